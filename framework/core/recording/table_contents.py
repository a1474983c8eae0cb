"""What is in a wheel table: each column with the channel that is read from it, and the column map that says so."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from ..files import toml_string
from ..vehicle import Vehicle
from .contents import Contents, Source, contents_of, ends_of
from .types import TEXT_COLUMNS, WHEEL_COLUMNS, Recording, WheelTable
from .vehicle_text import vehicle_text
from .wheel_columns import ALSO_READ, Column, map_line
from .wheel_file import OpenedTable, open_wheel
from .wide_table import joints_in

UNITS = {"wheel_speed_rad_s": "rad/s", "wheel_angle_rad": "rad", "torque_Nm": "N m at the wheel's axle, after the gear"}
"""What columns of joints are taken for."""

_HEAD = """\
# Which column of {name} is which channel, as `bevameter inspect` recognised it: edit what is wrong.
# What is left out here is recognised by its name. Channels:
#   {channels}
# SI = scale times the value in SI, plus offset; a scale says the sign, too:
#   torque_Nm = {{ column = "M1", unit = "Nm", scale = -1.0, offset = 0.2 }}
# The definition of slip is slip (1 - V/(r omega) when driving), relative_to_rim, relative_to_travel ((r omega - V)/V),
# speed_ratio (V/(r omega)) or rim_to_travel.
{decimal}
[columns]
"""


def inspect_table(
    path: Path, read: Callable[[], Recording], vehicle: Vehicle | None, columns: Path | None, *, camera: bool = False
) -> Contents:
    """Say what the columns of a wheel table are, and write the column map and the vehicle file that say it.

    Parameters
    ----------
    path
        The table.
    read
        Reads the recording that it belongs to.
    vehicle, columns
        The vehicle and the column map, where there are any.
    camera
        Whether there are images beside it, for which a vehicle file has to describe the camera.

    Raises
    ------
    InputError
        The file is no table, or the column map is at fault by itself.
    """
    opened = open_wheel(path, columns)
    contents = contents_of(read)
    table = None if contents.recording is None else contents.recording.wheel
    by_name = {column.name: column for column in opened.found.values()}
    wide = {} if columns is not None else joints_in([name for name in opened.sheet.names if name not in by_name])
    by_wheel = {name: (wheel, channel) for wheel, own in wide.items() for channel, name in own.items()}
    of_wheels = {
        each.column: (wheel, channel) for wheel, own in opened.mapped.wheels.items() for channel, each in own.items()
    }
    faults = {error.place: error for error in opened.faults}
    n, ends = (None, (None, None)) if table is None else (len(table), ends_of(table.observed("time_s")))
    sources = tuple(
        Source(name, "column", n, *ends, *(
            _of_wheel(*of_wheels[name], "by its name" if columns is None else "as the column map says")
            if name in of_wheels
            else _of_joint(*by_wheel[name]) if name in by_wheel
            else _use(name, by_name.get(name), faults.get(f"column {name}"), table)
        ))
        for name in opened.sheet.names
    )  # fmt: skip
    wheels = dict.fromkeys(wheel for wheel, _ in (*by_wheel.values(), *of_wheels.values()))
    own = all(name in ALSO_READ or (name in by_name and by_name[name].source == "own") for name in opened.sheet.names)
    files = {} if columns is not None or own else {"columns.toml": _map_text(path, opened, by_name, wide)}
    if vehicle is None and (camera or not {"radius_m", "width_m"} <= set(opened.sheet.names)):
        files["vehicle.toml"] = vehicle_text(contents.recording, joints={each: each for each in wheels}, camera=camera)
    return replace(contents, sources=sources, files=files, map_name="columns.toml", folder=path.parent)


def _of_wheel(wheel: str, channel: str, how: str) -> tuple[str, str]:
    return f"{channel} of {wheel}", how


def _of_joint(wheel: str, channel: str) -> tuple[str, str]:
    return "", f"{channel} of {wheel} by its name: a column map with [wheels.{wheel}] reads it"


def _use(name: str, column: Column | None, fault: InputError | None, table: WheelTable | None) -> tuple[str, str]:
    if fault is not None:
        return "", f"{fault.problem}; expected {fault.expected}"
    if column is None:
        return (name, "") if name in ALSO_READ else ("", "not known by its name")
    if table is not None and not column.per_load and column.channel not in (*table.columns, *TEXT_COLUMNS):
        return "", f"{column.channel}, but no value in any row"
    if column.channel in TEXT_COLUMNS:
        return column.channel, "names"
    if column.source == "own":
        return column.channel, "SI, by its name"
    unit = f"in {column.unit}" if column.unit else "no unit: see notes"
    if column.per_load:
        unit = f"a coefficient, times {column.unit}"
    sign = "" if column.factor == 1.0 and not column.offset else f", times {column.factor:.6g}"
    return column.channel, unit + sign + (f" plus {column.offset:g}" if column.offset else "")


def _map_text(
    path: Path, opened: OpenedTable, by_name: Mapping[str, Column], wide: Mapping[str, Mapping[str, str]]
) -> str:
    """Write the column map; the file's own columns and those of no channel are in comments."""
    decimal = f'decimal = "{opened.mapped.decimal}"\n' if opened.mapped.decimal else ""
    channels = ", ".join((*WHEEL_COLUMNS, *TEXT_COLUMNS))
    lines = [_HEAD.format(name=toml_string(path.name), channels=channels, decimal=decimal)]
    lines_of = {
        wheel: [f"{channel} = {toml_string(name)}    # {UNITS[channel]}\n" for channel, name in own.items()]
        for wheel, own in wide.items()
    }
    for wheel, own in opened.mapped.wheels.items():
        lines_of[wheel] = [f"{_line(channel, each.column, each.unit)}\n" for channel, each in own.items()]
    named = {name for own in wide.values() for name in own.values()} | opened.mapped.named
    for name in opened.sheet.names:
        if name in named:
            continue
        column, quoted = by_name.get(name), toml_string(name)
        if column is None:
            lines.append(
                f'# ... = {{ column = {quoted}, unit = "..." }}    # not used\n' if name not in ALSO_READ else ""
            )
        elif column.source == "own":
            lines.append(f"# {column.channel} = {quoted}    # by its name, SI\n")
        else:
            lines.append(f"{_line(column.channel, name, column.unit)}\n")
    for wheel, own in lines_of.items():
        lines += [f"\n[wheels.{toml_string(wheel)}]\n", *own]
    return "".join(lines)


def _line(channel: str, name: str, unit: str | None) -> str:
    defined = ['definition = "slip"'] if channel == "slip" else []
    return map_line(channel, name, *([] if unit is None else [f"unit = {toml_string(unit)}"]), *defined)
