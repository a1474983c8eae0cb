"""Samples that are compared with the simulation: channels, covariates, latent load and slip, and held-out blocks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.recording.types import WheelTable
from ...framework.core.track.grounds import Ground
from ...framework.core.vehicle import Vehicle, Wheel
from ..effects.drive import GROUND, drive_of, order_of, select_rows
from ..effects.effect import LOAD, PULL, SINKAGE, SLIP, TORQUE, Drive
from ..mechanics.textbook import CHANNELS
from ..rows.gate import LIMITS
from ..rows.noise import least_noise, sensor_noise
from ..rows.standstill import stands
from ..rows.trials import AS_TRIALS, is_of_trials, missing_clock, without_time
from ..rows.unloaded import carries_nothing
from ..rows.words import sentence
from .blocks import blocks_of
from .lanes import lanes
from .latent import Path
from .paths import path_without_outliers, regimes, smooth_speeds

ANSWERS = (TORQUE, SINKAGE, PULL)
"""Channels that the simulator predicts; load and slip are imposed by the drive."""

SIMULATED = "simulated_"
"""Prefix of columns with another simulator's channels."""

MOST_SLIP = 0.995
"""Slip from which on a wheel is stuck, and its channels do not depend on the soil's parameters as modelled [-]."""

LEAST_ROWS = 5

MOST_ROWS = 1500
"""A recording with more rows is thinned to about this number, in pieces of neighbouring rows."""

_PIECE, _LEAST_OF_PART = 50, 50
"""Rows in a piece, and least rows that a wheel on one ground keeps."""

_SATURATED, _MORE_OFTEN, _LEVELS_NEAR, _FEWEST_LEVELS = 0.02, 3.0, 5, 20
"""A sensor is saturated if at least this share of the rows has exactly the channel's extreme value, so many times more
often than each of so many values next to it, in a channel of at least so many different values."""

_MOST_STANDSTILL = 0.1
"""Largest share of rows in which time does not increase [-]."""

_NEXT = 1.5
"""Median time steps within which a row follows the previous one [-]."""


@dataclass(frozen=True)
class Samples:
    """Rows of one wheel geometry, in order of time within each stretch.

    Parameters
    ----------
    wheel
        The wheel.
    drive
        Covariates of each row; `load_N` and `slip` are their expected true values.
    measured : (n, 5)
        Channels as `textbook.CHANNELS`; NaN where not observed.
    noise : (5,)
        Initial estimate of the sensors' standard deviations; NaN for absent channels.
    stated : (5,)
        True where the vehicle states the noise.
    load, slip
        Their latent paths.
    follows : (n,)
        True where a row is the next one in time after the previous row.
    position, lane : (n,)
        Coordinate along which soil varies: place [m], else time [s], number of the row for steady-state trials of
        several runs, NaN for others, whose soils are independent; and number of the track, along which soil is the same
        in every pass, or of the run.
    block : (n,)
        Number of the block that a row is held out with.
    block_kind
        Description of the blocks.
    notes
        Remarks on rows left out.
    simulated : (n, 5)
        Channels of another simulator, if any, with its load and slip.
    grounds, wheels
        Grounds, and names of wheels, by number.
    """

    wheel: Wheel
    drive: Drive
    measured: np.ndarray
    noise: np.ndarray
    stated: np.ndarray
    load: Path
    slip: Path
    follows: np.ndarray
    position: np.ndarray
    lane: np.ndarray
    block: np.ndarray
    block_kind: str
    notes: tuple[str, ...] = ()
    simulated: np.ndarray | None = None
    grounds: tuple[Ground, ...] = (Ground(),)
    wheels: tuple[str, ...] = ("",)

    def __len__(self) -> int:
        return len(self.measured)

    @property
    def answers(self) -> tuple[int, ...]:
        """Channels that the simulator predicts and that were observed."""
        return tuple(channel for channel in ANSWERS if np.isfinite(self.measured[:, channel]).sum() >= LEAST_ROWS)

    @property
    def split(self) -> str:
        """How rows are held out, in words."""
        return f"{len(np.unique(self.block))} {self.block_kind}"

    def on_ground(self, number: int) -> Samples:
        """Return the rows on one ground."""
        rows = np.flatnonzero(self.drive.ground == number)
        drive = select_rows(self.drive, rows)
        follows = self.follows[rows] & (np.diff(rows, prepend=-2) == 1)
        return replace(
            self, drive=replace(drive, ground=np.zeros(len(rows), dtype=int)), measured=self.measured[rows],
            load=self.load.select(rows, follows), slip=self.slip.select(rows, follows), follows=follows,
            position=self.position[rows], lane=self.lane[rows], block=self.block[rows], grounds=(self.grounds[number],),
            simulated=None if self.simulated is None else self.simulated[rows],
        )  # fmt: skip

    def divided_at(self, times: Sequence[float]) -> Samples:
        """Return the same rows, on one ground more after each of some times in order [s]."""
        ground = np.searchsorted(times, self.drive.time_s, side="right")
        borders = [float(self.drive.time_s.min()), *times, float(self.drive.time_s.max())]
        follows, rows = self.follows & (np.diff(ground, prepend=-1) == 0), np.arange(len(self))
        return replace(
            self, drive=replace(self.drive, ground=ground), follows=follows, load=self.load.select(rows, follows),
            slip=self.slip.select(rows, follows), grounds=tuple(Ground("", *span) for span in pairwise(borders)),
        )  # fmt: skip

    def of_class_of(self, rows: np.ndarray) -> np.ndarray:
        """Return the rows on grounds of the classes of some rows (k,); these themselves where there is one class."""
        if len(self.classes) == 1:
            return rows
        same = [np.isin(self.drive.ground, grounds) for grounds in self.classes.values()]
        return np.flatnonzero(np.any([own for own in same if own[rows].any()], axis=0))

    @property
    def classes(self) -> dict[str, list[int]]:
        """Numbers of the grounds of each class; a ground whose class is not known is one of its own."""
        answer: dict[str, list[int]] = {}
        for number, ground in enumerate(self.grounds):
            answer.setdefault(ground.class_name or f"ground {number + 1}", []).append(number)
        return answer

    @property
    def seen(self) -> np.ndarray:
        """(n, m) True where a predicted channel was observed."""
        return np.isfinite(self.measured[:, list(self.answers)])


def gather(table: WheelTable, wheel: Wheel, vehicle: Vehicle, grounds: Sequence[Ground] = (Ground(),)) -> Samples:
    """Select the rows that can be compared.

    Parameters
    ----------
    table
        Rows of wheels of one geometry, slip derived.
    wheel, vehicle
        The wheel, and the vehicle, which may state the noise of its sensors.
    grounds
        Grounds; which of them each row is on is in the table's column `GROUND`, NaN for none.

    Raises
    ------
    InputError
        Load, slip or every predicted channel is missing, or too few rows are left.
    """
    _check(table)
    order, stretch = order_of(table)
    table = table.select(order)
    still = int((np.diff(table["time_s"]) == 0.0).sum()) if "time_s" in table else 0
    if still > _MOST_STANDSTILL * len(table):
        raise InputError(
            table.source, f"time_s stands still in {still} of {len(table)} rows",
            expected="a clock that runs, or column run in a file of steady-state trials",
        )  # fmt: skip
    usable, notes = _usable(table, stretch)
    timed, noise = "time_s" in table, sensor_noise(table, vehicle)
    if is_of_trials(table):
        timed, stretch, noise = False, np.arange(len(table)), sensor_noise(without_time(table), vehicle)
        notes.append(sentence(AS_TRIALS))
    if unclocked := missing_clock(table):
        notes.append(sentence(unclocked))
    if table.wheel is not None and len(set(table.wheel)) > 1 and "x_m" not in table:
        notes.append(f"rows of {len(set(table.wheel))} wheels are taken together: as if all ran on the same ground")
    if usable.sum() < LEAST_ROWS:
        raise InputError(
            table.source, f"{int(usable.sum())} rows with load, slip and an answer", expected=f"at least {LEAST_ROWS}"
        )
    measured = np.column_stack([table.columns.get(name, np.full(len(table), math.nan)) for name in CHANNELS])
    if not np.isfinite(measured[usable][:, ANSWERS]).any():
        raise InputError(table.source, "nothing to compare", expected="torque, sinkage or drawbar pull that change")
    if timed:
        measured, saturated = _without_saturated(measured, noise)
        notes += saturated
    answered = np.isfinite(measured[:, ANSWERS]).any(axis=1)
    if lost := int((usable & ~answered).sum()):
        notes.append(f"{lost} rows without torque, sinkage and drawbar pull are left out")
    usable &= answered
    most = int(np.isfinite(measured[usable][:, ANSWERS]).sum(axis=0).max())
    if most < LEAST_ROWS:
        raise InputError(
            table.source, f"at most {most} usable values of torque, sinkage or drawbar pull",
            expected=f"at least {LEAST_ROWS} of one of them",
        )  # fmt: skip
    time_s = table["time_s"] if timed else np.arange(float(len(table)))
    regime = regimes(table, wheel, stretch) if timed else np.zeros(len(table), dtype=int)
    load, slip = (
        path_without_outliers(measured[:, channel], time_s, noise[channel], stretch, regime, timed)
        for channel in (LOAD, SLIP)
    )
    table = table.adding({"load_N": load.mean, "slip": np.clip(slip.mean, -1.0, MOST_SLIP)})
    drive = drive_of(table, wheel, stretch)
    if timed:
        drive = smooth_speeds(drive, table, wheel, regime)
    samples = _select_samples(table, wheel, vehicle, drive, measured, noise, load, slip, usable, timed, notes)
    samples = _with_grounds(samples, grounds)
    block, block_kind = blocks_of(samples.drive, len(samples.grounds), len(samples.classes))
    return replace(samples, block=block, block_kind=block_kind)


def _check(table: WheelTable) -> None:
    """Raise `InputError` for a table without load, slip or any predicted channel."""
    for name, remedy in (("load_N", "load_N, the wheel's load"), ("slip", "slip, or both speeds")):
        if name not in table:
            raise InputError(table.source, f"no column {name}", expected=remedy)
        if not np.isfinite(table[name]).any():
            raise InputError(table.source, "no value in any row", expected=remedy, place=f"column {name}")
    if not any(CHANNELS[channel] in table for channel in ANSWERS):
        raise InputError(
            table.source, "nothing to compare", expected="values of torque_Nm, sinkage_m or drawbar_pull_N"
        )


def _select_samples(
    table: WheelTable, wheel: Wheel, vehicle: Vehicle, drive: Drive, measured: np.ndarray, noise: np.ndarray,
    load: Path, slip: Path, usable: np.ndarray, timed: bool, notes: list[str],
) -> Samples:  # fmt: skip
    rows = np.flatnonzero(usable)
    lost = int((~np.isfinite(drive.place_m[rows])).sum())
    placed = lost == 0 and drive.has("place_m")
    lane = lanes(drive, wheel.width_m, table.wheel) if placed else drive.stretch
    number = drive.pass_number[rows]
    passes = len(np.unique(number[np.isfinite(number)])) if placed else 1
    if passes > 1:
        rows = rows[np.lexsort((drive.place_m[rows], lane[rows]))]
    parts = np.column_stack([drive.ground, lane if passes > 1 else drive.wheel])[rows]
    part = np.unique(parts, axis=0, return_inverse=True)[1].ravel()
    kept = _thinned(rows, part, max(passes, 1))
    thinned, rows = len(kept) < len(rows), kept
    if thinned:
        notes.append(f"{int(usable.sum())} rows thinned to {len(rows)}, in pieces of {_PIECE}")
    follows = _next_in_time(drive)[rows] & (np.diff(rows, prepend=-2) == 1)
    follows[1:] &= np.diff(drive.ground[rows]) == 0
    drive = select_rows(drive, rows)
    others = [table.columns.get(SIMULATED + name, np.full(len(table), math.nan)) for name in CHANNELS]
    simulated = np.column_stack(others)[rows] if any(name.startswith(SIMULATED) for name in table.columns) else None
    if timed and 0 < lost < usable.sum():
        notes.append(f"{lost} rows have no place: ground is taken to vary with time, and passes to share none of it")
    position = drive.place_m if placed else np.where(drive.timed, drive.time_s, math.nan)
    if not drive.timed and len(np.unique(drive.run)) > 1:
        # Ground is prepared anew for each run; trials of one may share it.
        position, lane = np.arange(float(len(rows))), drive.run
    else:
        lane = lane[rows]
    stated = np.array([name in vehicle.noise for name in CHANNELS])
    return Samples(
        wheel, drive, measured[rows], noise, stated, load.select(rows, follows), slip.select(rows, follows), follows,
        position, lane, np.zeros(len(rows), dtype=int), "", tuple(notes), simulated,
        wheels=("",) if table.wheel is None else tuple(dict.fromkeys(table.wheel.tolist())),
    )  # fmt: skip


def _with_grounds(samples: Samples, grounds: Sequence[Ground]) -> Samples:
    """Return the samples with those grounds that have rows, numbered anew."""
    present, number = np.unique(samples.drive.ground, return_inverse=True)
    return replace(
        samples, drive=replace(samples.drive, ground=number), grounds=tuple(grounds[each] for each in present)
    )


def _next_in_time(drive: Drive) -> np.ndarray:
    """(n,) True where a row is the next one of its stretch, by the median time step."""
    step = np.diff(drive.time_s)
    inside = np.diff(drive.stretch) == 0
    median_step = np.median(step[inside & (step > 0.0)]) if (inside & (step > 0.0)).any() else math.inf
    with np.errstate(invalid="ignore"):
        return np.append(False, inside & (step > 0.0) & (step < _NEXT * median_step))


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
    if GROUND in table:
        checks.append((np.isfinite(table[GROUND]), "at a change of ground, or where none is stated"))
    usable, notes = np.ones(len(table), dtype=bool), []
    with np.errstate(invalid="ignore"):
        for good, why in checks:
            lost = int((usable & ~good).sum())
            if lost:
                notes.append(f"{lost} row{'s' if lost > 1 else ''} {why} {'are' if lost > 1 else 'is'} left out")
            usable &= good
    return usable, notes


def _without_saturated(measured: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Remove values of saturated sensors: many rows have exactly the channel's largest or least value."""
    measured, notes = measured.copy(), []
    for channel in ANSWERS:
        column = measured[:, channel]
        values, counts = np.unique(column[np.isfinite(column)], return_counts=True)
        # Without noise a plateau is due to the wheel, not to the sensor.
        if len(values) < _FEWEST_LEVELS or noise[channel] <= least_noise(values):
            continue
        for end, which in ((0, "least"), (-1, "largest")):
            near = counts[1:][:_LEVELS_NEAR] if end == 0 else counts[:-1][-_LEVELS_NEAR:]
            often = max(_SATURATED * counts.sum(), _MORE_OFTEN * near.max(), _LEVELS_NEAR)
            if counts[end] > often:
                measured[column == values[end], channel] = math.nan
                notes.append(
                    f"{CHANNELS[channel]} is exactly {values[end]:.6g}, its {which} value, in {counts[end]} rows: "
                    "the sensor is taken to be at the end of its range, and they are left out"
                )
    return measured, notes


def _thinned(rows: np.ndarray, part: np.ndarray, passes: int) -> np.ndarray:
    """Select rows (k,) in pieces.

    Parameters
    ----------
    rows : (n,)
        In order of time, or, of several passes, of place, all passes over the same places.
    part : (n,)
        Number of the part that a row is of, such as a wheel on one ground: each keeps rows, in proportion to its own.
    passes
        Number of passes.
    """
    if len(rows) <= MOST_ROWS:
        return np.sort(rows)
    sizes = np.bincount(part)
    least = min(_LEAST_OF_PART, MOST_ROWS // len(sizes))
    budgets = np.minimum(sizes, np.maximum(least, (MOST_ROWS * sizes) // len(rows)))
    kept = []
    for number, budget in enumerate(budgets.tolist()):
        own = rows[part == number]
        length = min(_PIECE * min(passes, 3), budget)
        starts = np.linspace(0, len(own) - length, budget // length).astype(int)
        kept.append(own[np.unique((starts[:, None] + np.arange(length)).ravel())])
    return np.sort(np.concatenate(kept))
