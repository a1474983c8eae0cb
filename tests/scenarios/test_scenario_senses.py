"""What the synthetic camera sees and the synthetic microphone hears is what ground at that place would show."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
import synthetic_samples as samples
from bevameter.framework.core.classifier.signal_to_noise import NOISE_FREE_DB
from bevameter.framework.core.vehicle import Camera
from bevameter.framework.scenario.contact_sound import VOICES, contact_sound, engine, motor_whine, wind
from bevameter.framework.scenario.ground import PAINTERS, paint_tile
from bevameter.framework.scenario.hearing import heard
from bevameter.framework.scenario.plan import make_plan
from bevameter.framework.scenario.presets import PRESETS
from bevameter.framework.scenario.seeing import ground_sites
from bevameter.framework.scenario.view import GroundSite, View
from synthetic_samples import SAMPLE_CLASSES, labelled_looks, labelled_sounds

RATE = 22050


def _camera(distorted: bool = False) -> Camera:
    camera = PRESETS["rover4" if distorted else "demo"].vehicle.camera
    assert camera is not None
    return camera


def _image_of(camera: Camera, points_m: np.ndarray) -> np.ndarray:
    """Pixels (n, 2) of points (n, 3) of the vehicle frame, by OpenCV's own projection."""
    p = camera.pitch_rad
    axes = np.array([[0.0, -1.0, 0.0], [-math.sin(p), 0.0, -math.cos(p)], [math.cos(p), 0.0, -math.sin(p)]])
    origin = np.array([camera.forward_m, camera.left_m, camera.height_m])
    turn, _ = cv2.Rodrigues(axes)
    distortion = np.array(camera.distortion or (0.0,) * 4)
    pixels, _ = cv2.projectPoints(points_m, turn, -axes @ origin, camera.intrinsics, distortion)
    return pixels.reshape(-1, 2)


def _patch(view: View, site: GroundSite, place: tuple[float, float, float], centre: tuple[float, float]) -> np.ndarray:
    """Grey values of half a metre of ground about a spot of the site frame, as seen from a place."""
    ground = view.ground([site], place)
    full = np.zeros((view.camera.height_px, view.camera.width_px), dtype=np.float32)
    full[view.first_row :] = ground.mean(axis=2)
    x, y = np.meshgrid(centre[0] + np.linspace(-0.25, 0.25, 40), centre[1] + np.linspace(-0.25, 0.25, 40))
    cos, sin = math.cos(place[2]), math.sin(place[2])
    ahead = cos * (x - place[0]) + sin * (y - place[1])
    left = cos * (y - place[1]) - sin * (x - place[0])
    pixels = _image_of(view.camera, np.stack([ahead.ravel(), left.ravel(), np.zeros(x.size)], axis=1))
    u, v = (pixels[:, i].astype(np.float32).reshape(x.shape) for i in range(2))
    assert u.min() > 0
    assert v.max() < view.camera.height_px - 1
    return cv2.remap(full, u, v, cv2.INTER_LINEAR)


@pytest.mark.parametrize("distorted", [False, True])
def test_a_spot_looks_the_same_from_frame_to_frame(distorted: bool) -> None:
    rng = np.random.default_rng(0)
    view = View(_camera(distorted), rng)
    site = GroundSite.make(paint_tile("gravel", rng, size=512), rng, None)
    spot = (103.0, -41.0)
    seen = [
        _patch(view, site, (spot[0] - reach * math.cos(yaw), spot[1] - reach * math.sin(yaw), yaw), spot)
        for reach, yaw in ((1.5, 0.3), (1.9, 0.3), (1.7, 0.55))
    ]
    elsewhere = _patch(view, site, (spot[0] - 1.5, spot[1] + 0.4, 0.0), (spot[0], spot[1] + 0.4))
    for other in seen[1:]:
        assert np.corrcoef(seen[0].ravel(), other.ravel())[0, 1] > 0.75
    assert abs(np.corrcoef(seen[0].ravel(), elsewhere.ravel())[0, 1]) < 0.3


def test_a_boundary_is_crossed_where_the_labels_say() -> None:
    plan = make_plan(PRESETS["short"], 2)
    sites = ground_sites(plan, tile_px=128)
    for site, stretch in zip(sites[1:], plan.stretches[1:], strict=True):
        for off, expected in ((-0.05, False), (0.05, True)):
            here = np.interp(stretch.start_m + off, plan.way_m, plan.time_s)
            assert bool(site.beyond(plan.at(plan.x_m, here), plan.at(plan.y_m, here))) is expected


def test_blur_grows_with_speed() -> None:
    rng = np.random.default_rng(1)
    view = View(_camera(), rng)
    site = GroundSite.make(paint_tile("loam", rng, size=512), rng, None)
    exposure = view.camera.exposure_s
    assert exposure is not None
    near = [
        view.ground([site], (3.0, 4.0, 0.2), speed * exposure)[-200:].mean(axis=2) for speed in (0.1, 1.0, 2.0, 4.0)
    ]
    sharpness = [cv2.Laplacian(image, cv2.CV_32F).std() for image in near]
    assert np.all(np.diff(sharpness) < 0)
    assert sharpness[-1] < 0.6 * sharpness[0]


def test_tiles_are_seamless_and_sites_differ() -> None:
    for name in PAINTERS:
        tile = paint_tile(name, np.random.default_rng(4), size=256).astype(float)
        inside = np.abs(np.diff(tile, axis=1)).mean()
        assert np.abs(tile[:, 0] - tile[:, -1]).mean() < 2.0 * inside + 2.0, name
        assert np.abs(tile[0] - tile[-1]).mean() < 2.0 * np.abs(np.diff(tile, axis=0)).mean() + 2.0, name
        other = paint_tile(name, np.random.default_rng(5), size=256).astype(float)
        assert np.abs(tile - other).mean() > 5.0, name


def _bands(sound: np.ndarray) -> np.ndarray:
    """Share of the power below 600 Hz, up to 2.5 kHz, and above."""
    power = np.abs(np.fft.rfft(sound)) ** 2
    cuts = (np.array([600, 2500]) * len(sound) / RATE).astype(int)
    parts = np.array([part.sum() for part in np.split(power, cuts)])
    return parts / parts.sum()


def test_contact_sound_is_louder_when_faster_and_classes_differ() -> None:
    shares = {}
    for name in VOICES:
        slow, fast = (
            contact_sound(name, np.full(2 * RATE, v), RATE, np.random.default_rng(2), site=np.random.default_rng(9))
            for v in (0.3, 3.0)
        )
        assert fast.std() > 2.5 * slow.std() > 0, name
        shares[name] = _bands(fast)
    assert shares["clay"][0] > 0.6
    assert shares["sand"][2] > 0.7
    assert shares["grass"][2] > 0.7
    assert shares["gravel"][1:].sum() > 0.6
    assert shares["loam"][2] < 0.3


def test_whine_follows_the_wheel() -> None:
    rng = np.random.default_rng(0)
    peaks = []
    for omega in (2.0, 4.0):
        power = np.abs(np.fft.rfft(motor_whine(np.full(RATE, omega), RATE, np.random.default_rng(3))))
        peaks.append(np.argmax(power))
    assert peaks[1] == pytest.approx(2 * peaks[0], rel=0.03)
    assert _bands(wind(2 * RATE, RATE, rng))[0] > 0.9
    assert _bands(engine(2 * RATE, RATE, rng))[0] > 0.6


def test_microphone_faults_are_in_the_sound() -> None:
    plan = make_plan(PRESETS["short"], 1)
    sound = np.concatenate(list(heard(plan)))
    start = PRESETS["short"].sound_start_s
    assert len(sound) == int((70.0 - start) * RATE)
    assert np.abs(sound).max() <= 1.0

    def cut(first: float, last: float) -> np.ndarray:
        return sound[round((first - start) * RATE) : round((last - start) * RATE)]

    assert np.all(cut(50.01, 53.99) == 0)
    assert np.all(cut(48.0, 50.0).std() > 0)
    assert _bands(cut(34.5, 38.5))[0] > 0.8 > _bands(cut(28.5, 31.0))[0]
    assert cut(42.5, 46.5).std() > 5.0 * cut(39.5, 41.5).std()


def are_grouped(labels, groups, sites: int) -> bool:
    """Whether every class has so many sites, named after it."""
    named = all(group.startswith(label) for label, group in zip(labels, groups, strict=True))
    return named and set(labels) == set(SAMPLE_CLASSES) and len(set(groups)) == sites * len(SAMPLE_CLASSES)


def test_looks_are_labelled_grouped_and_repeatable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(samples, "_EYES", 2)
    looks = labelled_looks(np.random.default_rng(0), 1)
    n = len(looks.patches)
    assert looks.patches.shape == (n, 64, 64, 3)
    assert looks.patches.dtype == np.uint8
    assert len(looks.labels) == len(looks.groups) == len(looks.blurred) == n
    assert 0 < looks.blurred.sum() < n
    again = labelled_looks(np.random.default_rng(0), 1)
    assert np.array_equal(looks.patches, again.patches)
    assert are_grouped(looks.labels, looks.groups, 1)


def test_sounds_are_labelled_and_grouped() -> None:
    reported: list[float] = []
    sounds = labelled_sounds(np.random.default_rng(0), 2, reported.append)
    assert reported[-1] == 1.0
    assert np.all(np.diff(reported) > 0)
    assert sounds.windows.dtype == np.float32
    assert np.abs(sounds.windows).max() <= 1.0
    assert sounds.windows.std(axis=1).min() > 1e-4
    assert (sounds.snr_dB < 0).any()
    assert (sounds.snr_dB >= NOISE_FREE_DB).any()
    assert are_grouped(sounds.labels, sounds.groups, 2)
