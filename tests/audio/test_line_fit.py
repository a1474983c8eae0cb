"""Place, standard deviation and strength of fitted lines, against tones and orders of known place and power."""

import numpy as np
import pytest
from bevameter.audio.explain.drive_spectra import Speeds, drive_spectra
from bevameter.audio.explain.explain import explain_sound
from bevameter.audio.explain.line_fit import Spectra, fit_line, hann_power
from bevameter.audio.explain.lines import find_lines

RATE = 16000
NOISE = 0.03
SECONDS = 56.0
AMPLITUDES = (0.001, 0.002, 0.004, 0.02, 0.06)
"""Amplitudes of tones: 3 to 38 dB over white noise of `NOISE` in 1 Hz."""


def excess_dB(amplitude):
    """Power of a tone over that of the noise in 1 Hz [dB]."""
    return 10.0 * np.log10(0.5 * amplitude**2 / (NOISE**2 / (RATE / 2)))


def varied_speed(rng):
    time_s = np.arange(0.0, SECONDS + 0.05, 0.1)
    return time_s, np.interp(time_s, np.arange(0.0, SECONDS + 7.0, 6.0), rng.uniform(4.0, 8.0, int(SECONDS // 6) + 2))


def found_in(study, sound, time_s, wheel, rng):
    return find_lines(drive_spectra(study.ArraySound(sound, RATE), Speeds.of(time_s, wheel, 0.2 * wheel)), rng)[0]


def scored(truths, lines, family):
    """Standard scores of the fitted places, and errors of the fitted excess [dB], each (n,), of the true lines."""
    assert 0.8 * len(truths) <= len(lines) <= len(truths), [(line.family, line.place) for line in lines]
    assert {line.family for line in lines} == {family}
    z, error = [], []
    for line in lines:
        place, amplitude = min(truths, key=lambda truth: abs(truth[0] - line.place))
        z.append((line.place - place) / line.sd)
        error.append(10.0 * np.log10(1.5 * line.excess) - excess_dB(amplitude))
    return np.array(z), np.array(error)


def holds(z):
    """Whether standard scores agree with their standard deviation: about 95 % lie within 2."""
    return np.mean(np.abs(z) < 2.0) >= 0.9 and np.sqrt(np.mean(z**2)) < 1.2


def test_steady_tones_of_any_strength_are_placed_within_their_uncertainty(study, rng):
    z, error = [], []
    t = np.arange(int(SECONDS * RATE)) / RATE
    for _ in range(3):
        time_s, wheel = varied_speed(rng)
        places = 150.0 + 450.0 * np.arange(10) + rng.uniform(0.0, 250.0, 10)
        truths = list(zip(places, rng.permutation(AMPLITUDES * 2), strict=True))
        sound = NOISE * rng.standard_normal(t.size)
        sound += sum(a * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f, a in truths)
        one = scored(truths, found_in(study, sound, time_s, wheel, rng), "fixed")
        z.append(one[0])
        error.append(one[1])
    assert holds(np.concatenate(z)), np.concatenate(z)
    # The weakest tones scatter with the noise; the smooth background spectrum is a few tenths of a dB too high.
    assert np.abs(np.concatenate(error)).max() < 3.0
    assert np.median(np.abs(np.concatenate(error))) < 0.6


@pytest.mark.parametrize("place", [100.0, 200.0, 203.3, 999.5, 1000.25])
def test_the_frequency_of_a_strong_tone_is_unbiased(study, rng, place):
    """The estimate was once half a bin low, by seven standard deviations."""
    time_s, wheel = varied_speed(rng)
    t = np.arange(int(SECONDS * RATE)) / RATE
    sound = NOISE * rng.standard_normal(t.size) + 0.005 * np.sin(2 * np.pi * place * t)
    found = explain_sound(study.ArraySound(sound, RATE), time_s, wheel, 0.2 * wheel).findings
    (tone,) = found.missing
    frequency, excess = tone.parameters["frequency"], tone.parameters["excess"]
    assert abs(frequency.value - place) < 3.0 * frequency.sd < 0.1
    assert excess.value == pytest.approx(excess_dB(0.005), abs=1.0)


@pytest.mark.parametrize("error", [0.0, 0.003], ids=["exact speed", "noisy speed"])
def test_orders_of_any_strength_are_placed_within_their_uncertainty(study, rng, error):
    z = []
    t = np.arange(int(SECONDS * RATE)) / RATE
    for _ in range(3):
        time_s, wheel = varied_speed(rng)
        theta = np.cumsum(np.interp(t, time_s, wheel)) / RATE
        places = 40.0 + 60.0 * np.arange(8) + rng.uniform(0.0, 40.0, 8)
        truths = list(zip(places, rng.choice(AMPLITUDES[2:], 8), strict=True))
        # The place of an order within its bin changes with speed, and so does the noise of the ground around it.
        noise = NOISE * np.interp(t, time_s, wheel / wheel.mean()) ** 2 * rng.standard_normal(t.size)
        sound = noise + sum(a * np.sin(order * theta) for order, a in truths)
        measured = wheel * (1.0 + error * rng.standard_normal(wheel.size))
        z.append(scored(truths, found_in(study, sound, time_s, measured, rng), "order")[0])
    assert holds(np.concatenate(z)), np.concatenate(z)


def test_the_excess_of_a_line_that_masks_the_noise_around_it_is_unknown(study, rng):
    time_s, wheel = varied_speed(rng)
    t = np.arange(int(SECONDS * RATE)) / RATE
    sound = 0.001 * rng.standard_normal(t.size) + 0.9 * np.sin(2 * np.pi * 1777.4 * t)
    found = explain_sound(study.ArraySound(sound, RATE), time_s, wheel, 0.2 * wheel).findings
    (tone,) = found.missing
    assert np.isnan(tone.parameters["excess"].value)
    assert any("excess of what was found at 1777 Hz is not known" in note for note in found.notes)
    assert abs(tone.parameters["frequency"].value - 1777.4) < 2.0 * tone.parameters["frequency"].sd


def test_the_main_lobe_is_that_of_the_hann_window():
    n = 4096
    window = np.hanning(n + 1)[:-1]
    tone = np.exp(2j * np.pi * 100.3 * np.arange(n) / n) * window
    power = np.abs(np.fft.fft(tone)[97:105]) ** 2 / window.sum() ** 2
    np.testing.assert_allclose(hann_power(np.arange(97, 105) - 100.3), power, rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(hann_power(np.array([0.0, 1.0, -1.0, 2.0])), [1.0, 0.25, 0.25, 0.0], atol=1e-5)


def test_a_line_without_data_is_as_uncertain_as_its_search_range(rng):
    nothing = Spectra(np.full((30, 200), np.nan), np.ones(30), 20, np.arange(30) // 5)
    line = fit_line(nothing, np.arange(30), 90.0, 1.5)
    assert (line.multiple, line.excess) == (90.0, 0.0)
    assert line.sd == pytest.approx(3.0 / np.sqrt(12.0))


def test_a_line_in_few_stretches_is_as_uncertain_as_its_search_range(rng):
    for groups, known in ((1, False), (2, False), (8, True)):
        power = np.ones((15 * groups, 200))
        power[:, 98:103] += 20.0 * hann_power(np.arange(98, 103) - 100.0)
        seen = Spectra(rng.exponential(power), np.ones(len(power)), 20, np.arange(len(power)) // 15)
        line = fit_line(seen, np.arange(len(power)), 100.2, 1.5)
        assert (line.sd < 0.1) == known
        assert line.sd <= 3.0 / np.sqrt(12.0) + 1e-9


def test_a_place_fitted_to_noise_stays_within_its_search_range(rng):
    noise = Spectra(rng.exponential(size=(60, 200)), np.ones(60), 20, np.arange(60) // 10)
    for place in range(40, 160, 10):
        line = fit_line(noise, np.arange(60), float(place), 1.5)
        assert abs(line.multiple - place) <= 1.5 + 1e-9
        assert 0.0 < line.sd <= 3.0 / np.sqrt(12.0) + 1e-9
        assert line.excess < 1.0
