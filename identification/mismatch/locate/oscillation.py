"""A line in the spectrum of what a fit leaves: something that oscillates by the clock, whatever ground and wheel do."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import welch
from scipy.stats import f as ratio_of_variances

from ...effects.effect import Drive
from ...mechanics.textbook import CHANNELS
from ..fit.fitting import Fitted, Problem

_SEGMENTS, _SHORTEST, _LONGEST = 8, 48, 512
"""Into how many segments a recording is cut (they overlap by half), and the fewest and most rows of one."""

_OVERLAP = 1.0 / 36.0
"""Squared correlation of the spectra of two Hann segments that overlap by half (P. D. Welch, IEEE Trans. Audio
Electroacoust. 15 (1967), 70-73)."""

_AWAY, _BESIDE = 2, 9
"""Frequencies on each side that a line reaches into, and those after them whose mean is the background: the side with
more, for noise behind a filter has a slope or an edge, and a line stands out of both sides."""

_INDEPENDENT = 0.55
"""Share of so many neighbouring frequencies that tell independently [-]: a Hann window's transform (-1/4, 1/2, -1/4)
makes squared correlations of 4/9 between the next ones and 1/36 between those after."""

_SLOWEST = 6
"""Periods in a segment below which an oscillation may be ground or memory."""

_CHANCE, _SHARED = math.log(1e-6), 10.0
"""Log-probability by which noise may look like a line, all frequencies and channels together, and how many times the
background load or slip have where they have a line themselves, which a channel follows [-]."""

_WORTH_A_WORD = 0.05
"""Share of what is left of a channel, its variance, below which a line in it is of no interest [-]."""

_EVEN = 0.3
"""Share of the step by which rows of one rate may come early or late [-]."""

_LOST = 0.02
"""Share of a channel's rows from which on those that were not observed make lines of their own [-]."""

_NOTHING = 1e-300
"""What a channel that never varies is divided by."""


@dataclass(frozen=True)
class Oscillation:
    """A line at `frequency_Hz` in what is left of a channel, of an amplitude in its unit, SI."""

    channel: str
    frequency_Hz: float
    amplitude: float


@dataclass(frozen=True)
class _Spectra:
    """Spectra (k, m) at frequencies (k,) [Hz], the backgrounds of noise (k, m), and the degrees of freedom of both."""

    frequency: np.ndarray
    power: np.ndarray
    background: np.ndarray
    freedom: float

    def chance(self) -> np.ndarray:
        """Log-probability (k, m) by which noise is as strong at each frequency; 0 where it is not looked at."""
        answer = np.zeros_like(self.power)
        searched = slice(_SLOWEST - 1, len(self.frequency) - 2)
        ratio = (self.power / self.background)[searched]
        answer[searched] = ratio_of_variances.logsf(ratio, self.freedom, _INDEPENDENT * _BESIDE * self.freedom)
        return answer


def oscillations(problem: Problem, fitted: Fitted) -> tuple[Oscillation, ...]:
    """Find the strongest line in what a fit leaves of each channel (n, m), SI.

    None where rows do not follow evenly in time for long enough, or where load or slip have a line there, or at half of
    its frequency.
    """
    drive = problem.samples.drive
    spectra = _spectra(drive, np.nan_to_num(fitted.residuals))
    imposed = _spectra(drive, np.column_stack([drive.load_N, drive.slip]))
    if spectra is None or imposed is None:
        return ()
    chance, shared = spectra.chance(), (imposed.power / imposed.background).max(axis=1) > _SHARED
    shared[: _SLOWEST - 1] = False
    found = []
    for position, answer in enumerate(problem.answers):
        if np.isnan(fitted.residuals[:, position]).mean() > _LOST:
            continue
        seldom = chance[:, position] + math.log(chance.size) < _CHANCE
        ratio = np.where(seldom, spectra.power[:, position] / spectra.background[:, position], 0.0)
        at = int(np.argmax(ratio))
        half = (at + 1) // 2 - 1
        if ratio[at] == 0.0 or shared[max(at - 1, 0) : at + 2].any() or shared[max(half - 1, 0) : half + 3].any():
            continue
        line = slice(at - 2, at + 3)
        above = (spectra.power[line, position] - spectra.background[line, position]).clip(min=0.0).sum()
        if above > _WORTH_A_WORD * spectra.power[:, position].sum():
            amplitude = math.sqrt(2.0 * float(above) * float(spectra.frequency[0]))
            found.append(Oscillation(CHANNELS[answer], float(spectra.frequency[at]), amplitude))
    return tuple(found)


def _spectra(drive: Drive, series: np.ndarray) -> _Spectra | None:
    """Average the spectra of series (n, m) over segments of even time; None where there are none."""
    if not drive.timed:
        return None
    step = float(np.median(np.concatenate([np.diff(drive.time_s[rows]) for rows in drive.runs])))
    uneven = [np.flatnonzero(np.abs(np.diff(drive.time_s[rows]) - step) > _EVEN * step) + 1 for rows in drive.runs]
    runs = [part for rows, at in zip(drive.runs, uneven, strict=True) for part in np.split(rows, at)]
    runs = [rows for rows in runs if len(rows) >= _SHORTEST]
    if not runs:
        return None
    lengths = np.array([len(rows) for rows in runs])
    size = int(np.clip(min(2 * lengths.sum() // (_SEGMENTS + 1), np.median(lengths)), _SHORTEST, _LONGEST))
    runs = [rows for rows in runs if len(rows) >= size]
    counts = [(len(rows) - size) // (size - size // 2) + 1 for rows in runs]
    each = [welch(series[rows], 1.0 / step, nperseg=size, axis=0) for rows in runs]
    # Neither the mean nor half the rate is like the others.
    frequency = each[0][0][1:-1]
    power = np.average([spectrum[1:-1] for _, spectrum in each], axis=0, weights=counts)
    freedom = 2.0 * sum(counts) / (1.0 + 2.0 * _OVERLAP)
    return _Spectra(frequency, power, _background(power), freedom)


def _background(power: np.ndarray) -> np.ndarray:
    """Mean power (k, m) beside each frequency, on the side that has more."""
    reach = _AWAY + (_BESIDE + 1) // 2
    mean = uniform_filter1d(power, _BESIDE, axis=0, mode="reflect")
    padded = np.pad(mean, ((reach, reach), (0, 0)), mode="reflect")
    return np.maximum(np.maximum(padded[: len(power)], padded[2 * reach :]), _NOTHING)
