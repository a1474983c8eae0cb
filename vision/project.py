"""Where the ground ahead lies in the image: a pinhole camera over flat ground.

Vehicle frame: x forward, y left, z up, its origin on the ground under the vehicle's reference point. Camera frame
(OpenCV): x right, y down, z along the optical axis, which points `pitch_rad` below the horizon. Ground is taken to be
flat, so that a slope or a bump moves a cell by about its height over the tangent of the line of sight's angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..framework.core.vehicle import Camera
from .features import PATCH_PX

MIN_PX_ACROSS = 24.0
"""A cell that is seen on fewer pixels than this along the line of sight shows no texture worth naming [px]."""
ROWS, COLUMNS = 3, 3
_MAX_OVERSAMPLING = 3


def camera_axes(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Give the rotation (3, 3) from vehicle to camera axes, and the camera's place (3,) in the vehicle frame [m]."""
    sine, cosine = np.sin(camera.pitch_rad), np.cos(camera.pitch_rad)
    rotation = np.array([[0.0, -1.0, 0.0], [-sine, 0.0, -cosine], [cosine, 0.0, -sine]])
    return rotation, np.array([camera.forward_m, camera.left_m, camera.height_m])


def ground_to_image(camera: Camera, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project points of flat ground into the image.

    Parameters
    ----------
    camera
        Geometry and lens.
    points_m : (n, 2)
        x forward, y left in the vehicle frame [m].

    Returns
    -------
    pixels : (n, 2)
        Column and row [px]; NaN behind the camera.
    inside : (n,)
        True where the pixel lies within the image.
    """
    rotation, place = camera_axes(camera)
    points = np.column_stack([points_m, np.zeros(len(points_m))])
    depth = (points - place) @ rotation[2]
    pixels = np.full((len(points), 2), np.nan)
    # A little in front of the lens at least: the distortion polynomial means nothing at a right angle.
    front = depth > 0.05 * camera.height_m
    if front.any():
        turn, _ = cv2.Rodrigues(rotation)
        shift = -rotation @ place
        lens = np.asarray(camera.distortion, dtype=float) if camera.distortion else None
        projected, _ = cv2.projectPoints(points[front][:, None, :], turn, shift, camera.intrinsics, lens)
        pixels[front] = projected.reshape(-1, 2)
        flat = (points[front] - place) @ rotation[:2].T / depth[front][:, None]
        # Far outside the view the distortion polynomial folds back into the image.
        pixels[front] = np.where(np.hypot(flat[:, 0], flat[:, 1])[:, None] <= _view(camera), pixels[front], np.nan)
    last = np.array([camera.width_px - 1, camera.height_px - 1])
    with np.errstate(invalid="ignore"):
        inside = np.all((pixels >= 0) & (pixels <= last), axis=1)
    return pixels, np.asarray(inside)


def _view(camera: Camera) -> float:
    """Tangent of the widest angle from the optical axis that can reach the image [-]."""
    right, bottom = camera.width_px - 1.0, camera.height_px - 1.0
    across, down = np.linspace(0, right, 21), np.linspace(0, bottom, 21)
    border = np.concatenate(
        [np.stack([across, np.full(21, row)], axis=1) for row in (0.0, bottom)]
        + [np.stack([np.full(21, column), down], axis=1) for column in (0.0, right)]
    )
    lens = np.asarray(camera.distortion, dtype=float) if camera.distortion else None
    flat = cv2.undistortPoints(border[:, None, :], camera.intrinsics, lens).reshape(-1, 2)
    return 1.1 * float(np.hypot(flat[:, 0], flat[:, 1]).max())


@dataclass(frozen=True)
class GroundPatches:
    """Square patches of ground ahead, fixed to the vehicle, and where each of their pixels lies in the image.

    Parameters
    ----------
    centre_m : (k, 2)
        Centres, x forward and y left in the vehicle frame [m].
    resolution_px : (k,)
        Pixels of the image across the patch, in the direction in which there are fewest [px].
    side_m
        Side of a patch [m].
    side_px
        Side s of the image of one [px].
    """

    centre_m: np.ndarray
    resolution_px: np.ndarray
    side_m: float
    _map_x: np.ndarray
    _map_y: np.ndarray
    _oversampling: int
    side_px: int

    def __len__(self) -> int:
        return len(self.centre_m)

    def cut(self, image: np.ndarray) -> np.ndarray:
        """Give the patches as seen straight from above, (k, s, s, 3) uint8, from an image (h, w, 3) uint8."""
        if not len(self):
            return np.empty((0, self.side_px, self.side_px, 3), dtype=np.uint8)
        tall = np.asarray(
            cv2.remap(image, self._map_x, self._map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
        )
        if self._oversampling > 1:
            tall = np.asarray(cv2.resize(tall, (self.side_px, self.side_px * len(self)), interpolation=cv2.INTER_AREA))
        return tall.reshape(len(self), self.side_px, self.side_px, 3)


def ground_patches(camera: Camera, side_m: float, side_px: int = PATCH_PX) -> GroundPatches:
    """Lay out patches on the ground that the camera sees well.

    Rows stand from the nearest ground that is wholly in view to the furthest that is still resolved, evenly in the
    logarithm of distance; columns side by side around the vehicle's line of travel.

    Parameters
    ----------
    camera
        Geometry and lens.
    side_m
        Side of a patch [m].
    side_px
        Side s of the images of patches [px].

    Returns
    -------
    GroundPatches
        None of them where the camera resolves no ground at that size.
    """
    lateral = (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * side_m
    # Candidates of distance to the middle column; the furthest is where pixels run out at any camera's resolution.
    ahead = camera.forward_m + np.geomspace(0.2, 60.0, 240) * camera.height_m
    middle = np.column_stack([ahead, np.zeros_like(ahead)])
    good = np.flatnonzero(_seen(camera, middle, side_m) >= MIN_PX_ACROSS)
    centres = np.empty((0, 2))
    if len(good):
        near, far = ahead[good[0]], ahead[good[-1]]
        rows = np.geomspace(near, max(far, near * (1 + 1e-9)), ROWS) if near > 0 else np.linspace(near, far, ROWS)
        rows = rows[np.concatenate([[True], np.diff(rows) > 0.25 * side_m])]
        centres = np.column_stack([np.repeat(rows, COLUMNS), np.tile(lateral, len(rows))])
    resolution = _seen(camera, centres, side_m)
    keep = resolution >= MIN_PX_ACROSS
    centres, resolution = centres[keep], resolution[keep]
    finest = _finest(camera, centres, side_m)
    times = int(np.clip(np.ceil(finest.max(initial=1.0) / side_px - 0.25), 1, _MAX_OVERSAMPLING))
    size = side_px * times
    step = ((np.arange(size) + 0.5) / size - 0.5) * side_m
    # A patch's rows run away from the vehicle towards its top, its columns from left to right.
    forward, left = np.meshgrid(-step, -step, indexing="ij")
    grid = np.stack([forward.ravel(), left.ravel()], axis=1)
    points = (centres[:, None, :] + grid[None]).reshape(-1, 2)
    pixels = ground_to_image(camera, points)[0].astype(np.float32).reshape(len(centres) * size, size, 2)
    return GroundPatches(
        centres,
        resolution,
        side_m,
        np.ascontiguousarray(pixels[..., 0]),
        np.ascontiguousarray(pixels[..., 1]),
        times,
        side_px,
    )


def _edges(camera: Camera, centres: np.ndarray, side_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Pixels across each patch along x and along y, (k, 2), and whether its corners are in the image, (k,)."""
    half = side_m / 2
    corners = np.array([[half, half], [half, -half], [-half, half], [-half, -half]])
    middles = np.array([[half, 0.0], [-half, 0.0], [0.0, half], [0.0, -half]])
    points = (centres[:, None, :] + np.concatenate([corners, middles])[None]).reshape(-1, 2)
    pixels, inside = ground_to_image(camera, points)
    pixels, inside = pixels.reshape(-1, 8, 2), inside.reshape(-1, 8)
    along = np.linalg.norm(pixels[:, 4] - pixels[:, 5], axis=1)
    across = np.linalg.norm(pixels[:, 6] - pixels[:, 7], axis=1)
    return np.stack([along, across], axis=1), np.asarray(inside.all(axis=1))


def _seen(camera: Camera, centres: np.ndarray, side_m: float) -> np.ndarray:
    """The fewer pixels across each patch, 0 where a corner is out of view, (k,)."""
    size, inside = _edges(camera, centres, side_m)
    return np.where(inside, np.nan_to_num(size.min(axis=1)), 0.0)


def _finest(camera: Camera, centres: np.ndarray, side_m: float) -> np.ndarray:
    return np.nan_to_num(_edges(camera, centres, side_m)[0].max(axis=1, initial=0.0))
