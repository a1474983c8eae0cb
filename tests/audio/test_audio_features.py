import numpy as np
import pytest
from bevameter.audio.features import (
    FEATURE_NAMES,
    FFT_SIZE,
    MEL_BANDS,
    RATE_HZ,
    cut_windows,
    mel_filters,
    resample,
)  # fmt: skip
from bevameter.audio.quality import features_and_noise


def window_features(windows):
    return features_and_noise(windows)[0]


def crunch(rng, seconds, hits_per_s=40.0):
    """Grains that break: decaying bursts of noise at random times."""
    sound = np.zeros(int(seconds * RATE_HZ))
    for at in rng.integers(0, sound.size - 800, int(seconds * hits_per_s)):
        sound[at : at + 800] += rng.exponential() * rng.normal(size=800) * np.exp(-np.arange(800) / 100)
    return (0.3 * sound / np.abs(sound).max()).astype(np.float32)


def test_gain_does_not_matter(rng):
    window = crunch(rng, 1.0)[None]
    np.testing.assert_allclose(window_features(window), window_features(window * 0.01), rtol=1e-3, atol=1e-3)


def test_each_window_has_a_number_for_each_name_and_does_not_depend_on_its_neighbours(rng):
    windows, _ = cut_windows(crunch(rng, 50.0))
    features = window_features(windows)
    assert features.shape == (len(windows), len(FEATURE_NAMES))
    assert len(set(FEATURE_NAMES)) == len(FEATURE_NAMES)
    assert np.isfinite(features).all()
    np.testing.assert_allclose(features[70:73], window_features(windows[70:73]), rtol=1e-4, atol=1e-4)


def test_grains_and_hiss_differ_where_they_should(rng):
    sparse, hiss = window_features(np.stack([crunch(rng, 1.0, 5.0), rng.normal(size=RATE_HZ).astype(np.float32)]))
    by_name = {name: (a, b) for name, a, b in zip(FEATURE_NAMES, sparse, hiss, strict=True)}
    assert by_name["crest_4"][0] > by_name["crest_4"][1] + 1
    assert by_name["length_4_1"][0] < by_name["length_4_1"][1]
    assert by_name["centroid_mean"][1] == pytest.approx(np.log2(4.0), abs=0.6)


def test_silence_and_broken_samples_have_no_features(rng):
    windows = np.stack([np.zeros(RATE_HZ), np.full(RATE_HZ, np.nan), crunch(rng, 1.0)]).astype(np.float32)
    assert np.isnan(window_features(windows)).all(axis=1).tolist() == [True, True, False]


@pytest.mark.parametrize(("seconds", "count"), [(0.3, 1), (1.0, 1), (1.5, 2), (1.9, 3), (10.0, 19)])
def test_windows_reach_to_the_end_of_the_sound(rng, seconds, count):
    sound = crunch(rng, seconds)
    windows, start_s = cut_windows(sound)
    assert windows.shape == (count, RATE_HZ)
    assert start_s[0] == 0
    if seconds >= 1:
        assert start_s[-1] + 1.0 == pytest.approx(seconds, abs=0.26)
        at = round(start_s[-1] * RATE_HZ)
        np.testing.assert_array_equal(windows[-1], sound[at : at + RATE_HZ])
    else:
        np.testing.assert_array_equal(windows[0, : sound.size], sound)
        np.testing.assert_array_equal(windows[0, sound.size : 2 * sound.size], sound)


def test_resampling_keeps_a_tone():
    tone = np.sin(2 * np.pi * 1000 * np.arange(22050) / 22050).astype(np.float32)
    there = resample(tone, 22050)
    assert len(there) == RATE_HZ
    expected = np.sin(2 * np.pi * 1000 * np.arange(RATE_HZ) / RATE_HZ)
    np.testing.assert_allclose(there[2000:-2000], expected[2000:-2000], atol=1e-2)


def test_mel_filters_are_triangles_that_overlap_to_one():
    filters = mel_filters()
    assert filters.shape == (FFT_SIZE // 2 + 1, MEL_BANDS)
    peaks = filters.argmax(axis=0)
    assert (np.diff(peaks) > 0).all()
    inside = filters[peaks[0] + 1 : peaks[-1]].sum(axis=1)
    np.testing.assert_allclose(inside, 1.0, atol=1e-4)
