"""Covariates of each sample from a wheel table: place, speeds, accelerations, uninterrupted stretches."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter
from scipy.stats import median_abs_deviation

from ...framework.core.recording.types import WheelTable
from ...framework.core.track.passes import side_by_side, slip_before
from ...framework.core.track.place import axis_of, place_of
from ...framework.core.track.positions import continuous, runs_of, set_down
from ...framework.core.vehicle import Wheel
from .effect import COVARIATES, Drive

COLUMNS = {
    "load_N": "load_N",
    "slip": "slip",
    "time_s": "time_s",
    "travel_speed_m_s": "travel_speed_m_s",
    "rim_speed_m_s": "wheel_speed_rad_s",
    "wheel_angle_rad": "wheel_angle_rad",
    "pitch_rad": "pitch_rad",
    "pass_number": "pass",
    "place_m": "x_m",
    "x_m": "x_m",
    "y_m": "y_m",
    "acceleration_m_s2": "travel_speed_m_s",
    "angular_acceleration_rad_s2": "wheel_speed_rad_s",
}
"""Wheel column of each attribute of `Drive`; accelerations need `time_s` as well."""

GROUND = "ground"
"""Column of the number of the ground of each row, NaN for none; all rows are on one ground where absent."""

_WINDOWS, _DEGREE = (9, 13, 19, 27, 39, 55), 4
"""Windows [samples] of the polynomials fitted to speeds for their derivative, and the degree of these: a parabola over
nine samples attenuates accelerations within a second by some per cent, and overestimates masses as much."""


class PresentDrive(Drive):
    """A drive to be simulated: `has` is true for a column observed in any row, constant or not."""

    def has(self, name: str) -> bool:
        """Return whether a channel was observed in any sample."""
        return bool(np.isfinite(getattr(self, name)).any())


def order_of(table: WheelTable) -> tuple[np.ndarray, np.ndarray]:
    """Order (n,) by run, then start of the stretch (trials as given), and stretch (n,) of each row in that order.

    A stretch ends where wheel, run or pass change, where time does not increase or jumps by five median steps, and
    where the wheel was set down elsewhere (`positions.set_down`). Of several wheels the front one comes first: the next
    runs on the ground behind it.
    """
    time_s = table.get("time_s")
    if time_s is None:
        return np.arange(len(table)), np.arange(len(table))
    labels = _labels(table)
    wheel, run = np.divmod(labels, len(table) + 1)
    order = np.lexsort((time_s, labels))
    labels, time_s = labels[order], time_s[order]
    step = np.diff(time_s)
    median_step = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 1.0
    broken = (np.diff(labels) != 0) | (step <= 0.0) | (step > 5.0 * median_step)
    number = table.get("pass")
    if number is not None:
        broken |= np.nan_to_num(np.diff(_carried(number[order], labels))) != 0.0
    if "x_m" in table:
        of_one = np.cumsum(np.append(False, broken))
        broken |= set_down(np.column_stack([table[name][order] for name in ("x_m", "y_m") if name in table]), of_one)
    stretch = np.concatenate([[0], np.cumsum(broken)])[: len(order)]
    first = np.flatnonzero(np.diff(stretch, prepend=-1))
    # Of several wheels that start together the rear one comes last.
    begun = np.sort(time_s[first])
    together = np.concatenate([[0], np.cumsum(np.diff(begun) > 2.0 * median_step)])[
        np.searchsorted(begun, time_s[first])
    ]
    passes = np.ones(len(first))
    if number is not None and wheel.any():
        passes = np.nan_to_num(_carried(number[order], labels)[first], nan=1.0)
    rank = np.argsort(np.lexsort((wheel[order][first], time_s[first], passes, together, run[order][first])))
    again = np.argsort(rank[stretch], kind="stable")
    return order[again], rank[stretch][again]


def _by_appearance(names: np.ndarray | None, count: int) -> np.ndarray:
    """Number names (n,) in order of first appearance."""
    if names is None:
        return np.zeros(count, dtype=int)
    _, first, which = np.unique(names, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[which]


def _labels(table: WheelTable) -> np.ndarray:
    """Number (n,) of wheel and run of each row."""
    wheel, run = (_by_appearance(names, len(table)) for names in (table.wheel, table.run))
    return wheel * (len(table) + 1) + run


def _carried(number: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Pass numbers (n,), filled forward and then backward within each label (n,).

    NaN where a label has none.
    """
    order = np.argsort(label, kind="stable")
    answer = number.copy()
    for rows in (order[run] for run in runs_of(label[order])):
        stated = np.flatnonzero(np.isfinite(number[rows]))
        if len(stated):
            last = np.clip(np.searchsorted(stated, np.arange(len(rows)), side="right") - 1, 0, None)
            answer[rows] = number[rows][stated[last]]
    return answer


def drive_of(table: WheelTable, wheel: Wheel, stretch: np.ndarray, kind: type[Drive] = Drive) -> Drive:
    """Compute the covariates of a table's rows.

    Parameters
    ----------
    table
        Rows of one wheel geometry in the order of `order_of`, with load and slip.
    wheel
        The wheel, for its radius.
    stretch : (n,)
        Stretch of each row.
    kind
        `Drive`, or `PresentDrive` for a drive to be simulated.
    """
    missing = np.full(len(table), math.nan)

    def column(name: str) -> np.ndarray:
        return table.columns.get(name, missing)

    rate, travel, time_s = column("wheel_speed_rad_s"), column("travel_speed_m_s"), column("time_s")
    # Slip and one of the two speeds give the other.
    slip = table["slip"]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))
        if not np.isfinite(travel).any():
            travel = np.where(np.isfinite(ratio), rate * wheel.radius_m * ratio, math.nan)
        elif not np.isfinite(rate).any():
            rate = np.where(ratio > 0.0, travel / (wheel.radius_m * ratio), math.nan)
    plane = continuous(np.column_stack([column("x_m"), column("y_m")]), time_s, stretch)
    axis = axis_of(plane, stretch, wheel.width_m)
    passes = _carried(column("pass"), _labels(table))
    place_m = place_of(plane, axis, passes, stretch, wheel.width_m)
    lane = side_by_side(axis, plane, passes, stretch, wheel.width_m)
    return kind(
        load_N=table["load_N"],
        slip=table["slip"],
        time_s=time_s,
        travel_speed_m_s=travel,
        rim_speed_m_s=rate * wheel.radius_m,
        wheel_angle_rad=column("wheel_angle_rad"),
        pitch_rad=column("pitch_rad"),
        pass_number=passes,
        place_m=place_m,
        x_m=plane[:, 0],
        y_m=plane[:, 1],
        acceleration_m_s2=rate_of_change(travel, time_s, stretch),
        angular_acceleration_rad_s2=rate_of_change(rate, time_s, stretch),
        stretch=stretch,
        run=stretch if (np.diff(stretch) == 0).any() else np.unique(_labels(table), return_inverse=True)[1],
        slip_before=slip_before(slip, passes, place_m, stretch, lane),
        ground=np.nan_to_num(column(GROUND)).astype(int),
        wheel=_by_appearance(table.wheel, len(table)),
        axis=axis,
    )


def select_rows(drive: Drive, rows: np.ndarray) -> Drive:
    """Return the rows of a mask or an index array, as a drive of the same kind."""
    return replace(drive, **{name: getattr(drive, name)[rows] for name in COVARIATES})


def rate_of_change(values: np.ndarray, time_s: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Rate of change [1/s], (n,), from local polynomials between gaps of each stretch; NaN where these are too short.

    The window minimises the expected error of noise and attenuation (after C. M. Stein, Ann. Statist. 9 (1981),
    1135-1151: an unbiased estimate of the risk). The rate is shrunk to its mean by the share of noise in its variance,
    so that regressions on it are not attenuated (regression calibration; R. J. Carroll et al., "Measurement Error in
    Nonlinear Models" (2006), Ch. 4). Near the ends of stretches noise is larger: some attenuation remains in stretches
    of tens of rows or less.
    """
    seen = np.isfinite(values) & np.isfinite(time_s)
    broken = (np.diff(stretch) != 0) | (seen[1:] != seen[:-1])
    runs = np.split(np.arange(len(values)), np.flatnonzero(broken) + 1)
    usable = [rows for rows in runs if len(rows) >= _WINDOWS[0] and seen[rows[0]]]
    narrow = np.full(len(values), math.nan)
    if not usable:
        return narrow
    steps = [float(np.median(np.diff(time_s[rows]))) for rows in usable]
    # The noise of a rate grows with the sampling rate.
    per_s2 = float(np.average([step**-2 for step in steps], weights=[len(rows) for rows in usable]))
    left = np.concatenate([values[rows] - savgol_filter(values[rows], _WINDOWS[0], _DEGREE) for rows in usable])
    kept = 1.0 - savgol_coeffs(_WINDOWS[0], _DEGREE)[_WINDOWS[0] // 2]
    noise = float(median_abs_deviation(left, scale="normal")) ** 2 / kept  # pyright: ignore[reportArgumentType]
    best: tuple[float, float, np.ndarray] | None = None
    longest = max(len(rows) for rows in usable)
    for window in [each for each in _WINDOWS if each <= longest]:
        rate = np.full(len(values), math.nan)
        for rows, step in zip(usable, steps, strict=True):
            fits = min(window, len(rows) - 1 + len(rows) % 2)
            rate[rows] = savgol_filter(values[rows], fits, _DEGREE, deriv=1, delta=step)
        narrow = rate if best is None else narrow
        slope = savgol_coeffs(window, _DEGREE, deriv=1)
        difference = slope - np.pad(savgol_coeffs(_WINDOWS[0], _DEGREE, deriv=1), (window - _WINDOWS[0]) // 2)
        of_noise = noise * per_s2 * float(slope @ slope)
        risk = float(np.nanmean((rate - narrow) ** 2)) - noise * per_s2 * float(difference @ difference) + of_noise
        if best is None or risk < best[0]:
            best = risk, of_noise, rate
    assert best is not None
    _, of_noise, rate = best
    mean, variance = float(np.nanmean(rate)), float(np.nanvar(rate))
    return mean + (rate - mean) * (max(1.0 - of_noise / variance, 0.0) if variance > 0.0 else 1.0)
