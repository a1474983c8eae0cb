"""Patches cut from photographs of ground, and what a moving camera in changing light would have made of them."""

from __future__ import annotations

import cv2
import numpy as np

from .features import PATCH_PX

CROP_PX = (64, 256)
"""Range of the side of a crop that becomes one patch [px]: the same ground nearer and further."""
MAX_BLUR = 0.45
"""Longest motion blur, as a share of the side of a patch [-]."""
AS_IT_IS, RELIT, DEGRADED = 0, 1, 2
"""What was done to a patch: nothing but cutting it; another light; another light and a worse camera."""
SHARES = (0.15, 0.3, 0.55)
"""Share of patches of each of these kinds [-]."""
UPRIGHT_SIDES = (0.19, 0.5)
"""Side of a patch cut as it is, as a share of the image's short side: the range that `classify` looks at."""


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


def cut_patch(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Cut one square at a random place, scale, turn and stretch, (64, 64, 3) uint8.

    Parameters
    ----------
    image : (h, w, 3)
        uint8, blue, green, red.
    """
    height, width = image.shape[:2]
    short = min(height, width)
    low, high = min(CROP_PX[0], 0.5 * short), min(CROP_PX[1], 0.7 * short)
    side = np.exp(rng.uniform(np.log(low), np.log(max(high, low))))
    stretch = np.exp(rng.uniform(-0.3, 0.3))
    turn = rng.uniform(0, 2 * np.pi)
    # Where the patch's axes lie in the image; the whole patch has to stay inside.
    axes = side / PATCH_PX * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    axes = axes * np.array([np.sqrt(stretch), 1 / np.sqrt(stretch)])
    if rng.random() < 0.5:
        axes[:, 0] *= -1
    reach = np.abs(axes).sum(axis=1) * PATCH_PX / 2
    room = np.array([width, height]) - 1 - 2 * reach
    if (room < 0).any():
        axes *= float(np.min((np.array([width, height]) - 1) / (2 * reach)))
        reach = np.abs(axes).sum(axis=1) * PATCH_PX / 2
        room = np.maximum(np.array([width, height]) - 1 - 2 * reach, 0.0)
    centre = reach + rng.random(2) * room
    # Shrinking without a filter would alias: average first.
    shrink = side / PATCH_PX
    source = cv2.GaussianBlur(image, (0, 0), 0.45 * shrink) if shrink > 1.3 else image
    matrix = np.column_stack([axes, centre - axes @ np.full(2, (PATCH_PX - 1) / 2)])
    return np.asarray(
        cv2.warpAffine(
            source,
            matrix,
            (PATCH_PX, PATCH_PX),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REFLECT_101,
        )
    )


def _light(patch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Another light: exposure, gamma, white balance, a little hue and saturation; clipping as it comes."""
    colour = patch.astype(np.float32) / 255
    grey = colour.mean(axis=2, keepdims=True)
    colour = grey + (colour - grey) * rng.uniform(0.4, 1.4)
    colour = np.clip(colour * np.exp(rng.normal(0, 0.08, 3)), 1e-4, None)
    colour = colour ** np.exp(rng.normal(0, 0.2)) * np.exp(rng.normal(0, 0.3))
    if rng.random() < 0.3:  # the edge of a shadow
        angle, at = rng.uniform(0, 2 * np.pi), rng.uniform(-0.4, 0.4)
        y, x = np.mgrid[0:PATCH_PX, 0:PATCH_PX] / PATCH_PX - 0.5
        lit = 1 / (1 + np.exp(-(x * np.cos(angle) + y * np.sin(angle) - at) * rng.uniform(10, 60)))
        colour *= (1 - rng.uniform(0.2, 0.6) * lit)[:, :, None]
    return np.clip(colour * 255 + 0.5, 0, 255).astype(np.uint8)


def _camera(patch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A moving camera further away: coarser along the line of sight, out of focus, smeared, noisy, compressed."""
    if rng.random() < 0.6:
        coarse = np.maximum(8, PATCH_PX / np.exp(rng.uniform(0, np.log(3), 2))).astype(int)
        small = cv2.resize(patch, (int(coarse[0]), int(coarse[1])), interpolation=cv2.INTER_AREA)
        patch = np.asarray(cv2.resize(small, (PATCH_PX, PATCH_PX), interpolation=cv2.INTER_LINEAR))
    if rng.random() < 0.3:
        patch = np.asarray(cv2.GaussianBlur(patch, (0, 0), rng.uniform(0.4, 1.6)))
    if rng.random() < 0.7:
        patch = motion_blur(patch, MAX_BLUR * PATCH_PX * rng.random() ** 1.5, rng.uniform(0, np.pi))
    noise = rng.exponential(2.0)
    patch = np.clip(patch + rng.normal(0, noise, patch.shape) + 0.5, 0, 255).astype(np.uint8)
    if rng.random() < 0.5:
        _, data = cv2.imencode(".jpg", patch, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(50, 96))])
        patch = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)
    return patch


def training_patches(image: np.ndarray, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Cut and vary patches of one photograph.

    Parameters
    ----------
    image : (h, w, 3)
        uint8, blue, green, red.
    n
        How many.

    Returns
    -------
    patches : (n, 64, 64, 3)
        uint8.
    kind : (n,)
        `AS_IT_IS`, `RELIT` or `DEGRADED`.
    """
    edges = np.round(np.cumsum(SHARES) * n)
    kind = np.searchsorted(edges, np.arange(n), side="right")
    patches = np.empty((n, PATCH_PX, PATCH_PX, 3), dtype=np.uint8)
    for index in range(n):
        if kind[index] == AS_IT_IS:
            patches[index] = _upright(image, rng)
            continue
        patch = _light(cut_patch(image, rng), rng)
        patches[index] = patch if kind[index] == RELIT else _camera(patch, rng)
    return patches, kind


def _upright(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A square cut out at a random place and scale and resampled, no more."""
    height, width = image.shape[:2]
    short = min(height, width)
    side = int(np.clip(round(rng.uniform(*UPRIGHT_SIDES) * short), min(48, short), short))
    top, left = int(rng.integers(height - side + 1)), int(rng.integers(width - side + 1))
    crop = image[top : top + side, left : left + side]
    how = cv2.INTER_AREA if side > PATCH_PX else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(crop, (PATCH_PX, PATCH_PX), interpolation=how))
