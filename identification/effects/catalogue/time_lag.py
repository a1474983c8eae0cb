"""A channel arrives late."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

from ...mechanics.textbook import CHANNELS
from ..effect import LOAD, PULL, SINKAGE, SLIP, TORQUE, Drive, Effect, Parameter, Situation
from ..registry import register

_LONGEST = 40
"""Bound of the delay [samples]."""

_CHORD, _ONE_RATE = 20, 0.9
"""Rows over which slip changes, and share of its mean square change that its mean change makes above which it has one
rate [-]: a ramp of slip has more than 0.99, slip that rises and falls less than 0.1."""

_PRIOR = "engineering judgement: filters and buses delay by a few samples"


@register
class TimeLag(Effect):
    """A channel arrives late (early, where negative)."""

    slug = "time_lag"
    title = "time lag"
    what_happens = "a channel arrives late"
    check = "stop and start the wheel abruptly, and compare when the channels respond"
    kind = "instrument"
    needs = ("time_s",)
    source = "definition"

    def __init__(self, channel: int, step_s: float) -> None:
        self.form = CHANNELS[channel]
        self.equation = f"{self.form} reported at t = {self.form} at t - tau"
        self.changes = Effect.changes if channel in (LOAD, SLIP) else (channel,)
        self._channel, self._step = channel, step_s
        longest = _LONGEST * step_s
        self.parameters = (Parameter("tau", "s", -longest, longest, step_s, 4.0 * step_s, _PRIOR, step=0.2 * step_s),)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give a delay of each channel of a time series; of slip only where it does not change at one rate."""
        drive = situation.drive
        one_rate = drive.has("time_s") and slips_at_one_rate(drive)
        return [form for form in cls.forms_by_name(situation) if not (one_rate and form.form == CHANNELS[SLIP])]

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give a delay and a low-pass of each channel of a time series."""
        drive = situation.drive
        if not (drive.timed and drive.has("time_s")):
            return ()
        steps = np.diff(drive.time_s)[np.diff(drive.stretch) == 0]
        step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
        answers = [channel for channel in (TORQUE, SINKAGE, PULL) if situation.measures(channel)]
        lags = [TimeLag(channel, step) for channel in [*answers, LOAD, SLIP]]
        return [*lags, *(LowPass(channel, step) for channel in answers)]

    def starts(self) -> list[np.ndarray]:
        return [np.array([samples * self._step]) for samples in (1.5, 6.0, 20.0, -2.0)]

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        if self._channel in (LOAD, SLIP):
            column = 0 if self._channel == LOAD else 1
            imposed[:, column] = delayed(imposed[:, column], drive.time_s, drive.periods, -values[0])

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        if self._channel not in (LOAD, SLIP):
            channels[:, self._channel] = delayed(channels[:, self._channel], drive.time_s, drive.periods, values[0])


class LowPass(Effect):
    """A channel is smoothed by its amplifier or its driver, and so arrives late."""

    slug, title, what_happens, check = TimeLag.slug, TimeLag.title, TimeLag.what_happens, TimeLag.check
    kind = "instrument"
    needs = ("time_s",)
    source = "definition of a first-order low-pass"

    def __init__(self, channel: int, step_s: float) -> None:
        self.form = f"{CHANNELS[channel]}, low-pass"
        self.equation = f"tau d({CHANNELS[channel]} reported)/dt = {CHANNELS[channel]} - {CHANNELS[channel]} reported"
        self.changes = (channel,)
        self._channel, self._step = channel, step_s
        self.parameters = (
            Parameter("tau", "s", 0.0, _LONGEST * step_s, step_s, 4.0 * step_s, _PRIOR, step=0.2 * step_s),
        )

    def starts(self) -> list[np.ndarray]:
        return [np.array([samples * self._step]) for samples in (1.0, 5.0)]

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, self._channel] = filtered(channels[:, self._channel], drive.time_s, drive.periods, float(values[0]))


def delayed(values: np.ndarray, time_s: np.ndarray, runs: Sequence[np.ndarray], lag_s: float) -> np.ndarray:
    """Values (n,) as they were `lag_s` ago, interpolated within each of the clock's runs; their ends are held."""
    answer = np.empty_like(values)
    for rows in runs:
        good = rows[np.isfinite(values[rows]) & np.isfinite(time_s[rows])]
        answer[rows] = np.interp(time_s[rows] - lag_s, time_s[good], values[good]) if good.size else np.nan
    return answer


def filtered(values: np.ndarray, time_s: np.ndarray, runs: Sequence[np.ndarray], constant_s: float) -> np.ndarray:
    """Values (n,) behind a first-order low-pass of time constant [s], within each of the clock's runs.

    Exact for values that are linear between samples.
    """
    answer = values.copy()
    for rows in runs:
        good = rows[np.isfinite(values[rows]) & np.isfinite(time_s[rows])]
        if len(good) < 2:
            continue
        step = float(np.median(np.diff(time_s[good])))
        constant = max(constant_s, 1e-9 * step)
        keep = math.exp(-step / constant)
        reached = (1.0 - keep) * constant / step
        now, before = 1.0 - reached, reached - keep
        # The run starts settled.
        answer[good], _ = lfilter([now, before], [1.0, -keep], values[good], zi=[(before + keep) * values[good[0]]])
    return answer


def slips_at_one_rate(drive: Drive) -> bool:
    """Say whether slip changes at one rate in time: a delay is then an offset of slip."""
    together = drive.stretch[_CHORD:] == drive.stretch[:-_CHORD]
    change = (drive.slip[_CHORD:] - drive.slip[:-_CHORD])[together]
    return bool(change.any()) and float(change.mean() ** 2) > _ONE_RATE * float(np.mean(change**2))
