"""Square crops of a photograph at several scales: what a photograph is judged by, and trained on."""

from __future__ import annotations

import cv2
import numpy as np

from .features import PATCH_PX

IMAGE_PX = 512
"""Short side that larger photographs are reduced to [px]."""
SIDES = ((1.0, 1), (0.6, 2), (0.35, 3))
"""Side of a crop as a share of the image's short side, and how many stand along each axis."""


def reduced(image: np.ndarray) -> np.ndarray:
    """Reduce an image to a short side of `IMAGE_PX`; smaller ones stay as they are."""
    factor = IMAGE_PX / min(image.shape[:2])
    if factor >= 1:
        return image
    size = (max(1, round(image.shape[1] * factor)), max(1, round(image.shape[0] * factor)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def image_patches(image: np.ndarray, side_px: int = PATCH_PX) -> np.ndarray:
    """Cut an image (h, w, 3) into crops of `SIDES`, spread evenly, each of `side_px`: (n, side, side, 3) uint8."""
    image = reduced(image)
    height, width = image.shape[:2]
    short = min(height, width)
    patches: list[np.ndarray] = []
    for share, count in SIDES:
        side = max(round(share * short), min(16, short))
        tops, lefts = (np.unique(np.linspace(0, length - side, count).astype(int)) for length in (height, width))
        patches += [resized(image[y : y + side, x : x + side], side_px) for y in tops for x in lefts]
    return np.stack(patches)


def resized(square: np.ndarray, side_px: int) -> np.ndarray:
    """Give a square image (s, s, 3) another side [px]."""
    how = cv2.INTER_AREA if len(square) > side_px else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(square, (side_px, side_px), interpolation=how))
