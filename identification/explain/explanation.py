"""Result of `explain`: where simulation and recording differ, which physics is missing, and what modelling it gains."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...framework.core.errors import InputError
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
    """An interval of a variable over which a channel differs from the simulation.

    For the variable ``"constant"`` it is an interval of the channel's offset, for ``"lag_s"`` of its delay. `share` is
    the share of this interval in the total gain of all that are reported; `p_value` is corrected for the number of
    tests; `mean` is the mean residual relative to the channel's noise.
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

    `evidence_nats` is the log Bayes factor over the textbook wheel, and `heldout_nats` the gain in log-likelihood on
    held-out blocks over the textbook wheel: NaN where its probability is below 5 %.
    """

    effect: str
    kind: str
    probability: float
    evidence_nats: float
    heldout_nats: float
    parameters: dict[str, Estimate]


@dataclass(frozen=True)
class Screened:
    """An effect that was not fitted because of its small expected gain by a score test."""

    effect: str
    expected_nats: float


@dataclass(frozen=True)
class ChannelFit:
    """Root-mean-square error of a channel on held-out rows, without and with the missing physics, and its noise, in SI.

    `before_interval` and `after_interval` are 95 % intervals from bootstrapping blocks.
    """

    rmse_before: float
    rmse_after: float
    noise: float
    n: int
    before_interval: tuple[float, float]
    after_interval: tuple[float, float]


@dataclass(frozen=True)
class Rows:
    """The rows compared: variables (each (n,)), measured, and predictions before and after (n, m), rows held out."""

    channels: tuple[str, ...]
    variables: dict[str, np.ndarray]
    measured: np.ndarray
    before: np.ndarray
    after: np.ndarray
    noise: np.ndarray


@dataclass(frozen=True)
class ExplainedGround:
    """A ground of the drive: its class (``""`` where not known), when the vehicle was on it [s], number of rows, and
    its soil with and without the missing physics.
    """

    class_name: str
    start_s: float
    end_s: float
    n: int
    soil: dict[str, Estimate]
    soil_textbook: dict[str, Estimate]


@dataclass(frozen=True)
class Explanation:
    """Result of `explain`.

    Parameters
    ----------
    source
        The recording.
    verdict
        ``"none"``: nothing beyond noise. ``"cannot_tell"``: something whose possible causes the data do not separate.
    summary
        The answer in a few sentences.
    grounds
        Grounds that were driven on.
    trust
        Reliability of prediction and parameters, in words.
    located, missing, candidates
        See their types.
    fits
        By channel.
    split
        How rows were held out, in words.
    heldout_nats
        Gain of the best candidate, as `Candidate.heldout_nats`, with its standard deviation between blocks.
    notes
        Remarks on the comparison and on rows left out.
    rows
        For plots.
    simulator
        The textbook wheel with the missing physics, its parameter vector `vector` (p,), and the vector's `covariance`
        (p, p).
    believed
        Probability of each of the simulator's effects, by slug.
    seconds
        Time taken.
    vehicle
        Name of the vehicle; empty if it has none.
    """

    source: str
    verdict: Verdict
    summary: str
    grounds: tuple[ExplainedGround, ...]
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
    vehicle: str = ""

    @property
    def soil(self) -> dict[str, Estimate]:
        """Soil with the missing physics in the model, by name, SI; empty where several grounds have one each."""
        return self.grounds[0].soil if len(self.grounds) == 1 else {}

    @property
    def soil_textbook(self) -> dict[str, Estimate]:
        """Soil of the textbook wheel, for comparison."""
        return self.grounds[0].soil_textbook if len(self.grounds) == 1 else {}

    def physics_of(self, ground: int = 0) -> AugmentedSimulator:
        """Soil of a ground, by number, and effects as fitted: to simulate and predict with, to save, to store.

        The textbook wheel's soil alone where nothing was found. Each effect has its probability; where that is low,
        others fit as well. Standard deviations are conditional on the effects; those of `soil` and `missing` include
        the variance between probable sets. A discrepancy is not part of it: it applies to the recording only.
        """
        return AugmentedSimulator.of(self.simulator, self.vector, self.covariance, self.believed, ground, self.vehicle)

    @property
    def physics(self) -> AugmentedSimulator:
        """Soil and effects of the only ground; raises `InputError` where there are several (`physics_of`)."""
        if len(self.grounds) > 1:
            raise InputError(self.source, f"{len(self.grounds)} grounds", expected="physics_of(number of a ground)")
        return self.physics_of()

    def to_json(self) -> dict:
        """Return the documented JSON (schema 1) of `bevameter explain --json`: SI units, None for unknown numbers.

        Rows, simulator and covariance are not part of it; `physics` has a `to_json` of its own.
        """
        return to_json(self)


def to_json(explanation: Explanation) -> dict:
    """Convert the result to the documented JSON (schema 1)."""
    answer = {
        "schema": 1,
        "verdict": explanation.verdict,
        "summary": explanation.summary,
        "n": explanation.n,
        "soil": estimates_json(explanation.soil),
        "soil_textbook": estimates_json(explanation.soil_textbook),
        "grounds": [
            {
                "class": each.class_name or None, "start_s": finite_or_none(each.start_s),
                "end_s": finite_or_none(each.end_s), "n": each.n, "soil": estimates_json(each.soil),
                "soil_textbook": estimates_json(each.soil_textbook),
            }
            for each in explanation.grounds
        ],
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
