"""Samples as callers hand them over, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ..core.arguments import number, refused, shown
from ..core.errors import InputError
from ..core.recording.sound import MAX_CHANNELS, SAMPLE_RATES
from ..core.recording.types import WHEEL_COLUMNS
from ..core.vehicle import Vehicle
from .log import WheelRow

_CHANNELS = frozenset((*WHEEL_COLUMNS, "yaw_rad", "roll_rad", "current_A")) - {"time_s"}


def finite(what: str, name: str, value: object) -> float:
    """Give a number of a sample; raises `InputError` where it is none, or not finite."""
    found = number(f"{what}, {name}", value, "a finite number")
    if not math.isfinite(found):
        raise refused(f"{what}, {name}", value, "a finite number")
    return found


def image_of(frame: np.ndarray) -> np.ndarray:
    """Give a copy of an image, (h, w, 3); raises `InputError` where it is none."""
    image = np.asarray(frame)
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)):
        said = f"{image.dtype} of shape {image.shape}"
        raise InputError("image", said, expected="uint8 of shape (height, width, 3) or (height, width)")
    return np.array(image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2))


def sound_of(block: ArrayLike, sample_rate_Hz: object) -> tuple[np.ndarray, int]:
    """Give a copy of samples, (m, c) float32, and their rate [Hz]; raises `InputError` where they are none."""
    rate = number("sound", sample_rate_Hz, "a sample rate [Hz]")
    low, high = SAMPLE_RATES
    if not low <= rate <= high or rate != round(rate):
        raise InputError("sound", f"{rate:g} Hz", expected=f"a whole number from {low} to {high} Hz")
    given = np.asarray(block)
    if given.dtype.kind != "f":  # whole numbers would be taken for a sound that is thousands of times too loud
        raise InputError("sound", f"samples of {given.dtype}", expected="numbers with a point, in [-1, 1]")
    samples = np.array(given if given.ndim != 1 else given[:, None], dtype=np.float32)
    if samples.ndim != 2 or not 1 <= samples.shape[1] <= MAX_CHANNELS:
        raise InputError("sound", f"shape {given.shape}", expected="samples (m,), or (m, channels)")
    return samples, round(rate)


def wheel_row(vehicle: Vehicle, wheel: str, channels: Mapping[str, object]) -> WheelRow:
    """Give a sample of a wheel; raises `InputError` where it is none."""
    names = [each.name for each in vehicle.wheels]
    if not names:
        raise InputError("wheel", "a sample, and the vehicle has no wheels", expected="[wheel] in vehicle.toml")
    if (wheel or len(names) > 1) and wheel not in names:
        raise InputError("wheel", shown(wheel), expected=f"one of {', '.join(names)}")
    values = {}
    for name, value in channels.items():
        if name not in _CHANNELS:
            raise InputError("wheel", f"channel {name}", expected=f"some of {', '.join(sorted(_CHANNELS))}")
        values[name] = number(f"wheel, {name}", value, "a number")
        if math.isinf(values[name]):
            raise InputError("wheel", f"{name} {values[name]}", expected="a finite number, or NaN")
    return WheelRow(wheel, values)
