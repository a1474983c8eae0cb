"""Steady trials of a textbook wheel, as a laboratory tabulates them."""

from __future__ import annotations

import numpy as np
import pandas as pd
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium

WHEEL = Wheel(name="wheel", radius_m=0.15, width_m=0.1)
SAND = Soil(c_Pa=800.0, phi_rad=np.radians(30.0), k_m=0.012, stiffness_Pa=1.2e5, n=1.0)
LOAM = Soil(c_Pa=4000.0, phi_rad=np.radians(22.0), k_m=0.02, stiffness_Pa=2.5e5, n=0.7)
VEHICLE = "[wheel]\nradius_m = 0.15\nwidth_m = 0.1\n"
"""Its vehicle file."""


def trials(soil=SAND, *, loads=(60.0, 100.0, 150.0, 200.0), slips=(0.05, 0.1, 0.2, 0.3, 0.4, 0.6), noise=0.01, seed=0):
    """Give the table of trials at each load [N] and slip, read with relative noise: a DataFrame."""
    rng = np.random.default_rng(seed)
    load, slip = (each.ravel() for each in np.meshgrid(loads, slips, indexing="ij"))
    found = equilibrium(WHEEL, soil, load, slip)

    def read(values, size=0.0):
        return values + noise * (np.abs(values) + size) * rng.standard_normal(len(values))

    return pd.DataFrame({
        "Fz [N]": read(load), "DP [N]": read(found.drawbar_pull_N, 20.0), "T [Nm]": read(found.torque_Nm),
        "Slip [%]": read(100.0 * slip), "Sinkage [mm]": read(1e3 * found.sinkage_m),
    }).round(3)  # fmt: skip
