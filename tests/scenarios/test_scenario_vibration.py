"""What the synthetic inertial sensor feels follows from the ground's published spectrum, the vehicle and the sensor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.scenario import roughness, vibration
from bevameter.framework.scenario.ground import PAINTERS
from bevameter.framework.scenario.plan import Plan, make_plan
from bevameter.framework.scenario.presets import PRESETS, Leg
from bevameter.framework.scenario.roughness import ROUGHNESS, STEP_M, coherence, pressed, profiles
from bevameter.framework.scenario.vibration import CHANNELS, NOISE, felt
from bevameter.framework.scenario.write import write_scenario
from scipy.signal import csd, welch
from synthetic_samples import SAMPLE_CLASSES, labelled_runs


def drive(terrain: str, speed_m_s: float = 3.0, seed: int = 1) -> Plan:
    legs = (Leg(terrain, 4.0, 12.0),)
    return make_plan(replace(PRESETS["camera-imu"], legs=legs, faults=(), fast_speed_m_s=speed_m_s), seed)


def shaken(terrain: str, speed_m_s: float = 3.0) -> np.ndarray:
    """Standard deviation of each channel at speed, (6,)."""
    return np.concatenate(list(felt(drive(terrain, speed_m_s))))[800:1400].std(axis=0)


@pytest.mark.parametrize("terrain", ["asphalt", "grass", "sand"])
def test_profiles_have_the_published_spectrum_and_the_coherence_of_isotropic_ground(terrain, monkeypatch):
    monkeypatch.setattr(roughness, "SPREAD", 0.0)
    rough = ROUGHNESS[terrain]
    left, right = profiles(terrain, 4000.0, 0.3, np.random.default_rng(2))
    frequency, power = welch(left, 1.0 / STEP_M, nperseg=8192)
    chosen = (frequency > 0.3) & (frequency < 8.0)
    expected = rough.coefficient * frequency[chosen] ** -rough.exponent
    assert np.mean(power[chosen] / expected) == pytest.approx(1.0, abs=0.04)
    assert np.polyfit(np.log(frequency[chosen]), np.log(power[chosen]), 1)[0] == pytest.approx(-rough.exponent, abs=0.1)
    cross = csd(left, right, 1.0 / STEP_M, nperseg=8192)[1].real / power
    for low, high in ((0.2, 0.4), (0.6, 0.9), (2.0, 4.0)):
        rows = (frequency > low) & (frequency < high)
        assert cross[rows].mean() == pytest.approx(coherence(frequency[rows], 0.3, rough.exponent).mean(), abs=0.08)


def test_a_contact_averages_waves_that_are_shorter_than_it_and_leaves_long_ones():
    place = np.arange(0.0, 10.0, STEP_M)
    waves = np.sin(2.0 * np.pi * place / np.array([[0.05], [2.0]]))
    short, long = pressed(waves, 0.2)[:, 100:-100].std(axis=1) / waves.std(axis=1)
    assert short < 0.1
    assert long > 0.98


@pytest.mark.parametrize("frequency_Hz", [0.8, 2.0, 5.0, 11.0])
def test_the_body_answers_as_a_quarter_car(frequency_Hz):
    body, wheel, spring, damper, tyre, loss, step = 50.0, 15.0, 8e3, 380.0, 65e3, 90.0, 1e-3
    arms = np.array([[0.45, 0.35], [0.45, -0.35], [-0.45, 0.35], [-0.45, -0.35]])
    time = np.arange(0.0, 12.0, step)
    below = np.repeat(1e-3 * np.sin(2.0 * np.pi * frequency_Hz * time)[:, None], 4, axis=1)
    even, mass = np.ones((len(time), 4)), 4.0 * body
    moved, _ = vibration._ride(
        below, tyre * even, loss * even, spring * even[0], damper * even[0], arms, np.array([mass, 40.0, 20.0]), wheel,
        np.full(4, -650.0), np.zeros((2, 7)), step,
    )  # fmt: skip
    s = 2j * math.pi * frequency_Hz
    hold, push = spring + damper * s, tyre + loss * s
    moves = np.linalg.solve([[body * s**2 + hold, -hold], [-hold, wheel * s**2 + hold + push]], [0.0, push])
    settled = moved[len(time) // 2 :]
    assert np.sqrt(2.0) * settled[:, 0].std() == pytest.approx(1e-3 * abs(moves[0] * s**2), rel=0.04)
    assert np.abs(settled[:, 1:]).max() < 1e-9  # neither pitch nor roll


def test_a_contact_pushes_only():
    falls = np.zeros((400, 4))
    falls[1:] = -1.0
    _, force = vibration._ride(
        falls, np.full((400, 4), 65e3), np.zeros((400, 4)), np.full(4, 8e3), np.full(4, 380.0),
        np.array([[0.4, 0.3], [0.4, -0.3], [-0.4, 0.3], [-0.4, -0.3]]), np.array([200.0, 40.0, 20.0]), 15.0,
        np.full(4, -650.0), np.zeros((2, 7)), 1e-3,
    )  # fmt: skip
    assert force.min() == -650.0  # all of the load, and no more


def test_rougher_ground_and_more_speed_shake_more_and_at_rest_there_is_the_noise_of_the_data_sheet():
    upright = CHANNELS.index("az")
    by_ground = [shaken(name)[upright] for name in ("asphalt", "gravel", "grass")]
    assert by_ground == sorted(by_ground)
    assert shaken("sand", 3.5)[upright] > 1.5 * shaken("sand", 1.0)[upright]
    plan = drive("asphalt")
    zero = np.zeros_like(plan.time_s)
    resting = np.concatenate(list(felt(replace(plan, way_m=zero, speed_m_s=zero, yaw_rad=zero))))
    assert resting[:, upright].mean() == pytest.approx(9.81, abs=0.05)
    assert resting.std(axis=0) == pytest.approx(np.repeat(NOISE, 3) * math.sqrt(1.11 * 40.0), rel=0.1)


def test_a_recording_gives_vibration_with_the_speed_of_the_wheels_and_a_seed_the_same_bytes(tmp_path, monkeypatch):
    legs = (Leg("asphalt", 0.0, 6.0), Leg("gravel", 0.0, 6.0))
    camera_off = replace(PRESETS["camera-imu"], legs=legs, faults=(), camera_rate_Hz=None)
    monkeypatch.setattr("bevameter.framework.scenario.write.preset", lambda name: camera_off)
    one, other = (write_scenario("camera-imu", tmp_path / name, seed=3) for name in ("one", "other"))
    assert (one / "vibration.csv").read_bytes() == (other / "vibration.csv").read_bytes()
    run = read_recording(one).vibration
    assert run is not None
    assert run.problems == ()
    assert run.names == CHANNELS
    assert run.wheel_names == ("speed_front_left", "speed_front_right", "speed_rear_left", "speed_rear_right")
    assert len(run.time_s) == 1200
    assert run.wheel[600, 0] == pytest.approx(3.2 / 0.25, rel=0.35)


def test_runs_are_labelled_and_grouped_and_every_ground_is_rough():
    assert set(ROUGHNESS) == set(PAINTERS)
    runs, labels = labelled_runs(np.random.default_rng(0), 1)
    assert len(runs) == len(labels) == len(SAMPLE_CLASSES)
    assert {item.class_name for item in labels} == set(SAMPLE_CLASSES)
    assert all(item.group.startswith(item.class_name) for item in labels)
    assert all(np.isfinite(run.channels).all() for run in runs)
