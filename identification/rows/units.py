"""Whether load and pull can be in newtons, by what they are beside each other and the torque."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Wheel
from .gate import GRAVITY_M_S2
from .plausible import FEWEST_TOLD, is_steady

_DRIVEN, _UPPER = 0.02, 0.9
"""Slip from which on rows count, and which quantile of them is looked at [-]."""

_UNUSUAL, _USUAL = 1.8, (0.1, 1.2)
"""Torque over radius and load, or pull over load, beyond which hardly any driven wheel gets, and what they get to [-].
The most of 544 recordings by other hands is 1.44."""

_FLAT, _RISES, _TOGETHER = 0.15, (0.4, 1.6), 0.6
"""Slope of pull over torque over radius that no wheel has, slopes that they have, and the correlation from which on
there is one [-]. Of the recordings none with such a correlation has a slope below 0.21."""

_SMALL, _PULLS = 0.02, (0.05, 1.2)
"""Pull over load that is next to nothing, and what is usual, where no torque tells more [-]."""

_UNITS: tuple[tuple[str, Callable[[np.ndarray], np.ndarray | float]], ...] = (
    ("divided by the load", lambda load: load),
    ("in kN", lambda load: 1e3),
    ("in kgf", lambda load: GRAVITY_M_S2),
)
"""What pulls are given as, and what makes newtons of each, by the load (n,) [N]."""


def load_in_kilograms(table: WheelTable, wheel: Wheel, reasons: np.ndarray) -> str | None:
    """Say, in words, that the load is probably in kilograms: the torque, or where there is none the pull, is beyond
    what sand bears under it and would be usual were it 9.81 times as large; None where it is not so.

    Parameters
    ----------
    table, wheel
        Rows of one wheel's geometry: `load_N` [N], `slip`, `torque_Nm` or `drawbar_pull_N`; and its radius [m].
    reasons : (n,)
        Why each row is not used, ``""`` where it is.
    """
    for name, said, lever_m in (
        ("torque_Nm", "torque over radius", wheel.radius_m),
        ("drawbar_pull_N", "the pull", 1.0),
    ):
        found = _driven(table, name, reasons)
        if found is None:
            continue
        size = float(np.quantile(np.abs(table[name][found]) / (lever_m * table["load_N"][found]), _UPPER))
        likely = size / GRAVITY_M_S2
        if size < _UNUSUAL or not _USUAL[0] <= likely <= _USUAL[1]:
            return None
        return (
            f"{said} is {size:.2g} times the load (upper tenth of the driven rows), more than sand bears, and would be "
            f"{likely:.2g} times, as usual, were load_N in kg: check its unit; the load is used as it is"
        )
    return None


def pull_in_another_unit(table: WheelTable, wheel: Wheel, reasons: np.ndarray) -> str | None:
    """Say, in words, as what the pull is probably given: next to nothing beside load and torque, it follows the torque,
    or where there is none the slip, and would be usual in another unit; None where it is not so.

    Parameters
    ----------
    table, wheel, reasons
        As of `load_in_kilograms`.
    """
    rows = _driven(table, "drawbar_pull_N", reasons)
    if rows is None:
        return None
    torque = table.get("torque_Nm")
    if torque is not None and np.isfinite(torque[rows]).sum() >= FEWEST_TOLD:
        rows = rows & np.isfinite(torque)
        beside = torque[rows] / (wheel.radius_m * table["load_N"][rows])
    else:
        torque, beside = None, table["slip"][rows]
    load, pull = table["load_N"][rows], table["drawbar_pull_N"][rows]
    if np.ptp(beside) == 0.0:
        return None
    most = float(np.quantile(np.abs(pull), _UPPER))

    def fits(factor: np.ndarray | float, limits: tuple[float, float]) -> bool:
        pulled = factor * pull / load
        if np.ptp(pulled) == 0.0 or abs(np.corrcoef(beside, pulled)[0, 1]) < _TOGETHER:
            return False
        slope = np.polyfit(beside, pulled, 1)[0] if torque is not None else np.quantile(np.abs(pulled), _UPPER)
        return bool(limits[0] <= abs(slope) <= limits[1])

    small, usual = (_FLAT, _RISES) if torque is not None else (_SMALL, _PULLS)
    likely = [unit for unit, factor in _UNITS if fits(factor(load), usual)] if fits(1.0, (0.0, small)) else []
    if not likely:
        return None
    return (
        f"drawbar_pull_N is {most:.2g} N (upper tenth) under loads of {np.median(load):.3g} N (median), and would be "
        f"usual were it {' or '.join(likely)}: check its unit; the pull is used as it is"
    )


def _driven(table: WheelTable, name: str, reasons: np.ndarray) -> np.ndarray | None:
    """Rows (n,) in which a channel was seen and the wheel is driven; None where they are too few."""
    values, load, slip = table.get(name), table.get("load_N"), table.get("slip")
    if values is None or load is None or slip is None:
        return None
    rows = is_steady(reasons) & np.isfinite(values) & (load > 0.0) & (slip > _DRIVEN)
    return rows if rows.sum() >= FEWEST_TOLD else None
