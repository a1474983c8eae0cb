"""Patches cut from photographs of ground, and what a moving camera in changing light would have made of them."""

from __future__ import annotations

import cv2
import numpy as np

from .crops import image_patches, reduced
from .features import PATCH_PX

CROP_SHARES = (0.25, 0.8)
"""Range of the side of a turned crop, as a share of the photograph's short side: the same ground nearer and further."""
MAX_BLUR = 0.45
"""Longest motion blur, as a share of the side of a patch [-]."""
NOISE = (0.2, 12.0)
"""Range of the standard deviation of noise, of 255 [-]."""
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


def degraded(patch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A worse camera: coarser along the line of sight, out of focus, smeared, underexposed, noisy, compressed."""
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
    sd = np.exp(rng.uniform(*np.log(NOISE)))
    noise = rng.normal(0, sd, patch.shape if np.ptp(patch, axis=2).any() else (height, width, 1))
    patch = np.clip(patch + noise + 0.5, 0, 255).astype(np.uint8)
    if rng.random() < 0.5:
        _, data = cv2.imencode(".jpg", patch, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(50, 96))])
        patch = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)
    return patch


def whole_copies(image: np.ndarray, copies: int, rng: np.random.Generator, side_px: int = PATCH_PX) -> list[np.ndarray]:
    """Cut a photograph (h, w, 3) as it is judged: as it came, and so many copies in another light, by a worse camera.

    Each is (n, side_px, side_px, 3) uint8 (`image_patches`); what is wrong with a copy is wrong with all of its crops.
    """
    image = np.ascontiguousarray(reduced(image))
    versions = [image, *(degraded(relit(image, rng), rng) for _ in range(copies))]
    return [image_patches(version, side_px) for version in versions]


def training_patches(
    image: np.ndarray, n: int, rng: np.random.Generator, side_px: int = PATCH_PX
) -> tuple[np.ndarray, np.ndarray]:
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
    """
    image = reduced(image)
    kind = np.searchsorted(np.round(np.cumsum(SHARES) * n), np.arange(n), side="right")
    upright = image_patches(image, side_px)
    order = np.resize(rng.permutation(len(upright)), n)
    patches = np.empty((n, side_px, side_px, 3), dtype=np.uint8)
    for index in range(n):
        if kind[index] == AS_IT_IS:
            patches[index] = upright[order[index]]
            continue
        patch = relit(cut_patch(image, rng, side_px), rng)
        patches[index] = patch if kind[index] == RELIT else degraded(patch, rng)
    return patches, kind
