"""Models of what files say: strict, frozen, and what is wrong named in one line with its key."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, ValidationError

from .errors import InputError
from .origin import Offset, Origin

_SHOWN = 80
"""Characters of a value that are shown at most [-]."""

Model = TypeVar("Model", bound=BaseModel)


class FileModel(BaseModel):
    """A table of a file: a key that nothing reads is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def _number(value: object) -> object:
    """Refuse what pydantic would take for a number though a file that says it has another meaning."""
    if isinstance(value, bool | str):
        raise ValueError(f"{value!r:.{_SHOWN}}, expected a number")
    return value


Number = Annotated[float, BeforeValidator(_number)]
Whole = Annotated[int, BeforeValidator(_number)]
Positive = Annotated[Number, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[Number, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[Number, Field(allow_inf_nan=False)]


def _numbers(value: object, expected: str, counts: tuple[int, ...]) -> list[float]:
    """Give the numbers of a list; raises ValueError where they are none or not so many."""
    if isinstance(value, list) and len(value) in counts and all(type(each) in (int, float) for each in value):
        return [float(each) for each in value]
    raise ValueError(f"{value!r:.{_SHOWN}}, expected {expected}")


def _origin(value: object) -> Origin:
    try:
        return Origin(*_numbers(value, "[latitude, longitude] or [latitude, longitude, heading] in degrees", (2, 3)))
    except InputError as error:
        raise ValueError(str(error)) from None


def _offset(value: object) -> Offset:
    x_m, y_m, yaw_deg = _numbers(value, "[x, y, yaw] in metres and degrees", (3,))
    try:
        return Offset(x_m, y_m, math.radians(yaw_deg))
    except InputError as error:
        raise ValueError(str(error)) from None


StatedOrigin = Annotated[Origin, PlainValidator(_origin)]
StatedOffset = Annotated[Offset, PlainValidator(_offset)]


def checked(model: type[Model], data: object, path: str | Path, written: Mapping[str, str] | None = None) -> Model:
    """Make a model of a file's data.

    Parameters
    ----------
    model
        Its class.
    data
        What stands in the file.
    path
        The file, for errors.
    written
        How keys are written that the model has by another name.

    Raises
    ------
    InputError
        A key or its value is at fault: file, key and value are named. A key that nothing reads comes before one that is
        missing: the former is often the latter, misspelt.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        fault = min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
    key = ".".join(str(part) for part in fault["loc"] if part != "[key]")
    for read, wrote in (written or {}).items():
        key = key.replace(read, wrote, 1)
    place = f"key {key}" if key else None
    if fault["type"] == "extra_forbidden":
        raise InputError(path, "no such key", place=place)
    shown = "" if fault["type"] in ("missing", "value_error") else f"{fault['input']!r:.{_SHOWN}}: "
    raise InputError(path, f"{shown}{fault['msg'].removeprefix('Value error, ')}", place=place)
