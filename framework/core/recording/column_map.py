"""The column map: which column of a table is which channel, where names do not say it, and in which unit.

It is to a table what the topic map is to a bag, and given by the same option; ``docs/recording.md`` shows it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from ..errors import InputError
from ..files import load_toml
from ..models import FileModel, Finite, checked
from .slip_definitions import Definition
from .types import TEXT_COLUMNS, WHEEL_COLUMNS


class MappedColumn(FileModel):
    """A column of the table: its name, its unit, and what makes it SI: scale times value in SI plus offset; of slip
    how it is defined.
    """

    column: str
    unit: str | None = None
    scale: Finite | None = None
    offset: Finite = 0.0
    definition: Definition | None = None


def _channel(name: str) -> str:
    known = (*WHEEL_COLUMNS, *TEXT_COLUMNS)
    if name not in known:
        raise ValueError(f"no column of a wheel file, expected one of {', '.join(known)}")
    return name


AnyColumn = Annotated[MappedColumn, BeforeValidator(lambda v: {"column": v} if isinstance(v, str) else v)]


_Columns = dict[Annotated[str, AfterValidator(_channel)], AnyColumn]


class ColumnMap(FileModel):
    """Which column is which channel; the decimal mark, and the sheet of a workbook, where they are in doubt.

    `wheels` is for tables with columns for each wheel: which of them are of the wheel of that name.
    """

    columns: _Columns = Field(default_factory=dict)
    wheels: dict[str, _Columns] = Field(default_factory=dict)
    decimal: Literal[".", ","] | None = None
    sheet: str | None = None

    @model_validator(mode="after")
    def _check(self) -> ColumnMap:
        for part in (self.columns, *self.wheels.values()):
            for channel, entry in part.items():
                if entry.definition is not None and channel != "slip":
                    raise ValueError(f"{channel} has a definition, expected one of slip only")
        return self

    @property
    def named(self) -> frozenset[str]:
        """Names of all columns in it."""
        return frozenset(entry.column for part in (self.columns, *self.wheels.values()) for entry in part.values())

    def of_wheel(self, name: str) -> ColumnMap:
        """Give the map of one wheel's columns and those that all share."""
        return self.model_copy(update={"columns": {**self.columns, **self.wheels[name]}, "wheels": {}})


def load_column_map(path: Path) -> ColumnMap:
    """Read a column map; raises `InputError` on an unknown key, a wrong value or a column that is none of a wheel's."""
    data = load_toml(path)
    topics = [name for name in ("wheel", "pose", "camera", "sound") if name in data]
    if topics and not data.keys() & {"columns", "wheels"}:
        raise InputError(
            path, f"a topic map, which a bag needs: it has [{topics[0]}]", expected="[columns], for a table"
        )
    return checked(ColumnMap, data, path)
