"""The look of the ground: one seamless photograph-like tile for each site, by terrain class.

Each class has its own structure (ripples, clods, stones, blades, plates, aggregate); each site draws its own grain,
hue, moisture and light, and hues overlap between classes, so that neither one colour nor one scale names a class.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from .fields import band_noise, cells, fractal_noise, shaded, warped

RESOLUTION_M = 0.004
"""Size of a tile's pixel on the ground [m]."""


@dataclass(frozen=True)
class Light:
    """Sun of one site: azimuth and elevation [rad], and its colour as gains on blue, green, red [-]."""

    azimuth_rad: float
    elevation_rad: float
    gains: tuple[float, float, float]

    @staticmethod
    def draw(rng: np.random.Generator) -> Light:
        """Draw the sun of a site, somewhere between morning and noon, clear or hazy."""
        warmth = rng.normal(0.0, 0.05)
        level = rng.uniform(0.82, 1.12)
        return Light(
            rng.uniform(0.0, 2.0 * math.pi),
            math.radians(rng.uniform(28.0, 65.0)),
            (level * (1.0 - warmth), level, level * (1.0 + warmth)),
        )


@dataclass(frozen=True)
class Surface:
    """What a class's painter gives: colour (size, size, 3) BGR in [0, 255] under level light, and height [px]."""

    colour: np.ndarray
    height_px: np.ndarray


def paint_tile(class_name: str, rng: np.random.Generator, *, size: int = 1536) -> np.ndarray:
    """Paint the ground of one site of a class, seen from straight above.

    Parameters
    ----------
    class_name
        One of `PAINTERS`.
    rng
        Source of randomness: another draw is another site.
    size
        Side of the tile [px], each pixel `RESOLUTION_M` wide.

    Returns
    -------
    (size, size, 3) uint8
        BGR; it repeats seamlessly.
    """
    light = Light.draw(rng)
    surface = PAINTERS[class_name](rng, size)
    lit = shaded(surface.height_px, light.azimuth_rad, light.elevation_rad)
    lit = lit * (1.0 + 0.05 * fractal_noise(rng, size, size / 2, slope=1.2))
    image = surface.colour * lit[..., None] * np.asarray(light.gains, dtype=np.float32)
    return np.clip(image, 0, 255).astype(np.uint8)


def _colour(rng: np.random.Generator, rgb: tuple[float, float, float], *, level: float, hue: float) -> np.ndarray:
    """Draw a site's colour around a typical one, as BGR: `level` and `hue` are relative standard deviations [-]."""
    drawn = np.asarray(rgb[::-1]) * math.exp(rng.normal(0.0, level)) * np.exp(rng.normal(0.0, hue, 3))
    return drawn.astype(np.float32)


def _tinted(base: np.ndarray, *variations: np.ndarray) -> np.ndarray:
    """A colour (3,) times (1 + each variation (size, size))."""
    gain = np.ones_like(variations[0])
    for variation in variations:
        gain = gain * (1.0 + variation)
    return base * gain[..., None]


def _px(length_m: float) -> float:
    return length_m / RESOLUTION_M


def _sand(rng: np.random.Generator, size: int) -> Surface:
    base = _colour(rng, (186, 160, 120), level=0.10, hue=0.05)
    wave_px = _px(rng.uniform(0.07, 0.16))
    count = max(1, round(size / wave_px))
    angle = rng.uniform(-0.6, 0.6)
    across = round(count * math.tan(angle))
    rows, columns = np.mgrid[:size, :size].astype(np.float32)
    phase = 2.0 * np.pi / size * (count * columns + across * rows)
    phase += 0.9 * band_noise(rng, size, 6.0 * wave_px, octaves=0.8) + 0.5 * band_noise(rng, size, 2.5 * wave_px)
    steep = rng.uniform(0.1, 0.9)
    ripple = np.sin(phase) + 0.25 * steep * np.sin(2.0 * phase + 0.8)
    patchy = np.clip(0.6 + 0.5 * band_noise(rng, size, size / 4, octaves=0.6), 0.05, 1.4)
    amplitude = wave_px * rng.uniform(0.012, 0.06)
    relief = amplitude * ripple * patchy + 0.9 * fractal_noise(rng, size, _px(0.5), slope=1.3)
    grain = band_noise(rng, size, 2.5, octaves=0.5)
    height = relief + rng.uniform(0.05, 0.11) * grain
    moist = 0.05 * fractal_noise(rng, size, size / 3, slope=1.4)
    specks = np.where(band_noise(rng, size, 3.0) > 3.2, -0.35, 0.0).astype(np.float32)
    return Surface(_tinted(base, moist, 0.03 * grain, specks, 0.02 * ripple * patchy), height)


def _loam(rng: np.random.Generator, size: int) -> Surface:
    dry = rng.random()
    base = _colour(rng, (88 + 62 * dry, 66 + 52 * dry, 47 + 42 * dry), level=0.08, hue=0.05)
    height = 2.0 * fractal_noise(rng, size, _px(0.4), slope=1.0)
    tone = 0.05 * fractal_noise(rng, size, _px(0.25), slope=0.6)
    hollow = np.zeros_like(height)
    for spacing_m, share, rise in ((0.075, 0.25, 0.5), (0.034, 0.45, 0.45), (0.016, 0.6, 0.4)):
        spacing = _px(spacing_m * math.exp(rng.normal(0.0, 0.2)))
        clods = cells(rng, size, spacing, warp_px=0.16 * spacing)
        there = rng.random(clods.count) < share
        tall = (there * rng.uniform(0.3, 1.0, clods.count)).astype(np.float32)
        dome = clods.dome() * clods.per_cell(tall)
        height += rise * 0.5 * spacing * dome
        tone += clods.per_cell((there * rng.normal(0.0, 0.06, clods.count)).astype(np.float32))
        hollow += np.exp(-clods.edge_px / (0.08 * spacing)) * clods.per_cell(there.astype(np.float32))
    tone -= 0.14 * np.minimum(hollow, 1.5)
    grit = 0.06 * band_noise(rng, size, 3.0, octaves=0.7)
    colour = _tinted(base, tone, grit)
    straw = _strokes(rng, size, int(rng.uniform(0, 260) * (size / 1536) ** 2), (0.02, 0.06), curl=0.2)
    cv2.polylines(colour, straw, False, (base * 1.5).tolist(), 1, cv2.LINE_AA)
    return Surface(colour, height + 0.3 * grit)


def _gravel(rng: np.random.Generator, size: int) -> Surface:
    ground = _colour(rng, (92, 84, 74), level=0.15, hue=0.03)
    stone = _colour(rng, (142, 134, 124), level=0.12, hue=0.025)
    colour = _tinted(ground, 0.1 * band_noise(rng, size, 4.0, octaves=0.8))
    height = fractal_noise(rng, size, _px(0.3), slope=1.0)
    grain_m = rng.uniform(0.02, 0.04)
    for factor, share in ((0.5, 0.9), (1.0, 0.8), (1.8, 0.25)):
        spacing = _px(grain_m * factor)
        stones = cells(rng, size, spacing, warp_px=0.10 * spacing)
        there = stones.per_cell(rng.random(stones.count) < share) & (stones.edge_px > 0.07 * spacing)
        tones = np.exp(rng.normal(0.0, 0.2, (stones.count, 1)) + rng.normal(0.0, 0.02, (stones.count, 3)))
        tilt = rng.normal(0.0, 0.12, (stones.count, 2)).astype(np.float32)
        slope = np.sum(stones.per_cell(tilt) * stones.offset_px, axis=-1)
        lift = 0.22 * spacing * stones.dome() + slope
        rim = 1.0 - 0.55 * np.exp(-stones.edge_px / (0.10 * spacing))
        face = stones.per_cell((stone * tones).astype(np.float32)) * rim[..., None]
        colour = np.where(there[..., None], face, colour * 0.94)
        height = np.where(there, height + lift, height)
    speckle = 0.06 * band_noise(rng, size, 2.5, octaves=0.6)
    height = np.asarray(cv2.GaussianBlur(height, (0, 0), 0.8, borderType=cv2.BORDER_REFLECT))
    return Surface(colour * (1.0 + speckle)[..., None], height)


def _grass(rng: np.random.Generator, size: int) -> Surface:
    soil = _colour(rng, (62, 56, 36), level=0.15, hue=0.05)
    dry = rng.beta(1.2, 2.5)
    green = _colour(rng, (84, 112, 46), level=0.12, hue=0.08)
    straw = _colour(rng, (158, 142, 84), level=0.10, hue=0.05)
    colour = np.ascontiguousarray(_tinted(soil, 0.15 * band_noise(rng, size, 8.0, octaves=1.0)))
    thick = band_noise(rng, size, size / 5, octaves=0.7)
    length_m = rng.uniform(0.03, 0.09)
    lay = rng.uniform(0.0, 2.0 * math.pi)
    layers = 14
    density = rng.uniform(0.7, 1.3) * 0.10 * 0.05 / length_m
    for layer in range(layers):
        depth = (layer + 1) / layers
        blades = _strokes(
            rng, size, int(density * size * size / layers), (0.6 * length_m, 1.4 * length_m), curl=0.5, lay=lay,
            where=thick,
        )  # fmt: skip
        shares = np.array_split(np.arange(len(blades)), 5)
        for share in shares:
            mixed = np.clip(rng.normal(dry, 0.25), 0.0, 1.0)
            ink = ((1.0 - mixed) * green + mixed * straw) * (0.45 + 0.65 * depth) * math.exp(rng.normal(0.0, 0.13))
            cv2.polylines(colour, [blades[i] for i in share], False, ink.tolist(), 1, cv2.LINE_AA)
    uneven = 1.5 * fractal_noise(rng, size, _px(0.6), slope=1.4)
    return Surface(colour * (1.0 + 0.07 * thick)[..., None], uneven)


def _clay(rng: np.random.Generator, size: int) -> Surface:
    red = rng.random()
    base = _colour(rng, (128 + 34 * red, 112 - 4 * red, 96 - 22 * red), level=0.14, hue=0.04)
    dry = rng.uniform(0.25, 1.0)
    spacing = _px(rng.uniform(0.10, 0.30))
    plates = cells(rng, size, spacing, jitter=0.8, warp_px=0.07 * spacing)
    width = _px(rng.uniform(0.002, 0.007)) * dry * (1.0 + 0.4 * band_noise(rng, size, spacing, octaves=0.7))
    crack = np.clip(1.5 - plates.edge_px / np.maximum(width, 0.3), 0.0, 1.0) * min(1.0, 0.45 + dry)
    fine = cells(rng, size, 0.35 * spacing, warp_px=0.05 * spacing)
    parted = fine.per_cell((rng.random(fine.count) < 0.5 * dry).astype(np.float32))
    hair = np.clip(1.2 - fine.edge_px / 0.9, 0.0, 1.0) * parted
    curl = np.exp(-plates.edge_px / (0.12 * spacing)) * 0.02 * spacing * dry
    smooth = 0.5 * fractal_noise(rng, size, _px(0.15), slope=1.6)
    height = curl + smooth + warped(0.02 * spacing * plates.dome(), rng, 2.0, spacing)
    tone = plates.per_cell(rng.normal(0.0, 0.045, plates.count).astype(np.float32))
    wet = (1.0 - dry) * 0.10 * fractal_noise(rng, size, size / 4, slope=1.5)
    silt = 0.025 * fractal_noise(rng, size, _px(0.03), slope=0.6)
    return Surface(_tinted(base, tone, wet, silt, -0.72 * crack, -0.35 * hair), height - 2.0 * crack)


def _asphalt(rng: np.random.Generator, size: int) -> Surface:
    base = _colour(rng, (98, 98, 97), level=0.18, hue=0.02)
    chips = cells(rng, size, _px(rng.uniform(0.009, 0.016)))
    shows = rng.random(chips.count) < rng.uniform(0.15, 0.5)
    tones = (shows * rng.normal(0.18, 0.16, chips.count)).astype(np.float32)
    binder = -0.10 * np.exp(-chips.edge_px / 1.0)
    worn = 0.05 * fractal_noise(rng, size, size / 2, slope=1.5)
    fine = 0.05 * band_noise(rng, size, 2.5, octaves=0.6)
    colour = np.ascontiguousarray(_tinted(base, chips.per_cell(tones), binder, worn, fine))
    seams = _strokes(rng, size, int(rng.integers(0, 5)), (0.6, 1.6), curl=0.9, points=12)
    cv2.polylines(colour, seams, False, (base * 0.35).tolist(), int(rng.integers(1, 4)), cv2.LINE_AA)
    rough = rng.uniform(0.06, 0.16)
    return Surface(colour, 0.2 * chips.dome() + rough * fractal_noise(rng, size, _px(0.05), slope=1.2))


def _strokes(
    rng: np.random.Generator,
    size: int,
    count: int,
    lengths_m: tuple[float, float],
    *,
    curl: float,
    lay: float | None = None,
    where: np.ndarray | None = None,
    points: int = 4,
) -> list[np.ndarray]:
    """Curved strokes for `cv2.polylines`, those across the tile's edge drawn again on its other side.

    `lay` is the direction that they favour [rad] (none where absent), `where` a field that thins them where it is low.
    """
    start = rng.uniform(0.0, size, (count, 2))
    if where is not None:
        at = where[start[:, 1].astype(int), start[:, 0].astype(int)]
        start = start[rng.random(count) < 1.0 / (1.0 + np.exp(-1.5 * (at + 1.0)))]
    n = len(start)
    heading = rng.uniform(0.0, 2.0 * np.pi, n) if lay is None else rng.normal(lay, 0.9, n)
    step = _px(1.0) * rng.uniform(*lengths_m, n) / (points - 1)
    turning = np.cumsum(rng.normal(0.0, curl, (n, points - 1)) / math.sqrt(points), axis=1) + heading[:, None]
    path = np.zeros((n, points, 2))
    path[:, 1:, 0] = np.cumsum(np.cos(turning), axis=1) * step[:, None]
    path[:, 1:, 1] = np.cumsum(np.sin(turning), axis=1) * step[:, None]
    path += start[:, None, :]
    copies = [path]
    for shift in ((size, 0), (-size, 0), (0, size), (0, -size)):
        moved = path + shift
        seen = np.any((moved >= 0) & (moved < size), axis=(1, 2)) & np.all(
            (moved.max(axis=1) >= 0) & (moved.min(axis=1) < size), axis=1
        )
        copies.append(moved[seen])
    return list(np.round(np.concatenate(copies)).astype(np.int32))


PAINTERS: dict[str, Callable[[np.random.Generator, int], Surface]] = {
    "asphalt": _asphalt,
    "clay": _clay,
    "grass": _grass,
    "gravel": _gravel,
    "loam": _loam,
    "sand": _sand,
}
"""By class name, what paints its ground."""
