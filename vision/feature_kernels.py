"""Compiled loops over patches (n, 64, 64) of float32: each pixel is touched once or twice, and nothing is stored.

What they compute is described in `features`, which finishes their sums with logarithms and ratios. A patch that holds
NaN gives NaN. Reductions may be reordered for vector units, but NaN is respected.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_REORDER = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")
def difference_sums(norm, lags):
    """Mean size and mean square of differences at lags (l,), in four directions: each (n, l, 4)."""
    n, height, width = norm.shape
    size = np.empty((n, len(lags), 4), dtype=np.float32)
    square = np.empty((n, len(lags), 4), dtype=np.float32)
    for i in range(n):
        patch = norm[i]
        for k in range(len(lags)):
            lag = lags[k]
            for direction in range(4):
                down = 0 if direction == 0 else lag
                right = 0 if direction == 1 else lag
                falling = direction == 3
                first, last = (right, 0) if falling else (0, right)
                total = np.float32(0.0)
                squares = np.float32(0.0)
                for y in range(height - down):
                    here = patch[y, first : width - right + first]
                    there = patch[y + down, last : width - right + last]
                    for x in range(width - right):
                        step = there[x] - here[x]
                        total += abs(step)
                        squares += step * step
                count = np.float32((height - down) * (width - right))
                size[i, k, direction] = total / count
                square[i, k, direction] = squares / count
    return size, square


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")
def pattern_counts(source, radius, table):
    """Histogram of local binary patterns at a radius [px], codes binned by `table` (256,): (n, 10)."""
    n, height, width = source.shape
    inner = width - 2 * radius
    counts = np.zeros((n, 10), dtype=np.float32)
    code = np.empty(inner, dtype=np.uint8)
    for i in range(n):
        patch = source[i]
        for y in range(radius, height - radius):
            above, middle, below = patch[y - radius], patch[y], patch[y + radius]
            for x in range(inner):
                here = middle[x + radius]
                bits = np.uint8(0)
                bits |= np.uint8(above[x] > here)
                bits |= np.uint8(above[x + radius] > here) << np.uint8(1)
                bits |= np.uint8(above[x + 2 * radius] > here) << np.uint8(2)
                bits |= np.uint8(middle[x + 2 * radius] > here) << np.uint8(3)
                bits |= np.uint8(below[x + 2 * radius] > here) << np.uint8(4)
                bits |= np.uint8(below[x + radius] > here) << np.uint8(5)
                bits |= np.uint8(below[x] > here) << np.uint8(6)
                bits |= np.uint8(middle[x] > here) << np.uint8(7)
                code[x] = bits
            for x in range(inner):
                counts[i, table[code[x]]] += np.float32(1.0)
    return counts


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")
def gradient_products(norm):
    """Structure tensor of central differences, averaged over 4 x 4 px: xx - yy, 2 xy, xx + yy, (n, 3, 16, 16)."""
    n, height, width = norm.shape
    answer = np.zeros((n, 3, height // 4, width // 4), dtype=np.float32)
    for i in range(n):
        patch = norm[i]
        for y in range(height):
            inside = 0 < y < height - 1
            for x in range(width):
                gx = patch[y, x + 1] - patch[y, x - 1] if 0 < x < width - 1 else np.float32(0.0)
                gy = patch[y + 1, x] - patch[y - 1, x] if inside else np.float32(0.0)
                answer[i, 0, y // 4, x // 4] += gx * gx - gy * gy
                answer[i, 1, y // 4, x // 4] += np.float32(2.0) * gx * gy
                answer[i, 2, y // 4, x // 4] += gx * gx + gy * gy
    return answer / np.float32(16.0)


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")
def band_sums(band):
    """Means of |b|, b^2 and b^3 of each patch, (n, 3), and of |b| over blocks of 8 x 8 px, (n, 64)."""
    n, height, width = band.shape
    moments = np.empty((n, 3), dtype=np.float32)
    blocks = np.zeros((n, height // 8, width // 8), dtype=np.float32)
    for i in range(n):
        total = np.float32(0.0)
        squares = np.float32(0.0)
        cubes = np.float32(0.0)
        for y in range(height):
            for column in range(width // 8):
                part = np.float32(0.0)
                for x in range(8 * column, 8 * column + 8):
                    value = band[i, y, x]
                    part += abs(value)
                    squares += value * value
                    cubes += value * value * value
                blocks[i, y // 8, column] += part
                total += part
        count = np.float32(height * width)
        moments[i, 0] = total / count
        moments[i, 1] = squares / count
        moments[i, 2] = cubes / count
    return moments, blocks.reshape(n, -1) / np.float32(64.0)


@njit(cache=True, nogil=True, error_model="numpy")
def hue_sums(red_green, yellow_blue, sectors):
    """Chroma of pixels (n, m) by sector of hue, over the number of pixels: (n, sectors)."""
    n, count = red_green.shape
    answer = np.zeros((n, sectors), dtype=np.float32)
    turn = sectors / (2 * np.pi)
    for i in range(n):
        for j in range(count):
            a, b = red_green[i, j], yellow_blue[i, j]
            sector = int((math.atan2(b, a) + np.pi) * turn)
            answer[i, min(sector, sectors - 1)] += math.sqrt(a * a + b * b)
    return answer / np.float32(count)
