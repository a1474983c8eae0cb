"""Where along its track a wheel is: along an axis of the plane where that runs straight, by the way gone where not."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

ASIDE = 0.1
"""Spread across the main direction as a share of that along it from which on a track turns [-]."""

_BESIDE = 3.0
"""Steps of the earlier pass within which a later one lies on it [-], and one width of the wheel."""


def moved(x_m: np.ndarray, y_m: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Places (n, 2) from the middle of their stretch (n,), NaN where not observed: lanes side by side are one track."""
    place = np.column_stack([x_m, y_m])
    number = np.unique(stretch, return_inverse=True)[1]
    seen = np.asarray(np.isfinite(place).all(axis=1))
    count = np.bincount(number[seen], minlength=number.max() + 1)
    middle = np.column_stack([np.bincount(number[seen], each[seen], len(count)) for each in place.T])
    with np.errstate(invalid="ignore"):
        return np.where(seen[:, None], place - (middle / count[:, None])[number], np.nan)


def axis(x_m: np.ndarray, y_m: np.ndarray, stretch: np.ndarray) -> np.ndarray | None:
    """Direction (2,) in which stretches (n,) run: x where it is nearly that; None where they turn."""
    away = moved(x_m, y_m, stretch)
    away = away[np.isfinite(away).all(axis=1)]
    if not away.any():
        return np.array([1.0, 0.0])
    spread, directions = np.linalg.eigh(away.T @ away)
    if spread[0] > ASIDE**2 * spread[1]:
        return None
    main = directions[:, 1]
    if abs(main[1]) < ASIDE * abs(main[0]):
        return np.array([1.0, 0.0])
    return main * np.sign(main[np.argmax(np.abs(main))])


def place_of(
    x_m: np.ndarray, y_m: np.ndarray, stretch: np.ndarray, pass_number: np.ndarray, width_m: float
) -> np.ndarray:  # fmt: skip
    """Place along the track (n,) [m], NaN where not observed.

    Parameters
    ----------
    x_m, y_m, stretch, pass_number : (n,)
        In the order of time; y NaN where there is none.
    width_m
        Of the wheel: a later pass that comes so near to an earlier one, and `_BESIDE` of its steps, is on its track.
    """
    main = axis(x_m, y_m, stretch)
    if main is not None:
        return x_m if main[1] == 0.0 else main[0] * (x_m - x_m[0]) + main[1] * (y_m - y_m[0])
    steps = np.nan_to_num(np.hypot(np.diff(x_m), np.diff(y_m)))
    way = np.concatenate([[0.0], np.cumsum(steps)])
    number = np.nan_to_num(pass_number, nan=1.0)
    plane = np.column_stack([x_m, y_m])
    seen = np.isfinite(plane).all(axis=1)
    for later in np.unique(number)[1:]:
        before, rows = np.flatnonzero(seen & (number < later)), np.flatnonzero(seen & (number == later))
        near, at = map(np.asarray, KDTree(plane[before]).query(plane[rows]))
        reached = near < width_m + _BESIDE * float(np.median(steps[steps > 0.0]))
        way[rows[reached]] = way[before[at[reached]]]
    return way
