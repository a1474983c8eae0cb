"""Images that stand in a bag's messages, raw or compressed one by one (for video see `video`)."""

from __future__ import annotations

import base64
import binascii
import re
from typing import Any

import numpy as np

from ..errors import InputError
from .bag_messages import DecodeError, field, fields_of, number
from .camera import decode_image
from .pixels import ENCODINGS, PixelError, bgr_of, is_depth

_DEPTH_NAMES = re.compile(r"depth|disparity", re.IGNORECASE)
_BAYER = re.compile(r"bayer_(rggb|bggr|gbrg|grbg)\d+")


def bytes_of(content: Any, path: str) -> np.ndarray:
    """Give the bytes at a path, (n,) uint8, those of JSON from base64; raises `DecodeError`."""
    data = field(content, path)
    if isinstance(data, str):
        try:
            data = base64.b64decode(data, validate=True)
        except (binascii.Error, ValueError) as error:
            raise DecodeError(f"{path} is no base64: {error}") from error
    try:
        return np.frombuffer(data, np.uint8) if isinstance(data, bytes | bytearray) else np.asarray(data, np.uint8)
    except (TypeError, ValueError, OverflowError) as error:
        raise DecodeError(f"{path} is no bytes: {error}") from error


def image_of(content: Any, source: str, bit_depth: int | None = None) -> np.ndarray:
    """Make an image of an Image or CompressedImage.

    Parameters
    ----------
    content
        The message.
    source
        Where it stands, for errors.
    bit_depth
        Bits that 16-bit samples make use of; all where None.

    Returns
    -------
    np.ndarray
        (h, w, 3) uint8, blue, green, red.

    Raises
    ------
    DecodeError, InputError
        It is no image that can be read.
    """
    raw = bytes_of(content, "data")
    if "encoding" not in fields_of(content):
        return _of_compressed(content, raw, source, bit_depth)
    width, height, step = (int(number(content, name)) for name in ("width", "height", "step"))
    big_endian = "is_bigendian" in fields_of(content) and bool(field(content, "is_bigendian"))
    try:
        encoding = str(field(content, "encoding"))
        return bgr_of(raw, encoding, width, height, step, big_endian=big_endian, bit_depth=bit_depth)
    except PixelError as error:
        raise DecodeError(str(error)) from error


def _of_compressed(content: Any, raw: np.ndarray, source: str, bit_depth: int | None) -> np.ndarray:
    """Decode a compressed image; ROS states its format as ``jpeg`` or ``rgb8; jpeg compressed bgr8``."""
    stated = str(field(content, "format")) if "format" in fields_of(content) else ""
    if is_depth(stated):
        raise DecodeError(f"format {stated!r} is of distances and no image")
    image = decode_image(raw.tobytes(), source, bit_depth=bit_depth)
    before, _, after = stated.partition(";")
    pattern = _BAYER.fullmatch(before.strip())
    if pattern and not re.search("bgr|rgb", after):  # the mosaic itself was compressed, as if it were grey
        try:
            return bgr_of(image[:, :, 1].ravel(), f"bayer_{pattern[1]}8", image.shape[1], image.shape[0], 0)
        except PixelError as error:
            raise InputError(source, str(error), expected="an image") from error
    return image


def no_picture(topic: str, sample: Any) -> str:
    """Say why a topic's first message, decoded, is no image of the ground; empty where it may be one."""
    fields = fields_of(sample)
    for name in ("encoding", "format"):
        stated = str(field(sample, name)) if name in fields else ""
        if is_depth(stated) or (stated in ("16UC1", "mono16") and _DEPTH_NAMES.search(topic)):
            return f"{stated} is of distances, no image of the ground"
    if {"encoding", "step"} <= set(fields) and (encoding := str(field(sample, "encoding"))) not in ENCODINGS:
        return f"encoding {encoding!r} is not read; {', '.join(ENCODINGS)} are"
    return ""
