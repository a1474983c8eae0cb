"""The rows of a recording that the mismatch tool compares: channels, covariates, noise and how rows are held out."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from ....framework.core.errors import InputError
from ....framework.core.recording.types import WheelTable
from ....framework.core.vehicle import Vehicle, Wheel
from ...effects.drive import drive_of, order_of, select_rows
from ...effects.effect import LOAD, PULL, SINKAGE, SLIP, TORQUE, Drive
from ...gate import LIMITS
from ...mechanics.textbook import CHANNELS
from ...noise import from_running_median, least_noise, sensor_noise
from ...standing import stands
from ...trials import AS_TRIALS, is_of_trials, without_clock, without_time
from ...unloaded import carries_nothing
from .averaging import restless, smoothed
from .lanes import lanes

ANSWERS = (TORQUE, SINKAGE, PULL)
"""Channels that the simulator answers with; load and slip are what the drive imposes."""

SIMULATED = "simulated_"
"""Prefix of columns that hold another simulator's answers."""

MOST_SLIP = 0.995
"""A wheel that slips by so much is stuck: its channels say nothing of the soil any longer [-]."""

LEAST_ROWS = 5
_FEW_ROWS = 20
MOST_ROWS = 1500
"""A recording with more rows is thinned to about this number, in stretches so that neighbours stay neighbours."""

_THINNED_STRETCH, _MOST_TOGETHER = 50, 3
"""Rows that stay together where others are left out, and of how many passes at most as many do."""

_MOST_LOST = 0.2
"""Most of the rows that are left out for want of a place where there are several passes [-]."""

_BLOCKS = 12
_WIDEST = 0.09
"""Slips, or loads as a share of the largest, that are held out as one level lie within this range [-]."""

_ISOLATED, _MOST_ISOLATED = 7.0, 0.05
"""A value this many sensor noises from the median of its neighbours in time is a gross error, where no more than the
latter share of a stretch is [-]."""

_AT_END, _MORE_OFTEN = 0.02, 3.0
"""Share of rows that are exactly a channel's largest or least value from which on its sensor is at its end [-], where
no value near there is as frequent by so many times [-]."""

_LEVELS_NEAR, _FEWEST_LEVELS = 5, 20
"""Values near a channel's end that are looked at, and how many values it has at least: a coarse one has no end."""

_STANDS_STILL = 0.1
"""Share of rows in which a clock may stand still before it is no clock [-]."""


@dataclass(frozen=True)
class Samples:
    """Rows of one wheel geometry.

    Parameters
    ----------
    wheel
        The wheel.
    drive
        Covariates of each row; in a recording with time, load, slip and speeds are averaged over neighbours that
        differ by no more than noise: what is asked of a residual must not share its errors. Load and slip that really
        change from row to row are what they probably were.
    measured : (n, 5)
        Channels as `textbook.CHANNELS`; NaN where not observed, or where a gross error stood. Load and slip that really
        change from row to row are those of `drive`.
    noise : (5,)
        Standard deviations of the sensors, from the vehicle or from the data's own scatter, and those with which load
        and slip of `drive` are known where they really change from row to row; NaN for absent channels.
    stated : (5,)
        True where the vehicle states the noise.
    position, lane : (n,)
        Where soil varies: place [m], else time [s], NaN for steady-state trials, whose soils are independent; and the
        number of the track, whose soil repeats where the wheel runs in its own rut again.
    block : (n,)
        Number of the block that a row is held out with.
    made_of
        What the blocks are, in words.
    notes
        What was left out, in words.
    simulated : (n, 5)
        Another simulator's answers, and the load and slip that they are of, where there is one.
    memory : (5,)
        How the sensors' errors are correlated with those of the row before [-], 0 where they are independent.
    """

    wheel: Wheel
    drive: Drive
    measured: np.ndarray
    noise: np.ndarray
    stated: np.ndarray
    position: np.ndarray
    lane: np.ndarray
    block: np.ndarray
    made_of: str
    notes: tuple[str, ...] = ()
    simulated: np.ndarray | None = None
    memory: np.ndarray = field(default_factory=lambda: np.zeros(len(CHANNELS)))

    def __len__(self) -> int:
        return len(self.measured)

    def select(self, rows: np.ndarray) -> Samples:
        """Give some of the rows, (k,) their numbers."""
        each = ("measured", "position", "lane", "block", *(["simulated"] if self.simulated is not None else []))
        return replace(self, drive=select_rows(self.drive, rows), **{name: getattr(self, name)[rows] for name in each})

    @property
    def answers(self) -> tuple[int, ...]:
        """Channels that are answered and were observed."""
        return tuple(channel for channel in ANSWERS if np.isfinite(self.measured[:, channel]).sum() >= LEAST_ROWS)

    @property
    def split(self) -> str:
        """How rows are held out, in words."""
        return f"{len(np.unique(self.block))} {self.made_of}"

    @property
    def seen(self) -> np.ndarray:
        """(n, m) True where an answer was observed."""
        return np.isfinite(self.measured[:, list(self.answers)])


@dataclass(frozen=True)
class Comparable:
    """Rows that can be compared, before it is known how much of the noise of load and slip there is.

    Parameters
    ----------
    table, wheel, vehicle
        As in `comparable`, the table's rows in the order in which they are followed.
    drive
        Its covariates, smoothed where rows follow each other in time.
    measured, noise
        Channels (n, 5), SI, and the noise (5,) that neighbours show.
    usable : (n,)
        True for rows that can be used.
    timed
        Whether rows follow each other in time.
    notes
        What was done to the rows, in words.
    """

    table: WheelTable
    wheel: Wheel
    vehicle: Vehicle
    drive: Drive
    measured: np.ndarray
    noise: np.ndarray
    usable: np.ndarray
    timed: bool
    notes: tuple[str, ...]


def gather(table: WheelTable, wheel: Wheel, vehicle: Vehicle) -> Samples:
    """Choose and lay out the rows; arguments and errors as in `comparable`."""
    return laid_out(comparable(table, wheel, vehicle))


def comparable(table: WheelTable, wheel: Wheel, vehicle: Vehicle) -> Comparable:
    """Choose the rows that can be compared.

    Parameters
    ----------
    table
        Rows of wheels of one geometry, slip derived.
    wheel, vehicle
        The wheel, and the vehicle whose sensors' noise may be stated.

    Raises
    ------
    InputError
        Load, slip or every answer is missing, or too few rows are left.
    """
    for name, remedy in (("load_N", "load_N, the wheel's load"), ("slip", "slip, or both speeds")):
        if name not in table:
            raise InputError(table.source, f"no column {name}", expected=remedy)
        if not np.isfinite(table[name]).any():
            raise InputError(table.source, "no value in any row", expected=remedy, place=f"column {name}")
    if not any(CHANNELS[channel] in table for channel in ANSWERS):
        raise InputError(
            table.source, "nothing to compare", expected="values of torque_Nm, sinkage_m or drawbar_pull_N"
        )
    order, stretch = order_of(table)
    table = table.select(order)
    still = int((np.diff(table["time_s"]) == 0.0).sum()) if "time_s" in table else 0
    if still > _STANDS_STILL * len(table):
        raise InputError(
            table.source, f"time_s stands still in {still} of {len(table)} rows",
            expected="a clock that runs, or column run in a file of steady-state trials",
        )  # fmt: skip
    usable, notes = _usable(table, stretch)
    timed, noise = "time_s" in table, sensor_noise(table, vehicle)
    if is_of_trials(table):
        timed, stretch, noise = False, np.arange(len(table)), sensor_noise(without_time(table), vehicle)
        notes.append(AS_TRIALS)
    notes += without_clock(table)
    if table.wheel is not None and len(set(table.wheel)) > 1:
        notes.append(f"rows of {len(set(table.wheel))} wheels are taken together: as if all ran on the same ground")
    if still:
        notes.append(f"{still} rows have the time of the row before: what remembers or accelerates starts anew there")
    if usable.sum() < LEAST_ROWS:
        raise InputError(
            table.source, f"{int(usable.sum())} rows with load, slip and an answer", expected=f"at least {LEAST_ROWS}"
        )
    measured = np.column_stack([table.columns.get(name, np.full(len(table), math.nan)) for name in CHANNELS])
    if not np.isfinite(measured[usable][:, ANSWERS]).any():
        raise InputError(table.source, "nothing to compare", expected="torque, sinkage or drawbar pull that change")
    if timed:
        measured, at_end = _without_ends(measured, noise)
        notes += at_end
    measured, gross = _without_gross_errors(measured, noise, stretch, timed)
    if gross:
        which = "1 value stands" if gross == 1 else f"{gross} values stand"
        notes.append(f"{which} alone far from their neighbours in time: taken for gross errors")
    usable &= np.isfinite(measured[:, [LOAD, SLIP]]).all(axis=1) & np.isfinite(measured[:, ANSWERS]).any(axis=1)
    table = WheelTable(
        {**table.columns, "load_N": measured[:, LOAD], "slip": measured[:, SLIP]}, table.wheel, table.run, table.source
    )
    drive = drive_of(table, wheel, stretch)
    if timed:
        drive = smoothed(drive, table, noise)
    usable, unplaced = _on_known_ground(drive, usable)
    return Comparable(table, wheel, vehicle, drive, measured, noise, usable, timed, (*notes, *unplaced))


def laid_out(chosen: Comparable, shares: tuple[float, float] = (1.0, 1.0)) -> Samples:
    """Lay out the rows that can be compared, with shares (2,) of the noise that neighbours in time show of load and of
    slip, how much there is [-].
    """
    table, wheel, drive, measured, noise = chosen.table, chosen.wheel, chosen.drive, chosen.measured, chosen.noise
    usable, notes = chosen.usable, list(chosen.notes)
    if chosen.timed:
        drive, measured, noise = restless(drive, measured, noise, shares)
    rows = np.flatnonzero(usable)
    lost = int((~np.isfinite(drive.place_m[rows])).sum())
    placed = lost == 0 and drive.has("place_m")
    lane = lanes(drive, wheel.width_m, table.wheel) if placed else drive.stretch
    number = drive.pass_number[rows]
    passes = len(np.unique(number[np.isfinite(number)])) if placed else 1
    if passes > 1:
        rows = rows[np.lexsort((drive.place_m[rows], lane[rows]))]
    rows, thinned = _thinned(rows, max(passes, 1))
    if thinned:
        notes.append(f"{int(usable.sum())} rows thinned to {len(rows)}, in stretches of {_THINNED_STRETCH}")
    if len(rows) < _FEW_ROWS:
        notes.append(f"{len(rows)} rows: only a mismatch much larger than the noise shows in so few")
    drive = select_rows(drive, rows)
    others = [table.columns.get(SIMULATED + name, np.full(len(table), math.nan)) for name in CHANNELS]
    simulated = np.column_stack(others)[rows] if any(name.startswith(SIMULATED) for name in table.columns) else None
    measured = measured[rows]
    stated = np.array([name in chosen.vehicle.noise for name in CHANNELS])
    if drive.timed and 0 < lost < usable.sum():
        notes.append(f"{lost} rows have no place: ground is taken to vary with time, and passes to share none of it")
    position = drive.place_m if placed else np.where(drive.timed, drive.time_s, math.nan)
    samples = Samples(
        wheel, drive, measured, noise, stated, position, lane[rows],
        np.zeros(len(rows), dtype=int), "", tuple(notes), simulated,
    )  # fmt: skip
    return _blocked(samples)


def _usable(table: WheelTable, stretch: np.ndarray) -> tuple[np.ndarray, list[str]]:
    load, slip = table["load_N"], table["slip"]
    checks = [
        (~stands(table), "in which the wheel stands"),
        (np.isfinite(load) & np.isfinite(slip), "without load or slip"),
        (load > 0.0, "whose wheel carries nothing"),
        (~carries_nothing(load, stretch), "among them whose load is the noise of a zero"),
        ((slip >= -1.0) & (slip < MOST_SLIP), f"with a slip outside -1 to {MOST_SLIP}"),
    ]
    angle = table.get("slip_angle_rad")
    if angle is not None:
        checks.append((~(np.abs(angle) > LIMITS.slip_angle_rad), "driven at an angle to the wheel's plane"))
    usable, notes = np.ones(len(table), dtype=bool), []
    with np.errstate(invalid="ignore"):
        for good, why in checks:
            lost = int((usable & ~good).sum())
            if lost:
                notes.append(f"{lost} row{'s' if lost > 1 else ''} {why} {'are' if lost > 1 else 'is'} left out")
            usable &= good
    return usable, notes


def _without_gross_errors(
    measured: np.ndarray, noise: np.ndarray, stretch: np.ndarray, timed: bool
) -> tuple[np.ndarray, int]:
    """Blank values that stand alone: far from the running median, their neighbours not."""
    if not timed:
        return measured, 0
    measured, count = measured.copy(), 0
    number = np.cumsum(np.diff(stretch, prepend=stretch[:1]) != 0)
    for channel in range(measured.shape[1]):
        seen = np.isfinite(measured[:, channel])
        away = from_running_median(measured[:, channel], stretch) > _ISOLATED * noise[channel]
        # Where many stand apart the channel is quick, not faulty.
        share = np.bincount(number, away) / np.maximum(np.bincount(number, seen), 1.0)
        away &= share[number] <= _MOST_ISOLATED
        measured[away, channel] = math.nan
        count += int(away.sum())
    return measured, count


def _without_ends(measured: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Blank the values of answers whose sensor is at its end: many rows are exactly the largest value, or the least."""
    measured, notes = measured.copy(), []
    for channel in ANSWERS:
        column = measured[:, channel]
        values, counts = np.unique(column[np.isfinite(column)], return_counts=True)
        # Without noise a plateau is the wheel's, not the sensor's.
        if len(values) < _FEWEST_LEVELS or noise[channel] <= least_noise(values):
            continue
        for end, which in ((0, "least"), (-1, "largest")):
            near = counts[1:][:_LEVELS_NEAR] if end == 0 else counts[:-1][-_LEVELS_NEAR:]
            often = max(_AT_END * counts.sum(), _MORE_OFTEN * near.max(), _LEVELS_NEAR)
            if counts[end] > often:
                measured[column == values[end], channel] = math.nan
                notes.append(
                    f"{CHANNELS[channel]} is exactly {values[end]:.6g}, its {which} value, in {counts[end]} rows: "
                    "taken for a sensor at its end and left out"
                )
    return measured, notes


def _on_known_ground(drive: Drive, usable: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Leave out rows (n,) of passes whose few lost places would cost all others the ground that they share."""
    there = np.isfinite(drive.place_m)
    lost = int((usable & ~there).sum())
    if not (drive.timed and drive.has("pass_number") and 0 < lost <= _MOST_LOST * usable.sum()):
        return usable, []
    return usable & there, [f"{lost} rows have no place and are left out: passes share their ground by place"]


def _thinned(rows: np.ndarray, passes: int) -> tuple[np.ndarray, bool]:
    """Choose rows (k,) in pieces, of all passes over the same places where `rows` (n,) come in the order of these."""
    if len(rows) <= MOST_ROWS:
        return np.sort(rows), False
    length = _THINNED_STRETCH * min(passes, _MOST_TOGETHER)
    starts = np.linspace(0, len(rows) - length, MOST_ROWS // length).astype(int)
    kept = np.unique((starts[:, None] + np.arange(length)).ravel())
    return np.sort(rows[kept]), True


def _blocked(samples: Samples) -> Samples:
    """Number the blocks to hold out: conditions of trials, else stretches of time that no run or pass crosses."""
    drive, count = samples.drive, len(samples)
    if drive.timed:
        usual = max(count // _BLOCKS, 1)
        block, number = np.empty(count, dtype=int), 0
        for rows in np.split(np.arange(count), np.flatnonzero(np.diff(drive.stretch)) + 1):
            parts = max(round(len(rows) / usual), 1)
            for part in np.array_split(rows, parts):
                block[part] = number
                number += 1
        made_of = "stretches of time"
        if number > 2 * _BLOCKS:
            block = block * _BLOCKS // number
            made_of = "groups of neighbouring runs"
        return replace(samples, block=block, made_of=f"{made_of} held out in turn")
    level, made_of = np.arange(count) * min(_BLOCKS, count) // count, "groups of trials held out in turn"
    for name, values in (("slips", drive.slip), ("loads", drive.load_N / float(np.max(drive.load_N)))):
        apart = levels(values)
        if apart.max() >= 2:
            level, made_of = levels(values, widest=_WIDEST), f"{name} held out in turn, all their repeats together"
            if level.max() > apart.max():
                made_of = f"groups of like {name} held out in turn"
            break
    if level.max() >= _BLOCKS:
        level = level * _BLOCKS // (level.max() + 1)
    return replace(samples, block=level, made_of=made_of)


def levels(values: np.ndarray, apart: float = 0.03, widest: float = math.inf) -> np.ndarray:
    """Number the levels of a quantity, (n,): neighbours in size that are nearer than `apart` are one level.

    Where scattered values make a chain of such neighbours, it is divided into levels that are at most `widest`.
    """
    order = np.argsort(values)
    along = values[order]
    ends = np.diff(along) > apart
    for chain in np.split(np.arange(len(values)), np.flatnonzero(ends) + 1):
        if len(chain) > 1 and np.ptp(along[chain]) > widest:
            like = fcluster(linkage(along[chain, None], "complete"), widest, "distance")
            ends[chain[:-1]] |= np.diff(like) != 0
    answer = np.empty(len(values), dtype=int)
    answer[order] = np.concatenate([[0], np.cumsum(ends)])
    return answer
