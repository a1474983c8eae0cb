"""What a model's file says of itself, checked key by key before anything is made of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from .class_names import check_class_names
from .errors import InputError
from .models import checked

FORMAT = "bevameter terrain classifier"
FORMAT_VERSION = 1

_Temperature = Annotated[float, Field(gt=0, lt=1e3)]


class Metadata(BaseModel):
    """Metadata of a terrain classifier, as they stand in its file; see `TerrainClassifier` and `Fitted`."""

    model_config = ConfigDict(strict=True, frozen=True)

    modality: str
    classes: Annotated[list[str], Field(min_length=2)]
    feature_names: Annotated[list[str], Field(min_length=1)]
    settings: dict[str, Any]
    report: dict[str, Any]
    member_temperatures: Annotated[list[_Temperature], Field(min_length=1)]
    temperature: _Temperature
    threshold: Annotated[float, Field(gt=0, lt=1e6)]
    correlation: Annotated[float, Field(ge=0, le=1)]


def checked_metadata(meta: dict, path: Path) -> Metadata:
    """Check metadata as JSON has them.

    Raises
    ------
    InputError
        The file is another program's or of another version, or a key is missing or holds what it may not; the text
        names the file and the key.
    """
    if meta.get("format") != FORMAT:
        raise InputError(path, "another program's file", expected="a model that `bevameter train` wrote")
    version = meta.get("format_version")
    if version is True or version != FORMAT_VERSION:
        raise InputError(path, f"format version {version}", expected=f"version {FORMAT_VERSION}")
    read = checked(Metadata, meta, path)
    check_class_names(read.classes, path, "key classes")
    for key, names in (("classes", read.classes), ("feature_names", read.feature_names)):
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(path, f"{twice!r} stands twice", expected="each name once", place=f"key {key}")
    return read
