"""`explain_sound` on sound sampled at low rates, and on microphones that recorded nothing."""

import numpy as np
import pytest
from bevameter.audio.explain.drive_spectra import Speeds, drive_spectra, observed_hz, reference_level
from bevameter.audio.explain.explain import explain_sound
from bevameter.audio.explain.resonances import find_resonances
from bevameter.audio.explain.wind import find_wind
from bevameter.framework.core.errors import InputError

SECONDS = 64.0
TIME_S = np.arange(0.0, SECONDS + 0.05, 0.1)
WHEEL = 6.0 + 2.0 * np.sin(TIME_S / 3.0) + 0.5 * np.sin(TIME_S)
TRAVEL = 0.2 * WHEEL


def noise_at(rate, rng):
    """White noise that grows with speed, as a 16-bit recorder at `rate` [Hz] keeps it."""
    t = np.arange(int(SECONDS * rate)) / rate
    return np.round(0.03 * rng.standard_normal(t.size) * np.interp(t, TIME_S, TRAVEL) * 32768) / 32768


def spectra_of(study, samples, rate):
    return drive_spectra(study.ArraySound(samples, rate), Speeds.of(TIME_S, WHEEL, TRAVEL))


@pytest.mark.parametrize("rate", [1000, 2000, 4000, 8000, 11025, 12000])
def test_nothing_is_found_above_the_sampled_band(study, rng, rate):
    found = explain_sound(study.ArraySound(noise_at(rate, rng), rate), TIME_S, WHEEL, TRAVEL).findings
    assert found.verdict == "none", found.missing
    assert found.notes[0] == f"sampled at {rate:g} Hz: nothing above {0.45 * rate:g} Hz was observed"


@pytest.mark.parametrize("rate", [2000, 4000, 8000])
def test_effects_within_the_sampled_band_are_found_and_located(study, rng, rate):
    """The gear's second harmonic leaves the band of the slowest recorder where the wheel turns fast."""
    t = np.arange(int(SECONDS * rate)) / rate
    theta = np.cumsum(np.interp(t, TIME_S, WHEEL)) / rate
    top = observed_hz(rate)
    sound = noise_at(rate, rng) + 0.01 * np.sin(350.3 * theta) + 0.01 * np.sin(700.6 * theta)
    sound += 0.01 * np.sin(2 * np.pi * 0.9 * top * t)
    found = explain_sound(study.ArraySound(sound, rate), TIME_S, WHEEL, TRAVEL).findings
    assert {cause.effect for cause in found.missing} == {"gear_mesh", "steady_tone"}
    gear, tone = sorted(found.missing, key=lambda cause: cause.effect)
    assert gear.parameters["order"].value == pytest.approx(350.3, abs=0.5)
    assert tone.parameters["frequency"].value == pytest.approx(0.9 * top, abs=0.2)
    assert max(place.to_Hz for place in found.located) <= top


def test_spectra_and_bands_end_at_the_sampled_band(study, rng):
    slow = spectra_of(study, noise_at(4000, rng), 4000)
    fast = spectra_of(study, noise_at(16000, rng), 16000)
    assert (slow.top_hz, fast.top_hz) == (1800.0, 5000.0)
    assert slow.band_hz[-1] < 1800.0 < fast.band_hz[slow.band_hz.size] * 2.0 ** (1.0 / 24.0)
    np.testing.assert_array_equal(slow.band_hz, fast.band_hz[: slow.band_hz.size])
    # Up to its end the spectra are those of noise: neither the band limit nor the resampling shows.
    assert slow.fixed[:, -100:].mean() == pytest.approx(1.0, abs=0.05)
    assert np.nanmean(slow.turned[:, -100:]) == pytest.approx(1.0, abs=0.05)
    assert np.isnan(slow.turned[:, -20:]).any()
    assert not np.isnan(fast.turned).any()


def test_wind_is_not_fitted_where_the_band_lacks_contact_sound(study, rng):
    said = find_wind(spectra_of(study, noise_at(1000, rng), 1000), rng)
    assert isinstance(said, str)
    assert "nothing above 600 Hz" in said


def test_of_two_recorders_the_one_with_the_narrower_band_counts(study, rng):
    fast, slow = noise_at(16000, rng), noise_at(8000, rng)
    for samples, rate, other, other_rate in ((fast, 16000, slow, 8000), (slow, 8000, fast, 16000)):
        reference = reference_level(study.ArraySound(other, other_rate))
        assert find_resonances(spectra_of(study, samples, rate), [], rng, reference) == []


def test_sound_sampled_too_slowly_is_refused(study, rng):
    with pytest.raises(InputError, match="sampled at 500 Hz"):
        spectra_of(study, noise_at(500, rng), 500)


@pytest.mark.parametrize("rate", [8000, 16000, 22050])
@pytest.mark.parametrize("dead", ["level", "half", "step", "flicker", "flicker of 8 bits", "drift"])
def test_a_level_is_silence(study, rng, rate, dead):
    n = int(SECONDS * rate)
    samples = {
        "level": np.full(n, 0.1),
        "half": np.full(n, 0.5),
        "step": 0.5 + (np.arange(n) > 0.4 * n) * 2.0**-15,
        "flicker": 0.5 + (rng.random(n) < 0.3) * 2.0**-15,
        "flicker of 8 bits": 0.5 + (rng.random(n) < 0.01) * 2.0**-7,
        "drift": 0.5 * np.exp(-np.arange(n) / n),
    }[dead]
    with pytest.raises(InputError, match="8 stretches of 8 s left out: silent"):
        spectra_of(study, samples, rate)


@pytest.mark.parametrize("rate", [8000, 16000])
def test_a_level_under_sound_changes_nothing(study, rng, rate):
    t = np.arange(int(SECONDS * rate)) / rate
    sound = 0.001 * rng.standard_normal(t.size)
    plain, lifted, humming = (
        explain_sound(study.ArraySound(samples, rate), TIME_S, WHEEL, TRAVEL).findings
        for samples in (sound, sound + 0.5, sound + 0.5 + 0.001 * np.sin(2 * np.pi * 440.0 * t))
    )
    assert plain.verdict == lifted.verdict == "none"
    assert [cause.effect for cause in humming.missing] == ["steady_tone"]
    assert humming.missing[0].parameters["frequency"].value == pytest.approx(440.0, abs=0.1)
