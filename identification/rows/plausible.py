"""Whether channels can be what their names say: signs, sizes, clocks, and sensors that are stuck."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Wheel
from .trials import is_of_trials

_ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
"""What the ground answers with varies; a load may be the wheel's share of the weight, and a slip may be held."""

_SLOWEST_S, _ROWS_OF_A_DRIVE = 2.0, 50
"""A drive of so many rows is logged more often than at such intervals."""

_FEWEST_ROWS = 5
"""Rows of which a sensor that moves does not read the same."""

_REVERSED = 0.9
"""Share of rows below zero from which on a channel is measured the other way round [-]."""

_MOST_PULLED, _LARGEST = 20.0, 0.9
"""Loads that a wheel pulls, or turns against at its rim, at most [-], and which quantiles are compared. On the soils of
J. Y. Wong, *Terramechanics and Off-Road Vehicle Engineering* (2010), Table 2.3, the textbook wheel reaches 1 where its
load is 3 kPa of its radius times its width or more, 2 on snow, and 10 where it is 0.1 kPa on the most cohesive snow
(Sweden, 6 kPa); real sand gave 2.5 (`single-wheel-sand`, a locked wheel). A load in kN shows as 20 to 300."""

_CLEARLY = 0.03
"""Sinkage so far below zero, or torque, is no reading of a sensor whose zero is a little off [radii, loads at the
rim]."""

_DRIVEN, _BRAKED = 0.1, -0.2
"""From these slips on a wheel is driven, or braked, whatever its radius is off by [-]: the shear stress under it is
forwards, or backwards. Tips of lugs that carry a wheel at 1.15 radii make a slip of -0.13 of none."""

FEWEST_TOLD = 8
"""Rows of which a course, or an upper tenth, tells something."""


def is_steady(reasons: np.ndarray) -> np.ndarray:
    """Tell rows (n,) whose forces balance, by why each is not used: those that are, and those only braked."""
    return np.array([reason == "" or str(reason).startswith("braked") for reason in reasons], dtype=bool)


def check_signs(table: WheelTable, wheel: Wheel) -> None:
    """Refuse a load or a sinkage that is measured the other way round.

    Raises
    ------
    InputError
        Nearly all rows of one are below zero.
    """
    for name, least, expected in (
        ("load_N", 0.0, "the wheel's load, positive"),
        ("sinkage_m", _CLEARLY * wheel.radius_m, "positive downwards"),
    ):
        values = table.get(name)
        seen = np.empty(0) if values is None else values[np.isfinite(values)]
        if not seen.size or np.median(seen) >= -least:
            continue
        share = float(np.mean(seen < 0.0))
        if share > _REVERSED:
            raise InputError(
                table.source, f"{np.median(seen):.3g} (median), {100.0 * share:.0f} % of the rows below 0",
                expected=expected, place=f"column {name}",
            )  # fmt: skip


def check_torque(table: WheelTable, wheel: Wheel, reasons: np.ndarray) -> str | None:
    """Refuse a torque that brakes a wheel which its slip says is driven, or drives one which it says is braked: one of
    them is measured the other way round. Say, in words, where only the lesser part of the rows is so; else None.

    Parameters
    ----------
    table, wheel
        Rows of one wheel's geometry, and the wheel.
    reasons : (n,)
        Why each row is not used, ``""`` where it is.

    Raises
    ------
    InputError
        Of the rows that are used and slip, nearly all have a torque below zero, and clearly so; or of those that are
        braked, and are more than the driven ones, nearly all have one above it.
    """
    torque, slip, load = table.get("torque_Nm"), table.get("slip"), table.get("load_N")
    if torque is None or slip is None or load is None:
        return None
    seen = np.isfinite(torque) & (load > 0.0)
    driven, braked = (reasons == "") & (slip > _DRIVEN) & seen, is_steady(reasons) & (slip < _BRAKED) & seen
    clearly = _CLEARLY * wheel.radius_m * load
    if _mostly_below(torque[driven], clearly[driven]):
        raise _contradicted(table, torque[driven], f"above {_DRIVEN:g} below 0", "column torque_Nm")
    if not _mostly_below(-torque[braked], clearly[braked]):
        return None
    error = _contradicted(table, torque[braked], f"below {_BRAKED:g} above 0", "columns torque_Nm and slip")
    if braked.sum() > driven.sum():
        raise error
    return f"torque_Nm is {error.problem}, as if a braked wheel were driven: check its sign there, and that of the slip"


def _mostly_below(values: np.ndarray, clearly: np.ndarray) -> bool:
    """Tell whether nearly all values (n,), of enough rows, are below zero, and their median by more than is clear."""
    return (
        len(values) >= _FEWEST_ROWS
        and float(np.mean(values < 0.0)) > _REVERSED
        and float(np.median(values)) < -float(np.median(clearly))
    )


def _contradicted(table: WheelTable, torque: np.ndarray, rows: str, place: str) -> InputError:
    """Say that torques (n,) [N m] and slips have not the same sign."""
    share = 100.0 * max(float(np.mean(torque < 0.0)), float(np.mean(torque > 0.0)))
    return InputError(
        table.source, f"{np.median(torque):.3g} (median), {share:.0f} % of the rows with a slip {rows}",
        expected="torque and slip both positive where the wheel drives, both negative where it is braked", place=place,
    )  # fmt: skip


def check_sizes(table: WheelTable, wheel: Wheel) -> None:
    """Refuse a sinkage that no wheel has: it is in another unit.

    Raises
    ------
    InputError
        Half of the rows lie deeper than the wheel is high.
    """
    sinkage = table.get("sinkage_m")
    if sinkage is None or not np.isfinite(sinkage).any():
        return
    middle = float(np.nanmedian(sinkage))
    if abs(middle) > 2.0 * wheel.radius_m:
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
    load = table.get("load_N")
    if load is not None and np.isfinite(load).any() and not np.nanmax(load) > 0.0:
        raise InputError(
            table.source, f"{np.nanmax(load):.3g} at most", expected="the wheel's load, positive", place="column load_N"
        )
    for name, lever_m in (("drawbar_pull_N", 1.0), ("torque_Nm", wheel.radius_m)):
        _check_load(table, name, lever_m)


def _check_load(table: WheelTable, name: str, lever_m: float) -> None:
    """Refuse a load beside which a channel, over its lever, is larger than any soil makes it."""
    if "load_N" not in table or name not in table:
        return
    both = (table["load_N"] > 0.0) & np.isfinite(table[name])
    if not both.any():
        return
    load, answer = (float(np.quantile(np.abs(table[each][both]), _LARGEST)) for each in ("load_N", name))
    if answer > _MOST_PULLED * load * lever_m:
        unit = name.rpartition("_")[2]
        raise InputError(
            table.source, f"{load:.3g} N and {answer:.3g} {unit} (upper tenth of the rows)",
            place=f"columns load_N and {name}",
            expected=f"both in SI units, for no soil bears more than {_MOST_PULLED * load * lever_m:.3g} {unit} there",
        )  # fmt: skip


def slow_clock(table: WheelTable) -> str | None:
    """Say, in words, that rows (n,) of a drive follow each other as slowly as if time were not in seconds, else None.

    Parameters
    ----------
    table
        Rows of one wheel, in order of time, slip derived.
    """
    if len(table) < _ROWS_OF_A_DRIVE or "time_s" not in table or is_of_trials(table):
        return None
    step = float(np.median(np.diff(table["time_s"])))
    if not step > _SLOWEST_S:
        return None
    return (
        f"rows lie {step:.3g} s apart (median), yet slip and load go on from row to row: if time_s is not in seconds, "
        "speeds along the drive, accelerations and lags are wrong"
    )


def without_stuck(table: WheelTable) -> tuple[WheelTable, list[str]]:
    """Leave out answers that never change, and say so in words.

    Parameters
    ----------
    table
        Rows of one wheel.

    Returns
    -------
    WheelTable
        The same rows, NaN where a channel was left out.
    list
        A sentence for each of those.
    """
    columns, notes = dict(table.columns), []
    for name in _ANSWERS:
        values = table.get(name)
        seen = np.empty(0) if values is None else values[np.isfinite(values)]
        if len(seen) >= _FEWEST_ROWS and np.ptp(seen) == 0.0:
            notes.append(f"{name} never changes: it is left out, as of a sensor that is stuck or absent")
            columns[name] = np.full(len(table), math.nan)
    return WheelTable(columns, table.wheel, table.run, table.source), notes
