"""One sound out of what several microphones, or several channels of a recorder, took down."""

from __future__ import annotations

import numpy as np

CANCELLED = 0.01
"""A mean that holds less than this share of the loudest channel's power is the difference of the channels, not their
common sound [-]."""


def mixed(channels: np.ndarray) -> np.ndarray:
    """Mix the channels of a stretch of sound.

    Parameters
    ----------
    channels : (m, c)
        Samples, finite; or (m,) of one channel.

    Returns
    -------
    np.ndarray
        (m,), the channels' mean; the loudest of them where they cancel, as a balanced line does that was recorded as
        left and right, and where all others are silent.
    """
    if channels.ndim == 1 or channels.shape[1] == 1:
        return channels.reshape(len(channels))
    mean = channels.mean(axis=1)
    power = np.square(channels).mean(axis=0, dtype=np.float64)
    cancelled = np.square(mean).mean(dtype=np.float64) < CANCELLED * power.max()
    return channels[:, np.argmax(power)] if cancelled else mean
