"""What the pages show of one site: its snapshot and the drives behind it, read again as the database grows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from ...database.belief import cells_on_grid
from ...database.observations import Drive, SoilObservation
from ...database.posterior import ClassSoil, class_soils, measured_class
from ...database.reader import SiteReader
from ...database.snapshot import Snapshot
from ...database.store import TerrainDatabase
from ..core.pooling import cells_from_keys

MOST_STEPS = 20
"""Most steps in which a class is shown to become known."""


@dataclass(frozen=True)
class Look:
    """What one drive saw of a cell at one time.

    Parameters
    ----------
    drive
        The drive.
    time_s
        On the recording's clock [s].
    probabilities
        By class [-]; empty where it recognised nothing.
    quality
        In [0, 1].
    reasons
        What was said of it, such as why it recognised nothing.
    """

    drive: Drive
    time_s: float
    probabilities: Mapping[str, float]
    quality: float
    reasons: tuple[str, ...]

    @property
    def when(self) -> datetime | None:
        """In UTC; None where nobody knows when the recording began."""
        start = self.drive.started
        return None if start is None else datetime.fromtimestamp(start.timestamp() + self.time_s, UTC)


class Site:
    """One site of a database, as it was when it was read.

    Parameters
    ----------
    database
        The database.
    snapshot
        What is known of the site.
    drives
        The drives that it rests on, with their fused looks.
    """

    def __init__(self, database: TerrainDatabase, snapshot: Snapshot, drives: Sequence[Drive]) -> None:
        self.database, self.snapshot = database, snapshot
        early = datetime.min.replace(tzinfo=UTC)
        # In order of time; those of which nobody knows when they were come first, as imported.
        self.drives = sorted(drives, key=lambda drive: drive.started or early)
        columns, rows = cells_from_keys(snapshot.cells.key).T
        self.columns, self.rows = np.ascontiguousarray(columns), np.ascontiguousarray(rows)

    @staticmethod
    def read(database: TerrainDatabase, reader: SiteReader, known: Site | None = None) -> Site:
        """Read a site; the known one again where nothing is new. Raises `InputError` where it cannot be read."""
        snapshot = reader.snapshot()
        return known if known is not None and known.snapshot is snapshot else Site(database, snapshot, reader.drives)

    @property
    def name(self) -> str:
        """Its name."""
        return self.snapshot.site

    @property
    def synthetic(self) -> bool:
        """Whether any drive is of a synthetic world."""
        return any(drive.synthetic for drive in self.drives)

    def cell_at(self, x: float, y: float) -> tuple[int, int]:
        """Give column and row of the cell that a place [m] lies in."""
        size = self.snapshot.cell_size_m
        return int(np.floor(x / size)), int(np.floor(y / size))

    def centre_of(self, cell: tuple[int, int]) -> tuple[float, float]:
        """Give the centre of a cell [m]."""
        size = self.snapshot.cell_size_m
        return (cell[0] + 0.5) * size, (cell[1] + 0.5) * size

    def nearest(self, x: float, y: float) -> tuple[int, int] | None:
        """Give the seen cell nearest to a place [m]; None where no cell was seen."""
        if not len(self.columns):
            return None
        size = self.snapshot.cell_size_m
        best = int(np.argmin(np.hypot(self.columns + 0.5 - x / size, self.rows + 0.5 - y / size)))
        return int(self.columns[best]), int(self.rows[best])

    def looks_at(self, cell: tuple[int, int]) -> list[Look]:
        """Give the fused looks behind a cell, newest drive first."""
        found: list[Look] = []
        for drive in reversed(self.drives):
            found += _looks(drive, cell, self.snapshot.cell_size_m)
        return found

    def soil_history(self) -> dict[str, list[tuple[Drive, ClassSoil]]]:
        """Give by class what was known of its soil after each drive that measured it, in order of time.

        Of more than `MOST_STEPS` drives some are left out, evenly, and neither the first nor the last.
        """
        measured: dict[str, list[tuple[Drive, list[SoilObservation]]]] = {}
        for drive in self.drives:
            own: dict[str, list[SoilObservation]] = {}
            for soil in drive.soils:
                if (name := measured_class(soil)) is not None:
                    own.setdefault(name, []).append(soil)
            for name, soils in own.items():
                measured.setdefault(name, []).append((drive, soils))
        history: dict[str, list[tuple[Drive, ClassSoil]]] = {}
        for name, steps in measured.items():
            last = len(steps) - 1
            for step in np.unique(np.linspace(0, last, min(len(steps), MOST_STEPS)).astype(int)).tolist():
                soils = [soil for _, some in steps[: step + 1] for soil in some]
                history.setdefault(name, []).append((steps[step][0], class_soils(soils)[name]))
        return history


def _looks(drive: Drive, cell: tuple[int, int], size_m: float) -> Iterator[Look]:
    terrain, evidence = drive.terrain, drive.terrain.evidence
    if terrain.cell_size_m == size_m:
        here = (terrain.cell_x == cell[0]) & (terrain.cell_y == cell[1])
    else:  # on a finer grid of its own
        here = (cells_on_grid(terrain.cell_x, terrain.cell_y, terrain.cell_size_m, size_m) == cell).all(axis=1)
    for row in np.flatnonzero(here).tolist():
        belief = dict(zip(evidence.classes, evidence.probabilities[row].tolist(), strict=True))
        yield Look(
            drive, float(terrain.time_s[row]), {} if evidence.unknown[row] else belief, float(evidence.quality[row]),
            evidence.reasons[row],
        )  # fmt: skip
