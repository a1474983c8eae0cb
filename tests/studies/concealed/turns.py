"""Tracks that turn: lanes side by side, rounds on an oval, out and back in the same rut; at random."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

KINDS = ("lanes", "rounds", "back")


@dataclass(frozen=True)
class Track:
    """A track on the ground, and how it is driven.

    Parameters
    ----------
    corners : (k, 2)
        Line on the ground, x and y [m], corners close enough together to be round where it is.
    kind
        ``lanes``: once along it; ``rounds``: it is closed, and driven again and again; ``back``: to its end and back.
    position_sd_m
        Noise of the positions recorded [m].
    """

    corners: np.ndarray
    kind: str
    position_sd_m: float

    @property
    def length_m(self) -> float:
        """Length of the line [m]."""
        return float(self._way[-1])

    @property
    def _way(self) -> np.ndarray:
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.corners, axis=0).T))])

    def on_ground(self, way_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the place along the line [m] and the number of the pass, from 1, after a way driven, (m,) each."""
        number = np.floor(way_m / self.length_m * (1.0 - 1e-12))
        rest = way_m - number * self.length_m
        if self.kind == "back":
            rest = np.where(number % 2.0 == 1.0, self.length_m - rest, rest)
        return rest, number + 1.0

    def at(self, place_m: np.ndarray) -> np.ndarray:
        """Give x and y (m, 2) [m] of places along the line (m,) [m]."""
        return np.column_stack([np.interp(place_m, self._way, axis) for axis in self.corners.T])

    def recorded(self, rng: np.random.Generator, place_m: np.ndarray) -> np.ndarray:
        """Give x and y (m, 2) [m] with the noise of a recorder."""
        there = self.at(place_m)
        return there + self.position_sd_m * rng.normal(size=there.shape)


def draw_track(rng: np.random.Generator, way_m: float, width_m: float, again: bool) -> Track:
    """Draw a track for a way of so many metres, on which ruts are driven `again` or by chance."""
    kind = str(rng.choice(KINDS, p=(0.0, 0.7, 0.3) if again else (0.5, 0.35, 0.15)))
    if kind == "lanes":
        corners, runs = _side_by_side(int(rng.integers(3, 7)), width_m * rng.uniform(1.5, 4.0) / way_m), 1.0
    elif kind == "rounds":
        corners, runs = _oval(rng.uniform(0.0, 3.0)), float(rng.integers(2, 5))
    else:
        corners, runs = np.array([[0.0, 0.0], [1.0, 0.0]]), 4.0 if again else 2.0
    # a little longer than needed, so that the last row is on the last run
    size = way_m / runs * 1.0001 / Track(corners, kind, 0.0).length_m
    heading = rng.uniform(-math.pi, math.pi)
    turned = np.array([[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]])
    corners = size * corners @ turned + rng.uniform(-100.0, 100.0, 2)
    return Track(corners, kind, float(rng.choice([0.0, 0.005, 0.02])))


def _side_by_side(count: int, apart: float) -> np.ndarray:
    """Lanes of length 1 / count, `apart` from each other, joined by half circles, (k, 2)."""
    angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 25)
    pieces = []
    for lane in range(count):
        ends = np.array([[0.0, lane * apart], [1.0 / count, lane * apart]])
        pieces.append(ends if lane % 2 == 0 else ends[::-1])
        if lane < count - 1:
            bend = 0.5 * apart * np.column_stack([np.cos(angles), np.sin(angles)])
            side = np.array([1.0, 1.0]) if lane % 2 == 0 else np.array([-1.0, 1.0])
            pieces.append(side * bend + [pieces[-1][-1][0], (lane + 0.5) * apart])
    return np.concatenate(pieces)


def _oval(straight: float) -> np.ndarray:
    """Closed line of two half circles of radius 1 and two straights of so many radii, (k, 2)."""
    angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 49)
    half = np.column_stack([0.5 * straight + np.cos(angles), np.sin(angles)])
    return np.concatenate([half, -half, half[:1]])
