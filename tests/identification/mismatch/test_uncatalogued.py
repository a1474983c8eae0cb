"""A constant fault of a sensor that the catalogue lacks is said to be one, and nothing of the catalogue stands in."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, Recording, SoilKnowledge, Vehicle, Wheel, WheelTable, explain
from bevameter.identification.effects.named import parse_effect
from bevameter.identification.effects.stored import AugmentedSimulator
from bevameter.identification.mismatch.explanation import to_json
from bevameter.identification.mismatch.show.headline import verdict
from bevameter.identification.simulate import simulate

SENSORS = {"load_N": 0.4, "slip": 0.002, "torque_Nm": 0.05, "sinkage_m": 1.5e-4, "drawbar_pull_N": 0.3}
VEHICLE = Vehicle(wheels=(Wheel(radius_m=0.15, width_m=0.12),))
SOIL = SoilKnowledge({"c_Pa": 900.0, "phi_rad": 0.56, "k_m": 0.012, "stiffness_Pa": 2.5e5, "n": 0.9})


def trials(fault=lambda table: {}, *effects: str) -> Recording:
    """A table of 60 steady trials of three loads and ten slips, two of each; `fault` changes what sensors report."""
    rng = np.random.default_rng(8)
    load, slip = (np.tile(each.ravel(), 2) for each in np.meshgrid([60.0, 90.0, 120.0], np.linspace(0.05, 0.6, 10)))
    drive = WheelTable({"load_N": load, "slip": slip}, None, np.arange(60).astype(str), Path("table.csv"))
    true = dict(simulate(VEHICLE, SOIL, drive, effects).columns)
    reported = true | fault(true)
    noisy = {name: reported[name] + sd * rng.normal(size=len(load)) for name, sd in SENSORS.items()}
    table = WheelTable(noisy, None, drive.run, Path("table.csv"))
    return Recording("table", Path("table.csv"), VEHICLE, None, "", "0" * 64, wheel=table)


FAULTS = {
    "zero of drawbar_pull_N": ("DP_0", 4.0, lambda true: {"drawbar_pull_N": true["drawbar_pull_N"] + 4.0}),
    "gain of drawbar_pull_N": ("g", -0.15, lambda true: {"drawbar_pull_N": true["drawbar_pull_N"] * 0.85}),
    "zero of load_N": ("W_0", 9.0, lambda true: {"load_N": true["load_N"] + 9.0}),
    "drawbar_pull_N in torque_Nm": (
        "l",
        0.03,
        lambda true: {"torque_Nm": true["torque_Nm"] + 0.03 * true["drawbar_pull_N"]},
    ),
    "drawbar_pull_N in sinkage_m": (
        "c",
        1e-4,
        lambda true: {"sinkage_m": true["sinkage_m"] + 1e-4 * true["drawbar_pull_N"]},
    ),
}


@pytest.mark.parametrize("form", FAULTS)
def test_a_fault_that_the_catalogue_lacks_is_named_for_what_it_is_like(form):
    name, size, fault = FAULTS[form]
    answer = explain(trials(fault))
    assert answer.verdict == "unknown"
    (found,) = answer.missing
    assert (found.effect, found.kind, found.form) == ("unknown", "unknown", form)
    assert found.probability > 0.9
    estimate = found.parameters[name]
    assert abs(estimate.value - size) < 4.0 * estimate.sd
    assert estimate.sd < 0.2 * abs(size)
    assert found.description in answer.summary
    assert found.would_tell
    assert f"nothing in the catalogue explains it as well as {found.description}" in verdict(answer)
    assert min(fit.rmse_after / fit.rmse_before for fit in answer.fits.values()) < 0.5
    # The simulator that was found is kept with it, and reports as the sensor does.
    kept = AugmentedSimulator.from_json(json.loads(json.dumps(answer.physics.to_json())))
    assert [(effect.slug, effect.form) for effect in kept.effects] == [("unknown", form)]
    assert to_json(answer)["missing"][0]["effect"] == "unknown"


@pytest.mark.parametrize("end_Nm", [5.0, 6.0])
def test_a_torque_that_saturates_is_named_for_it(end_Nm):
    answer = explain(trials(lambda true: {"torque_Nm": end_Nm * np.tanh(true["torque_Nm"] / end_Nm)}))
    assert answer.verdict == "unknown"
    assert [each.form for each in answer.missing if each.parameters] == ["torque_Nm saturates softly"]


CATALOGUE = {
    "torque_gain": ((), lambda true: {"torque_Nm": true["torque_Nm"] * 1.2}),
    "sinkage_offset": ((), lambda true: {"sinkage_m": true["sinkage_m"] + 0.004}),
    "slip_sinkage": (("slip_sinkage:n1=0.3",), lambda true: {}),
    "bulldozing": (("bulldozing:share=1.0",), lambda true: {}),
}


@pytest.mark.parametrize("slug", CATALOGUE)
def test_what_the_catalogue_has_is_not_taken_for_one(slug):
    effects, fault = CATALOGUE[slug]
    answer = explain(trials(fault, *effects))
    listed = {name for each in answer.missing for name in (each.effect, *each.indistinguishable_from)}
    assert slug in listed
    assert "unknown" not in {each.effect for each in answer.missing}


def test_where_nothing_is_wrong_nothing_is_found():
    assert explain(trials()).verdict == "none"


def test_physics_is_named_beside_such_a_fault():
    answer = explain(trials(FAULTS["zero of drawbar_pull_N"][2], "slip_sinkage:n1=0.3"))
    found = {(each.effect, each.form): each for each in answer.missing}
    assert ("unknown", "zero of drawbar_pull_N") in found
    assert max(each.probability for (slug, _), each in found.items() if slug == "slip_sinkage") > 0.9
    assert answer.verdict == "unknown"
    assert "beside that is slip-sinkage (" in verdict(answer)


def test_a_fault_beside_physics_is_found_on_ground_that_seems_to_vary():
    """Along a ramp of slip ground that varies makes up for what a law leaves out: it is sought in quiet ground, too."""
    rng = np.random.default_rng(2)
    time_s = np.arange(300) / 10.0
    load, slip = 100.0 + 25.0 * np.sin(0.7 * time_s), 0.3 + 0.25 * np.sin(0.13 * time_s)
    drive = WheelTable({"time_s": time_s, "load_N": load, "slip": slip}, None, None, Path("drive.csv"))
    true = dict(simulate(VEHICLE, SOIL, drive, ["slip_sinkage:n1=0.3"]).columns)
    true["drawbar_pull_N"] = true["drawbar_pull_N"] + 8.0
    noisy = {name: true[name] + sd * rng.normal(size=300) for name, sd in SENSORS.items()}
    table = WheelTable({"time_s": time_s, **noisy}, None, None, Path("drive.csv"))
    answer = explain(Recording("drive", Path("drive.csv"), VEHICLE, None, "", "0" * 64, wheel=table))
    assert {"unknown", "slip_sinkage"} <= {each.effect for each in answer.missing}


def runs(zeros: dict[str, list[float]], *effects: str) -> Recording:
    """Runs of 80 rows each of a load and a sweep of slip of its own, with another zero of some sensors in each."""
    rng = np.random.default_rng(5)
    count = max(map(len, zeros.values()), default=5)
    number = np.repeat(np.arange(count), 80)
    along = np.tile(np.linspace(0.0, 1.0, 80), count)
    time_s = np.arange(80 * count) / 10.0 + 30.0 * number
    load = np.take([70.0, 110.0, 90.0], number % 3) * (1.0 + 0.2 * np.sin(9.0 * along + number))
    slip = np.where(number % 2, 0.55 - 0.5 * along, 0.05 + 0.5 * along)
    drive = WheelTable({"time_s": time_s, "load_N": load, "slip": slip}, None, number.astype(str), Path("runs.csv"))
    true = dict(simulate(VEHICLE, SOIL, drive, effects).columns)
    shift = {name: np.array(values)[number] for name, values in zeros.items()}
    noisy = {name: true[name] + shift.get(name, 0.0) + sd * rng.normal(size=len(load)) for name, sd in SENSORS.items()}
    table = WheelTable({"time_s": time_s, **noisy}, None, drive.run, Path("runs.csv"))
    return Recording("runs", Path("runs.csv"), VEHICLE, None, "", "0" * 64, wheel=table)


Z_0 = [4e-4, -3e-4, 5e-4, -6e-4, 1e-4]


def test_zeros_that_differ_from_run_to_run_are_told_and_what_is_beside_them():
    answer = explain(runs({"sinkage_m": Z_0}, "slip_sinkage:n1=0.3"))
    found = {(each.effect, each.form): each for each in answer.missing}
    zeros = found["unknown", "zeros of sinkage_m by run"]
    assert zeros.probability > 0.9
    assert zeros.description == "zeros of the sensors of sinkage that differ from run to run"
    estimates = [zeros.parameters[f"z_0 of run {number + 1}"] for number in range(5)]
    assert all(abs(each.value - size) < 4.0 * each.sd for each, size in zip(estimates, Z_0, strict=True))
    assert max(each.sd for each in estimates) < 1.5e-4
    assert max(each.probability for (slug, _), each in found.items() if slug == "slip_sinkage") > 0.9
    assert "z_0 of run 3" in answer.summary
    assert "2 more parameters" in answer.summary
    # Another drive's zeros nobody knows: what is kept foretells none.
    assert answer.physics is not None
    assert {effect.slug for effect in answer.physics.effects} == {"slip_sinkage"}
    assert len(answer.physics.correlation) == 5 + sum(len(effect.parameters) for effect in answer.physics.effects)


def test_zeros_of_several_sensors_are_one_fault():
    answer = explain(runs({"sinkage_m": Z_0, "drawbar_pull_N": [1.5, -1.0, 0.5, 2.0, -1.8]}))
    (found,) = answer.missing
    assert found.form == "zeros of torque_Nm, sinkage_m, drawbar_pull_N by run"
    assert answer.verdict == "unknown"


def test_a_zero_for_each_run_does_not_stand_in_for_what_the_catalogue_has():
    answer = explain(runs({}, "slip_sinkage:n1=0.3"))
    assert answer.verdict == "physics"
    assert "unknown" not in {each.effect for each in answer.missing}


def test_runs_as_many_as_blocks_tell_their_own_zeros():
    answer = explain(runs({"sinkage_m": [*Z_0, *Z_0[::-1], 2e-4, -2e-4]}))
    (found,) = answer.missing
    assert found.form == "zeros of sinkage_m by run"
    assert not any("crossed once" in note for note in answer.notes)


def test_a_slope_that_is_stated_and_the_same_everywhere_is_no_fault():
    def sloped(true):
        return {"drawbar_pull_N": true["drawbar_pull_N"] - true["load_N"] * np.sin(0.0873)}

    recording = trials(sloped)
    assert recording.wheel is not None
    pitched = {**recording.wheel.columns, "pitch_rad": np.full(60, 0.0873)}
    wheel = WheelTable(pitched, None, recording.wheel.run, recording.wheel.source)
    answer = explain(Recording("table", Path("table.csv"), VEHICLE, None, "", "0" * 64, wheel=wheel))
    listed = {name for each in answer.missing for name in (each.effect, *each.indistinguishable_from)}
    assert "slope_gravity" in listed
    assert answer.verdict != "unknown"


def test_what_the_catalogue_lacks_is_not_asked_for_by_name():
    with pytest.raises(InputError, match="unknown"):
        parse_effect("unknown:DP_0=5")
