"""MP3 as a stream of bytes that may be cut anywhere: split into frames by their headers, decoded by libsndfile.

A frame's header says how long it is and how much sound it holds (ISO/IEC 11172-3, 2.4.2.3; half sample rates: ISO/IEC
13818-3; quarter ones are an extension in common use). So it is known, before anything is decoded, how much sound there
is and in which message, and the decoder is given whole frames only.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import soundfile as sf

WARM_UP = 32
"""Frames before a stretch that are decoded with it: a frame may build on data of as many before it [-]."""

_BITRATES = {
    1: (32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320),
    2: (8, 16, 24, 32, 40, 48, 56, 64, 80, 96, 112, 128, 144, 160),
}
"""kbit/s by the header's index, from 1 on, of MPEG-1 and of MPEG-2 and -2.5."""

_RATES = (44_100, 48_000, 32_000)
_DIVISORS = {3: 1, 2: 2, 0: 4}  # of the sample rate, by the header's version
_HEADER = 4
_DECODER_DELAY = 529  # samples that a decoder leaves out at its beginning, where the number of frames is stated


@dataclass(frozen=True)
class Mp3Header:
    """What a frame's header says: its length in bytes, its samples (of each channel), sample rate [Hz] and channels."""

    size: int
    samples: int
    sample_rate: int
    channels: int

    @property
    def kind(self) -> tuple[int, int, int]:
        """What is the same in all frames of a stream."""
        return self.samples, self.sample_rate, self.channels


def header_at(data: bytes | bytearray, place: int) -> Mp3Header | None:
    """Read the header of a frame of layer III, None where there is none."""
    if place + _HEADER > len(data) or data[place] != 0xFF or data[place + 1] & 0xE6 != 0xE2:
        return None
    version, bitrate, rate = data[place + 1] >> 3 & 3, data[place + 2] >> 4, data[place + 2] >> 2 & 3
    if version not in _DIVISORS or bitrate in (0, 15) or rate == 3:
        return None
    full = version == 3
    samples, sample_rate = 1152 if full else 576, _RATES[rate] // _DIVISORS[version]
    kbits = _BITRATES[1 if full else 2][bitrate - 1]
    size = samples // 8 * kbits * 1000 // sample_rate + (data[place + 2] >> 1 & 1)
    return Mp3Header(size, samples, sample_rate, 1 if data[place + 3] >> 6 == 3 else 2)


class Mp3Splitter:
    """Splits a stream into whole frames.

    A first header counts where another one stands at the end of its frame, so that it is none by chance; so does the
    first one after damage, and that of a frame which goes from one piece of data to the next, as what lay between may
    be missing. The frame that encoders write first, which holds no sound but says how much there is of it, is left out.
    """

    def __init__(self) -> None:
        self._held = bytearray()
        self._follows = False
        self.header: Mp3Header | None = None
        self.broken = False
        """Is something missing before the frames given last?"""

    def lose(self) -> None:
        """Take it that data are missing before the next ones."""
        self._held.clear()
        self._follows = False

    def feed(self, data: bytes) -> list[bytes]:
        """Give the frames that are whole with these data, as far as nothing is missing between them."""
        old = len(self._held)
        self._held += data
        self.broken = not self._follows
        frames: list[bytes] = []
        place = 0
        while place + _HEADER <= len(self._held):
            header = header_at(self._held, place)
            if header is None or (self.header is not None and header.kind != self.header.kind):
                if frames:
                    break  # what comes after the damage is for the next call
                place = self._skip(place)
                continue
            end = place + header.size
            sure = self._follows and place >= old
            if len(self._held) < end + (0 if sure else _HEADER):
                break
            following = header if sure else header_at(self._held, end)
            if following is None or following.kind != header.kind:
                if frames:
                    break
                place = self._skip(place)
                continue
            self.header, self._follows = header, True
            frame = bytes(self._held[place:end])
            if not any(mark in frame[:64] for mark in (b"Xing", b"Info", b"VBRI")):
                frames.append(frame)
            place = end
        del self._held[:place]
        return frames

    def _skip(self, place: int) -> int:
        """Go on to what may be the next header."""
        self._follows, self.broken = False, True
        found = self._held.find(b"\xff", place + 1)
        return len(self._held) if found < 0 else found


def decode_frames(frames: Sequence[bytes], before: Sequence[bytes], header: Mp3Header) -> np.ndarray:
    """Decode frames that follow each other.

    Parameters
    ----------
    frames
        The frames.
    before
        Frames right before them, which they may build on; up to `WARM_UP` are of use.
    header
        The stream's.

    Returns
    -------
    np.ndarray
        (m, c) float32, m by the frames' headers; silence where libsndfile gives fewer.
    """
    early = [_silenced(frames[0]), *before[-WARM_UP:]]
    wanted = len(frames) * header.samples
    stream = [early[0], *_founded([*early[1:], *frames])]
    samples = np.zeros((wanted, header.channels), np.float32)
    try:
        with sf.SoundFile(io.BytesIO(counted(stream))) as file:
            if (file.samplerate, file.channels) == (header.sample_rate, header.channels):
                file.read(len(early) * header.samples - _DECODER_DELAY, dtype="float32")
                found = file.read(wanted, dtype="float32", always_2d=True)
                samples[: len(found)] = found
    except (sf.SoundFileError, RuntimeError):
        pass
    return samples


def _side_information(frame: bytes) -> tuple[int, int, int]:
    """Give where a frame's side information begins and ends, and how far back its sound's data reach [bytes]."""
    header = header_at(frame, 0)
    assert header is not None
    mono, full = header.channels == 1, header.samples == 1152
    begin = _HEADER + (0 if frame[1] & 1 else 2)  # a check sum
    end = begin + ((17 if mono else 32) if full else (9 if mono else 17))
    return begin, end, (frame[begin] << 1 | frame[begin + 1] >> 7) if full else frame[begin]


def _silenced(frame: bytes, held: int = 0) -> bytes:
    """Make a frame say that it holds no sound; the data that it carries for others, and those `held` before, stay."""
    begin, end, back = _side_information(frame)
    side = bytearray(end - begin)
    back = min(back, held)
    if frame[1] & 8:  # MPEG-1: nine bits
        side[0], side[1] = back >> 1, (back & 1) << 7
    else:
        side[0] = back
    return frame[:begin] + bytes(side) + frame[end:]


def _founded(frames: Sequence[bytes]) -> list[bytes]:
    """Silence the frames that reach back before the first one: decoders make noise of them, and say so."""
    held, answer = 0, []
    for frame in frames:
        _, end, back = _side_information(frame)
        answer.append(frame if back <= held else _silenced(frame, held))
        held += len(frame) - end
    return answer


def counted(frames: Sequence[bytes]) -> bytes:
    """Put before frames one that says how many they are: else libsndfile goes by the first one's bit rate.

    It is silent, and has ``Info`` behind its side information, then flags and the number, as the encoder LAME writes
    it.
    """
    start = bytearray(frames[0][:_HEADER])
    start[1] |= 1  # no check sum
    start[2] = start[2] & 0x0D | 0xE0  # the greatest bit rate, no padding
    header = header_at(start, 0)
    assert header is not None
    _, end, _ = _side_information(bytes(start) + bytes(_HEADER))
    text = b"Info" + struct.pack(">II", 1, len(frames))
    return b"".join([(bytes(start) + bytes(end - _HEADER) + text).ljust(header.size, b"\0"), *frames])


def mp3_share(chunks: Sequence[bytes]) -> float:
    """Say which share of some chunks' bytes are frames of MP3 [-]: hardly any of other data are, by chance."""
    splitter = Mp3Splitter()
    whole = sum(len(frame) for chunk in chunks for frame in splitter.feed(chunk))
    return whole / max(sum(map(len, chunks)), 1)
