"""Columns of several wheels in one table, by labels in their names: ``Fz FL [N]``, ``left_Fz``, ``DP rear right``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from .column_map import MappedColumn
from .column_names import Meaning, meaning, written
from .types import WHEEL_COLUMNS

_WORDS = {
    **dict.fromkeys(("front", "vorne", "vorn", "avant", "delantera"), ("front", "")),
    **dict.fromkeys(("middle", "mid", "mitte"), ("middle", "")),
    **dict.fromkeys(("rear", "back", "hinten", "arrière", "trasera"), ("rear", "")),
    **dict.fromkeys(("left", "l", "links", "li", "gauche"), ("", "left")),
    **dict.fromkeys(("right", "r", "rechts", "re", "droite"), ("", "right")),
    **dict.fromkeys(("fl", "lf", "vl"), ("front", "left")),
    **dict.fromkeys(("fr", "rf", "vr"), ("front", "right")),
    **dict.fromkeys(("ml", "lm"), ("middle", "left")),
    **dict.fromkeys(("mr", "rm"), ("middle", "right")),
    **dict.fromkeys(("rl", "lr", "bl", "lb", "hl"), ("rear", "left")),
    **dict.fromkeys(("rr", "br", "rb", "hr"), ("rear", "right")),
}
"""Axle and side by the words and letters for them, in English, German, French and Spanish."""

_OF_WHEEL = frozenset({"wheel", "w", "rad", "roue", "rueda", "side", "axle"})
_NUMBERED = re.compile(r"(?:wheel|rad|roue|w)?(\d{1,2})")
_MOST_WORDS, _LONGEST = 3, 80
"""Most words of a label, and longest name of a column with one [-]."""

_FEWEST_IN_COMMON = 2
"""Channels that wheels which are only numbered have in common: Load 1 and Load 2 alone may be two cells of one [-]."""

ByWheel = dict[str, dict[str, list[MappedColumn]]]


def wheels_in(names: Sequence[str], given: Sequence[str | None], taken: frozenset[str]) -> ByWheel:
    """Find the columns of each wheel, by wheel and channel; none where a table is not of several wheels.

    Parameters
    ----------
    names, given
        Names of the columns, and their units by a row of units.
    taken
        Columns whose channel is known otherwise.
    """
    found: ByWheel = {}
    for name, unit in zip(names, given, strict=True):
        if name not in taken and (known := _of_a_wheel(name, unit)) is not None:
            wheel, read = known
            column = MappedColumn(column=name, unit=read.unit)
            found.setdefault(wheel, {}).setdefault(read.channel, []).append(column)
    numbered = {wheel: own for wheel, own in found.items() if wheel.startswith("wheel_")}
    if _in_common(numbered.values()) < _FEWEST_IN_COMMON:
        found = {wheel: own for wheel, own in found.items() if wheel not in numbered}
    return found if _in_common(found.values()) else {}


def is_of_a_wheel(name: str) -> bool:
    """Say whether a cell of a table can be the name of a column of one of several wheels."""
    return len(name) <= _LONGEST and any(map(str.isalpha, name)) and _of_a_wheel(name, None) is not None


def _in_common(wheels: Iterable[dict[str, list[MappedColumn]]]) -> int:
    """Count the channels that several wheels have."""
    channels = [channel for own in wheels for channel in own]
    return sum(channels.count(channel) > 1 for channel in set(channels))


def _of_a_wheel(name: str, unit: str | None) -> tuple[str, Meaning] | None:
    """Give the wheel and what the column of it is, or None where its name has no label or says nothing without it."""
    parted = written(name)
    words = [part for word in parted.words for part in re.findall(r"[^\W\d_]+|\d+", word)]
    unit = parted.unit if parted.unit is not None else unit
    for other in parted.others:
        if wheel := _wheel([word for word in re.split(r"[\s_\-]+", other) if word]):
            return _read(wheel, words, unit)
    for length in range(min(_MOST_WORDS, len(words) - 1), 0, -1):
        for start in range(len(words) - length, -1, -1):
            wheel = _wheel(words[start : start + length])
            if wheel and (read := _read(wheel, [*words[:start], *words[start + length :]], unit)):
                return read
    return None


def _read(wheel: str, words: Sequence[str], unit: str | None) -> tuple[str, Meaning] | None:
    read = meaning("_".join(words), unit)
    return (wheel, read) if read is not None and read.channel in WHEEL_COLUMNS and read.channel != "time_s" else None


def _wheel(label: Sequence[str]) -> str:
    """Name the wheel of a label, such as front_left of FL; empty where it is none."""
    words = [word.casefold() for word in label]
    if numbered := _NUMBERED.fullmatch("".join(words)):
        return f"wheel_{int(numbered[1])}"
    places = [_WORDS.get(word) for word in words if word not in _OF_WHEEL]
    if not places or None in places:
        return ""
    axles, sides = ([each[at] for each in places if each and each[at]] for at in (0, 1))
    return "_".join([*axles, *sides]) if len(axles) < 2 and len(sides) < 2 else ""
