"""`explain`: why simulation and recording differ."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from ...framework.core.arguments import path_of, refused, whole
from ...framework.core.recording.types import Recording
from ...framework.core.soil import SoilKnowledge, as_knowledge
from ...framework.core.vehicle import Vehicle
from ..effects.catalogue import SLUGS, effects_for
from ..effects.effect import Effect
from ..felt_rows import felt_rows, only_steady
from ..identify import open_recording
from .explanation import Explanation
from .fit.beside import attach
from .fit.fitting import Problem
from .fit.gross_errors import outlying
from .fit.lanes import passes_apart
from .fit.load_and_slip import gathered
from .fit.remembering import TOLD, remembering
from .fit.samples import Samples
from .fit.simulated import as_differences
from .fit.textbook import QUIET
from .fit.trial import ASKED_FOR, Trial, again, least_errors, situation, textbook_trial, without
from .locate.joint_misfit import joint_correction
from .locate.regions import locate
from .locate.smooth_correction import SmoothCorrection, nats_left, smooth_correction
from .name.asked import asked_beside, calmed
from .name.evidence import borne_out, doubts, repetition, warranted
from .name.naming import name
from .name.search import search
from .name.tries import Search
from .name.uncatalogued import better_uncatalogued
from .show import readable
from .show.answer import assemble
from .show.notes import several_grounds
from .show.told_soil import disagreement

_GROUND_OF_ITS_OWN = (
    "each pass is taken to be on ground of its own: what passes differ by is explained as well by that as by what was "
    "found with the same ground in all, {found}"
)

_ROUGHER = 1.3
"""Growth of how much ground varies, over `QUIET`, with which no memory is taken [-]: ground that varies by 6 % over
eight rows, beside sensors that remember by 0.8, came out as 18 % over one row."""

_MOST_TOLD = 6
"""Trials left out that a note names; the others are counted."""


def explain(
    recording: Recording | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    soil: SoilKnowledge | str | Path | None = None,
    simulated: str | Path | None = None,
    seed: int = 0,
    catalogue: Iterable[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Explanation:
    """Compare a recording with the simulation, and say what the simulation leaves out.

    Parameters
    ----------
    recording
        A recording, or the path of one, or of a single wheel file.
    vehicle
        The vehicle, or its TOML file; the recording's own where absent.
    soil
        What is known of the soil from elsewhere, or its TOML file: it breaks ties.
    simulated
        Another simulator's wheel file for the same drive; the built-in simulator, its soil refitted, where absent.
    seed
        Of the resampling behind the intervals of held-out errors.
    catalogue
        Public names of the effects to consider; all where absent.
    progress
        Told in words what is being done.

    Returns
    -------
    Explanation
        The answer, of whatever kind; see `Explanation.verdict`.

    Raises
    ------
    InputError
        The recording has no wheel channels or geometry, lacks channels or rows to compare, or a name is unknown.
    """
    began = time.perf_counter()
    tell = progress or (lambda _: None)
    seed, considered = whole("seed", seed), _considered(catalogue)
    opened, known = open_recording(recording, vehicle), as_knowledge(soil)
    if simulated is not None:
        simulated = path_of("simulated", simulated, "the path of a wheel file")
    rows = felt_rows(opened, every_row=simulated is not None)
    table, settling = rows.table, []
    if simulated is not None:
        table, settling = only_steady(attach(rows.table, simulated, rows.wheel))
    # The search fills the cores by itself: more of BLAS's own threads beside it only wait for each other.
    with threadpool_limits(1):
        tell("asking how well load and slip are known")
        samples, own = gathered(table, rows.wheel, rows.vehicle, known), None
        if simulated is not None:
            tell("fitting the textbook wheel to the other simulator")
            samples, own = as_differences(samples, simulated)
        tell("refitting the soil")
        problem, textbook = textbook_trial(samples, known)
        found, remaining = _sought(problem, textbook, considered, tell)
        time_s = rows.table["time_s"] if "time_s" in rows.table else np.empty(0)
        notes = (*opened.problems, *rows.problems, *settling, *several_grounds(opened.labels, time_s))
        kept = np.arange(len(samples))
        while (far := _alone(problem, found, len(samples) - len(kept))).any():
            tell("leaving out what stands alone")
            kept = kept[~far]
            problem, textbook = textbook_trial(samples.select(kept), known)
            found, remaining = _sought(problem, textbook, considered, tell)
        other = None
        if remembered := _as_remembered(samples, problem, found.chosen, known):
            tell("the same with sensors that remember")
            samples, problem, found = remembered
            other = _on_other_ground(samples, known, found, _left_over(problem, found, found.chosen))
            if other is None:
                found, remaining = _sought(problem, found.textbook, considered, tell)
        if len(kept) < len(samples):
            notes = (*notes, _trials_left_out(samples, kept))
            samples, own = samples.select(kept), None if own is None else own[kept]
        if other := other or _on_other_ground(samples, known, found, remaining):
            with_same = " and ".join(readable.effect(each.name) for each in found.chosen.effects) or "which is nothing"
            problem, textbook, gained = other
            found, remaining = _sought(problem, textbook, considered, tell)
            # Other ground is a cause already, unless it is the same once the passes tell from each other.
            by_pass = any("pass_number" in effect.needs for effect in found.chosen.effects)
            alike = by_pass and calmed(found.textbook, found.chosen)
            if found.chosen.effects and found.chosen.gain < asked_beside(gained) and not alike:
                found = replace(found, chosen=found.textbook)
                remaining = _left_over(problem, found, found.chosen)
            notes = (*notes, _GROUND_OF_ITS_OWN.format(found=with_same))
        repeated = repetition(problem, found, remaining.innovations, remaining.explained)
        before = least_errors(problem, found.textbook)
        fewer = borne_out(warranted(found, repeated), repeated, before)
        if fewer is not found:
            found = fewer
            remaining = _left_over(problem, found, found.chosen)
            if remaining.explained.any():
                # What repeated itself was a misfit, which something else than time or place explains.
                repeated = repetition(problem, found, remaining.innovations, remaining.explained)
        chosen = found.chosen
        felt = nats_left(problem, chosen.fitted, chosen.effects) if chosen.effects else 0.0
        against = doubts(problem, found, remaining.gain, repeated, felt)
        naming = name(found, remaining.gain, repeated=repeated, doubted=bool(against))
        if naming.unknown > 0.5 and found.chosen.effects:
            alone = _left_over(problem, found, found.textbook).gain
            naming = name(found, remaining.gain, alone, repeated=repeated, doubted=bool(against))
        if known.values:
            tell("comparing the soil stated with the one found")
            other_soil = disagreement(problem.samples, known)
            notes = notes if other_soil is None else (*notes, other_soil)
        tell("locating the mismatch")
        regions = locate(problem, found.chosen.fitted)
    return assemble(
        problem, found, naming, remaining, regions, source=str(opened.source), seed=seed, began=began, problems=notes,
        before=before, simulated=own, repeated=repeated, doubted=against,
    )  # fmt: skip


def _considered(catalogue: Iterable[str] | None) -> tuple[str, ...]:
    """Public names of the effects to consider; raises `InputError` where they are no list, or one is no effect."""
    if catalogue is None:
        return SLUGS
    if isinstance(catalogue, str) or not isinstance(catalogue, Iterable):
        raise refused("catalogue", catalogue, "a list of names of effects")
    names = tuple(catalogue)
    for each in names:
        if each not in SLUGS:
            raise refused("catalogue", each, "one of " + ", ".join(SLUGS))
    return names


def _alone(problem: Problem, found: Search, already: int) -> np.ndarray:
    """(n,) True for trials alone far from what was found, or from it less an effect that only bends towards them.
    `already` were left out before.
    """
    chosen = found.chosen
    far = outlying(problem.samples, chosen.fitted, already)
    if far.any() or problem.samples.drive.timed:
        return far
    for effect in chosen.effects:
        less = without(problem, found.textbook, chosen, effect)
        lonely = outlying(problem.samples, less.fitted, already)
        if lonely.any() and _bends_towards(problem, found, effect, chosen.gain - less.gain, lonely):
            return lonely
    return far


def _bends_towards(problem: Problem, found: Search, effect: Effect, own: float, far: np.ndarray) -> bool:
    """Say whether an effect that was found is hardly asked for without some trials, (n,) True in `far`, and gains most
    of its `own` nats by them.
    """
    others, textbook = textbook_trial(problem.samples.select(np.flatnonzero(~far)), problem.known)
    fewer = again(others, textbook, found.chosen)
    return fewer.gain - without(others, textbook, fewer, effect).gain < min(ASKED_FOR, 0.5 * own)


def _as_remembered(
    samples: Samples, problem: Problem, trial: Trial, known: SoilKnowledge
) -> tuple[Samples, Problem, Search] | None:
    """Fit the textbook wheel and a trial that was found to sensors that remember, if that trial does much better then.

    Before anything is found misfit that is as smooth as what it depends on would pass for a memory, which hides it. Nor
    is there one beside which the ground varies much more than without: it varies over so few rows that it is no longer
    told from what sensors remember (`Memory.new_in`).
    """
    tried = remembering(samples, problem, trial.fitted)
    if tried is None:
        return None
    there, textbook = textbook_trial(tried, known)
    better = again(there, textbook, trial) if trial.effects else textbook
    rougher = better.fitted.noise.spread.max() > _ROUGHER * trial.fitted.noise.spread.max() + QUIET
    if rougher or better.fitted.score < trial.fitted.score + TOLD:
        return None
    return tried, there, Search(textbook, (better,) if trial.effects else (), (), better)


def _trials_left_out(samples: Samples, kept: np.ndarray) -> str:
    """Say which trials are left out, those of the numbers `kept` (k,) aside."""
    lost = np.setdiff1d(np.arange(len(samples)), kept)
    told = [f"slip {samples.drive.slip[row]:.3g} at {samples.drive.load_N[row]:.4g} N" for row in lost[:_MOST_TOLD]]
    further = [f"{len(lost) - _MOST_TOLD} more"] if len(lost) > _MOST_TOLD else []
    each = "; ".join(told + further)
    return (
        f"{len(lost)} of {len(samples)} trials left out as gross errors, alone far from what was found, or from what "
        f"it is without an effect that they alone ask for: {each}"
    )


def _sought(
    problem: Problem, textbook: Trial, slugs: Sequence[str], tell: Callable[[str], None]
) -> tuple[Search, SmoothCorrection]:
    """Search the catalogue, and what it leaves for what nothing explains."""
    effects = effects_for(situation(problem, textbook.fitted), slugs)

    def trying(what: str) -> None:
        tell(f"trying {what}")

    found = search(problem, textbook, effects, trying)
    tell("asking whether a fault that the catalogue lacks explains it better")
    if further := better_uncatalogued(problem, found):
        found = search(problem, textbook, [*effects, further], trying)
    tell("looking for what nothing explains")
    return found, _left_over(problem, found, found.chosen)


def _on_other_ground(
    samples: Samples, known: SoilKnowledge, found: Search, remaining: SmoothCorrection
) -> tuple[Problem, Trial, float] | None:
    """Fit the textbook wheel to passes each on ground of its own, if that gains what one of the effects found does, or
    more with all of them [nats].

    That effect then only makes up for the ground being taken for the same in all passes.
    """
    explained = found.chosen.gain + remaining.gain
    apart = passes_apart(samples)
    if explained < ASKED_FOR or np.array_equal(apart.lane, samples.lane):
        return None
    problem, textbook = textbook_trial(apart, known)
    gain = min(
        textbook.held_out.gain(found.textbook.held_out)[0], textbook.fitted.score - found.textbook.fitted.score
    )  # fmt: skip
    chosen = found.chosen
    less = [without(problem, found.textbook, chosen, effect) for effect in chosen.effects if len(chosen.effects) > 1]
    same = [max((each.gain for each in found.trials if each.slugs == trial.slugs), default=0.0) for trial in less]
    # An effect that earned little is no reason to give up ground that is the same in all passes.
    own = [trial.gain for trial, there in zip(less, same, strict=True) if trial.gain > there + ASKED_FOR]
    if max(gain, *own, 0.0) > explained - ASKED_FOR:
        return problem, textbook, gain
    better = again(problem, found.textbook, chosen).gain > explained + ASKED_FOR
    return (problem, textbook, gain) if better else None


def _left_over(problem: Problem, found: Search, trial: Trial) -> SmoothCorrection:
    """Find what a set of effects leaves that depends smoothly on something.

    What follows a course of its own, as a drift does, excuses no more than it gains beside the others.
    """
    without_it = [
        each.gain
        for each in (found.textbook, *found.trials)
        if each.slugs < trial.slugs and all(effect.any_course is None for effect in each.effects)
    ]
    own = trial.gain - max(without_it, default=0.0)
    left = smooth_correction(problem, trial.fitted, trial.held_out).beyond(trial.effects, own)
    if trial.effects:
        return left
    joint = joint_correction(problem, trial.fitted, trial.held_out, turning=True)
    return left if joint is None or left.gain > joint.gain else joint
