"""Wheels that the rows describe themselves, in columns radius_m and width_m, without a vehicle or with one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydantic import ValidationError

from ...framework.core.errors import InputError
from ...framework.core.findings import Finding, note
from ...framework.core.recording.types import Recording, WheelTable
from ...framework.core.vehicle import Vehicle, Wheel

_COLUMNS = ("radius_m", "width_m", "grouser_height_m", "grouser_count")
_NEEDED = _COLUMNS[:2]

_SAME = 0.01
"""Share by which a length in a row differs from the vehicle's at most, where it is that [-]."""


def by_geometry(recording: Recording) -> list[Recording]:
    """Give one recording for each wheel that the rows describe, in the order of the file; as it is where they do not.

    A vehicle that came with the recording describes its wheels, whatever the rows say.

    Raises
    ------
    InputError
        A row lacks its wheel's radius or width, or gives one that no wheel can have.
    """
    table = recording.wheel
    described = recording.vehicle is not None and recording.vehicle.wheels
    if described or table is None or any(name not in table for name in _NEEDED):
        return [recording]
    names = [name for name in _COLUMNS if name in table]
    values = np.column_stack([np.nan_to_num(table[name]) if name not in _NEEDED else table[name] for name in names])
    rows, columns = np.nonzero(~np.isfinite(values))
    if len(rows):
        place = f"row {int(rows[0]) + 1}, column {names[int(columns[0])]}"
        raise InputError(table.source, "no value", expected="the wheel's geometry in every row", place=place)
    _, first, label = np.unique(values, axis=0, return_index=True, return_inverse=True)
    label = label.ravel()
    parts = []
    for group in np.argsort(first):
        geometry = dict(zip(names, values[first[group]].tolist(), strict=True))
        part = table.select(label == group)
        parts.append(replace(recording, vehicle=_vehicle(part, geometry, int(first[group])), wheel=part))
    return parts


def of_driven(table: WheelTable, vehicle: Vehicle) -> tuple[WheelTable, Finding | None]:
    """Give the rows of driven wheels, and a note ``towed_wheels`` where there are rows of others.

    Raises
    ------
    InputError
        No row is of a driven wheel.
    """
    towed = [wheel.name for wheel in vehicle.wheels if wheel.driven is False]
    if not towed or table.wheel is None:
        return table, None
    kept = ~np.isin(table.wheel.astype(str), towed)
    if not kept.any():
        problem = f"all rows are of {', '.join(towed)}, with driven = false in the vehicle file"
        raise InputError(table.source, problem, expected="rows of a driven wheel")
    if kept.all():
        return table, None
    return table.select(kept), note("towed_wheels", wheels=towed, used=int(kept.sum()), n=len(table))


def by_soil(recording: Recording) -> list[Recording]:
    """Give one recording for each soil that the rows name, in the order of the file; as it is where they name none."""
    table = recording.wheel
    if table is None or table.soil is None:
        return [recording]
    names = dict.fromkeys(table.soil.tolist())
    return [replace(recording, wheel=table.select(table.soil == name)) for name in names]


def of_vehicle(table: WheelTable, vehicle: Vehicle) -> tuple[WheelTable, Finding | None]:
    """Give the rows whose own geometry, where they have one, is that of the vehicle's wheel.

    Returns
    -------
    WheelTable
        These rows.
    Finding or None
        ``other_wheels`` where there are rows of others.

    Raises
    ------
    InputError
        No row is of a wheel of the vehicle.
    """
    own = [name for name in _NEEDED if name in table]
    if not own or not len(table):
        return table, None
    names, which = np.unique(
        np.full(len(table), "") if table.wheel is None else table.wheel.astype(str), return_inverse=True
    )
    wheels = [vehicle.wheel(None if table.wheel is None else str(name)) for name in names]
    expected = np.array([[getattr(wheel, name) for name in own] for wheel in wheels])[which.ravel()]
    written = np.column_stack([table[name] for name in own])
    other = np.abs(written - expected) > _SAME * expected
    lost = other.any(axis=1)
    if not lost.any():
        return table, None
    if lost.all():
        column = int(np.argmax(other[0]))
        raise InputError(
            table.source, f"{written[0, column]:g}", place=f"sample 1, column {own[column]}",
            expected=f"{expected[0, column]:g}, the vehicle's wheel, in some row",
        )  # fmt: skip
    used = int(np.count_nonzero(~lost))
    return table.select(np.flatnonzero(~lost)), note("other_wheels", columns=own, used=used, n=len(table))


def _vehicle(table: WheelTable, geometry: dict[str, float], row: int) -> Vehicle:
    """Build a vehicle whose wheels all have the geometry [m] of a row."""
    names = ["wheel"] if table.wheel is None else [str(name) for name in np.unique(table.wheel)]
    numbers = {**geometry, "grouser_count": int(geometry.get("grouser_count", 0))}
    try:
        return Vehicle(name=describe(numbers), wheels=tuple(Wheel(name=name, **numbers) for name in names))
    except ValidationError as error:
        fault = error.errors()[0]
        place = f"row {row + 1}, column {fault['loc'][-1]}"
        shown = "" if fault["type"] == "value_error" else f"{fault['input']!r}: "
        problem = shown + fault["msg"].removeprefix("Value error, ")
        raise InputError(table.source, problem, place=place) from None


def describe(geometry: dict[str, float]) -> str:
    """Say in words which wheel this is."""
    height, count = geometry.get("grouser_height_m", 0.0), geometry.get("grouser_count", 0)
    grousers = f", {count:g} grousers of {1e3 * height:g} mm" if height and count else ""
    return f"wheel of radius {1e3 * geometry['radius_m']:g} mm, width {1e3 * geometry['width_m']:g} mm{grousers}"


def half_stated_grousers(wheel: Wheel) -> Finding | None:
    """Note what of a wheel's grousers is not considered because only their number or only their height is stated."""
    count, height_m = wheel.grouser_count, wheel.grouser_height_m
    if count and not height_m:
        return note("grouser_height_missing", count=count)
    return note("grouser_count_missing", height_m=height_m) if height_m and not count else None
