"""Zeros of sensors that differ from run to run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...mechanics.textbook import CHANNELS
from ..effect import PULL, SINKAGE, TORQUE, Drive, Effect, Parameter, Situation
from ..registry import register
from ..sensors import SYMBOLS

_MOST_RUNS = 24
"""Runs up to which the effect is considered: each has a zero in every channel."""

_HELD, _WITHIN = {"load_N": "load", "rim_speed_m_s": "speed of the rim", "pitch_rad": "slope along the track"}, 0.2
"""What may be constant within each run and differ between runs, and the share of its variance that is then within runs
[-]."""


@register
class ZerosByRun(Effect):
    """Zeros differ from run to run, as where sensors are reset before each run, or the surface is levelled again."""

    slug = "zeros_by_run"
    title = "run-to-run zero error"
    what_happens = "the zero of a channel differs from run to run"
    check = "read the sensors before and after each run with the wheel just touching the ground"
    kind = "instrument"
    by_run = True
    by_place = True
    of_one_drive = True
    equation = "q reported = q + q_0, q_0 constant in each run"
    source = "definition"

    def __init__(self, channels: Sequence[int], typical: np.ndarray, runs: np.ndarray, remark: str = "") -> None:
        self.form = " and ".join(CHANNELS[each] for each in channels)
        self.remark, self.changes = remark, tuple(channels)
        self._channels, self._runs = list(channels), runs
        parameters = []
        for each in channels:
            (symbol, unit), usual = SYMBOLS[each], float(typical[each])
            source = "engineering judgement: zeros drift by 5 % of the usual reading between runs"
            parameters += [
                Parameter(f"{symbol}_0_run{run + 1}", unit, -2.0 * usual, 2.0 * usual, 0.0, 0.05 * usual, source)
                for run in runs.tolist()
            ]
        self.parameters = tuple(parameters)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give a form for each channel, and one for all of them, of several runs in which slip varies.

        Where each run has its own slip, zeros by run would explain any dependence on slip.
        """
        drive, runs = situation.drive, np.unique(situation.drive.run)
        wheels = len(np.unique(drive.wheel))  # a zero of one wheel is a fault of that wheel's sensor
        if not 2 * wheels <= len(runs) <= _MOST_RUNS:
            return ()
        if not drive.has("slip") or _within_runs(drive, "slip") < 1.0 - _WITHIN:
            return ()
        held = [words for name, words in _HELD.items() if drive.has(name) and _within_runs(drive, name) < _WITHIN]
        others = " or the ".join(held)
        remark = f"{cls.title}: it may depend on the {others} instead, which differs between runs" if held else ""
        seen = _measured(situation)
        together = [seen] if len(seen) > 1 else []
        return [cls(each, situation.typical, runs, remark) for each in [*([one] for one in seen), *together]]

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give a form for each channel, with a zero for every run that there may be."""
        return [cls([each], situation.typical, np.arange(_MOST_RUNS)) for each in _measured(situation)]

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        run = np.minimum(np.searchsorted(self._runs, drive.run), len(self._runs) - 1)
        # The zeros of a run that the recording did not have are not known.
        known = self._runs[run] == drive.run
        for channel, zeros in zip(self._channels, values.reshape(len(self._channels), -1), strict=True):
            channels[:, channel] += np.where(known, zeros[run], 0.0)


def _measured(situation: Situation) -> list[int]:
    return [channel for channel in (TORQUE, SINKAGE, PULL) if situation.measures(channel)]


def _within_runs(drive: Drive, name: str) -> float:
    """Share of a covariate's variance that is within runs [-]."""
    values = getattr(drive, name)
    good = np.isfinite(values)
    values, run = values[good], np.unique(drive.run[good], return_inverse=True)[1]
    mean = np.bincount(run, values) / np.bincount(run)
    return float(np.var(values - mean[run]) / np.var(values))
