"""What the microphone hears along a drive: the ground of each stretch, the drive's whine, and what disturbs it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from .contact_sound import contact_sound, engine, motor_whine, wind
from .plan import Plan

_FLOOR = 0.0006
"""Root mean square of the microphone's own noise, of full scale [-]."""

_FADE_S = 0.3


def heard(plan: Plan) -> Iterator[np.ndarray]:
    """Yield the sound of a drive stretch by stretch, (m,) float32 in [-1, 1], from the preset's `sound_start_s` on."""
    rate = plan.preset.sound_rate_Hz
    if rate is None:
        return
    start = plan.preset.sound_start_s
    count = int((plan.duration_s - start) * rate)
    edges = [0, *(round((s.end_s - start) * rate) for s in plan.stretches[:-1]), count]
    for number, (first, last) in enumerate(pairwise(edges)):
        if last <= first:
            continue
        time = start + np.arange(first, last) / rate
        rng = plan.generator(1000 + number)
        speed = plan.at(plan.speed_m_s, time)
        wheel = plan.preset.vehicle.wheels[0]
        omega = speed / (wheel.radius_m * (1.0 - plan.at(plan.slip, time)))
        sound = contact_sound(plan.stretches[number].terrain, speed, rate, rng)
        sound += motor_whine(omega, rate, rng)
        sound += _FLOOR * rng.standard_normal(len(time), dtype=np.float32)
        for kind, source in (("wind", wind), ("engine", engine)):
            _disturb(plan, kind, source, time, sound, rate, rng)
        sound[plan.fault("microphone_dropout", time)] = 0.0
        yield np.clip(sound, -1.0, 1.0)


def _disturb(
    plan: Plan,
    kind: str,
    source: Callable[[int, int, np.random.Generator], np.ndarray],
    time: np.ndarray,
    sound: np.ndarray,
    rate: int,
    rng: np.random.Generator,
) -> None:
    """Add a disturbance where faults of its kind are on, swelling and fading."""
    for fault in plan.faults:
        if fault.kind != kind:
            continue
        first, last = np.searchsorted(time, [fault.start_s, fault.end_s])
        if last > first:
            now = time[first:last]
            fade = np.clip(np.minimum(now - fault.start_s, fault.end_s - now) / _FADE_S, 0.0, 1.0)
            sound[first:last] += (fade * source(last - first, rate, rng)).astype(np.float32)
