"""What a model measures of patches: the built-in features, and those of a backbone beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier
from ..framework.core.classifier.signal_to_noise import SignalToNoise
from ..framework.core.errors import InputError
from .backbone import Backbone, recorded_backbone
from .crops import resized
from .features import FEATURE_NAMES, PATCH_PX, patch_features
from .quality import check_limits, noise_leaves

MODALITY = "vision"


@dataclass(frozen=True)
class Measures:
    """Features of patches, and what they say of noise; models of before do not know how noise shows."""

    backbone: Backbone | None = None
    noise: SignalToNoise | None = None

    @property
    def side_px(self) -> int:
        """Side of the patches that are measured [px]."""
        return self.backbone.preprocessing.size_px if self.backbone else PATCH_PX

    def of(self, patches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Measure patches (n, s, s, 3) uint8: these at `PATCH_PX`, by which quality is judged, and features (n, d)."""
        if self.backbone is None:
            return patches, patch_features(patches)
        small = np.stack([resized(patch, PATCH_PX) for patch in patches])
        return small, np.concatenate([patch_features(small), self.backbone.features(patches)], axis=1)

    def above_noise(self, features: np.ndarray) -> np.ndarray | None:
        """Give what noise leaves of the quality of patches with features (n, d), (n,); None where that is not known."""
        return None if self.noise is None else noise_leaves(self.noise, features[:, : len(FEATURE_NAMES)])


def feature_names(d: int) -> tuple[str, ...]:
    """Give the names of d features: the built-in ones, then those of a backbone."""
    return FEATURE_NAMES + tuple(f"backbone_{index}" for index in range(d - len(FEATURE_NAMES)))


def measures_of(model: TerrainClassifier) -> Measures:
    """Give what a model measures.

    Raises
    ------
    InputError
        The model is for other features than those made here, its limits or its noise model are damaged, or its backbone
        is missing or does not give what it gave at training.
    """
    expected = "a model that `bevameter train vision` of this version wrote"
    d, stored = len(model.feature_names), model.settings.get("backbone")
    made = model.modality, model.feature_names, model.settings.get("patch_px"), d > len(FEATURE_NAMES)
    if made != (MODALITY, feature_names(d), PATCH_PX, stored is not None):
        problem = "made for other features than this version of Bevameter measures"
        raise InputError(model.source, problem, expected=expected)
    try:
        check_limits(model.settings.get("limits"))
    except ValueError as error:
        raise InputError(model.source, str(error), expected=expected, place="key settings.limits") from None
    noise = None
    if "noise" in model.settings:
        try:
            noise = SignalToNoise.from_settings(model.settings["noise"], len(FEATURE_NAMES))
        except ValueError as error:
            raise InputError(model.source, str(error), expected=expected, place="key settings.noise") from None
    if stored is None:
        return Measures(noise=noise)
    backbone = recorded_backbone(stored, model.source)
    if len(stored["test_features"]) != d - len(FEATURE_NAMES):
        raise InputError(
            model.source, "a test vector of another length", expected=expected, place="key settings.backbone"
        )
    return Measures(backbone, noise)
