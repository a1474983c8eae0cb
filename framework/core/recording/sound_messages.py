"""Sound that stands in a bag's messages: samples as they are, MP3, or pieces of a coded file (FLAC, Ogg, WAV).

A message may be cut off from the next at any byte. Each kind is one class that takes the messages in order, twice: to
count the samples, in one pass over the bag with all other streams, and to give them.
"""

from __future__ import annotations

import io
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import soundfile as sf

from .bag_images import bytes_of
from .bag_messages import DecodeError, field
from .mp3 import WARM_UP, Mp3Splitter, decode_frames
from .sound import MAX_CHANNELS, SAMPLE_RATES

MAX_JITTER_S = 0.1
"""A sound message that arrives this much later than its samples go on leaves a gap [s]."""

MAX_CODED_BYTES = 64 * 2**20
"""No coded file is put together of messages that is larger [bytes]."""

_STRETCH_SAMPLES = 2**19  # of all channels, which MP3 is decoded to in one go

MAX_EXCESS = 0.5
"""Coded sound may be longer than the time in which it was recorded by this share, and a minute [-]."""

_FILE_STARTS = (b"fLaC", b"OggS", b"RIFF", b"FORM")
_READ_FRAMES = 2**16
_FAINT, _LOUD = 1e-7, 4.0  # magnitudes of samples that are no integers: more than 24 bits, and some overshoot


@dataclass(frozen=True)
class Pcm:
    """How a sample is written: numpy's type (``<i3`` and ``>i3`` of 24 bits), and the numbers that are 0 and 1."""

    kind: str
    zero: float
    one: float


PCM = {
    "U8": Pcm("u1", 128.0, 128.0), "S8": Pcm("i1", 0.0, 128.0),
    "S16LE": Pcm("<i2", 0.0, 2.0**15), "S16BE": Pcm(">i2", 0.0, 2.0**15),
    "S24LE": Pcm("<i3", 0.0, 2.0**23), "S24BE": Pcm(">i3", 0.0, 2.0**23),
    "S32LE": Pcm("<i4", 0.0, 2.0**31), "S32BE": Pcm(">i4", 0.0, 2.0**31),
    "F32LE": Pcm("<f4", 0.0, 1.0), "F32BE": Pcm(">f4", 0.0, 1.0),
    "F64LE": Pcm("<f8", 0.0, 1.0), "F64BE": Pcm(">f8", 0.0, 1.0),
}  # fmt: skip
"""By GStreamer's names, which AudioInfo states."""

Coding = Literal["pcm", "mp3", "file"]


@dataclass(frozen=True)
class SoundSource:
    """Where a bag's sound is, and how it is written.

    Parameters
    ----------
    topic, field
        Name of the topic, and path of the data in its messages.
    coding
        Samples (``pcm``), MP3, or a coded file that is cut into messages.
    pcm
        How samples are written; a key of `PCM`.
    sample_rate
        [Hz], None where it is not known; of coded sound its own goes.
    channels
        Interleaved channels.
    """

    topic: str
    field: str
    coding: Coding
    pcm: str
    sample_rate: int | None
    channels: int


class SoundReader(ABC):
    """Takes the messages of a topic of sound in order.

    `frames` are the samples of each channel in each of the messages so far; 0 where one cannot be used.
    """

    def __init__(self, source: SoundSource):
        self.source = source
        self.sample_rate = source.sample_rate
        self.channels = source.channels
        self.frames: list[int] = []

    @abstractmethod
    def count(self, time_ns: int, content: Any) -> None:
        """Count the samples of a message, None where it cannot be decoded; raises `DecodeError`."""

    def finish(self) -> str:
        """Count what the last message leaves; say what is wrong with all of it, if anything."""
        return ""

    def samples(self, time_ns: int, content: Any) -> np.ndarray:
        """Give the samples of a message as it comes, (m, channels) float32; in place of `count` and `pieces`.

        Raises
        ------
        DecodeError
            It cannot be decoded, or not before those that follow.
        """
        raise DecodeError("a coded file that is cut into messages can only be decoded once it is complete")

    @abstractmethod
    def pieces(self, messages: Iterable[tuple[int, Any]], places: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Give the samples again, (m, channels) float32.

        Parameters
        ----------
        messages
            Time [ns] and content, None where it cannot be decoded, of each.
        places : (n,)
            Place of each message's first sample in the count of all.

        Yields
        ------
        place, samples
        """


class PcmReader(SoundReader):
    """Samples as they are."""

    def __init__(self, source: SoundSource):
        super().__init__(source)
        self._pcm = PCM[source.pcm]
        self._rest = b""
        self._ragged = False
        self._due_ns: float | None = None

    def count(self, time_ns: int, content: Any) -> None:
        """Count by reading."""
        self.frames.append(0)
        self.frames[-1] = len(self.samples(time_ns, content))

    def pieces(self, messages: Iterable[tuple[int, Any]], places: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Give each message's samples."""
        again = PcmReader(self.source)
        again.sample_rate = self.sample_rate
        for place, (time_ns, content) in zip(places.tolist(), messages, strict=False):
            try:
                yield place, again.samples(time_ns, content)
            except DecodeError:
                continue

    def samples(self, time_ns: int, content: Any) -> np.ndarray:
        """Give a message's samples."""
        if content is None:
            return np.empty((0, self.channels), np.float32)
        values = field(content, self.source.field)
        try:
            values = bytes_of(content, self.source.field) if isinstance(values, str | bytes) else np.asarray(values)
        except ValueError as error:  # lists of different lengths
            raise DecodeError(f"{self.source.field} is no list of samples: {error}") from error
        if values.dtype.kind not in "iuf" or values.ndim != 1:
            raise DecodeError(f"{self.source.field} is no list of samples")
        if values.dtype == np.uint8:
            values = self._of_bytes(time_ns, values.tobytes())
        if len(values) % self.channels:
            raise DecodeError(f"{len(values)} samples of {values.dtype} in {self.channels} channels")
        samples = (values.astype(np.float32) - np.float32(self._pcm.zero)) / np.float32(self._pcm.one)
        return samples.reshape(-1, self.channels)

    def _of_bytes(self, time_ns: int, data: bytes) -> np.ndarray:
        """Make numbers of bytes, with those that the message before left; what is less than a frame is kept.

        After bytes that are missing, nobody knows where a sample begins if messages do not end with one. From the
        wrong place integers are as loud as can be, as their low bytes come first, and others of any magnitude.
        """
        width = int(self._pcm.kind[-1])
        block = width * self.channels
        late = self._due_ns is None or time_ns - self._due_ns > MAX_JITTER_S * 1e9
        if late:
            self._rest = b""
        data = self._rest + data
        self._ragged |= len(data) % block != 0
        if late and self._ragged:
            data = data[min(range(width), key=lambda skip: _oddness(numbers(data[skip:], self._pcm.kind), self._pcm)) :]
        whole = len(data) // block * block
        self._rest = data[whole:]
        self._due_ns = time_ns + whole / block / (self.sample_rate or 1) * 1e9
        return numbers(data[:whole], self._pcm.kind)


def numbers(data: bytes, kind: str) -> np.ndarray:
    """Make numbers of bytes, (n,); a rest that is none is left out."""
    width = int(kind[-1])
    data = data[: len(data) // width * width]
    if width != 3:
        return np.frombuffer(data, np.dtype(kind))
    low_first = np.frombuffer(data, np.uint8).reshape(-1, 3)[:, :: 1 if kind[0] == "<" else -1]
    padded = np.zeros((len(low_first), 4), np.uint8)
    padded[:, 1:] = low_first
    return padded.view("<i4").ravel() >> 8


def _oddness(values: np.ndarray, pcm: Pcm) -> float:
    """Say how little numbers look like samples: of integers by their loudness, of others by their magnitudes."""
    if not len(values):
        return 0.0
    if values.dtype.kind != "f":
        return float(np.square(values.astype(np.float64) - pcm.zero).mean())
    size = np.abs(values)
    return float(1.0 - ((size == 0) | ((size > _FAINT) & (size < _LOUD))).mean())


class Mp3Reader(SoundReader):
    """MP3, whose frames may begin in one message and end in another."""

    def __init__(self, source: SoundSource):
        super().__init__(source)
        self._splitter = Mp3Splitter()
        self._before: list[bytes] = []

    def count(self, time_ns: int, content: Any) -> None:
        """Count by the frames' headers."""
        self.frames.append(0)
        found = self._frames(content)
        if (header := self._splitter.header) is not None:
            self.sample_rate, self.channels = header.sample_rate, header.channels
            self.frames[-1] = len(found) * header.samples

    def _frames(self, content: Any) -> list[bytes]:
        if content is None:
            self._splitter.lose()
            return []
        return self._splitter.feed(bytes_of(content, self.source.field).tobytes())

    def samples(self, time_ns: int, content: Any) -> np.ndarray:
        """Decode the frames that end in a message."""
        found, header = self._frames(content), self._splitter.header
        if not found or header is None:
            return np.empty((0, self.channels), np.float32)
        self.sample_rate, self.channels = header.sample_rate, header.channels
        before = [] if self._splitter.broken else self._before
        self._before = [*before, *found][-WARM_UP:]
        return decode_frames(found, before, header)

    def finish(self) -> str:
        """Say that there is no frame, or that this libsndfile does not decode them."""
        if not any(self.frames):
            return "no frame of MP3 in it"
        if "MP3" not in sf.available_formats():
            return "MP3, which libsndfile reads from version 1.1 on"
        return ""

    def pieces(self, messages: Iterable[tuple[int, Any]], places: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Decode stretches that have no gap, step by step."""
        header = self._splitter.header
        again = Mp3Reader(self.source)
        before: list[bytes] = []
        held: list[bytes] = []
        start = end = 0
        for place, (_, content) in zip(places.tolist(), messages, strict=False):
            try:
                found = again._frames(content)
            except DecodeError:
                found = []
            if not found or header is None:
                continue
            broken = place != end or again._splitter.broken
            if held and (broken or (end - start) * header.channels > _STRETCH_SAMPLES):
                yield start, decode_frames(held, before, header)
                before, held = (before + held)[-WARM_UP:], []
            before = [] if broken else before
            if not held:
                start = place
            held += found
            end = place + len(found) * header.samples
        if held and header is not None:
            yield start, decode_frames(held, before, header)


class FileReader(SoundReader):
    """Coded files that are cut into messages: each goes from a message that begins with its mark to the next such one.

    A file's samples count as those of its first message.
    """

    def __init__(self, source: SoundSource):
        super().__init__(source)
        self._data = io.BytesIO()
        self._first = 0
        self._span_ns: list[int] = []
        self._problem = ""
        self._known = False

    def count(self, time_ns: int, content: Any) -> None:
        """Collect what belongs to one file, and count the file before."""
        self.frames.append(0)
        self._span_ns = [*self._span_ns[:1], time_ns]
        data = b"" if content is None else bytes_of(content, self.source.field).tobytes()
        if begins_file(data) and self._data.tell():
            self._count_file()
            self._first = len(self.frames) - 1
        self._keep(data)

    def _keep(self, data: bytes) -> None:
        if self._data.tell() + len(data) <= MAX_CODED_BYTES:
            self._data.write(data)
        else:
            self._problem = f"a coded file of more than {MAX_CODED_BYTES} bytes"

    def _count_file(self) -> None:
        """Count by decoding: what a header says is not to be relied on."""
        for samples in self._decoded(self._data):
            self.frames[self._first] += len(samples)
            seconds = sum(self.frames) / (self.sample_rate or 1)
            span = (self._span_ns[-1] - self._span_ns[0]) * 1e-9
            if seconds > span * (1 + MAX_EXCESS) + 60.0:
                self._problem = f"decodes to more than {seconds:.0f} s of sound in the {span:.0f} s of its messages"
                break
        self._data = io.BytesIO()

    def _decoded(self, data: io.BytesIO) -> Iterator[np.ndarray]:
        """Decode a file as far as it goes; those of other sample rate or channels than the first one are left out."""
        data.seek(0)
        try:
            with sf.SoundFile(data) as file:
                if not self._known:
                    low, high = SAMPLE_RATES
                    if not (low <= file.samplerate <= high and file.channels <= MAX_CHANNELS):
                        self._problem = f"{file.channels} channels of {file.samplerate} Hz"
                        return
                    self.sample_rate, self.channels, self._known = file.samplerate, file.channels, True
                if (file.samplerate, file.channels) == (self.sample_rate, self.channels):
                    while len(samples := file.read(_READ_FRAMES, dtype="float32", always_2d=True)):
                        yield samples
        except (sf.SoundFileError, RuntimeError, TypeError, ValueError) as error:
            self._problem = self._problem or ("" if self._known else f"no sound that can be read: {error}")

    def finish(self) -> str:
        """Count the last file."""
        self._count_file()
        return self._problem

    def pieces(self, messages: Iterable[tuple[int, Any]], places: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
        """Decode each file, step by step."""
        place = 0
        for number, (_, content) in enumerate(messages):
            if number >= len(places):
                break
            try:
                data = b"" if content is None else bytes_of(content, self.source.field).tobytes()
            except DecodeError:
                continue
            if begins_file(data) and self._data.tell():
                yield from self._placed(int(places[place]))
                place = number
            self._keep(data)
        yield from self._placed(int(places[place]))

    def _placed(self, place: int) -> Iterator[tuple[int, np.ndarray]]:
        data, self._data = self._data, io.BytesIO()
        for samples in self._decoded(data):
            yield place, samples
            place += len(samples)


def begins_file(data: bytes) -> bool:
    """Say whether a file begins here: each page of an Ogg file has its mark, but only the first one is called that."""
    return data.startswith(_FILE_STARTS) and (not data.startswith(b"OggS") or (len(data) > 5 and bool(data[5] & 2)))


READERS: dict[Coding, type[SoundReader]] = {"pcm": PcmReader, "mp3": Mp3Reader, "file": FileReader}
