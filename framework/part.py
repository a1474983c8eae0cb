"""A part of a recording's wheel rows: a span of time, stretches of one class of ground, some of the wheels."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..identification.rows.on_track import ground_of_rows
from .core.arguments import number, refused
from .core.errors import InputError
from .core.recording.types import Recording, WheelTable
from .core.track.grounds import Ground
from .core.track.way import pose_from_wheel, track_of
from .core.vehicle import Vehicle


def part_of(
    recording: Recording,
    *,
    from_s: float | None = None,
    to_s: float | None = None,
    on: str | None = None,
    wheels: str | Sequence[str] = (),
    grounds: Sequence[Ground] | None = None,
    database: str | Path | None = None,
) -> Recording:
    """Restrict a recording to a part of its wheel rows; poses, labels, camera and sound stay whole.

    Parameters
    ----------
    recording
        The recording; returned as it is where nothing else is given.
    from_s, to_s
        First and last time of the part, on the recording's clock [s]; the recording's own where absent.
    on
        Class of ground on whose stretches the rows are, `CHANGE_MARGIN_M` away from where it changes.
    wheels
        Name of a wheel, or several; all where empty.
    grounds
        Grounds of the drive, in order of time; found by `grounds_of` where absent and needed.
    database
        Path or URL of a terrain database, for `grounds_of`.

    Returns
    -------
    Recording
        `Recording.part` and a note say which part it is, and its digest is not that of the whole.

    Raises
    ------
    InputError
        A value is of the wrong kind, or no row is in the part; the error says what the recording holds.
    """
    names = _names(wheels)
    if from_s is None and to_s is None and on is None and not names:
        return recording
    table = recording.wheel
    if table is None or not len(table):
        raise InputError(recording.source, "no wheel rows", expected="wheel rows to choose a part of")
    kept = np.ones(len(table), dtype=bool)
    if names:
        kept &= _of_wheels(recording, table, names)
    if on is not None:
        if not isinstance(on, str):
            raise refused("on", on, "the name of a class of ground")
        if grounds is None:
            from .grounds import grounds_of  # a second of imports, mostly not needed

            grounds, _ = grounds_of(recording, database, doubtful=True)
        kept &= _on_class(recording, table, on, grounds)
    if from_s is not None or to_s is not None:
        kept &= _between(recording, table, from_s, to_s)
    if not kept.any():
        raise InputError(recording.source, "no row is in every part named", expected="parts that have rows in common")
    timed = "time_s" in table and bool(np.isfinite(table["time_s"][kept]).any())
    span = f"{np.nanmin(table['time_s'][kept]):.1f} to {np.nanmax(table['time_s'][kept]):.1f} s" if timed else ""
    wheel = f"wheel{'s' * (len(names) > 1)} {', '.join(names)}" if names else ""
    said = ", ".join(each for each in (span, wheel, f"on {on}" if on is not None else "") if each)
    pose = recording.pose
    if pose is None:  # where the vehicle was before counts for what ruts its wheels ran in
        pose, _ = pose_from_wheel(table, recording.vehicle)
    digest = hashlib.sha256(recording.digest.encode() + np.packbits(kept).tobytes()).hexdigest()
    note = f"used of the recording: {said}; {int(kept.sum())} of {len(table)} rows"
    return replace(
        recording,
        vehicle=_with_driven(recording),
        wheel=table.select(kept),
        pose=pose,
        part=said,
        digest=digest,
        notes=(*recording.notes, note),
    )


def _with_driven(recording: Recording) -> Vehicle | None:
    """Give the vehicle, its wheels that have rows known as driven where it does not say: a part may not have them."""
    vehicle, table = recording.vehicle, recording.wheel
    if vehicle is None or table is None or table.wheel is None:
        return vehicle
    there = set(table.wheel.astype(str).tolist())
    wheels = tuple(
        each.model_copy(update={"driven": True}) if each.driven is None and each.name in there else each
        for each in vehicle.wheels
    )
    return vehicle.model_copy(update={"wheels": wheels})


def _names(wheels: str | Sequence[str]) -> tuple[str, ...]:
    """Names of wheels, each once; raises `InputError` where they are none."""
    names = (wheels,) if isinstance(wheels, str) else wheels
    if not isinstance(names, Sequence) or not all(isinstance(each, str) for each in names):
        raise refused("wheels", wheels, "the name of a wheel, or a list of names")
    return tuple(dict.fromkeys(names))


def _of_wheels(recording: Recording, table: WheelTable, names: Sequence[str]) -> np.ndarray:
    """Find the rows (n,) of wheels."""
    vehicle = recording.vehicle
    alone = vehicle.wheels[0].name if vehicle is not None and len(vehicle.wheels) == 1 else ""
    of_row = np.full(len(table), alone) if table.wheel is None else table.wheel.astype(str)
    there = sorted(set(of_row.tolist()) - {""})
    for name in names:
        if name not in there:
            expected = "one of " + ", ".join(there) if there else "no name: the rows name no wheels"
            raise InputError(recording.source, f"no row of a wheel {name!r}", expected=expected)
    return np.isin(of_row, names)


def _on_class(recording: Recording, table: WheelTable, on: str, grounds: Sequence[Ground]) -> np.ndarray:
    """Find the rows (n,) on the stretches of a class."""
    classes = sorted({each.class_name for each in grounds} - {""})
    if on not in classes:
        expected = "one of " + ", ".join(classes) if classes else (
            "labels.csv, a database that knows the track, or a camera or microphone with a model: nothing says what "
            "the ground was"
        )  # fmt: skip
        raise InputError(recording.source, f"no ground of class {on!r}", expected=expected)
    if table.soil is not None:
        return table.soil == on
    try:
        track = track_of(recording)
    except InputError:
        track = None  # grounds are then told apart by time
    vehicle = recording.vehicle
    ahead = {wheel.name: wheel.position_m[0] for wheel in vehicle.wheels} if vehicle is not None else {}
    alone = next(iter(ahead.values())) if len(ahead) == 1 else 0.0
    forward_m = np.full(len(table), alone)
    if table.wheel is not None:
        forward_m = np.array([ahead.get(name, alone) for name in table.wheel.tolist()])
    row = ground_of_rows(table["time_s"], forward_m, track, grounds)
    kept = np.isin(row, [number for number, each in enumerate(grounds) if each.class_name == on])
    if not kept.any():
        raise InputError(
            recording.source, f"no wheel row on {on}, away from where the ground changes",
            expected="a stretch of the class that wheels ran over",
        )  # fmt: skip
    return kept


def _between(recording: Recording, table: WheelTable, from_s: float | None, to_s: float | None) -> np.ndarray:
    """Find the rows (n,) of a span of time [s]."""
    if "time_s" not in table:
        raise InputError(recording.source, "no column time_s", expected="times, to choose a span of them")
    first, last = float(np.nanmin(table["time_s"])), float(np.nanmax(table["time_s"]))
    ends = [
        default if end is None else number(name, end, "a number [s]")
        for name, end, default in (("from_s", from_s, first), ("to_s", to_s, last))
    ]
    kept = (table["time_s"] >= ends[0]) & (table["time_s"] <= ends[1])
    if math.isnan(ends[0] + ends[1]) or ends[0] >= ends[1] or not kept.any():
        raise InputError(
            recording.source, f"no row from {ends[0]:g} s to {ends[1]:g} s",
            expected=f"a start before the end, within the recording's {first:.1f} to {last:.1f} s",
        )  # fmt: skip
    return kept
