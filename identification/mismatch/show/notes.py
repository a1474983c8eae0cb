"""What an answer has to add in words: what was left out, what it rests on, and what speaks against it."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from ....framework.core.recording.types import Labels
from ...effects.time_faults import bends_foretold, slips_at_one_rate
from ...mechanics.textbook import CHANNELS
from ..fit.fitting import Fitted, Problem
from ..fit.trial import Trial
from ..locate.oscillation import oscillations
from ..name.naming import MANY
from ..name.tries import Search
from . import readable
from .outside import outside, unstated_lugs

_VARIES = 0.02
"""Variation of the ground that is worth a word [-]."""

_REPEATS = 1.5
"""Rows that say the same from which on it is worth a word."""

_SHARE_OF_ONE = 0.05
"""Share of a drive from which on a kind of ground is worth a word [-]."""


_RULED_OUT = (
    (
        "drift", bends_foretold,
        "slip and load, as they went, foretell whatever bends with time: of drifts only those that go straight were "
        "considered; drive the first load again at the end",
    ),
    (
        "time_lag", slips_at_one_rate,
        "slip changes at one rate: a delay of it, which is no more than an offset then, was not considered; let slip "
        "fall as well as rise",
    ),
)  # fmt: skip
"""Of which effects some forms are not offered, on which drives, and what is said of that."""


def notes_of(
    problem: Problem, found: Search, best: Trial, residuals: tuple[np.ndarray, np.ndarray],
    listed: Collection[str], unsure: list[str], repeated: float, doubted: Sequence[str],
) -> list[str]:  # fmt: skip
    """Give what has to be added to an answer.

    Parameters
    ----------
    problem, found
        The samples, and what was tried.
    best
        What the answer rests on.
    residuals : two of (n, m)
        What was left of rows held out before and after.
    listed
        Effects that the answer lists.
    unsure
        Effects of which held-out data ask for one.
    repeated
        Number of neighbouring rows that say the same.
    doubted
        What speaks against the chosen set, in words.
    """
    return [
        *problem.samples.notes,
        *_not_predicted(problem, *residuals),
        *_beside(unsure),
        *_many(found.chosen),
        *_dispersed(found),
        *_ground(problem, best.fitted),
        *_remembering(problem),
        *_repeated(repeated),
        *_oscillates(problem, best.fitted),
        *_crossed_once(best),
        *_not_considered(problem, found),
        *(effect.remark for effect in best.effects if effect.remark),
        *outside(listed, problem.answers),
        *unstated_lugs(listed, problem.samples.wheel),
        *([f"{'; '.join(doubted)}: it is believed in no more than half"] if doubted else []),
    ]


def several_grounds(labels: Labels | None, time_s: np.ndarray) -> list[str]:
    """Say which kinds of ground somebody wrote down along a drive, if there are several.

    Parameters
    ----------
    labels
        Ground truth, where there is any.
    time_s : (n,)
        When the rows were taken that are explained.
    """
    if labels is None or not len(time_s):
        return []
    names, counts = np.unique(labels.at(time_s).astype(str), return_counts=True)
    kinds = [
        str(name) for name, count in zip(names, counts, strict=True) if name and count > _SHARE_OF_ONE * len(time_s)
    ]
    if len(kinds) < 2:
        return []
    return [
        f"by its labels the drive goes over {', '.join(kinds)}, and one soil is fitted to all of it: cut the "
        "recording, and explain each kind of ground by itself"
    ]


def _not_predicted(problem: Problem, before: np.ndarray, after: np.ndarray) -> list[str]:
    """Say how many held-out rows have no prediction: the soil of the other rows does not carry their load."""
    counts = [(np.isnan(each) & problem.seen).any(axis=1).sum() for each in (before, after)]
    return [
        f"{count} held-out rows were not predicted {when}, their load not being carried: the errors are of the others"
        for count, when in zip(counts, ("before", "after"), strict=True)
        if count
    ]


def _beside(unsure: list[str]) -> list[str]:
    """Say what else may be there."""
    if not unsure:
        return []
    names = ", ".join(readable.effect(slug) for slug in unsure)
    return [f"held-out data ask for something more, and do not tell whether it is {names}"]


def _many(chosen: Trial) -> list[str]:
    """Say why effects that are needed together are not each asserted."""
    if len(chosen.unexpected) < MANY:
        return []
    return [
        f"{len(chosen.effects)} effects together fit best; so many often stand in for one that the catalogue lacks, "
        "and none of them is asserted"
    ]


def _dispersed(found: Search) -> list[str]:
    """Say that every form is wrong, and what that does to probabilities and choice."""
    if found.dispersion <= 1.0 or not found.chosen.effects:
        return []
    return [
        f"every set as large that was tried leaves {math.sqrt(found.dispersion):.1f} times the noise or more on rows "
        "held out: sets are weighed by errors, and of those not excluded the one that errs least is chosen"
    ]


def _ground(problem: Problem, fitted: Fitted) -> list[str]:
    """Say how much the ground is taken to vary, where that is more than a little."""
    stiffness, strength = fitted.noise.spread
    if max(stiffness, strength) < _VARIES:
        return []
    where = "from trial to trial"
    if np.isfinite(problem.samples.position).all():
        unit = "m" if np.array_equal(problem.samples.position, problem.samples.drive.place_m) else "s"
        where = f"along the track, over {fitted.noise.length:.2g} {unit}"
    return [
        f"the ground is taken to vary {where}: stiffness by {100.0 * stiffness:.1f} %, "
        f"strength by {100.0 * strength:.1f} % (standard deviation)"
    ]


def _remembering(problem: Problem) -> list[str]:
    """Say which sensors' errors last, and that this is counted."""
    each = zip(problem.answers, problem.memory.rho, strict=True)
    lasting = [f"{rho:.2f} in {readable.shown(CHANNELS[channel]).name}" for channel, rho in each if rho > 0.0]
    if not lasting:
        return []
    return [
        "errors of sensors last, or what nothing explains looks so: they are correlated with those of the row before, "
        f"by {', '.join(lasting)}, and rows count by what is new in them"
    ]


def _repeated(repeated: float) -> list[str]:
    """Say that evidence counts less than it seems."""
    if repeated < _REPEATS:
        return []
    return [
        f"what is left repeats itself from row to row, as behind a slow amplifier: {repeated:.1f} rows count as one"
    ]


def _oscillates(problem: Problem, fitted: Fitted) -> list[str]:
    """Say what swings by the clock, and how often it does so in a turn of the wheel."""
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


def _not_considered(problem: Problem, found: Search) -> list[str]:
    """Say which forms of faults that were considered this drive rules out."""
    considered = {effect.slug for trial in found.trials for effect in trial.effects}
    passed = " ".join(what for what, _ in found.passed)
    return [
        told for slug, ruled_out, told in _RULED_OUT
        if (slug in considered or slug in passed) and ruled_out(problem.samples.drive)
    ]  # fmt: skip


def _crossed_once(trial: Trial) -> list[str]:
    """Say what rows held out cannot test."""
    if not trial.held_out.untested:
        return []
    return ["the place was crossed once: how its ground differs, and from where to where, was fitted and not predicted"]
