"""What swings by the clock, in words: a finding of its own where nothing else was found."""

from __future__ import annotations

import math

import numpy as np

from ..explanation import Missing
from ..fit.fitting import Fitted, Problem
from ..locate.oscillation import oscillations
from ..name.naming import UNKNOWN
from . import readable

_SURE = 0.95
"""Probability of something that the catalogue lacks where a line is all that is found [-]. Noise makes one in a million
recordings; of 1,248 of the study's, which hold none, no null had one, and one whose delay was not found had."""


def swings(problem: Problem, fitted: Fitted) -> list[str]:
    """Say what a fit leaves that swings by the clock, and how often it does so in a turn of the wheel."""
    speed, radius_m = problem.samples.drive.rim_speed_m_s, problem.samples.wheel.radius_m
    known = np.isfinite(speed).any()
    turns_Hz = float(np.nanmedian(np.abs(speed))) / (2.0 * math.pi * radius_m) if known else 0.0
    answer = []
    for line in oscillations(problem, fitted):
        how = readable.shown(line.channel)
        often = f", {line.frequency_Hz / turns_Hz:.3g} times in a usual turn of the wheel" if turns_Hz > 0.0 else ""
        answer.append(
            f"what is left of {how.name} oscillates at {line.frequency_Hz:.3g} Hz by "
            f"{readable.number(line.amplitude, how.scale)} {how.unit}{often}: a resonance, a controller, or lugs whose "
            "angle was not recorded"
        )
    return answer


def swinging(told: list[str]) -> tuple[Missing, ...]:
    """Give what swings, in words, as something that the catalogue lacks."""
    if not told:
        return ()
    tell = "the same drive at another speed: a resonance keeps its frequency, what the wheel makes follows its speed"
    return (
        Missing(
            UNKNOWN, UNKNOWN, "oscillation by the clock", _SURE, {}, "a sin(2 pi f t + phase), a and f as described",
            "found in the spectrum of what is left", (), tell, "; ".join(told),
        ),
    )  # fmt: skip
