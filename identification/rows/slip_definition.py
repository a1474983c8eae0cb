"""Whether recorded slip is what a wheel file calls slip, by the speeds and by how torque and pull go with it."""

from __future__ import annotations

import numpy as np
from scipy.stats import rankdata
from scipy.stats import t as t_distribution

from ...framework.core.errors import InputError
from ...framework.core.findings import Finding, warning
from ...framework.core.recording.mends import mend
from ...framework.core.recording.slip_definitions import FORMULAS, definitions_of
from ...framework.core.recording.types import WheelTable
from ...framework.core.recording.wheel_file import slip_from_speeds
from ...framework.core.vehicle import Wheel

_FEWEST = 8
"""Fewest rows for an answer [-]."""

_AGREES, _DIFFERS = 0.03, 0.05
"""Slip within the former of what the speeds give in nine rows of ten is of that definition; a median difference of more
than the latter is of another one [-]."""

_TOGETHER, _CHANCE, _LEAST_RANGE = -0.5, 1e-4, 0.2
"""Largest correlation with slip of what falls, largest chance of it where nothing falls, least range of slip [-]."""

_LOST = 0.7
"""Share of the torque that is left at most at the largest third of slips [-]: sand that softens keeps more, by the
ratio of its friction at large displacement to its peak."""


def check_by_speeds(table: WheelTable, wheel: Wheel) -> None:
    """Refuse a recorded slip that is by another definition what the speeds of rim and travel give.

    Parameters
    ----------
    table
        Channels of one wheel as recorded: `slip` [-], `wheel_speed_rad_s` [rad/s] and `travel_speed_m_s` [m/s].
    wheel
        Its radius [m].

    Raises
    ------
    InputError
        It is, and is not by that of a wheel file.
    """
    recorded, rim, travel = (table.get(name) for name in ("slip", "wheel_speed_rad_s", "travel_speed_m_s"))
    if recorded is None or rim is None or travel is None:
        return
    slip = slip_from_speeds(rim * wheel.radius_m, travel)
    seen = np.isfinite(recorded) & np.isfinite(slip)
    if seen.sum() < _FEWEST or float(np.median(np.abs(recorded - slip)[seen])) < _DIFFERS:
        return
    if len(found := definitions_of(recorded[seen], slip[seen], _AGREES)) == 1:
        line = mend(table, "slip", f'definition = "{found[0]}"')
        raise InputError(
            table.source, f"is {FORMULAS[found[0]]} by the two speeds and a radius of {wheel.radius_m:g} m",
            expected=f"{FORMULAS['slip']}; to convert it: {line}", place="column slip",
        )  # fmt: skip


def check_by_forces(table: WheelTable, rows: np.ndarray) -> Finding | None:
    """Refuse a slip with which the torque falls, at like loads, and the pull where there is one; doubt one with which
    only one of them does.

    The torque of a driven wheel rises with slip, as the shear displacement under it does (P. A. Janosi and B. Hanamoto,
    1961): one that falls is over a ratio of speeds V/(r omega), which falls where slip rises.

    Parameters
    ----------
    table
        Rows of one wheel's geometry: `load_N` [N], `slip` [-], `torque_Nm` [N m], `drawbar_pull_N` [N].
    rows : (n,)
        Which of them balance.

    Returns
    -------
    Finding or None
        ``slip_definition``, where only one of the two falls, or there is no torque and the pull does.

    Raises
    ------
    InputError
        Torque and pull fall, or the torque does and there is no pull.
    """
    load, slip = table.get("load_N"), table.get("slip")
    if load is None or slip is None:
        return None
    rows = rows & (load > 0.0) & np.isfinite(slip)
    falls = {
        name: _falls(table[name][rows] / load[rows], slip[rows], load[rows])
        for name in ("torque_Nm", "drawbar_pull_N")
        if name in table
    }
    if not any(falls.values()):
        return None
    line = mend(table, "slip", 'definition = "speed_ratio"')
    falling = [name for name, each in falls.items() if each]
    if not falls.get("torque_Nm") and "torque_Nm" in falls:
        return None  # a pull may fall where the wheel digs in
    if len(falling) < len(falls) or "torque_Nm" not in falls:
        return warning("slip_definition", channel=falling[0], mend=line)
    raise InputError(
        table.source, f"{' and '.join(falling)} fall at like loads as it rises",
        expected=f"slip, with which forces rise; if it is {FORMULAS['speed_ratio']}: {line}", place="column slip",
    )  # fmt: skip


def _falls(share: np.ndarray, slip: np.ndarray, load: np.ndarray) -> bool:
    """Say whether shares of the load (n,) fall by much as slip (n,) rises, the loads (n,) being equal: by Spearman's
    partial rank correlation, with a test of Student's t.
    """
    seen = np.isfinite(share)
    if seen.sum() < _FEWEST or float(np.ptp(np.quantile(slip[seen], (0.05, 0.95)))) < _LEAST_RANGE:
        return False
    share, slip, load = share[seen], slip[seen], load[seen]
    least, most = np.quantile(slip, (1 / 3, 2 / 3))
    if float(np.median(share[slip >= most])) > _LOST * float(np.median(share[slip <= least])):
        return False
    ranks = np.column_stack([rankdata(each) for each in (share, slip, load)])
    ranks -= ranks.mean(axis=0)
    by_load = ranks[:, 2:] @ (ranks[:, 2] @ ranks[:, :2] / max(float(ranks[:, 2] @ ranks[:, 2]), 1.0))[None, :]
    left = ranks[:, :2] - by_load
    size = float(np.sqrt(np.prod(np.sum(left**2, axis=0))))
    if size == 0.0:
        return False
    correlation, freedom = float(left[:, 0] @ left[:, 1]) / size, len(left) - 3
    statistic = correlation * np.sqrt(freedom / max(1.0 - correlation**2, 1e-12))
    return correlation < _TOGETHER and bool(t_distribution.cdf(statistic, freedom) < _CHANCE)
