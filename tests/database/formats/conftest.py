"""A snapshot and a raster of it, for the tests of all formats."""

from __future__ import annotations

import pytest
from bevameter.database.grid import Grid
from bevameter.database.snapshot import Snapshot


@pytest.fixture
def view(drive_with_soil) -> Snapshot:
    """Cells of 0.5 m: sand (0, 0), clay (1, 0), not recognised (2, 0), asphalt without soil (-3, -2)."""
    return Snapshot.derive("quarry", [drive_with_soil])


@pytest.fixture
def grid(view) -> Grid:
    """Five rows and eight columns of all layers."""
    return view.grid((-2.0, -1.5, 2.0, 1.0), 0.5, now=2e9)
