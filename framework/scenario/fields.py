"""Periodic random fields on a square tile: noise of a wavelength, fractal noise, cells, and light on a relief.

Every field repeats seamlessly beyond the tile's edge, so that a tile of a few metres can pave a track of any length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from scipy import fft


def band_noise(
    rng: np.random.Generator, size: int, wavelength_px: float, *, octaves: float = 0.5, stretch: float = 1.0
) -> np.ndarray:
    """Noise whose power lies around one wavelength: (size, size) float32 of mean 0 and standard deviation 1.

    Parameters
    ----------
    rng
        Source of randomness.
    size
        Side of the tile [px].
    wavelength_px
        Wavelength of the greatest power [px].
    octaves
        Standard deviation of the band, a Gaussian in the logarithm of the frequency [octaves].
    stretch
        How much longer the wavelength is along x than along y [-].
    """
    octave = np.log2(_frequency(size, stretch) * np.float32(wavelength_px))
    gain = np.exp(np.float32(-0.5 / octaves**2) * octave**2)
    return _filtered(rng, size, gain)


def fractal_noise(rng: np.random.Generator, size: int, largest_px: float, *, slope: float = 1.0) -> np.ndarray:
    """Noise with amplitude falling as frequency^-slope below `largest_px`: (size, size) float32, mean 0, sd 1."""
    radius = _frequency(size, 1.0)
    gain = (radius**2 + np.float32(largest_px**-2.0)) ** np.float32(-0.5 * (slope + 1.0))
    return _filtered(rng, size, gain)


@lru_cache(maxsize=4)
def _frequency(size: int, stretch: float) -> np.ndarray:
    """Frequencies of a tile's Fourier modes [1/px], as `scipy.fft.rfft2` lays them out; x counted `stretch` times."""
    radius = np.hypot(fft.fftfreq(size)[:, None], fft.rfftfreq(size)[None, :] * stretch).astype(np.float32)
    radius[0, 0] = 1e-9
    radius.flags.writeable = False
    return radius


def _filtered(rng: np.random.Generator, size: int, gain: np.ndarray) -> np.ndarray:
    """Noise of the given amplitude by mode: its modes are drawn as they are, no noise has to be transformed first."""
    spectrum = rng.standard_normal((*gain.shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    spectrum *= gain
    spectrum[0, 0] = 0.0
    field = np.asarray(fft.irfft2(spectrum, s=(size, size)))
    field *= np.float32(1.0 / max(float(field.std()), 1e-12))
    return field


@dataclass(frozen=True)
class Cells:
    """A tile parted into cells, as stones, clods or plates part the ground.

    Parameters
    ----------
    labels : (size, size)
        Number of the cell that each pixel lies in.
    count
        Number of cells.
    edge_px : (size, size)
        Distance to the nearest edge between cells [px].
    offset_px : (size, size, 2)
        From the cell's seed to the pixel, x then y [px].
    """

    labels: np.ndarray
    count: int
    edge_px: np.ndarray
    offset_px: np.ndarray

    def per_cell(self, values: np.ndarray) -> np.ndarray:
        """Spread one value a cell, (count,) or (count, k), over the pixels."""
        return values[self.labels]

    def dome(self) -> np.ndarray:
        """Height of a dome over each cell, 0 at its edge and 1 at its middle: (size, size) float32."""
        reach = np.zeros(self.count, dtype=np.float32)
        np.maximum.at(reach, self.labels.ravel()[::3], self.edge_px.ravel()[::3])
        share = np.minimum(self.edge_px / np.maximum(reach[self.labels], 1.0), 1.0)
        return np.sqrt(np.maximum(1.0 - (1.0 - share) ** 2, 0.0)).astype(np.float32)


def cells(
    rng: np.random.Generator, size: int, spacing_px: float, *, jitter: float = 0.9, warp_px: float = 0.0
) -> Cells:
    """Part a tile into Voronoi cells around a jittered grid of seeds, their edges bent by noise.

    Parameters
    ----------
    rng
        Source of randomness.
    size
        Side of the tile [px].
    spacing_px
        Mean distance of the seeds [px].
    jitter
        How far seeds stray from the grid, in grid spacings [-].
    warp_px
        Standard deviation of the displacement that bends the edges [px].
    """
    side = max(2, round(size / spacing_px))
    pitch = size / side
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    seeds = np.mod((grid + 0.5 + jitter * (rng.random((side * side, 2)) - 0.5)) * pitch, size).astype(np.int32)
    pad = int(min(size, np.ceil(2.5 * pitch)))
    owner = np.full((size, size), -1, dtype=np.int32)
    owner[seeds[:, 1], seeds[:, 0]] = np.arange(side * side)
    wide = np.pad(owner, pad, mode="wrap")
    _, nearest = cv2.distanceTransformWithLabels(
        (wide < 0).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.asarray(nearest, dtype=np.intp)
    lookup = np.zeros(int(nearest.max()) + 1, dtype=np.int32)
    at_seeds = wide >= 0
    lookup[nearest[at_seeds]] = wide[at_seeds]
    labels = lookup[nearest[pad : pad + size, pad : pad + size]]
    if warp_px > 0:
        labels = warped(labels.astype(np.float32), rng, warp_px, spacing_px, cv2.INTER_NEAREST).astype(np.int32)
    rows, columns = np.mgrid[:size, :size].astype(np.float32)
    offset = np.stack([columns, rows], axis=-1) - seeds[labels]
    offset -= size * np.round(offset / size)
    return Cells(labels, side * side, _edge_distance(labels, pad), offset.astype(np.float32))


def _edge_distance(labels: np.ndarray, pad: int) -> np.ndarray:
    edge = (labels != np.roll(labels, 1, axis=0)) | (labels != np.roll(labels, 1, axis=1))
    wide = np.pad(edge, pad, mode="wrap")
    distance = cv2.distanceTransform((~wide).astype(np.uint8), cv2.DIST_L2, 3)
    size = len(labels)
    return distance[pad : pad + size, pad : pad + size]


def warped(
    field: np.ndarray, rng: np.random.Generator, amplitude_px: float, wavelength_px: float, how: int = cv2.INTER_LINEAR
) -> np.ndarray:
    """Displace a periodic field by smooth noise of standard deviation `amplitude_px` in either direction."""
    size = len(field)
    rows, columns = np.mgrid[:size, :size].astype(np.float32)
    columns += amplitude_px * band_noise(rng, size, wavelength_px, octaves=0.7)
    rows += amplitude_px * band_noise(rng, size, wavelength_px, octaves=0.7)
    return cv2.remap(field, columns, rows, how, borderMode=cv2.BORDER_WRAP)


def shaded(height_px: np.ndarray, azimuth_rad: float, elevation_rad: float) -> np.ndarray:
    """Light that a matt relief of the given height [px] throws back, 1 where it is level: (size, size) float32.

    Lambert's cosine law for a sun at the given azimuth and elevation, with a fifth of skylight from everywhere.
    """
    slope_x = 0.5 * (np.roll(height_px, -1, axis=1) - np.roll(height_px, 1, axis=1))
    slope_y = 0.5 * (np.roll(height_px, -1, axis=0) - np.roll(height_px, 1, axis=0))
    toward = np.cos(elevation_rad) * (np.cos(azimuth_rad) * slope_x + np.sin(azimuth_rad) * slope_y)
    direct = (np.sin(elevation_rad) - toward) / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    return (0.2 + 0.8 * np.maximum(direct, 0.0) / np.sin(elevation_rad)).astype(np.float32)
