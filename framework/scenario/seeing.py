"""What the camera takes along a drive: one JPEG after another, with what goes wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from .ground import paint_tile
from .plan import Plan
from .view import FARTHEST_M, GroundSite, View

FIRST_FRAME_S = 0.08
"""When the camera takes its first image [s]: its clock ticks between the wheels'."""

TARGET_LEVEL = 112.0
"""Mean grey level that the automatic exposure aims at [-]."""

_BEHIND_M, _AHEAD_M = 2.0, FARTHEST_M + 10.0
_OVEREXPOSURE = 3.5
_QUALITY = 88


@dataclass(frozen=True)
class Picture:
    """One image as it is stored: JPEG data, cut short where a fault did so."""

    time_s: float
    data: bytes


def frame_times(plan: Plan) -> np.ndarray:
    """When images are recorded [s]: none while the camera is gone."""
    rate = plan.preset.camera_rate_Hz
    if rate is None or plan.preset.vehicle.camera is None:
        return np.empty(0)
    time = np.arange(FIRST_FRAME_S, plan.duration_s, 1.0 / rate)
    return time[~plan.fault("camera_gap", time)]


def ground_sites(plan: Plan, *, tile_px: int = 1024) -> list[GroundSite]:
    """Paint the ground of every stretch and lay it where it belongs."""
    sites = []
    for number, stretch in enumerate(plan.stretches):
        rng = plan.generator(3000 + number)
        start = None
        if number:
            x, y, yaw = (float(plan.at(v, np.array(stretch.start_s))) for v in (plan.x_m, plan.y_m, plan.yaw_rad))
            start = (x, y, yaw)
        sites.append(GroundSite.make(paint_tile(stretch.terrain, rng, size=tile_px), rng, start))
    return sites


def seen(plan: Plan) -> Iterator[Picture]:
    """Yield the images of a drive in order of time."""
    camera = plan.preset.vehicle.camera
    times = frame_times(plan)
    if camera is None or not len(times):
        return
    rng = plan.generator(3)
    view = View(camera, rng)
    sites = ground_sites(plan)
    starts = np.array([stretch.start_m for stretch in plan.stretches])
    exposure = camera.exposure_s or 0.0
    gain, level = 1.0, TARGET_LEVEL
    for time in times.tolist():
        now = np.array(time)
        way, speed, *place = (
            float(plan.at(values, now)) for values in (plan.way_m, plan.speed_m_s, plan.x_m, plan.y_m, plan.yaw_rad)
        )
        first = max(int(np.searchsorted(starts, way - _BEHIND_M, side="right")) - 1, 0)
        last = int(np.searchsorted(starts, way + _AHEAD_M, side="right"))
        # The automatic exposure follows the ground with a lag, and hunts a little.
        gain = float(np.clip(gain * (TARGET_LEVEL / max(level, 5.0)) ** 0.25, 0.4, 3.0))
        over = bool(plan.fault("camera_overexposed", now))
        if bool(plan.fault("camera_black", now)):
            dark = np.zeros((camera.height_px, camera.width_px, 3), dtype=np.float32)
            image = view.sensed(dark, 1.0, rng)
        else:
            shown = gain * math.exp(rng.normal(0.0, 0.015)) * (_OVEREXPOSURE if over else 1.0)
            image = view.frame(sites[first:last], (place[0], place[1], place[2]), speed * exposure, shown, rng)
            level = level if over else float(image[::8, ::8].mean())
        data = jpeg(image)
        if bool(plan.fault("camera_truncated", now)):
            data = data[: int(len(data) * rng.uniform(0.05, 0.6))]
        yield Picture(time, data)


def jpeg(image: np.ndarray) -> bytes:
    """Encode an image as JPEG."""
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    if not done:
        raise RuntimeError("OpenCV could not encode a JPEG")
    return data.tobytes()
