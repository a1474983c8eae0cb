"""What the camera of a driving vehicle says about the ground ahead, cell by cell."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
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
"""Looks at so many frames are given together, unless a frame is `urgent` [-]."""
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

    @staticmethod
    def concatenate(parts: Sequence[GroundEvidence]) -> GroundEvidence:
        """Join evidence about cells, at least one part."""
        time_s, x_m, y_m = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("time_s", "x_m", "y_m")
        )
        return GroundEvidence(time_s, x_m, y_m, ClassEvidence.concatenate([part.evidence for part in parts]))


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
    batch: list[GroundEvidence] = []
    last: tuple[float, float, float] | None = None

    def pose(time_s: float) -> tuple[float, float, float]:
        x, y, yaw = (float(np.asarray(value).reshape(-1)[0]) for value in pose_at(np.array([time_s])))
        return x, y, yaw

    def wanted(time_s: float) -> bool:
        here = pose(time_s)
        return bool(np.isfinite(here).all()) and (last is None or not _near(last, *here, cell_size_m))

    for frame in camera_stream.frames(wanted):
        here = pose(frame.time_s)
        if frame.image is not None:  # else the next whole image is looked at, however near
            last = here
        batch.append(_look(frame, here, camera, layout, speed_at, model, measures, cell_size_m))
        if len(batch) == BATCH_FRAMES or frame.urgent:
            yield GroundEvidence.concatenate(batch)
            batch = []
    if batch:
        yield GroundEvidence.concatenate(batch)


def _near(last: tuple[float, float, float], x: float, y: float, yaw: float, cell_size_m: float) -> bool:
    moved = np.hypot(x - last[0], y - last[1])
    turned = abs(np.angle(np.exp(1j * (yaw - last[2]))))
    return bool(moved < MIN_STEP * cell_size_m and turned < MIN_TURN_RAD)


def _look(
    frame: Frame,
    pose: tuple[float, float, float],
    camera: Camera,
    layout: GroundPatches,
    speed_at: Callable[[np.ndarray], np.ndarray],
    model: TerrainClassifier,
    measures: Measures,
    cell_size_m: float,
) -> GroundEvidence:
    """Look at one frame: by itself, so that what is seen does not depend on the frames that it comes with."""
    k = len(layout)
    problem = _problem(frame, camera, model)
    if problem is None and k and frame.image is not None:
        blur = 0.0
        if camera.exposure_s is not None:
            speed = float(np.asarray(speed_at(np.array([frame.time_s])), dtype=float)[0])
            blur = abs(speed) * camera.exposure_s / cell_size_m
        evidence = patch_evidence(
            model, measures, layout.cut(frame.image), resolution_px=layout.resolution_px, blur_share=np.full(k, blur)
        )
    else:
        evidence = ClassEvidence.nothing(model.classes, [(problem or "",)] * k)
    x, y, yaw = pose
    ahead, left = layout.centre_m[:, 0], layout.centre_m[:, 1]
    return GroundEvidence(
        np.full(k, frame.time_s),
        _cell(x + np.cos(yaw) * ahead - np.sin(yaw) * left, cell_size_m),
        _cell(y + np.sin(yaw) * ahead + np.cos(yaw) * left, cell_size_m),
        evidence,
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
