"""Sound, from files that somebody else made: read within limits, in blocks or whole."""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import soundfile as sf

from ..errors import InputError
from ..files import file_size
from .channels import mixed
from .mp3 import Mp3Splitter, counted
from .types import SoundBlock

MAX_SOUND_SAMPLES = 2**27
"""No more sound than this is read into memory at once, less where it has more than two channels: 46 minutes of 48 kHz
[-]."""

SAMPLE_RATES = (1_000, 768_000)
"""Sample rates that a sound may have [Hz]."""

MAX_CHANNELS = 64
"""Channels that a sound may have [-]."""

SOUND_FORMATS = ("WAV", "WAVEX", "RF64", "FLAC", "OGG", "AIFF", "W64", "MP3")
_EXPECTED = "a WAV, FLAC, Ogg, AIFF or MP3 file"

MAX_MP3_BYTES = 256 * 2**20
"""No MP3 file is read that is larger: 4 hours at 128 kbit/s [bytes]."""

_READ_FRAMES = 2**16
_COUNT_FRAMES = 2**8  # a read that fails gives nothing, so that a damaged file is counted in small steps


def read_sound(path: str | Path, start_s: float = 0.0, end_s: float | None = None) -> tuple[np.ndarray, int]:
    """Read a sound file, or a stretch of it, into memory.

    Parameters
    ----------
    path
        WAV, FLAC, Ogg, AIFF or MP3.
    start_s, end_s
        The stretch [s] from the beginning of the file; to its end where `end_s` is None.

    Returns
    -------
    samples : (m,)
        float32 in [-1, 1], the channels as `mixed` mixes them.
    sample_rate
        [Hz].

    Raises
    ------
    InputError
        The file is missing, no sound, empty, cut off, too long for memory, or holds samples that are no finite
        numbers; the stretch lies outside of the file.
    """
    channels, rate = read_channels(path, start_s, end_s)
    return mixed(channels), rate


def read_channels(path: str | Path, start_s: float = 0.0, end_s: float | None = None) -> tuple[np.ndarray, int]:
    """Read a sound file as `read_sound` does, each channel by itself: (m, c) float32 in [-1, 1], and the rate [Hz]."""
    stream = SoundFileStream(path)
    if stream.problems:
        raise InputError(path, stream.problems[0].removeprefix(f"{stream.path.name}: "), expected="a whole sound file")
    rate = stream.sample_rate
    first = round(start_s * rate)
    last = stream.frames if end_s is None else round(end_s * rate)
    if not 0 <= first < last <= stream.frames + 0.02 * rate:
        raise InputError(
            path,
            f"a stretch from {start_s:g} s to {last / rate:g} s",
            expected=f"a stretch within its {stream.duration_s:.3f} s",
        )
    last = min(last, stream.frames)
    with stream.open() as file:
        most = 2 * MAX_SOUND_SAMPLES // max(file.channels, 2)
        if last - first > most:
            raise InputError(path, f"{last - first} samples", expected=f"no more than {most} at once")
        samples = np.empty((last - first, file.channels), dtype=np.float32)
        file.seek(first)
        for place in range(0, len(samples), _READ_FRAMES):
            piece = samples[place : place + _READ_FRAMES]
            read = _frames(file, len(piece))
            if len(read) < len(piece):
                raise InputError(
                    path,
                    f"ends after {(first + place + len(read)) / rate:.3f} s of {stream.frames / rate:.3f} s",
                    expected="a whole sound file",
                )
            piece[:] = read
    bad = ~np.isfinite(samples)
    if bad.any():
        where = int(np.argmax(bad.any(axis=1)))
        raise InputError(
            path, f"sample {samples[bad][0]}", expected="finite samples", place=f"{(first + where) / rate:.4f} s"
        )
    return np.clip(samples, -1.0, 1.0, out=samples), rate


class SoundFileStream:
    """Sound of a file in blocks; its memory is that of one block, however long the file (a `SoundStream`).

    A file that was cut off is read as far as it goes, with a note in `problems`.

    Parameters
    ----------
    path
        WAV, FLAC, Ogg, AIFF or MP3.
    start_s
        Time of the first sample on the recording's clock [s].

    Raises
    ------
    InputError
        The file is missing, no sound, or holds no sample.
    """

    def __init__(self, path: str | Path, start_s: float = 0.0):
        self.path = Path(path)
        self._start_s = start_s
        self._mp3: bytes | None = None
        self._mp3_rest = 0
        self.problems: tuple[str, ...] = ()
        with self.open() as file:
            self._sample_rate = file.samplerate
            stated = max(file.frames, _frames_stated(self.path, file))
            self.frames = self._readable(file)
            cut = file.format == "OGG" and _ogg_cut(self.path)
        if not self.frames:
            raise InputError(self.path, "no sample in it that can be read", expected="sound")
        if self.frames < stated:
            whole = f"{stated / self._sample_rate:.3f} s"
            self.problems = (f"{self.path.name}: cut off, ends after {self.duration_s:.3f} s of {whole}",)
        elif file.format == "MP3" and self._mp3_rest:
            self.problems = (f"{self.path.name}: damaged, read up to {self.duration_s:.3f} s",)
        elif cut:
            self.problems = (f"{self.path.name}: cut off, ends after {self.duration_s:.3f} s without its last page",)

    @property
    def sample_rate(self) -> int:
        """Samples a second [Hz]."""
        return self._sample_rate

    @property
    def start_s(self) -> float:
        """Time of the first sample on the recording's clock [s]."""
        return self._start_s

    @property
    def duration_s(self) -> float:
        """Length of what is readable [s]."""
        return self.frames / self._sample_rate

    def open(self) -> sf.SoundFile:
        """Open the file; raises `InputError` where it is missing, no sound, or beyond the limits."""
        if not file_size(self.path, "a sound file"):
            raise InputError(self.path, "an empty file", expected="a sound file")
        try:
            file = sf.SoundFile(self.path if self._mp3 is None else io.BytesIO(self._mp3))
            if file.format == "MP3" and self._mp3 is None:
                file.close()
                self._mp3, self._mp3_rest = self._mp3_frames()
                file = sf.SoundFile(io.BytesIO(self._mp3))
        except (sf.SoundFileError, OSError, TypeError, ValueError) as error:
            raise InputError(self.path, f"no sound that can be read: {error}", expected=_EXPECTED) from error
        low, high = SAMPLE_RATES
        fault = None
        if file.format not in SOUND_FORMATS:
            fault = (f"sound of kind {file.format}", _EXPECTED)
        elif not low <= file.samplerate <= high:
            fault = (f"sample rate {file.samplerate} Hz", f"{low} to {high} Hz")
        elif file.channels > MAX_CHANNELS:
            fault = (f"{file.channels} channels", f"no more than {MAX_CHANNELS}")
        if fault:
            file.close()
            raise InputError(self.path, fault[0], expected=fault[1])
        return file

    def _mp3_frames(self) -> tuple[bytes, int]:
        """Give the frames of an MP3 file up to where it is damaged, with their number before them, and how many follow.

        Without that number libsndfile goes by the first frame's bit rate, and gives too much or too little.
        """
        size = self.path.stat().st_size
        if size > MAX_MP3_BYTES:
            raise InputError(self.path, f"{size} bytes", expected=f"MP3 of no more than {MAX_MP3_BYTES} bytes")
        splitter = Mp3Splitter()
        frames = splitter.feed(self.path.read_bytes())
        return (counted(frames), len(splitter.feed(b""))) if frames else (b"", 0)

    def _readable(self, file: sf.SoundFile) -> int:
        """Count the frames that can be read: by reading the last where that works, by reading all otherwise."""
        if file.frames <= 0:
            return 0
        try:
            file.seek(file.frames - 1)
            if len(file.read(1, dtype="float32")):
                return file.frames
        except (sf.SoundFileError, RuntimeError):
            pass  # cut off, or damaged on the way: count what there is
        count = 0
        with self.open() as again:
            while read := len(_frames(again, _COUNT_FRAMES)):
                count += read
        return count

    def blocks(self, block_s: float, hop_s: float) -> Iterator[SoundBlock]:
        """Yield blocks of `block_s` seconds whose starts are `hop_s` apart [s]; the last, shorter rest is left out.

        A block that holds samples that are no finite numbers comes as None with its problem.
        """
        size, hop = block_hop(block_s, hop_s, self._sample_rate)
        with self.open() as file:
            held, start = np.empty((0, file.channels), np.float32), 0
            while start + size <= self.frames:
                wanted = size - len(held)
                fresh = _frames(file, wanted)
                if len(fresh) < wanted:
                    return
                held = np.concatenate([held, fresh])
                yield sound_block(self._start_s + start / self._sample_rate, held)
                start += hop
                held = held[hop:]
                if hop > size and start + size <= self.frames:
                    file.seek(start)


def block_hop(block_s: float, hop_s: float, sample_rate: int) -> tuple[int, int]:
    """Give the length of a block and the hop between blocks in samples; raises `ValueError` unless both are >= 1."""
    size, hop = round(block_s * sample_rate), round(hop_s * sample_rate)
    if size < 1 or hop < 1:
        raise ValueError(f"blocks of {block_s} s every {hop_s} s hold no sample at {sample_rate} Hz")
    return size, hop


def sound_block(start_s: float, channels: np.ndarray) -> SoundBlock:
    """Make a block of samples (m, c), or say why it cannot be used."""
    if not np.isfinite(channels).all():
        return SoundBlock(start_s, None, f"sound at {start_s:.2f} s: samples that are no finite numbers")
    channels = np.clip(channels, -1.0, 1.0)
    return SoundBlock(start_s, mixed(channels), channels=channels if channels.shape[1] > 1 else None)


def _frames(file: sf.SoundFile, frames: int) -> np.ndarray:
    """Read up to so many frames (m, c), fewer where the file ends or is damaged."""
    try:
        return file.read(frames, dtype="float32", always_2d=True)
    except (sf.SoundFileError, RuntimeError):
        return np.empty((0, file.channels), np.float32)


def _ogg_cut(path: Path) -> bool:
    """Say whether an Ogg file lacks its last page, which bears the mark of the end (RFC 3533, section 6)."""
    with path.open("rb") as raw:
        raw.seek(max(path.stat().st_size - 2**17, 0))  # a page has 65,307 bytes at most
        tail = raw.read()
    page = tail.rfind(b"OggS")
    return page < 0 or page + 27 > len(tail) or not tail[page + 5] & 4


def _frames_stated(path: Path, file: sf.SoundFile) -> int:
    """Count the frames that a WAV file's header states; libsndfile counts what is there and says nothing.

    A data size of 0 or of all ones is what recorders write that were stopped before they could fill it in: nothing is
    stated then.
    """
    if file.format not in ("WAV", "WAVEX"):
        return 0
    with path.open("rb") as raw:
        head = raw.read(12)
        block = 0
        while len(chunk := raw.read(8)) == 8:
            kind, length = struct.unpack("<4sI" if head[:4] == b"RIFF" else ">4sI", chunk)
            if kind == b"fmt ":
                fmt = raw.read(min(length, 16))
                if len(fmt) < 14:
                    return 0
                block = struct.unpack("<H" if head[:4] == b"RIFF" else ">H", fmt[12:14])[0]
                raw.seek(length - len(fmt) + length % 2, os.SEEK_CUR)
            elif kind == b"data":
                return length // block if block and 0 < length < 0xFFFFFFFF else 0
            else:
                raw.seek(length + length % 2, os.SEEK_CUR)
    return 0
