"""Features of patches: invariances, sensitivities, and quality."""

import cv2
import numpy as np
import pytest
from bevameter.framework.core.classifier.signal_to_noise import NOISE_FREE_DB
from bevameter.vision.augment import (
    DEGRADED,
    cut_patch,
    motion_blur,
    noise_copies,
    noisy,
    training_patches,
    whole_copies,
)
from bevameter.vision.crops import image_patches
from bevameter.vision.features import FEATURE_NAMES, PATCH_PX, patch_features
from bevameter.vision.quality import learn_limits, light, rated, sharpness


def textures(rng, n=6, sigma=1.0, size=PATCH_PX):
    grain = np.stack([cv2.GaussianBlur(rng.normal(size=(size, size)), (0, 0), sigma) for _ in range(n)])
    grain /= grain.std(axis=(1, 2), keepdims=True)
    return np.clip(120 + 25 * grain[..., None] * np.array([0.8, 1.0, 1.1]), 0, 255).astype(np.uint8)


def column(name):
    return FEATURE_NAMES.index(name)


def test_one_name_a_column_and_all_finite(rng):
    rows = patch_features(textures(rng))
    assert rows.shape == (6, len(FEATURE_NAMES))
    assert len(set(FEATURE_NAMES)) == len(FEATURE_NAMES)
    assert np.isfinite(rows).all()
    assert patch_features(np.empty((0, 64, 64, 3), dtype=np.uint8)).shape == (0, len(FEATURE_NAMES))


def test_a_patch_is_measured_alone(rng):
    """The other patches of the batch change nothing."""
    patches = textures(rng, n=70)
    np.testing.assert_allclose(patch_features(patches)[[0, 69]], patch_features(patches[[0, 69]]), rtol=1e-4, atol=1e-4)


def test_other_shapes_are_refused(rng):
    with pytest.raises(ValueError, match="uint8"):
        patch_features(textures(rng).astype(float))
    with pytest.raises(ValueError, match="64"):
        patch_features(textures(rng)[:, :32])


def test_patches_without_contrast_are_not_finite():
    flat = np.full((2, 64, 64, 3), (90, 120, 130), dtype=np.uint8)
    assert not np.isfinite(patch_features(flat)).all(axis=1).any()


def test_texture_is_invariant_to_exposure_and_rotation(rng):
    patches = textures(rng, n=12, sigma=1.5)
    rows = patch_features(patches)
    texture = slice(column("brightness_p1"), None)
    spread = rows[:, texture].std(axis=0) + 0.02
    dimmer = patch_features((patches * 0.7).astype(np.uint8))
    turned = patch_features(np.ascontiguousarray(np.rot90(patches, axes=(1, 2))))
    assert np.median(np.abs(dimmer - rows)[:, texture] / spread) < 0.3
    assert np.abs(turned - rows)[:, column("energy_mean_0.05") :].max() < 0.02


def test_grain_blur_and_hue_are_seen(rng):
    fine, coarse = patch_features(textures(rng, sigma=0.8)), patch_features(textures(rng, sigma=4.0))
    assert fine[:, column("energy_mean_0.4")].min() > coarse[:, column("energy_mean_0.4")].max()
    sharp = textures(rng, sigma=0.8)
    blurred = np.stack([motion_blur(patch, 15, 0.5) for patch in sharp])
    assert (sharpness(patch_features(blurred)) < sharpness(patch_features(sharp)) - 0.5).all()
    agreement = column("direction_agreement")
    assert patch_features(blurred)[:, agreement].min() > patch_features(sharp)[:, agreement].max()
    green = sharp.copy()
    green[..., 1] = np.minimum(green[..., 1].astype(int) + 40, 255)
    assert (patch_features(green)[:, column("green_share")] > patch_features(sharp)[:, column("green_share")]).all()


@pytest.mark.parametrize("direction", [0.0, np.pi / 2, 0.7])
def test_motion_blur_smears_along_its_direction_and_keeps_the_light(direction):
    image = np.zeros((65, 65), dtype=np.float32)
    image[32, 32] = 1.0
    smeared = motion_blur(image, 20, direction)
    assert smeared.sum() == pytest.approx(1.0, abs=1e-4)
    y, x = np.nonzero(smeared > 1e-3)
    along = (x - 32) * np.cos(direction) + (y - 32) * np.sin(direction)
    across = -(x - 32) * np.sin(direction) + (y - 32) * np.cos(direction)
    assert 19 <= np.ptp(along) <= 24
    assert np.abs(across).max() <= 2


@pytest.mark.parametrize("shape", [(512, 512), (128, 300), (20, 17)])
def test_cutting_works_at_any_size_and_stays_inside(shape, rng):
    image = np.full((*shape, 3), 200, dtype=np.uint8)
    for _ in range(10):
        assert cut_patch(image, rng).min() >= 199


def test_a_photograph_of_any_shape_is_degraded_as_a_whole():
    image = np.random.default_rng(1).integers(60, 200, (90, 150, 3), dtype=np.uint8)
    copies = whole_copies(image, 3, np.random.default_rng(5))
    assert [part.shape for part in copies] == [(14, PATCH_PX, PATCH_PX, 3)] * 4
    assert np.array_equal(copies[0], image_patches(image))
    assert not any(np.array_equal(part, copies[0]) for part in copies[1:])


def test_training_patches_repeat_by_seed():
    image = np.random.default_rng(0).integers(0, 255, (100, 120, 3), dtype=np.uint8)
    first, kind, snr_dB = training_patches(image, 10, np.random.default_rng(5))
    again, *_ = training_patches(image, 10, np.random.default_rng(5))
    np.testing.assert_array_equal(first, again)
    assert np.bincount(kind).tolist() == [4, 2, 4]
    assert (snr_dB[kind != DEGRADED] == NOISE_FREE_DB).all()
    assert (snr_dB[kind == DEGRADED] < NOISE_FREE_DB).any()


@pytest.mark.parametrize(("sd", "ratio_dB"), [(0.0, NOISE_FREE_DB), (3.0, 20.0), (30.0, 0.0)])
def test_the_ratio_of_noise_is_that_of_grey_levels(sd, ratio_dB, rng):
    waves = 128 + 30 * np.sqrt(2) * np.sin(np.arange(512) * 2 * np.pi / 32)
    image = np.repeat(np.tile(waves, (512, 1))[..., None], 3, axis=2).astype(np.uint8)
    changed, found_dB = noisy(image, rng.normal(0, sd, (512, 512, 1)))
    assert found_dB == pytest.approx(ratio_dB, abs=0.3)
    assert (changed.astype(int) - image).std() == pytest.approx(sd, abs=0.3)


def test_copies_for_noise_reach_from_none_to_nothing_else(rng):
    patches = textures(rng, n=200)
    copies, snr_dB = noise_copies(patches, rng)
    assert copies.shape == patches.shape
    assert np.quantile(snr_dB, 0.1) < -15 < 10 < np.quantile(snr_dB, 0.9)


def test_quality_names_what_is_wrong(rng):
    sharp = textures(rng, n=40)
    blurred = np.stack([motion_blur(patch, 25, 0.0) for patch in sharp])
    rows = patch_features(np.concatenate([sharp, blurred]))
    limits = learn_limits(rows, np.arange(80) < 40)
    good, reasons = rated(light(sharp), rows[:40], limits)
    assert np.mean(good > 0.9) > 0.8
    assert sum(bool(reason) for reason in reasons) < 8
    faulty = {
        "blurred": blurred[:4],
        "dark": (sharp[:4] * 0.05).astype(np.uint8),
        "overexposed or underexposed": np.clip(sharp[:4].astype(int) + 125, 0, 255).astype(np.uint8),
        "no texture": (120 + (sharp[:4].astype(int) - 120) // 20).astype(np.uint8),
    }
    for name, patches in faulty.items():
        quality, said = rated(light(patches), patch_features(patches), limits)
        assert (quality < 0.8).all(), name
        assert all(name in reason for reason in said), (name, said)


def test_quality_falls_with_distance_and_speed(rng):
    patches = textures(rng, n=3)
    rows = patch_features(patches)
    limits = {"sharp": -9.0, "blurred": -12.0}
    pixels, share = np.array([100.0, 26.0, 10.0]), np.array([0.0, 0.5, np.nan])
    far, said = rated(light(patches), rows, limits, resolution_px=pixels)
    assert far == pytest.approx([1.0, 0.5, 0.0])
    assert said[2] == ("too few pixels on the ground",)
    fast, said = rated(light(patches), rows, limits, blur_share=share)
    assert fast == pytest.approx([1.0, 0.625, 1.0])
    assert said[1] == ("moving fast for the exposure",)
