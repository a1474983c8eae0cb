"""What `explain` answers: where simulation and recording differ, what was left out, and what modelling it gains."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...framework.core.explanation import Estimate as Estimate
from ...framework.core.explanation import Missing as Missing
from ...framework.core.explanation import Verdict as Verdict
from ...framework.core.explanation import estimates_json
from ...framework.core.quantities import finite_or_none
from ...framework.core.sound_explanation import SoundFindings
from ..effects.stored import AugmentedSimulator
from ..mechanics.augmented import AugmentedWheel


@dataclass(frozen=True)
class Region:
    """Where a channel leaves the simulation: an interval of a variable.

    Where the variable is ``"constant"`` the interval is that of the channel's offset, where it is ``"lag_s"`` of its
    delay. `share` is what this variable adds there to those before it, of all that is reported; `p_value` is corrected
    for the number of tests; `mean` is the residual there in units of the channel's noise.
    """

    channel: str
    variable: str
    start: float
    end: float
    share: float
    p_value: float
    mean: float


@dataclass(frozen=True)
class Candidate:
    """A hypothesis that was fitted: an effect or a set of them.

    `evidence_nats` is ln of its evidence over the textbook wheel's, and `heldout_nats` its gain in log-likelihood on
    held-out blocks over the textbook wheel: NaN where its probability is below 1 %, and for what is unknown.
    """

    effect: str
    kind: str
    probability: float
    evidence_nats: float
    heldout_nats: float
    parameters: dict[str, Estimate]


@dataclass(frozen=True)
class Screened:
    """An effect that was not fitted: a score test gives it so few nats."""

    effect: str
    expected_nats: float


@dataclass(frozen=True)
class ChannelFit:
    """Root-mean-square error of a channel on held-out rows, without and with what was missing, and its noise, in SI.

    `before_interval` and `after_interval` are 95 % intervals from resampling blocks.
    """

    rmse_before: float
    rmse_after: float
    noise: float
    n: int
    before_interval: tuple[float, float]
    after_interval: tuple[float, float]


@dataclass(frozen=True)
class Rows:
    """The rows compared, for pictures: variables (each (n,)), measured, before and after (n, m), held out."""

    channels: tuple[str, ...]
    variables: dict[str, np.ndarray]
    measured: np.ndarray
    before: np.ndarray
    after: np.ndarray
    noise: np.ndarray


@dataclass(frozen=True)
class Explanation:
    """The answer.

    Parameters
    ----------
    source
        The recording.
    verdict
        ``"none"``: nothing beyond noise. ``"cannot_tell"``: something, whose possible causes the data do not separate.
    summary
        The answer in a few sentences.
    soil
        Soil with the missing physics in the model, by name, SI.
    soil_textbook
        Soil of the textbook wheel, for comparison.
    trust
        What to rely on: prediction, parameters.
    located, missing, candidates
        See their types.
    fits
        By channel.
    split
        How rows were held out.
    heldout_nats
        Gained by the best candidate, as `Candidate.heldout_nats`, with the scatter between blocks.
    notes
        What was left out of the comparison, in words.
    rows
        For pictures.
    simulator
        The textbook wheel with what was missing, its parameter vector `vector` (p,), and the vector's `covariance`
        (p, p).
    believed
        Probability of each of the simulator's effects, by slug.
    seconds
        Time taken.
    """

    source: str
    verdict: Verdict
    summary: str
    soil: dict[str, Estimate]
    soil_textbook: dict[str, Estimate]
    trust: str
    located: tuple[Region, ...]
    missing: tuple[Missing, ...]
    candidates: tuple[Candidate, ...]
    fits: dict[str, ChannelFit]
    split: str
    heldout_nats: Estimate
    notes: tuple[str, ...]
    rows: Rows
    simulator: AugmentedWheel
    vector: np.ndarray
    seconds: float
    sound: SoundFindings | None = None
    seed: int = 0
    n: int = field(default=0)
    covariance: np.ndarray | None = None
    believed: dict[str, float] = field(default_factory=dict)
    screened: tuple[Screened, ...] = ()

    @property
    def physics(self) -> AugmentedSimulator:
        """Soil and effects as found: to simulate and predict with, to save, to keep with a class of ground.

        The textbook wheel's soil alone where nothing was found. Each effect has its probability; where that is low,
        others fit as well. Standard deviations are conditional on the effects; those of `soil` and `missing` include
        the spread between probable sets. The discrepancy of something unknown is not part of it: it holds in the
        recording only.
        """
        return AugmentedSimulator.of(self.simulator, self.vector, self.covariance, self.believed)

    def to_json(self) -> dict:
        """Return the documented JSON (schema 1) of `bevameter explain --json`: SI units, None where a number is unknown.

        Rows, simulator and covariance are not part of it; `physics` has a `to_json` of its own.
        """
        return to_json(self)


def to_json(explanation: Explanation) -> dict:
    """Lay the answer out as the documented JSON (schema 1)."""
    answer = {
        "schema": 1,
        "verdict": explanation.verdict,
        "summary": explanation.summary,
        "n": explanation.n,
        "soil": estimates_json(explanation.soil),
        "soil_textbook": estimates_json(explanation.soil_textbook),
        "trust": explanation.trust,
        "located": [
            {
                "channel": region.channel, "variable": region.variable, "from": region.start, "to": region.end,
                "share": region.share, "p_value": region.p_value, "mean_residual_in_noise": region.mean,
            }
            for region in explanation.located
        ],
        "missing": [each.to_json() for each in explanation.missing],
        "candidates": [
            {
                "effect": each.effect, "kind": each.kind, "probability": each.probability,
                "evidence_nats": finite_or_none(each.evidence_nats), "heldout_nats": finite_or_none(each.heldout_nats),
                "parameters": estimates_json(each.parameters),
            }
            for each in explanation.candidates
        ],
        "screened": [
            {"effect": each.effect, "expected_nats": finite_or_none(each.expected_nats)}
            for each in explanation.screened
        ],
        "fit": {
            "split": explanation.split,
            "channels": {
                name: {
                    "rmse_before": finite_or_none(each.rmse_before), "rmse_after": finite_or_none(each.rmse_after),
                    "noise": finite_or_none(each.noise), "n": each.n,
                    "rmse_before_interval": list(each.before_interval),
                    "rmse_after_interval": list(each.after_interval),
                }
                for name, each in explanation.fits.items()
            },
            "heldout_nats_gained": {"value": explanation.heldout_nats.value, "sd": explanation.heldout_nats.sd},
        },
        "notes": list(explanation.notes),
        "seed": explanation.seed,
        "seconds": explanation.seconds,
    }  # fmt: skip
    if explanation.sound is not None:
        answer["sound"] = explanation.sound.to_json()
    return answer
