"""A folder as `make demo` leaves it, small: ground whose soil is known and ground whose soil is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bevameter import ClassEvidence, SoilEstimate, TerrainDatabase
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.framework.core.soil import Quantity


def write_terrain(path: Path) -> None:
    """Write a database of ten metres of sand with soil and five of grass without, along x = 0."""
    cell_y = np.arange(60)
    evidence = ClassEvidence(
        ("grass", "sand"),
        np.where((cell_y < 40)[:, None], [0.01, 0.99], [0.97, 0.03]),
        np.ones(60),
        np.zeros(60, bool),
        ((),) * 60,
    )
    ground = TerrainObservations(0.25, np.zeros(60, int), cell_y, np.arange(60.0), np.full(60, "fused"), evidence)
    mean, covariance = np.array([900.0, 0.6]), np.diag([80.0**2, 0.02**2])
    values = {"c_Pa": (900.0, 80.0), "phi_rad": (0.54, 0.015), "k_m": (0.02, 0.002), "stiffness_Pa": (2e5, 1e4),
              "n": (1.0, 0.03)}  # fmt: skip
    parameters = {name: Quantity(v, sd, v - 1.96 * sd, v + 1.96 * sd) for name, (v, sd) in values.items()}
    estimate = SoilEstimate(
        parameters, mean, covariance, {}, (), dict.fromkeys(values, True), "", "ml", ("load_N",), 300, 1.0
    )
    soils = tuple(
        SoilObservation(10.0 * i, 10.0 * i + 9.0, 0.0, 1.0 + 2.0 * i, {"sand": 1.0}, estimate, (5e3, 3e4), 400.0)
        for i in range(4)
    )
    with TerrainDatabase(path) as database:
        database.add_drive(Drive("d1", "a drive", "pit", "rover", None, {}, "method", ground, soils))
