"""A database for the tests of the pages: three drives at a quarry, one elsewhere."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from bevameter import ClassEvidence, SoilEstimate, TerrainDatabase
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.framework.core.soil import Quantity

CLASSES = ("asphalt", "sand")
START = datetime(2026, 3, 1, 9, tzinfo=UTC)


def quantity(value: float, sd: float) -> Quantity:
    return Quantity(value, sd, value - 1.96 * sd, value + 1.96 * sd)


def stretch(start_s: float, c_Pa: float, phi_deg: float, gate: str = "") -> SoilObservation:
    """Sand, measured from x = start_s / 10 on; or not, and why."""
    phi = math.radians(phi_deg)
    rest = {"k_m": quantity(0.02, 0.001), "stiffness_Pa": quantity(5e5, 2e4), "n": quantity(1.0, 0.02)}
    estimate = SoilEstimate(
        {"c_Pa": quantity(c_Pa, 60.0), "phi_rad": quantity(phi, 0.01), **rest},
        np.array([c_Pa, math.tan(phi)]), np.diag([60.0**2, 0.01**2]), {}, (), {}, "", "ml", ("load_N",), 50, 1.0,
    )  # fmt: skip
    place = start_s / 10.0, 0.25
    return SoilObservation(
        start_s, start_s + 8.0, *place, {"sand": 0.99, "asphalt": 0.01}, None if gate else estimate, (5e3, 3e4), 80.0,
        gate_reason=gate,
    )  # fmt: skip


def a_drive(number: int, site: str = "quarry", soils: tuple[SoilObservation, ...] = ()) -> Drive:
    """Ten by four cells of half a metre: sand, asphalt in the top row, and one in the corner that is too dark."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(10), np.arange(4)))
    sand = np.where(y == 3, 0.02, 0.98)
    dark = (x == 9) & (y == 0)
    evidence = ClassEvidence(
        CLASSES, np.column_stack([1.0 - sand, sand]), np.full(40, 0.9), dark,
        tuple(("camera: too <dark>",) if each else () for each in dark),
    )  # fmt: skip
    terrain = TerrainObservations(0.5, x, y, x + 0.25, np.full(40, "fused"), evidence)
    return Drive(
        f"digest {number}", f"drive {number}", site, "rover", START + timedelta(days=number), {"camera": "abcdef0123"},
        "m", terrain, soils,
    )  # fmt: skip


@pytest.fixture(scope="session")
def path(tmp_path_factory) -> Path:
    """The database's file."""
    path = tmp_path_factory.mktemp("view") / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(a_drive(1, soils=(stretch(0.0, 800.0, 29.0), stretch(10.0, 0.0, 0.0, "in the rut"))))
        database.add_drive(a_drive(2, soils=(stretch(0.0, 900.0, 30.0), stretch(20.0, 850.0, 31.0))))
        database.add_drive(a_drive(3))
        database.add_drive(a_drive(4, site="beach <1>"))
    return path


@pytest.fixture
def database(path):
    with TerrainDatabase(path, must_exist=True) as database:
        yield database


@pytest.fixture
def drive():
    """Makes drives at the quarry: of a number, with stretches on classes."""

    def make(number: int, measured: tuple[str, ...] = ()) -> Drive:
        return a_drive(number, soils=tuple(stretch(0.0, 800.0 + 5.0 * number, 30.0) for _ in measured))

    return make
