"""What a drive brings home: the frozen types that go into the terrain database.

Ground is observed on a grid of square cells in the site's own frame: cell (i, j) of size s covers
``[i s, (i + 1) s) x [j s, (j + 1) s)``; `framework.core.pooling.cells_of` turns places into cells.
"""

from __future__ import annotations

import hashlib
import json
import math
import uuid
from collections.abc import Mapping
from dataclasses import astuple, dataclass, field
from datetime import UTC, datetime
from functools import cached_property

import numpy as np

from ..framework.core.evidence import ClassEvidence
from ..framework.core.origin import Offset, Origin
from ..framework.core.pooling import LARGEST_CELL_INDEX
from ..framework.core.soil import SoilEstimate

SENSES = ("camera", "microphone", "fused")
"""Who saw it: one sense, or the belief fused from all of them."""

_NAMESPACE = uuid.UUID("6f2b1c1e-6f0b-5d0c-9a43-5b1d8c3f7a10")


@dataclass(frozen=True)
class TerrainObservations:
    """Class probabilities of m ground cells, each seen by one sense (or fused) at one time.

    Parameters
    ----------
    cell_size_m
        Edge of a cell [m].
    cell_x, cell_y : (m,) int
        Cell indices (`framework.core.pooling.cells_of`).
    time_s : (m,)
        Time on the recording's clock [s].
    sense : (m,) str
        One of `SENSES` each.
    evidence
        m items: classes, probabilities (m, k), quality, unknown flags and reasons.
    """

    cell_size_m: float
    cell_x: np.ndarray
    cell_y: np.ndarray
    time_s: np.ndarray
    sense: np.ndarray
    evidence: ClassEvidence

    def __post_init__(self) -> None:
        m = len(self.evidence)
        if not (math.isfinite(self.cell_size_m) and self.cell_size_m > 0):
            raise ValueError(f"cell_size_m must be positive and finite, got {self.cell_size_m!r}")
        for name in ("cell_x", "cell_y", "time_s", "sense"):
            if np.shape(getattr(self, name)) != (m,):
                raise ValueError(f"{name} must have shape ({m},), got {np.shape(getattr(self, name))}")
        if len(set(self.evidence.classes)) != len(self.evidence.classes):
            raise ValueError("class names are not distinct")
        strange = set(np.unique(np.asarray(self.sense, dtype=str)).tolist()) - set(SENSES)
        if strange:
            raise ValueError(f"sense {sorted(strange)[0]!r} is none of {', '.join(SENSES)}")
        for name in ("cell_x", "cell_y"):
            cells = np.asarray(getattr(self, name))
            if cells.dtype.kind not in "iu" or (
                m and not -LARGEST_CELL_INDEX <= int(cells.min()) <= int(cells.max()) <= LARGEST_CELL_INDEX
            ):
                raise ValueError(f"{name} must be whole numbers within +-{LARGEST_CELL_INDEX}")
        sums = np.sum(self.evidence.probabilities, axis=1)
        within = np.all((self.evidence.probabilities >= 0) & (self.evidence.probabilities <= 1), axis=1)
        if not (np.all(within) and np.all(np.abs(sums - 1.0) < 1e-3) and np.all(np.isfinite(self.time_s))):
            raise ValueError("probabilities must lie in [0, 1] and sum to one, times must be finite")
        if not np.all((self.evidence.quality >= 0) & (self.evidence.quality <= 1)):
            raise ValueError("quality must lie in [0, 1]")

    def __len__(self) -> int:
        return len(self.evidence)

    @staticmethod
    def nothing(cell_size_m: float = 1.0) -> TerrainObservations:
        """No cell at all: a drive whose senses saw nothing."""
        none = np.zeros(0, dtype=np.int64)
        evidence = ClassEvidence((), np.zeros((0, 0)), np.zeros(0), np.zeros(0, dtype=bool), ())
        return TerrainObservations(cell_size_m, none, none, np.zeros(0), np.zeros(0, dtype=str), evidence)


@dataclass(frozen=True)
class SoilEffect:
    """An effect beyond the textbook that acts on a stretch: its slug and its parameters by name, SI."""

    slug: str
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SoilObservation:
    """The soil that the wheels measured on one stretch of a drive.

    Parameters
    ----------
    start_s, end_s
        The stretch on the recording's clock [s].
    x_m, y_m
        Its mean place in the site's frame [m]; NaN where the recording holds no places.
    class_probabilities
        Fused belief over classes along the stretch [-]; empty where no sense recognised it, and then the stretch
        counts for no class.
    estimate
        What was estimated; None where the gate closed (then `gate_reason` says why).
    normal_stress_Pa
        Least and greatest normal stress driven [Pa].
    load_N
        Mean vertical load on one wheel [N].
    effects
        Effects beyond the textbook, known before, that were subtracted from what the wheels measured.
    gate_reason
        Why the stretch may not be used; empty where it may.
    """

    start_s: float
    end_s: float
    x_m: float
    y_m: float
    class_probabilities: Mapping[str, float]
    estimate: SoilEstimate | None
    normal_stress_Pa: tuple[float, float]
    load_N: float
    effects: tuple[SoilEffect, ...] = ()
    gate_reason: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start_s) and math.isfinite(self.end_s) and self.end_s >= self.start_s):
            raise ValueError(f"a stretch from {self.start_s!r} to {self.end_s!r} s is none")
        values = list(self.class_probabilities.values())
        if values and not (all(0 <= value <= 1 for value in values) and sum(values) <= 1 + 1e-3):
            raise ValueError("class probabilities must lie in [0, 1] and sum to one at most")
        if self.estimate is None and not self.gate_reason:
            raise ValueError("a stretch without an estimate needs the reason why")


@dataclass(frozen=True)
class Drive:
    """One recording, processed once with certain models: what `TerrainDatabase.add_drive` stores.

    The same recording processed again with the same models and method is the same drive (`Drive.id`) and adds
    nothing. Processed with other models or another method it is another drive of the same recording: both are kept,
    and what is derived uses the newest one.

    Parameters
    ----------
    recording_digest
        `Recording.digest`.
    name
        Name of the recording, for people.
    site
        Name of the site whose frame all places are in: places of two sites never mix.
    vehicle_name
        The vehicle's name.
    start_time
        When second 0 of the recording's clock was; None where nobody knows, and then ages are unknown. A time
        without a zone is taken as UTC.
    models
        Version of the model by sense.
    method
        Version of everything else that shapes the result: code, settings, the vehicle's description.
    terrain, soils
        What was observed.
    origin
        Where on Earth the site's frame lies; None where nobody knows.
    offset
        Where the recording's frame lies in the site's; None where they are one.
    """

    recording_digest: str
    name: str
    site: str
    vehicle_name: str
    start_time: datetime | None
    models: Mapping[str, str]
    method: str
    terrain: TerrainObservations
    soils: tuple[SoilObservation, ...] = ()
    origin: Origin | None = None
    offset: Offset | None = None

    @property
    def started(self) -> datetime | None:
        """`start_time` in UTC."""
        if self.start_time is None or self.start_time.tzinfo is not None:
            return self.start_time and self.start_time.astimezone(UTC)
        return self.start_time.replace(tzinfo=UTC)

    @property
    def synthetic(self) -> bool:
        """Whether it is of a synthetic world: its site calls itself so, or a model knows no other."""
        return "synthetic" in self.site.lower() or any(
            version.startswith("synthetic") for version in self.models.values()
        )

    @cached_property
    def id(self) -> uuid.UUID:
        """The drive's identity: UUID 5 of the recording's digest and of all that shapes what was made of it.

        Nothing that was observed enters it: `Drive` without observations has the same, and so a drive can be looked
        for before it is processed.
        """
        started = self.started
        key = [
            self.recording_digest,
            self.site,
            self.vehicle_name,
            None if started is None else started.isoformat(),
            sorted(self.models.items()),
            self.method,
            float(self.terrain.cell_size_m),
        ]
        if self.origin is not None or self.offset is not None:
            key += [each and list(map(float, astuple(each))) for each in (self.origin, self.offset)]
        return uuid.uuid5(_NAMESPACE, json.dumps(key, ensure_ascii=True, separators=(",", ":")))

    def row_ids(self, kind: str, count: int) -> list[uuid.UUID]:
        """The identities of its observations: UUID 5 of the drive, the kind and the index within the drive."""
        drive = hashlib.sha1(self.id.bytes, usedforsecurity=False)
        answer = []
        for index in range(count):
            each = drive.copy()  # as `uuid.uuid5`, without hashing the drive again
            each.update(f"{kind}/{index}".encode())
            answer.append(uuid.UUID(bytes=each.digest()[:16], version=5))
        return answer
