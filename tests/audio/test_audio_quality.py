import json

import numpy as np
import pytest
from bevameter.audio.augment import NOISES, add_noise, sounding_power
from bevameter.audio.features import RATE_HZ
from bevameter.audio.quality import (
    MEASURES,
    NoiseModel,
    RecordingFaults,
    assess,
    features_and_noise,
    noise_inputs,
    recording_faults,
)  # fmt: skip
from bevameter.framework.core.classifier.signal_to_noise import NOISE_FREE_DB


def steps(rng, count=1):
    """Windows with two low-pitched steps each, silent between them."""
    time = np.arange(RATE_HZ) / RATE_HZ
    windows = np.zeros((count, RATE_HZ))
    for window in windows:
        for at in rng.uniform([0.1, 0.5], [0.3, 0.8]):
            envelope = np.where(time > at, np.exp(-np.abs(time - at) / rng.uniform(0.02, 0.06)), 0)
            window += rng.normal(size=RATE_HZ) * envelope
    return (0.2 * windows + 1e-4 * rng.normal(size=windows.shape)).astype(np.float32)


def faults_of(samples, rate=22050):
    return recording_faults(samples, rate, np.array([0.0]), np.array([len(samples) / rate]))


def test_a_gap_is_measured(rng):
    sound = rng.normal(0, 0.1, 22050)
    assert faults_of(sound).missing[0] == 0
    sound[5000:16025] = 0
    assert faults_of(sound).missing[0] == pytest.approx(0.5, abs=0.01)
    sound[5000:16025] = np.nan
    assert faults_of(sound).missing[0] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("level", [1.0, 0.4])
def test_clipping_is_measured_at_full_scale_and_below(rng, level):
    sound = rng.normal(0, 0.2, 22050)
    assert faults_of(sound).clipped[0] < 1e-3
    driven = np.clip(5 * sound, -level, level)
    assert faults_of(driven).clipped[0] == pytest.approx(np.mean(np.abs(driven) >= level), rel=0.4)


@pytest.mark.parametrize(("low", "high", "offset"), [(-0.4, 0.4, 0.1), (-0.4, 0.8, 0.0), (-9.0, 0.3, -0.2)])
def test_clipping_is_measured_on_each_side_by_itself(rng, low, high, offset):
    sound = np.convolve(rng.normal(0, 0.25, 22050), np.ones(8) / 8, "same")
    driven = np.clip(3 * sound, low, high) + offset
    assert faults_of(driven).clipped[0] == pytest.approx(np.mean((3 * sound <= low) | (3 * sound >= high)), rel=0.05)


def test_a_louder_moment_hides_no_clipping(rng):
    sound = np.clip(rng.normal(0, 1.0, 4 * 22050), -0.5, 0.5)
    starts = np.arange(4.0)
    before = recording_faults(sound, 22050, starts, starts + 1).clipped
    sound[30000] = 0.95
    sound[60000:60100] *= 1.9
    np.testing.assert_allclose(recording_faults(sound, 22050, starts, starts + 1).clipped, before, atol=0.005)


@pytest.mark.parametrize("steps", [128, 32768])
def test_quiet_and_coarse_sound_is_not_called_clipped(rng, steps):
    sound = np.convolve(rng.normal(0, 0.05, 22050), np.ones(8) / 8, "same")
    assert faults_of(np.round(sound * steps) / steps).clipped[0] < 0.005


def test_clipping_of_one_of_several_channels_is_measured(rng):
    whole = rng.normal(0, 0.1, 22050)
    driven = np.clip(10 * whole, -0.6, 0.6)
    alone = faults_of(driven).clipped[0]
    for channels in ([driven, whole], [whole, driven], [whole, driven, whole, whole]):
        assert faults_of(np.stack(channels, axis=1)).clipped[0] == pytest.approx(alone)


def test_channels_that_cancel_are_not_called_silent(rng):
    sound = rng.normal(0, 0.2, 22050)
    assert faults_of(np.stack([sound, -sound], axis=1)).rms[0] == pytest.approx(0.2, rel=0.05)


def test_a_pure_tone_is_not_called_clipped():
    tone = 0.8 * np.sin(2 * np.pi * 90 * np.arange(22050) / 22050)
    assert faults_of(np.round(tone * 32767) / 32768).clipped[0] < 0.02


@pytest.mark.parametrize("noise", NOISES)
def test_noise_has_unit_power_and_is_added_at_its_ratio(rng, noise):
    assert np.mean(np.square(noise(RATE_HZ, rng))) == pytest.approx(1.0, rel=1e-6)
    window = steps(rng)[0]
    added = add_noise(window, 6.0, rng) - window
    assert 10 * np.log10(sounding_power(window) / np.mean(added**2)) == pytest.approx(6.0, abs=0.1)


@pytest.fixture(scope="module")
def fitted():
    rng = np.random.default_rng(3)
    clean = steps(rng, 60)
    snr = np.concatenate([np.full(60, NOISE_FREE_DB), rng.uniform(-10, 30, 240)])
    windows = np.concatenate([clean, [add_noise(clean[i % 60], snr[60 + i], rng) for i in range(240)]])
    inputs = noise_inputs(*features_and_noise(windows))
    return NoiseModel.fit(inputs, snr, np.arange(300) % 60 % 6, np.arange(300) < 60)[0]


def rate(model, windows):
    faults = RecordingFaults(np.full(len(windows), 0.1), np.zeros(len(windows)), np.zeros(len(windows)))
    return assess(*features_and_noise(windows), faults, model)


def test_quality_falls_with_noise_that_was_not_trained_on(fitted):
    rng = np.random.default_rng(4)
    clean = steps(rng, 20)
    quality = [rate(fitted, clean)[0].mean()]
    for snr in (15, 5, -5):
        noisy = np.stack([add_noise(window, snr, rng) for window in clean])
        quality.append(rate(fitted, noisy)[0].mean())
    assert quality[0] > 0.8
    assert quality[0] > quality[1] > quality[2] > quality[3]
    assert quality[3] < 0.2


def test_reasons_name_the_noise(fitted):
    rng = np.random.default_rng(5)
    clean = steps(rng, 10)
    time = np.arange(RATE_HZ) / RATE_HZ
    hum = sum(np.sin(2 * np.pi * 187.5 * k * time) / k for k in range(1, 6))
    _, reasons = rate(fitted, clean + hum.astype(np.float32))
    assert sum("engine" in " ".join(r) for r in reasons) >= 5
    rumble = np.cumsum(rng.normal(size=RATE_HZ))
    _, reasons = rate(fitted, clean + (rumble / rumble.std()).astype(np.float32))
    assert sum("wind" in " ".join(r) for r in reasons) >= 5


def test_faults_cost_quality_and_are_named(fitted):
    windows = steps(np.random.default_rng(6), 3)
    faults = RecordingFaults(np.array([0.0, 0.1, 0.1]), np.array([0.0, 0.2, 0.0]), np.array([1.0, 0.0, 0.7]))
    quality, reasons = assess(*features_and_noise(windows), faults, fitted)
    assert (quality == 0).all()
    assert reasons[0][0] == "silent"
    assert reasons[1][0].startswith("clipped")
    assert reasons[2][0].startswith("70% of the sound is missing")


def test_a_noise_model_survives_json_and_refuses_damage(fitted):
    settings = json.loads(json.dumps(fitted.settings()))
    again = NoiseModel.from_settings(settings, len(fitted.ratio.mean))
    np.testing.assert_allclose(again.ratio.coefficient, fitted.ratio.coefficient, atol=1e-8)
    for damage in (
        {"mean": [1.0]},
        {"scale": [0.0] * len(fitted.ratio.mean)},
        {"intercept": float("nan")},
        {"low_dB": 1e9},
    ):
        with pytest.raises(ValueError, match="damaged"):
            NoiseModel.from_settings(settings | damage, len(fitted.ratio.mean))
    with pytest.raises(ValueError, match="no noise model"):
        NoiseModel.from_settings({"mean": []}, 1)
    assert len(MEASURES) == len(fitted.usual_mean)
