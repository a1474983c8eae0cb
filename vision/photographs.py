"""Photographs of the ground that a drive led over, to train a classifier of its classes from."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..framework.core.errors import InputError
from ..framework.core.recording.types import Recording
from ..framework.core.track.way import track_of
from .project import ground_patches
from .quality import well_lit

SIDE_M = 1.0
"""Side of the ground on a photograph [m], and the way between two of them: they show different ground."""

SIDE_PX = 256


@dataclass(frozen=True)
class Photograph:
    """Ground ahead of the vehicle, seen from straight above.

    Parameters
    ----------
    time_s
        When it was taken [s].
    image : (s, s, 3)
        uint8, blue, green, red; None where the frame cannot be used.
    problem
        Why it cannot.
    """

    time_s: float
    image: np.ndarray | None
    problem: str = ""


def photographs(recording: Recording, from_s: float = -math.inf, to_s: float = math.inf) -> Iterator[Photograph]:
    """Cut the nearest square metre of ground out of frames that are a metre of the way apart.

    Parameters
    ----------
    recording
        With images, places, and the camera's geometry in its vehicle.
    from_s, to_s
        The time within which frames are taken [s].

    Yields
    ------
    Photograph
        In order of time. A frame that cannot be read, or is black, blank or overexposed, has no image.

    Raises
    ------
    InputError
        Images, places or the camera's geometry are missing, or the camera sees no square metre of the ground.
    """
    camera = None if recording.vehicle is None else recording.vehicle.camera
    track = track_of(recording)
    for there, what in ((recording.camera, "images"), (camera, "[camera] of its vehicle"), (track, "places")):
        if there is None:
            raise InputError(recording.source, f"no {what}", expected="images, places and the camera's geometry")
    assert recording.camera is not None and camera is not None and track is not None  # noqa: PT018 - just checked
    patches = ground_patches(camera, SIDE_M, SIDE_PX)
    if not len(patches):
        expected = "a camera that looks at the ground ahead, with its height and pitch"
        raise InputError(recording.source, "the camera sees no square metre of ground", expected=expected)
    nearest = int(np.argmin(np.hypot(*patches.centre_m.T)))
    last_m = -math.inf

    def wanted(time_s: float) -> bool:
        return from_s <= time_s <= to_s and _way_m(time_s) >= last_m + SIDE_M

    def _way_m(time_s: float) -> float:
        known = track.time_s[0] <= time_s <= track.time_s[-1]
        return float(np.interp(time_s, track.time_s, track.way_m)) if known else -math.inf

    for frame in recording.camera.frames(wanted):
        if frame.image is None:
            yield Photograph(frame.time_s, None, frame.problem or "the image cannot be read")
            continue
        image = patches.cut(frame.image)[nearest]
        if not well_lit(image[None])[0]:
            yield Photograph(frame.time_s, None, "black, blank or overexposed")
            continue
        last_m = _way_m(frame.time_s)
        yield Photograph(frame.time_s, image)
