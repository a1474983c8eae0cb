"""Patches cut from photographs of ground, and what a moving camera in changing light would have made of them."""

from __future__ import annotations

import cv2
import numpy as np

from ..framework.core.classifier.signal_to_noise import NOISE_FREE_DB
from .crops import image_patches, reduced
from .features import PATCH_PX

CROP_SHARES = (0.25, 0.8)
"""Range of the side of a turned crop, as a share of the photograph's short side: the same ground nearer and further."""
MAX_BLUR = 0.45
"""Longest motion blur, as a share of the side of a patch [-]."""
NOISE = (0.2, 12.0)
"""Range of the standard deviation of noise in copies that teach what ground looks like, of 255 [-]."""
STRONGEST_NOISE = 100.0
"""Most of it in copies from which it is learnt what noise is and what it costs, of 255 [-]: nothing is left of the
ground. If as much taught what ground looks like, blurred and dark photographs would be recognised less well."""
GRAIN_PX = (0.5, 2.5)
"""Range of the size of a grain of noise [px]: a patch is seen on more or fewer pixels of the camera than it has."""
SNR_DB = (-32.0, 25.0)
"""Range of the contrast of the ground over noise, in copies that teach what noise is [dB]."""
FADED = 0.05
"""Least contrast that is left of the ground in these [-]: a flat noisy patch is to be known for what it is, too."""
_ROUNDING = 0.29
"""Standard deviation of what 8 bits round off [-]."""
MIN_LIGHT = 0.2
"""Least share of the light that reaches an underexposed image [-]."""
GREY_SHARE = 0.1
"""Share of relit patches that lose their colour, as to a monochrome camera [-]."""
AS_IT_IS, RELIT, DEGRADED = 0, 1, 2
"""What was done to a patch: nothing but cutting it; another light; another light and a worse camera."""
SHARES = (0.4, 0.2, 0.4)
"""Share of patches of each of these kinds [-]."""


def motion_blur(image: np.ndarray, length_px: float, direction_rad: float) -> np.ndarray:
    """Smear an image evenly along a line of `length_px` [px], as motion during exposure does."""
    if length_px < 1.0:
        return image
    half = int(np.ceil(length_px / 2)) + 1
    along = np.linspace(-0.5, 0.5, 8 * half) * length_px
    kernel = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
    x, y = half + along * np.cos(direction_rad), half + along * np.sin(direction_rad)
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    for dx in (0, 1):
        for dy in (0, 1):
            share = np.abs(1 - dx - (x - column)) * np.abs(1 - dy - (y - row))
            np.add.at(kernel, (np.minimum(row + dy, 2 * half), np.minimum(column + dx, 2 * half)), share)
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REFLECT_101))


def cut_patch(image: np.ndarray, rng: np.random.Generator, side_px: int = PATCH_PX) -> np.ndarray:
    """Cut one square at a random place, scale, turn, stretch and tilt, (side_px, side_px, 3) uint8.

    Parameters
    ----------
    image : (h, w, 3)
        uint8, blue, green, red.
    """
    height, width = image.shape[:2]
    side = min(height, width) * np.exp(rng.uniform(*np.log(CROP_SHARES)))
    stretch, turn = np.exp(rng.uniform(-0.3, 0.3)), rng.uniform(0, 2 * np.pi)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    axes = axes * (side / 2 * np.array([np.sqrt(stretch), 1 / np.sqrt(stretch)]))
    if rng.random() < 0.5:
        axes[:, 0] *= -1
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * rng.uniform(0.8, 1.0, (4, 2)) @ axes.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    # The whole patch has to stay inside.
    room = np.array([width, height]) - 1 - (high - low)
    if (room < 0).any():
        corners *= float(np.min((np.array([width, height]) - 1) / (high - low)))
        low = corners.min(axis=0)
        room = np.maximum(np.array([width, height]) - 1 - (corners.max(axis=0) - low), 0.0)
    corners += rng.random(2) * room - low
    # Shrinking without a filter would alias: average first.
    shrink = side / side_px
    source = cv2.GaussianBlur(image, (0, 0), 0.45 * shrink) if shrink > 1.3 else image
    last = side_px - 1
    square = np.array([[0, 0], [last, 0], [last, last], [0, last]], dtype=np.float32)
    matrix = cv2.getPerspectiveTransform(corners.astype(np.float32), square)
    return np.asarray(
        cv2.warpPerspective(
            source, matrix, (side_px, side_px), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101
        )
    )


def relit(patch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Another light: exposure, gamma, white balance, saturation, the edge of a shadow; clipping as it comes."""
    colour = patch.astype(np.float32) / 255
    grey = colour.mean(axis=2, keepdims=True)
    colour = grey + (colour - grey) * (0.0 if rng.random() < GREY_SHARE else rng.uniform(0.4, 1.4))
    if (colour != grey).any():
        colour *= np.exp(rng.normal(0, 0.08, 3))
    colour = np.clip(colour, 1e-4, None) ** np.exp(rng.normal(0, 0.2)) * np.exp(rng.normal(0, 0.3))
    if rng.random() < 0.3:
        angle, at = rng.uniform(0, 2 * np.pi), rng.uniform(-0.4, 0.4)
        y, x = np.mgrid[0 : patch.shape[0], 0 : patch.shape[1]] / np.reshape(patch.shape[:2], (2, 1, 1)) - 0.5
        dark = 1 / (1 + np.exp(-(x * np.cos(angle) + y * np.sin(angle) - at) * rng.uniform(10, 60)))
        colour *= (1 - rng.uniform(0.2, 0.6) * dark)[:, :, None]
    return np.clip(colour * 255 + 0.5, 0, 255).astype(np.uint8)


def noisy(patch: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, float]:
    """Add noise (h, w, 3) or (h, w, 1) to a patch (h, w, 3) uint8.

    Returns
    -------
    patch : (h, w, 3)
        uint8.
    snr_dB
        How far the spread of the patch's grey levels stands above that of the noise [dB], at most `NOISE_FREE_DB`.
    """
    changed = np.clip(patch + noise + 0.5, 0, 255).astype(np.uint8)
    grey = cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY).astype(np.float32)
    spread, added = float(grey.std()), float((cv2.cvtColor(changed, cv2.COLOR_BGR2GRAY) - grey).std())
    snr_dB = 20 * np.log10(max(spread, _ROUNDING) / max(added, _ROUNDING))
    return changed, min(float(snr_dB), NOISE_FREE_DB)


def degraded(patch: np.ndarray, rng: np.random.Generator, strongest: float = NOISE[1]) -> tuple[np.ndarray, float]:
    """A worse camera: coarser along the line of sight, out of focus, smeared, underexposed, noisy, compressed.

    Gives the patch, and how far its ground stands above the noise [dB] (`noisy`); `strongest` is the most noise
    [of 255].
    """
    patch = _badly_seen(patch, rng)
    sd = np.exp(rng.uniform(np.log(NOISE[0]), np.log(strongest)))
    shape = patch.shape if np.ptp(patch, axis=2).any() else (*patch.shape[:2], 1)
    patch, snr_dB = noisy(patch, rng.normal(0, sd, shape))
    return _stored(patch, rng), snr_dB


def _badly_seen(patch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What is wrong before there is noise: coarse, out of focus, smeared, underexposed."""
    (height, width), side = patch.shape[:2], min(patch.shape[:2])
    if rng.random() < 0.6:
        coarse = np.maximum(8, np.array([width, height]) / np.exp(rng.uniform(0, np.log(3), 2))).astype(int)
        small = cv2.resize(patch, (int(coarse[0]), int(coarse[1])), interpolation=cv2.INTER_AREA)
        patch = np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR))
    if rng.random() < 0.3:
        patch = np.asarray(cv2.GaussianBlur(patch, (0, 0), rng.uniform(0.4, 1.6) * side / PATCH_PX))
    if rng.random() < 0.7:
        patch = motion_blur(patch, MAX_BLUR * side * rng.random() ** 1.5, rng.uniform(0, np.pi))
    if rng.random() < 0.3:
        patch = (patch * np.exp(rng.uniform(np.log(MIN_LIGHT), 0))).astype(np.uint8)
    return patch


def noise_copies(patches: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Fade patches (n, s, s, 3) and add noise, to learn from what it looks like; give `noisy`'s ratios (n,), too."""
    copies, snr_dB = np.empty_like(patches), np.empty(len(patches))
    for index, patch in enumerate(patches):
        if rng.random() < 0.5:
            patch = _badly_seen(patch, rng)
        mean = patch.mean(axis=(0, 1))
        faded = (mean + (patch - mean) * np.exp(rng.uniform(np.log(FADED), 0)) + 0.5).astype(np.uint8)
        spread = max(float(cv2.cvtColor(faded, cv2.COLOR_BGR2GRAY).std()), _ROUNDING)
        sd = min(spread * 10 ** (-rng.uniform(*SNR_DB) / 20), STRONGEST_NOISE)
        copy, snr_dB[index] = noisy(faded, _grains(patch, sd, rng))
        copies[index] = _stored(copy, rng)
    return copies, snr_dB


def _grains(patch: np.ndarray, sd: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of any grain for a patch (h, w, 3), (h, w, 3), or of brightness alone (h, w, 1)."""
    height, width = patch.shape[:2]
    grain = float(np.exp(rng.uniform(*np.log(GRAIN_PX))))
    coloured = np.ptp(patch, axis=2).any() and rng.random() < 0.5
    grains = rng.normal(0, sd, (int(np.ceil(height / grain)), int(np.ceil(width / grain)), 3 if coloured else 1))
    how = cv2.INTER_AREA if grain < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(grains, (width, height), interpolation=how)).reshape(height, width, -1)


def _stored(patch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One time in two, as a camera gives it that compresses."""
    if rng.random() >= 0.5:
        return patch
    _, data = cv2.imencode(".jpg", patch, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(50, 96))])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)


def whole_copies(image: np.ndarray, copies: int, rng: np.random.Generator, side_px: int = PATCH_PX) -> list[np.ndarray]:
    """Cut a photograph (h, w, 3) as it is judged: as it came, and so many copies in another light, by a worse camera.

    Each is (n, side_px, side_px, 3) uint8 (`image_patches`); what is wrong with a copy is wrong with all of its crops.
    """
    image = np.ascontiguousarray(reduced(image))
    versions = [image, *(degraded(relit(image, rng), rng, STRONGEST_NOISE)[0] for _ in range(copies))]
    return [image_patches(version, side_px) for version in versions]


def training_patches(
    image: np.ndarray, n: int, rng: np.random.Generator, side_px: int = PATCH_PX
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut and vary patches of one photograph.

    Parameters
    ----------
    image : (h, w, 3)
        uint8, blue, green, red.
    n
        How many.
    side_px
        Side s of a patch [px].

    Returns
    -------
    patches : (n, s, s, 3)
        uint8.
    kind : (n,)
        `AS_IT_IS` (some of `image_patches`), `RELIT` or `DEGRADED`.
    snr_dB : (n,)
        How far the ground stands above the noise that was added [dB]; `NOISE_FREE_DB` where none was.
    """
    image = reduced(image)
    kind = np.searchsorted(np.round(np.cumsum(SHARES) * n), np.arange(n), side="right")
    upright = image_patches(image, side_px)
    order = np.resize(rng.permutation(len(upright)), n)
    patches, snr_dB = np.empty((n, side_px, side_px, 3), dtype=np.uint8), np.full(n, NOISE_FREE_DB)
    for index in range(n):
        if kind[index] == AS_IT_IS:
            patches[index] = upright[order[index]]
            continue
        patch = relit(cut_patch(image, rng, side_px), rng)
        if kind[index] == DEGRADED:
            patch, snr_dB[index] = degraded(patch, rng)
        patches[index] = patch
    return patches, kind, snr_dB
