"""What a run over a recording found, in figures that a program and a person can read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..database.observations import SoilObservation
from ..identification.estimate.words import sentences
from .core.evidence import ClassEvidence
from .core.findings import Finding
from .core.origin import Offset, Origin
from .core.soil import Quantity, SoilEstimate
from .fusion import Belief
from .sense_map import SenseRecord

_REASONS_KEPT = 12


@dataclass(frozen=True)
class SenseSummary:
    """How one sense did.

    Parameters
    ----------
    sense
        Its name.
    absent
        Why it was not there; empty where it was.
    items
        Looks at a ground cell (camera) or windows of sound (microphone).
    trusted_share
        Share of them whose gate was open [-].
    mean_quality
        Mean quality of those [-].
    said
        Share of those by class [-].
    closed, doubted
        How many items were closed, or open with a reservation, by reason, the most frequent first.
    cells
        Ground cells it voted on.
    cells_led
        Those of them in which no sense had more weight.
    effective_looks
        Mean number of independent looks that its looks at a cell were worth [-].
    model
        Where its model is from.
    model_version
        SHA-256 of the model.
    synthetic_model
        Does the model know synthetic ground only?
    """

    sense: str
    absent: str
    items: int
    trusted_share: float
    mean_quality: float
    said: Mapping[str, float]
    closed: Mapping[str, int]
    doubted: Mapping[str, int]
    cells: int
    cells_led: int
    effective_looks: float
    model: str
    model_version: str
    synthetic_model: bool


@dataclass(frozen=True)
class Agreement:
    """Length of track on which a sense, or all together, named the class of the labels, another, or none [m]."""

    sense: str
    right_m: float
    wrong_m: float
    unknown_m: float


@dataclass(frozen=True)
class LearntSoil:
    """The soil that was learnt on one stretch.

    Parameters
    ----------
    class_name
        The most probable class; None where no sense recognised it.
    class_probability
        Its probability [-].
    start_s, end_s
        The stretch [s].
    n
        Samples used.
    parameters
        By name, each with its 95 % interval.
    separable
        By parameter: do the data determine it?
    advice
        What driving would determine what these data do not.
    misfit
        Root of the mean squared residual in units of the sensors' noise [-].
    problems
        What is to be minded in using the estimate, such as a model that does not fit.
    findings
        The same as data.
    effects
        Known effects (slugs) that were subtracted from the wheel channels.
    """

    class_name: str | None
    class_probability: float
    start_s: float
    end_s: float
    n: int
    parameters: Mapping[str, Quantity]
    separable: Mapping[str, bool]
    advice: str
    misfit: float
    problems: tuple[str, ...]
    findings: tuple[Finding, ...]
    effects: tuple[str, ...] = ()

    @staticmethod
    def of(estimate: SoilEstimate, observed: SoilObservation) -> LearntSoil:
        """Sum up the observation of a stretch that has an estimate."""
        belief = observed.class_probabilities
        best = max(belief, key=lambda name: belief[name]) if belief else None
        return LearntSoil(
            class_name=best,
            class_probability=belief[best] if best is not None else 0.0,
            start_s=observed.start_s,
            end_s=observed.end_s,
            n=estimate.n,
            parameters=dict(estimate.parameters),
            separable=dict(estimate.separable),
            advice=estimate.advice,
            misfit=estimate.misfit,
            problems=sentences(estimate.findings),
            findings=estimate.findings,
            effects=tuple(effect.slug for effect in observed.effects),
        )


@dataclass(frozen=True)
class TraverseSummary:
    """What a run found.

    Parameters
    ----------
    recording, source, digest, site, vehicle, database
        What was read, and where the result went.
    synthetic
        Does the recording say of itself that it is synthetic?
    duration_s, distance_m
        Length of the drive [s], [m]; 0 where the recording holds no places.
    places
        What the places come from: ``"recorded"``, ``"dead reckoning"``, or empty.
    cell_size_m
        Edge of a ground cell [m].
    known
        Did the database hold this drive already, so that nothing was processed? Then `track_m` and `senses` are empty.
    cells
        Ground cells by class, ``"unknown"`` included.
    track_m
        Length of track by class [m], ``"unknown"`` included.
    contradictions
        Cells at which the senses contradicted each other.
    senses
        Camera and microphone.
    soils
        What was learnt of the soil, stretch by stretch.
    closed_s
        For how long the wheels could not be used for soil, by reason [s].
    used_s
        For how long they were [s].
    observations_new, observations_known
        What the database had not, and had, before.
    problems
        What of the recording could not be read or used.
    warnings
        What to mind in using the result.
    seconds
        How long the run took [s].
    notes
        What was converted or assumed in reading the recording.
    origin, offset
        Where on Earth the site's frame lies, and where the recording's lies in it; None where nobody knows, and where
        they are one.
    agreement
        How each sense, and last all together, agree with the recording's labels; empty without such.
    """

    recording: str
    source: str
    digest: str
    site: str
    vehicle: str
    database: str
    synthetic: bool
    duration_s: float
    distance_m: float
    places: str
    cell_size_m: float
    known: bool
    cells: Mapping[str, int]
    track_m: Mapping[str, float]
    contradictions: int
    senses: tuple[SenseSummary, ...]
    soils: tuple[LearntSoil, ...]
    closed_s: Mapping[str, float]
    used_s: float
    observations_new: int
    observations_known: int
    problems: tuple[str, ...]
    warnings: tuple[str, ...]
    seconds: float
    notes: tuple[str, ...] = ()
    origin: Origin | None = None
    offset: Offset | None = None
    agreement: tuple[Agreement, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Give the summary as plain tables and numbers, as `bevameter run --json` writes it."""
        return {"schema": 1, **asdict(self)}


def sense_summary(
    record: SenseRecord, belief: Belief, *, model: str, model_version: str, synthetic_model: bool
) -> SenseSummary:
    """Sum up how one sense did."""
    weight = belief.sense_weights.get(record.sense, np.zeros(len(belief)))
    strongest = np.max([*belief.sense_weights.values(), np.zeros(len(belief))], axis=0)
    voted = weight > 0
    looks = belief.effective_looks.get(record.sense, np.zeros(len(belief)))
    opened = max(record.opened, 1)
    return SenseSummary(
        sense=record.sense,
        absent=record.absent,
        items=record.items,
        trusted_share=record.opened / max(record.items, 1),
        mean_quality=record.quality_sum / opened,
        said={name: count / opened for name, count in record.said.most_common()},
        closed=dict(record.closed.most_common(_REASONS_KEPT)),
        doubted=dict(record.doubted.most_common(_REASONS_KEPT)),
        cells=int(voted.sum()),
        cells_led=int((voted & (weight >= strongest)).sum()),
        effective_looks=float(looks[voted].mean()) if voted.any() else 0.0,
        model=model,
        model_version=model_version,
        synthetic_model=synthetic_model,
    )


def count_cells(belief: ClassEvidence) -> dict[str, int]:
    """Count ground cells by class, the most frequent first."""
    return dict(Counter(belief.labels()).most_common())


def count_contradictions(belief: ClassEvidence) -> int:
    """Count the cells at which the senses contradict each other."""
    return sum(bool(texts) for texts, unknown in zip(belief.reasons, belief.unknown, strict=True) if not unknown)
