"""What the vehicle's description announces, its lugs, counts as no further effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter import Recording, SoilKnowledge, Vehicle, Wheel, WheelTable, explain
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.effects.grousers import LugRadius, LugTips
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import situation, textbook_trial, try_adding
from bevameter.identification.mismatch.locate.smooth_correction import SmoothCorrection
from bevameter.identification.mismatch.name import partners as module
from bevameter.identification.mismatch.name.asked import surplus
from bevameter.identification.mismatch.name.evidence import warranted
from bevameter.identification.mismatch.name.naming import instead, name, why_not
from bevameter.identification.mismatch.name.search import search
from bevameter.identification.mismatch.name.tries import Search, Tries
from bevameter.identification.mismatch.show.answer import assemble
from bevameter.identification.simulate import simulate
from concealed.conceal import conceal


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


def test_lugs_that_come_out_as_announced_ask_little_of_what_they_gain(made):
    _, _, _, lugs, _ = made

    def surplus_beside(lugs_alone: float, share: float, sd: float) -> float:
        index = lugs.fitted.model.slices()[-1][1].start
        vector, covariance = lugs.fitted.vector.copy(), lugs.fitted.covariance.copy()
        vector[index], covariance[index, index] = share, sd**2
        larger = replace(lugs, fitted=replace(lugs.fitted, vector=vector, covariance=covariance))
        only_lugs = replace(lugs, effects=lugs.effects[1:], gain=lugs_alone)
        return surplus(only_lugs, gaining(larger, lugs_alone + 30.0))

    assert surplus_beside(400.0, 0.95, 0.01) == pytest.approx(15.0)
    assert surplus_beside(400.0, 1.2, 0.09) == pytest.approx(15.0)
    assert surplus_beside(1800.0, 1.0, 0.01) == pytest.approx(30.0 - 0.015 * 1800.0)
    assert surplus_beside(400.0, 0.85, 0.01) == pytest.approx(-2.0), "another form may be right"
    assert surplus_beside(400.0, 1.0, 0.3) == pytest.approx(-2.0), "data that do not tell confirm nothing"


@pytest.mark.parametrize("lugs", [LugRadius(0.01), LugTips(0.01)])
def test_a_prior_that_knows_the_lugs_confirms_none(lugs):
    scale = lugs.parameters[0].scale
    told = [1.0 / np.hypot(1.0 / scale, 1.0 / by_data) for by_data in (0.09, 0.11, 1e6)]
    assert [lugs.as_announced(np.ones(1), np.array([sd])) for sd in told] == [True, False, False]


def test_no_share_is_asked_of_what_ripples_gain(made):
    _, _, alone, _, sensor = made
    rippling = replace(gaining(alone["slip_sinkage"], 700.0), rippled=640.0)
    assert surplus(rippling, gaining(sensor, 730.0)) == pytest.approx(15.0)
    assert surplus(replace(rippling, rippled=0.0), gaining(sensor, 730.0)) == pytest.approx(5.0)


def test_two_effects_without_lugs_confirm_none(made):
    _, _, alone, lugs, sensor = made
    assert not sensor.as_announced
    assert not alone["slip_sinkage"].as_announced
    only_lugs = replace(lugs, effects=lugs.effects[1:], gain=400.0)
    assert surplus(only_lugs, gaining(sensor, 430.0)) == pytest.approx(-2.0)


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
    remaining = SmoothCorrection((), 0.0, 0.0, nothing, nothing)
    before = found.textbook.held_out.residuals
    answer = assemble(problem, found, naming, remaining, (), source="made", seed=0, began=0.0, before=before)
    assert answer.verdict == "cannot_tell"
    assert {each.effect for each in answer.missing} == {"stress_peak_shift", "slip_sinkage", "grousers"}


def test_what_stands_in_the_same_place_beside_lugs_lists_them_once(made):
    problem, textbook, alone, lugs, _ = made
    shifted = gaining(try_adding(problem, textbook, alone["stress_peak_shift"], lugs.effects[-1]), 60.5)
    sinks = gaining(lugs, 61.0)
    found = Search(textbook, (sinks, shifted), (), sinks)
    naming = name(found, 0.0)
    nothing, before = np.zeros_like(problem.measured), textbook.held_out.residuals
    remaining = SmoothCorrection((), 0.0, 0.0, nothing, nothing)
    answer = assemble(problem, found, naming, remaining, (), source="made", seed=0, began=0.0, before=before)
    # Not sure, for a doubt that all share, are all three.
    doubted = name(found, 0.0, doubted=True)
    unsure = assemble(problem, found, doubted, remaining, (), source="made", seed=0, began=0.0, before=before)
    for each, listed in ((answer, {"grousers"}), (unsure, {"grousers", "slip_sinkage", "stress_peak_shift"})):
        effects = [missing.effect for missing in each.missing]
        assert len(effects) == len(set(effects))
        assert set(effects) >= listed


def test_lugs_that_were_turned_down_have_no_say(made):
    _, textbook, alone, lugs, _ = made
    sinks, lugs = gaining(alone["slip_sinkage"], 60.0), gaining(lugs, 64.5)
    naming = name(Search(textbook, (sinks, lugs), (), sinks), 0.0)
    assert "grousers" not in naming.effects or naming.effects["grousers"] == 0.0
    assert naming.effects["slip_sinkage"] > 0.9
    assert why_not(lugs, Search(textbook, (sinks, lugs), (), sinks), 1.0).startswith("adds too little")
    # Beside another effect they count only where they earned their place there.
    peak = gaining(alone["stress_peak_shift"], 62.0)
    naming = name(Search(textbook, (peak, sinks, lugs), (), peak), 0.0)
    assert naming.effects["grousers"] == 0.0
    naming = name(Search(textbook, (peak, gaining(sinks, 50.0), lugs), (), peak), 0.0)
    assert naming.effects["grousers"] > 0.3


def test_lugs_that_gain_little_are_kept_beside_what_is_found(made):
    _, textbook, alone, lugs, sensor = made
    sinks = gaining(alone["slip_sinkage"], 60.0)
    assert warranted(Search(textbook, (sinks,), (), gaining(lugs, 67.0)), 1.0).chosen.slugs == lugs.slugs
    assert warranted(Search(textbook, (sinks,), (), gaining(lugs, 67.0)), 2.0).chosen is sinks
    assert warranted(Search(textbook, (sinks,), (), gaining(sensor, 67.0)), 1.0).chosen is sinks
    # Each of the two has to earn its place, and lugs alone as much as any effect.
    only_lugs = replace(lugs, effects=lugs.effects[1:], gain=50.0)
    both = Search(textbook, (gaining(sinks, 59.0), only_lugs), (), gaining(lugs, 70.0))
    assert warranted(both, 1.0).chosen is both.chosen
    assert warranted(both, 2.0).chosen.slugs == {"slip_sinkage"}
    assert warranted(Search(textbook, (), (), replace(only_lugs, gain=20.0)), 3.0).chosen is textbook


def test_what_nobody_published_gives_way_to_an_effect_beside_lugs(made):
    problem, textbook, alone, lugs, sensor = made
    vector = alone["stress_peak_shift"].fitted.vector.copy()
    vector[5] = 0.75  # a0
    peak = alone["stress_peak_shift"]
    peak = replace(peak, fitted=replace(peak.fitted, vector=vector), gain=60.0)
    for nats, chosen in ((56.0, {"slip_sinkage", "grousers"}), (45.0, {"stress_peak_shift"})):
        tries = Tries(problem, textbook, (), print, [peak, gaining(lugs, nats), gaining(sensor, nats)])
        ended = tries.ended(peak)
        assert ended.chosen.slugs == chosen
    tries = Tries(problem, textbook, (), print, [peak, gaining(lugs, 56.0)])
    assert "a0 = 0.75, beyond what has been published" in why_not(peak, tries.ended(peak), 1.0)


def test_lugs_are_tried_beside_what_is_found(made):
    problem, textbook, _, _, _ = made
    effects = [*effects_for(situation(problem, textbook.fitted), ["slip_sinkage"]), LugRadius(0.01, its_slip=True)]
    found = search(problem, textbook, effects)
    assert found.chosen.slugs == {"slip_sinkage"}
    considered = [trial.names for trial in found.trials] + [frozenset(each.split(" + ")) for each, _ in found.passed]
    beside = [names for names in considered if len(names) > 1 and any("grousers" in each for each in names)]
    assert beside
    assert len(set(beside)) == len(beside)


def test_lugs_are_tried_beside_the_effects_that_gain_most_in_any_form(made, monkeypatch):
    """An effect with a form that gains little comes as early as its best form is good."""
    problem, textbook, alone, _, sensor = made
    sinks, peak = alone["slip_sinkage"], alone["stress_peak_shift"]
    lugs = LugRadius(0.01, its_slip=True)
    tried = []
    monkeypatch.setattr(Tries, "weigh", lambda _self, base, effects: tried.append(base) or [])
    monkeypatch.setattr(module, "_BESIDE_EXPECTED", 1)
    singles = [gaining(sinks, 30.0), gaining(peak, 70.0), gaining(sinks, 90.0)]
    best = replace(sensor, effects=sensor.effects[1:], gain=100.0)
    module._beside_expected(Tries(problem, textbook, (lugs,), print), singles, best)
    assert [(base.slugs, base.gain) for base in tried] == [({"torque_gain"}, 100.0), ({"slip_sinkage"}, 90.0)]


@pytest.mark.parametrize(("share", "slugs"), [(0.95, {"shear_hump", "load_gain"}), (0.4, {"load_gain"})])
def test_beside_lugs_as_announced_what_only_a_fit_tells_is_tried(made, monkeypatch, share, slugs):
    """A torque gain did as well alone as lugs whose soil has a peak of shear strength, which is nothing at first."""
    problem, textbook, _, lugs, sensor = made
    catalogue = effects_for(situation(problem, textbook.fitted), ["shear_hump", "load_gain", "torque_gain"])
    vector, covariance = lugs.fitted.vector.copy(), lugs.fitted.covariance.copy()
    vector[-1], covariance[-1, -1] = share, 0.01**2
    only_lugs = replace(
        lugs, effects=lugs.effects[1:], gain=99.0, fitted=replace(lugs.fitted, vector=vector, covariance=covariance)
    )
    best = replace(sensor, effects=sensor.effects[1:], gain=100.0)
    tried = []
    monkeypatch.setattr(Tries, "weigh", lambda _self, base, effects: tried.append((base, effects)) or [])
    module._beside_expected(Tries(problem, textbook, catalogue, print), [best, only_lugs], best)
    ((base, effects),) = tried
    assert base is only_lugs
    assert {effect.slug for effect in effects} == slugs


def test_a_radius_that_is_wrong_by_the_lugs_height_may_be_the_lugs(tmp_path):
    """Lugs whose tips drag the soil along were once a wrong radius, up to 96 %."""
    noise = {"load_N": 1.0, "torque_Nm": 0.5, "slip": 0.002, "sinkage_m": 3e-4, "drawbar_pull_N": 2.5}
    wheel = Wheel(radius_m=0.17, width_m=0.17, grouser_height_m=0.0087, grouser_count=16)
    vehicle = Vehicle(wheels=(wheel,), noise=noise)
    soil = SoilKnowledge({"c_Pa": 2200.0, "phi_rad": 0.45, "k_m": 0.021, "stiffness_Pa": 6e5, "n": 0.78})
    rng = np.random.default_rng(35)
    load, slip = rng.permutation(np.tile([150.0, 250.0, 350.0, 450.0], 30)), rng.uniform(0.03, 0.7, 120)
    names = np.array([f"t{number}" for number in range(120)])
    path = tmp_path / "table.csv"
    drive = WheelTable({"load_N": load, "slip": slip}, None, names, path)
    answers = simulate(vehicle, soil, drive, ["grousers:form=displacement of the tips,s=1"])
    noisy = {name: answers[name] + sd * rng.normal(size=120) for name, sd in noise.items()}
    recording = Recording("table", path, vehicle, None, "", "0" * 64, wheel=WheelTable(noisy, None, names, path))
    answer = explain(recording, catalogue=["grousers", "rolling_radius", "shear_hump"])
    listed = {slug for each in answer.missing for slug in (each.effect, *each.indistinguishable_from)}
    assert {"grousers", "rolling_radius"} <= listed
    lugs = next(each for each in answer.missing if each.effect == "grousers")
    assert lugs.form == "displacement of the tips"
    assert abs(lugs.parameters["s"].value - 1.0) < 3.0 * lugs.parameters["s"].sd
