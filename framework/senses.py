"""The senses: what trains, classifies files and observes a recording's ground, and the registry of them.

A sense is one class in one module. Modules of this package whose name ends in ``sense`` are found where they lie; one
of another distribution is found by its entry point in the group ``bevameter.senses``, or registers itself when its
module is imported::

    @register
    class Thermal(Sense):
        name, instrument = "thermal", "thermal camera"

        def train(self, labelled, rng, *, notes=()): ...
        def classify(self, files, model): ...
        def absence(self, recording): ...
        def observe(self, recording, track, model, cell_size_m): ...
"""

from __future__ import annotations

import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import ClassVar

import numpy as np

from .core.classifier.classifier import TerrainClassifier, TrainingOutcome
from .core.classifier.labelled import LabelledFile, read_labelled
from .core.classifier.shipped import load_model
from .core.errors import InputError
from .core.evidence import ClassEvidence
from .core.plugins import load_plugins, once
from .core.recording.types import Recording
from .core.track.way import Places, cells_under_wheels


@dataclass(frozen=True)
class Observation:
    """Evidence of n items (looks, windows of time), and the m cells of the ground that they are of.

    Parameters
    ----------
    evidence
        n items.
    time_s : (n,)
        When each was observed [s].
    item : (m,)
        Index of an item. An item may be of several cells, and of none where nobody knows the place.
    cells : (m, 2)
        The cell (`framework.core.pooling.cells_of`).
    window_s : (n, 2), optional
        Beginning and end of each item's window of time [s], where its cells are those that the wheels ran over in it.
    """

    evidence: ClassEvidence
    time_s: np.ndarray
    item: np.ndarray
    cells: np.ndarray
    window_s: np.ndarray | None = None

    @staticmethod
    def under_wheels(
        evidence: ClassEvidence,
        start_s: np.ndarray,
        end_s: np.ndarray,
        recording: Recording,
        track: Places,
        cell_size_m: float,
    ) -> Observation:
        """Lay n windows of time from `start_s` to `end_s` (n,) [s] on the cells that the wheels then ran over."""
        item, cells = cells_under_wheels(track, recording.vehicle, start_s, end_s, cell_size_m)
        return Observation(evidence, 0.5 * (start_s + end_s), item, cells, np.column_stack([start_s, end_s]))


class Sense(ABC):
    """Recognises classes of terrain by one instrument.

    Attributes
    ----------
    name
        That of its models: ``vision`` is trained by ``bevameter train vision`` and read from ``vision.skops``.
    instrument
        That of what it observes with, for summaries and reasons: ``camera``.
    takes_backbone
        Whether a network of the user's own may measure for it.
    """

    name: ClassVar[str]
    instrument: ClassVar[str]
    takes_backbone: ClassVar[bool] = False

    @abstractmethod
    def train(
        self, labelled: Sequence[LabelledFile], rng: np.random.Generator, *, notes: Sequence[str] = ()
    ) -> TrainingOutcome:
        """Train a classifier of modality `name` on labelled files; `notes` go among the report's warnings.

        Where `takes_backbone` is true there is a further keyword, `backbone`: an ONNX file, or None.

        Raises
        ------
        InputError
            A file cannot be used, or there are fewer than two classes.
        """

    @abstractmethod
    def classify(self, files: Sequence[Path], model: TerrainClassifier) -> list[dict]:
        """Classify files: the rows of `ClassEvidence.as_rows`, one for each file and window.

        Raises
        ------
        InputError
            A file cannot be read, or the model is not of this version.
        """

    def excerpt(self, sample: LabelledFile) -> str:
        """Show a labelled sample in a report, as HTML that needs nothing from elsewhere; empty where it cannot be."""
        return ""

    def remarks(self, model: TerrainClassifier) -> tuple[str, ...]:
        """Say what a user should know of a model before a run, such as what it costs; raises `InputError`."""
        return ()

    @abstractmethod
    def absence(self, recording: Recording) -> str:
        """Say why a recording cannot be observed by this sense; empty where it can, given places and a model."""

    def recorded(self, recording: Recording) -> bool:
        """Say whether a recording has what this sense observes, whatever else it lacks: then a model is looked for."""
        return not self.absence(recording)

    @abstractmethod
    def observe(
        self, recording: Recording, track: Places, model: TerrainClassifier, cell_size_m: float
    ) -> Iterator[Observation]:
        """Observe the ground of a recording, in order of time, in memory that does not grow with its length.

        Raises
        ------
        InputError
            The model is not of this version.
        """


SENSES: dict[str, Sense] = {}
"""Those that are registered, by name; `senses` loads all of them first."""


def register(sense: type[Sense]) -> type[Sense]:
    """Add a sense, as a decorator of its class; it takes the place of another of the same name."""
    SENSES[sense.name] = sense()
    return sense


@once
def load_senses() -> None:
    """Import the modules of this package's senses, and of others that entry points name."""
    others = dict(SENSES)
    package = import_module("..", __package__)
    for part in pkgutil.iter_modules(package.__path__):
        folders = [str(Path(folder) / part.name) for folder in package.__path__]
        for module in pkgutil.iter_modules(folders) if part.ispkg else ():
            if module.name.endswith("sense"):
                import_module(f"{package.__name__}.{part.name}.{module.name}")
    load_plugins("bevameter.senses")
    SENSES.update(others)  # what was registered before stays


def senses() -> tuple[Sense, ...]:
    """Give all senses, in the order of their instruments' names."""
    load_senses()
    return tuple(sorted(SENSES.values(), key=lambda sense: (sense.instrument, sense.name)))


def sense_named(name: str) -> Sense:
    """Give a sense; raises `InputError` where there is none of that name."""
    known = {sense.name: sense for sense in senses()}
    if name not in known:
        raise InputError("sense", f"no sense {name!r}", expected=" or ".join(known))
    return known[name]


def senses_of(recording: Recording) -> tuple[str, ...]:
    """Name the senses that a recording has something for, and so need a model."""
    return tuple(sense.name for sense in senses() if sense.recorded(recording))


def train_sense(name: str, folder: str | Path, *, seed: int = 0, backbone: str | Path | None = None) -> TrainingOutcome:
    """Train a sense on a labelled folder.

    Parameters
    ----------
    name
        Of the sense, such as ``"vision"``.
    folder
        With ``index.csv`` (file, class, group[, start_s, end_s]), or with sub-folders named by class.
    seed
        Seed of everything random.
    backbone
        ONNX file of an image network whose features are used with the built-in ones; for ``"vision"``.

    Returns
    -------
    TrainingOutcome
        The classifier, and the report of how well it does on groups that it was not trained on.

    Raises
    ------
    InputError
        There is no such sense, or it takes no backbone; the backbone, the folder, its index, or a file in it cannot be
        used; the text names it.
    """
    sense, notes = sense_named(name), []
    if backbone is not None and not sense.takes_backbone:
        raise InputError("backbone", f"{name} takes none", expected="a sense that sees images: vision")
    further = {} if backbone is None else {"backbone": Path(backbone)}
    labelled = read_labelled(Path(folder), notes)
    return sense.train(labelled, np.random.default_rng(seed), notes=notes, **further)


def classify_files(name: str, files: Sequence[str | Path], model: str | Path) -> list[dict]:
    """Classify files by a sense's model, its file or the name of one that comes with the package.

    Returns
    -------
    list of dict
        One row for each file and window.

    Raises
    ------
    InputError
        There is no such sense, the model is not one of it, or a file cannot be read.
    """
    sense = sense_named(name)
    return sense.classify([Path(file) for file in files], load_model(model, name))
