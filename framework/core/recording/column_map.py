"""The column map: which column of a table is which channel, where names do not say it, and in which unit.

It is to a table what the topic map is to a bag, and given by the same option; ``docs/recording.md`` shows it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from ..errors import InputError
from ..files import load_toml
from ..models import FileModel, Finite, checked
from .types import WHEEL_COLUMNS


class MappedColumn(FileModel):
    """A column of the table: its name, its unit, and what makes it SI: scale times value in SI plus offset."""

    column: str
    unit: str | None = None
    scale: Finite | None = None
    offset: Finite = 0.0


def _channel(name: str) -> str:
    if name not in (*WHEEL_COLUMNS, "wheel", "run"):
        raise ValueError(f"no column of a wheel file, expected one of {', '.join((*WHEEL_COLUMNS, 'wheel', 'run'))}")
    return name


AnyColumn = Annotated[MappedColumn, BeforeValidator(lambda v: {"column": v} if isinstance(v, str) else v)]


class ColumnMap(FileModel):
    """Which column is which channel; the decimal mark, and the sheet of a workbook, where they are in doubt."""

    columns: dict[Annotated[str, AfterValidator(_channel)], AnyColumn] = Field(default_factory=dict)
    decimal: Literal[".", ","] | None = None
    sheet: str | None = None


def load_column_map(path: Path) -> ColumnMap:
    """Read a column map; raises `InputError` on an unknown key, a wrong value or a column that is none of a wheel's."""
    data = load_toml(path)
    topics = [name for name in ("wheel", "pose", "camera", "sound") if name in data]
    if topics and "columns" not in data:
        raise InputError(
            path, f"a topic map, which a bag needs: it has [{topics[0]}]", expected="[columns], for a table"
        )
    return checked(ColumnMap, data, path)
