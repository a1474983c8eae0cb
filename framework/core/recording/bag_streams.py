"""Camera and sound of a bag, read message by message so that memory does not grow with the recording."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ..errors import InputError
from .bag_files import BagFile, Message
from .bag_messages import DecodeError, decode, field, fields_of
from .camera import MAX_IMAGE_PIXELS, decode_image
from .sound import block_hop, sound_block
from .topic_map import SoundFormat
from .types import Frame, SoundBlock, Wanted, always

MAX_JITTER_S = 0.1
"""A sound message that arrives this much later than its samples go on leaves a gap [s]."""

_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1, "8UC1": 1, "8UC3": 3}
_CONVERT = {"rgb8": cv2.COLOR_RGB2BGR, "rgba8": cv2.COLOR_RGBA2BGR, "bgra8": cv2.COLOR_BGRA2BGR,
            "mono8": cv2.COLOR_GRAY2BGR, "8UC1": cv2.COLOR_GRAY2BGR}  # fmt: skip
_SCALE = {"pcm8": (np.dtype("u1"), 128.0, 128.0), "pcm16": (np.dtype("<i2"), 0.0, 32768.0),
          "pcm32": (np.dtype("<i4"), 0.0, 2147483648.0), "float32": (np.dtype("<f4"), 0.0, 1.0)}  # fmt: skip


class BagCamera:
    """Images of a topic, decoded one at a time (a `CameraStream`).

    Parameters
    ----------
    bag
        The bag.
    topic
        Name of the topic.
    time_ns : (n,)
        Time of each image [ns].
    origin_ns
        Zero of the recording's clock [ns].
    """

    def __init__(self, bag: BagFile, topic: str, time_ns: np.ndarray, origin_ns: int):
        self._bag, self._topic, self._time_ns, self._origin_ns = bag, topic, time_ns, origin_ns

    def __len__(self) -> int:
        return len(self._time_ns)

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield every image that is wanted; one that cannot be decoded comes as None with its problem."""
        messages = self._bag.messages({self._topic})
        for number, (time, message) in enumerate(zip((self._time_ns - self._origin_ns) * 1e-9, messages, strict=False)):
            if not wanted(float(time)):
                continue
            try:
                yield Frame(float(time), image_of(decode(message), f"{self._bag.path}, {self._topic}, image {number}"))
            except (DecodeError, InputError) as error:
                yield Frame(float(time), None, f"{self._topic}, image {number}: {error}")


def image_of(content: Any, source: str) -> np.ndarray:
    """Make an image (h, w, 3) uint8 BGR of an Image or CompressedImage; raises `DecodeError` or `InputError`."""
    data = field(content, "data")
    if isinstance(data, str):  # JSON
        try:
            data = base64.b64decode(data, validate=True)
        except (binascii.Error, ValueError) as error:
            raise DecodeError(f"data is no base64: {error}") from error
    raw = np.frombuffer(data, np.uint8) if isinstance(data, bytes) else np.asarray(data, np.uint8)
    if "encoding" not in fields_of(content):
        return decode_image(raw.tobytes(), source)
    encoding = str(field(content, "encoding"))
    if encoding not in _CHANNELS:
        raise DecodeError(f"encoding {encoding!r}; {', '.join(_CHANNELS)} are known")
    height, width, step = (int(field(content, name)) for name in ("height", "width", "step"))
    used = width * _CHANNELS[encoding]
    if not 0 < height * width <= MAX_IMAGE_PIXELS or step < used or len(raw) < step * height:
        raise DecodeError(f"{len(raw)} bytes for {width} x {height} pixels of {encoding} in rows of {step}")
    pixels = raw[: step * height].reshape(height, step)[:, :used].reshape(height, width, -1)
    if encoding in _CONVERT:
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), _CONVERT[encoding]), dtype=np.uint8)
    return pixels.copy()


@dataclass(frozen=True)
class SoundLayout:
    """How the samples of a sound topic are written, and when each message's first sample was.

    Parameters
    ----------
    topic
        Name of the topic.
    field
        Path of the samples.
    format
        How a sample is written.
    channels
        Interleaved channels.
    sample_rate
        [Hz].
    start_s : (n,)
        Start of each message on the recording's clock [s].
    frames : (n,)
        Frames of each message; 0 where it could not be decoded.
    """

    topic: str
    field: str
    format: SoundFormat
    channels: int
    sample_rate: int
    start_s: np.ndarray
    frames: np.ndarray

    def places(self) -> np.ndarray:
        """Place the messages' first samples on a gapless count of samples, (n,), by their times.

        Messages follow each other without a gap as long as their times agree with that within `MAX_JITTER_S`: the
        samples' own clock is steadier than their arrival.
        """
        rate, place = self.sample_rate, 0
        places = np.zeros(len(self.frames), dtype=np.int64)
        for number, (start, frames) in enumerate(zip(self.start_s.tolist(), self.frames.tolist(), strict=True)):
            by_time = round((start - self.start_s[0]) * rate)
            if by_time - place > MAX_JITTER_S * rate:
                place = by_time
            places[number] = place
            place += frames
        return places


class BagSound:
    """Sound of a topic, in blocks (a `SoundStream`); where messages are missing, blocks come as None."""

    def __init__(self, bag: BagFile, layout: SoundLayout):
        self._bag, self._layout = bag, layout
        self._places = layout.places()
        self._total = int(self._places[-1] + layout.frames[-1])

    @property
    def sample_rate(self) -> int:
        """Samples a second [Hz]."""
        return self._layout.sample_rate

    @property
    def start_s(self) -> float:
        """Time of the first sample on the recording's clock [s]."""
        return float(self._layout.start_s[0])

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample [s]."""
        return self._total / self.sample_rate

    @property
    def gap_s(self) -> float:
        """Time within it that has no sample [s]."""
        return (self._total - int(self._layout.frames.sum())) / self.sample_rate

    def blocks(self, block_s: float, hop_s: float) -> Iterator[SoundBlock]:
        """Yield blocks of `block_s` seconds whose starts are `hop_s` apart [s]; the last, shorter rest is left out."""
        size, hop = block_hop(block_s, hop_s, self.sample_rate)
        start, base = 0, 0
        channels = self._layout.channels
        held, there = np.empty((0, channels), np.float32), np.empty(0, bool)
        for place, samples in self._pieces():
            gap = place - (base + len(held))
            held = np.concatenate([held, np.zeros((gap, channels), np.float32), samples])
            there = np.concatenate([there, np.zeros(gap, bool), np.ones(len(samples), bool)])
            while start + size <= base + len(held):
                part = slice(start - base, start - base + size)
                time = self.start_s + start / self.sample_rate
                if there[part].all():
                    yield sound_block(time, held[part])
                else:
                    yield SoundBlock(time, None, f"{self._layout.topic} at {time:.2f} s: no sound was recorded")
                start += hop
            drop = min(start - base, len(held))
            held, there, base = held[drop:], there[drop:], base + drop

    def _pieces(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield each message's place and samples (m, c); a long gap is filled in steps, so that it needs no memory."""
        step = self.sample_rate
        end = 0
        for place, message in zip(self._places.tolist(), self._bag.messages({self._layout.topic}), strict=False):
            while place - end > step:
                end += step
                yield end, np.empty((0, self._layout.channels), np.float32)
            try:
                samples = samples_of(decode(message), self._layout.field, self._layout.format, self._layout.channels)
            except DecodeError:
                continue
            end = place + len(samples)
            yield place, samples


def samples_of(content: Any, path: str, form: SoundFormat, channels: int) -> np.ndarray:
    """Give the samples of a sound message, (m, channels) float32; raises `DecodeError`."""
    values = np.asarray(field(content, path))
    kind, zero, scale = _SCALE[form]
    if values.dtype == np.uint8 and form != "pcm8":
        if len(values) % (kind.itemsize * channels):
            raise DecodeError(f"{len(values)} bytes of {form} in {channels} channels")
        values = values.view(kind) if values.flags.c_contiguous else values.copy().view(kind)
    if values.dtype.kind not in "iuf" or len(values) % channels:
        raise DecodeError(f"{len(values)} samples of {values.dtype} in {channels} channels")
    return ((values.astype(np.float32) - np.float32(zero)) / np.float32(scale)).reshape(-1, channels)


def is_mp3(message: Message, content: Any, path: str) -> bool:
    """Recognise MP3 data, which ROS's audio_capture sends by default, by the mark at the beginning of each frame."""
    try:
        values = np.asarray(field(content, path))
    except DecodeError:
        return False
    return bool(values.dtype == np.uint8 and len(values) > 3 and values[0] == 0xFF and values[1] & 0xE6 == 0xE2)
