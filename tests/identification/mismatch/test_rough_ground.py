"""Ground that varies much makes up for what a law leaves out, along a ramp of slip most of all."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from bevameter import InputError
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mismatch.fit.fitting import Problem
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import Trial, situation, textbook_trial
from bevameter.identification.mismatch.name import search as module
from bevameter.identification.mismatch.name.asked import rests_on_ground, standing, surplus, worth
from bevameter.identification.mismatch.name.evidence import leaves_to_ground, outdone, warranted
from bevameter.identification.mismatch.name.naming import name, why_not
from bevameter.identification.mismatch.name.search import _as_in_quiet_ground, _forms_of, _proposed
from bevameter.identification.mismatch.name.tries import Search, Tries
from concealed.conceal import conceal
from effects_tried import SITUATION


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Problem, Trial]:
    folder = conceal(7110, ("slip_sinkage",), "hidden", "bench").write(tmp_path_factory.mktemp("recording"))
    rows = felt_rows(open_recording(folder, None))
    return textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))


@pytest.fixture(scope="module")
def textbook(recorded) -> Trial:
    return recorded[1]


@pytest.fixture(scope="module")
def made(textbook):
    """Trials of other gains, grounds and errors: those of the textbook wheel, times so much."""
    effects = {effect.name: effect for effect in effects_for(SITUATION)}

    def trial(names: tuple[str, ...], gain: float, spread: float, errors: float) -> Trial:
        noise = replace(textbook.fitted.noise, spread=np.full(2, spread))
        held_out = replace(textbook.held_out, residuals=errors * textbook.held_out.residuals)
        fitted = replace(textbook.fitted, noise=noise)
        chosen = tuple(effects[name] for name in names)
        return replace(textbook, effects=chosen, gain=gain, fitted=fitted, held_out=held_out)

    return trial


LOAD, SINKS, BOTH = ("load_gain",), ("slip_sinkage[exponent]",), ("slip_sinkage[exponent]", "load_gain")


def test_what_explains_the_ground_that_varies_need_not_gain_more(made):
    rough, quiet = made(LOAD, 500.0, 0.2, 1.0), made(BOTH, 300.0, 0.09, 0.49)
    assert rests_on_ground(rough, quiet)
    assert not rests_on_ground(quiet, rough)
    assert surplus(rough, quiet) == 288.0
    assert surplus(quiet, made((*BOTH, "torque_gain"), 900.0, 0.2, 1.0)) == -math.inf
    # Neither where errors are more than half, nor where the ground varies nearly as much, or little.
    for other in (made(BOTH, 300.0, 0.09, 0.51), made(BOTH, 300.0, 0.11, 0.49)):
        assert not rests_on_ground(rough, other)
        assert surplus(rough, other) == pytest.approx(-225.0)
    assert not rests_on_ground(made(LOAD, 500.0, 0.09, 1.0), made(SINKS, 300.0, 0.02, 0.1))
    # A channel that is predicted without errors says nothing.
    held = quiet.held_out.residuals.copy()
    held[:, 1] = 0.0
    assert rests_on_ground(rough, replace(quiet, held_out=replace(quiet.held_out, residuals=held)))


def test_what_rests_on_the_ground_has_no_say_and_much_more_of_it_is_doubt(made, textbook):
    rough, quiet = made(LOAD, 305.0, 0.2, 1.0), made(BOTH, 300.0, 0.05, 0.3)
    found = Search(textbook, (rough, quiet), (), quiet)
    assert warranted(found, 1.0) is found
    assert why_not(rough, found, 1.0) == "leaves to ground that varies by 20 % (not 5 %) what the chosen set explains"
    weights = name(found, 0.0).weights
    assert weights[0] == 0.0
    assert weights[1] > 0.9
    assert not outdone(found, 1.0)
    # Without ground that is rough one effect of five nats less would do.
    alike = Search(textbook, (made(LOAD, 305.0, 0.05, 0.3), quiet), (), quiet)
    assert warranted(alike, 1.0).chosen.slugs == {"load_gain"}
    more = Search(textbook, (made(LOAD, 330.0, 0.2, 1.0), quiet), (), quiet)
    assert outdone(more, 1.0)
    assert not outdone(more, 10.0)
    assert not outdone(Search(textbook, (made(LOAD, 330.0, 0.05, 0.3), quiet), (), quiet), 1.0)
    assert not leaves_to_ground(more)
    assert leaves_to_ground(replace(more, chosen=more.trials[0]))
    assert not leaves_to_ground(Search(textbook, (rough, made(BOTH, 9.0, 0.05, 0.3)), (), rough))


def test_a_set_that_leaves_to_the_ground_what_another_explains_does_not_take_its_place(made, recorded):
    quiet, rough = made(BOTH, 300.0, 0.05, 0.3), made(("torque_gain", "load_gain"), 345.0, 0.2, 1.0)
    assert standing(quiet, [rough, quiet]) == [quiet]
    # What explains the ground goes before what merely gains more, but it has to gain something.
    best, larger = made(LOAD, 250.0, 0.2, 1.0), made(("torque_gain", "load_gain"), 900.0, 0.2, 1.0)
    assert max([larger, quiet], key=partial(worth, best)) is quiet
    assert surplus(best, made(BOTH, 3.0, 0.05, 0.3)) < 0.0
    # Of what it does not predict nothing is known.
    few = quiet.held_out.residuals.copy()
    few[: len(few) // 5] = np.nan
    assert not rests_on_ground(rough, replace(quiet, held_out=replace(quiet.held_out, residuals=few)))
    tries = Tries(*recorded, (), print, [rough, quiet])
    assert tries.ended(quiet).chosen is quiet


@pytest.fixture(scope="module")
def ramps(tmp_path_factory) -> Tries:
    hidden = ("slip_sinkage", "torque_offset")
    folder = conceal(770004, hidden, "plain", "ramps", samples=600).write(tmp_path_factory.mktemp("recording"))
    rows = felt_rows(open_recording(folder, None))
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))
    few = effects_for(situation(problem, textbook.fitted), [*hidden, "load_gain", "time_lag"])
    return Tries(problem, textbook, few, lambda _: None)


def test_sets_are_sought_in_quiet_ground_by_some_of_the_rows_and_judged_on_all(ramps):
    assert ramps.textbook.fitted.noise.spread.max() > 0.1
    proposed = _proposed(ramps)
    assert proposed[0].slugs == {"slip_sinkage", "torque_offset"}
    assert all(len(trial.fitted.theta_1) == 500 and trial.fitted.noise.spread.max() <= 0.03 for trial in proposed)
    assert len({trial.slugs for trial in proposed}) == len(proposed)
    found = _as_in_quiet_ground(ramps, ramps.textbook)
    assert found.slugs == {"slip_sinkage", "torque_offset"}
    assert len(found.fitted.theta_1) == len(ramps.problem.samples) > 590
    forms = [form for effect in ramps.catalogue for form in _forms_of(effect)]
    assert len(found.names.intersection(form.name for form in forms)) == 2
    # A form found only by further parameters of a catalogue's form is one that all rows offer, too.
    squared = [form for form in forms if form.name == "slip_sinkage[exponent, squared]"]
    assert len(squared) == 1
    assert squared[0] not in ramps.catalogue
    assert rests_on_ground(ramps.textbook, found)


def test_where_some_of_the_rows_do_not_tell_nothing_is_proposed(ramps, monkeypatch):
    samples = ramps.problem.samples
    kept = np.linspace(0, len(samples) - 1, 500).round().astype(int)
    measured = samples.measured.copy()
    measured[kept, 2] = np.nan
    fewer = replace(ramps, problem=Problem(replace(samples, measured=measured)))
    assert 2 in fewer.problem.samples.answers
    assert _proposed(fewer) == []

    def refused(*_):
        raise InputError("column load_N", "no soil carries 9 N", expected="newtons")

    monkeypatch.setattr(module, "textbook_trial", refused)
    assert _as_in_quiet_ground(ramps, ramps.textbook) is ramps.textbook
