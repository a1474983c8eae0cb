"""From what ideal sensors report to a table as it is recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .drives import Plan
from .mechanics import ANSWERS, Body, Channels, Drive, travel_ratio
from .sensors import Sensors, quantise, slip_of

_STEPS = {
    "time_s": 1e-4, "wheel_speed_rad_s": 1e-5, "travel_speed_m_s": 1e-6, "wheel_angle_rad": 1e-4, "x_m": 1e-4,
    "y_m": 1e-4,
}  # fmt: skip


@dataclass(frozen=True)
class Recorded:
    """The recorded columns, (m,) each, by name, and names of steady trials.

    `sound` marks rows without gross errors and gaps; `load_error` is the recorded load over the reported one, and
    `slip_error` the recorded ratio V/(r omega) over the reported one, (m,), 1 where the row is not sound.
    """

    columns: dict[str, np.ndarray]
    run: np.ndarray | None
    sound: np.ndarray
    load_error: np.ndarray
    slip_error: np.ndarray

    def true_slip(self, drive: Drive) -> np.ndarray:
        """Give the slip that the drive would have had if the recorded error were real, (m,)."""
        ratio = travel_ratio(drive.slip) * self.slip_error
        return np.where(ratio <= 1.0, 1.0 - ratio, 1.0 / ratio - 1.0)

    def stated_noise(self, sensors: Sensors) -> dict[str, float]:
        """Give the noise stated in vehicle.toml: nothing, or what a data sheet would state."""
        if not sensors.stated:
            return {}
        stated = {name: sensors.deviation(name) for name in ("load_N", *ANSWERS) if name in self.columns}
        slip = float(np.median(np.abs(self.columns["slip"])))
        return {**stated, "slip": max(1e-4, (1.0 - min(slip, 0.9)) * sensors.speed * float(np.sqrt(1.25)))}


def record(rng: np.random.Generator, plan: Plan, body: Body, sensors: Sensors, reported: Channels) -> Recorded:
    """Add noise, rounding, gross errors and gaps, and keep the columns of the plan's recorder."""
    drive, count = plan.drive, len(plan.drive)
    columns: dict[str, np.ndarray] = {"time_s": drive.time_s, "pass": drive.passes}
    for name in ("load_N", *ANSWERS):
        values = getattr(reported, name) + sensors.draw(rng, name, count)
        columns[name] = quantise(values, sensors.quanta[name])
    rim = drive.travel_speed / travel_ratio(reported.slip)  # as the stated radius has it, wrong or right
    travel = drive.travel_speed * (1.0 + sensors.speed * rng.normal(size=count))
    rim_read = rim * (1.0 + 0.5 * sensors.speed * rng.normal(size=count))
    columns |= {
        "slip": np.clip(slip_of(rim_read, travel), -1.0, 1.0), "wheel_speed_rad_s": rim_read / body.radius_m,
        "travel_speed_m_s": travel, "wheel_angle_rad": _turned(drive, rim / body.radius_m), "x_m": drive.x_m,
        "pitch_rad": drive.pitch_rad + 0.002 * rng.normal(size=count),
    }  # fmt: skip
    if plan.track is not None:
        columns["x_m"], columns["y_m"] = plan.track.recorded(rng, drive.x_m).T
    slip_error = travel_ratio(columns["slip"]) / travel_ratio(reported.slip)
    load_error = columns["load_N"] / reported.load_N
    sound = _spoil(rng, sensors, columns)
    kept = {
        name: quantise(columns[name], _STEPS[name]) if name in _STEPS else np.round(columns[name], 9)
        for name in plan.columns
    }
    runs = None if plan.protocol != "steady" else np.array([f"t{index:03d}" for index in range(count)])
    return Recorded(kept, runs, sound, np.where(sound, load_error, 1.0), np.where(sound, slip_error, 1.0))


def _turned(drive: Drive, omega: np.ndarray) -> np.ndarray:
    """Integrate the wheel's speed as its encoder reports it."""
    turn = np.diff(drive.wheel_angle)
    scale = omega / drive.wheel_speed
    return np.concatenate([[0.0], np.cumsum(turn * 0.5 * (scale[1:] + scale[:-1]))])


def _spoil(rng: np.random.Generator, sensors: Sensors, columns: dict[str, np.ndarray]) -> np.ndarray:
    """Put gross errors and gaps into the answers and the load; give the rows that stay sound."""
    count = len(columns["load_N"])
    sound = np.ones(count, dtype=bool)
    for name in ("load_N", *ANSWERS):
        rows = np.flatnonzero(rng.random(count) < sensors.gross)
        span = float(np.ptp(columns[name]))
        columns[name][rows] += span * rng.choice([-1.0, 1.0], len(rows)) * rng.uniform(0.3, 1.0, len(rows))
        if name == "load_N":
            columns[name][rows] = np.maximum(columns[name][rows], 0.0)
        sound[rows] = False
        if sensors.missing > 0.0:
            length = max(1, int(sensors.missing * count))
            start = int(rng.integers(0, count - length))
            columns[name][start : start + length] = np.nan
            sound[start : start + length] = False
    return sound
