"""Rows at standstill, to which the equations of a rolling wheel do not apply."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.recording.types import WheelTable
from ...framework.core.track.positions import runs_of
from ..effects.drive import order_of
from .noise import in_time, noise_of_series, running_median

_SPEEDS = ("wheel_speed_rad_s", "travel_speed_m_s")

_FASTEST = 0.9
"""Quantile of a recording's speeds that is its usual speed [-]."""

_SLOW, _VERY_SLOW = 0.05, 0.005
"""Shares of the usual speed below which a speed within its noise, and any speed, is zero [-]."""

_NOISE = 3.0
"""Standard deviations of a sensor's noise within which its reading may be zero."""

_WHOLLY = 0.95
"""Slip from which on a wheel that does not travel spins, and one that does not turn is dragged [-]."""

_TOGETHER, _SURELY = 10, 4.0
"""Rows between two of zero speed at most that are tested together, and standard errors from which on their mean is not
zero."""


def with_standstill(table: WheelTable) -> WheelTable:
    """Set the speeds to zero in rows in which a wheel stands, and blank the slip, which is undefined there.

    A wheel stands where all its speeds that were measured are zero but for their noise; one that is locked and dragged,
    or spins in one place, does not.

    Parameters
    ----------
    table
        Channels as recorded.
    """
    names = [name for name in _SPEEDS if name in table]
    if "time_s" not in table or not names:
        return table
    order, stretch = order_of(table)
    still = np.zeros(len(table), dtype=bool)
    still[order] = np.all([_is_zero(table[name][order], stretch) for name in names], axis=0)
    slip = table.get("slip")
    if slip is not None and len(names) == 1:
        still &= ~(np.abs(slip) >= _WHOLLY)
    if not still.any():
        return table
    changed = {name: np.where(still, 0.0, table[name]) for name in names}
    if slip is not None:
        changed["slip"] = np.where(still, math.nan, slip)
    return table.adding(changed)


def stands(table: WheelTable) -> np.ndarray:
    """Rows, (n,), of a table that `with_standstill` gave in which a wheel is at standstill."""
    names = [name for name in _SPEEDS if name in table]
    if "time_s" not in table or not names:
        return np.zeros(len(table), dtype=bool)
    still = np.all([table[name] == 0.0 for name in names], axis=0)
    return still & np.isnan(table["slip"]) if "slip" in table else still


def _is_zero(speed: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Where a speed (n,) is zero within its noise, by the median of neighbours in its stretch (n,)."""
    seen = np.abs(speed[np.isfinite(speed)])
    if not len(seen):
        return np.zeros(len(speed), dtype=bool)
    fastest = float(np.quantile(seen, _FASTEST))
    noise = float(np.nan_to_num(noise_of_series(in_time(speed, stretch))))
    least = np.clip(_NOISE * noise, _VERY_SLOW * fastest, _SLOW * fastest)
    smooth = np.concatenate([running_median(speed[rows], 5) for rows in runs_of(stretch)])
    zero = np.abs(smooth) <= least
    rows = np.flatnonzero(zero)
    apart = (np.diff(rows) > _TOGETHER) | (np.diff(stretch[rows]) != 0)
    for together in np.split(rows, np.flatnonzero(apart) + 1):
        seen = speed[together[0] : together[-1] + 1] if len(together) else speed[:0]
        seen = seen[np.isfinite(seen)]
        # Slow is no standstill: over many rows the noise averages out.
        least = max(_SURELY * noise / math.sqrt(max(len(seen), 1)), _VERY_SLOW * fastest)
        if len(seen) and abs(float(seen.mean())) > least:
            zero[together] = False
    return zero
