"""The planner's view of a site while a vehicle drives there: what is stored, and what the drive has seen by now."""

from __future__ import annotations

import numpy as np

from ...database.observations import Drive, SoilObservation, TerrainObservations
from ...database.posterior import class_soils
from ...database.snapshot import Snapshot
from ...database.store import TerrainDatabase
from ..core.evidence import ClassEvidence
from ..fusion import Belief


class SiteByNow:
    """Snapshots of a site that each take up only what came since the last.

    Parameters
    ----------
    database
        The terrain database; read once.
    drive
        The drive, without observations.
    classes
        Names that the senses may give.
    """

    def __init__(self, database: TerrainDatabase, drive: Drive, classes: tuple[str, ...]):
        stored, physics = [], {}
        if database.there and drive.site in database.sites():
            stored = database.drives(drive.site, newest=True)
            physics = database.snapshot(drive.site).physics
        self._stored, self._drive, self._classes = stored, drive, classes
        self.snapshot = Snapshot.derive(drive.site, [*stored, self._seen(_nothing(classes))], physics)

    def _seen(self, belief: Belief) -> Drive:
        """Give the drive as if it had seen only some cells."""
        looked = np.flatnonzero(np.isfinite(belief.last_seen_s))
        own = self._drive
        size = own.terrain.cell_size_m
        x, y = belief.cells[looked].T
        evidence = _over(belief.select(looked), self._classes)
        terrain = TerrainObservations(size, x, y, belief.last_seen_s[looked], np.full(len(looked), "fused"), evidence)
        return Drive(
            own.recording_digest, own.name, own.site, own.vehicle_name, own.start_time, own.models, own.method, terrain,
            (), own.origin, own.offset,
        )  # fmt: skip

    def take_up(self, belief: Belief, soils: tuple[SoilObservation, ...] = ()) -> Snapshot:
        """Give the snapshot in which cells are as they are believed to be now; other cells stay as they were.

        Parameters
        ----------
        belief
            Of the cells that were seen.
        soils
            All that the drive has measured by now; none where that is what it was the last time.
        """
        seen = self._seen(belief)
        if len(seen.terrain):
            self.snapshot = self.snapshot.with_drives([*self._stored, seen], [seen], dict(self.snapshot.physics))
        if soils:
            own = self.snapshot
            known = class_soils([each for drive in self._stored for each in drive.soils] + list(soils))
            drives = [*self._stored, self._drive]
            self.snapshot = Snapshot.of(
                own.site, own.cell_size_m, own.class_names, own.cells, known, drives, own.physics
            )  # fmt: skip
        return self.snapshot


def _nothing(classes: tuple[str, ...]) -> Belief:
    none = ClassEvidence.nothing(classes, [])
    empty = np.empty((0, 2), dtype=np.int64)
    return Belief(
        none.classes, none.probabilities, none.quality, none.unknown, none.reasons, empty, {}, {}, {}, np.empty(0)
    )


def _over(evidence: ClassEvidence, classes: tuple[str, ...]) -> ClassEvidence:
    """Give evidence over more classes, of which it says nothing."""
    probabilities = np.zeros((len(evidence), len(classes)))
    probabilities[:, [classes.index(name) for name in evidence.classes]] = evidence.probabilities
    if len(classes):
        probabilities[evidence.unknown] = 1.0 / len(classes)
    return ClassEvidence(classes, probabilities, evidence.quality, evidence.unknown, evidence.reasons)
