"""Vibration of bags: trained on, classified, and part of a run."""

from __future__ import annotations

import json

import numpy as np
import pytest
from bevameter.audio.vibration import classify_vibration, vibration_evidence
from bevameter.audio.vibration_train import train_vibration
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.readers import read_recording
from mcap.writer import Writer


def write(path, loudness: float, seed: int, seconds: float = 20.0):
    """An inertial sensor at 100 Hz on ground that shakes by so much, and the speed of a wheel."""
    rng = np.random.default_rng(seed)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/Imu", "jsonschema", b'{"type": "object"}')
        number = writer.register_schema("std_msgs/Float64", "jsonschema", b'{"type": "object"}')
        imu = writer.register_channel("/imu", "json", schema)
        wheel = writer.register_channel("/wheel/wheel_speed_rad_s", "json", number)
        for i in range(round(100 * seconds)):
            turn, push = (dict(zip("xyz", loudness * rng.standard_normal(3), strict=True)) for _ in range(2))
            message = {"angular_velocity": turn, "linear_acceleration": {**push, "z": push["z"] + 9.81}}
            writer.add_message(imu, i * 10**7, json.dumps(message).encode(), i * 10**7)
            if i % 10 == 0:
                speed = json.dumps({"data": 2.0 + 0.1 * rng.standard_normal()}).encode()
                writer.add_message(wheel, i * 10**7, speed, i * 10**7)
        writer.finish()
    return path


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for name, loudness in (("gravel", 1.0), ("grass", 0.2)):
        (folder / name).mkdir()
        for run in range(4):
            write(folder / name / f"{run}.mcap", loudness * (1.0 + 0.1 * run), seed=run)
    return train_vibration(read_labelled(folder), np.random.default_rng(0)).classifier


def test_a_model_trained_on_bags_knows_the_ground_of_another(model, tmp_path):
    assert "speed_mean" in model.feature_names
    path = write(tmp_path / "new.mcap", 1.05, seed=9)
    rows = classify_vibration([path], model)
    assert np.mean([row["class"] == "gravel" for row in rows]) > 0.9
    run = read_recording(path).vibration
    start_s, _, evidence = vibration_evidence(run, model)
    assert len(start_s) == len(rows) == len(evidence.probabilities)


def test_a_bag_without_an_inertial_sensor_is_refused(model, tmp_path):
    with (tmp_path / "none.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        number = writer.register_schema("std_msgs/Float64", "jsonschema", b'{"type": "object"}')
        wheel = writer.register_channel("/wheel/load_N", "json", number)
        for i in range(5):
            writer.add_message(wheel, i * 10**8, b'{"data": 50.0}', i * 10**8)
        writer.finish()
    with pytest.raises(InputError, match=r"none\.mcap: no inertial sensor"):
        classify_vibration([tmp_path / "none.mcap"], model)
