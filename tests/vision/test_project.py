"""The camera over flat ground, against points projected by hand and against an image painted by rays."""

import math

import cv2
import numpy as np
import pytest
from bevameter.framework.core.vehicle import Camera
from bevameter.vision.features import PATCH_PX
from bevameter.vision.project import ground_patches, ground_to_image


def camera(**changes):
    given = {
        "matrix": ((420.0, 0.0, 319.5), (0.0, 430.0, 239.5), (0.0, 0.0, 1.0)),
        "width_px": 640,
        "height_px": 480,
        "height_m": 0.9,
        "pitch_rad": math.radians(25.0),
        "forward_m": 0.4,
    }
    return Camera(**(given | changes))


def ray_to_ground(lens, column, row):
    """Where the line of sight of a pixel meets the ground: built from angles, not from a matrix."""
    right = (column - lens.matrix[0][2]) / lens.matrix[0][0]
    down = (row - lens.matrix[1][2]) / lens.matrix[1][1]
    forward = math.cos(lens.pitch_rad) - down * math.sin(lens.pitch_rad)
    drop = math.sin(lens.pitch_rad) + down * math.cos(lens.pitch_rad)
    reach = lens.height_m / drop
    return lens.forward_m + reach * forward, lens.left_m - reach * right


def test_projection_and_rays_agree():
    lens = camera(left_m=0.2)
    for column, row in [(319.5, 239.5), (10, 400), (630, 470), (100, 250)]:
        pixels, inside = ground_to_image(lens, np.array([ray_to_ground(lens, column, row)]))
        np.testing.assert_allclose(pixels[0], (column, row), atol=1e-6)
        assert inside[0]


def test_optical_axis_meets_the_ground_where_the_pitch_says():
    lens = camera()
    pixels, _ = ground_to_image(lens, np.array([[0.4 + 0.9 / math.tan(lens.pitch_rad), 0.0]]))
    np.testing.assert_allclose(pixels[0], (319.5, 239.5), atol=1e-9)


def test_left_is_left_and_points_behind_are_not_projected():
    pixels, inside = ground_to_image(camera(), np.array([[2.0, 0.5], [2.0, -0.5], [-5.0, 0.0]]))
    assert pixels[0, 0] < 319.5 < pixels[1, 0]
    assert np.isnan(pixels[2]).all()
    assert inside.tolist() == [True, True, False]


def test_distortion_follows_the_polynomial():
    k1, k2, p1, p2 = -0.2, 0.05, 0.001, -0.002
    lens = camera(distortion=(k1, k2, p1, p2))
    point = np.array([[1.6, 0.4]])
    straight = ground_to_image(camera(), point)[0][0]
    x, y = (straight[0] - 319.5) / 420, (straight[1] - 239.5) / 430
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2 * r2
    bent = (
        420 * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + 319.5,
        430 * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + 239.5,
    )
    np.testing.assert_allclose(ground_to_image(lens, point)[0][0], bent, atol=1e-6)


def test_far_outside_the_view_distortion_does_not_fold_back():
    lens = camera(distortion=(-0.35, 0.0, 0.0, 0.0))
    _, inside = ground_to_image(lens, np.array([[0.6, y] for y in np.linspace(2, 40, 200)]))
    assert not inside.any()


@pytest.mark.parametrize("distortion", [(), (-0.15, 0.02, 0.0, 0.0)])
@pytest.mark.parametrize("side", [0.25, 0.5])
def test_patches_show_the_ground_they_stand_for(distortion, side):
    """Paint each pixel by the ground it sees, cut patches, and read the ground's coordinates back from them."""
    lens = camera(distortion=distortion)
    layout = ground_patches(lens, side)
    assert len(layout) >= 3
    # A picture whose colour is the place itself: each pixel's line of sight followed to the ground.
    column, row = np.meshgrid(np.arange(640.0), np.arange(480.0))
    seen = np.column_stack([column.ravel(), row.ravel()])
    if distortion:
        seen = cv2.undistortPoints(seen[:, None], lens.intrinsics, np.array(distortion), P=lens.intrinsics)[:, 0]
    with np.errstate(divide="ignore"):
        x, y = ray_to_ground(lens, *seen.T)
    ahead_of = (x > 0) & (x < 8)
    image = np.zeros((480 * 640, 3), dtype=np.uint8)
    image[:, 0] = np.where(ahead_of, np.clip(x * 40, 0, 255), 0)
    image[:, 1] = np.where(ahead_of, np.clip(y * 60 + 128, 0, 255), 0)
    image = image.reshape(480, 640, 3)
    patches = layout.cut(image)
    assert patches.shape == (len(layout), PATCH_PX, PATCH_PX, 3)
    for patch, (ahead, left) in zip(patches, layout.centre_m, strict=True):
        step = (np.arange(PATCH_PX) + 0.5 - PATCH_PX / 2) / PATCH_PX * side
        x_seen, y_seen = patch[:, :, 0] / 40.0, (patch[:, :, 1] - 128.0) / 60.0
        # Rows run from far to near, columns from left to right.
        np.testing.assert_allclose(x_seen.mean(axis=1), ahead - step, atol=0.045)
        np.testing.assert_allclose(y_seen.mean(axis=0), left - step, atol=0.03)


def test_layout_is_in_view_and_resolved():
    layout = ground_patches(camera(), 0.5)
    half = 0.25
    for dx in (-half, half):
        for dy in (-half, half):
            assert ground_to_image(camera(), layout.centre_m + np.array([dx, dy]))[1].all()
    assert (layout.resolution_px >= 24).all()
    assert (np.diff(np.unique(layout.centre_m[:, 0])) > 0.1).all()


def test_a_camera_of_too_low_resolution_has_no_patches():
    coarse = camera(matrix=((8.0, 0.0, 5.5), (0.0, 8.0, 4.5), (0.0, 0.0, 1.0)), width_px=12, height_px=10)
    layout = ground_patches(coarse, 0.3)
    assert len(layout) == 0
    assert layout.cut(np.zeros((10, 12, 3), dtype=np.uint8)).shape == (0, PATCH_PX, PATCH_PX, 3)
