"""Video of a bag: packets of H.264, H.265 and the like, decoded by PyAV (FFmpeg), which is the extra `video`."""

from __future__ import annotations

from collections import deque
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
        self._bag, self._topic, self.codec = bag, topic, codec
        self._time_s = ((time_ns - origin_ns) * 1e-9).tolist()

    def __len__(self) -> int:
        return len(self._time_s)

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield every image that is wanted; all are decoded, as each is coded by what changed from those before."""
        images = VideoImages(self._topic, self.codec, wanted)
        for time_s, message in zip(self._time_s, self._bag.messages({self._topic}), strict=False):
            try:
                content, problem = decode(message), ""
            except DecodeError as error:
                content, problem = None, str(error)
            yield from images.take(time_s, content, problem)
        yield from images.end()


class VideoImages:
    """Images of the packets of a video, as they can be decoded: a codec may hold some back.

    Parameters
    ----------
    topic
        Name of the topic.
    codec
        Of `codec_of`.
    wanted
        Called with the time of each [s]; says whether it is given.
    """

    def __init__(self, topic: str, codec: str, wanted: Wanted = always):
        self._topic, self._decoder, self._wanted = topic, _Decoder(codec), wanted
        self._pictures: dict[int, Any] = {}
        self._problems: dict[int, str] = {}
        self._times: deque[float] = deque()
        self._place = 0

    def take(self, time_s: float, content: Any, problem: str = "") -> list[Frame]:
        """Take a message: its time [s], and what it holds, None with the problem where it cannot be read; give the
        images that are complete.
        """
        number, data = self._place + len(self._times), b""
        self._times.append(time_s)
        try:
            data = b"" if content is None else bytes_of(content, "data").tobytes()
        except DecodeError as error:
            problem = str(error)
        if problem:
            self._problems[number] = problem
        self._pictures |= self._decoder.pictures(number, data, self._problems)
        return self._given(number - _WAITING)

    def end(self) -> list[Frame]:
        """Give the images that are left."""
        number = self._place + len(self._times)
        self._pictures |= self._decoder.pictures(number, None, self._problems)
        return self._given(number)

    def _given(self, last: int) -> list[Frame]:
        """Give images up to a number, and those after it that are there."""
        frames: list[Frame] = []
        while self._times and (self._place in self._pictures or self._place in self._problems or self._place <= last):
            picture = self._pictures.pop(self._place, None)
            problem = self._problems.pop(self._place, "it builds on an image that is missing or damaged")
            time_s = self._times.popleft()
            if self._wanted(time_s):
                frames.append(self._frame(time_s, picture, problem))
            self._place += 1
        return frames

    def _frame(self, time_s: float, picture: Any, problem: str) -> Frame:
        if picture is None:
            return Frame(time_s, None, f"{self._topic}, image {self._place}: {problem}")
        return Frame(time_s, np.asarray(picture.to_ndarray(format="bgr24"), dtype=np.uint8))


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
