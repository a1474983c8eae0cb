"""Vibration of a bag: what its inertial sensor (sensor_msgs/Imu) hears of the ground, with the wheels' own channels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .bag_messages import number
from .topic_map import VibrationTopic
from .types import VibrationRun, WheelTable
from .vibration import MAX_RUN_S, SAMPLE_RATE_HZ, in_g, of_wheels, on_clock

NAMES = ("wx", "wy", "wz", "ax", "ay", "az")
"""Channels: rates of turning [rad/s] and accelerations [m/s^2] along the sensor's axes."""

_FIELDS = tuple(f"{of}.{axis}" for of in ("angular_velocity", "linear_acceleration") for axis in "xyz")

LEAST_RATE_HZ = 20.0
"""Slower messages of an inertial sensor hold no vibration [Hz]."""

_CLOCK = 0.95
"""Share of the least rate from which on a sensor nominally has it: 20 Hz may be 19.97 [-]."""


def shaken(content: Any) -> tuple[float, ...]:
    """Give the channels of a message; raises `DecodeError` where it has no such fields."""
    return tuple(number(content, field) for field in _FIELDS)


def vibration_of(
    rows: Sequence[tuple[float, ...]], origin_ns: int, wheel: WheelTable | None, source: VibrationTopic | None,
    path: Path,
) -> tuple[VibrationRun | None, list[str]]:  # fmt: skip
    """Bring an inertial sensor's messages onto the clock of vibration runs, with current and speed of each wheel.

    Parameters
    ----------
    rows
        Time [ns] and `NAMES` of each message.
    origin_ns
        Zero of the recording's clock [ns].
    wheel
        Channels of the wheels; named ``current_NAME`` and ``speed_NAME``.
    source, path
        The sensor's topic, and the bag.

    Returns
    -------
    VibrationRun or None, problems
        None where the messages are too few or too slow to hold vibration, which is said where there are any.
    """
    if source is None or len(rows) < 2:
        return None, []
    time_s = (np.array([each[0] for each in rows], dtype=np.int64) - origin_ns) * 1e-9
    values = np.array([each[1:] for each in rows])
    seen = np.isfinite(values).all(axis=1)
    time_s, first = np.unique(time_s[seen], return_index=True)
    values = values[seen][first]
    if len(time_s) < 2:
        return None, []
    rate = 1.0 / float(np.median(np.diff(time_s)))
    if rate < _CLOCK * LEAST_RATE_HZ or time_s[-1] - time_s[0] > MAX_RUN_S:
        span = f"{rate:.3g} messages a second over {time_s[-1] - time_s[0]:.0f} s"
        return None, [
            f"{source.topic}: {span} are not used as vibration, which needs {LEAST_RATE_HZ:g} or more within a day"
        ]
    clock = time_s[0] + np.arange(int((time_s[-1] - time_s[0]) * SAMPLE_RATE_HZ + 1e-6) + 1) / SAMPLE_RATE_HZ
    channels = np.column_stack([on_clock(time_s, each, clock, rate, 5.0 / rate) for each in values.T])
    run = VibrationRun(clock, NAMES, channels, *of_wheels(wheel, clock), SAMPLE_RATE_HZ, path)
    return run, in_g(NAMES, channels, source.topic)
