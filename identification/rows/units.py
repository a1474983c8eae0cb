"""Whether channels can be in the SI units of their columns: sizes that no wheel has, or that another unit explains."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.findings import Finding, warning
from ...framework.core.recording.types import WheelTable
from ...framework.core.recording.wheel_file import slip_from_speeds
from ...framework.core.vehicle import Wheel
from .gate import GRAVITY_M_S2, balanced

_MOST_PULLED, _LARGEST = 20.0, 0.9
"""Largest pull, or torque over radius, in loads [-], and the quantile compared. On the soils of
J. Y. Wong, *Terramechanics and Off-Road Vehicle Engineering* (2010), Table 2.3, the textbook wheel reaches 1 where its
load is 3 kPa of its radius times its width or more, 2 on snow, and 10 where it is 0.1 kPa on the most cohesive snow
(Sweden, 6 kPa); real sand gave 2.5 (`single-wheel-sand`, a locked wheel). A load in kN shows as 20 to 300."""

_FEWEST, _DRIVEN = 8, 0.02
"""Fewest rows for an upper tenth or a slope, and the slip from which on rows count [-]."""

_UNUSUAL, _USUAL = 1.8, (0.1, 1.2)
"""Torque over radius and load, or pull over load: an implausible value, and the usual range [-]. The largest of 544
recordings by others is 1.44."""

_FLAT, _RISES, _TOGETHER = 0.15, (0.4, 1.6), 0.6
"""Implausible slope of pull against torque over radius, the usual range, and the least correlation for a slope [-]. No
recording with such a correlation has a slope below 0.21."""

_SMALL, _PULLS = 0.02, (0.05, 1.2)
"""Negligible pull over load, and the usual range, where there is no torque [-]."""

_OF_PULL: tuple[tuple[str, Callable[[np.ndarray], np.ndarray | float]], ...] = (
    ("load", lambda load: load),
    ("kN", lambda load: 1e3),
    ("kgf", lambda load: GRAVITY_M_S2),
)
"""Units that pulls are given in, and the factor to newtons of each, by the load (n,) [N]."""

_STRANGE_SLIPS, _USUAL_SLIPS, _MOST, _FEWEST_SPEEDS = (-0.5, 0.8), (-0.3, 0.75), 0.95, 20
"""Slips beyond which hardly any drive stays throughout, the usual range, the share of rows in it [-], and fewest rows.
"""

_OF_SPEED = (
    ("wheel_speed_rad_s", "revolutions per minute", math.pi / 30.0),
    ("wheel_speed_rad_s", "degrees per second", math.pi / 180.0),
    ("wheel_speed_rad_s", "revolutions per second", 2.0 * math.pi),
    ("travel_speed_m_s", "km/h", 1.0 / 3.6),
    ("travel_speed_m_s", "cm/s", 0.01),
    ("travel_speed_m_s", "mm/s", 0.001),
)
"""Units that speeds are recorded in, and the factor to SI of each."""


def check_sizes(table: WheelTable, wheel: Wheel) -> None:
    """Refuse a sinkage that no wheel has: it is in another unit.

    Raises
    ------
    InputError
        Half of the rows lie deeper than the wheel is high.
    """
    sinkage = table.observed("sinkage_m")
    if sinkage.size and abs(middle := float(np.median(sinkage))) > 2.0 * wheel.radius_m:
        raise InputError(
            table.source, f"{middle:.3g} m (median)", place="column sinkage_m",
            expected=f"less than the wheel's diameter, {2.0 * wheel.radius_m:.3g} m",
        )  # fmt: skip


def check_load(table: WheelTable, wheel: Wheel) -> None:
    """Refuse a load that is never there, and one that no soil lets a wheel pull so much with, or turn against.

    Raises
    ------
    InputError
        No row has a load above 0, or the upper tenth of the rows pull, or turn against, too many times the load: one of
        them is in another unit.
    """
    load = table.observed("load_N")
    if load.size and not load.max() > 0.0:
        raise InputError(
            table.source, f"{load.max():.3g} at most", expected="the wheel's load, positive", place="column load_N"
        )
    for name, lever_m in (("drawbar_pull_N", 1.0), ("torque_Nm", wheel.radius_m)):
        if "load_N" not in table or name not in table:
            continue
        both = (table["load_N"] > 0.0) & np.isfinite(table[name])
        if not both.any():
            continue
        load, answer = (float(np.quantile(np.abs(table[each][both]), _LARGEST)) for each in ("load_N", name))
        most = _MOST_PULLED * load * lever_m
        if answer > most:
            unit = name.rpartition("_")[2]
            raise InputError(
                table.source, f"{load:.3g} N and {answer:.3g} {unit} (upper tenth of the rows)",
                place=f"columns load_N and {name}",
                expected=f"both in SI units, for no soil bears more than {most:.3g} {unit} there",
            )  # fmt: skip


def load_in_kilograms(table: WheelTable, wheel: Wheel, reasons: np.ndarray) -> Finding | None:
    """Doubt a load under which the torque, or where there is none the pull, is beyond what sand bears, and would be
    usual were it 9.81 times as large: ``load_unit``.

    Parameters
    ----------
    table, wheel
        Rows of one wheel's geometry: `load_N` [N], `slip`, `torque_Nm` or `drawbar_pull_N`; and its radius [m].
    reasons : (n,)
        Why each row is not used, ``""`` where it is.
    """
    for name, lever_m in (("torque_Nm", wheel.radius_m), ("drawbar_pull_N", 1.0)):
        found = _driven(table, name, reasons)
        if found is None:
            continue
        size = float(np.quantile(np.abs(table[name][found]) / (lever_m * table["load_N"][found]), _LARGEST))
        likely = size / GRAVITY_M_S2
        if size < _UNUSUAL or not _USUAL[0] <= likely <= _USUAL[1]:
            return None
        return warning("load_unit", channel=name, ratio=size, ratio_if_kg=likely)
    return None


def pull_in_another_unit(table: WheelTable, wheel: Wheel, reasons: np.ndarray) -> Finding | None:
    """Doubt a pull that is negligible against load and torque, follows the torque, or where there is none the slip,
    and would be usual in another unit: ``pull_unit``.

    Parameters
    ----------
    table, wheel, reasons
        As of `load_in_kilograms`.
    """
    rows = _driven(table, "drawbar_pull_N", reasons)
    if rows is None:
        return None
    torque = table.get("torque_Nm")
    if torque is not None and np.isfinite(torque[rows]).sum() >= _FEWEST:
        rows = rows & np.isfinite(torque)
        against = torque[rows] / (wheel.radius_m * table["load_N"][rows])
    else:
        torque, against = None, table["slip"][rows]
    load, pull = table["load_N"][rows], table["drawbar_pull_N"][rows]
    if np.ptp(against) == 0.0:
        return None

    def fits(factor: np.ndarray | float, limits: tuple[float, float]) -> bool:
        pulled = factor * pull / load
        if np.ptp(pulled) == 0.0 or abs(np.corrcoef(against, pulled)[0, 1]) < _TOGETHER:
            return False
        slope = np.polyfit(against, pulled, 1)[0] if torque is not None else np.quantile(np.abs(pulled), _LARGEST)
        return bool(limits[0] <= abs(slope) <= limits[1])

    small, usual = (_FLAT, _RISES) if torque is not None else (_SMALL, _PULLS)
    likely = [unit for unit, factor in _OF_PULL if fits(factor(load), usual)] if fits(1.0, (0.0, small)) else []
    if not likely:
        return None
    most = float(np.quantile(np.abs(pull), _LARGEST))
    return warning("pull_unit", pull_N=most, load_N=float(np.median(load)), units=likely)


def _driven(table: WheelTable, name: str, reasons: np.ndarray) -> np.ndarray | None:
    """Rows (n,) in which a channel was seen and the wheel is driven; None where they are too few."""
    values, load, slip = table.get(name), table.get("load_N"), table.get("slip")
    if values is None or load is None or slip is None:
        return None
    rows = balanced(reasons) & np.isfinite(values) & (load > 0.0) & (slip > _DRIVEN)
    return rows if rows.sum() >= _FEWEST else None


def speeds_in_another_unit(table: WheelTable, wheel: Wheel) -> Finding | None:
    """Doubt speeds whose slip is hardly any drive's all along, and would be a usual one were one of them in another
    unit: ``speed_unit``. None where slip was recorded (`kinematics.slip_disagreement`).

    Parameters
    ----------
    table
        Channels of one wheel as recorded: `wheel_speed_rad_s` [rad/s] and `travel_speed_m_s` [m/s].
    wheel
        Its radius [m].
    """
    rim, travel, recorded = (table.get(name) for name in ("wheel_speed_rad_s", "travel_speed_m_s", "slip"))
    if rim is None or travel is None:
        return None
    made = slip_from_speeds(rim * wheel.radius_m, travel)
    if recorded is not None and not np.allclose(recorded, made, rtol=1e-9, atol=1e-12, equal_nan=True):
        return None

    def slips(speeds: dict[str, np.ndarray]) -> np.ndarray:
        return slip_from_speeds(speeds["wheel_speed_rad_s"] * wheel.radius_m, speeds["travel_speed_m_s"])

    def share_within(speeds: dict[str, np.ndarray], limits: tuple[float, float]) -> float:
        slip = slips(speeds)
        slip = slip[np.isfinite(slip)]
        return float(np.mean((slip >= limits[0]) & (slip <= limits[1]))) if len(slip) else 0.0

    moving = ((rim * travel) > 0.0) & np.isfinite(slip_from_speeds(rim * wheel.radius_m, travel))
    speeds = {"wheel_speed_rad_s": rim[moving], "travel_speed_m_s": travel[moving]}
    if moving.sum() < _FEWEST_SPEEDS or share_within(speeds, _STRANGE_SLIPS) > 1.0 - _MOST:
        return None
    likely = [
        {"channel": name, "unit": unit}
        for name, unit, to_si in _OF_SPEED
        if share_within({**speeds, name: to_si * speeds[name]}, _USUAL_SLIPS) >= _MOST
    ]
    return warning("speed_unit", slip=float(np.median(slips(speeds))), likely=likely) if likely else None
