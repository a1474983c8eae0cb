"""What the camera of a driving vehicle says about the ground ahead, cell by cell."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..framework.core.classifier.classifier import TerrainClassifier
from ..framework.core.evidence import ClassEvidence
from ..framework.core.recording.types import CameraStream, Frame
from ..framework.core.vehicle import Camera
from .classify import NO_COLOUR, misses_colour, patch_evidence
from .measures import Measures, measures_of
from .project import GroundPatches, ground_patches

BATCH_FRAMES = 8
MIN_STEP = 0.5
"""Share of a cell that the vehicle has to move before another frame is looked at [-]: frames taken from nearly the same
place show the same ground in the same light, and say little that is new."""
MIN_TURN_RAD = 0.15

PoseAt = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class GroundEvidence:
    """Evidence about m cells of ground.

    Parameters
    ----------
    time_s : (m,)
        When the image was taken [s].
    x_m, y_m : (m,)
        Centre of the cell in the site frame [m].
    evidence
        m items.
    """

    time_s: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    evidence: ClassEvidence

    def __len__(self) -> int:
        return len(self.time_s)


def observe_ground(
    camera_stream: CameraStream,
    camera: Camera,
    pose_at: PoseAt,
    speed_at: Callable[[np.ndarray], np.ndarray],
    model: TerrainClassifier,
    cell_size_m: float,
) -> Iterator[GroundEvidence]:
    """Look at the ground ahead along a drive.

    Patches of one cell's size lie at fixed places ahead of the vehicle. Each is evidence about the cell of the site
    frame that holds its centre, which is off by half a cell at most. Memory does not grow with the drive.

    Parameters
    ----------
    camera_stream
        Images in order of time.
    camera
        Geometry and lens.
    pose_at
        Gives x [m], y [m] and yaw [rad] in the site frame at times (n,) [s]; NaN where the place is not known, and
        then the frame is passed over.
    speed_at
        Gives the speed of travel [m/s] at times (n,) [s]; NaN where it is not known.
    model
        Of modality ``"vision"``.
    cell_size_m
        Side of a cell; cells are centred at (floor(x / side) + 0.5) side [m].

    Yields
    ------
    GroundEvidence
        A few frames at a time. A frame that could not be read, is black or blank, or has no colour where the model
        goes by it, gives unknown cells with the reason.

    Raises
    ------
    InputError
        The model is for other features, or without its backbone.
    """
    measures = measures_of(model)
    layout = ground_patches(camera, cell_size_m, measures.side_px)
    batch: list[tuple[Frame, float, float, float]] = []
    last: tuple[float, float, float] | None = None

    def pose(time_s: float) -> tuple[float, float, float]:
        x, y, yaw = (float(np.asarray(value).reshape(-1)[0]) for value in pose_at(np.array([time_s])))
        return x, y, yaw

    def wanted(time_s: float) -> bool:
        here = pose(time_s)
        return bool(np.isfinite(here).all()) and (last is None or not _near(last, *here, cell_size_m))

    for frame in camera_stream.frames(wanted):
        x, y, yaw = pose(frame.time_s)
        if frame.image is not None:  # else the next whole image is looked at, however near
            last = (x, y, yaw)
        batch.append((frame, x, y, yaw))
        if len(batch) == BATCH_FRAMES:
            yield _look(batch, camera, layout, speed_at, model, measures, cell_size_m)
            batch = []
    if batch:
        yield _look(batch, camera, layout, speed_at, model, measures, cell_size_m)


def _near(last: tuple[float, float, float], x: float, y: float, yaw: float, cell_size_m: float) -> bool:
    moved = np.hypot(x - last[0], y - last[1])
    turned = abs(np.angle(np.exp(1j * (yaw - last[2]))))
    return bool(moved < MIN_STEP * cell_size_m and turned < MIN_TURN_RAD)


def _look(
    batch: list[tuple[Frame, float, float, float]],
    camera: Camera,
    layout: GroundPatches,
    speed_at: Callable[[np.ndarray], np.ndarray],
    model: TerrainClassifier,
    measures: Measures,
    cell_size_m: float,
) -> GroundEvidence:
    k = len(layout)
    time_s = np.array([frame.time_s for frame, *_ in batch])
    blur = np.zeros(len(batch))
    if camera.exposure_s is not None:
        blur = np.abs(np.asarray(speed_at(time_s), dtype=float)) * camera.exposure_s / cell_size_m
    problems = [_problem(frame, camera, model) for frame, *_ in batch]
    usable = [index for index, problem in enumerate(problems) if problem is None]
    seen: dict[int, ClassEvidence] = {}
    if usable and k:
        patches = np.concatenate(
            [layout.cut(image) for index in usable if (image := batch[index][0].image) is not None]
        )
        evidence = patch_evidence(
            model,
            measures,
            patches,
            resolution_px=np.tile(layout.resolution_px, len(usable)),
            blur_share=np.repeat(blur[usable], k),
        )
        for place, index in enumerate(usable):
            seen[index] = evidence.select(slice(place * k, (place + 1) * k))
    parts = [
        seen[index] if index in seen else ClassEvidence.nothing(model.classes, [(problems[index] or "",)] * k)
        for index in range(len(batch))
    ]
    x, y, yaw = (np.array(values) for values in zip(*(pose for _, *pose in batch), strict=True))
    ahead, left = layout.centre_m[:, 0], layout.centre_m[:, 1]
    site_x = x[:, None] + np.cos(yaw)[:, None] * ahead - np.sin(yaw)[:, None] * left
    site_y = y[:, None] + np.sin(yaw)[:, None] * ahead + np.cos(yaw)[:, None] * left
    return GroundEvidence(
        np.repeat(time_s, k),
        _cell(site_x.ravel(), cell_size_m),
        _cell(site_y.ravel(), cell_size_m),
        ClassEvidence.concatenate(parts),
    )


def _cell(value: np.ndarray, cell_size_m: float) -> np.ndarray:
    return (np.floor(value / cell_size_m) + 0.5) * cell_size_m


def _problem(frame: Frame, camera: Camera, model: TerrainClassifier) -> str | None:
    """What keeps a whole frame from being looked at."""
    if frame.image is None:
        return frame.problem or "no image"
    height, width = frame.image.shape[:2]
    if (width, height) != (camera.width_px, camera.height_px):
        return f"image of {width} x {height} px, camera of {camera.width_px} x {camera.height_px} px"
    thinned = frame.image[::16, ::16]
    if thinned.max() < 12:
        return "black image"
    if thinned.min() > 250:
        return "white image"
    if thinned.reshape(-1, 3).std(axis=0).max() < 1.0:
        return "blank image"
    return NO_COLOUR if misses_colour(model, frame.image) else None
