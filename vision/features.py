"""What a patch of ground looks like: texture, colour and brightness.

Brightness and contrast are taken out before texture is measured, and directions are sorted rather than kept, so that
light, gamma and the turn of the vehicle change little. Brightness itself has columns of its own:
snow is bright and asphalt dark, and how far to trust that is learnt from copies in other light. Motion blur wipes out
detail along one direction only, hence energies of the least blurred direction are added to those of all.

Sources: uniform rotation-invariant local binary patterns, Ojala, Pietikainen, Maenpaa 2002
(doi:10.1109/TPAMI.2002.1017623); log-Gabor filters, Field 1987 (doi:10.1364/JOSAA.4.002379); sums over grey-level
differences in place of co-occurrence matrices, Unser 1986 (doi:10.1109/TPAMI.1986.4767760); structure tensor, Bigun
and Granlund 1987.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from scipy import fft

from .feature_kernels import band_sums, difference_sums, gradient_products, hue_sums, pattern_counts

PATCH_PX = 64
"""Side of a patch [px]; patches of another size are resampled to it."""
SCALES = (0.05, 0.1, 0.2, 0.4)
"""Centre frequencies of the filter bank [cycles/px]."""
ORIENTATIONS = 6
LBP_RADII = (1, 2, 4)
LAGS = (1, 2, 4, 8)
_BATCH = 64
HUES = 8
"""Sectors of hue [-]."""
_BANDS = ((0.02, 0.06), (0.06, 0.15), (0.15, 0.35))


def patch_features(patches: np.ndarray) -> np.ndarray:
    """Measure patches of ground.

    Parameters
    ----------
    patches : (n, 64, 64, 3)
        uint8, blue, green, red.

    Returns
    -------
    (n, d)
        Float; columns as `FEATURE_NAMES`. A patch without any contrast has rows that are not finite.

    Raises
    ------
    ValueError
        The patches are of another shape or type.
    """
    if patches.ndim != 4 or patches.shape[1:] != (PATCH_PX, PATCH_PX, 3) or patches.dtype != np.uint8:
        raise ValueError(f"patches must be (n, {PATCH_PX}, {PATCH_PX}, 3) uint8, got {patches.shape} {patches.dtype}")
    if not len(patches):
        return np.empty((0, len(FEATURE_NAMES)))
    return np.concatenate([_batch(patches[i : i + _BATCH]) for i in range(0, len(patches), _BATCH)])


def _batch(patches: np.ndarray) -> np.ndarray:
    n = len(patches)
    tall = np.ascontiguousarray(patches).reshape(n * PATCH_PX, PATCH_PX, 3)
    grey = cv2.cvtColor(tall, cv2.COLOR_BGR2GRAY).reshape(n, PATCH_PX, PATCH_PX).astype(np.float32)
    mean = grey.mean(axis=(1, 2), keepdims=True)
    spread = grey.std(axis=(1, 2), keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        norm = np.where(spread > 0, (grey - mean) / spread, np.nan).astype(np.float32)
        blocks = [
            _colour(tall, n),
            np.log(spread[:, 0, 0] / (mean[:, 0, 0] + 1.0))[:, None],
            _marginal(norm),
            _spectrum(norm),
            _bands(norm),
            _patterns(norm),
            _differences(norm),
            _structure(norm),
        ]
    return np.concatenate(blocks, axis=1).astype(float)


_TAILS = (51, 972)
"""Places of the 5th and 95th percentile among the 1024 pixels of half the resolution."""


@cache
def _logarithms() -> np.ndarray:
    return np.log(np.arange(256, dtype=np.float32) + 4.0)


def _colour(tall: np.ndarray, n: int) -> np.ndarray:
    """Colour opponents relative to brightness, brightness, and shares of hues, (n, 23).

    Of the opponents: means, spreads, and how they go with brightness. Of brightness: mean, on a linear and a
    logarithmic scale, and tails. Hues are weighed by how colourful a pixel is, square-rooted so that rare ones count.
    """
    half = cv2.resize(tall, (PATCH_PX // 2, n * PATCH_PX // 2), interpolation=cv2.INTER_AREA)
    pixels = np.asarray(half, dtype=np.uint8).reshape(n, -1, 3)
    table = _logarithms()
    blue, green, red = (np.take(table, pixels[:, :, channel]) for channel in range(3))
    bright = (blue + green + red) / 3
    opponents = (red - green, 0.5 * (red + green) - blue)
    tails = np.partition(bright, _TAILS, axis=1)[:, _TAILS]
    level = bright.mean(axis=1, keepdims=True)
    bright = bright - level
    spread = bright.std(axis=1)
    columns = []
    centred = []
    for opponent in opponents:
        middle = opponent.mean(axis=1)
        rest = opponent - middle[:, None]
        centred.append(rest)
        deviation = rest.std(axis=1)
        together = (rest * bright).mean(axis=1) / (deviation * spread + 1e-4)
        columns += [middle, np.log(deviation + 0.01), together]
    both = (centred[0] * centred[1]).mean(axis=1) / (centred[0].std(axis=1) * centred[1].std(axis=1) + 1e-4)
    chroma = np.hypot(columns[0], columns[3])
    greenish = (opponents[0] < -0.04).mean(axis=1)
    range_ = np.maximum(np.maximum(blue, green), red) - np.minimum(np.minimum(blue, green), red)
    columns += [both, chroma, greenish, range_.mean(axis=1), range_.std(axis=1)]
    light = [pixels.mean(axis=(1, 2)) / 255.0, level[:, 0], *tails.T]
    return np.concatenate([np.stack([*columns, *light], axis=1), np.sqrt(hue_sums(*opponents, HUES))], axis=1)


def _marginal(norm: np.ndarray) -> np.ndarray:
    """Shape of the distribution of brightness, (n, 7)."""
    # Every second pixel will do for percentiles.
    flat = norm[:, ::2, ::2].reshape(len(norm), -1)
    cuts = (10, 102, 256, 767, 921, 1013)
    ordered = np.partition(flat, cuts, axis=1)[:, cuts]
    skew = np.einsum("ni,ni,ni->n", flat, flat, flat) / flat.shape[1]
    return np.concatenate([ordered, (skew / (1 + np.abs(skew)))[:, None]], axis=1)


@cache
def _filters() -> tuple[np.ndarray, np.ndarray]:
    """A Hann window (64, 64), and log-Gabor weights (64 * 33, scales * orientations) for a power spectrum."""
    fy, fx = np.meshgrid(np.fft.fftfreq(PATCH_PX), np.fft.rfftfreq(PATCH_PX), indexing="ij")
    radius = np.hypot(fx, fy)
    radius[0, 0] = 1.0
    angle = np.arctan2(fy, fx)
    double = np.where((fx > 0) & (fx < 0.5), 2.0, 1.0)
    weights = []
    for scale in SCALES:
        radial = np.exp(-(np.log(radius / scale) ** 2) / (2 * np.log(1.7) ** 2))
        radial[0, 0] = 0.0
        for k in range(ORIENTATIONS):
            off = np.angle(np.exp(2j * (angle - np.pi * k / ORIENTATIONS))) / 2
            weights.append(double * radial * np.exp(-(off**2) / (2 * (np.pi / 9) ** 2)))
    hann = np.hanning(PATCH_PX + 2)[1:-1]
    return np.outer(hann, hann).astype(np.float32), np.stack(weights, -1).reshape(-1, len(weights)).astype(np.float32)


def _spectrum(norm: np.ndarray) -> np.ndarray:
    """Energy by scale: overall, in the strongest and weakest direction, and how much the direction matters, (n, 16)."""
    window, weights = _filters()
    transform = np.asarray(fft.rfft2(norm * window))
    power = np.square(np.abs(transform))
    energy = power.reshape(len(norm), -1) @ weights
    energy = energy.reshape(len(norm), len(SCALES), ORIENTATIONS) + 1e-3
    overall = energy.mean(axis=2)
    ordered = np.sort(energy, axis=2)
    strong, weak = ordered[:, :, -2:].mean(axis=2), ordered[:, :, :2].mean(axis=2)
    # Does one direction rule at every scale? Blur and tracks do that, grass does not.
    share = energy / energy.sum(axis=2, keepdims=True)
    common = share.mean(axis=1)
    agreement = (common**2).sum(axis=1) * ORIENTATIONS
    slope = np.diff(np.log(strong), axis=1)
    return np.concatenate(
        [np.log(overall), np.log(strong / overall), np.log(weak / overall), slope, np.log(agreement)[:, None]], axis=1
    )


@cache
def _band_masks() -> np.ndarray:
    fy, fx = np.meshgrid(np.fft.fftfreq(PATCH_PX), np.fft.rfftfreq(PATCH_PX), indexing="ij")
    radius = np.hypot(fx, fy)
    return np.stack(
        [np.exp(-0.5 * (radius / high) ** 2) - np.exp(-0.5 * (radius / low) ** 2) for low, high in _BANDS]
    ).astype(np.float32)


def _bands(norm: np.ndarray) -> np.ndarray:
    """Skewness, peakedness and patchiness within bands of scale, and how their envelopes go together, (n, 11)."""
    transform = np.asarray(fft.rfft2(norm))
    columns, envelopes = [], []
    for mask in _band_masks():
        band = np.asarray(fft.irfft2(transform * mask))
        moments, blocks = band_sums(band)
        scale = np.sqrt(moments[:, 1]) + 1e-6
        columns += [np.cbrt(moments[:, 2]) / scale, np.log(moments[:, 0] / scale)]
        columns.append(np.log(blocks.std(axis=1) / (blocks.mean(axis=1) + 1e-6) + 0.01))
        envelopes.append((blocks - blocks.mean(axis=1, keepdims=True)) / (blocks.std(axis=1, keepdims=True) + 1e-6))
    columns += [(envelopes[i] * envelopes[i + 1]).mean(axis=1) for i in range(2)]
    return np.stack(columns, axis=1)


@cache
def _uniform_table() -> np.ndarray:
    """Bin of each 8-bit pattern: its number of ones where it turns at most twice around the circle, else 9."""
    codes = np.arange(256, dtype=np.uint8)
    bits = (codes[:, None] >> np.arange(8)) & 1
    turns = (bits != np.roll(bits, 1, axis=1)).sum(axis=1)
    return np.where(turns <= 2, bits.sum(axis=1), 9).astype(np.uint8)


def _patterns(norm: np.ndarray) -> np.ndarray:
    """Shares of uniform local binary patterns at each radius, square-rooted so that rare ones count, (n, 30)."""
    columns = []
    for radius in LBP_RADII:
        source = norm
        if radius > 1:
            source = np.empty_like(norm)
            for patch, smooth in zip(norm, source, strict=True):
                cv2.blur(patch, (radius + 1, radius + 1), dst=smooth)
        counts = pattern_counts(source, radius, _uniform_table())
        columns.append(np.sqrt(counts / (PATCH_PX - 2 * radius) ** 2))
    return np.concatenate(columns, axis=1)


def _differences(norm: np.ndarray) -> np.ndarray:
    """Grey-level differences over lags: size, direction, peakedness, homogeneity, (n, 16)."""
    sizes, squares = difference_sums(norm, np.array(LAGS))
    sizes = sizes + 1e-4
    columns = []
    for size, square in zip(sizes.transpose(1, 0, 2), squares.transpose(1, 0, 2), strict=True):
        columns += [
            np.log(size.mean(axis=1)),
            np.log(size.max(axis=1) / size.min(axis=1)),
            np.log(size.max(axis=1)),
            np.log(np.sqrt(square.mean(axis=1)) / size.mean(axis=1) + 1e-4),
        ]
    return np.stack(columns, axis=1)


def _structure(norm: np.ndarray) -> np.ndarray:
    """Coherence of gradients in small, large and the one largest window, and patchiness of edges, (n, 5)."""
    n = len(norm)
    fine = gradient_products(norm)
    columns = []
    for size in (1, 4, 16):
        part = fine.reshape(n, 3, 16 // size, size, 16 // size, size).mean(axis=(3, 5))
        direction = np.hypot(part[:, 0], part[:, 1])
        columns.append(direction.sum(axis=(1, 2)) / (part[:, 2].sum(axis=(1, 2)) + 1e-6))
    edges = np.sqrt(fine[:, 2]).reshape(n, -1)
    columns += [np.log(edges.std(axis=1) / (edges.mean(axis=1) + 1e-6) + 0.01), np.cbrt(_skewness(edges))]
    return np.stack(columns, axis=1)


def _skewness(values: np.ndarray) -> np.ndarray:
    rest = values - values.mean(axis=1, keepdims=True)
    return (rest**3).mean(axis=1) / ((rest**2).mean(axis=1) ** 1.5 + 1e-9)


def _names() -> tuple[str, ...]:
    colour = ["red_green", "red_green_spread", "red_green_with_light", "yellow_blue", "yellow_blue_spread"]
    colour += ["yellow_blue_with_light", "opponents_together", "chroma", "green_share", "saturation"]
    names = [*colour, "saturation_spread", "light", "log_light", "log_light_p5", "log_light_p95"]
    names += [f"hue_{i}" for i in range(HUES)] + ["contrast"]
    names += [f"brightness_p{p}" for p in (1, 10, 25, 75, 90, 99)] + ["brightness_skewness"]
    scales = [f"{scale:g}" for scale in SCALES]
    names += [f"energy_{kind}_{s}" for kind in ("mean", "strong", "weak") for s in scales]
    names += [f"energy_slope_{s}" for s in scales[1:]] + ["direction_agreement"]
    names += [f"band{i}_{kind}" for i in range(3) for kind in ("skewness", "peakedness", "patchiness")]
    names += ["envelopes_01", "envelopes_12"]
    names += [f"lbp{radius}_{i}" for radius in LBP_RADII for i in range(10)]
    names += [f"lag{lag}_{kind}" for lag in LAGS for kind in ("size", "direction", "strong", "peakedness")]
    names += ["coherence_4", "coherence_16", "coherence_64", "edge_patchiness", "edge_skewness"]
    return tuple(names)


FEATURE_NAMES = _names()
