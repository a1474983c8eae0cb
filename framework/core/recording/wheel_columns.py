"""Which column of a table is which channel of the wheel, and how its values become SI."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import toml_string
from . import units
from .column_map import ColumnMap
from .column_names import HINTS, PER_LOAD, QUANTITIES, Meaning, key, meaning, names_of_channels, stem_of, written
from .slip_definitions import Definition
from .types import TEXT_COLUMNS, WHEEL_COLUMNS

OWN = frozenset((*WHEEL_COLUMNS, *TEXT_COLUMNS))
"""The wheel file's own columns."""

TORQUE_OVER_RADIUS = "torque_over_radius_N"
"""Column of torque over the wheel's radius, which the table does not know."""

ALSO_READ = (
    "radius_m", "width_m", "grouser_height_m", "grouser_count", "yaw_rad", "roll_rad", "current_A", TORQUE_OVER_RADIUS,
)  # fmt: skip
"""Columns beyond the contract's that something reads: the wheel that a row is of, the vehicle's heading and roll,
the current of the wheel's motor, and torque over the wheel's radius."""

_UNITLESS = frozenset({"time_s", "slip", "pass"})
"""Own columns that a laboratory's table may have by chance, or by its clock: they do not make it one in SI units."""

_NEAR = 0.83
"""Likeness by difflib from which on a name is another, misspelt [-]."""

_MOST_COMPARED = 200
"""Columns whose names are compared with those of channels, letter by letter [-]."""

_DIMENSIONS = {quantity.channel: quantity.dimension for quantity in QUANTITIES}
_PERCENT = 0.01


@dataclass(frozen=True)
class Column:
    """Where a channel comes from.

    Parameters
    ----------
    channel, name
        The channel, and the column's name in the table.
    factor, offset
        Factor to SI times value, plus offset [SI].
    unit
        As written in the table or the map; None where nobody says it.
    source
        ``own`` for a column of the contract, ``name`` where its name was recognised, ``map`` by a column map.
    signed
        Whether a column map says the sign.
    definition
        Of slip: how it is defined.
    wheel
        The wheel that it is of, in a table with columns for each; ``""`` in others.
    """

    channel: str
    name: str
    factor: float = 1.0
    offset: float = 0.0
    unit: str | None = None
    source: str = "own"
    signed: bool = False
    definition: Definition = "slip"
    wheel: str = ""

    @property
    def per_load(self) -> bool:
        """Whether it is a coefficient, such as DP/W, which is to be multiplied by the load."""
        return self.unit is not None and self.unit == PER_LOAD.get(self.channel)

    def line(self, *entries: str) -> str:
        """Give the line of a column map that says of the column what is not to be guessed, and where it stands."""
        where = f"[wheels.{self.wheel}]" if self.wheel else "[columns]"
        return f"{map_line(self.channel, self.name, *entries)} under {where} in a column map (--columns)"

    def to_si(self, values: np.ndarray, percent: bool) -> np.ndarray:
        """Give values (n,) in SI; `percent` says that the cells had per cent signs."""
        factor = _PERCENT if percent and self.unit is None else self.factor
        inverse = round(1.0 / factor) if 0.0 < abs(factor) < 1.0 else 0
        # 12.5 mm are 0.0125 m to the last bit by division only
        scaled = values / inverse if inverse and factor == 1.0 / inverse else values * factor
        return scaled + self.offset if self.offset else scaled


def is_known(name: str) -> bool:
    """Say whether a cell of a table can be the name of a column that means something."""
    return name in OWN or (bool(name) and len(name) <= 80 and meaning(name) is not None)


def is_wheel_channel(name: str) -> bool:
    """Say whether a column makes a table a wheel file: one of the contract, misspelt or not, or a force, say."""
    if name in OWN or misspelt(name) is not None:
        return True
    found = meaning(name)
    answers = ("load_N", "torque_Nm", "sinkage_m", "slip", "drawbar_pull_N")
    if found is None or found.channel not in answers:
        return False
    return found.unit is not None or (found.certain and len(key(name)) > 3)


def assign(
    names: Sequence[str],
    given: Sequence[str | None],
    mapped: ColumnMap,
    source: Path,
    map_source: Path | None,
    faults: list[InputError],
) -> dict[str, Column]:
    """Say which column is which channel.

    Parameters
    ----------
    names, given
        Names of the columns, each once, and their units by a row of units.
    mapped
        The column map; it is believed before names.
    source, map_source
        The table and the map, for errors.
    faults
        What is wrong is added to it.

    Returns
    -------
    dict
        By channel; those of scatter within a trial, such as `load_sd_N`, included.
    """
    found = _mapped(names, given, mapped, source, map_source, faults)
    used = {column.name for column in found.values()}
    for name, unit in zip(names, given, strict=True):
        if name in OWN and name not in found and name not in used:
            factor = 1.0 if unit is None else units.factor(unit, _DIMENSIONS[name])
            found[name] = Column(name, name)
            used.add(name)
            if factor != 1.0 and name in _UNITLESS - {"time_s"} and factor is not None:
                found[name] = Column(name, name, factor, 0.0, unit, "name")
            elif factor != 1.0:
                problem = f"the row of units says {unit}"
                faults.append(InputError(source, problem, expected="the unit of its name", place=f"column {name}"))
    # A table in SI with columns of the user's own: a name without a unit there is no channel.
    others = {*_UNITLESS, *TEXT_COLUMNS}
    in_si = any(column.source == "own" and channel not in others for channel, column in found.items())
    taken: dict[str, list[Meaning]] = {}
    places: dict[str, list[str]] = {}
    for name, unit in zip(names, given, strict=True):
        if name in used or name in ALSO_READ or is_scatter(name):
            continue
        read = meaning(name, unit)
        if read is not None and (read.unit is not None or read.channel == "soil" or not in_si):
            taken.setdefault(read.channel, []).append(read)
            places.setdefault(read.channel, []).append(name)
        elif len(names) <= _MOST_COMPARED and (right := misspelt(name)) is not None:
            faults.append(InputError(source, "no column of a wheel file", expected=right, place=f"column {name}"))
    for channel, readings in taken.items():
        if channel not in found:
            column = _chosen(channel, readings, places[channel], source, faults)
            if column is not None:
                found[channel] = column
    if not in_si and "slip" in found and any(column.source == "name" for column in found.values()):
        found["slip"] = replace(found["slip"], source="name" if found["slip"].source == "own" else found["slip"].source)
    faults.extend(_near(names, {column.name for column in found.values()}, found, source))
    place = {name: number for number, name in enumerate(names)}
    return dict(sorted(found.items(), key=lambda entry: place[entry[1].name]))


def _mapped(
    names: Sequence[str],
    given: Sequence[str | None],
    mapped: ColumnMap,
    source: Path,
    map_source: Path | None,
    faults: list[InputError],
) -> dict[str, Column]:
    found: dict[str, Column] = {}
    said = str(map_source or source)
    rows = dict(zip(names, given, strict=True))
    for channel, entry in mapped.columns.items():
        place, dimension = f"key columns.{channel}", _DIMENSIONS.get(channel, "text")
        if entry.column not in rows:
            close = difflib.get_close_matches(entry.column, names, n=1, cutoff=0.5)
            expected = f"{close[0]}" if close else f"one of {', '.join(names)}"
            faults.append(
                InputError(said, f"no column {entry.column!r} in {source.name}", expected=expected, place=place)
            )
            continue
        unit = entry.unit if entry.unit is not None else written(entry.column).unit or rows[entry.column]
        read = meaning(entry.column, rows[entry.column])
        if unit is None and read is not None and read.channel == channel:
            unit = read.unit
        factor = _factor(channel, unit, read)
        if factor is None:
            share = f", {PER_LOAD[channel]} of a coefficient" if channel in PER_LOAD else ""
            expected = (
                f"one of {units.spelt(dimension)}{share}; or scale, the factor to SI, with unit = {_si(dimension)!r}"
            )
            faults.append(InputError(said, f"unit {unit!r}", expected=expected, place=place))
            continue
        scale = 1.0 if entry.scale is None else entry.scale
        found[channel] = Column(
            channel, entry.column, factor * scale, entry.offset, unit, "map", entry.scale is not None,
            entry.definition or "slip",
        )  # fmt: skip
    return found


def _factor(channel: str, unit: str | None, read: Meaning | None) -> float | None:
    """Give the factor to SI of a column that a map names, None where the channel has no such unit."""
    dimension = _DIMENSIONS.get(channel, "text")
    if unit is None or dimension == "text":
        return 1.0
    if unit == PER_LOAD.get(channel):
        return read.factor if read is not None and read.unit == unit else 1.0
    return units.factor(unit, dimension)


def _chosen(
    channel: str, readings: Sequence[Meaning], names: Sequence[str], source: Path, faults: list[InputError]
) -> Column | None:
    """Take the column of a channel; of several, the only one that a word and no letter names."""
    usable = [(read, name) for read, name in zip(readings, names, strict=True) if read.factor is not None]
    measured = [(read, name) for read, name in usable if read.unit != PER_LOAD.get(channel)] or usable
    certain = [(read, name) for read, name in measured if read.certain] or measured
    if not usable:
        read, name = readings[0], names[0]
        why = "no unit" if read.unit is None else f"unit {read.unit!r}"
        line = Column(channel, name).line('unit = "..."')
        expected = f"{channel}: one of {units.spelt(read.dimension)} in brackets, or {line}"
        faults.append(InputError(source, why, expected=expected, place=f"column {name}"))
        return None
    if len(certain) > 1:
        all_names = ", ".join(name for _, name in certain)
        expected = f"one column of it: {Column(channel, certain[0][1]).line()}, or of another of them"
        faults.append(InputError(source, f"{len(certain)} columns mean {channel}: {all_names}", expected=expected))
        return None
    read, name = certain[0]
    return Column(channel, name, read.factor or 1.0, 0.0, read.unit, "name")


def _near(names: Sequence[str], used: set[str], found: Mapping[str, Column], source: Path) -> list[InputError]:
    """Find names that are a channel's with a slip of the pen, where nothing else gives that channel."""
    faults = []
    known = {folded: each for folded, each in names_of_channels().items() if len(folded) > 3}
    for name in names[:_MOST_COMPARED]:
        if name in used or name in ALSO_READ or misspelt(name) is not None or meaning(name) is not None:
            continue
        parted = written(name)
        spelt = key("".join(parted.words))
        if len(spelt) < 4 or (parted.unit is None and not found):
            continue
        close = difflib.get_close_matches(spelt, known, n=1, cutoff=_NEAR)
        right, channel = known[close[0]] if close else ("", None)
        fits = parted.unit is None or (channel and units.factor(parted.unit, _DIMENSIONS[channel]) is not None)
        own = all(column.source == "own" for column in found.values())
        if channel and channel not in found and fits and not (own and parted.unit is None):
            faults.append(
                InputError(
                    source,
                    "no name of a channel",
                    expected=f"{channel}: did you mean {right}?",
                    place=f"column {name}",
                )
            )
    return faults


def hints(names: Sequence[str]) -> dict[str, str]:
    """Give what is to be made of columns that come near to a channel and are none."""
    found: dict[str, str] = {}
    for name in names:
        for stem in ("".join(written(name).words), stem_of(name)[0]):
            if key(stem) in HINTS:
                found[name] = HINTS[key(stem)]
    return found


def is_scatter(name: str) -> bool:
    """Say whether a column is the contract's for the scatter of a channel within a trial, such as `load_sd_N`."""
    return name in {f"{stem}_sd_{unit}" if unit else f"{stem}_sd" for stem, unit in map(stem_of, WHEEL_COLUMNS)}


def map_line(channel: str, column: str, *entries: str) -> str:
    """Give the line of a column map that says of a channel's column what is not to be guessed."""
    return f"{channel} = {{ {', '.join((f'column = {toml_string(column)}', *entries))} }}"


def _si(dimension: str) -> str:
    return "-" if dimension in ("1", "count") else dimension


def _is_word_for_unit(text: str) -> bool:
    return text.isalpha() and units.is_unit(text)


def misspelt(name: str) -> str | None:
    """Give the contract's column that a name is a misspelling of, or None for a column of the user's own."""
    small = name.casefold().replace(" ", "_").replace("-", "_").replace("[", "").replace("]", "")
    for right in OWN:
        if small == right.casefold():
            return None if name == right else right
    for right in sorted(WHEEL_COLUMNS, key=len, reverse=True):
        stem, unit = stem_of(right)
        for beginning, answer in ((stem, right), (f"{stem}_sd", f"{stem}_sd_{unit}" if unit else f"{stem}_sd")):
            if name == answer:
                return None
            rest = small.removeprefix(beginning).split("_") if small.startswith(beginning) else None
            if small == beginning or (rest and rest[0] == "" and all(map(_is_word_for_unit, rest[1:]))):
                return answer
    # a word more makes a column of the user's own, such as wheel_speed_left_rad_s
    alike = {c.casefold(): c for c in WHEEL_COLUMNS if len(c) > 4 and c.count("_") == small.count("_")}
    close = difflib.get_close_matches(small, alike, n=1, cutoff=_NEAR)
    return alike[close[0]] if close else None
