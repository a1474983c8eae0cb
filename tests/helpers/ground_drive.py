"""A slow drive over several grounds, by mechanics that share nothing with the simulator that is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from bevameter.framework.core.recording.types import Labels, Pose, Recording, WheelTable
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.framework.scenario.mechanics import Soil, equilibrium

SAND = Soil(c_Pa=900.0, phi_rad=0.5, k_m=0.015, stiffness_Pa=2.5e5, n=1.05)
LOAM = Soil(c_Pa=2200.0, phi_rad=0.5, k_m=0.022, stiffness_Pa=4.2e5, n=0.7)
CLAY = Soil(c_Pa=4000.0, phi_rad=0.24, k_m=0.011, stiffness_Pa=3e5, n=0.8)

NOISE = {"load_N": 5.0, "torque_Nm": 1.0, "sinkage_m": 5e-4, "drawbar_pull_N": 6.0, "slip": 0.005}
SPEED_M_S = 0.2


def simulation(drive: Recording, grounds: Mapping[str, Soil], path: Path) -> Path:
    """Write what a simulator without missing physics gives for a drive of one wheel as a wheel file."""
    labels, table = drive.labels, drive.wheel
    columns = {name: table[name] for name in ("time_s", "load_N", "slip")}
    columns |= {name: np.empty(len(table)) for name in ("torque_Nm", "sinkage_m", "drawbar_pull_N")}
    for start_s, end_s, name in zip(labels.start_s, labels.end_s, labels.classes, strict=True):
        rows = (table["time_s"] >= start_s) & (table["time_s"] < end_s)
        found = equilibrium(0.25, 0.2, grounds[name], table["load_N"][rows], table["slip"][rows])
        for channel in ("torque_Nm", "sinkage_m", "drawbar_pull_N"):
            columns[channel][rows] = getattr(found, channel)
    np.savetxt(path, np.column_stack(list(columns.values())), "%.9g", ",", header=",".join(columns), comments="")
    return path


def ground_drive(
    grounds: Mapping[str, Soil], *, seed: int = 0, seconds: float = 20.0, places: Sequence[float] = (0.0,),
    slip_sinkage: Mapping[str, float] | None = None, zeros: Mapping[str, Mapping[str, float]] | None = None,
) -> Recording:  # fmt: skip
    """Return a straight drive over grounds, each for so many `seconds`, labelled.

    Parameters
    ----------
    grounds
        Soils by class, in order.
    seed, seconds
        Of the noise; time on each ground [s].
    places
        Distance of each wheel ahead of the reference point [m]; the wheels are named w0, w1 ...
    slip_sinkage
        By class: share by which stiffness falls for a slip of one.
    zeros
        By wheel: errors of the zeros of channels.
    """
    rng, rate = np.random.default_rng(seed), 10.0
    border_m = seconds * SPEED_M_S
    time_s = np.arange(0.0, len(grounds) * seconds, 1.0 / rate)
    parts, names = [], []
    for number, forward in enumerate(places):
        phase = rng.uniform(0.0, 6.3, 2)
        load = 600.0 * (1.0 + 0.35 * np.sin(2.0 * np.pi * time_s / 7.0 + phase[0]))
        slip = 0.3 - 0.25 * np.cos(2.0 * np.pi * time_s / 9.3 + phase[1])
        on = np.clip(((SPEED_M_S * time_s + forward) / border_m).astype(int), 0, len(grounds) - 1)
        columns = {name: np.empty(len(time_s)) for name in ("torque_Nm", "sinkage_m", "drawbar_pull_N")}
        for each, (name, soil) in enumerate(grounds.items()):
            rows = on == each
            softer = 1.0 - (slip_sinkage or {}).get(name, 0.0) * slip[rows]
            found = equilibrium(0.25, 0.2, soil, load[rows], slip[rows], stiffness=softer)
            for channel, values in columns.items():
                values[rows] = getattr(found, channel)
        columns |= {"load_N": load, "slip": slip}
        for channel, noise in NOISE.items():
            zero = (zeros or {}).get(f"w{number}", {}).get(channel, 0.0)
            columns[channel] = columns[channel] + zero + noise * rng.standard_normal(len(time_s))
        parts.append({"time_s": time_s, **columns})
        names += len(time_s) * [f"w{number}"]
    wheels = tuple(
        Wheel(radius_m=0.25, width_m=0.2, name=f"w{number}", position_m=(forward, 0.0))
        for number, forward in enumerate(places)
    )
    table = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    starts = seconds * np.arange(len(grounds))
    still = np.zeros_like(time_s)
    return Recording(
        name="drive", source=Path("drive"), vehicle=Vehicle(wheels=wheels, noise=NOISE), start_time=None, site="",
        digest="d" * 64, wheel=WheelTable(table, np.array(names), None, "drive/wheel.csv"),
        pose=Pose(time_s, SPEED_M_S * time_s, still, still),
        labels=Labels(starts, starts + seconds, tuple(grounds)),
    )  # fmt: skip
