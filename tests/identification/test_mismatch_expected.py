"""What the vehicle's description announces, its lugs, counts as no further effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.scenario.concealed.conceal import conceal
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.effects.grousers import LugRadius
from bevameter.identification.identify import felt_rows, open_recording
from bevameter.identification.mismatch.answer import assemble
from bevameter.identification.mismatch.evidence import warranted
from bevameter.identification.mismatch.naming import instead, name
from bevameter.identification.mismatch.samples import gather
from bevameter.identification.mismatch.search import Search, _Tries, search, surplus
from bevameter.identification.mismatch.smooth_correction import SmoothCorrection
from bevameter.identification.mismatch.trial import situation, textbook_trial, try_adding


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Problem, textbook and trials of slip-sinkage, a stress peak, and slip-sinkage beside lugs, as on a table."""
    folder = conceal(7110, ("slip_sinkage",), "hidden", "bench").write(tmp_path_factory.mktemp("recording"))
    rows = felt_rows(open_recording(folder, None))
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))
    sinks, peak, gain = (
        effects_for(situation(problem, textbook.fitted), [slug])[0]
        for slug in ("slip_sinkage", "stress_peak_shift", "torque_gain")
    )
    alone = {effect.slug: try_adding(problem, textbook, textbook, effect) for effect in (sinks, peak)}
    lugs = try_adding(problem, textbook, alone["slip_sinkage"], LugRadius(0.01, its_slip=True))
    sensor = try_adding(problem, textbook, alone["slip_sinkage"], gain)
    return problem, textbook, alone, lugs, sensor


def gaining(trial, nats: float):
    return replace(trial, gain=nats)


def test_little_is_asked_of_lugs_beside_an_effect_and_of_an_effect_beside_lugs_as_much_as_ever(made):
    _, _, alone, lugs, sensor = made
    sinks, peak = gaining(alone["slip_sinkage"], 60.0), gaining(alone["stress_peak_shift"], 60.0)
    assert surplus(sinks, gaining(lugs, 70.0)) == pytest.approx(5.0)
    assert surplus(sinks, gaining(sensor, 70.0)) == pytest.approx(-5.0)
    assert surplus(peak, gaining(lugs, 70.0)) == pytest.approx(5.0)
    only_lugs = replace(lugs, effects=lugs.effects[1:], gain=60.0)
    assert surplus(only_lugs, gaining(lugs, 70.0)) == pytest.approx(-5.0)


def test_one_effect_beside_lugs_and_another_alone_are_rivals(made):
    problem, textbook, alone, lugs, sensor = made
    peak, lugs, sensor = gaining(alone["stress_peak_shift"], 60.0), gaining(lugs, 61.0), gaining(sensor, 61.0)
    found = Search(textbook, (peak, lugs, sensor), (), peak)
    naming = name(found, 0.0)
    assert 0.3 < naming.effects["stress_peak_shift"] < 0.7
    assert naming.effects["grousers"] == naming.effects["slip_sinkage"]
    assert naming.effects["slip_sinkage"] > 0.3
    assert naming.effects["torque_gain"] == 0.0, "two effects are more than one"
    assert naming.look_alikes["stress_peak_shift"] == ("slip_sinkage",)
    assert instead(found, "stress_peak_shift") == {"slip_sinkage": lugs}
    nothing = np.zeros_like(problem.measured)
    remaining = SmoothCorrection((), 0.0, nothing, nothing)
    answer = assemble(problem, found, naming, remaining, (), source="made", seed=0, began=0.0)
    assert answer.verdict == "cannot_tell"
    assert {each.effect for each in answer.missing} == {"stress_peak_shift", "slip_sinkage", "grousers"}


def test_lugs_that_gain_little_are_kept_beside_what_is_found(made):
    _, textbook, alone, lugs, sensor = made
    sinks = gaining(alone["slip_sinkage"], 60.0)
    assert warranted(Search(textbook, (sinks,), (), gaining(lugs, 67.0)), 1.0).chosen.slugs == lugs.slugs
    assert warranted(Search(textbook, (sinks,), (), gaining(lugs, 67.0)), 2.0).chosen is sinks
    assert warranted(Search(textbook, (sinks,), (), gaining(sensor, 67.0)), 1.0).chosen is sinks


def test_what_nobody_published_gives_way_to_an_effect_beside_lugs(made):
    problem, textbook, alone, lugs, sensor = made
    vector = alone["stress_peak_shift"].fitted.vector.copy()
    vector[5] = 0.75  # a0
    peak = alone["stress_peak_shift"]
    peak = replace(peak, fitted=replace(peak.fitted, vector=vector), gain=60.0)
    for nats, chosen in ((56.0, {"slip_sinkage", "grousers"}), (45.0, {"stress_peak_shift"})):
        tries = _Tries(problem, textbook, (), print, [peak, gaining(lugs, nats), gaining(sensor, nats)])
        assert tries.ended(peak).chosen.slugs == chosen


def test_lugs_are_tried_beside_what_is_found(made):
    problem, textbook, _, _, _ = made
    effects = [*effects_for(situation(problem, textbook.fitted), ["slip_sinkage"]), LugRadius(0.01, its_slip=True)]
    found = search(problem, textbook, effects)
    assert found.chosen.slugs == {"slip_sinkage"}
    considered = {trial.slugs for trial in found.trials} | {frozenset(each[0].split(" + ")) for each in found.passed}
    assert any("grousers" in str(sorted(each)) and len(each) > 1 for each in considered)
