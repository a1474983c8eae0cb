"""What a forward camera sees of a world paved with ground tiles: perspective, motion blur, the sensor's faults.

The ground is a function of place in the site frame, so that a spot looks the same from frame to frame and lies under
the wheels when they reach it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from ..core.vehicle import Camera
from .ground import RESOLUTION_M

FARTHEST_M = 60.0
"""Ground beyond this is haze [m]."""

HAZE_M = 45.0
"""Distance at which haze has taken 63 % of the contrast [m]."""

_STEP_PX = 1.4
_RAGGED_M = 0.35
_SHOT_NOISE, _READ_NOISE = 0.05, 2.0
_MOST_EXPOSURES = 10
_LEVELS = 7


@dataclass(frozen=True)
class GroundSite:
    """One stretch of ground as the camera sees it.

    Parameters
    ----------
    levels
        Its tile, and the same halved again and again, for ground far away.
    turn_rad
        How the tile lies in the site frame.
    start
        x, y [m] and heading [rad] of the track where the stretch begins; None for the first.
    fringe
        Phases [rad] of the ragged line that bounds it.
    """

    levels: tuple[np.ndarray, ...]
    turn_rad: float
    start: tuple[float, float, float] | None
    fringe: tuple[float, float]

    @staticmethod
    def make(tile: np.ndarray, rng: np.random.Generator, start: tuple[float, float, float] | None) -> GroundSite:
        """Make a site of a tile (size, size, 3), turned at random."""
        levels = [tile]
        for _ in range(_LEVELS - 1):
            side = len(levels[-1]) // 2
            levels.append(cv2.resize(levels[-1], (side, side), interpolation=cv2.INTER_AREA))
        phases = rng.uniform(0.0, 2.0 * math.pi, 2)
        return GroundSite(tuple(levels), float(rng.uniform(0.0, 2.0 * math.pi)), start, (phases[0], phases[1]))

    def beyond(
        self, ahead_m: np.ndarray, left_m: np.ndarray, place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> np.ndarray:
        """Say which spots lie beyond the ragged line where this stretch begins; the line meets the track there.

        Parameters
        ----------
        ahead_m, left_m
            Spots in the frame of a vehicle [m].
        place
            Of the vehicle: x, y [m], yaw [rad]; without it the spots are x and y of the site frame.
        """
        if self.start is None:
            return np.ones(np.shape(ahead_m), dtype=bool)
        x, y, heading = self.start
        turn = place[2] - heading
        cos, sin = math.cos(turn), math.sin(turn)
        own_along = math.cos(heading) * (place[0] - x) + math.sin(heading) * (place[1] - y)
        own_left = math.cos(heading) * (place[1] - y) - math.sin(heading) * (place[0] - x)
        along = cos * ahead_m - sin * left_m + own_along
        if np.min(along) > _RAGGED_M:
            return np.ones(np.shape(along), dtype=bool)
        if np.max(along) < -_RAGGED_M:
            return np.zeros(np.shape(along), dtype=bool)
        left = sin * ahead_m + cos * left_m + own_left
        first, second = self.fringe
        ragged = 0.12 * (np.sin(2.1 * left + first) - math.sin(first))
        ragged += 0.04 * (np.sin(8.3 * left + second) - math.sin(second))
        return along > ragged


@dataclass(frozen=True)
class _Band:
    """Rows of the image that share a level of the tile and a number of sub-exposures."""

    rows: slice
    level: int
    exposures: int


class View:
    """Renders the ground for one camera: what does not change from frame to frame is computed once.

    Parameters
    ----------
    camera
        Its geometry; a lens' distortion counts.
    rng
        For sky and sensor.
    """

    def __init__(self, camera: Camera, rng: np.random.Generator):
        self.camera = camera
        ahead, left = ground_seen(camera)
        distance = np.hypot(ahead - camera.forward_m, left - camera.left_m)
        middle = distance[:, camera.width_px // 2]
        seen = np.flatnonzero(np.all(np.isfinite(distance), axis=1) & (middle < FARTHEST_M))
        self.first_row = int(seen[0]) if len(seen) else camera.height_px
        below = slice(self.first_row, camera.height_px)
        self.ahead_m = ahead[below].astype(np.float32)
        self.left_m = left[below].astype(np.float32)
        self._middle = middle[below]
        self._footprint()
        self._sky = _panorama(self.first_row, rng)
        self._vignette = _vignette(camera)
        clear = np.exp(-distance[below] / HAZE_M).astype(np.float32)[..., None]
        haze = self._sky[-1, 0] if self.first_row else np.full(3, 150.0, dtype=np.float32)
        self._contrast = np.ascontiguousarray(clear * self._vignette[below])
        self._veil = np.ascontiguousarray((1.0 - clear) * haze * self._vignette[below])
        self._noise = rng.standard_normal((camera.height_px + 61, camera.width_px + 67, 3), dtype=np.float32)

    def _footprint(self) -> None:
        """Size on the ground of the pixels of each row, across and along [m]."""
        across = np.abs(np.gradient(self.left_m, axis=1)).mean(axis=1)
        self._along = np.maximum(np.abs(np.gradient(self._middle)), 1e-6)
        mean = np.sqrt(across * np.minimum(self._along, 12.0 * across))
        self._level = np.clip(np.round(np.log2(mean / RESOLUTION_M) - 0.2), 0, _LEVELS - 1).astype(int)

    def ground(
        self, sites: Sequence[GroundSite], place: tuple[float, float, float], travel_m: float = 0.0
    ) -> np.ndarray:
        """Render the ground rows from a vehicle at `place` (x, y [m], yaw [rad]): (rows, width, 3) float32.

        Parameters
        ----------
        sites
            Those in view, in order of the track.
        place
            Of the vehicle's reference point, in the middle of the exposure.
        travel_m
            How far the vehicle moves during the exposure: the blur is the mean of exposures along that way.
        """
        image = np.empty((*self.ahead_m.shape, 3), dtype=np.float32)
        for band in self._bands(travel_m):
            ahead, left = self.ahead_m[band.rows], self.left_m[band.rows]
            edges = [site.beyond(ahead, left, place) for site in sites[1:]]
            # Ground that a later stretch covers whole need not be drawn.
            base = max((number for number, there in enumerate(edges, start=1) if there.all()), default=0)
            drawn = _exposed(sites[base], band, ahead, left, place, travel_m)
            for site, there in zip(sites[base + 1 :], edges[base:], strict=True):
                if there.any():
                    drawn = np.where(there[..., None], _exposed(site, band, ahead, left, place, travel_m), drawn)
            image[band.rows] = drawn
        return image

    def _bands(self, travel_m: float) -> list[_Band]:
        blur = np.abs(travel_m) / self._along
        exposures = np.clip(np.ceil(blur / _STEP_PX), 1, _MOST_EXPOSURES).astype(int)
        exposures = np.where(exposures > 4, 2 * ((exposures + 1) // 2), exposures)
        cuts = np.flatnonzero((np.diff(self._level) != 0) | (np.diff(exposures) != 0)) + 1
        edges = [0, *cuts.tolist(), len(self._level)]
        return [_Band(slice(a, b), int(self._level[a]), int(exposures[a])) for a, b in pairwise(edges) if b > a]

    def frame(
        self,
        sites: Sequence[GroundSite],
        place: tuple[float, float, float],
        travel_m: float,
        gain: float,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """Take a picture, (height, width, 3) uint8 BGR: ground under haze, sky, vignetting, noise, clipping."""
        light = np.empty((self.camera.height_px, self.camera.width_px, 3), dtype=np.float32)
        ground = light[self.first_row :]
        cv2.multiply(self.ground(sites, place, travel_m), self._contrast, ground, scale=gain)
        cv2.scaleAdd(self._veil, gain, ground, ground)
        if self.first_row:
            shift = round(place[2] * self.camera.matrix[0][0]) % self._sky.shape[1]
            columns = np.mod(np.arange(self.camera.width_px) - shift, self._sky.shape[1])
            cv2.multiply(self._sky[:, columns], self._vignette[: self.first_row], light[: self.first_row], scale=gain)
        return self.sensed(light, gain, rng)

    def sensed(self, light: np.ndarray, gain: float, rng: np.random.Generator) -> np.ndarray:
        """Turn light on the sensor, (h, w, 3) float32, into a picture: shot and read noise, clipping at 255."""
        down, right = rng.integers(0, 61), rng.integers(0, 67)
        noise = self._noise[down : down + self.camera.height_px, right : right + self.camera.width_px]
        spread = light * np.float32(_SHOT_NOISE * max(gain, 0.3))
        spread += np.float32(_READ_NOISE)
        cv2.sqrt(spread, spread)
        cv2.multiply(spread, noise, spread)
        return cv2.add(light, spread, dtype=cv2.CV_8U)


def ground_seen(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel's ray meets flat ground in the vehicle frame: ahead, left [m], (h, w); NaN above the horizon."""
    columns, rows = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    pixels = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2).astype(np.float64)
    rays = cv2.undistortPoints(pixels, camera.intrinsics, np.asarray(camera.distortion or (0.0,) * 4)).reshape(-1, 2)
    across = rays[:, 0].reshape(columns.shape)
    down = rays[:, 1].reshape(columns.shape)
    falls = math.sin(camera.pitch_rad) + down * math.cos(camera.pitch_rad)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(falls > 1e-4, camera.height_m / falls, np.nan)
    ahead = camera.forward_m + reach * (math.cos(camera.pitch_rad) - down * math.sin(camera.pitch_rad))
    return ahead, camera.left_m - reach * across


def _exposed(
    site: GroundSite,
    band: _Band,
    ahead: np.ndarray,
    left: np.ndarray,
    place: tuple[float, float, float],
    travel_m: float,
) -> np.ndarray:
    """Colours of a site's ground at places of the vehicle frame, the mean of the band's sub-exposures."""
    tile = site.levels[band.level]
    scale = 1.0 / (RESOLUTION_M * 2**band.level)
    turn = place[2] + site.turn_rad
    cos, sin = scale * math.cos(turn), scale * math.sin(turn)
    # The vehicle's own place modulo the tile in double precision; what is left is small enough for float32.
    half = 0.5 * (1.0 - 2.0**-band.level)
    own_u = scale * (math.cos(site.turn_rad) * place[0] - math.sin(site.turn_rad) * place[1]) - half
    own_v = scale * (math.sin(site.turn_rad) * place[0] + math.cos(site.turn_rad) * place[1]) - half
    u = ahead * np.float32(cos)
    u -= left * np.float32(sin)
    v = ahead * np.float32(sin)
    v += left * np.float32(cos)
    # Averaging many exposures smooths as interpolation would.
    how = cv2.INTER_LINEAR if band.exposures < 3 else cv2.INTER_NEAREST
    if band.exposures == 1:
        u += np.float32(own_u % len(tile))
        v += np.float32(own_v % len(tile))
        return cv2.remap(tile, u, v, how, borderMode=cv2.BORDER_WRAP).astype(np.float32)
    total = np.zeros((*ahead.shape, 3), dtype=np.float32)
    for index in range(band.exposures):
        moved = travel_m * ((index + 0.5) / band.exposures - 0.5)
        at_u = u + np.float32((own_u + cos * moved) % len(tile))
        at_v = v + np.float32((own_v + sin * moved) % len(tile))
        cv2.accumulate(cv2.remap(tile, at_u, at_v, how, borderMode=cv2.BORDER_WRAP), total)
    total *= np.float32(1.0 / band.exposures)
    return total


def _vignette(camera: Camera) -> np.ndarray:
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px].astype(np.float32)
    half = 0.5 * math.hypot(camera.width_px, camera.height_px)
    radius = np.hypot(columns - 0.5 * camera.width_px, rows - 0.5 * camera.height_px) / half
    return np.repeat((1.0 - 0.28 * radius**2)[..., None], 3, axis=2).astype(np.float32)


def _panorama(rows: int, rng: np.random.Generator) -> np.ndarray:
    """Sky and a line of distant hills all round, (rows, width, 3) float32 BGR."""
    if rows == 0:
        return np.zeros((0, 1, 3), dtype=np.float32)
    width = 2640
    angle = np.arange(width) * 2.0 * np.pi / width
    height = np.linspace(1.0, 0.0, rows)[:, None]
    zenith, haze = np.array([225.0, 188.0, 150.0]), np.array([205.0, 200.0, 194.0])
    sky = haze + (zenith - haze) * height[..., None] * np.ones((1, width, 1))
    clouds = sum(
        rng.uniform(0.3, 1.0) * np.sin(k * angle + 5.0 * height * rng.uniform(0.5, 1.5) + rng.uniform(0.0, 6.3))
        for k in (3, 5, 9, 16, 27)
    )
    sky += np.clip(9.0 * clouds * height, -12.0, 18.0)[..., None]
    hills = sum(rng.uniform(0.2, 1.0) / k * np.sin(k * angle + rng.uniform(0.0, 6.3)) for k in (4, 7, 13, 31, 57))
    far = height < np.clip(0.25 + 0.5 * hills, 0.0, 0.8)
    sky[far] = 0.6 * haze + 0.4 * np.array([95.0, 108.0, 92.0])
    sky[-1] = haze
    return sky.astype(np.float32)
