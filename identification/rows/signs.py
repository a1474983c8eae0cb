"""Whether load, sinkage, torque and drawbar pull are measured in the directions that their columns are defined in."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.findings import Finding, warning
from ...framework.core.recording.mends import TURNED, mend
from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Wheel
from .gate import balanced

_REVERSED = 0.9
"""Share of rows below zero from which on a channel has the opposite sign [-]."""

_CLEARLY = 0.03
"""Sinkage, or torque, so far below zero is no reading of a sensor with a small offset [radii, loads at the rim]."""

_DRIVEN, _BRAKED = 0.1, -0.2
"""From these slips on a wheel is driven, or braked, whatever the error of its radius [-]. Tips of lugs that carry a
wheel at 1.15 radii make a slip of -0.13 of none."""

_FEWEST_TORQUES, _FEWEST_PULLS = 5, 8
"""Fewest rows for a sign, and for a correlation."""

_WIDE = 0.1
"""Least range of the torque, over radius and load, against which the pull is judged [-]."""

_AGAINST, _FALLS, _WITHOUT_TORQUE = -0.5, -0.3, -0.7
"""Correlation of pull and torque, both over the load, and slope, below which the one falls as the other rises; the
correlation of pull and slip where there is no torque. Of 511 recordings by others none has a correlation with the
torque below -0.04; of 3000 textbook wheels that slip-sinkage buries 59 are doubted, and none refused [-].
"""

_CLIMBS, _TOO_LITTLE = 0.05, 0.5
"""Least pull over load of a wheel that climbs, and share of it below which torque over radius cannot be right [-]."""

_NEARLY_ALL = 0.9
"""Share of rows in which a pull of the other sign would leave the ground a resistance, as it does [-]."""

_MORE_THAN_DRIVEN = 0.03
"""Excess of pull over torque over radius, per load, that is more than an offset [-]."""

_SLOPING = 0.05
"""Slope from which on gravity may be part of the recorded pull [rad]."""

_STEEPEST = 1.4
"""Largest entry angle, that of a wheel nearly buried: beyond it tangents diverge [rad]."""


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
        seen = table.observed(name)
        if not seen.size or np.median(seen) >= -least:
            continue
        share = float(np.mean(seen < 0.0))
        if share > _REVERSED:
            raise InputError(
                table.source, f"{np.median(seen):.3g} (median), {100.0 * share:.0f} % of the rows below 0",
                expected=f"{expected}: {mend(table, name, TURNED)}", place=f"column {name}",
            )  # fmt: skip


def check_torque(table: WheelTable, wheel: Wheel, reasons: np.ndarray) -> Finding | None:
    """Refuse a torque that brakes a wheel whose slip is that of a driven one, or the reverse.

    Parameters
    ----------
    table, wheel
        Rows of one wheel's geometry, and the wheel.
    reasons : (n,)
        Why each row is not used, ``""`` where it is.

    Returns
    -------
    Finding or None
        ``torque_sign``, where only the lesser part of the rows contradict each other.

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
    driven, braked = (reasons == "") & (slip > _DRIVEN) & seen, balanced(reasons) & (slip < _BRAKED) & seen
    clearly = _CLEARLY * wheel.radius_m * load
    if _mostly_below(torque[driven], clearly[driven]):
        raise _contradiction(table, torque[driven], f"above {_DRIVEN:g} below 0", "torque_Nm")
    if not _mostly_below(-torque[braked], clearly[braked]):
        return None
    if braked.sum() > driven.sum():
        raise _contradiction(table, torque[braked], f"below {_BRAKED:g} above 0", "slip")
    return warning(
        "torque_sign", torque_Nm=float(np.median(torque[braked])), share=float(np.mean(torque[braked] > 0.0)),
        slip=_BRAKED, mend=mend(table, "torque_Nm", TURNED),
    )  # fmt: skip


def _mostly_below(values: np.ndarray, clearly: np.ndarray) -> bool:
    """Say whether nearly all values (n,), of enough rows, are below zero, and their median by more than is clear."""
    return (
        len(values) >= _FEWEST_TORQUES
        and float(np.mean(values < 0.0)) > _REVERSED
        and float(np.median(values)) < -float(np.median(clearly))
    )


def _contradiction(table: WheelTable, torque: np.ndarray, rows: str, turned: str) -> InputError:
    """Make the error that torques (n,) [N m] and slips have not the same sign, and say which is likely turned."""
    share = 100.0 * max(float(np.mean(torque < 0.0)), float(np.mean(torque > 0.0)))
    return InputError(
        table.source, f"{np.median(torque):.3g} (median), {share:.0f} % of the rows with a slip {rows}",
        expected="torque and slip both positive where the wheel drives, both negative where it is braked: "
        f"{mend(table, turned, TURNED)}",
        place="column torque_Nm" if turned == "torque_Nm" else "columns torque_Nm and slip",
    )  # fmt: skip


def check_torque_carries(table: WheelTable, wheel: Wheel) -> None:
    """Refuse a torque that cannot make the pull which carries the vehicle: no wheel pulls more than T/r.

    Parameters
    ----------
    table
        Rows with `torque_Nm` [N m], `load_N` [N], and `drawbar_pull_N` as computed from the weight [N].
    wheel
        Its radius [m].

    Raises
    ------
    InputError
        T/r is less than half of the pull in most rows that climb or accelerate.
    """
    torque, pull, load = (table.get(name) for name in ("torque_Nm", "drawbar_pull_N", "load_N"))
    if torque is None or pull is None or load is None:
        return
    rows = np.isfinite(torque) & (pull > _CLIMBS * load)
    if rows.sum() < _FEWEST_PULLS:
        return
    thrust = torque[rows] / wheel.radius_m
    if float(np.median(thrust / pull[rows])) < _TOO_LITTLE:
        raise InputError(
            table.source, place="torque_Nm",
            problem=f"over the radius it is {np.median(thrust):.3g} N (median) in rows in which the wheel pulls "
            f"{np.median(pull[rows]):.3g} N uphill",
            expected=f"the torque at the axle, N m, after the gear: {mend(table, 'torque_Nm', 'scale = RATIO')}",
        )  # fmt: skip


def check_pull(table: WheelTable, wheel: Wheel, reasons: np.ndarray) -> Finding | None:
    """Refuse a drawbar pull that is measured the other way round, and doubt one that may be.

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

    Returns
    -------
    Finding or None
        ``pull_sign``, or ``pull_sign_by_slip`` where there is no torque.

    Raises
    ------
    InputError
        The pull falls as torque rises, and is what no contact of that depth makes it, on ground not said to slope.
    """
    pull, load, torque = (table.get(name) for name in ("drawbar_pull_N", "load_N", "torque_Nm"))
    if pull is None or load is None:
        return None
    rows = balanced(reasons) & np.isfinite(pull) & (load > 0.0)
    driven = None if torque is None else rows & np.isfinite(torque)
    if torque is None or driven is None or driven.sum() < _FEWEST_PULLS:
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
    sinkage = table.get("sinkage_m")
    depth = np.full(len(thrust), math.nan) if sinkage is None else sinkage[driven]
    pitch = np.abs(table.observed("pitch_rad"))
    slopes = bool(pitch.size) and float(np.quantile(pitch, 0.9)) > _SLOPING
    if not slopes and _impossible(thrust, pulled, depth, wheel):
        raise InputError(
            table.source, place="column drawbar_pull_N",
            problem=f"falls by {-slope:.2g} N for each newton that torque over radius rises by (correlation "
            f"{correlation:.2f})",
            expected="positive forwards, for a wheel that is driven harder pulls more: "
            f"{mend(table, 'drawbar_pull_N', TURNED)}",
        )  # fmt: skip
    mended = mend(table, "drawbar_pull_N", TURNED)
    return warning("pull_sign", slope=slope, correlation=correlation, mend=mended)


def _impossible(thrust: np.ndarray, pulled: np.ndarray, depth_m: np.ndarray, wheel: Wheel) -> bool:
    """Say whether pull over load (n,) is impossible at T/(r W) (n,): less than with all force at the front of the
    contact, in most of the third of the rows in which the wheel is driven hardest, or more than T/r in most of the
    third in which it is driven least.
    """
    entry = np.minimum(np.arccos(np.clip(1.0 - depth_m / wheel.radius_m, 0.0, 1.0)), _STEEPEST)
    short = pulled - (thrust / np.cos(entry) - np.tan(entry))
    hardest = short[(thrust >= np.quantile(thrust, 2 / 3)) & np.isfinite(short)]
    beyond = (pulled - thrust)[thrust <= np.quantile(thrust, 1 / 3)]
    return (len(hardest) > 1 and float(np.median(hardest)) < 0.0) or float(np.median(beyond)) > _MORE_THAN_DRIVEN


def _by_slip(table: WheelTable, rows: np.ndarray) -> Finding | None:
    """Doubt a pull that is forwards where slip is least and backwards where it is largest, in rows (n,) of bool."""
    slip, pull, load = table.get("slip"), table["drawbar_pull_N"], table["load_N"]
    if slip is None:
        return None
    rows = rows & np.isfinite(slip)
    slips, pulled = slip[rows], pull[rows] / load[rows]
    if len(slips) < _FEWEST_PULLS or np.ptp(slips) == 0.0 or np.ptp(pulled) == 0.0:
        return None
    first, last = (slips <= np.quantile(slips, 1 / 3)), (slips >= np.quantile(slips, 2 / 3))
    turned = np.median(pulled[first]) > 0.0 > np.median(pulled[last])
    if not turned or np.corrcoef(slips, pulled)[0, 1] > _WITHOUT_TORQUE:
        return None
    return warning("pull_sign_by_slip", mend=mend(table, "drawbar_pull_N", TURNED))
