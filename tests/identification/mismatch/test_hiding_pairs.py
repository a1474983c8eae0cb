"""Two effects of which either hides the other: little alone, much together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Recording, SoilKnowledge, Vehicle, Wheel, WheelTable, explain
from bevameter.identification.effects.catalogue import SLUGS, effects_for
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import ASKED_FOR, Trial, situation, textbook_trial, try_adding
from bevameter.identification.mismatch.name.hiding_pairs import hiding_pairs, pairs_beside_better_fits, pairs_of_weak
from bevameter.identification.mismatch.name.tries import Tries
from bevameter.identification.simulate import simulate
from concealed.conceal import conceal

NOISE = {"load_N": 0.2, "torque_Nm": 0.018, "slip": 0.0014, "sinkage_m": 2.4e-4, "drawbar_pull_N": 0.05}
VEHICLE = Vehicle(wheels=(Wheel(radius_m=0.09, width_m=0.066),), noise=NOISE)
SOIL = SoilKnowledge({"c_Pa": 570.0, "phi_rad": 0.488, "k_m": 0.0082, "stiffness_Pa": 7.2e4, "n": 0.72})
FLATTENS, RUBS = "tyre_deflection:form=circle,compliance=7e-5", "drivetrain_friction:form=coulomb,T_c=0.055"


def trials(*effects: str) -> Recording:
    """A table of 105 steady trials of five loads, in no order, with the sensors' noise."""
    rng = np.random.default_rng(34)
    load = rng.permutation(np.tile([10.5, 19.0, 27.0, 35.5, 43.5], 21))
    slip = rng.uniform(0.03, 0.7, len(load))
    names = np.array([f"t{number}" for number in range(len(load))])
    drive = WheelTable({"load_N": load, "slip": slip}, None, names, Path("table.csv"))
    answers = simulate(VEHICLE, SOIL, drive, effects)
    noisy = {name: answers[name] + sd * rng.normal(size=len(load)) for name, sd in NOISE.items()}
    table = WheelTable(noisy, None, names, Path("table.csv"))
    return Recording("table", Path("table.csv"), VEHICLE, None, "", "0" * 64, wheel=table)


def tries_of(recording: Recording, *slugs: str) -> Tries:
    rows = felt_rows(recording)
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))
    return Tries(problem, textbook, effects_for(situation(problem, textbook.fitted), slugs or SLUGS), lambda _: None)


def alone_in(tries: Tries) -> list[Trial]:
    return [try_adding(tries.problem, tries.textbook, tries.textbook, effect) for effect in tries.catalogue]


def test_two_effects_are_come_upon_of_which_neither_is_asked_for_alone():
    tries = tries_of(trials(FLATTENS, RUBS), "tyre_deflection", "drivetrain_friction")
    alone = alone_in(tries)
    assert max(trial.gain for trial in alone) < ASKED_FOR
    (pair,) = hiding_pairs(tries, alone, tries.textbook)
    assert pair.slugs == {"tyre_deflection", "drivetrain_friction"}
    assert pair.gain > 3.0 * ASKED_FOR
    assert pair in tries.trials


@pytest.mark.parametrize("effects", [(), (FLATTENS,), (RUBS,)])
def test_no_pair_is_fitted_where_one_effect_or_none_is_there(effects):
    tries = tries_of(trials(*effects), "tyre_deflection", "drivetrain_friction", "torque_offset")
    alone = alone_in(tries)
    best = max(alone, key=lambda trial: trial.gain)
    assert (best.gain > 10.0 * ASKED_FOR) == bool(effects)
    assert hiding_pairs(tries, alone, best if effects else tries.textbook) == []


def test_both_are_named_or_listed():
    answer = explain(trials(FLATTENS, RUBS))
    assert answer.verdict == "physics"
    listed = {slug for each in answer.missing for slug in (each.effect, *each.indistinguishable_from)}
    assert {"tyre_deflection", "drivetrain_friction"} <= listed
    flattens = next(each for each in answer.missing if each.effect == "tyre_deflection")
    assert abs(flattens.parameters["compliance"].value - 7e-5) < 3.0 * flattens.parameters["compliance"].sd


def test_two_effects_are_told_of_which_each_gains_nearly_what_is_asked(tmp_path):
    """A concealed pair of 103 nats by the generator's reckoning, which knows how little the ground varies."""
    made = conceal(793800, ("multipass_compaction", "hard_layer"), "buried", protocol="steady")
    folder = made.write(tmp_path / "made")
    tries = tries_of(open_recording(folder, None), "multipass_compaction", "hard_layer")
    alone = alone_in(tries)
    assert max(trial.gain for trial in alone) < ASKED_FOR
    pairs = pairs_of_weak(tries, alone)
    assert max(trial.gain for trial in pairs) > 2.0 * ASKED_FOR
    assert tries.trials == pairs
    assert {each.effect for each in explain(folder).missing} == {"multipass_compaction", "hard_layer"}


def test_of_nothing_or_of_one_weak_effect_no_pair_is_made():
    tries = tries_of(trials(), "tyre_deflection", "drivetrain_friction", "torque_offset")
    assert pairs_of_weak(tries, alone_in(tries)) == []
    assert tries.trials == []


def test_a_hump_is_sought_beside_what_fits_better_and_foretells_no_better():
    """A wheel larger than stated and a hump: the soil makes up for either, and neither foretells slips held out."""
    tries = tries_of(trials("rolling_radius:e=0.05", "shear_hump:K_r=0.95"), "rolling_radius", "shear_hump")
    alone = alone_in(tries)
    assert max(trial.gain for trial in alone) < ASKED_FOR
    pairs = pairs_beside_better_fits(tries, alone)
    best = max(pairs, key=lambda trial: trial.gain)
    assert best.slugs == {"rolling_radius", "shear_hump"}
    assert best.gain > 3.0 * ASKED_FOR
    answer = explain(trials("rolling_radius:e=0.05", "shear_hump:K_r=0.95"))
    assert answer.verdict == "physics"
    assert {each.effect for each in answer.missing} == {"rolling_radius", "shear_hump"}
    assert (
        abs(next(each for each in answer.missing if each.effect == "rolling_radius").parameters["e"].value - 0.05)
        < 0.02
    )


def test_beside_what_fits_no_better_than_noise_no_hump_is_sought(monkeypatch):
    tries = tries_of(trials(), "rolling_radius", "shear_hump", "hard_layer", "drift")
    alone = alone_in(tries)
    score = tries.textbook.fitted.score
    assert all(trial.fitted.score < score + 5.0 + len(trial.effects[0].parameters) for trial in alone)
    assert pairs_beside_better_fits(tries, alone) == []
    # One that fits better by what its parameter gains of noise is no reason either.
    asked: list[Trial] = []
    monkeypatch.setattr(Tries, "weigh", lambda _, base, effects: asked.append(base) or [])
    (radius,) = [trial for trial in alone if trial.slugs == {"rolling_radius"}]
    for more, sought in ((5.5, 0), (6.5, 1)):
        better = replace(radius, fitted=replace(radius.fitted, score=score + more))
        assert pairs_beside_better_fits(tries, [better]) == []
        assert len(asked) == sought
