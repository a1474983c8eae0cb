"""A drive over three cells of ground, for the tests of commands on the database."""

from __future__ import annotations

import numpy as np
from bevameter import ClassEvidence, SoilEstimate
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.framework.core.soil import Quantity


def some_drive(site: str = "quarry", misfit: float = 1.0) -> Drive:
    """Sand with soil at cell (0, 0), asphalt without at (1, 0), something dark at (-7, 4)."""
    evidence = ClassEvidence(
        ("asphalt", "sand"), np.array([[0.0, 1.0], [1.0, 0.0], [0.5, 0.5]]), np.ones(3), np.array([False, False, True]),
        ((), (), ("too dark",)),
    )  # fmt: skip
    terrain = TerrainObservations(
        0.5, np.array([0, 1, -7]), np.array([0, 0, 4]), np.zeros(3), np.full(3, "fused"), evidence
    )
    names = {"c_Pa": 800.0, "phi_rad": 0.5, "k_m": 0.02, "stiffness_Pa": 5e5, "n": 1.0}
    estimate = SoilEstimate(
        {name: Quantity(value, 0.02 * value, value, value) for name, value in names.items()},
        np.array([800.0, 0.55]), np.diag([20.0**2, 0.01**2]), {}, (), {}, "", "ml", ("load_N",), 50, misfit,
    )  # fmt: skip
    soils = tuple(SoilObservation(i, i + 1, 0, 0, {"sand": 1.0}, estimate, (5e3, 3e4), 80.0) for i in range(6))
    return Drive(f"digest of {site}", "drive", site, "rover", None, {}, "m", terrain, soils)
