from __future__ import annotations

import gzip
from dataclasses import replace

import numpy as np
import pytest
from bevameter.audio.vibration import classify_vibration, vibration_evidence
from bevameter.audio.vibration_augment import FAULTS, ratio_dB
from bevameter.audio.vibration_features import VibrationChannels, vibration_features
from bevameter.audio.vibration_train import train_vibration
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.classifier.signal_to_noise import NOISE_FREE_DB
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.vibration import read_vibration_run

AXES = ("wx", "wy", "ax", "az")


def write_run(folder, name, kind, rng, seconds=25.0, wheels=True, speed=0.5):
    """A run over ground that shakes strongly and low (rough) or weakly and high (smooth)."""
    time = np.arange(0, seconds, 0.01)
    noise = rng.normal(size=(time.size, len(AXES)))
    if kind == "rough":
        noise = 4 * np.apply_along_axis(np.convolve, 0, noise, np.ones(8) / 8, "same")
    values = noise * rng.uniform(0.7, 1.3) + [0, 0, 0, 9.81]
    with gzip.open(folder / f"imu_{name}.csv.gz", "wt") as file:
        np.savetxt(file, np.column_stack([time, values]), "%.6g", ",", header=",".join(("time", *AXES)), comments="")
    if wheels:
        time = np.arange(0, seconds, 0.15)
        current = rng.normal(12 if kind == "rough" else 6, 1, (time.size, 2))
        table = np.column_stack([time, current, np.full((time.size, 2), speed)])
        np.savetxt(folder / f"pro_{name}.csv", table, "%.6g", ",", header="time,curL,curR,velL,velR", comments="")


@pytest.fixture(scope="module")
def labelled(tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("vibration"), np.random.default_rng(1)
    lines = ["file,class,group,wheel_file"]
    for index in range(12):
        kind = ("rough", "smooth")[index % 2]
        write_run(folder, index, kind, rng, speed=0.5 if index < 6 else 0.0)
        lines.append(f"imu_{index}.csv.gz,{kind},run {index},pro_{index}.csv")
    (folder / "index.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="module")
def outcome(labelled):
    return train_vibration(read_labelled(labelled), np.random.default_rng(2))


def test_a_class_without_a_window_is_named(labelled):
    runs = [replace(item, start_s=24.99) if item.class_name == "smooth" else item for item in read_labelled(labelled)]
    with pytest.raises(InputError, match=r"imu_1\.csv\.gz: no window of class 'smooth'"):
        train_vibration(runs, np.random.default_rng(2))


def test_a_speed_of_zero_is_missing_and_not_standstill(labelled):
    moving, unknown = (read_vibration_run(labelled / f"imu_{i}.csv.gz", labelled / f"pro_{i}.csv") for i in (0, 6))
    channels = VibrationChannels.of(moving)
    speed = channels.blocks()["speed"]
    known, _ = vibration_features(moving, channels)
    missing, first = vibration_features(unknown, channels)
    assert known.shape[1] == len(channels.names) == len(set(channels.names))
    assert np.isfinite(known[:-1]).all()
    assert np.isnan(missing[:, speed.start : speed.stop - 1]).all()
    assert (missing[:, speed.stop - 1] == 0).all()
    assert np.isfinite(missing[:, : channels.blocks()["drive"].start]).all()
    assert np.diff(first).tolist() == [128] * (len(first) - 1)


def test_level_and_spectrum_are_those_of_the_signal(labelled):
    run = read_vibration_run(labelled / "imu_1.csv.gz")
    channels = VibrationChannels.of(run)
    features, _ = vibration_features(run, channels)
    by_name = dict(zip(channels.names, features.mean(axis=0), strict=True))
    assert by_name["az_level"] == pytest.approx(np.log(run.channels[:, 3].std()), abs=0.05)
    assert by_name["az_crossings"] == pytest.approx(0.5, abs=0.03)  # of white noise


def test_left_and_right_and_the_direction_of_travel_do_not_matter(labelled):
    run = read_vibration_run(labelled / "imu_0.csv.gz", labelled / "pro_0.csv")
    left_right = [run.wheel_names.index(name) for name in ("curR", "curL", "velR", "velL")]
    wheel = run.wheel[:, left_right] * [1, 1, -1, -1]
    mirrored = replace(run, channels=run.channels * [-1, 1, -1, 1], wheel=wheel)
    uneven = run.wheel * [1, 1.5, 1, 1.2]
    for one, other in ((run, mirrored), (replace(run, wheel=uneven), replace(mirrored, wheel=uneven[:, left_right]))):
        channels = VibrationChannels.of(one)
        features, again = (vibration_features(each, channels)[0][:, : -channels.of_mounting] for each in (one, other))
        np.testing.assert_allclose(features, again, rtol=1e-9, atol=1e-9)


def test_another_mounting_of_the_sensor_shuts_the_gate(outcome, labelled):
    run = read_vibration_run(labelled / "imu_0.csv.gz", labelled / "pro_0.csv")
    tied = run.channels.copy()
    tied[:, 1] = tied[:, 0]  # two axes that feel one axis
    for channels, shut in ((run.channels, 0.0), (tied, 1.0)):
        _, _, evidence = vibration_evidence(replace(run, channels=channels), outcome.classifier)
        assert evidence.unknown.mean() == shut
    seen = outcome.classifier.fitted.member_columns
    assert {last for _, last in seen} == {len(outcome.classifier.feature_names) - VibrationChannels.of(run).of_mounting}


@pytest.mark.parametrize(("turned", "response"), [(0.98, np.log(1.0 / 0.42)), (0.0, np.log(0.02 / 0.42))])
def test_turning_in_place_is_set_against_what_the_wheels_command(labelled, turned, response):
    run = read_vibration_run(labelled / "imu_0.csv.gz", labelled / "pro_0.csv")
    wheel, shaken = run.wheel.copy(), 0.01 * run.channels
    wheel[:, 2:] = [0.2, -0.2]  # m/s
    shaken[:, 0] += turned  # rad/s
    channels = VibrationChannels.of(run)
    features, _ = vibration_features(replace(run, channels=shaken, wheel=wheel), channels)
    by_name = dict(zip(channels.names, features[0], strict=True))
    assert by_name["forward"] == pytest.approx(np.log(0.02))
    assert by_name["turning"] == pytest.approx(np.log(0.42))
    assert by_name["turning_response"] == pytest.approx(response, abs=0.2)
    assert by_name["turning_load"] == pytest.approx(np.log(12), abs=0.1)  # A


def test_runs_are_classified_with_and_without_their_wheels(outcome, tmp_path):
    assert outcome.report["balanced_accuracy"]["value"] > 0.9
    rng = np.random.default_rng(3)
    for name, kind in (("a", "rough"), ("b", "smooth")):
        write_run(tmp_path, name, kind, rng, wheels=False)
        rows = classify_vibration([tmp_path / f"imu_{name}.csv.gz"], outcome.classifier)
        assert np.mean([row["class"] == kind for row in rows]) > 0.8
        assert rows[1]["start_s"] == 1.28


def test_the_wheels_of_the_same_run_are_found_through_the_index(outcome, labelled):
    rows = classify_vibration([labelled / "imu_0.csv.gz"], outcome.classifier)
    assert np.mean([row["class"] == "rough" for row in rows]) > 0.9


def test_a_vehicle_that_stands_and_a_stuck_sensor_are_unknown(outcome, tmp_path, rng):
    time = np.arange(0, 6, 0.01)
    for name, values, said in (
        ("still", 1e-3 * rng.normal(size=(600, 4)), "stands"),
        ("stuck", np.column_stack([rng.normal(size=(600, 3)), np.full(600, 9.81)]), "does not change"),
    ):
        path = tmp_path / f"{name}.csv"
        np.savetxt(path, np.column_stack([time, values]), "%.6g", ",", header="time," + ",".join(AXES), comments="")
        rows = classify_vibration([path], outcome.classifier)
        assert all(row["unknown"] and said in row["reasons"][0] for row in rows)


def with_tone(run, ratio_dB):
    """A motor of 13 Hz and its harmonics, at another phase in each channel."""
    phase = 2 * np.pi * 13.0 * run.time_s[:, None] + np.arange(run.channels.shape[1])
    tone = sum(np.sin(order * phase) / order for order in (1, 2, 3))
    size = 10 ** (-ratio_dB / 20) * run.channels.std(axis=0) / tone.std(axis=0)
    return replace(run, channels=run.channels + size * tone)


def test_the_ratio_is_that_of_vibration_to_what_was_added(labelled):
    run = read_vibration_run(labelled / "imu_0.csv.gz")
    found = ratio_dB(with_tone(run, 10.0).channels, run.channels, np.array([0, 300]), 512)
    np.testing.assert_allclose(found, 10.0, atol=0.5)


def test_every_fault_leaves_a_whole_run_and_keeps_gaps(labelled, rng):
    run = read_vibration_run(labelled / "imu_0.csv.gz")
    run.channels[700:900] = np.nan
    for fault in FAULTS:
        changed = fault(run.channels - np.nanmean(run.channels, axis=0), np.nanstd(run.channels, axis=0), run, rng)
        assert changed.shape == run.channels.shape
        assert np.isnan(changed[720:880]).all()
        assert np.isfinite(changed[:690]).all()
        assert np.isfinite(changed[910:-50]).all()


def test_noise_costs_quality_says_so_and_ends_unknown(outcome, labelled):
    run = read_vibration_run(labelled / "imu_0.csv.gz")
    runs = (run, *(with_tone(run, above_dB) for above_dB in (16, 12, 8, -8)))
    found = [vibration_evidence(each, outcome.classifier)[2] for each in runs]
    quality = [evidence.quality.mean() for evidence in found]
    assert quality[0] > 0.9
    assert quality[0] > quality[1] > quality[2] > quality[3] >= quality[4]
    assert quality[4] < 0.1
    assert found[4].unknown.mean() > 0.9
    assert all(any("noise or a poor sensor" in reason for reason in said) for said in found[4].reasons)


@pytest.mark.parametrize("level", [0.05, 0.3, 1.0])
def test_a_motor_alone_is_no_ground(outcome, labelled, level):
    run = read_vibration_run(labelled / "imu_0.csv.gz")
    motor = with_tone(replace(run, channels=0.01 * run.channels), -40)
    motor = motor.channels * level * run.channels.std(axis=0) / motor.channels.std(axis=0)
    evidence = vibration_evidence(replace(run, channels=motor), outcome.classifier)[2]
    assert evidence.unknown.mean() > 0.9


def test_what_a_fault_left_alone_counts_as_free_of_noise(labelled):
    run = read_vibration_run(labelled / "imu_0.csv.gz")
    worse = run.channels.copy()
    worse[:, 1] = np.clip(worse[:, 1], -0.1, 0.1)
    (found,) = ratio_dB(worse, run.channels, np.array([0]), 512)
    assert 0.75 * NOISE_FREE_DB < found < NOISE_FREE_DB


def test_trust_is_learnt_from_worse_copies(outcome):
    table = outcome.report["trust"]
    assert table[-1]["quality"] > 0.9
    assert outcome.classifier.fitted.trust is not None
    assert outcome.report["n_degraded"] > 0.5 * outcome.report["n_scored"]


def test_a_model_from_before_noise_was_estimated_still_answers_and_a_damaged_one_is_refused(outcome, labelled):
    run, model = read_vibration_run(labelled / "imu_0.csv.gz"), outcome.classifier
    before = replace(model, settings={key: value for key, value in model.settings.items() if key != "noise"})
    assert not vibration_evidence(run, before)[2].unknown.any()
    damaged = replace(model, settings=model.settings | {"noise": model.settings["noise"] | {"scale": [0.0]}})
    with pytest.raises(InputError, match="scale of the noise model is damaged"):
        vibration_evidence(run, damaged)


def test_a_file_without_the_channels_is_refused(outcome, tmp_path):
    (tmp_path / "odd.csv").write_text("time_s,q\n0,1\n0.01,2\n0.02,1\n")
    with pytest.raises(InputError, match=r"odd\.csv.*no column wx, wy, ax, az"):
        classify_vibration([tmp_path / "odd.csv"], outcome.classifier)


@pytest.mark.slow
def test_real_runs_left_out_are_recognised(shared_data):
    runs = read_labelled(shared_data / "vehicle-vibration")
    report = train_vibration(runs, np.random.default_rng(4)).report
    assert report["groups"] == 48
    assert report["balanced_accuracy"]["value"] > 0.65  # five grounds, by run: chance is 0.2
