"""What a drive must be to be stored: one that every database takes, and that is read back as it was.

SQLite takes text and numbers that PostgreSQL refuses, and both take estimates that no snapshot would read. One such
drive would keep a whole database from being merged, or from being read.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from datetime import datetime
from types import SimpleNamespace

from ..framework.core.arguments import shown
from ..framework.core.errors import InputError
from .observations import Drive
from .rows import soil_observation, soil_rows
from .tables import DriveRow, table_of

LONGEST_SITE = 200
"""Letters of a site's name, as `add_physics` has it; an index of PostgreSQL takes texts of 2,700 bytes at most."""

_TEXT = "text without zero characters and halves of characters (surrogates)"
_DIGEST = table_of(DriveRow).c.recording_digest


def check_storable(drive: Drive) -> None:
    """Refuse a drive that some database does not take, or that could not be read back.

    Raises
    ------
    InputError
        It names the drive, and what of it.
    """
    source = f"drive {shown(drive.name)}"
    for name in ("recording_digest", "name", "site", "vehicle_name", "method"):
        _check_text(source, name, getattr(drive, name))
    for name, most in (("recording_digest", _DIGEST.type.length), ("site", LONGEST_SITE)):  # type: ignore[attr-defined]
        if len(getattr(drive, name)) > most:
            raise InputError(source, f"{len(getattr(drive, name))} letters", expected=f"{most} at most", place=name)
    _check_start(source, drive.start_time)
    if not isinstance(drive.models, Mapping):
        raise InputError(source, shown(drive.models), expected="the version of the model by sense", place="models")
    for value in (*drive.models, *drive.models.values()):
        _check_text(source, "models", value)
    for value in {reason for reasons in set(drive.terrain.evidence.reasons) for reason in reasons}:
        _check_text(source, "reasons", value)
    for row in soil_rows(drive):
        place = f"soil from {row['start_s']} s to {row['end_s']} s"
        for column, value in row.items():
            _check_parts(source, f"{place}, {column}", value)
        try:
            soil_observation(SimpleNamespace(**row))
        except ValueError as error:
            raise InputError(source, str(error), expected="what can be read back") from error


def _check_start(source: str, start: object) -> None:
    if start is None:
        return
    try:
        if isinstance(start, datetime) and start.utcoffset() is not None:
            start - start.utcoffset()  # type: ignore[operator]
    except OverflowError:
        start = str(start)
    if not isinstance(start, datetime):
        raise InputError(source, shown(start), expected="a time of the years 1 to 9999", place="start_time")


def _check_text(source: str, place: str, value: object) -> None:
    if not isinstance(value, str) or not is_text(value):
        raise InputError(source, ascii(value)[:80], expected=_TEXT, place=place)


def is_text(value: str) -> bool:
    """Say whether every database takes a text: it is of characters, none of which is zero."""
    return "\0" not in value and not any("\ud800" <= letter <= "\udfff" for letter in value)


def _check_parts(source: str, place: str, value: object) -> None:
    """Refuse text and numbers that JSON and SQL do not have, however deep."""
    for part in _parts(value):
        if isinstance(part, str):
            _check_text(source, place, part)
        elif isinstance(part, float) and not math.isfinite(part):
            raise InputError(source, str(part), expected="finite numbers", place=place)


def _parts(value: object) -> Iterator[object]:
    if isinstance(value, Mapping):
        yield from value
        value = list(value.values())
    if isinstance(value, list | tuple):
        for part in value:
            yield from _parts(part)
    else:
        yield value
