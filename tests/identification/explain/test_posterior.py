"""Posterior probabilities against arithmetic by hand, and what is listed and counted of them."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter.identification.effects.catalogue.sinkage_offset import SinkageOffset
from bevameter.identification.effects.catalogue.torque_offset import TorqueOffset
from bevameter.identification.explain.answer import Chosen, missing_of
from bevameter.identification.explain.evidence import discrepancy
from bevameter.identification.explain.fit import fit, with_effect
from bevameter.identification.explain.held_out import hold_out
from bevameter.identification.explain.posterior import posterior
from bevameter.identification.explain.search import Hypothesis, Search, situation
from bevameter.identification.mechanics.augmented import Entry

NOTHING = frozenset()
SINKAGE, TORQUE = frozenset({"sinkage_offset"}), frozenset({"torque_offset"})


@pytest.fixture(scope="module")
def found(fitted):
    """The textbook wheel and two offsets, whose ln evidence is put to 0, 20 and 15 nats."""
    problem, textbook = fitted
    size = np.sqrt(np.nanmean(problem.samples.measured**2, axis=0))
    effects = SinkageOffset(float(size[2])), TorqueOffset(float(size[1]))
    found = Search(problem, situation(problem, textbook), Hypothesis((), textbook, 0.0), effects, 0.0)
    for effect, evidence in zip(effects, (20.0, 15.0), strict=True):
        start = with_effect(textbook, effect, np.zeros(1))
        one = fit(problem, *start, textbook.noise, Entry(textbook.theta_1), steps=1, fit_noise=False)
        found.hypotheses.append(Hypothesis((effect,), one, evidence))
    return found


def test_it_is_prior_times_evidence(found):
    answer = posterior(found, effect=0.02, unknown=0.1, temperature=5.0)
    known = {NOTHING: 1.0, SINKAGE: 0.02 / 0.98 * np.exp(4.0), TORQUE: 0.02 / 0.98 * np.exp(3.0)}
    fits = {each.slugs: each.fitted for each in found.hypotheses}
    bayes = {slugs: np.exp(discrepancy(found.problem, fits[slugs]).log_evidence / 5.0) for slugs in known}
    whole = sum(weight * (0.9 + 0.1 * bayes[slugs]) for slugs, weight in known.items())
    for slugs, weight in known.items():
        assert answer.sets[slugs] == pytest.approx(0.9 * weight / whole)
        assert answer.sets[slugs | {"unknown"}] == pytest.approx(0.1 * weight * bayes[slugs] / whole)
    assert sum(answer.sets.values()) == pytest.approx(1.0)
    assert answer.effects["sinkage_offset"] == pytest.approx(
        known[SINKAGE] * (0.9 + 0.1 * bayes[SINKAGE]) / whole
    )  # fmt: skip
    assert answer.unknown == pytest.approx(sum(0.1 * known[each] * bayes[each] for each in known) / whole)


def listed(found, nothing: float, sinkage: float, torque: float, unknown: float) -> dict[str, float]:
    """Names and probabilities of what is listed under a given posterior."""
    sets = {NOTHING: nothing, SINKAGE: sinkage, TORQUE: torque, frozenset({"unknown"}): unknown}
    given = replace(
        posterior(found), sets=dict(sorted(sets.items(), key=lambda pair: -pair[1])), unknown=unknown,
        effects={"sinkage_offset": sinkage, "torque_offset": torque},
    )  # fmt: skip
    held = hold_out(found.problem, found.textbook.fitted)
    chosen = Chosen(given.best[next(iter(given.sets)) - {"unknown"}], None, held, held)
    return {each.effect: each.probability for each in missing_of(found.problem, found, given, chosen)}


def test_nothing_is_missing_only_where_the_textbook_is_more_probable_than_all_else(found):
    assert listed(found, 0.6, 0.3, 0.05, 0.05) == {}
    assert listed(found, 0.3, 0.04, 0.03, 0.02) == {"sinkage_offset": 0.04, "torque_offset": 0.03, "unknown": 0.02}


def test_an_asserted_effect_is_listed_alone_and_rivals_where_none_is(found):
    assert listed(found, 0.0, 0.95, 0.05, 0.0) == {"sinkage_offset": 0.95}
    assert listed(found, 0.0, 0.6, 0.3, 0.1) == {"sinkage_offset": 0.6, "torque_offset": 0.3, "unknown": 0.1}
