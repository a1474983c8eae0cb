"""Labelled images and sounds of the synthetic world, for the small models that the package trains by itself.

They come from the generators that also make the traverses, but from other sites; a group is one site.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from ..core.vehicle import Camera
from .contact_sound import VOICES, contact_sound, engine, motor_whine, wind
from .ground import PAINTERS, paint_tile
from .presets import PRESETS
from .view import GroundSite, View

SAMPLE_CLASSES = tuple(sorted(PAINTERS))
"""Classes of the synthetic world."""

SOUND_RATE_HZ = 22050
SOUND_LENGTH_S = 3.0

_PER_SITE = 3
_TILE_PX = 512
_VIEWS = 4
_FROM_ABOVE = 1 / 6
_GREATEST_BLUR_M = 0.05


@dataclass(frozen=True)
class _Eye:
    view: View
    camera: Camera


def labelled_images(
    rng: np.random.Generator, n_per_class: int, *, side_px: int = 192
) -> tuple[list[np.ndarray], list[str], list[str]]:
    """Make images of ground seen from straight above, as rectified from what a moving camera took.

    Each is cut from a rendered frame: perspective has coarsened it the more the further away it was, motion has
    blurred it, sensor and exposure have left their marks. A sixth are photographs from straight above.

    Parameters
    ----------
    rng
        Source of randomness.
    n_per_class
        Images of each of `SAMPLE_CLASSES`.
    side_px
        Side of an image [px]; its pixels are 4 to 8 mm wide on the ground.

    Returns
    -------
    images
        (side, side, 3) uint8 BGR each.
    labels, groups
        Class and site of each.
    """
    eyes = [_eye(rng) for _ in range(_VIEWS)]
    images, labels, groups = [], [], []
    site: GroundSite | None = None
    for name, site_name in _sites(n_per_class):
        if site is None or groups[-1] != site_name:
            site = GroundSite.make(paint_tile(name, rng, size=_TILE_PX), rng, None)
        eye = eyes[rng.integers(len(eyes))]
        above = rng.random() < _FROM_ABOVE
        image = _from_above(site, rng, side_px) if above else _rectified(site, eye, rng, side_px)
        images.append(image)
        labels.append(name)
        groups.append(site_name)
    return images, labels, groups


def _sites(n_per_class: int) -> Iterator[tuple[str, str]]:
    """Class and site of each sample, a few samples of each site."""
    for name in SAMPLE_CLASSES:
        for index in range(n_per_class):
            yield name, f"{name}-{index // _PER_SITE:03d}"


def _eye(rng: np.random.Generator) -> _Eye:
    """A camera like that of the presets, mounted somewhat otherwise."""
    usual = PRESETS["demo"].vehicle.camera
    if usual is None:
        raise ValueError("the demo's vehicle has no camera")
    camera = usual.model_copy(
        update={
            "height_m": usual.height_m * math.exp(rng.normal(0.0, 0.12)),
            "pitch_rad": usual.pitch_rad + rng.normal(0.0, 0.04),
        }
    )
    return _Eye(View(camera, rng), camera)


def _rectified(site: GroundSite, eye: _Eye, rng: np.random.Generator, side_px: int) -> np.ndarray:
    place = (rng.uniform(-50.0, 50.0), rng.uniform(-50.0, 50.0), rng.uniform(-math.pi, math.pi))
    travel = _GREATEST_BLUR_M * rng.beta(0.5, 1.2)
    gain = math.exp(rng.normal(0.0, 0.2))
    frame = eye.view.frame([site], place, travel, gain, rng)
    pixel_m = _pixel_size(rng)
    half = 0.5 * side_px * pixel_m
    nearest = float(eye.view.ahead_m[-1].max()) + 0.02
    ahead = nearest + half + 3.2 * rng.beta(0.9, 1.6)
    left = rng.uniform(-0.5, 0.5) * max(ahead - half, 0.2)
    rows, columns = np.mgrid[:side_px, :side_px].astype(np.float32)
    x = ahead + half - (rows + 0.5) * pixel_m
    y = left + half - (columns + 0.5) * pixel_m
    u, v = _projected(eye.camera, x, y)
    return np.asarray(cv2.remap(frame, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101))


def _pixel_size(rng: np.random.Generator) -> float:
    return 0.004 * 2.0 ** rng.uniform(0.0, 1.0)


def _projected(camera: Camera, ahead_m: np.ndarray, left_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of places on the ground in the vehicle frame, for a lens without distortion."""
    x = ahead_m - camera.forward_m
    depth = x * math.cos(camera.pitch_rad) + camera.height_m * math.sin(camera.pitch_rad)
    down = camera.height_m * math.cos(camera.pitch_rad) - x * math.sin(camera.pitch_rad)
    matrix = camera.intrinsics
    u = matrix[0, 0] * (camera.left_m - left_m) / depth + matrix[0, 2]
    v = matrix[1, 1] * down / depth + matrix[1, 2]
    return u.astype(np.float32), v.astype(np.float32)


def _from_above(site: GroundSite, rng: np.random.Generator, side_px: int) -> np.ndarray:
    scale = _pixel_size(rng) / 0.004
    turn = rng.uniform(0.0, 2.0 * math.pi)
    tile = site.levels[0]
    rows, columns = np.mgrid[:side_px, :side_px].astype(np.float32) * np.float32(scale)
    u = math.cos(turn) * columns - math.sin(turn) * rows + rng.uniform(0, len(tile))
    v = math.sin(turn) * columns + math.cos(turn) * rows + rng.uniform(0, len(tile))
    photo = cv2.remap(tile, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    noisy = photo * math.exp(rng.normal(0.0, 0.2)) + rng.normal(0.0, 2.0, photo.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def labelled_sounds(
    rng: np.random.Generator, n_per_class: int
) -> tuple[list[tuple[np.ndarray, int]], list[str], list[str]]:
    """Make contact sounds at many speeds, with the drive's whine, the microphone's noise and, some, a disturbance.

    Parameters
    ----------
    rng
        Source of randomness.
    n_per_class
        Sounds of each of `SAMPLE_CLASSES`, each `SOUND_LENGTH_S` long.

    Returns
    -------
    sounds
        Samples (m,) float32 in [-1, 1] and their rate [Hz].
    labels, groups
        Class and site of each; the sounds of one site share its voice.
    """
    count = int(SOUND_LENGTH_S * SOUND_RATE_HZ)
    sounds, labels, groups = [], [], []
    voice_seed = 0
    for name, site_name in _sites(n_per_class):
        if not groups or groups[-1] != site_name:
            voice_seed = int(rng.integers(2**32))
        sounds.append((_sound(name, voice_seed, count, rng), SOUND_RATE_HZ))
        labels.append(name)
        groups.append(site_name)
    return sounds, labels, groups


def _sound(name: str, voice_seed: int, count: int, rng: np.random.Generator) -> np.ndarray:
    start, end = np.exp(rng.uniform(math.log(0.10), math.log(4.0), 2))
    if rng.random() < 0.7:
        end = start * math.exp(rng.normal(0.0, 0.1))
    speed = np.linspace(start, end, count)
    sound = contact_sound(name, speed, SOUND_RATE_HZ, rng, site=np.random.default_rng(voice_seed))
    sound = sound + motor_whine(speed / 0.25 / (1.0 - rng.uniform(0.0, 0.5)), SOUND_RATE_HZ, rng)
    sound += 0.0006 * rng.standard_normal(count, dtype=np.float32)
    chance = rng.random()
    if chance < 0.08:
        sound += rng.uniform(0.02, 0.3) * wind(count, SOUND_RATE_HZ, rng)
    elif chance < 0.14:
        sound += rng.uniform(0.02, 0.15) * engine(count, SOUND_RATE_HZ, rng)
    return np.clip(sound * math.exp(rng.normal(0.0, 0.25)), -1.0, 1.0).astype(np.float32)


if set(VOICES) != set(PAINTERS):
    raise RuntimeError("every class of the synthetic world has a look and a voice")
