"""Learning a site: what the senses make of its cells, the slow drive over its patches, and the terrain database."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from bevameter import Recording, TerrainDatabase, WheelTable
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.database.snapshot import Snapshot
from bevameter.framework.core.recording.types import Pose
from bevameter.framework.core.track.way import track_of
from bevameter.framework.fusion import Belief
from bevameter.framework.scenario.mechanics import equilibrium
from bevameter.framework.scenario.presets import SLOW_RIM_SPEED_M_S
from bevameter.framework.segments import classes_along, learn_soil
from scipy.ndimage import distance_transform_edt, uniform_filter1d
from scipy.special import softmax

from .site import CELL_M, CELLS, CLASSES, SHARES, VEHICLE, Site, smooth_noise

SEPARATION = 4.4
"""Distance of two classes' features, in standard deviations of their noise [-]: about 93 % of the cells are right."""

UNSEEN_PATCHES, UNSEEN_CELLS = 4, 0.03
"""Patches that nobody has seen, and the share of the other cells that was not recognised: shadows of some metres."""

SLOW_S, FAST_M_S = 24.0, 2.0
"""Length of a slow stretch [s], and the speed between them [m/s]."""

RATE_HZ = 5.0
_LOAD_SWAY = ((0.38, 13.0), (0.10, 4.7))
"""Share of the load that moves to and fro [-], and period [s], as on the slow phases of the synthetic drives."""

START = datetime(2026, 11, 1, 8, 0, tzinfo=UTC)


@dataclass(frozen=True)
class Learnt:
    """A site's database after the slow drive.

    Parameters
    ----------
    drive
        What was stored.
    right
        Share of the recognised cells whose most probable class is the true one [-].
    visited : (v,) int
        Patches on which the vehicle crept.
    """

    drive: Drive
    right: float
    visited: np.ndarray

    def snapshot(self, folder: Path, stretches: int | None = None) -> Snapshot:
        """Store the drive in a new database, and read it back; with so many stretches a class, the first ones."""
        soils = self.drive.soils if stretches is None else first_of_each_class(self.drive.soils, stretches)
        with TerrainDatabase(folder / f"{self.drive.recording_digest}-{stretches}.db") as database:
            database.add_drive(replace(self.drive, soils=soils))
            return database.snapshot()


def learn(site: Site, rng: np.random.Generator, per_class: int) -> Learnt:
    """Look at a site, creep over so many patches of each class, and identify their soils."""
    unseen = rng.choice(len(site.soils), UNSEEN_PATCHES, replace=False)
    belief = _look(site, rng, unseen)
    visited = _tour(site, rng, per_class, unseen)
    recording = _drive(site, rng, visited)
    track = track_of(recording)
    assert track is not None
    along = classes_along(belief, track, VEHICLE, CELL_M)
    soil = learn_soil(recording, track, along)
    looked = np.flatnonzero(np.isfinite(belief.last_seen_s))
    terrain = TerrainObservations(
        CELL_M, belief.cells[looked, 0], belief.cells[looked, 1], belief.last_seen_s[looked],
        np.full(len(looked), "fused"), belief.select(looked),
    )  # fmt: skip
    drive = Drive(
        recording.digest, recording.name, recording.site, VEHICLE.name, START, {}, "closed loop", terrain,
        soil.observations,
    )  # fmt: skip
    open_ = ~belief.unknown
    right = np.argmax(belief.probabilities[open_], axis=1) == site.cell_class.ravel()[open_]
    return Learnt(drive, float(right.mean()), visited)


def first_of_each_class(soils: tuple[SoilObservation, ...], count: int) -> tuple[SoilObservation, ...]:
    """Keep the first stretches of each class that were identified."""
    kept, seen = [], dict.fromkeys(CLASSES, 0)
    for one in soils:
        if one.estimate is not None and one.class_probabilities:
            name = max(one.class_probabilities, key=one.class_probabilities.__getitem__)
            seen[name] += 1
            if seen[name] <= count:
                kept.append(one)
    return tuple(kept)


def _look(site: Site, rng: np.random.Generator, unseen: np.ndarray) -> Belief:
    """Classify all cells by features that are normal about their class's.

    The probabilities are the posterior itself, and so calibrated; half of the variance of the noise is alike over some
    metres, so that errors come in groups.
    """
    k, n = len(CLASSES), CELLS * CELLS
    smooth = np.stack([smooth_noise(rng, 1.5) for _ in range(k)], axis=-1).reshape(n, k)
    noise = math.sqrt(0.5) * (smooth + rng.standard_normal((n, k)))
    middles = SEPARATION / math.sqrt(2.0) * np.eye(k)
    features = middles[site.cell_class.ravel()] + noise
    apart = ((features[:, None, :] - middles) ** 2).sum(axis=-1)
    probabilities = softmax(np.log(SHARES) - 0.5 * apart, axis=1)
    never = np.isin(site.patch.ravel(), unseen)
    shadow = smooth_noise(rng, 1.0).ravel()
    unknown = never | (shadow > np.quantile(shadow, 1.0 - UNSEEN_CELLS))
    cells = np.stack(np.meshgrid(np.arange(CELLS), np.arange(CELLS), indexing="ij"), axis=-1).reshape(-1, 2)
    reasons = tuple(("too dark",) if each else () for each in unknown)
    nothing: dict[str, np.ndarray] = {}
    return Belief(
        tuple(CLASSES), np.where(unknown[:, None], 1.0 / k, probabilities), np.where(unknown, 0.0, 1.0), unknown,
        reasons, cells, nothing, nothing, nothing, np.where(never, np.nan, 0.0),
    )  # fmt: skip


def _tour(site: Site, rng: np.random.Generator, per_class: int, unseen: np.ndarray) -> np.ndarray:
    """Choose so many patches of each class, of those that were seen, in the order in which a lawn is mown."""
    chosen = []
    for number in range(len(CLASSES)):
        there = np.setdiff1d(np.flatnonzero(site.patch_class == number), unseen)
        chosen.extend(rng.permutation(there)[:per_class].tolist())
    return np.sort(chosen)


def _drive(site: Site, rng: np.random.Generator, visited: np.ndarray) -> Recording:
    """Creep straight over the middle of each patch, and go fast in between."""
    legs, at = [], None
    for patch in visited:
        # The bound of the site is a border as well: the stretch is to lie within.
        depth = np.asarray(distance_transform_edt(np.pad(site.patch == patch, 1)))[1:-1, 1:-1]
        middle = (np.array(np.unravel_index(np.argmax(depth), depth.shape)) + 0.5) * CELL_M
        heading = rng.uniform(0.0, 2.0 * np.pi) if at is None else math.atan2(middle[1] - at[1], middle[0] - at[0])
        slip = _sweep(rng)
        way = np.cumsum(SLOW_RIM_SPEED_M_S * (1.0 - slip) / RATE_HZ)
        toward = np.array([math.cos(heading), math.sin(heading)])
        begin = middle - 0.5 * way[-1] * toward
        if at is not None:
            length = float(np.hypot(*(begin - at)))
            steps = np.arange(1.0 / RATE_HZ, length / FAST_M_S, 1.0 / RATE_HZ)[:, None] * FAST_M_S / max(length, 1e-9)
            legs.append((at + steps * (begin - at), np.full(len(steps), 0.09), np.full(len(steps), FAST_M_S)))
        legs.append((begin + way[:, None] * toward, slip, SLOW_RIM_SPEED_M_S * (1.0 - slip)))
        at = legs[-1][0][-1]
    place, slip, speed = (np.concatenate([leg[index] for leg in legs]) for index in range(3))
    time = np.arange(len(place)) / RATE_HZ
    yaw = np.unwrap(np.arctan2(*np.gradient(uniform_filter1d(place, 5, axis=0), axis=0).T[::-1]))
    columns = _felt(site, rng, time, place, yaw, slip, speed)
    wheel = WheelTable(columns, np.full(len(time), VEHICLE.wheels[0].name), None, Path("closed loop"))
    digest = hashlib.sha256(b"".join(each.tobytes() for each in columns.values())).hexdigest()
    pose = Pose(time, place[:, 0], place[:, 1], yaw)
    return Recording("slow drive", Path("closed loop"), VEHICLE, START, "synthetic site", digest, wheel, pose)


def _sweep(rng: np.random.Generator) -> np.ndarray:
    """Slip of a slow stretch: twice up and down, as on the synthetic drives."""
    share = np.arange(round(SLOW_S * RATE_HZ)) / (SLOW_S * RATE_HZ)
    top = rng.uniform(0.8, 1.0, 2)[(share >= 0.5).astype(int)]
    return 0.05 + 0.55 * top * 0.5 * (1.0 - np.cos(4.0 * np.pi * share))


def _felt(
    site: Site, rng: np.random.Generator, time: np.ndarray, place: np.ndarray, yaw: np.ndarray, slip: np.ndarray,
    speed: np.ndarray,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Give the channels of one front wheel, in equilibrium with the ground below it, with the sensors' noise."""
    wheel = VEHICLE.wheels[0]
    forward, left = wheel.position_m
    under = place + forward * np.column_stack([np.cos(yaw), np.sin(yaw)])
    under += left * np.column_stack([-np.sin(yaw), np.cos(yaw)])
    row, column = np.clip(np.floor(under / CELL_M).astype(int), 0, CELLS - 1).T
    assert wheel.load_N is not None
    sway = [share * np.sin(2.0 * np.pi * time / period + rng.uniform(0.0, 6.3)) for share, period in _LOAD_SWAY]
    load = wheel.load_N * (1.0 + np.sum(sway, axis=0))
    torque, sinkage = np.empty(len(time)), np.empty(len(time))
    patch = site.patch[row, column]
    for number in np.unique(patch):
        here = patch == number
        found = equilibrium(
            wheel.radius_m, wheel.width_m, site.soils[number], load[here], slip[here],
            cohesion=site.cohesion[row, column][here], stiffness=site.stiffness[row, column][here],
        )  # fmt: skip
        torque[here], sinkage[here] = found.torque_Nm, found.sinkage_m
    true = {
        "load_N": load, "torque_Nm": torque, "sinkage_m": sinkage,
        "wheel_speed_rad_s": speed / (wheel.radius_m * (1.0 - slip)), "travel_speed_m_s": speed,
    }  # fmt: skip
    sensed = {name: value + VEHICLE.noise[name] * rng.standard_normal(len(time)) for name, value in true.items()}
    rim, travel = wheel.radius_m * sensed["wheel_speed_rad_s"], sensed["travel_speed_m_s"]
    return {"time_s": time, **sensed, "slip": np.where(rim >= travel, 1.0 - travel / rim, rim / travel - 1.0)}
