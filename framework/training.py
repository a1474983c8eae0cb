"""A classifier from a labelled folder, and files classified by it: the same few steps for every sense."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from .core.classifier.classifier import TerrainClassifier, TrainingOutcome
from .core.classifier.labelled import read_labelled

Modality = Literal["vision", "audio", "vibration"]


def train_from_folder(modality: Modality, folder: str | Path, *, seed: int = 0) -> TrainingOutcome:
    """Train a sense on a labelled folder.

    Parameters
    ----------
    modality
        ``"vision"``, ``"audio"`` or ``"vibration"``.
    folder
        With ``index.csv`` (file, class, group[, start_s, end_s]), or with sub-folders named by class.
    seed
        Seed of everything random.

    Returns
    -------
    TrainingOutcome
        The classifier, and the report of how well it does on groups that it was not trained on.

    Raises
    ------
    InputError
        The folder, its index, or a file in it cannot be used; the text names it.
    """
    rng = np.random.default_rng(seed)
    notes: list[str] = []
    labelled = read_labelled(Path(folder), notes)
    if modality == "vision":
        from ..vision.train import train_vision

        return train_vision(labelled, rng, notes=notes)
    if modality == "audio":
        from ..audio.train import train_audio

        return train_audio(labelled, rng, notes=notes)
    from ..audio.vibration import train_vibration

    return train_vibration(labelled, rng, notes=notes)


def classify_files(modality: Modality, files: Sequence[str | Path], model: str | Path) -> list[dict]:
    """Classify files: one row for each file and window (sound, vibration) or image.

    Raises
    ------
    InputError
        The model is not one of this modality, or a file cannot be read.
    """
    classifier = TerrainClassifier.load(Path(model), modality=modality)
    paths = [Path(file) for file in files]
    if modality == "vision":
        from ..vision.classify import classify_images

        return classify_images(paths, classifier)
    if modality == "audio":
        from ..audio.classify import classify_sounds

        return classify_sounds(paths, classifier)
    from ..audio.vibration import classify_vibration

    return classify_vibration(paths, classifier)
