"""A slow drive on known soils, as a recording of one wheel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bevameter import Recording, Vehicle, Wheel, WheelTable
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
VEHICLE = Vehicle(wheels=(WHEEL,), noise={"load_N": 1.0, "torque_Nm": 0.1, "sinkage_m": 2e-4, "slip": 0.005})
SAND = Soil(c_Pa=300.0, phi_rad=np.radians(31.0), k_m=0.012, stiffness_Pa=9e4, n=0.9)
CLAY = Soil(c_Pa=4e3, phi_rad=np.radians(15.0), k_m=0.008, stiffness_Pa=2e5, n=0.7)


def drive(rng, soils=(SAND,), stretch_s=30.0, speed=0.15) -> WheelTable:
    """Slow stretches of `stretch_s` on each soil, 10 Hz, load and slip varying."""
    time_s = np.arange(int(10 * stretch_s) * len(soils)) / 10.0
    load = 110.0 + 45.0 * np.sin(time_s / 2.0)
    slip = 0.3 + 0.2 * np.sin(time_s / 1.3)
    sinkage, torque = np.empty_like(load), np.empty_like(load)
    for part, soil in zip(np.array_split(np.arange(len(load)), len(soils)), soils, strict=True):
        state = equilibrium(WHEEL, soil, load[part], slip[part])
        sinkage[part], torque[part] = state.sinkage_m, state.torque_Nm
    channels = {"load_N": load, "torque_Nm": torque, "sinkage_m": sinkage, "slip": slip}
    noisy = {name: values + VEHICLE.noise[name] * rng.normal(size=len(values)) for name, values in channels.items()}
    speeds = {"travel_speed_m_s": np.full(len(load), speed)}
    return WheelTable({"time_s": time_s, **noisy, **speeds}, None, None, Path("wheel.csv"))


def recording(table: WheelTable, vehicle: Vehicle | None = VEHICLE) -> Recording:
    return Recording("test", Path("wheel.csv"), vehicle, None, "", "0" * 64, wheel=table)


def with_columns(table: WheelTable, **columns) -> WheelTable:
    return WheelTable({**table.columns, **columns}, table.wheel, table.run, table.source)
