"""Synthetic drives that conceal a cause: it acts where it is said to, and nothing but `truth.json` tells."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.scenario.concealed import Concealed, strength
from bevameter.framework.scenario.plan import Plan, make_plan
from bevameter.framework.scenario.presets import PRESETS
from bevameter.framework.scenario.wheels import RUT_STIFFENING, WheelRows, physics_of, wheel_rows
from bevameter.framework.scenario.write import write_scenario
from bevameter.identification.effects.catalogue import forms_by_name
from bevameter.identification.effects.parse import specimen

CONCEALING = tuple(name for name, preset in PRESETS.items() if preset.concealed)
CHANNELS = ("load_N", "torque_Nm", "sinkage_m", "drawbar_pull_N")


def with_and_without(name: str, seed: int = 0) -> tuple[Plan, WheelRows, WheelRows]:
    """A drive, and the same without what it conceals."""
    plan = make_plan(PRESETS[name], seed)
    return plan, wheel_rows(plan), wheel_rows(replace(plan, preset=replace(plan.preset, concealed=())))


def changed(rows: WheelRows, plain: WheelRows) -> set[str]:
    return {name for name in CHANNELS if not np.array_equal(rows.recorded[name], plain.recorded[name])}


def ground_under(plan: Plan, rows: WheelRows) -> np.ndarray:
    """Class of ground under each row's wheel."""
    ahead = np.array([plan.preset.vehicle.wheel(name).position_m[0] for name in rows.wheel.tolist()])
    number = plan.stretch_at(plan.at(plan.way_m, rows.true["time_s"]) + ahead)
    return np.array([stretch.terrain for stretch in plan.stretches])[number]


def test_each_is_a_short_drive_of_wheels_over_three_soils() -> None:
    assert CONCEALING == ("slip-sinkage", "sand-bulldozing", "load-gain", "torque-zero", "drivetrain-friction")
    for name in CONCEALING:
        preset = PRESETS[name]
        assert len({leg.terrain for leg in preset.legs}) == 3
        assert 100.0 <= preset.duration_s <= 150.0
        assert len(preset.concealed) == 1
        assert (
            preset.camera_rate_Hz is preset.sound_rate_Hz is preset.vehicle.camera is preset.vehicle.microphone is None
        )
    assert len({PRESETS[name].recorded_as for name in CONCEALING}) == len(CONCEALING)


@pytest.mark.parametrize("name", CONCEALING)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_soils_carry_the_wheels(name: str, seed: int) -> None:
    rows = wheel_rows(make_plan(PRESETS[name], seed))
    assert all(np.isfinite(values).all() for values in rows.true.values())
    radius = PRESETS[name].vehicle.wheels[0].radius_m
    assert rows.true["sinkage_m"].max() < 0.5 * radius


def test_slip_sinkage_grows_with_slip_on_all_ground() -> None:
    plan, rows, plain = with_and_without("slip-sinkage")
    assert changed(rows, plain) == {"torque_Nm", "sinkage_m", "drawbar_pull_N"}
    deeper = rows.true["sinkage_m"] / plain.true["sinkage_m"]
    slow = rows.true["travel_speed_m_s"] < 0.3
    for terrain in ("sand", "loam", "clay"):
        here = slow & (ground_under(plan, rows) == terrain)
        assert np.corrcoef(rows.true["slip"][here], deeper[here])[0, 1] > 0.9
        assert 1.2 < deeper[here].max() < 2.0
        assert deeper[here].min() == pytest.approx(1.0, abs=0.05)


def test_bulldozing_costs_pull_on_sand_only() -> None:
    plan, rows, plain = with_and_without("sand-bulldozing")
    assert changed(rows, plain) == {"drawbar_pull_N"}
    lost = plain.true["drawbar_pull_N"] - rows.true["drawbar_pull_N"]
    sand = ground_under(plan, rows) == "sand"
    assert np.all(lost[~sand] == 0.0)
    assert lost[sand].mean() > 4.0 * plan.preset.vehicle.noise["drawbar_pull_N"]
    assert lost[sand].max() < 0.15 * rows.true["load_N"][sand].max()


def test_load_gain_is_in_what_is_recorded_only() -> None:
    _, rows, plain = with_and_without("load-gain")
    assert changed(rows, plain) == {"load_N"}
    for name, values in plain.true.items():
        np.testing.assert_array_equal(rows.true[name], values)
    np.testing.assert_allclose(rows.recorded["load_N"] - plain.recorded["load_N"], 0.12 * plain.true["load_N"])


def test_torque_zero_is_that_of_one_wheel() -> None:
    _, rows, plain = with_and_without("torque-zero")
    assert changed(rows, plain) == {"torque_Nm"}
    off = rows.recorded["torque_Nm"] - plain.recorded["torque_Nm"]
    np.testing.assert_allclose(off, np.where(rows.wheel == "front_left", -9.0, 0.0), atol=1e-9)
    np.testing.assert_array_equal(rows.true["torque_Nm"], plain.true["torque_Nm"])


def test_friction_is_constant_and_viscous_on_all_wheels() -> None:
    plan, rows, plain = with_and_without("drivetrain-friction")
    assert changed(rows, plain) == {"torque_Nm"}
    values = plan.preset.concealed[0].values
    lost = rows.true["torque_Nm"] - plain.true["torque_Nm"]
    np.testing.assert_allclose(lost, values["T_c"] + values["b_v"] * rows.true["wheel_speed_rad_s"])
    assert lost.mean() < 0.4 * plain.true["torque_Nm"].mean()


@pytest.mark.parametrize("name", CONCEALING)
def test_only_the_truth_tells(name: str, tmp_path) -> None:
    folder = write_scenario(name, tmp_path / "drive", seed=1, duration_s=30.0)
    assert sorted(path.name for path in folder.iterdir()) == [
        "labels.csv", "pose.csv", "recording.toml", "truth.json", "vehicle.toml", "wheel.csv",
    ]  # fmt: skip
    told = json.loads((folder / "truth.json").read_text(encoding="utf-8"))["concealed"]
    assert told[0] == PRESETS[name].concealed[0].truth()
    words = {word for word in re.split(r"\W", f"{name} {told[0]['effect'].replace('_', ' ')} conceal") if len(word) > 3}
    for file in ("recording.toml", "vehicle.toml", "labels.csv"):
        text = (folder / file).read_text(encoding="utf-8").lower()
        text = "\n".join(line for line in text.splitlines() if not re.match(r"load_n|torque_nm|slip|sinkage_m", line))
        assert not {word for word in words - {"sand"} if word in text}, file
    recording = read_recording(folder)
    assert recording.problems == ()
    assert recording.name.startswith("exercise-")
    assert recording.labels is not None
    assert "truth.json" in (folder / "recording.toml").read_text(encoding="utf-8")


def test_places_where_causes_act() -> None:
    causes = (
        Concealed("bulldozing", {"share": 1.0}, terrain="sand"),
        Concealed("torque_offset", {"T_0": 2.0}, wheel="front_left"),
    )
    assert [cause.truth()["where"] for cause in causes] == [{"class": "sand"}, {"wheel": "front_left"}]
    assert strength(causes, "bulldozing", "share", terrain="sand", wheel="front_left") == 1.0
    assert strength(causes, "bulldozing", "share", terrain="loam", wheel="front_left") == 0.0
    assert strength(causes, "torque_offset", "T_0", wheel="front_left") == 2.0
    assert strength(causes, "torque_offset", "T_0", wheel="rear_left") == 0.0


@pytest.mark.parametrize("name", PRESETS)
def test_the_catalogue_has_what_is_concealed(name: str) -> None:
    preset = PRESETS[name]
    for cause in (*preset.concealed, *physics_of(preset.vehicle)):
        named = [{each.name for each in form.parameters} for form in forms_by_name(cause.effect, specimen())]
        assert set(cause.values) in named, cause.effect


@pytest.mark.parametrize("name", PRESETS)
def test_every_vehicle_has_inertia_and_those_of_two_axles_make_ruts(name: str) -> None:
    vehicle = PRESETS[name].vehicle
    told = {cause.effect: cause.values for cause in physics_of(vehicle)}
    assert set(told) == {"inertia", "multipass_compaction"} if len(vehicle.wheels) > 1 else {"inertia"}
    assert set(told["inertia"]) == {"J", "m"}
    if len(vehicle.wheels) > 1:
        rut = told["multipass_compaction"]
        assert np.exp(rut["A"] * -np.expm1(-1.0 / rut["N0"])) == pytest.approx(RUT_STIFFENING)
