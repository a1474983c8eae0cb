"""The models a run uses: those that a user trained, or small ones trained here on synthetic ground.

The default models are trained the first time they are needed, on samples of the package's own synthetic world, and
cached. They know synthetic ground only, of which each run warns.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
import platformdirs
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError

from .core.arguments import path_of
from .core.classifier.classifier import TerrainClassifier
from .core.classifier.store import FORMAT_VERSION
from .core.errors import InputError
from .senses import senses as all_senses

CACHE_VARIABLE = "BEVAMETER_CACHE"
"""Environment variable that names another folder for the cache."""

SYNTHETIC_WARNING = (
    "models of {senses} know synthetic ground only: on real ground their classes mean nothing; "
    "make your own with `bevameter train`, and give them with --models"
)

_SEED = 20021
_SITES_PER_CLASS = 24
_CANDIDATES = ("logistic",)
"""On synthetic sites of its own it beats trees and kernels, whose training would make the first run wait."""


@dataclass(frozen=True)
class Models:
    """The classifiers of a run, and where each is from.

    Parameters
    ----------
    classifiers
        By name of the sense: ``"vision"``, ``"audio"`` ...
    origins
        By sense: the file that a model was read from.
    synthetic
        Senses whose model knows synthetic ground only.
    """

    classifiers: dict[str, TerrainClassifier]
    origins: dict[str, str]
    synthetic: tuple[str, ...]

    @staticmethod
    def joined(parts: Sequence[Models]) -> Models:
        """Put models of several senses together."""
        return Models(
            {name: each for part in parts for name, each in part.classifiers.items()},
            {name: each for part in parts for name, each in part.origins.items()},
            tuple(sense for part in parts for sense in part.synthetic),
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings to the user."""
        return (SYNTHETIC_WARNING.format(senses=" and ".join(self.synthetic)),) if self.synthetic else ()


def find_models(
    folder: str | Path | None = None,
    database: str | Path | None = None,
    *,
    senses: Sequence[str] = ("audio", "vision"),
    progress: Callable[[str, float], None] | None = None,
) -> Models:
    """Find the model of each sense.

    Looked for in `folder` if given; else next to the database, in ``terrain.models`` for ``terrain.db``; a sense that
    has no ``vision.skops``, say, there gets the default model, trained now if it is not in the cache, or none where it
    is a sense that the synthetic world has nothing for.

    Parameters
    ----------
    folder
        Where a user put models. Then at least one must be there.
    database
        Path or SQLAlchemy URL of the terrain database.
    senses
        Names of those that are needed: no model is trained for nothing.
    progress
        Called with the name of a model in training and the share of it that is done, in [0, 1].

    Raises
    ------
    InputError
        `folder` is missing or holds no model; a model there is damaged or of another sense.
    """
    found = own_models(folder, database)
    own = [sense for sense in senses if sense in found]
    synthetic = tuple(sense for sense in senses if sense not in found and sense in TRAINERS)
    # A damaged model is found out before others are trained.
    classifiers = {sense: TerrainClassifier.load(found[sense], modality=sense) for sense in own}
    classifiers |= {sense: default_model(sense, progress=progress) for sense in synthetic}
    origins = {sense: str(found[sense]) for sense in own} | {sense: str(cached_path(sense)) for sense in synthetic}
    return Models(classifiers, origins, synthetic)


def at_hand(folder: str | Path | None, database: str | Path | None) -> tuple[str, ...]:
    """Name the senses whose model `find_models` need not train; raises `InputError` as it does."""
    found = own_models(folder, database)
    return tuple(
        sense.name
        for sense in all_senses()
        if sense.name in found or (sense.name in TRAINERS and cached_path(sense.name).is_file())
    )


def own_models(folder: str | Path | None, database: str | Path | None) -> dict[str, Path]:
    """Give the files of a user's models by sense; raises `InputError` where a folder is named that holds none."""
    where = path_of("models", folder, "the folder that holds them") if folder is not None else models_of(database)
    paths = {} if where is None else {sense.name: where / f"{sense.name}.skops" for sense in all_senses()}
    found = {name: path for name, path in paths.items() if path.is_file()}
    if folder is not None and not found:
        names = " or ".join(path.name for path in paths.values())
        raise InputError(Path(folder), "no model", expected=f"a folder with {names}")
    return found


def models_of(database: str | Path | None) -> Path | None:
    """Give the folder of models that belongs to a database: ``terrain.models`` next to ``terrain.db``.

    None where the database is no file.
    """
    if database is None:
        return None
    text = str(database)
    if "://" in text:
        try:
            url = make_url(text)
        except ArgumentError:
            return None
        if not url.drivername.startswith("sqlite") or url.database in (None, "", ":memory:"):
            return None
        text = str(url.database)
    path = Path(text)
    return path.with_name(f"{path.stem}.models")


def cache_folder() -> Path:
    """Give the folder of the default models."""
    other = os.environ.get(CACHE_VARIABLE)
    return Path(other) if other else Path(platformdirs.user_cache_dir("bevameter", appauthor=False)) / "models"


def cached_path(sense: str) -> Path:
    """Give the file of a default model: named by the package's version and by all code that shapes the model."""
    return cache_folder() / f"{sense}-{version('bevameter')}-{_recipe(sense)}.skops"


@cache
def _recipe(sense: str) -> str:
    """Hash of the settings and of the sources that make samples and features: a change of either is another model."""
    digest = hashlib.sha256(repr((_SEED, _SITES_PER_CLASS, FORMAT_VERSION)).encode())
    own = Path(__file__).resolve().parent
    files = [*(own / "core").rglob("*.py"), *(own / "scenario").glob("*.py"), *(own.parent / sense).glob("*.py")]
    for file in sorted(files):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:12]


def default_model(sense: str, *, progress: Callable[[str, float], None] | None = None) -> TerrainClassifier:
    """Give the default model of a sense from the cache; train it first where it is missing or damaged.

    Raises
    ------
    InputError
        The cache cannot be written.
    """
    path = cached_path(sense)
    if path.is_file():
        try:
            return TerrainClassifier.load(path, modality=sense)
        except InputError:
            path.unlink(missing_ok=True)  # damaged: trained again below
    classifier = train_default(sense, progress=progress)
    classifier.save(path)
    return classifier


def train_default(
    sense: str, *, sites_per_class: int = _SITES_PER_CLASS, progress: Callable[[str, float], None] | None = None
) -> TerrainClassifier:
    """Train the default model of a sense on synthetic ground.

    Parameters
    ----------
    sense
        ``"vision"`` or ``"audio"``.
    sites_per_class
        Sites of each class of the synthetic world.
    progress
        Called with what is trained and the share of it that is done, in [0, 1].
    """

    def report(share: float) -> None:
        if progress is not None:
            progress(f"training {sense}", share)

    report(0.0)
    return TRAINERS[sense](np.random.default_rng(_SEED), sites_per_class, report)


def _vision(rng: np.random.Generator, sites: int, report: Callable[[float], None]) -> TerrainClassifier:
    from ..vision.train import train_vision_patches
    from .scenario.samples import labelled_looks

    looks = labelled_looks(rng, sites, progress=lambda share: report(0.8 * share))
    return train_vision_patches(
        looks.patches, looks.labels, looks.groups, looks.blurred, rng, lambda share: report(0.8 + 0.2 * share),
        candidates=_CANDIDATES,
    ).classifier  # fmt: skip


def _audio(rng: np.random.Generator, sites: int, report: Callable[[float], None]) -> TerrainClassifier:
    from ..audio.train import train_audio_windows
    from .scenario.samples import labelled_sounds

    sounds = labelled_sounds(rng, sites, progress=lambda share: report(0.8 * share))
    return train_audio_windows(
        sounds.windows, sounds.labels, sounds.groups, sounds.snr_dB, rng,
        progress=lambda share: report(0.8 + 0.2 * share), candidates=_CANDIDATES,
    ).classifier  # fmt: skip


TRAINERS = {"vision": _vision, "audio": _audio}
"""What the synthetic world has samples for."""
