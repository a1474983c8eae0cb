"""The models that come with the package: what there is, and reading them with their digests checked.

A model is three files of the folder ``core/trained``: ``NAME.skops``, its card ``NAME.md``, and an example with the
answer that the model gave when it was made. ``index.json`` lists them. ``make models`` writes all of it.
"""

from __future__ import annotations

import hashlib
import json
import os
from functools import cache
from pathlib import Path
from typing import Literal

from ..errors import InputError, reading
from ..models import FileModel, checked
from .classifier import TerrainClassifier

FOLDER = Path(__file__).parents[1] / "trained"
INDEX = "index.json"
_REMEDY = "the file that the package came with; install it again"


class ShippedModel(FileModel):
    """A model that comes with the package.

    Parameters
    ----------
    name
        ``vision-real``.
    sense
        Name of its sense.
    ground
        Of which ground it was trained: ``"real"`` or ``"synthetic"``.
    default
        Whether a run takes it where a user has no model of the sense.
    measured
        How well it does on what it was not trained on, in words.
    limits
        What it is not to be trusted for, in words; why it is not taken by itself where it is none of the defaults.
    classes
        Names of its classes.
    sha256, version
        Of its file, hexadecimal; and of its content, as in `TerrainClassifier`.
    example, example_sha256
        A file that the sense classifies, and its digest.
    answers
        What the model answered when it was made: rows of `Sense.classify` without the file's name.
    """

    name: str
    sense: str
    ground: Literal["real", "synthetic"]
    default: bool
    measured: str
    limits: str
    classes: tuple[str, ...]
    sha256: str
    version: str
    example: str
    example_sha256: str
    answers: tuple[dict, ...]

    @property
    def file(self) -> Path:
        """The model."""
        return FOLDER / f"{self.name}.skops"

    @property
    def card(self) -> str:
        """The card: data, licence, split, scores and limits (Markdown)."""
        file = self.file.with_suffix(".md")
        with reading(file, _REMEDY):
            return file.read_text(encoding="utf-8")

    def load(self) -> TerrainClassifier:
        """Read the model; raises `InputError` where its file is missing or is not the one that was made."""
        _check_digest(self.file, self.sha256)
        return TerrainClassifier.load(self.file, modality=self.sense)

    def example_file(self) -> Path:
        """Give the example; raises `InputError` where it is missing or is not the one that was used."""
        _check_digest(FOLDER / self.example, self.example_sha256)
        return FOLDER / self.example


@cache
def shipped_models() -> dict[str, ShippedModel]:
    """Give the models by name; raises `InputError` where their index is damaged."""
    index = FOLDER / INDEX
    with reading(index, _REMEDY):
        try:
            listed = json.loads(index.read_text(encoding="utf-8"))
        except ValueError as error:
            raise InputError(index, f"no JSON: {error}", expected=_REMEDY) from None
        return {name: checked(ShippedModel, {"name": name, **entry}, index) for name, entry in listed.items()}


def shipped_model(name: str) -> ShippedModel:
    """Give one model; raises `InputError` where there is none of that name."""
    known = shipped_models()
    if name not in known:
        raise InputError("model", f"no {name!r} comes with the package", expected="one of " + ", ".join(known))
    return known[name]


def named(model: str | Path) -> ShippedModel | None:
    """Give the model of that name; None where it is the path of a file or folder, or of neither."""
    return None if os.path.exists(model) else shipped_models().get(str(model))


def load_model(model: str | Path, sense: str) -> TerrainClassifier:
    """Read a model by its file or, where it came with the package, by its name; raises `InputError`."""
    shipped = named(model)
    if shipped is None:
        return TerrainClassifier.load(Path(model), modality=sense)
    if shipped.sense != sense:
        raise InputError(shipped.name, f"a model for {shipped.sense}", expected=f"a model for {sense}")
    return shipped.load()


def _check_digest(file: Path, sha256: str) -> None:
    with reading(file, _REMEDY):
        found = hashlib.sha256(file.read_bytes()).hexdigest()
    if found != sha256:
        raise InputError(file, f"SHA-256 {found[:12]}...", expected=f"{sha256[:12]}..., {_REMEDY}")
