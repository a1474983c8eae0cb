"""How far a patch of ground may be trusted: light, clipping, sharpness, noise, and pixels on the ground.

What counts as sharp (`learn_limits`) and how noise shows (`learn_noise`) is learnt from the training patches and kept
in a model's settings; the other limits follow from 8-bit pixels.
"""

from __future__ import annotations

import numpy as np

from ..framework.core.classifier.signal_to_noise import SignalToNoise
from .features import FEATURE_NAMES

_FINE_WEAK = [FEATURE_NAMES.index("energy_mean_0.2"), FEATURE_NAMES.index("energy_weak_0.2")]
_COARSE_STRONG = [FEATURE_NAMES.index("energy_mean_0.05"), FEATURE_NAMES.index("energy_strong_0.05")]

CLIPPED = (0.05, 0.5)
"""Share of clipped pixels at which quality starts to fall, and at which it is 0 [-]."""
DARK = (24.0, 6.0)
"""Mean grey level at which quality starts to fall, and at which it is 0: noise and quantisation take over [-]."""
FLAT = (3.0, 0.7)
"""Standard deviation of grey levels, likewise: smooth snow and sand have little, and colour and brightness tell [-]."""
BLUR_QUALITY = 0.3
"""Quality that is left to a patch as blurred as the most blurred ones that training knew [-]."""
DROWNED_DB = -10.0
"""Contrast of the ground over noise at which a patch is not to be trusted any more [dB]: answers say no more than the
shares of the classes do (photographs held out)."""
RESOLVED_PX = (40.0, 12.0)
"""Pixels of the image across a patch, likewise [px]."""

_COSTS = 0.8
"""A fault is named where it leaves less than this [-]."""


def sharpness(features: np.ndarray) -> np.ndarray:
    """Give the log ratio of fine detail in the most blurred direction to coarse detail, (n,), of features (n, d)."""
    return features[:, _FINE_WEAK].sum(axis=1) - features[:, _COARSE_STRONG].sum(axis=1)


def learn_limits(features: np.ndarray, sharp: np.ndarray) -> dict[str, float]:
    """Learn what is sharp from training patches.

    Parameters
    ----------
    features : (n, d)
        Of `patch_features`.
    sharp : (n,)
        True for patches that were not blurred.

    Returns
    -------
    dict
        `sharp`: the 3rd percentile of sharpness among unblurred patches, so that ground which is smooth by nature
        does not count as blurred; `blurred`: the 1st among blurred ones.
    """
    value = sharpness(features)
    finite = np.isfinite(value)
    low = float(np.percentile(value[finite & sharp], 3))
    floor = float(np.percentile(value[finite & ~sharp], 1)) if (finite & ~sharp).any() else low - 3.0
    return {"sharp": low, "blurred": min(floor, low - 0.5)}


def check_limits(limits: object) -> None:
    """Refuse what `learn_limits` cannot have given; raises `ValueError`."""
    if not isinstance(limits, dict) or set(limits) != {"sharp", "blurred"}:
        raise ValueError(f"{limits!r} where sharp and blurred should be")
    for name, value in limits.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise ValueError(f"{name} is {value!r}, no finite number")
    if limits["sharp"] <= limits["blurred"]:
        raise ValueError(f"sharp, {limits['sharp']:g}, is not above blurred, {limits['blurred']:g}")


def learn_noise(
    features: np.ndarray,
    snr_dB: np.ndarray,
    groups: np.ndarray,
    copies: np.ndarray,
    copies_dB: np.ndarray,
    copies_groups: np.ndarray,
) -> tuple[SignalToNoise, np.ndarray]:
    """Learn how noise shows, from training patches and from noisy copies that teach nothing else.

    Parameters
    ----------
    features : (n, d)
        Of `patch_features`, of the training patches; rows that are not finite are passed over.
    snr_dB : (n,)
        Contrast of the ground over the noise added to each [dB]; `NOISE_FREE_DB` where none was.
    groups : (n,)
        What must stay on one side of a split.
    copies, copies_dB, copies_groups : (m, d), (m,), (m,)
        Likewise of the copies.

    Returns
    -------
    noise
        The estimate, and what it leaves of the quality.
    left : (n,)
        What noise leaves of the quality of each training patch, in [0, 1], by a model that has not seen its group.
    """
    inputs, ratio_dB = np.concatenate([features, copies]), np.concatenate([snr_dB, copies_dB])
    finite = np.isfinite(inputs).all(axis=1)
    group = np.concatenate([groups, copies_groups])[finite]
    noise, held_dB = SignalToNoise.fit(inputs[finite], ratio_dB[finite], group, drowned_dB=DROWNED_DB, squares=True)
    left = np.ones(len(inputs))
    left[finite] = noise.clear(held_dB)
    return noise, left[: len(features)]


def noise_leaves(noise: SignalToNoise, features: np.ndarray) -> np.ndarray:
    """Give what noise leaves of the quality of patches with features (n, d), (n,); 1 where they are not finite."""
    ratio_dB = noise.estimate(features)
    return np.where(np.isfinite(ratio_dB), noise.clear(ratio_dB), 1.0)


def light(patches: np.ndarray) -> np.ndarray:
    """Measure the light of patches (n, s, s, 3): share of clipped pixels, mean and spread of grey levels, (n, 3)."""
    grey = patches[:, ::2, ::2].reshape(len(patches), -1, 3)
    top, bottom = grey.max(axis=2), grey.min(axis=2)
    level = grey[:, :, 1].astype(np.float32)
    clipped = ((top >= 253) | ((top <= 2) & (bottom <= 2))).mean(axis=1)
    return np.column_stack([clipped, level.mean(axis=1), level.std(axis=1)])


def well_lit(patches: np.ndarray) -> np.ndarray:
    """Say of patches (n, s, s, 3) whether neither light nor texture costs a fifth of the quality, (n,)."""
    kept = [_ramp(column, *ends) for column, ends in zip(light(patches).T, (CLIPPED, DARK, FLAT), strict=True)]
    return np.asarray((np.stack(kept) >= _COSTS).all(axis=0))


def rated(
    lights: np.ndarray,
    features: np.ndarray,
    limits: dict[str, float],
    *,
    above_noise: np.ndarray | None = None,
    resolution_px: np.ndarray | None = None,
    blur_share: np.ndarray | None = None,
) -> tuple[np.ndarray, list[tuple[str, ...]]]:
    """Judge patches.

    Parameters
    ----------
    lights : (n, 3)
        Of `light`.
    features : (n, d)
        Of the same patches.
    limits
        Of `learn_limits`.
    above_noise : (n,)
        What noise leaves of the quality, where the model knows noise (`noise_leaves`) [-].
    resolution_px : (n,)
        Pixels of the image across each patch, where the geometry is known [px].
    blur_share : (n,)
        Path of the camera during the exposure over the side of the patch, where both are known [-].

    Returns
    -------
    quality : (n,)
        In [0, 1]: the product of what each fault leaves.
    reasons
        n tuples: the faults that cost a fifth or more.
    """
    value = np.nan_to_num(
        sharpness(features), nan=limits["blurred"], posinf=limits["blurred"], neginf=limits["blurred"]
    )
    sharp = BLUR_QUALITY + (1 - BLUR_QUALITY) * _ramp(value, limits["sharp"], limits["blurred"])
    faults = [
        ("overexposed or underexposed", _ramp(lights[:, 0], *CLIPPED)),
        ("dark", _ramp(lights[:, 1], *DARK)),
        ("no texture", _ramp(lights[:, 2], *FLAT)),
        ("blurred", sharp),
    ]
    if above_noise is not None:
        faults.append(("noise", above_noise))
    if resolution_px is not None:
        faults.append(("too few pixels on the ground", _ramp(resolution_px, *RESOLVED_PX)))
    if blur_share is not None:
        faults.append(("moving fast for the exposure", _ramp(np.nan_to_num(blur_share), 0.2, 1.0)))
    kept = np.stack([share for _, share in faults], axis=1)
    names = [name for name, _ in faults]
    reasons: list[tuple[str, ...]] = [()] * len(lights)
    for index in np.flatnonzero((kept < _COSTS).any(axis=1)):
        reasons[index] = tuple(name for name, share in zip(names, kept[index], strict=True) if share < _COSTS)
    return kept.prod(axis=1), reasons


def _ramp(value: np.ndarray, good: float, bad: float) -> np.ndarray:
    """1 at `good` and better, 0 at `bad` and worse, straight in between."""
    return np.clip((value - bad) / (good - bad), 0.0, 1.0)
