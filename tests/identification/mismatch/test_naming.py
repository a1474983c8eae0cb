"""Probabilities and choice among sets that were tried: what is alike, what is asked, what gives way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import (
    ASKED_FOR,
    Trial,
    situation,
    temperature,
    textbook_trial,
    try_adding,
)
from bevameter.identification.mismatch.locate.noise_floor import noise_floor
from bevameter.identification.mismatch.name.evidence import asks_for_more, doubts
from bevameter.identification.mismatch.name.naming import ASSERTED, name, why_not
from bevameter.identification.mismatch.name.preferred import plainest, says_no_more
from bevameter.identification.mismatch.name.tries import Search, Tries
from concealed.conceal import conceal


@pytest.mark.parametrize(
    ("effects", "more", "repeated", "gained", "asks"),
    [(1, 20.0, 1.0, 900.0, False), (1, 25.0, 1.0, 900.0, True), (1, 25.0, 2.0, 900.0, False),
     (2, 10.0, 1.0, 800.0, False), (2, 13.0, 1.0, 800.0, True), (1, 54.0, 1.0, 4600.0, False),
     (1, 100.0, 2.0, 4600.0, True)],
)  # fmt: skip
def test_a_set_beside_which_another_effect_still_gains_is_doubted(searched, effects, more, repeated, gained, asks):
    problem, found = searched
    kinds = effects_for(situation(problem, found.textbook.fitted), ["slip_sinkage", "torque_gain", "load_gain"])
    sets = [tuple(kinds[:count]) for count in (effects, effects + 1)]
    chosen, larger = (
        Trial(each, found.chosen.fitted, found.chosen.held_out, gain)
        for each, gain in zip(sets, (gained, gained + more), strict=True)
    )
    assert asks_for_more(Search(found.textbook, (chosen, larger), (), chosen), repeated) == asks
    assert not asks_for_more(Search(found.textbook, (chosen, larger), (), found.textbook), repeated)


@pytest.mark.parametrize(
    ("more", "repeated", "least", "most"),
    [
        (24.0, 1.0, 0.4, 0.5),
        (21.0, 1.0, 0.25, 0.35),
        (0.0, 1.0, 0.0, 0.02),
        (36.0, 3.0, 0.12, 0.18),
        (90.0, 1.0, 0.4, 0.5),
    ],
)
def test_what_gains_less_than_is_asked_beside_the_chosen_is_not_ruled_out(searched, more, repeated, least, most):
    problem, found = searched
    kinds = effects_for(situation(problem, found.textbook.fitted), ["slip_sinkage", "torque_gain"])
    further = next(effect for effect in kinds if effect.slug == "torque_gain")
    chosen = replace(found.chosen, gain=651.0)
    larger = replace(chosen, effects=(*chosen.effects, further), gain=chosen.gain + more)
    naming = name(Search(found.textbook, (chosen, larger), (), chosen), 0.0, repeated=repeated)
    assert least <= naming.effects["torque_gain"] <= most
    assert naming.effects["slip_sinkage"] > 0.9
    alone = name(Search(found.textbook, (chosen,), (), chosen), 0.0, repeated=repeated)
    assert naming.weights.sum() == pytest.approx(alone.weights.sum()), "only the chosen set's share is divided"
    # Counted for what it says, the same evidence has the same odds.
    once = [replace(trial, gain=trial.gain / repeated) for trial in (chosen, larger)]
    same = name(Search(found.textbook, tuple(once), (), once[0]), 0.0)
    assert naming.effects["torque_gain"] == pytest.approx(same.effects["torque_gain"])


@pytest.mark.parametrize(("gained", "sure"), [(100.0, True), (3000.0, False)])
def test_look_alikes_are_told_apart_less_surely_the_more_is_gained(searched, gained, sure):
    """Published forms of one effect differ: by some nats in thousands, and these are no evidence for another effect."""
    problem, found = searched
    rival = effects_for(situation(problem, found.textbook.fitted), ["stress_peak_shift"])[0]
    best, other = (
        Trial((effect,), found.chosen.fitted, found.chosen.held_out, gain)
        for effect, gain in ((found.chosen.effects[0], gained), (rival, gained - 9.0))
    )
    naming = name(Search(found.textbook, (best, other), (), best), 0.0)
    assert (naming.effects["slip_sinkage"] >= ASSERTED) == sure
    assert naming.effects["slip_sinkage"] > naming.effects["stress_peak_shift"]
    assert (naming.look_alikes["slip_sinkage"] == ("stress_peak_shift",)) != sure


def test_rows_that_repeat_each_other_set_look_alikes_less_far_apart(searched):
    """Thirty nats of which three say the same are ten."""
    problem, found = searched
    rival = effects_for(situation(problem, found.textbook.fitted), ["stress_peak_shift"])[0]
    best, other = (
        Trial((effect,), found.chosen.fitted, found.chosen.held_out, gain)
        for effect, gain in ((found.chosen.effects[0], 300.0), (rival, 285.0))
    )
    together = Search(found.textbook, (best, other), (), best)
    assert name(together, 0.0).look_alikes["slip_sinkage"] == ()
    assert name(together, 0.0, repeated=3.0).look_alikes["slip_sinkage"] == ("stress_peak_shift",)
    assert why_not(other, together, 1.0).startswith("explains less")
    assert why_not(other, together, 3.0).startswith("nearly as good")
    more = Trial((*best.effects, rival), found.chosen.fitted, found.chosen.held_out, 360.0)
    assert why_not(more, together, 1.0) == "adds too little to what is chosen (+60.0 nats)"
    assert "neighbouring rows repeat each other" in why_not(more, together, 2.0)


def test_what_nobody_has_published_gives_way_to_what_gains_nearly_as_much(searched):
    problem, found = searched
    kinds = effects_for(situation(problem, found.textbook.fitted), ["slip_sinkage", "stress_peak_shift"])
    shift = next(effect for effect in kinds if effect.slug == "stress_peak_shift")
    trial = try_adding(problem, found.textbook, found.textbook, shift)
    vector = trial.fitted.vector.copy()
    vector[5] = 0.9  # a0
    unheard_of = Trial((shift,), replace(trial.fitted, vector=vector), trial.held_out, 302.0)
    other = Trial((kinds[0],), found.chosen.fitted, found.chosen.held_out, 300.0)
    assert unheard_of.unheard_of
    ended = Tries(problem, found.textbook, (), print, [unheard_of, other]).ended(unheard_of)
    assert ended.chosen is other
    assert name(ended, 0.0).effects["slip_sinkage"] > ASSERTED
    alone = Tries(problem, found.textbook, (), print, [unheard_of]).ended(unheard_of)
    assert alone.chosen is unheard_of


@pytest.mark.parametrize(("gained", "gives_way"), [(303.0, True), (297.0, False)])
def test_what_nobody_has_published_gives_way_to_two_that_gain_as_much(searched, gained, gives_way):
    """Both of two that are there may gain no more than one effect that is bent beyond all bounds; it stays doubted."""
    problem, found = searched
    here = situation(problem, found.textbook.fitted)
    shift, gain = (effects_for(here, [slug])[0] for slug in ("stress_peak_shift", "torque_gain"))
    peak = try_adding(problem, found.textbook, found.textbook, shift)
    vector = peak.fitted.vector.copy()
    vector[5] = 0.9  # a0
    bent = Trial((shift,), replace(peak.fitted, vector=vector), peak.held_out, 300.0)
    two = replace(try_adding(problem, found.textbook, found.chosen, gain), gain=gained)
    ended = Tries(problem, found.textbook, (), print, [bent, two]).ended(bent)
    assert (ended.chosen.slugs == {"slip_sinkage", "torque_gain"}) == gives_way
    assert any("a0 = 0.9, beyond what has been published" in why for why in doubts(problem, ended, 0.0, 1.0))
    sure = replace(two, gain=320.0)
    ended = Tries(problem, found.textbook, (), print, [bent, sure]).ended(sure)
    assert not any("beyond" in why for why in doubts(problem, ended, 0.0, 1.0))
    for more, doubted in ((40.0, True), (50.0, False)):  # forms that have been published differ by as much
        one, both = replace(bent, gain=3000.0), replace(two, gain=3000.0 + more)
        ended = Tries(problem, found.textbook, (), print, [one, both]).ended(both)
        assert ended.chosen is both
        assert any("one effect less" in why for why in doubts(problem, ended, 0.0, 1.0)) == doubted


def test_a_search_that_tried_nothing_has_an_answer(searched):
    _, found = searched
    naming = name(Search(found.textbook, (), (), found.textbook), 0.0)
    assert naming.effects == {}
    assert naming.weights.shape == (0,)


def test_where_nothing_is_asked_for_no_candidate_is_likely(searched):
    _, found = searched
    nearly = Trial(found.chosen.effects, found.chosen.fitted, found.chosen.held_out, ASKED_FOR - 0.1)
    naming = name(Search(found.textbook, (nearly,), (), found.textbook), 0.0)
    assert naming.effects["slip_sinkage"] == pytest.approx(0.5 * (1.0 - naming.unknown))
    assert naming.weights.sum() == pytest.approx(0.5 * (1.0 - naming.unknown))
    asked = Trial(found.chosen.effects, found.chosen.fitted, found.chosen.held_out, ASKED_FOR + 0.1)
    assert name(Search(found.textbook, (asked,), (), asked), 0.0).effects["slip_sinkage"] > ASSERTED


def test_of_sets_that_gain_alike_the_one_that_errs_less_is_chosen(searched):
    problem, found = searched
    effects = effects_for(situation(problem, found.textbook.fitted), ["slip_sinkage", "stress_peak_shift"])[:2]
    residuals = found.chosen.held_out.residuals

    def tried(effect, gain: float, times: float) -> Trial:
        return Trial((effect,), found.chosen.fitted, replace(found.chosen.held_out, residuals=times * residuals), gain)

    def chosen(lead: float) -> Trial:
        tries = Tries(problem, found.textbook, (), print, [tried(effects[0], 300.0 + lead, 3.0), other])
        return tries.ended(tries.trials[0]).chosen

    other = tried(effects[1], 300.0, 1.0)
    assert chosen(3.0) is other
    assert chosen(5.0).effects == (effects[0],)
    ahead, behind = (tried(effects[0], gain, 3.0) for gain in (303.0, 297.0))
    together = Search(found.textbook, (ahead, behind, other), (), other)
    assert why_not(ahead, together, 1.0) == "as good: 3.0 nats more, but larger errors on held-out rows"
    assert why_not(behind, together, 1.0) == "nearly as good: 3.0 nats behind"


def test_where_every_form_is_wrong_nats_count_less_and_what_is_not_excluded_is_chosen_by_its_errors(searched):
    problem, found = searched
    there = situation(problem, found.textbook.fitted)
    effects = [effects_for(there, [slug])[0] for slug in ("slip_sinkage", "stress_peak_shift")]
    residuals = found.chosen.held_out.residuals

    def ended(lead: float, times: float, gained: float = 300.0) -> Search:
        errors, gains = (2.0 * times, times), (gained + lead, gained)
        tries = Tries(problem, found.textbook, (), print, [
            Trial((effect,), found.chosen.fitted, replace(found.chosen.held_out, residuals=error * residuals), gain)
            for effect, error, gain in zip(effects, errors, gains, strict=True)
        ])  # fmt: skip
        return tries.ended(tries.trials[0])

    # The noise is exceeded by both: thrice by the one, six times by the other.
    wrong, right = ended(60.0, 3.0), ended(60.0, 1.0)
    assert wrong.dispersion == pytest.approx(9.0 * dispersion_of(problem, found.chosen), rel=1e-6)
    assert wrong.chosen.effects == (effects[1],)
    assert (right.dispersion, right.chosen.effects) == (1.0, (effects[0],))
    assert ended(200.0, 3.0).chosen.effects == (effects[0],)
    # Whatever errs less: what gains nothing is not chosen.
    assert ended(15.0, 3.0, ASKED_FOR + 1.0).chosen.effects == (effects[1],)
    assert ended(15.0, 3.0, ASKED_FOR - 1.0).chosen.effects == (effects[0],)
    # That every form is wrong makes nothing unknown less probable.
    for left in (20.0, 75.0, 4000.0):
        assert name(wrong, left).unknown == name(replace(wrong, dispersion=1.0), left).unknown
    # In the probabilities, too, which go by errors on blocks that err independently.
    ratio = np.log(name(wrong, 0.0).weights[1] / name(wrong, 0.0).weights[0])
    blocks, channels = len(np.unique(problem.samples.block)), len(problem.answers)
    assert ratio == pytest.approx(blocks * channels * np.log(2.0) / temperature(300.0), rel=1e-6)
    ahead = effects[0].slug
    assert name(right, 0.0).effects[ahead] > ASSERTED > 0.9 * ASSERTED > name(ended(20.0, 3.0), 0.0).effects[ahead]
    assert why_not(wrong.trials[0], wrong, 1.0) == "as good: 60.0 nats more, but larger errors on held-out rows"


def dispersion_of(problem, trial: Trial) -> float:
    """Variance of the held-out residuals over the noise's, the channels' geometric mean."""
    floor = np.array([noise_floor(problem, trial.fitted, each) for each in range(len(problem.answers))])
    variance = np.nanmean(trial.held_out.residuals**2, axis=0)
    return float(np.exp(np.mean(np.log(variance / floor**2))))


def test_a_torque_off_by_the_same_everywhere_is_sooner_a_wrong_zero_than_friction(tmp_path):
    """Both may be it, and neither is asserted: but friction of a drive follows load and speed as a rule."""
    folder = conceal(7111, ("torque_offset",), "hidden", protocol="steady").write(tmp_path / "off")
    rows = felt_rows(open_recording(folder, None))
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))
    catalogue = effects_for(situation(problem, textbook.fitted), ["torque_offset", "drivetrain_friction"])
    forms = {effect.name: try_adding(problem, textbook, textbook, effect) for effect in catalogue}
    zero, constant = forms["torque_offset"], forms["drivetrain_friction[coulomb]"]
    assert zero.gain == pytest.approx(constant.gain, abs=0.1), "the wheel turns one way: they say the same"
    trials = tuple(forms.values())
    assert says_no_more(trials, constant)
    assert says_no_more(trials, forms["drivetrain_friction[coulomb+load]"])
    assert not says_no_more(trials, zero)
    assert plainest(problem, trials, constant) is zero
    naming = name(Search(textbook, trials, (), zero), 0.0)
    assert ASSERTED > naming.effects["torque_offset"] > 2.0 * naming.effects["drivetrain_friction"] > 0.2
    # Where the catalogue lacks the zero, friction is doubted: what shows of it may be one.
    assert any("wrong zero" in each for each in doubts(problem, Search(textbook, (constant,), (), constant), 0.0, 1.0))
    assert not any("wrong zero" in each for each in doubts(problem, Search(textbook, trials, (), zero), 0.0, 1.0))
    # Where its other parts show, friction is as likely as anything that explains as much.
    shows = replace(forms["drivetrain_friction[coulomb+load]"], gain=zero.gain + 20.0)
    trials = tuple(shows if trial.names == shows.names else trial for trial in trials)
    assert not says_no_more(trials, shows)
    assert plainest(problem, trials, shows) is shows
    assert name(Search(textbook, trials, (), shows), 0.0).effects["drivetrain_friction"] > ASSERTED
