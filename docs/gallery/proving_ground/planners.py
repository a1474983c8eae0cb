"""Planners on a grid of cells: least times by what each believes of the ground."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from bevameter.database.snapshot import Snapshot
from bevameter.database.speed import SpeedLimit, curvature_of, limits
from bevameter.database.traction import Traction
from bevameter.framework.scenario.mechanics import Soil
from scipy.ndimage import gaussian_filter1d, uniform_filter
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from .site import CELL_M, CELLS, CLASSES, VEHICLE, Site, centres, vehicle_forces

SIGHT_M, MOST_M_S, UNKNOWN_M_S, REACTION_S = 6.0, 8.0, 0.3, 0.3
"""Distance seen, the vehicle's own greatest speed, creeping speed on unknown ground, time from seeing to braking."""

CONFIDENCE = 0.95

STEP_M = 0.25
"""Way between the places of a route [m]."""

APART_M = 35.0
"""Least distance of start and goal [m]."""

_SMOOTHINGS_M = (0.0, 0.5, 1.0, 1.5)
"""Standard deviations of the Gaussian that rounds the corners of a way over the grid [m]; the fastest is taken."""

SETTINGS = {"sight_m": SIGHT_M, "most_m_s": MOST_M_S, "unknown_m_s": UNKNOWN_M_S, "reaction_s": REACTION_S}


@dataclass(frozen=True)
class Planner:
    """One belief about the ground.

    Parameters
    ----------
    name
        For the table.
    ground
        What it takes for granted, over all cells: its lower bounds.
    speeds
        Greatest speeds along a path (n, 2) [m].
    """

    name: str
    ground: Traction
    speeds: Callable[[np.ndarray], SpeedLimit]


@dataclass(frozen=True)
class Route:
    """A path as planned: places (n, 2) [m] `STEP_M` apart, their curvature (n,) [1/m] and speeds (n,) [m/s]."""

    path: np.ndarray
    bend: np.ndarray
    speed: np.ndarray


def by_database(name: str, snapshot: Snapshot, confidence: float = CONFIDENCE) -> Planner:
    """Plan with lower bounds from the terrain database."""
    answer = snapshot.along(centres(), confidence=confidence)

    def speeds(path: np.ndarray) -> SpeedLimit:
        return snapshot.along(path, confidence=confidence).speed_limit(VEHICLE, **SETTINGS)

    return Planner(name, answer.traction(VEHICLE), speeds)


def by_means(name: str, snapshot: Snapshot) -> Planner:
    """Plan with the expected values of the database, as if they were certain."""
    found = snapshot.along(centres(), confidence=CONFIDENCE).traction(VEHICLE)
    return _certain(name, np.array([found.acceleration, found.braking, found.side]), found.known)


def by_one_soil(name: str, share: float = 1.0) -> Planner:
    """Plan without a database: all ground is one soil, whose parameters are the mean of the classes' typical ones.

    So much of its acceleration, braking and side force is used: a margin where it is less than 1 [-].
    """
    width_m = VEHICLE.wheels[0].width_m
    kinds = CLASSES.values()
    c, tan_phi, k, stiffness, n = np.mean(
        [(each.c_Pa, math.tan(each.phi_rad), each.k_m, each.stiffness_Pa(width_m), each.n) for each in kinds], axis=0
    )
    forces = share * vehicle_forces(Soil(c, math.atan(tan_phi), k, stiffness, n), np.ones(1)).reshape(3, 1)
    return _certain(name, np.repeat(forces, CELLS**2, axis=1))


def by_truth(name: str, site: Site) -> Planner:
    """Plan with the true ground."""
    return _certain(name, np.array([site.acceleration, site.braking, site.side]).reshape(3, -1))


def _certain(name: str, forces: np.ndarray, known: np.ndarray | None = None) -> Planner:
    """Take accelerations (3, cells) for granted: forwards, braking and to the side [m/s^2]."""
    count = forces.shape[1]
    known = np.ones(count, dtype=bool) if known is None else known
    columns = [each for row in forces for each in (row, row)]
    ground = Traction(known, np.where(known, "", "unknown"), *columns, load_N=())

    def speeds(path: np.ndarray) -> SpeedLimit:
        rows = cells_along(path)
        picked = Traction(known[rows], ground.reason[rows], *(each[rows] for each in columns), load_N=())
        return limits(picked, curvature_of(path), _steps(path), **SETTINGS)

    return Planner(name, ground, speeds)


def plan(planner: Planner, pairs: np.ndarray) -> list[Route | None]:
    """Find the fastest routes between pairs of cells, (m, 2) int; None where there is none."""
    speed = cell_speeds(planner.ground)
    starts, row = np.unique(pairs[:, 0], return_inverse=True)
    _, before = dijkstra(_grid(speed), indices=starts, return_predecessors=True)
    routes = []
    for (start, goal), tree in zip(pairs.tolist(), before[row], strict=True):
        way = [goal]
        while way[-1] != start and tree[way[-1]] >= 0:
            way.append(int(tree[way[-1]]))
        there = way[-1] == start and speed[start] > 0.0
        routes.append(_rounded(planner, centres()[way[::-1]]) if there else None)
    return routes


def cell_speeds(ground: Traction) -> np.ndarray:
    """Greatest speed on each cell, were all ground like it (n,) [m/s]; 0 where the vehicle may not move."""
    braking = np.maximum(ground.braking_lower, 0.0)
    late = braking * REACTION_S
    speed = np.minimum(np.sqrt(late**2 + 2.0 * braking * SIGHT_M) - late, MOST_M_S)
    return np.where(ground.known, np.where(ground.acceleration_lower > 0.0, speed, 0.0), UNKNOWN_M_S)


def _grid(speed: np.ndarray) -> csr_array:
    """Times between neighbouring cells [s], eight a cell; nobody cuts the corner of a cell where it may not move."""
    number = np.arange(CELLS**2).reshape(CELLS, CELLS)
    open_ = (speed > 0.0).reshape(CELLS, CELLS)
    edges = []
    low, high, whole = slice(None, -1), slice(1, None), slice(None)
    for first, second in (
        ((low, whole), (high, whole)), ((whole, low), (whole, high)), ((low, low), (high, high)),
        ((low, high), (high, low)),
    ):  # fmt: skip
        free = open_[first] & open_[second]
        if whole not in first:
            free &= open_[first[0], second[1]] & open_[second[0], first[1]]
        edges.append(np.stack([number[first][free], number[second][free]]))
    one, other = np.concatenate(edges, axis=1)
    length = np.hypot(*(centres()[one] - centres()[other]).T)
    # Corners will be rounded: a way keeps off its slow neighbours.
    slowness = uniform_filter(1.0 / np.maximum(speed, UNKNOWN_M_S).reshape(CELLS, CELLS), 3).ravel()
    time = 0.5 * length * (slowness[one] + slowness[other])
    both = np.concatenate([one, other]), np.concatenate([other, one])
    return csr_array((np.tile(time, 2), both), shape=(CELLS**2, CELLS**2))


def _rounded(planner: Planner, way: np.ndarray) -> Route:
    """Round the corners of a way over the grid so far as the planned time is least."""
    best, least = None, math.inf
    for smoothing in _SMOOTHINGS_M:
        path = _resampled(way)
        if smoothing:
            rounded = gaussian_filter1d(path, smoothing / STEP_M, axis=0, mode="nearest")
            path = _resampled(np.concatenate([path[:1], rounded[1:-1], path[-1:]]))
        limit = planner.speeds(path).limit_m_s
        with np.errstate(divide="ignore"):
            time = float(np.sum(STEP_M / np.maximum(0.5 * (limit[1:] + limit[:-1]), 0.0)))
        if best is None or (limit[1:].min() > 0.0 and time < least):
            best, least = Route(path, curvature_of(path), limit), time
    assert best is not None
    return best


def _resampled(path: np.ndarray) -> np.ndarray:
    """Give places `STEP_M` apart along a path."""
    way = np.append(0.0, np.cumsum(_steps(path)))
    at = np.linspace(0.0, way[-1], max(round(way[-1] / STEP_M), 2) + 1)
    return np.column_stack([np.interp(at, way, each) for each in path.T])


def _steps(path: np.ndarray) -> np.ndarray:
    return np.hypot(*np.diff(path, axis=0).T)


def cells_along(path: np.ndarray) -> np.ndarray:
    """Give the number of the cell of each place, (n,)."""
    x, y = np.clip(np.floor(path / CELL_M).astype(int), 0, CELLS - 1).T
    return x * CELLS + y


def draw_pairs(site: Site, rng: np.random.Generator, count: int, seen: np.ndarray) -> np.ndarray:
    """Draw start and goal cells (m, 2) on recognised gravel, loam and sand, `APART_M` apart or more."""
    good = [list(CLASSES).index(name) for name in ("gravel", "loam", "sand")]
    cells = np.flatnonzero(np.isin(site.cell_class.ravel(), good) & seen)
    pairs = []
    while len(pairs) < count:
        pair = rng.choice(cells, 2)
        if np.hypot(*np.subtract(*centres()[pair])) >= APART_M:
            pairs.append(pair)
    return np.array(pairs, dtype=int).reshape(-1, 2)
