"""Instruments: their noise, their grain, their rare errors, and how the ground varies beneath them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .contact import Array, Reaction
from .drives import Drive, smooth_wander
from .effect import ANSWERED, FIELD_OF, span
from .scene import Ground, Scene

LOAD, SLIP = "load_N", "slip"
WHEEL_SPEED, TRAVEL_SPEED, ANGLE = "wheel_speed_rad_s", "travel_speed_m_s", "wheel_angle_rad"
PITCH, PLACE, PASS, TIME = "pitch_rad", "x_m", "pass", "time_s"


@dataclass(frozen=True)
class Sensors:
    """Standard deviations by column and the habits of the instruments."""

    sd: dict[str, float]
    memory: float  # of the noise from row to row
    grain: dict[str, float]  # quantisation step by column
    gross: dict[str, float]  # share of gross errors by column
    missing: float  # share of missing values


def draw_sensors(rng: np.random.Generator, scene: Scene) -> Sensors:
    """Noise of 0.5 to 3 % of the range, lower by averaging in steady trials."""
    drive, reference = scene.drive, scene.reference
    scale = 0.6 if drive.steady else 1.0

    def share(low: float, high: float) -> float:
        return scale * float(np.exp(rng.uniform(np.log(low), np.log(high))))

    sd = {
        LOAD: share(0.005, 0.03) * float(np.mean(drive.load)),
        SLIP: share(0.004, 0.02),
        WHEEL_SPEED: share(0.001, 0.004) * float(np.median(drive.wheel_speed)),
        ANGLE: share(0.002, 0.01),
        PITCH: share(0.001, 0.004),
        PLACE: share(0.0005, 0.003) * float(np.ptp(drive.place)),
    }
    for column in ANSWERED:
        sd[column] = share(0.005, 0.03) * span(getattr(reference, FIELD_OF[column]))
    sd[TRAVEL_SPEED] = sd[SLIP] * scene.wheel.radius * float(np.median(drive.wheel_speed))
    answered = list(scene.answered)
    grained = [c for c in (LOAD, *answered) if rng.random() < 0.4] if rng.random() < 0.25 else []
    faulty = rng.choice([LOAD, *answered], int(rng.integers(1, 3)), replace=False) if rng.random() < 0.2 else []
    return Sensors(
        sd=sd,
        memory=0.0 if drive.steady or rng.random() < 0.7 else float(rng.uniform(0.15, 0.5)),
        grain={c: sd[c] * float(rng.uniform(0.5, 2.0)) for c in grained},
        gross={str(c): float(rng.uniform(0.001, 0.008)) for c in faulty},
        missing=float(rng.uniform(0.001, 0.01)) if rng.random() < 0.3 else 0.0,
    )


def draw_ground(rng: np.random.Generator, drive: Drive) -> Ground:
    """Ground that varies by 0 to 5 % along a track (over 0.2 to 2 m) or by 0 to 3 % from trial to trial."""
    bound = 0.03 if drive.steady else 0.05
    stiffness_sd, strength_sd = (bound * rng.random(2)).tolist()
    length = float(np.exp(rng.uniform(np.log(0.2), np.log(2.0))))
    if drive.steady:
        first, second = rng.standard_normal((2, drive.rows))
    else:
        first, second = (smooth_wander(rng, drive.place, length) for _ in range(2))
    return Ground(np.exp(stiffness_sd * first), np.exp(strength_sd * second), stiffness_sd, strength_sd, length)


def _noise(rng: np.random.Generator, sd: float, memory: float, rows: int) -> Array:
    """White or first-order autoregressive noise."""
    white = rng.standard_normal(rows)
    if memory:
        for row in range(1, rows):
            white[row] = memory * white[row - 1] + np.sqrt(1.0 - memory**2) * white[row]
    return sd * white


def read_off(
    rng: np.random.Generator, scene: Scene, drive: Drive, reaction: Reaction, sensors: Sensors
) -> dict[str, Array]:
    """All columns that could be recorded, with noise and grain, yet without gross errors and gaps.

    The travel speed is the one from which slip was computed with the nominal radius, so that the three columns agree.
    """
    truth = {
        LOAD: drive.load,
        SLIP: drive.slip,
        WHEEL_SPEED: drive.wheel_speed,
        ANGLE: drive.angle,
        PITCH: drive.pitch,
        PLACE: drive.place,
        **{column: getattr(reaction, FIELD_OF[column]) for column in ANSWERED},
    }
    columns = {
        name: values + _noise(rng, sensors.sd[name], sensors.memory, drive.rows) for name, values in truth.items()
    }
    for name, step in sensors.grain.items():
        columns[name] = step * np.round(columns[name] / step)
    columns[TRAVEL_SPEED] = scene.wheel.radius * columns[WHEEL_SPEED] * (1.0 - columns[SLIP])
    columns[PASS] = drive.passes
    columns[TIME] = drive.time
    return columns


def spoil(rng: np.random.Generator, columns: dict[str, Array], sensors: Sensors) -> dict[str, Array]:
    """Rare gross errors and missing values; returns where each column was spoilt."""
    spoilt = {}
    for name in (LOAD, SLIP, *ANSWERED):
        if name not in columns:
            continue
        hit = rng.random(len(columns[name])) < sensors.gross.get(name, 0.0)
        size = rng.uniform(8.0, 30.0, len(hit)) * rng.choice([-1.0, 1.0], len(hit))
        columns[name] = np.where(hit, columns[name] + size * sensors.sd[name], columns[name])
        gone = (rng.random(len(hit)) < sensors.missing) & (name != SLIP)
        columns[name] = np.where(gone, np.nan, columns[name])
        spoilt[name] = hit | gone
    return spoilt
