"""The generator of concealed recordings: its drives, the strength of what is hidden, what it writes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.core.recording.readers import read_recording
from concealed.conceal import conceal
from concealed.drives import PROTOCOLS, draw_plan
from concealed.effects import catalogue
from concealed.mechanics import Body, Ground, simulate, travel_ratio
from concealed.strength import LEVELS
from concealed.table import record
from concealed.weighing import refit_textbook, refit_with, vector, weights
from scipy.optimize import least_squares

BODY = Body(0.15, 0.12, 0.01, 12)
GROUND = Ground(c_Pa=1000.0, phi_rad=0.5, k_m=0.015, stiffness_Pa=1.5e5, n=0.9)


def test_plans_have_what_effects_need(rng):
    for _ in range(5):
        for protocol in ("bench", "field"):
            plan = draw_plan(rng, protocol, BODY, GROUND, frozenset({"speeds", "passes", "pitch", "pull"}), samples=300)
            drive = plan.drive
            assert np.exp(np.ptp(np.log(drive.wheel_speed))) > 1.8
            assert drive.passes.max() >= 3
            assert np.ptp(drive.pitch_rad) > 0.03
            assert {"pass", "pitch_rad", "drawbar_pull_N", "x_m", "time_s"} <= set(plan.columns)
            np.testing.assert_allclose(  # slip is that of the speeds
                drive.travel_speed, BODY.radius_m * drive.wheel_speed * travel_ratio(drive.slip)
            )
            starts = np.flatnonzero(np.diff(drive.passes)) + 1
            np.testing.assert_array_equal(drive.x_m[starts], 0.0)
            assert np.all(np.diff(drive.time_s) > 0.0)
            assert np.all(np.diff(drive.wheel_angle) >= 0.0)


def test_a_rig_ramps_slip_once_for_each_load_the_lightest_first(rng):
    drive = draw_plan(rng, "ramps", BODY, GROUND, frozenset({"pull"}), samples=400).drive
    starts = np.flatnonzero(np.diff(drive.lane)) + 1
    loads = [float(np.median(load)) for load in np.split(drive.load_N, starts)]
    assert len(loads) >= 3
    assert np.all(np.diff(loads) > 0.0)
    assert all(np.all(np.diff(slip) >= 0.0) and np.ptp(slip) > 0.3 for slip in np.split(drive.slip, starts))
    assert np.all(np.diff(drive.time_s)[starts - 1] >= 20.0)
    np.testing.assert_array_equal(drive.x_m[starts], 0.0)
    np.testing.assert_allclose(drive.wheel_speed, drive.wheel_speed[0])
    again = draw_plan(rng, "ramps", BODY, GROUND, frozenset({"passes", "speeds", "pitch"}), samples=400).drive
    assert all(set(again.passes[again.lane == lane]) == {1.0, 2.0, 3.0} for lane in np.unique(again.lane))
    assert np.ptp(np.log(again.wheel_speed)) > 1.0
    assert np.ptp(again.pitch_rad) > 0.03
    with pytest.raises(ValueError, match="ramps trials have no accelerations"):
        draw_plan(rng, "ramps", BODY, GROUND, frozenset({"accelerations"}))


def test_tracks_turn_and_later_passes_run_on_the_same_ground(rng):
    kinds = set()
    for again in [False] * 12 + [True] * 6:
        plan = draw_plan(rng, "turns", BODY, GROUND, frozenset({"passes"} if again else ()), samples=400)
        drive, track = plan.drive, plan.track
        assert track is not None
        kinds.add((track.kind, again))
        assert {"x_m", "y_m"} <= set(plan.columns)
        assert bool(drive.passes.max() >= 2.0) is (track.kind != "lanes")
        there = track.at(drive.x_m)
        steps = np.hypot(*np.diff(there, axis=0).T)
        gone = 0.5 * np.diff(drive.time_s) * (drive.travel_speed[1:] + drive.travel_speed[:-1])
        # The chord of a bend, or of the corner at the end of a way back, is the shorter way.
        assert np.all(steps <= gone * 1.001)
        assert np.median(steps / gone) > 0.995
        for number in range(2, int(drive.passes.max()) + 1):
            rows = drive.passes == number
            apart = there[rows][:, None] - there[drive.passes == 1.0]
            assert np.hypot(*np.moveaxis(apart, -1, 0)).min(axis=1).max() <= gone.max()
        noise = (track.recorded(rng, drive.x_m) - there).std()
        assert noise == pytest.approx(track.position_sd_m, rel=0.15, abs=1e-9)
    assert kinds >= {("lanes", False), ("rounds", False), ("rounds", True), ("back", True)}


def test_a_patch_on_a_track_that_turns_lies_where_the_track_says():
    result = conceal(101, ("soil_patch",), "plain", "turns", samples=400)
    places = result.truth["effects"][0]["places"]
    start, end = places["distance_m"]
    columns = result.recorded.columns
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(columns["x_m"]), np.diff(columns["y_m"])))])
    inside = (way > start) & (way < end) & (columns["pass"] == 1)
    assert inside.sum() > 10
    assert set(result.truth["effects"][0]["variables"]) == {"distance_m", "x_m", "y_m"}
    for name in ("x_m", "y_m"):
        low, high = places[name]
        assert np.all((columns[name][inside] > low - 0.05) & (columns[name][inside] < high + 0.05))


@pytest.mark.parametrize("level", list(LEVELS))
def test_the_strength_is_that_of_the_level(level):
    result = conceal(2, ("drivetrain_friction",), level, "bench", samples=500)
    assert result.truth["reached"]
    assert result.truth["nats"] == pytest.approx(LEVELS[level], rel=0.15)
    assert min(result.truth["textbook_r2"].values()) > 0.95


def test_nats_are_those_of_another_fit():
    """Steady trials, rows independent: nats from a variance counted over many recordings, by another optimiser."""
    result = conceal(1, ("slip_sinkage",), "hidden", "steady")
    case, effects = result.case, result.effects
    drive, rng = case.drive, np.random.default_rng(0)
    plan = draw_plan(rng, "steady", case.body, case.ground, frozenset({"pull"}))
    plan = replace(plan, drive=drive, columns=(*plan.columns, "drawbar_pull_N"))
    sensors = replace(case.sensors, gross=0.0, missing=0.0)
    misses = []
    for _ in range(150):
        soil = case.variation.of(case.ground, case.variation.draw(rng))
        varied, theta_1 = simulate(soil, case.body, drive, effects, nodes=8)
        seen = record(rng, plan, case.body, sensors, varied)
        expected, _ = simulate(
            case.ground, case.body, drive, effects, nodes=8, guess=theta_1,
            load_N=drive.load_N * seen.load_error, slip=seen.true_slip(drive),
        )  # fmt: skip
        columns = np.column_stack([seen.columns[name] for name in case.names])
        misses.append(columns - case.answers(expected))
    counted = np.var(misses, axis=0)
    _, theta_1 = simulate(case.ground, case.body, drive, effects)
    weight = weights(case, effects, result.clean, theta_1)
    ratio = (counted / weight.variance).mean(axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=0.12)

    def misfit(logs):
        ground = Ground(np.exp(logs[0]), float(np.arctan(np.exp(logs[1]))), *np.exp(logs[2:]))
        model, _ = simulate(ground, case.body, drive)
        return ((case.answers(model) - case.answers(result.clean)) / np.sqrt(counted)).ravel()

    fit = least_squares(misfit, vector(case.ground) + 0.1, x_scale="jac")
    assert fit.cost == pytest.approx(result.truth["nats"], rel=0.15)


def test_what_varies_along_the_track_is_weighed_as_it_varies():
    """Whitened misfits of the true model have unit variance in each channel, noise and soil drawn many times."""
    result = conceal(4, (), "hidden", "bench", samples=400)
    case = result.case
    _, theta_1 = simulate(case.ground, case.body, case.drive)
    weight = weights(case, (), result.clean, theta_1)
    rng = np.random.default_rng(1)
    squares = []
    for _ in range(25):
        soil = case.variation.of(case.ground, case.variation.draw(rng))
        load = case.drive.load_N + case.sensors.deviation("load_N") * rng.normal(size=400)
        slip = case.drive.slip + case.sensors.slip_deviation(case.drive) * rng.normal(size=400)
        truth, _ = simulate(soil, case.body, case.drive, nodes=8, guess=theta_1)
        model, _ = simulate(case.ground, case.body, case.drive, nodes=8, guess=theta_1, load_N=load, slip=slip)
        noise = np.array([case.sensors.deviation(name) for name in case.names]) * rng.normal(
            size=(400, len(case.names))
        )
        off = weight.whiten(case.answers(truth) + noise - case.answers(model))
        squares.append(np.mean(off.reshape(len(case.names), 400) ** 2, axis=1))
    np.testing.assert_allclose(np.mean(squares, axis=0), 1.0, atol=0.12)


def test_a_null_hides_nothing():
    result = conceal(11, (), "hidden", "field", samples=400)
    assert result.effects == ()
    assert result.truth["effects"] == []
    assert result.truth["level"] == "null"
    assert result.truth["nats"] == pytest.approx(0.0, abs=0.01)
    plain, _ = simulate(result.case.ground, result.case.body, result.case.drive)
    np.testing.assert_array_equal(result.clean.answers(), plain.answers())
    # and what the textbook leaves of the recorded rows is what was put there: noise and the soil's variation
    sound = result.recorded.sound
    off = np.column_stack([result.recorded.columns[n] - getattr(result.oracle, n) for n in result.case.names])[sound]
    _, theta_1 = simulate(result.case.ground, result.case.body, result.case.drive)
    expected = weights(result.case, (), result.clean, theta_1).variance[sound].mean(axis=0)
    assert np.all(np.mean(off**2, axis=0) / expected < 2.5)
    assert np.all(np.mean(off**2, axis=0) / expected > 0.3)


def test_both_effects_of_a_pair_are_there_beyond_each_other():
    result = conceal(5, ("torque_offset", "slip_sinkage"), "hidden", "steady")
    assert [effect["effect"] for effect in result.truth["effects"]] == ["torque_offset", "slip_sinkage"]
    assert result.truth["reached"]
    for effect in result.truth["effects"]:
        assert effect["nats_alone"] == pytest.approx(LEVELS["hidden"], rel=0.15)
        assert effect["share_beside_the_other"] > 0.3


def test_the_same_seed_makes_the_same_recording():
    one, two = (conceal(3, ("drift",), "buried", "bench", samples=200) for _ in range(2))
    assert one.truth == two.truth
    for name, values in one.recorded.columns.items():
        np.testing.assert_array_equal(values, two.recorded.columns[name])


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_recordings_are_read_and_do_not_reveal_their_effects(tmp_path, protocol):
    result = conceal(6, ("slip_sinkage",), "hidden", protocol, samples=200)
    folder = result.write(tmp_path / "recording", tmp_path / "truth")
    recording = read_recording(folder)
    assert recording.wheel is not None
    assert len(recording.wheel) == len(result.case.drive)
    assert recording.problems == ()
    assert recording.vehicle is not None
    assert recording.vehicle.wheels[0].radius_m == result.case.body.radius_m
    assert ("run" if protocol == "steady" else "time_s") in (folder / "wheel.csv").read_text().splitlines()[0].split(
        ","
    )
    np.testing.assert_allclose(recording.wheel["torque_Nm"], result.recorded.columns["torque_Nm"])
    text = " ".join(path.read_text() for path in folder.iterdir() if path.suffix == ".toml")
    assert not any(slug in text for slug in catalogue())
    assert {path.name for path in folder.iterdir()} == {"recording.toml", "vehicle.toml", "wheel.csv"}
    truth = json.loads((tmp_path / "truth" / "recording.json").read_text())
    assert truth["effects"][0]["effect"] == "slip_sinkage"
    assert set(truth["oracle_rmse"]) == set(result.case.names)


def test_the_truth_is_not_written_where_the_tool_looks(tmp_path):
    result = conceal(6, (), "hidden", "steady")
    with pytest.raises(ValueError, match="truth folder"):
        result.write(tmp_path / "a", tmp_path / "a" / "truth")


def test_soil_known_from_elsewhere_comes_with_a_slippery_rim(tmp_path):
    result = conceal(0, ("rim_adhesion",), "buried", "steady")
    folder = result.write(tmp_path / "a")
    assert result.truth["soil_known"]
    assert "phi_deg" in (folder / "soil.toml").read_text()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"effects": ("gremlins",)}, "no effect 'gremlins'"),
        ({"effects": ("drift", "drift")}, "one or two different"),
        ({"level": "loud"}, "no level 'loud'"),
        ({"protocol": "moon"}, "no protocol 'moon'"),
        ({"effects": ("drift",), "protocol": "steady"}, "cannot be seen in steady trials"),
        ({"forms": ("nonsense",)}, "no form 'nonsense'"),
    ],
)
def test_a_bad_argument_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        conceal(0, **given)


def test_refitting_finds_the_soil_of_a_null():
    result = conceal(7, (), "hidden", "steady")
    _, theta_1 = simulate(result.case.ground, result.case.body, result.case.drive)
    weight = weights(result.case, (), result.clean, theta_1)
    fit = refit_textbook(
        result.case, result.clean, weight, vector(result.case.ground) + np.array([0.3, -0.1, 0.3, 0.2, 0.1])
    )
    assert fit.nats < 0.5


def test_refitting_with_the_effect_itself_leaves_nothing():
    """The fit with soil and magnitude, of an effect and of a fault of the inputs."""
    for slug in ("load_gain", "bulldozing"):
        result = conceal(1, (slug,), "hidden", "steady")
        _, theta_1 = simulate(result.case.ground, result.case.body, result.case.drive, result.effects)
        weight = weights(result.case, result.effects, result.clean, theta_1)
        effect = result.effects[0]
        near = effect.scaled(0.8 * effect.magnitude)
        fit, magnitude = refit_with(result.case, result.clean, weight, near, vector(result.case.ground) + 0.01)
        assert fit.nats < 1.0
        assert magnitude == pytest.approx(effect.magnitude, rel=0.1)
