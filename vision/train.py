"""Training of the camera's classifier from photographs of ground."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier, TrainingOutcome
from ..framework.core.classifier.labelled import LabelledFile, readable
from ..framework.core.classifier.signal_to_noise import NOISE_FREE_DB, SignalToNoise
from ..framework.core.classifier.together import Wholes
from ..framework.core.errors import InputError
from ..framework.core.recording.camera import read_image
from .augment import (
    AS_IT_IS,
    CROP_SHARES,
    DEGRADED,
    GREY_SHARE,
    MAX_BLUR,
    SHARES,
    noise_copies,
    training_patches,
    whole_copies,
)
from .backbone import Backbone
from .crops import IMAGE_PX, SIDES
from .features import FEATURE_NAMES, PATCH_PX, patch_features
from .measures import MODALITY, Measures, feature_names
from .quality import learn_limits, learn_noise, light, noise_leaves, rated

ROWS_WANTED = 6000
PATCHES = (8, 40)
"""Fewest and most patches of one photograph."""
WHOLES_WANTED = 800
COPIES = (1, 4)
"""Fewest and most degraded copies of one photograph from which it is learnt how far to trust all of its crops."""
MIN_SIDE_PX = 16
CANDIDATES = ("stiff logistic", "kernel")
BACKBONE_CANDIDATES = ("stiff logistic", "kernel", "reduced logistic")
"""The first two see the built-in features, the last those of a backbone."""
PATCH_CANDIDATES = ("logistic", "trees")
Progress = Callable[[float], None]


def train_vision(
    labelled: Sequence[LabelledFile],
    rng: np.random.Generator,
    progress: Progress | None = None,
    *,
    notes: Sequence[str] = (),
    backbone: Backbone | None = None,
) -> TrainingOutcome:
    """Train on labelled photographs of ground, seen from above or nearly so.

    Parameters
    ----------
    labelled
        Image files with class and group.
    rng
        Decides on patches, their variations and the splits.
    progress
        Called with the share done, 0 to 1.
    notes
        What the report is to say of the material among its warnings.
    backbone
        A network whose features stand beside the built-in ones. Whether a classifier of either or of both is taken, is
        decided on groups held out.

    Raises
    ------
    InputError
        The backbone cannot be run, no file of a class is a whole image that is large enough, or there are fewer than
        two classes.
    """
    said = list(notes)
    samples: list[LabelledFile] = []

    def images() -> Iterator[tuple[np.ndarray, str, str]]:
        for item, image in readable(labelled, _image, said):
            samples.append(item)
            yield image, item.class_name, item.group

    return _train(images(), len(labelled), rng, progress, said, backbone, samples)


def train_vision_arrays(
    images: Sequence[np.ndarray],
    labels: Sequence[str],
    groups: Sequence[str],
    rng: np.random.Generator,
    progress: Progress | None = None,
    *,
    backbone: Backbone | None = None,
) -> TrainingOutcome:
    """Train on images in memory.

    Parameters
    ----------
    images
        n images, each (h, w, 3) uint8, blue, green, red.
    labels, groups
        n class names and groups.
    rng, progress, backbone
        As in `train_vision`.

    Raises
    ------
    InputError
        An image is too small, or there are fewer than two classes.
    """
    for index, image in enumerate(images):
        _check_size(image, f"image {index}")
    return _train(zip(images, labels, groups, strict=True), len(images), rng, progress, [], backbone)


def _image(item: LabelledFile) -> np.ndarray:
    image = read_image(item.file)
    _check_size(image, item.file)
    return image


def _train(
    images: Iterable[tuple[np.ndarray, str, str]],
    count: int,
    rng: np.random.Generator,
    progress: Progress | None,
    notes: list[str],
    backbone: Backbone | None,
    samples: Sequence[LabelledFile] = (),
) -> TrainingOutcome:
    """Train on images with class and group, `count` at most; `notes` and `samples` may grow until the last was read."""
    report = progress or (lambda share: None)
    measures = Measures(backbone)
    each = int(np.clip(ROWS_WANTED // max(count, 1), *PATCHES))
    copies = COPIES[0] if backbone else int(np.clip(WHOLES_WANTED // max(count, 1), *COPIES))
    measured, in_noise, versions, labels, groups = [], [], [], [], []
    copying, adding = rng.spawn(2)  # of their own: patches are the same whether there are copies or none
    for index, (image, label, group) in enumerate(images):
        patches, kind, snr_dB = training_patches(image, each, rng, measures.side_px)
        small, values = measures.of(patches)
        measured.append((values, light(small), kind, snr_dB))
        labels.append(label)
        groups.append(group)
        copied, ratio_dB = noise_copies(small[kind != DEGRADED], adding)
        in_noise.append((patch_features(copied), ratio_dB))
        for crops in whole_copies(image, copies, copying, measures.side_px):
            small, values = measures.of(crops)
            versions.append((light(small), values))
        report(0.5 * (index + 1) / count)
    if not measured:
        raise InputError("training data", "no photograph", expected="photographs of at least two classes")
    rows, lights, kind, snr_dB = (np.concatenate(part) for part in zip(*measured, strict=True))
    noisy, noisy_dB = (np.concatenate(part) for part in zip(*in_noise, strict=True))
    made = {
        "image_px": IMAGE_PX,
        "crops": [list(side) for side in SIDES],
        "turned_crops": list(CROP_SHARES),
        "patches_per_image": each,
        "max_blur": MAX_BLUR,
        "grey_share": GREY_SHARE,
    }
    built_in, d = len(FEATURE_NAMES), rows.shape[1]
    owner = np.repeat(np.arange(len(labels)), each)
    label, group = np.asarray(labels, dtype=str)[owner], np.asarray(groups, dtype=str)[owner]
    noise, above_noise = learn_noise(rows[:, :built_in], snr_dB, group, noisy, noisy_dB, group[kind != DEGRADED])
    limits = learn_limits(rows, kind != DEGRADED)
    if backbone is not None:
        made["backbone"] = backbone.record()
        notes += [
            text
            for text in (backbone.assumed, f"Features in addition to the built-in ones: {backbone.cost()}.")
            if text
        ]
    return TerrainClassifier.train(
        rows,
        label,
        group,
        modality=MODALITY,
        feature_names=feature_names(d),
        settings={"patch_px": PATCH_PX, "limits": limits, "noise": noise.settings()} | made,
        rng=rng,
        candidates=BACKBONE_CANDIDATES if backbone else CANDIDATES,
        columns=dict(zip(BACKBONE_CANDIDATES, ((0, built_in), (0, built_in), (built_in, d)), strict=True)),
        gate_ends=(built_in,),
        degraded=kind != AS_IT_IS,
        quality=rated(lights, rows, limits, above_noise=above_noise)[0],
        samples=samples,
        sample_of=owner,
        wholes=_wholes(versions, labels, groups, 1 + copies, limits, noise),
        source="labelled photographs",
        notes=notes,
        progress=lambda share: report(0.5 + 0.5 * share),
    )


def _wholes(
    measured: Sequence[tuple[np.ndarray, np.ndarray]], labels: Sequence[str], groups: Sequence[str], each: int,
    limits: dict[str, float], noise: SignalToNoise,
) -> Wholes:  # fmt: skip
    """Put together light and features of crops, `each` versions of a photograph of which the first is as it came."""
    lights, features = (np.concatenate(part) for part in zip(*measured, strict=True))
    above_noise = noise_leaves(noise, features[:, : len(FEATURE_NAMES)])
    return Wholes(
        features, rated(lights, features, limits, above_noise=above_noise)[0],
        np.repeat(np.arange(len(measured)), [len(values) for _, values in measured]),
        np.repeat(np.asarray(labels, dtype=str), each), np.repeat(np.asarray(groups, dtype=str), each),
        np.arange(len(measured)) % each > 0, SHARES[DEGRADED],
    )  # fmt: skip


def train_vision_patches(
    patches: np.ndarray,
    labels: Sequence[str],
    groups: Sequence[str],
    blurred: np.ndarray,
    rng: np.random.Generator,
    progress: Progress | None = None,
    *,
    candidates: Sequence[str] | None = None,
) -> TrainingOutcome:
    """Train on cells of ground as a moving camera has already seen them; noisy copies teach what noise is.

    Parameters
    ----------
    patches : (n, 64, 64, 3)
        uint8, blue, green, red: as `bevameter.vision.project.GroundPatches.cut` gives them.
    labels, groups
        n class names and groups.
    blurred : (n,)
        True for patches that motion has smeared; their scores are reported apart.
    rng, progress
        As in `train_vision`.
    candidates
        Kinds of classifiers to choose from, of `bevameter.framework.core.fitting.CANDIDATES`.

    Raises
    ------
    InputError
        There are fewer than two classes.
    """
    rows, group = patch_features(patches), np.asarray(groups, dtype=str)
    limits = learn_limits(rows, ~np.asarray(blurred, dtype=bool))
    copies, copies_dB = noise_copies(patches, rng.spawn(1)[0])
    clean_dB = np.full(len(patches), NOISE_FREE_DB)
    noise, above_noise = learn_noise(rows, clean_dB, group, patch_features(copies), copies_dB, group)
    if progress is not None:
        progress(0.2)
    return TerrainClassifier.train(
        rows,
        labels,
        groups,
        modality=MODALITY,
        feature_names=FEATURE_NAMES,
        settings={"patch_px": PATCH_PX, "limits": limits, "noise": noise.settings()},
        rng=rng,
        candidates=candidates or PATCH_CANDIDATES,
        degraded=blurred,
        quality=rated(light(patches), rows, limits, above_noise=above_noise)[0],
        source="labelled patches",
        progress=None if progress is None else (lambda share: progress(0.2 + 0.8 * share)),
    )


def _check_size(image: np.ndarray, source: str | Path) -> None:
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or min(image.shape[:2]) < MIN_SIDE_PX:
        raise InputError(
            source,
            f"an image of shape {image.shape}, {image.dtype}",
            expected=f"8-bit colour, at least {MIN_SIDE_PX} px on each side",
        )
