"""A line in the spectrum of what a fit leaves: something that oscillates by the clock, whatever ground and wheel do."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import welch
from scipy.stats import chi2

from ...effects.effect import Drive
from ...forward import CHANNELS
from ..fit.fitting import Fitted, Problem

_SEGMENTS, _SHORTEST, _LONGEST = 8, 64, 512
"""Into how many segments a recording is cut (they overlap by half), and the fewest and most rows of one."""

_OVERLAP = 1.0 / 36.0
"""Squared correlation of the spectra of two Hann segments that overlap by half (P. D. Welch, IEEE Trans. Audio
Electroacoust. 15 (1967), 70-73)."""

_AROUND = 12
"""Frequencies on each side whose median is the background."""

_SLOWEST = 8
"""Periods in a segment below which an oscillation may be ground or memory."""

_CHANCE = 1e-4
"""Probability by which noise may look like a line, all frequencies and channels together [-]."""

_WORTH_A_WORD = 0.05
"""Share of what is left of a channel, its variance, below which a line in it is of no interest [-]."""

_EVEN = 0.3
"""Share of the step by which rows of one rate may come early or late [-]."""

_NOTHING = 1e-300
"""What a channel that never varies is divided by."""


@dataclass(frozen=True)
class Oscillation:
    """A line at `frequency_Hz` in what is left of a channel, of an amplitude in its unit, SI."""

    channel: str
    frequency_Hz: float
    amplitude: float


def oscillations(problem: Problem, fitted: Fitted) -> tuple[Oscillation, ...]:
    """Find the strongest line in what a fit leaves of each channel; none where rows do not follow evenly in time."""
    frequency, power, counted, per_row = _spectra(problem.samples.drive, fitted.innovations)
    if not counted:
        return ()
    freedom = 2.0 * counted / (1.0 + 2.0 * _OVERLAP)
    flat = _flat(fitted.innovations, per_row)
    middle = median_filter(power * flat, (2 * _AROUND + 1, 1), mode="reflect")
    background = np.maximum(middle / flat * freedom / chi2.median(freedom), _NOTHING)
    searched = slice(_SLOWEST, len(frequency) - 2)
    chance = chi2.sf(freedom * power[searched] / background[searched], freedom)
    found = []
    for position, answer in enumerate(problem.answers):
        strongest = int(np.argmin(chance[:, position])) + _SLOWEST
        line = slice(strongest - 2, strongest + 3)
        above = float(np.sum((power[line, position] - background[line, position]).clip(min=0.0)))
        seldom = chance[strongest - _SLOWEST, position] * chance.size < _CHANCE
        if seldom and above > _WORTH_A_WORD * float(power[:, position].sum()):
            amplitude = math.sqrt(2.0 * above * float(frequency[0])) * float(fitted.noise.answers[position])
            found.append(Oscillation(CHANNELS[answer], float(frequency[strongest]), amplitude))
    return tuple(found)


def _spectra(drive: Drive, innovations: np.ndarray) -> tuple[np.ndarray, np.ndarray, int, np.ndarray]:
    """Frequencies (k,) [Hz], spectra (k, m) of innovations (n, m), over how many segments they are averaged, 0 where
    there is no clock to tell them by, and frequencies (k,) [1/row].
    """
    nothing = np.empty(0), np.empty((0, innovations.shape[1])), 0, np.empty(0)
    if not drive.timed:
        return nothing
    step = float(np.median(np.concatenate([np.diff(drive.time_s[rows]) for rows in drive.runs])))
    runs = [rows for rows in drive.runs if np.all(np.abs(np.diff(drive.time_s[rows]) - step) < _EVEN * step)]
    if not runs:
        return nothing
    lengths = np.array([len(rows) for rows in runs])
    size = int(np.clip(min(2 * lengths.sum() // (_SEGMENTS + 1), np.median(lengths)), _SHORTEST, _LONGEST))
    runs = [rows for rows in runs if len(rows) >= size]
    if not runs:
        return nothing
    counts = [(len(rows) - size) // (size - size // 2) + 1 for rows in runs]
    spectra = [welch(innovations[rows], 1.0 / step, nperseg=size, axis=0) for rows in runs]
    power = np.average([each for _, each in spectra], axis=0, weights=counts)
    # Neither the mean nor half the rate is like the others.
    frequency = spectra[0][0][1:-1]
    return frequency, power[1:-1], sum(counts), frequency * step


def _flat(innovations: np.ndarray, per_row: np.ndarray) -> np.ndarray:
    """Factors (k, m) that take the slope out of spectra at frequencies (k,) [1/row]: those of a memory of one row."""
    size = np.maximum(np.sum(innovations**2, axis=0), _NOTHING)
    memory = np.sum(innovations[1:] * innovations[:-1], axis=0) / size
    return np.abs(1.0 - memory * np.exp(-2.0j * np.pi * per_row)[:, None]) ** 2
