"""Raw images as cameras send them, made into blue, green and red of 8 bits.

The encodings are those of ROS (sensor_msgs/image_encodings.hpp), which other recorders use, too. OpenCV makes the
conversions: Bayer patterns are interpolated bilinearly, and YUV is that of ITU-R BT.601 with 16 to 235 for black to
white, as cameras send it and as ROS's own cv_bridge reads it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

MAX_IMAGE_PIXELS = 64_000_000
"""No image is decoded that has more pixels by its header [-]."""

MIN_BAYER_SIDE = 3
"""Interpolation of a Bayer pattern needs neighbours on both sides [px]."""


class PixelError(ValueError):
    """Data that make no image; the text says why."""


@dataclass(frozen=True)
class _Layout:
    """Samples a pixel, bytes a sample, and OpenCV's code to BGR (None where it is that)."""

    samples: int
    bytes: int
    code: int | None


def _layouts() -> Mapping[str, _Layout]:
    of_channels = {
        "mono": (1, cv2.COLOR_GRAY2BGR), "rgb": (3, cv2.COLOR_RGB2BGR), "bgr": (3, None),
        "rgba": (4, cv2.COLOR_RGBA2BGR), "bgra": (4, cv2.COLOR_BGRA2BGR),
        "bayer_rggb": (1, cv2.COLOR_BayerRGGB2BGR), "bayer_bggr": (1, cv2.COLOR_BayerBGGR2BGR),
        "bayer_gbrg": (1, cv2.COLOR_BayerGBRG2BGR), "bayer_grbg": (1, cv2.COLOR_BayerGRBG2BGR),
    }  # fmt: skip
    found = {
        f"{name}{8 * size}": _Layout(samples, size, code)
        for name, (samples, code) in of_channels.items()
        for size in (1, 2)
    }
    for samples, name in ((1, "mono"), (3, "bgr"), (4, "bgra")):  # OpenCV's own names of types
        found[f"8UC{samples}"], found[f"16UC{samples}"] = found[f"{name}8"], found[f"{name}16"]
    for name in ("yuv422", "uyvy"):
        found[name] = _Layout(2, 1, cv2.COLOR_YUV2BGR_UYVY)
    for name in ("yuv422_yuy2", "yuyv"):
        found[name] = _Layout(2, 1, cv2.COLOR_YUV2BGR_YUY2)
    return found


_LAYOUTS = _layouts()
_PLANES = {"nv12": cv2.COLOR_YUV2BGR_NV12, "nv21": cv2.COLOR_YUV2BGR_NV21, "nv24": cv2.COLOR_YUV2BGR_YUY2}
ENCODINGS = (*_LAYOUTS, *_PLANES)
"""Encodings that are read."""

_NO_LIGHT = ("32FC", "64FC", "16SC", "32SC")


def is_depth(encoding: str) -> bool:
    """Say whether an encoding, or the format of a compressed image, is of distances and not of light."""
    return encoding.startswith(_NO_LIGHT) or "compresseddepth" in encoding.casefold()


def to_8_bits(values: np.ndarray, bit_depth: int) -> np.ndarray:
    """Scale samples of so many bits to 8, the brightest that the depth allows to 255; what is beyond stays at 255."""
    return np.asarray(cv2.convertScaleAbs(values, alpha=255.0 / (2**bit_depth - 1)), dtype=np.uint8)


def bgr_of(
    raw: np.ndarray,
    encoding: str,
    width: int,
    height: int,
    step: int,
    *,
    big_endian: bool = False,
    bit_depth: int | None = None,
) -> np.ndarray:
    """Make an image of raw data.

    Parameters
    ----------
    raw : (n,)
        uint8.
    encoding
        One of `ENCODINGS`.
    width, height
        [px].
    step
        Bytes from one row to the next; 0 where rows are not padded.
    big_endian
        Order of the bytes of 16-bit samples.
    bit_depth
        Bits that 16-bit samples make use of; all where None.

    Returns
    -------
    np.ndarray
        (h, w, 3) uint8, blue, green, red.

    Raises
    ------
    PixelError
        The encoding is not known, the data are too few, or the size is 0 or beyond `MAX_IMAGE_PIXELS`.
    """
    if encoding not in _LAYOUTS and encoding not in _PLANES:
        what = "is no image in colours or grey" if is_depth(encoding) else "is not read"
        raise PixelError(f"encoding {encoding!r} {what}; {', '.join(ENCODINGS)} are")
    said = f"{len(raw)} bytes for {width} x {height} pixels of {encoding} in rows of {step}"
    if width <= 0 or height <= 0 or width * height > MAX_IMAGE_PIXELS:
        raise PixelError(said)
    try:
        if encoding in _PLANES:
            return _of_planes(raw, encoding, width, height, step, said)
        layout = _LAYOUTS[encoding]
        return _of_pixels(_rows(raw, width * layout.samples * layout.bytes, height, step, said),
                          layout, encoding, big_endian, bit_depth)  # fmt: skip
    except cv2.error as error:
        raise PixelError(f"{said}: {error.err}") from error


def _rows(raw: np.ndarray, used: int, height: int, step: int, said: str) -> np.ndarray:
    """Cut data into rows, (height, used); the last row may come without its padding."""
    step = step or used
    last = (height - 1) * step + used
    if step < used or len(raw) < last:
        raise PixelError(said)
    if step == used:
        return raw[:last].reshape(height, used)
    return np.lib.stride_tricks.as_strided(raw[:last], (height, used), (step, 1), writeable=False)


def _of_pixels(rows: np.ndarray, layout: _Layout, encoding: str, big_endian: bool, bit_depth: int | None) -> np.ndarray:
    height = len(rows)
    if layout.bytes == 2:
        values = np.ascontiguousarray(rows).view(">u2" if big_endian else "<u2").astype(np.uint16, copy=False)
        rows = to_8_bits(values, bit_depth or 16).reshape(height, -1)
    if encoding.startswith("bayer") and min(rows.shape) < MIN_BAYER_SIDE:
        raise PixelError(f"{rows.shape[1]} x {height} pixels of {encoding}: too few to interpolate")
    pixels = rows.reshape(height, -1, layout.samples)
    if layout.code is None:
        return np.array(pixels)
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), layout.code), dtype=np.uint8)


def _of_planes(raw: np.ndarray, encoding: str, width: int, height: int, step: int, said: str) -> np.ndarray:
    """Make an image of a plane of brightness and one of colours behind it.

    For rows of these ROS states the width, or twice that (bytes a pixel times width).
    """
    full = encoding == "nv24"
    lines = 3 * height if full else height * 3 // 2
    if (width % 2 or height % 2) and not full:
        raise PixelError(f"{said}: an odd number")
    if step == 2 * width and len(raw) == width * lines:
        step = width
    if full:  # the colours' rows are twice as long: each pixel has its own
        step = step or width
        bright = _rows(raw, width, height, step, said)
        colours = _rows(raw[height * step :], 2 * width, height, 2 * step, said).reshape(height, width, 2)
        # OpenCV has no code for this, but one where two pixels share a colour: each pixel is laid down twice.
        pairs = np.stack([bright, colours[:, :, 0], bright, colours[:, :, 1]], axis=2)
        wide = cv2.cvtColor(pairs.reshape(height, 2 * width, 2), _PLANES[encoding])
        return np.ascontiguousarray(wide[:, ::2])
    rows = np.ascontiguousarray(_rows(raw, width, lines, step, said))
    return np.asarray(cv2.cvtColor(rows, _PLANES[encoding]), dtype=np.uint8)
