"""The answer put together: what is asserted, what is only possible, and what is not spoken of."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.mismatch.fit.trial import (
    Trial,
    situation,
    try_adding,
)
from bevameter.identification.mismatch.locate.smooth_correction import SmoothCorrection, Term
from bevameter.identification.mismatch.name.evidence import doubts
from bevameter.identification.mismatch.name.naming import ASSERTED, Naming, name
from bevameter.identification.mismatch.name.tries import Search
from bevameter.identification.mismatch.show.answer import _alone, _next_best, assemble
from bevameter.identification.mismatch.show.estimates import parameters, parameters_among
from bevameter.identification.mismatch.show.headline import verdict
from bevameter.identification.mismatch.show.readable import effect as effect_name


@pytest.mark.parametrize(
    ("sure", "verdict", "listed"),
    [(0.85, "physics", {"slip_sinkage"}), (0.7, "cannot_tell", {"slip_sinkage", "unknown"}),
     (0.1, "unknown", {"slip_sinkage", "unknown"})],
)  # fmt: skip
def test_something_unknown_is_a_rival_only_where_the_effect_is_not_sure(searched, sure, verdict, listed):
    problem, found = searched
    slip = problem.samples.drive.slip
    remaining = SmoothCorrection(
        (Term("torque_Nm", "slip", slip, 0.1 * slip, 12.0),),
        12.0,
        5.0,
        np.zeros_like(problem.measured),
        np.zeros_like(problem.measured),
    )
    naming = Naming({"slip_sinkage": sure}, 1.0 - sure, {"slip_sinkage": ()}, np.array([sure]))
    before = found.textbook.held_out.residuals
    answer = assemble(problem, found, naming, remaining, (), source="made", seed=0, began=0.0, before=before)
    assert answer.verdict == verdict
    assert {missing.effect for missing in answer.missing} == listed
    assert not any("something more" in note for note in answer.notes)
    scatter = found.chosen.held_out.gain(found.textbook.held_out)[1]
    assert answer.heldout_nats.sd == pytest.approx(math.hypot(scatter, 5.0) if sure < 0.5 else scatter)


def test_whatever_is_probable_is_listed_though_it_takes_more_than_one_effects_place(searched):
    """A second effect of another recording was 27 % probable in sets that shared nothing with the chosen one."""
    problem, found = searched
    kinds = {e.slug: e for e in effects_for(situation(problem, found.textbook.fitted), ["load_gain", "torque_gain"])}
    shift = effects_for(situation(problem, found.textbook.fitted), ["stress_peak_shift"])[0]
    gains = try_adding(problem, found.textbook, found.textbook, kinds["load_gain"])
    pairs = [
        replace(try_adding(problem, found.textbook, base, effect), gain=gain)
        for base, effect, gain in ((gains, kinds["torque_gain"], 300.0), (found.chosen, shift, 298.0))
    ]
    chosen = Search(found.textbook, tuple(pairs), (), pairs[0])
    nothing = SmoothCorrection((), 0.0, 0.0, np.zeros_like(problem.measured), np.zeros_like(problem.measured))
    naming, before = name(chosen, 0.0), found.textbook.held_out.residuals
    answer = assemble(problem, chosen, naming, nothing, (), source="made", seed=0, began=0.0, before=before)
    assert answer.verdict == "cannot_tell"
    listed = {missing.effect: missing for missing in answer.missing}
    assert set(listed) == {"load_gain", "torque_gain", "slip_sinkage", "stress_peak_shift"}
    for slug in ("slip_sinkage", "stress_peak_shift"):
        assert listed[slug].indistinguishable_from == ("load_gain", "torque_gain")
        assert listed[slug].probability == pytest.approx(naming.effects[slug])
        assert listed[slug].parameters


def test_no_more_than_six_are_listed_where_the_data_cannot_tell(searched):
    problem, found = searched
    slugs = ["load_gain", "torque_gain", "stress_peak_shift", "exit_angle", "bulldozing", "side_wall_friction"]
    forms = {e.slug: e for e in effects_for(situation(problem, found.textbook.fitted), slugs)}
    trials = [found.chosen] + [
        replace(try_adding(problem, found.textbook, found.textbook, forms[slug]), gain=found.chosen.gain - 0.1 * number)
        for number, slug in enumerate(slugs, 1)
    ]
    together = Search(found.textbook, tuple(trials), (), found.chosen)
    naming, before = name(together, 0.0), found.textbook.held_out.residuals
    nothing = SmoothCorrection((), 0.0, 0.0, np.zeros_like(problem.measured), np.zeros_like(problem.measured))
    answer = assemble(problem, together, naming, nothing, (), source="made", seed=0, began=0.0, before=before)
    assert answer.verdict == "cannot_tell"
    assert {each.effect for each in answer.missing} == {"slip_sinkage", *slugs[:5]}
    assert not any(slugs[5] in each.indistinguishable_from for each in answer.missing)
    assert any(candidate.effect.startswith(slugs[5]) for candidate in answer.candidates)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["slip x load", "sinkage_m"], "a drive that varies slip i, then load W with all else held"),
        (["sinkage_m", "lag_s", "constant"], ""),
        (["slip", "slip x load", "rim_speed_m_s"], "a drive that varies slip i, then load W, then speed of the rim"),
    ],
)
def test_what_is_unknown_is_looked_at_by_what_a_drive_can_vary(names, words):
    assert _alone(names).startswith(words)
    assert bool(words) == bool(_alone(names))


def test_parameters_err_by_what_sets_differ_by_that_hold_the_same_form(searched):
    """Of two sets as probable, beside one of which the effect is twice as strong: its parameter may be either."""
    problem, found = searched
    chosen, (effect,) = found.chosen, found.chosen.effects
    gain = effects_for(situation(problem, found.textbook.fitted), ["load_gain"])[0]
    pair = try_adding(problem, found.textbook, chosen, gain)
    vector = pair.fitted.vector.copy()
    own = chosen.fitted.vector[5:6]
    vector[5:6] = 2.0 * own
    other = replace(pair, fitted=replace(pair.fitted, vector=vector))
    both = replace(found, trials=(chosen, other))
    (alone,) = parameters(chosen.fitted, effect).values()
    for weights, between in (((0.48, 0.48), 0.5), ((0.003, 0.001), 0.25), ((0.96, 0.0), 0.0), ((0.0, 0.0), 0.0)):
        naming = Naming({}, 0.04, {}, np.array(weights))
        (told,) = parameters_among(both, naming, chosen, effect).values()
        assert told.value == alone.value == own[0]
        assert told.sd == pytest.approx(math.sqrt(alone.sd**2 + between * own[0] ** 2))
    naming = Naming({"slip_sinkage": 0.96}, 0.04, {"slip_sinkage": ()}, np.array([0.48, 0.48]))
    nothing = SmoothCorrection((), 0.0, 0.0, np.zeros_like(problem.measured), np.zeros_like(problem.measured))
    before = found.textbook.held_out.residuals
    answer = assemble(problem, both, naming, nothing, (), source="made", seed=0, began=0.0, before=before)
    (stated,) = answer.missing[0].parameters.values()
    assert stated.sd == pytest.approx(math.sqrt(alone.sd**2 + 0.5 * own[0] ** 2))


def test_an_excluded_rival_is_nothing_to_be_told_from(searched):
    problem, found = searched
    shift = effects_for(situation(problem, found.textbook.fitted), ["stress_peak_shift"])[0]
    other = try_adding(problem, found.textbook, found.textbook, shift)
    near, far = (replace(other, gain=found.chosen.gain - behind) for behind in (1.0, 400.0))
    assert _next_best(replace(found, trials=(found.chosen, far))) == []
    assert _next_best(replace(found, trials=(found.chosen, far, near))) == [near]


@pytest.mark.parametrize(("sure", "advised"), [(0.48, True), (0.96, False)])
def test_what_is_doubted_without_a_look_alike_is_told_how_to_tell_it_from_the_next_best(searched, sure, advised):
    problem, found = searched
    shift = effects_for(situation(problem, found.textbook.fitted), ["stress_peak_shift"])[0]
    other = try_adding(problem, found.textbook, found.textbook, shift)
    both = replace(found, trials=(*found.trials, other))
    nothing = SmoothCorrection((), 0.0, 0.0, np.zeros_like(problem.measured), np.zeros_like(problem.measured))
    naming = Naming({"slip_sinkage": sure}, 0.035, {"slip_sinkage": ()}, np.array([sure, 0.0]))
    before = found.textbook.held_out.residuals
    answer = assemble(problem, both, naming, nothing, (), source="made", seed=0, began=0.0, before=before)
    assert bool(answer.missing[0].would_tell) == advised
    assert ("What would tell: " in answer.summary) == advised


def test_effects_that_only_three_together_explain_it_are_not_each_asserted(searched):
    """Of recordings whose effect had been taken out of the catalogue one in five got three others in its place."""
    problem, found = searched
    effects = effects_for(situation(problem, found.textbook.fitted), ["load_gain", "torque_gain", "sinkage_offset"])
    together = Trial(tuple(effects), found.chosen.fitted, found.chosen.held_out, 1e5)
    naming = name(Search(found.textbook, (*found.trials, together), (), together), 0.0)
    assert all(naming.effects[slug] < ASSERTED for slug in together.slugs)
    pair = Trial(tuple(effects[:2]), found.chosen.fitted, found.chosen.held_out, 1e5)
    naming = name(Search(found.textbook, (*found.trials, pair), (), pair), 0.0)
    assert all(naming.effects[slug] > ASSERTED for slug in pair.slugs)


def test_an_effect_that_leaves_much_is_doubted_however_much_it_gains(searched):
    """Wrong models may fail wildly on held-out blocks: what is gained over them excuses nothing."""
    problem, found = searched
    alone = Trial(found.chosen.effects, found.chosen.fitted, found.chosen.held_out, 1e4)
    only = Search(found.textbook, (alone,), (), alone)
    assert name(only, 60.0).unknown < 0.05
    assert name(only, 130.0).unknown > 0.95
    effects = effects_for(situation(problem, found.textbook.fitted), ["load_gain", "torque_gain"])
    pair = Trial(tuple(effects), found.chosen.fitted, found.chosen.held_out, 1e4)
    assert name(Search(found.textbook, (pair,), (), pair), 70.0).unknown > 0.95


@pytest.mark.parametrize(
    ("felt", "gain", "repeated", "sure"),
    [
        (14.0, 500.0, 1.0, True),
        (16.0, 500.0, 1.0, False),
        (16.0, 500.0, 2.0, True),
        (29.0, 1000.0, 1.0, True),
        (31.0, 1000.0, 1.0, False),
    ],
)
def test_what_many_small_corrections_gain_together_speaks_against_a_set(searched, felt, gain, repeated, sure):
    problem, found = searched
    alone = replace(found.chosen, gain=gain)
    only = Search(found.textbook, (alone,), (), alone)
    against = doubts(problem, only, 0.0, repeated, felt)
    assert any("leaves more" in reason for reason in against) != sure
    naming = name(only, 0.0, repeated=repeated, doubted=bool(against))
    assert (naming.effects["slip_sinkage"] > ASSERTED) == sure


@pytest.mark.parametrize(("remaining", "repeated", "sure"), [(20.0, 1.0, True), (40.0, 1.0, False), (45.0, 3.0, True)])
def test_what_leaves_something_is_believed_in_no_more_than_half(searched, remaining, repeated, sure):
    """Less than is tolerated of a form, but more than right effects leave: no effect is asserted."""
    problem, found = searched
    alone = Trial(found.chosen.effects, found.chosen.fitted, found.chosen.held_out, 800.0)
    only = Search(found.textbook, (alone,), (), alone)
    against = doubts(problem, only, remaining, repeated)
    assert any("leaves more" in reason for reason in against) != sure
    naming = name(only, remaining, repeated=repeated, doubted=bool(against))
    assert (naming.effects["slip_sinkage"] > ASSERTED) == sure
    assert doubts(problem, Search(found.textbook, (alone,), (), found.textbook), remaining, repeated) == ()
    much = replace(alone, gain=1200.0)
    assert doubts(problem, Search(found.textbook, (much,), (), much), 40.0, 1.0) == (), "a share of what is gained"


def test_one_of_two_that_are_alike_is_told_beside_what_is_sure(searched):
    problem, found = searched
    kinds = effects_for(situation(problem, found.textbook.fitted), ["torque_offset", "drivetrain_friction"])
    pairs = [try_adding(problem, found.textbook, found.chosen, effect) for effect in kinds]
    together = Search(found.textbook, (*found.trials, *pairs), (), pairs[0])
    first, other = kinds[0].slug, next(effect.slug for effect in kinds if effect.slug != kinds[0].slug)
    nothing = np.zeros_like(problem.measured)

    def told(share: float, *more: str):
        shares = {"slip_sinkage": 0.95, first: share, other: share - 0.01} | dict.fromkeys(more, 0.02)
        naming = Naming(shares, 0.0, {"slip_sinkage": (), first: (other, *more)}, np.zeros(len(together.trials)))
        remaining = SmoothCorrection((), 0.0, 0.0, nothing, nothing)
        before = found.textbook.held_out.residuals
        return assemble(problem, together, naming, remaining, (), source="made", seed=0, began=0.0, before=before)

    answer = told(0.47)
    assert answer.verdict == "physics"
    assert [missing.effect for missing in answer.missing] == ["slip_sinkage", first]
    assert answer.missing[1].indistinguishable_from == (other,)
    assert "Beside that these data do not tell for sure what it is." in answer.summary
    assert re.search(f"{effect_name(first)} 47 % and {effect_name(other)} .* look alike here", answer.summary)
    assert f"{effect_name(first)} (about as likely as not, 47 %) or {effect_name(other)}" in verdict(answer)
    # Where neither is likely the rows ask for something, and that is a note.
    answer = told(0.3)
    assert [missing.effect for missing in answer.missing] == ["slip_sinkage"]
    assert any("something more" in note for note in answer.notes)
    # A long list names nothing: the best five beside the one.
    several = ("load_gain", "torque_gain", "exit_angle", "rolling_radius", "tyre_deflection")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "bevameter.identification.mismatch.show.answer.instead",
            lambda *_: dict.fromkeys((other, *several), pairs[1]),
        )
        assert told(0.47, *several).missing[1].indistinguishable_from == (other, *several[:4])


def test_candidates_stand_with_the_most_probable_first(searched):
    problem, found = searched
    # One that gains more and was turned down for its size has no say.
    larger = replace(found.chosen, effects=found.chosen.effects * 2, gain=found.chosen.gain + 5.0)
    both = replace(found, trials=(larger, *found.trials))
    nothing = SmoothCorrection((), 0.0, 0.0, np.zeros_like(problem.measured), np.zeros_like(problem.measured))
    naming, before = name(both, 0.0), found.textbook.held_out.residuals
    answer = assemble(problem, both, naming, nothing, (), source="made", seed=0, began=0.0, before=before)
    assert [each.why == "chosen" for each in answer.candidates] == [True, False]
    assert answer.candidates[1].heldout_nats > answer.candidates[0].heldout_nats


def test_noise_in_the_pictures_is_that_of_the_table(searched):
    problem, found = searched
    nothing = SmoothCorrection((), 0.0, 0.0, np.zeros_like(problem.measured), np.zeros_like(problem.measured))
    naming, before = name(found, 0.0), found.textbook.held_out.residuals
    answer = assemble(problem, found, naming, nothing, (), source="made", seed=0, began=0.0, before=before)
    assert answer.rows.noise == pytest.approx([answer.fits[channel].noise for channel in answer.rows.channels])
    after = (answer.rows.measured - answer.rows.after) / answer.rows.noise
    assert np.nanmean(np.abs(after) < 2.0) > 0.9, "what is right leaves little but the grey band"
