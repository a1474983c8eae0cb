"""Whether a fault that the catalogue lacks explains a recording better than what was found."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from ...effects.effect import Effect
from ...effects.uncatalogued import forms
from ..fit.fitting import Problem
from ..fit.together import together
from ..fit.trial import Trial, situation, try_adding, without
from .asked import asked_beside
from .promise import promised_by
from .tries import Search, gain_of

_SHARE = 0.1
"""Of the nats that one lacks for the answer a first step promises at least so many where its fit is worth the time [-]:
of six recordings with such a fault it promised 0.33 to 0.48."""

_SHORT = 5.0
"""Nats that more effects may gain more than one such fault, which is no reason for them: of ten recordings with one
they gained 0.2 more at most."""

_EACH_RUN = 100.0
"""What is another in each run takes up what forms of other effects differ by from pass to pass: it has to gain so many
nats more than what was found. Of 47 recordings of several runs without (trials 39 to 41 of docs/other-generators.md)
one gained 79 more and none else more than 39; of four of the study's with zeros that differ by 1 % of what sensors
usually read two gained 190 and 458, and two 26 and 68, which are not told for what they are."""


def better_uncatalogued(problem: Problem, found: Search) -> Effect | None:
    """Give the fault that does as well as more effects of the catalogue, or by what is asked of a further effect better
    than as many; None where there is none.

    One beside all that was found has to gain that once more: it may make up for how much published forms differ.
    """
    chosen, enough = found.chosen, []
    faults = forms(situation(problem, found.textbook.fitted))
    for base in _bases(problem, found):
        needed = [_needed(chosen, base, fault) for fault in faults]
        nats = together(partial(promised_by, problem, base), faults)
        worth = [
            (fault, least)
            for fault, own, least in zip(faults, nats, needed, strict=True)
            if own >= _SHARE * (least - base.gain)
        ]
        tried = together(partial(try_adding, problem, found.textbook, base), [fault for fault, _ in worth])
        enough += [trial for trial, (_, least) in zip(tried, worth, strict=True) if trial.gain >= least]
    return max(enough, key=gain_of).effects[-1] if enough else None


def _bases(problem: Problem, found: Search) -> Iterator[Trial]:
    """Sets beside which a fault is tried: none, what was found, and that less each of its effects."""
    chosen = found.chosen
    yield found.textbook
    if not chosen.effects:
        return
    yield chosen
    for effect in chosen.effects if len(chosen.effects) > 1 else ():
        same = [trial for trial in found.trials if trial.slugs == chosen.slugs - {effect.slug}]
        yield max(same, key=gain_of) if same else without(problem, found.textbook, chosen, effect)


def _needed(chosen: Trial, base: Trial, fault: Effect) -> float:
    """Nats that a set and a fault beside it have to gain together."""
    if fault.by_run:
        return max(chosen.gain, base.gain) + _EACH_RUN
    if base.slugs >= chosen.slugs:
        return base.gain + 2.0 * asked_beside(base.gain)
    if len(base.effects) + 1 < len(chosen.effects):
        return chosen.gain - _SHORT
    return chosen.gain + asked_beside(chosen.gain)
