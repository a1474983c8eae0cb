"""What comes round again, with the wheel or along the track: lugs, a wheel that is out of round, a washboard.

Ground that varies makes up for it where it is let: what it leaves of foregoing rows still has the line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from ..explanation import Region
from ..fit.fitting import Fitted, Problem
from ..fit.samples import Samples
from ..fit.soil_variation import HUBER
from .smooth_correction import Group, Term, ripples_with_angle
from .variables import MOST_CYCLES, span_of

ALONG_TRACK = "place_m"
"""Name of what a wave along the track depends on; its period follows in brackets."""

_ANGLE = "wheel_angle_rad"
"""Name of what a ripple depends on; its cycles a turn follow in brackets."""

_TURNS = 3.0
"""Turns of the wheel, in all runs together, in which what comes round with it is told from ground that varies."""

_PERIODS, _ROWS = 6.0, 4.0
"""Periods that there are along the track at least, and rows in one."""

_FINE = 0.2
"""Step from one wave number to the next, in those of one period along the whole track."""

_BESIDE = 101
"""Wave numbers whose median is the background of the one in their middle."""

_IMPOSED = 0.02
"""Share of load or slip, its variance, that a line may have which they do not bring about [-]."""

_BY_CHANCE = 3.0
"""Power that noise reaches no more often than once in twenty, beyond the logarithm of how many are looked at."""


def coming_round(problem: Problem, fitted: Fitted) -> list[Group]:
    """Give waves (n, 2) on each channel with the wheel's angle and along the track, each the likeliest of its kind."""
    drive, left = problem.samples.drive, np.clip(np.nan_to_num(fitted.innovations), -HUBER, HUBER)
    groups = []
    if drive.has("wheel_angle_rad") and turned(problem.samples) >= 2.0 * np.pi * _TURNS:
        groups += ripples_with_angle(problem, left)
    if drive.has("place_m") and np.isfinite(drive.place_m).all():
        groups += _along_track(problem, left)
    return groups


def turned(samples: Samples) -> float:
    """How far the wheel turned [rad], by its angle as it was counted or in its runs together.

    Each that comes round once counts, for the wheel is the same; of those that share their ground the longest does.
    """
    angle, stretch = samples.drive.wheel_angle_rad, samples.drive.stretch
    runs = np.split(np.arange(len(samples)), np.flatnonzero(np.diff(stretch)) + 1)
    longest: dict[float, float] = {}
    for rows in runs:
        lane, far = float(samples.lane[rows[0]]), span_of(angle[rows])
        longest[lane] = max(longest.get(lane, 0.0), far if far >= 2.0 * np.pi else 0.0)
    return max(float(np.nanmax(angle) - np.nanmin(angle)), sum(longest.values()))


def located(regions: Sequence[Region], terms: Sequence[Term], noise: Mapping[str, float]) -> tuple[Region, ...]:
    """Put what comes round with the wheel where it was found, instead of what rows foregoing leave of it.

    Parameters
    ----------
    regions
        Where channels leave the simulation, by what is new in each row: of a slow wave hardly anything is.
    terms
        What a correction consists of.
    noise
        By channel, SI.
    """
    waves = [term for term in terms if term.variable.startswith(f"{_ANGLE} (")]
    if not waves:
        return tuple(regions)
    turning = {term.channel for term in waves}
    others = [each for each in regions if each.variable != _ANGLE or each.channel not in turning]
    total = sum(term.gain for term in terms)
    left = (1.0 - sum(term.gain for term in waves) / total) / max(sum(each.share for each in others), 1e-300)
    answer = [replace(each, share=min(left, 1.0) * each.share) for each in others]
    for term in waves:
        count = int(term.variable.partition("(")[2].split()[0])
        by_chance = min(MOST_CYCLES * math.exp(-term.gain), 1.0)
        size = math.sqrt(2.0) * float(np.std(term.values)) / noise[term.channel]
        end = 2.0 * math.pi / count
        answer.append(Region(term.channel, _ANGLE, 0.0, end, term.gain / total, by_chance, size))
    return tuple(sorted(answer, key=lambda region: -region.share))


def _along_track(problem: Problem, left: np.ndarray) -> list[Group]:
    """Waves along the track at the wave number that stands out most of what is left (n, m); none that load or slip
    have, or where the track is short.
    """
    drive = problem.samples.drive
    place, length = drive.place_m, float(np.ptp(drive.place_m))
    # Where several passes share their places, one of them tells how short a wave can be.
    order = np.lexsort((place, drive.stretch))
    steps = np.diff(place[order])[np.diff(drive.stretch[order]) == 0]
    spacing = float(np.median(steps)) if len(steps) else 0.0
    if length <= _PERIODS * _ROWS * spacing or spacing == 0.0:
        return []
    periods = np.arange(_PERIODS, length / (_ROWS * spacing), _FINE)
    power = _power(place / length, periods, left)
    ratio = power / np.maximum(median_filter(power, (_BESIDE, 1), mode="reflect"), 1e-300)
    imposed = np.column_stack([drive.load_N, drive.slip])
    scale = np.maximum(imposed.std(axis=0), 1e-300)
    # A wave of variance 1 has half of their number for power, noise the one it has by chance among so many.
    line = max(0.5 * _IMPOSED * len(place), math.log(2.0 * len(periods)) + _BY_CHANCE)
    shared = _power(place / length, periods, (imposed - imposed.mean(axis=0)) / scale) > line
    strength = np.where(shared.any(axis=1), 0.0, ratio.max(axis=1))
    best = int(np.argmax(strength))
    if strength[best] == 0.0:
        return []
    phase = 2.0 * np.pi * periods[best] * place / length
    waves = np.column_stack([np.cos(phase), np.sin(phase)])
    name = f"{ALONG_TRACK} (every {length / periods[best]:.3g} m)"
    positions = range(len(problem.answers))
    independent = max(int(_FINE * len(periods)), 1)
    return [Group(position, name, place, waves, independent) for position in positions]


def _power(along: np.ndarray, periods: np.ndarray, series: np.ndarray) -> np.ndarray:
    """Power (k, m) of series (n, m) at so many periods (k,) along the track, where rows are at (n,) [-]."""
    waves = np.exp(-2j * np.pi * np.outer(periods, along))
    return np.abs(waves @ series) ** 2 / len(along)
