"""How far a window of vibration is to be trusted, and why not: gaps, a stuck sensor, standstill, noise."""

from __future__ import annotations

import numpy as np

from ..framework.core.classifier.signal_to_noise import SignalToNoise
from .vibration_features import VibrationChannels

STILL = np.log(2.0)
"""So far below the quietest training windows the vehicle is at standstill: half their amplitude."""


def levels(channels: VibrationChannels) -> list[int]:
    """Columns of how strongly each channel of the inertial sensor moves."""
    return [index for index, name in enumerate(channels.names) if name.endswith("_level")]


def noise_columns(channels: VibrationChannels) -> slice:
    """Columns of the inertial sensor: what wheels do says nothing of its noise."""
    return slice(channels.blocks()["drive"].start)


def rated(
    features: np.ndarray, channels: VibrationChannels, quietest: float, noise: SignalToNoise | None
) -> tuple[np.ndarray, list[tuple[str, ...]]]:
    """Rate windows.

    Parameters
    ----------
    features : (n, d)
        Of `vibration_features`.
    channels
        What they are made of.
    quietest
        Mean level of the quietest training windows [log of the channels' units].
    noise
        Estimates how far vibration stands above noise; None where a model has no such estimate.

    Returns
    -------
    quality : (n,)
        In [0, 1] [-]: the product of what little movement and noise leave; 0 for a gap or a stuck channel.
    reasons
        n tuples of phrases, where less than three quarters are left.
    """
    level = features[:, levels(channels)]
    gap = np.asarray(~np.isfinite(level).all(axis=1))
    stuck = np.asarray((level < np.log(2e-8)).any(axis=1))
    with np.errstate(invalid="ignore"):
        moving = np.clip((level.mean(axis=1) - quietest + STILL) / STILL, 0.0, 1.0)
    ratio = np.full(len(features), np.inf) if noise is None else noise.estimate(features[:, noise_columns(channels)])
    clear = np.ones(len(features)) if noise is None else noise.clear(ratio)
    quality: np.ndarray = np.where(gap | stuck, 0.0, np.nan_to_num(moving) * clear)
    reasons: list[tuple[str, ...]] = [()] * len(quality)
    for index in np.flatnonzero(quality < 0.75):
        if gap[index]:
            reasons[index] = ("the vibration was not recorded",)
        elif stuck[index]:
            reasons[index] = ("a channel does not change",)
        elif moving[index] <= clear[index]:
            reasons[index] = ("hardly any vibration: the vehicle stands, or nearly",)
        else:
            side = "below" if ratio[index] < 0 else "above"
            reasons[index] = (
                f"noise or a poor sensor: the ground's vibration is {abs(ratio[index]):.0f} dB {side} the noise",
            )
    return quality, reasons
