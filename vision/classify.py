"""Naming the ground on photographs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier
from ..framework.core.errors import InputError
from ..framework.core.evidence import ClassEvidence
from ..framework.core.recording.camera import read_image
from .crops import image_patches
from .features import FEATURE_NAMES
from .measures import Measures, measures_of
from .quality import light, rated
from .train import MIN_SIDE_PX

THUMBNAIL_PX = 160
NO_COLOUR = "no colour in the image, and the model was trained on colour"
_COLOURED = 0.02
"""Mean saturation of training patches above which a model goes by colour [-]; that of grey is 0."""


def misses_colour(model: TerrainClassifier, image: np.ndarray) -> bool:
    """Say whether an image (h, w, 3) has no colour at all, as a monochrome camera's, and the model cannot do without.

    It can where some of what it was trained on had lost its colour.
    """
    if model.settings.get("grey_share") or model.fitted.mean[FEATURE_NAMES.index("saturation")] <= _COLOURED:
        return False
    thinned = image[::4, ::4]
    return bool((thinned == thinned[:, :, :1]).all())


def patch_evidence(
    model: TerrainClassifier, measures: Measures, patches: np.ndarray, **known: np.ndarray
) -> ClassEvidence:
    """Say what patches (n, s, s, 3) show, all in one batch; `known` is passed on to `rated`."""
    small, features = measures.of(patches)
    above_noise = measures.above_noise(features)
    quality, reasons = rated(light(small), features, model.settings["limits"], above_noise=above_noise, **known)
    return model.evidence(features, quality, reasons)


def image_evidence(model: TerrainClassifier, images: Sequence[np.ndarray]) -> ClassEvidence:
    """Say what each image, (h, w, 3) uint8, shows: its patches pooled, one item an image."""
    measures = measures_of(model)
    patches = [image_patches(image, measures.side_px) for image in images]
    if not patches:
        return ClassEvidence.nothing(model.classes, [])
    unit = np.repeat(np.arange(len(patches)), [len(part) for part in patches])
    evidence = patch_evidence(model, measures, np.concatenate(patches))
    if grey := [number for number, image in enumerate(images) if misses_colour(model, image)]:
        unknown = np.isin(unit, grey)
        nothing = ClassEvidence.nothing(model.classes, [(NO_COLOUR,)] * int(unknown.sum()))
        evidence = ClassEvidence.concatenate([evidence.select(~unknown), nothing])
        unit = np.concatenate([unit[~unknown], unit[unknown]])
    return model.pool(evidence, unit, len(patches))


def classify_images(files: Sequence[str | Path], model: TerrainClassifier) -> list[dict]:
    """Name the ground on photographs.

    Parameters
    ----------
    files
        JPEG or PNG files.
    model
        Of modality ``"vision"``.

    Returns
    -------
    list of dict
        One for each file, in order: file, start_s and end_s (None), class, probabilities, quality, unknown, reasons.

    Raises
    ------
    InputError
        A file is no whole image, or the model is for other features or without its backbone.
    """
    measures_of(model)
    rows: list[dict] = []
    for file in files:
        image = read_image(file)
        if min(image.shape[:2]) < MIN_SIDE_PX:
            raise InputError(
                file, f"{image.shape[1]} x {image.shape[0]} px", expected=f"{MIN_SIDE_PX} px or more on each side"
            )
        rows += image_evidence(model, [image]).as_rows(file)
    return rows


def thumbnail(file: str | Path) -> bytes:
    """Give a photograph as a JPEG of at most `THUMBNAIL_PX` on each side; raises `InputError` where it is none."""
    image = read_image(file)
    factor = min(1.0, THUMBNAIL_PX / max(image.shape[:2]))
    size = (max(1, round(image.shape[1] * factor)), max(1, round(image.shape[0] * factor)))
    return cv2.imencode(".jpg", cv2.resize(image, size, interpolation=cv2.INTER_AREA))[1].tobytes()
