"""Places where no ground vehicle can have been: a fix that was lost, a frame that was changed on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..origin import FARTHEST_M
from ..recording.types import Pose

FASTEST_M_S = 50.0
"""No vehicle that a terrain database is for goes faster [m/s]: 180 km/h."""

_OFF_M = 5.0
"""Places this near to each other are never too far apart, however soon the one follows the other: satellites'
corrections, and times of receipt that bunch up, move them so [m]."""

_MOST_LOST = 0.1
"""Share of the places that may be impossible [-]: of more, nobody knows which are the right ones."""


def without_jumps(pose: Pose, source: Path, place: Callable[[int], str]) -> tuple[Pose, tuple[str, ...]]:
    """Leave out places that no ground vehicle gets to, and say so.

    Parameters
    ----------
    pose
        In order of time, finite.
    source
        The file.
    place
        Names a pose, counted from 0, as a user finds it.

    Returns
    -------
    Pose, problems

    Raises
    ------
    InputError
        More than a tenth would be left out: the places jump for good, or lie on no map.
    """
    far = np.maximum(np.abs(pose.x_m), np.abs(pose.y_m)) > FARTHEST_M
    if far.mean() > _MOST_LOST:
        row = int(np.argmax(far))
        raise InputError(
            source,
            f"x_m {pose.x_m[row]:.6g}, y_m {pose.y_m[row]:.6g}",
            expected=f"places within {FARTHEST_M:g} m of the origin",
            place=place(row),
        )
    possible = reached(pose.time_s, pose.x_m, pose.y_m) & ~far
    lost = int(np.sum(~possible))
    if lost > _MOST_LOST * len(possible):
        row = int(np.argmax(possible[1:] != possible[:-1])) + 1
        before, after = ((float(pose.x_m[at]), float(pose.y_m[at])) for at in (row - 1, row))
        raise InputError(
            source,
            f"a jump of {math.dist(before, after):.4g} m in {pose.time_s[row] - pose.time_s[row - 1]:.3g} s, to x_m "
            f"{after[0]:.6g}, y_m {after[1]:.6g}; {lost} of {len(possible)} places lie beyond such jumps",
            expected=f"places that a ground vehicle gets to, at no more than {FASTEST_M_S:g} m/s",
            place=place(row),
        )
    if not lost:
        return pose, ()
    row = int(np.argmin(possible))
    note = (
        f"{source.name}: {lost} of {len(possible)} places left out, no ground vehicle gets there (more than "
        f"{FASTEST_M_S:g} m/s), first {place(row)}: x_m {pose.x_m[row]:.6g}, y_m {pose.y_m[row]:.6g}"
    )
    return Pose(*(column[possible] for column in vars(pose).values())), (note,)


def reaches(time_s: np.ndarray | float, way_m: np.ndarray | float) -> np.ndarray | bool:
    """Say whether a ground vehicle gets so far [m] in a time [s]."""
    return way_m <= FASTEST_M_S * time_s + _OFF_M


def reached(time_s: np.ndarray, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Which places a ground vehicle can have been at, (n,) of bool.

    The longest run of places without a jump is believed, and before and after it what can be reached from there.

    Parameters
    ----------
    time_s, x_m, y_m : (n,)
        Time in order [s], and places [m]; of places at one time the first counts.
    """
    time_s, first, same = np.unique(time_s, return_index=True, return_inverse=True)
    x_m, y_m = x_m[first], y_m[first]

    def near(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        with np.errstate(over="ignore"):
            way = np.hypot(x_m[a] - x_m[b], y_m[a] - y_m[b])
            return np.asarray(reaches(np.abs(time_s[a] - time_s[b]), way))

    rows = np.arange(len(time_s))
    runs = np.split(rows, np.flatnonzero(~near(rows[1:], rows[:-1])) + 1)
    longest = max(range(len(runs)), key=lambda number: len(runs[number]))
    possible = np.zeros(len(rows), dtype=bool)
    possible[runs[longest]] = True
    later, earlier = runs[longest + 1 :], [run[::-1] for run in reversed(runs[:longest])]
    for last, others in ((runs[longest][-1], later), (runs[longest][0], earlier)):
        for run in others:
            back = run[np.cumsum(near(run, last)) > 0]
            possible[back] = True
            last = back[-1] if len(back) else last
    return possible[same]
