"""Whether the pull can be measured forwards, by what torque, sinkage and slip say of it."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Wheel
from .plausible import FEWEST_TOLD, is_steady

_WIDE = 0.1
"""Range of the torque, over radius and load, beside which a course of the pull means something [-]."""

_AGAINST, _FALLS, _WITHOUT_TORQUE = -0.5, -0.3, -0.7
"""Correlation of pull and torque, both over the load, and slope, below which the one falls as the other rises; the
correlation of pull and slip where there is no torque. Of 511 recordings by other hands none has a correlation with the
torque below -0.04; of 3000 textbook wheels that slip-sinkage buries 59 are doubted, and none refused [-].
"""

_NEARLY_ALL = 0.9
"""Share of rows in which a pull of the other sign would leave the ground a resistance, as it does [-]."""

_MORE_THAN_DRIVEN = 0.03
"""Pull beyond what the torque pushes, over the load, that is no zero a little off [-]."""

_SLOPING = 0.05
"""Slope from which on gravity may have its share in what is called pull [rad]."""

_STEEPEST = 1.4
"""Entry angle of a wheel that is as good as buried: steeper ones only make tangents run away [rad]."""


def check_pull(table: WheelTable, wheel: Wheel, reasons: np.ndarray) -> str | None:
    """Refuse a pull that is measured the other way round, and say, in words, where it may be; None where it is not so.

    On level ground DP = T/r - R: at like loads pull rises with torque, but for a resistance R that grows faster still,
    as where a wheel digs itself in. It is beyond doubt where, besides, R is impossible one way: the pull falls short of
    DP = T / (r cos theta_1) - W tan theta_1, which is all the force at the foremost point of the contact (by the
    moments about the axle), or it is more than T/r. Towed and braked wheels, and offsets, are on the same lines.

    Parameters
    ----------
    table, wheel
        Rows of one wheel's geometry: `drawbar_pull_N` and `load_N` [N], `torque_Nm` or `slip`, `sinkage_m` where there
        is one; and the wheel's radius [m].
    reasons : (n,)
        Why each row is not used, ``""`` where it is.

    Raises
    ------
    InputError
        The pull falls as torque rises, and is what no contact of that depth makes it, on ground not said to slope.
    """
    pull, load, torque = (table.get(name) for name in ("drawbar_pull_N", "load_N", "torque_Nm"))
    if pull is None or load is None:
        return None
    rows = is_steady(reasons) & np.isfinite(pull) & (load > 0.0)
    driven = None if torque is None else rows & np.isfinite(torque)
    if torque is None or driven is None or driven.sum() < FEWEST_TOLD:
        return _by_slip(table, rows)
    thrust, pulled = torque[driven] / (wheel.radius_m * load[driven]), pull[driven] / load[driven]
    least, most = np.quantile(thrust, (0.05, 0.95))
    if most - least < _WIDE or np.ptp(pulled) == 0.0:
        return None
    correlation = float(np.corrcoef(thrust, pulled)[0, 1])
    slope = float(np.polyfit(thrust, pulled, 1)[0])
    sensible = float(np.mean(thrust + pulled > 0.0)) > _NEARLY_ALL
    if correlation > _AGAINST or slope > _FALLS or not sensible:
        return None
    told = f"falls by {-slope:.2g} N for each newton that torque over radius rises by (correlation {correlation:.2f})"
    sinkage = table.get("sinkage_m")
    depth = np.full(len(thrust), math.nan) if sinkage is None else sinkage[driven]
    if not _slopes(table) and _impossible(thrust, pulled, depth, wheel):
        raise InputError(
            table.source, told, expected="positive forwards: a wheel that is driven harder pulls more",
            place="column drawbar_pull_N",
        )  # fmt: skip
    return f"drawbar_pull_N {told}: it may be measured the other way round (positive forwards); it is used as it is"


def _impossible(thrust: np.ndarray, pulled: np.ndarray, depth_m: np.ndarray, wheel: Wheel) -> bool:
    """Tell whether pull over load (n,) is what no contact makes it beside T/(r W) (n,): less than all force at its
    front does, in most of the third of the rows in which the wheel is driven hardest, or more than T/r in most of the
    third in which it is driven least.
    """
    entry = np.minimum(np.arccos(np.clip(1.0 - depth_m / wheel.radius_m, 0.0, 1.0)), _STEEPEST)
    short = pulled - (thrust / np.cos(entry) - np.tan(entry))
    hardest = short[(thrust >= np.quantile(thrust, 2 / 3)) & np.isfinite(short)]
    beyond = (pulled - thrust)[thrust <= np.quantile(thrust, 1 / 3)]
    return (len(hardest) > 1 and float(np.median(hardest)) < 0.0) or float(np.median(beyond)) > _MORE_THAN_DRIVEN


def _slopes(table: WheelTable) -> bool:
    """Tell whether the ground is said to slope."""
    pitch = table.get("pitch_rad")
    seen = np.empty(0) if pitch is None else np.abs(pitch[np.isfinite(pitch)])
    return bool(seen.size) and float(np.quantile(seen, 0.9)) > _SLOPING


def _by_slip(table: WheelTable, rows: np.ndarray) -> str | None:
    """Say, in words, that the pull of rows (n,) is forwards where slip is least and backwards where it is largest."""
    slip, pull, load = table.get("slip"), table["drawbar_pull_N"], table["load_N"]
    if slip is None:
        return None
    rows = rows & np.isfinite(slip)
    slips, pulled = slip[rows], pull[rows] / load[rows]
    if len(slips) < FEWEST_TOLD or np.ptp(slips) == 0.0 or np.ptp(pulled) == 0.0:
        return None
    first, last = (slips <= np.quantile(slips, 1 / 3)), (slips >= np.quantile(slips, 2 / 3))
    turned = np.median(pulled[first]) > 0.0 > np.median(pulled[last])
    if not turned or np.corrcoef(slips, pulled)[0, 1] > _WITHOUT_TORQUE:
        return None
    return (
        "drawbar_pull_N is forwards where slip is least and backwards where it is largest: it may be measured the "
        "other way round (positive forwards), or slip; they are used as they are"
    )
