"""Where a drive is quasi-static enough for the wheel to be an instrument, and why not where it is not.

The wheel-soil equations are static (Iagnemma & Dubowsky 2002, Sec. 3: valid at low speed). The gate closes where
inertia, an immobilised or braked wheel, ground too hard to sink into, or a rut of an earlier wheel would pass for
soil.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import savgol_filter

from ...framework.core.recording.types import WheelTable
from ...framework.core.recording.wheel_file import STANDSTILL_M_S
from ...framework.core.vehicle import Wheel
from ..mechanics.textbook import CHANNELS
from .noise import running_median
from .standstill import stands

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class Limits:
    """When the gate is open.

    Parameters
    ----------
    froude
        Travel speed over sqrt(g r) [-]: below, the soil's own inertia is a few per cent of its weight.
    acceleration_m_s2
        5 % of gravity puts 5 % of the load into the drawbar pull.
    least_slip, most_slip
        A braked wheel pushes soil before it, which the driven wheel's equations leave out; beyond `most_slip` the wheel
        digs and the contact is not steady [-].
    least_sinkage, most_sinkage
        In radii [-]: ground that does not yield shows no soil; a buried wheel touches with more than its rim.
    slip_angle_rad
        Straight ahead, within 2 degrees.
    least_s, least_rows
        A shorter stretch is not used.
    bridge_s
        A shorter closure does not end a stretch; its rows are left out. Nor does a shorter gap of the clock.
    gap_steps
        A gap of so many usual steps of the clock is a pause, and ends a stretch [-].
    """

    froude: float = 0.35
    acceleration_m_s2: float = 0.05 * GRAVITY_M_S2
    least_slip: float = -0.02
    most_slip: float = 0.95
    least_sinkage: float = 0.01
    most_sinkage: float = 1.0
    slip_angle_rad: float = np.deg2rad(2.0)
    least_s: float = 5.0
    least_rows: int = 30
    bridge_s: float = 0.5
    gap_steps: float = 5.0


LIMITS = Limits()


@dataclass(frozen=True)
class Stretch:
    """Rows of one stretch of a drive: `rows` (m,) indices of open rows; `reason` says why it is not used, if not."""

    start_s: float
    end_s: float
    rows: np.ndarray
    reason: str = ""


def quasi_static(table: WheelTable, wheel: Wheel) -> np.ndarray:
    """Say of each row why the gate is closed there, ``""`` where it is open: (n,) of str.

    Parameters
    ----------
    table
        Rows of one wheel in order of time, or steady-state trials; slip derived already.
    wheel
        The wheel.
    """
    reasons = np.full(len(table), "", dtype=object)
    for text, closed in _checks(table, wheel):
        reasons[closed & (reasons == "")] = text
    return reasons


def balanced(reasons: np.ndarray) -> np.ndarray:
    """Rows (n,) whose forces balance, by why each is not used (n,): those that are used, and those only braked."""
    return np.array([reason == "" or str(reason).startswith("braked") for reason in reasons], dtype=bool)


def _checks(table: WheelTable, wheel: Wheel) -> Iterator[tuple[str, np.ndarray]]:
    seen = {name: np.isfinite(table[name]) if name in table else np.zeros(len(table), bool) for name in CHANNELS}
    slip, sinkage = table.get("slip"), table.get("sinkage_m")
    yield "at standstill", stands(table)
    yield "slip was not observed", ~seen["slip"]
    yield "neither load nor sinkage was observed", ~(seen["load_N"] | seen["sinkage_m"])
    yield "fewer than three channels were observed", np.sum(list(seen.values()), axis=0) < 3
    angle, passes = table.get("slip_angle_rad"), table.get("pass")
    if angle is not None:
        yield "not straight ahead (slip angle beyond 2 deg)", np.abs(angle) > LIMITS.slip_angle_rad
    if passes is not None:
        yield "in the rut of an earlier wheel", passes > 1
    yield "rolling backwards", _backwards(table, wheel)
    if "time_s" in table:
        speed = _smooth_speed(table, wheel)
        if speed is not None:
            fastest = LIMITS.froude * np.sqrt(GRAVITY_M_S2 * wheel.radius_m)
            yield f"too fast for a static balance (above {fastest:.2f} m/s)", np.abs(speed) > fastest
            rate = np.abs(_rate(table["time_s"], speed))
            yield f"accelerating (above {LIMITS.acceleration_m_s2:.2f} m/s2)", rate > LIMITS.acceleration_m_s2
    if slip is not None:
        steady = running_median(slip, 11) if "time_s" in table else slip
        yield f"braked (slip below {LIMITS.least_slip:g})", steady < LIMITS.least_slip
        yield f"digging in (slip above {LIMITS.most_slip:g})", steady > LIMITS.most_slip
    if sinkage is not None:
        shallow, deep = LIMITS.least_sinkage * wheel.radius_m, LIMITS.most_sinkage * wheel.radius_m
        smooth = running_median(sinkage, 11) if "time_s" in table else sinkage
        yield f"ground too hard to sink into (sinkage below {1000 * shallow:.1f} mm)", smooth < shallow
        yield f"wheel buried (sinkage above {1000 * deep:.0f} mm)", smooth > deep


def _backwards(table: WheelTable, wheel: Wheel) -> np.ndarray:
    """Rows, (n,), in which rim and travel, as far as they were measured, both go backwards.

    Torque and pull have the other sign there, which no soil gives them, and the ground is what the wheel has compacted
    before where it goes back the way that it came.
    """
    speeds = [table[name] * scale for name, scale in (("wheel_speed_rad_s", wheel.radius_m), ("travel_speed_m_s", 1.0))
              if name in table]  # fmt: skip
    smooth = [running_median(speed, 11) if "time_s" in table else speed for speed in speeds]
    return np.all([speed < -STANDSTILL_M_S for speed in smooth], axis=0) if smooth else np.zeros(len(table), bool)


def _smooth_speed(table: WheelTable, wheel: Wheel) -> np.ndarray | None:
    """Travel speed [m/s], (n,), without the sensor's noise; from rim speed and slip where it was not measured."""
    speed, rim, slip = table.get("travel_speed_m_s"), table.get("wheel_speed_rad_s"), table.get("slip")
    if speed is None:
        if rim is None or slip is None:
            return None
        speed = rim * wheel.radius_m * np.where(slip >= 0.0, 1.0 - slip, 1.0 / np.maximum(1.0 + slip, 1e-3))
    return running_median(speed, 11)


def _rate(time_s: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Rate of change [1/s] over about half a second, (n,); zero where the stretch is too short."""
    step = float(np.median(np.diff(time_s))) if len(time_s) > 2 else 0.0
    if not (step > 0.0 and np.isfinite(speed).all()):
        return np.zeros(len(speed))
    window = max(2 * round(0.3 / step) + 1, 5)
    if len(speed) < window:
        return np.zeros(len(speed))
    return np.asarray(savgol_filter(speed, window, polyorder=1, deriv=1, delta=step))


def find_stretches(time_s: np.ndarray, reasons: np.ndarray, boundaries_s: np.ndarray) -> list[Stretch]:
    """Cut a drive into stretches that can be used and stretches that cannot; a pause of the clock is in none.

    Parameters
    ----------
    time_s : (n,)
        Times [s] in order; several wheels may share one.
    reasons : (n,)
        From `quasi_static`.
    boundaries_s : (m,)
        Times at which the ground changes: no stretch runs across one.
    """
    instants, index = np.unique(time_s, return_inverse=True)
    opened = np.zeros(len(instants), dtype=bool)
    np.logical_or.at(opened, index, reasons == "")
    opened = _bridged(instants, opened)
    cell = np.searchsorted(np.sort(boundaries_s), instants, side="right")
    paused = _paused(instants)
    change = np.flatnonzero((np.diff(opened.astype(int)) != 0) | (np.diff(cell) != 0) | paused) + 1
    edges = [0, *change.tolist(), len(instants)]
    answer = []
    for first, last in pairwise(edges):
        inside = (index >= first) & (index < last)
        rows = np.flatnonzero(inside & (reasons == ""))
        goes_on = last < len(instants) and not paused[last - 1]
        start, end = float(instants[first]), float(instants[last if goes_on else last - 1])
        answer.append(Stretch(start, end, rows, _verdict(opened[first], reasons[inside], rows, end - start)))
    return answer


def _paused(instants: np.ndarray) -> np.ndarray:
    """Say of instants (n,) [s] where the next one comes after a pause: (n - 1,)."""
    step = np.diff(instants)
    usual = float(np.median(step)) if len(step) else 0.0
    return step > max(LIMITS.gap_steps * usual, LIMITS.bridge_s)


def _bridged(instants: np.ndarray, opened: np.ndarray) -> np.ndarray:
    """Open closures shorter than `Limits.bridge_s` that lie between open stretches."""
    answer = opened.copy()
    change = np.flatnonzero(np.diff(opened.astype(int)) != 0) + 1
    edges = [0, *change.tolist(), len(opened)]
    for first, last in pairwise(edges[1:-1]):
        if not opened[first] and instants[last] - instants[first] < LIMITS.bridge_s:
            answer[first:last] = True
    return answer


def _verdict(opened: bool, reasons: np.ndarray, rows: np.ndarray, length_s: float) -> str:
    if not opened:
        texts, counts = np.unique(reasons[reasons != ""].astype(str), return_counts=True)
        return str(texts[np.argmax(counts)])
    if length_s < LIMITS.least_s or len(rows) < LIMITS.least_rows:
        return f"too short ({length_s:.1f} s, {len(rows)} rows)"
    return ""
