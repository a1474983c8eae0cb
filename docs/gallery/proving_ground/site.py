"""A site: patches of ground, each with a soil of its own about its class, and what a vehicle's wheels do on each cell.

Forces are those of `bevameter.framework.scenario.mechanics`, which shares no code with the estimator.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from bevameter.framework.core.vehicle import Vehicle
from bevameter.framework.scenario.mechanics import Soil, equilibrium
from bevameter.framework.scenario.presets import preset
from bevameter.framework.scenario.soils import SOILS, SoilClass
from bevameter.framework.scenario.wheels import VARIATION
from scipy.constants import g as GRAVITY
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import KDTree

CELL_M, CELLS = 0.5, 120
"""Edge of a cell [m], and cells along an edge of the site: 60 m."""

PATCH_M = 7.5
"""Mean distance of the middles of patches [m]."""

_SPREAD = (0.30, 0.10, 0.20, 0.30, 0.06)
"""Relative scatter of c, tan phi, k, stiffness and n between patches of one class. Those of c and tan phi are within
what Phoon & Kulhawy (1999, doi:10.1139/t99-038) found of soils of one kind, 10 to 50 % and 5 to 15 %; others chosen."""

_MUD = SoilClass(
    1500.0, math.radians(9.0), 0.010, 16.03e3, 1262.53e3, 0.70,
    "weaker than Wong 2010, Table 2.3, clayey soil of 55 % moisture (Thailand: 2070 Pa, 10 deg): chosen so that the "
    "vehicle is immobilised in about every second place",
)  # fmt: skip

CLASSES = {name: {**SOILS, "mud": _MUD}[name] for name in ("clay", "gravel", "loam", "mud", "sand")}
"""Sorted. On mud, and on much of the clay, the vehicle hardly moves."""

SHARES = np.array([0.18, 0.22, 0.24, 0.12, 0.24])
"""Share of patches by class [-]."""

_BARE = preset("rover4")
VEHICLE: Vehicle = _BARE.vehicle.model_copy(
    update={
        "wheels": tuple(
            wheel.model_copy(update={"load_N": load})
            for wheel, load in zip(_BARE.vehicle.wheels, (630.0, 630.0, 710.0, 710.0), strict=True)
        )
    }
)
"""The four-wheeled rover of the synthetic drives, which states its loads."""

_LOADS_N = (630.0, 710.0)
"""Of a front and of a rear wheel; there are two of each."""

_SLIPS = np.linspace(0.06, 0.84, 9)
_SIDE_SLIP = 0.15
"""Where the patch that bears side force is taken, of `_SLIPS` the nearest."""

_FACTORS = 1.0 + np.array([-0.12, 0.0, 0.12])
"""By which cohesion and stiffness of a cell differ from its patch's: nodes between which forces are interpolated."""


@dataclass(frozen=True)
class Site:
    """True ground.

    Parameters
    ----------
    patch : (CELLS, CELLS) int
        Number of the patch by cell, x first.
    patch_class : (p,) int
        Number of the patch's class in `CLASSES`.
    soils
        Of the p patches.
    cohesion, stiffness : (CELLS, CELLS)
        By which those of the patch are multiplied [-].
    acceleration, braking, side : (CELLS, CELLS)
        Greatest that the vehicle can have [m/s^2]; a negative acceleration: it is immobilised.
    """

    patch: np.ndarray
    patch_class: np.ndarray
    soils: tuple[Soil, ...]
    cohesion: np.ndarray
    stiffness: np.ndarray
    acceleration: np.ndarray
    braking: np.ndarray
    side: np.ndarray

    @property
    def cell_class(self) -> np.ndarray:
        """(CELLS, CELLS) int: number of the class."""
        return self.patch_class[self.patch]


def centres() -> np.ndarray:
    """Give the middles of all cells, (CELLS * CELLS, 2) [m], x changing slowest."""
    along = (np.arange(CELLS) + 0.5) * CELL_M
    return np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)


def make_site(rng: np.random.Generator) -> Site:
    """Draw a site."""
    side = round(CELLS * CELL_M / PATCH_M)
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2)
    seeds = (grid + 0.5 + 0.8 * (rng.random(grid.shape) - 0.5)) * PATCH_M
    patch = np.asarray(KDTree(seeds).query(centres())[1]).reshape(CELLS, CELLS)
    # As many patches of each class as its share says: a site without any mud would show nothing.
    ends = np.round(np.cumsum(SHARES) * len(seeds)).astype(int)
    patch_class = rng.permutation(np.searchsorted(ends, np.arange(len(seeds)), side="right"))
    kinds = list(CLASSES.values())
    soils = tuple(_soil(kinds[number], rng) for number in patch_class)
    cohesion, stiffness = (1.0 + VARIATION * smooth_noise(rng, 0.8) for _ in range(2))
    forces = np.array([vehicle_forces(soil) for soil in soils])
    at = [
        ((np.clip(each, *_FACTORS[[0, -1]]) - _FACTORS[0]) / (_FACTORS[1] - _FACTORS[0]))
        for each in (cohesion, stiffness)
    ]
    own = np.array([map_coordinates(forces[:, which], [patch, *at], order=1) for which in range(3)])
    return Site(patch, patch_class, soils, cohesion, stiffness, *own)


def _soil(kind: SoilClass, rng: np.random.Generator) -> Soil:
    width_m = VEHICLE.wheels[0].width_m
    return replace(kind, spread=_SPREAD).draw(rng, width_m)


def smooth_noise(rng: np.random.Generator, length_m: float) -> np.ndarray:
    """Noise of mean 0 and standard deviation 1 that is alike over so much way, (CELLS, CELLS)."""
    field = gaussian_filter(rng.standard_normal((CELLS, CELLS)), length_m / CELL_M, mode="reflect")
    return (field - field.mean()) / field.std()


def vehicle_forces(soil: Soil, factors: np.ndarray = _FACTORS) -> np.ndarray:
    """Find the greatest acceleration, braking and side acceleration (3, f, f) [m/s^2] on a soil.

    Braking and side force are limited by Bekker's thrust c A + W tan phi (Wong 2008, Sec. 2.4).

    Parameters
    ----------
    soil
        Whose cohesion and stiffness are multiplied by all pairs of
    factors : (f,)
        [-].
    """
    wheel = VEHICLE.wheels[0]
    shape = (len(_LOADS_N), len(factors), len(factors), 2 * len(_SLIPS))
    load, cohesion, stiffness, slip = (
        np.broadcast_to(np.reshape(each, np.roll((-1, 1, 1, 1), axis)), shape).ravel()
        for axis, each in enumerate((_LOADS_N, factors, factors, np.concatenate([_SLIPS, -_SLIPS])))
    )
    found = equilibrium(wheel.radius_m, wheel.width_m, soil, load, slip, cohesion=cohesion, stiffness=stiffness)
    length = np.sqrt(np.maximum(wheel.radius_m**2 - (wheel.radius_m - found.sinkage_m) ** 2, 0.0))
    thrust = cohesion * soil.c_Pa * wheel.width_m * length + load * math.tan(soil.phi_rad)
    carried = np.isfinite(found.drawbar_pull_N)
    pull = np.where(carried, found.drawbar_pull_N, -load)
    thrust = np.where(carried, thrust, 0.0)
    pull, thrust = (2.0 * each.reshape(shape) for each in (pull, thrust))
    braking = np.minimum(-pull, thrust)[..., len(_SLIPS) :]
    beside = thrust[..., np.argmin(np.abs(_SLIPS - _SIDE_SLIP))]
    forces = (pull[..., : len(_SLIPS)].sum(0).max(-1), np.maximum(braking, 0.0).sum(0).max(-1), beside.sum(0))
    return np.array(forces) * GRAVITY / (2.0 * sum(_LOADS_N))
