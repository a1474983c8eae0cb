"""What files of drives and drives that go on have in common in the Rerun viewer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..identification.estimate.identifiability import is_search_limit
from ..vision.project import camera_axes
from .colours import UNKNOWN_COLOUR
from .core.pictures import png_of
from .core.soil import Quantity
from .core.vehicle import Camera
from .rerun_stream import Log
from .sense_map import kind_of_reason

FRAME_PERIOD_S = 0.5
"""Camera frames are at least so far apart [s]."""

WIDEST_PX = 640
"""Wider frames are made smaller [px]."""

JPEG_QUALITY = 80
"""As OpenCV counts it, of 100 [-]."""

SOIL = {"c_Pa": ("c_kPa", 1e-3), "phi_rad": ("phi_deg", 180.0 / np.pi)}
"""Estimates that are written: name of the entity, and how many of its unit are one in SI."""


_LEGEND_DPI = 120
_LEVELS = {"trusted": "INFO", "quality is low": "WARN", "not trusted": "WARN"}


def camera_entity(camera: Camera | None, image: np.ndarray) -> str:
    """Say above which entity images (h, w, ...) stand: in the world, if it is this camera that took them."""
    at_its_place = camera is not None and (camera.height_px, camera.width_px) == image.shape[:2]
    return "world/vehicle/camera" if at_its_place else "camera"


def write_frame(log: Log, entity: str, time_s: float, image: np.ndarray) -> tuple[float, float]:
    """Write an image (h, w, 3) or (h, w), made smaller where it is wide; return by what its width and height shrank."""
    height, width = image.shape[:2]
    if width > WIDEST_PX:
        size = (WIDEST_PX, max(1, round(WIDEST_PX / width * height)))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    log.at(time_s, entity, log.rr.EncodedImage(contents=data.tobytes(), media_type="image/jpeg"))
    return image.shape[1] / width, image.shape[0] / height


def write_lens(log: Log, camera: Camera, across: float, down: float) -> None:
    """Write where a camera is and how it looks, without distortion; its images are scaled so `across` and `down`."""
    rr = log.rr
    rotation, place = camera_axes(camera)
    log.static("world/vehicle/camera", rr.Transform3D(translation=place, mat3x3=rotation.T))
    matrix = np.diag([across, down, 1.0]) @ camera.intrinsics
    resolution = [across * camera.width_px, down * camera.height_px]
    lens = rr.Pinhole(
        image_from_camera=matrix, resolution=resolution, camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=1.0
    )
    log.static("world/vehicle/camera", lens)


def write_vehicle(log: Log) -> None:
    """Write how the vehicle is drawn."""
    arrow = log.rr.Arrows3D(vectors=[[0.8, 0.0, 0.0]], origins=[[0.0, 0.0, 0.1]], colors=[0xD00000FF], radii=[0.08])
    log.static("world/vehicle/heading", arrow)


class SenseLog:
    """Writes whether a sense is trusted, each time that this or its reason changes."""

    def __init__(self, log: Log, instrument: str):
        self._log, self._instrument, self._before = log, instrument, ""

    def write(self, time_s: float, quality: float, reasons: Sequence[str]) -> None:
        """Take up what is so at a time [s]; the quality is 0 where the sense is not trusted."""
        state = "quality is low" if reasons and quality > 0.0 else "not trusted" if quality <= 0.0 else "trusted"
        now = f"{state}: {', '.join(map(kind_of_reason, reasons))}"
        if now != self._before:  # numbers that differ from window to window are no change
            text, level = ": ".join([state, *([", ".join(reasons)] if reasons else [])]), _LEVELS[state]
            path = self._log.path("senses", self._instrument, "log")
            self._log.at(time_s, path, self._log.rr.TextLog(text, level=level))
        self._before = now


def ends_of(parameters: Mapping[str, Quantity], separable: Mapping[str, bool], name: str) -> dict[str, float]:
    """Give an estimate and the ends of its interval in SI, by what they are called; NaN for what is not known."""
    if name not in parameters:
        return dict.fromkeys(("value", "low", "high"), np.nan)
    one = parameters[name]
    low, high = (np.nan if is_search_limit(name, end) else end for end in (one.low, one.high))
    return {"value": one.value if separable.get(name, True) else np.nan, "low": low, "high": high}


def write_legend(log: Log, colours: Mapping[str, str]) -> None:
    """Write what the colours stand for."""
    figure = Figure(figsize=(2.6, 0.9 + 0.25 * len(colours)), dpi=_LEGEND_DPI)
    handles = [Patch(facecolor=colour, label=name) for name, colour in colours.items()]
    handles.append(Patch(facecolor=UNKNOWN_COLOUR, label="seen, not recognised"))
    figure.legend(handles=handles, loc="center", frameon=False, title="more opaque: surer", alignment="left")
    log.static("legend", log.rr.EncodedImage(contents=png_of(figure, _LEGEND_DPI), media_type="image/png"))
