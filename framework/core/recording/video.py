"""Video of a bag: packets of H.264, H.265 and the like, decoded by PyAV (FFmpeg), which is the extra `video`."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np

from ..errors import InputError
from .bag_files import BagFile
from .bag_images import bytes_of
from .bag_messages import DecodeError, decode, field, fields_of
from .pixels import MAX_IMAGE_PIXELS
from .types import Frame, Wanted, always

_CODECS = {"264": "h264", "avc": "h264", "265": "hevc", "hevc": "hevc", "av1": "libdav1d", "vp8": "vp8", "vp9": "vp9"}
"""What the name of a codec or an encoder has in it (``h264``, ``libx264``, ``hevc_nvenc``), and who decodes it."""

_WAITING = 16
"""Packets after which an image that has not come will not come: no codec here keeps more of them [-]."""


def codec_of(sample: Any) -> str | None:
    """Give FFmpeg's name of the codec of a message, if it is a packet of video; None for single images.

    Raises
    ------
    InputError
        A video of another codec, or PyAV is not installed.
    """
    fields = fields_of(sample)
    if "encoding" in fields and "height" in fields and "step" in fields:  # sensor_msgs/Image
        return None
    name = "encoding" if "encoding" in fields else "format"
    if name not in fields:
        return None
    stated = str(field(sample, name)).casefold()
    codec = next((codec for mark, codec in _CODECS.items() if mark in stated), None)
    if codec is None:
        if name == "format":
            return None  # an image; what is none is said with each
        raise InputError("video", f"codec {stated!r}", expected="H.264, H.265, AV1, VP8 or VP9")
    _pyav()
    return codec


def _pyav() -> Any:
    try:
        return import_module("av")
    except ImportError as error:
        raise InputError("PyAV", "is not installed", expected='pip install "bevameter[video]"') from error


class BagVideo:
    """Video of a topic, one image a message, decoded one after the other (a `CameraStream`).

    An image that cannot be decoded, and those after it up to the next that needs no other (a key frame), come as None.

    Parameters
    ----------
    bag
        The bag.
    topic
        Name of the topic.
    codec
        Of `codec_of`.
    time_ns : (n,)
        Time of each message [ns].
    origin_ns
        Zero of the recording's clock [ns].
    """

    def __init__(self, bag: BagFile, topic: str, codec: str, time_ns: np.ndarray, origin_ns: int):
        self._bag, self._topic, self._codec = bag, topic, codec
        self._time_s = ((time_ns - origin_ns) * 1e-9).tolist()

    def __len__(self) -> int:
        return len(self._time_s)

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield every image that is wanted; all are decoded, as each is coded by what changed from those before."""
        decoder = _Decoder(self._codec)
        pictures: dict[int, Any] = {}
        problems: dict[int, str] = {}
        place = 0
        for number, data in self._packets(problems):
            pictures |= decoder.pictures(number, data, problems)
            last = number - (0 if data is None else _WAITING)
            while place < len(self) and (place in pictures or place in problems or place <= last):
                time, picture = self._time_s[place], pictures.pop(place, None)
                if wanted(time):
                    problem = problems.pop(place, "it builds on an image that is missing or damaged")
                    yield self._frame(place, time, picture, problem)
                place += 1

    def _packets(self, problems: dict[int, str]) -> Iterator[tuple[int, bytes | None]]:
        """Yield each message's number and data, empty where it cannot be read; at last None."""
        messages = self._bag.messages({self._topic})
        for number, message in zip(range(len(self)), messages, strict=False):
            data = b""
            try:
                data = bytes_of(decode(message), "data").tobytes()
            except DecodeError as error:
                problems[number] = str(error)
            yield number, data
        yield len(self), None

    def _frame(self, number: int, time: float, picture: Any, problem: str) -> Frame:
        if picture is None:
            return Frame(time, None, f"{self._topic}, image {number}: {problem}")
        return Frame(time, np.asarray(picture.to_ndarray(format="bgr24"), dtype=np.uint8))


class _Decoder:
    """FFmpeg's decoder of one codec, fed packet by packet; nothing is passed on that builds on what is missing."""

    def __init__(self, codec: str):
        self._av = _pyav()
        self._context = self._av.CodecContext.create(codec, "r")
        self._context.thread_count = 1  # more of them hold images back
        self._context.options = {"max_pixels": str(MAX_IMAGE_PIXELS), "err_detect": "explode"}
        self._whole = False

    def pictures(self, number: int, data: bytes | None, problems: dict[int, str]) -> dict[int, Any]:
        """Decode a packet, or what is left where `data` is None; give images by the number of their packet."""
        packet = None
        if data is not None:
            packet = self._av.Packet(data)
            packet.pts = number
        found: dict[int, Any] = {}
        try:
            if data == b"":
                raise ValueError("an empty packet")
            decoded = self._context.decode(packet)
        except (self._av.FFmpegError, ValueError) as error:
            problems.setdefault(number, f"damaged: {error}")
            self._whole = False
            return found
        for picture in decoded:
            self._whole = (self._whole or picture.key_frame) and not picture.is_corrupt
            if self._whole and picture.pts is not None:
                found[picture.pts] = picture
        return found
