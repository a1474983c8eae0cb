"""What stands in the place of what a search found: other effects that do as well, rivals in other forms."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace

import pytest
from bevameter.identification.effects.effect import Effect
from bevameter.identification.mismatch.name import search as module
from bevameter.identification.mismatch.name.singles import alike
from bevameter.identification.mismatch.name.tries import Tries


def replace_form(effect: Effect, form: str) -> Effect:
    """Give an effect under the name of another form."""
    other = copy(effect)
    other.form = form
    return other


def test_what_does_as_well_as_an_effect_alone_is_tried_in_its_place(trials, monkeypatch):
    problem, textbook, forms = trials(7110, ("slip_sinkage",), "hidden", "bench")
    slugs = ("load_gain", "torque_gain", "torque_offset", "sinkage_offset")
    effects = [forms(slug)[slug] for slug in slugs]
    singles = [
        replace(textbook, effects=(each,), gain=nats)
        for each, nats in zip(effects, (300.0, 292.0, 250.0, 40.0), strict=True)
    ]
    assert alike(singles, effects[0]) == {"torque_gain"}
    # Of so much as hundreds of nats forms of one effect may be apart by more than what excludes a set.
    more = [replace(each, gain=nats) for each, nats in zip(singles, (1034.0, 1012.0, 960.0, 40.0), strict=True)]
    assert alike(more, effects[0]) == {"torque_gain"}
    # Nor is what does much better in place of it.
    assert alike(singles, effects[3]) == set()
    both = replace(textbook, effects=(effects[0], effects[3]), gain=350.0)
    handed = []

    def attempt(_tries, _base, promised, *_):
        handed.append({effect.slug: nats for nats, effect in promised})
        return []

    monkeypatch.setattr(module, "without", lambda *_: singles[3])
    monkeypatch.setattr(Tries, "weigh", lambda _tries, _base, others: [(1.0, each) for each in others])
    monkeypatch.setattr(Tries, "attempt", attempt)
    monkeypatch.setattr(module, "_bare", lambda *_: singles[3])
    tries = Tries(problem, textbook, effects, print)
    module._exchanged(tries, singles, both)
    assert handed[0] == {"torque_gain": math.inf, "torque_offset": 1.0}
    # What was not tried after all, and does as well as one of those found, is tried in the end.
    assert handed[1:] == [{"torque_gain": math.inf}]
    tries.trials.append(replace(both, effects=(effects[1], effects[3])))
    handed.clear()
    module._exchanged(tries, singles, both)
    assert len(handed) == 1


def test_a_rival_that_is_not_excluded_is_tried_in_other_forms_too(trials, monkeypatch):
    """Only the best set was given its best forms: a rival's may be as good, and the answer too sure without them."""
    problem, textbook, forms = trials(7110, ("slip_sinkage",), "hidden", "bench")
    several = forms("slip_sinkage", "load_gain", "torque_gain", "hard_layer")
    singles = [replace(textbook, effects=(each,), gain=100.0) for each in several.values()]

    def pair(first: str, second: str, gain: float):
        return replace(textbook, effects=(several[first], several[second]), gain=gain)

    tries = Tries(problem, textbook, tuple(several.values()), print)
    best, near = pair("load_gain", "torque_gain", 240.0), pair("slip_sinkage[exponent]", "hard_layer", 235.0)
    tries.trials.extend([best, near, pair("slip_sinkage[exponent]", "torque_gain", 150.0)])
    handed = []

    def attempt(_tries, base, promised):
        handed.append((base, {effect.name for _, effect in promised}))
        return [pair(effect.name, "hard_layer", 250.0 + number) for number, (_, effect) in enumerate(promised)]

    monkeypatch.setattr(module, "_bare", lambda _problem, rival, dropped: rival.names - {dropped.name})
    monkeypatch.setattr(Tries, "attempt", attempt)
    better = module._rivals_in_other_forms(tries, singles, best)
    others = {name for name in several if name.startswith("slip_sinkage")} - {"slip_sinkage[exponent]"}
    ((beside, tried),) = handed
    assert beside == {"hard_layer"}
    assert len(tried) >= 2
    assert tried <= others
    # One that overtakes the best set takes its place.
    assert better.gain == 250.0 + len(tried) - 1
    assert better.slugs == {"slip_sinkage", "hard_layer"}
    handed.clear()
    alone = replace(best, effects=best.effects[:1])
    assert module._rivals_in_other_forms(tries, singles, alone) is alone
    assert handed == []


def test_of_a_rival_with_a_place_no_other_place_is_tried_that_its_residuals_did_not_lay_out(trials, monkeypatch):
    problem, textbook, forms = trials(7110, ("slip_sinkage",), "hidden", "bench")
    several = forms("soil_patch", "load_gain", "torque_gain")
    places = [effect for effect in several.values() if effect.slug == "soil_patch"]
    gains = [several[name] for name in ("load_gain", "torque_gain")]
    tries = Tries(problem, textbook, (*gains, *places, replace_form(places[0], "elsewhere")), print)
    best = replace(textbook, effects=tuple(gains), gain=700.0)
    tries.trials.extend([best, replace(textbook, effects=(gains[0], places[0]), gain=690.0)])
    handed = []
    monkeypatch.setattr(module, "_bare", lambda *_: textbook)
    monkeypatch.setattr(Tries, "attempt", lambda _tries, _base, promised: handed.extend(promised) or [])
    module._rivals_in_other_forms(tries, [replace(textbook, effects=(each,), gain=100.0) for each in gains], best)
    assert "soil_patch" not in {effect.slug for _, effect in handed}


@pytest.mark.parametrize(("behind", "tried"), [(20.0, True), (60.0, False)])
def test_of_what_is_nothing_alone_a_rival_is_tried_in_all_forms_that_promise(trials, monkeypatch, behind, tried):
    """Its forms beside the others were those that promised most: another one may do better than the best set."""
    problem, textbook, forms = trials(7110, ("slip_sinkage",), "hidden", "bench")
    several = forms("slip_sinkage", "load_gain", "torque_gain")
    alone = [replace(textbook, effects=(several[name],), gain=100.0) for name in ("load_gain", "torque_gain")]

    def pair(first: str, second: str, gain: float):
        return replace(textbook, effects=(several[first], several[second]), gain=gain)

    tries = Tries(problem, textbook, tuple(several.values()), print)
    best = pair("load_gain", "torque_gain", 700.0)
    tries.trials.extend([best, pair("load_gain", "slip_sinkage[exponent]", 700.0 - behind)])
    handed = set()

    def attempt(_tries, _base, promised):
        handed.update(effect.name for _, effect in promised)
        return []

    monkeypatch.setattr(module, "_bare", lambda *_: textbook)
    monkeypatch.setattr(Tries, "weigh", lambda _tries, _base, effects: [(30.0, effect) for effect in effects])
    monkeypatch.setattr(Tries, "attempt", attempt)
    module._rivals_in_other_forms(tries, alone, best)
    others = {name for name in several if name.startswith("slip_sinkage")} - {"slip_sinkage[exponent]"}
    assert (handed >= others) == tried
    assert (handed == set()) != tried
