"""Camera and sound of a bag, read message by message so that memory does not grow with the recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import minimum_filter1d

from ..errors import InputError
from .bag_files import BagFile
from .bag_images import image_of
from .bag_messages import DecodeError, decode, stamp_ns
from .sound import block_hop, sound_block
from .sound_messages import MAX_JITTER_S, SoundReader
from .types import Frame, SoundBlock, Wanted, always

CATCH_UP_S = 10.0
"""Messages that come late but catch up with their samples in this time do not leave a gap [s]."""


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
    bit_depth
        Bits that 16-bit samples make use of; all where None.
    """

    def __init__(self, bag: BagFile, topic: str, time_ns: np.ndarray, origin_ns: int, bit_depth: int | None = None):
        self._bag, self._topic, self._time_ns, self._origin_ns = bag, topic, time_ns, origin_ns
        self._bit_depth = bit_depth

    def __len__(self) -> int:
        return len(self._time_ns)

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield every image that is wanted; one that cannot be decoded comes as None with its problem."""
        messages = self._bag.messages({self._topic})
        for number, (time, message) in enumerate(zip((self._time_ns - self._origin_ns) * 1e-9, messages, strict=False)):
            if not wanted(float(time)):
                continue
            try:
                source = f"{self._bag.path}, {self._topic}, image {number}"
                yield Frame(float(time), image_of(decode(message), source, self._bit_depth))
            except (DecodeError, InputError) as error:
                yield Frame(float(time), None, f"{self._topic}, image {number}: {error}")


@dataclass(frozen=True)
class SoundLayout:
    """When the messages of a sound topic were, and how much sound is in each.

    Parameters
    ----------
    start_s : (n,)
        Start of each message on the recording's clock [s].
    frames : (n,)
        Samples of each channel in each message, not all 0; 0 where it could not be decoded.
    sample_rate
        [Hz].
    """

    start_s: np.ndarray
    frames: np.ndarray
    sample_rate: int

    def placed(self) -> tuple[float, np.ndarray]:
        """Place the messages on one count of samples by their times.

        Messages follow each other without a gap as long as their times agree with that within `MAX_JITTER_S`: the
        samples' own clock is steadier than their arrival. What is late is not missing if messages catch up with it
        within `CATCH_UP_S`. Beyond that, times go: where samples are too few for them there is a gap, and where they
        are too many, as of a microphone whose clock runs fast, messages overlap.

        Returns
        -------
        start_s, places
            Time of the first sample on the recording's clock [s], and the place of each message's first one, (n,).
        """
        full = np.flatnonzero(self.frames)
        start_s, frames = self.start_s[full], self.frames[full]
        before = np.concatenate([[0], np.cumsum(frames)[:-1]])
        late = np.round((start_s - start_s[0]) * self.sample_rate).astype(np.int64) - before
        step_s = max(float(np.median(np.diff(start_s))) if len(late) > 1 else 0.0, 1e-3)
        ahead = min(max(int(CATCH_UP_S / step_s), 1), len(late))
        least = minimum_filter1d(late[::-1], ahead, mode="nearest", origin=(ahead - 1) // 2)[::-1]
        held, shifts = int(least[0]), np.zeros(len(late), dtype=np.int64)
        for number, lag in enumerate(least.tolist()):
            if abs(lag - held) > MAX_JITTER_S * self.sample_rate:
                held = lag
            shifts[number] = held - least[0]
        places = np.zeros(len(self.frames), dtype=np.int64)
        places[full] = np.maximum(before + shifts, 0)
        return float(start_s[0] + least[0] / self.sample_rate), places

    @property
    def surplus_s(self) -> float:
        """By how much the samples last longer than the messages' times [s]."""
        full = np.flatnonzero(self.frames)
        recorded_s = self.start_s[full[-1]] - self.start_s[full[0]]
        return float(self.frames[full[:-1]].sum() / self.sample_rate - recorded_s)


class BagSound:
    """Sound of a topic, in blocks (a `SoundStream`); where messages are missing, blocks come as None.

    Parameters
    ----------
    bag
        The bag.
    reader
        What counted the topic's samples.
    layout
        When they were.
    """

    def __init__(self, bag: BagFile, reader: SoundReader, layout: SoundLayout):
        self._bag, self._reader, self._layout = bag, reader, layout
        self._topic = reader.source.topic
        self._start_s, self._places = layout.placed()
        full = layout.frames > 0
        places = self._places[full]
        ends = np.maximum.accumulate(places + layout.frames[full])
        self._total = int(ends[-1])
        self._missing = int(np.maximum(places[1:] - ends[:-1], 0).sum())

    @property
    def sample_rate(self) -> int:
        """Samples a second [Hz]."""
        return self._layout.sample_rate

    @property
    def start_s(self) -> float:
        """Time of the first sample on the recording's clock [s]."""
        return self._start_s

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample [s]."""
        return self._total / self.sample_rate

    @property
    def gap_s(self) -> float:
        """Time within it that has no sample [s]."""
        return self._missing / self.sample_rate

    def blocks(self, block_s: float, hop_s: float) -> Iterator[SoundBlock]:
        """Yield blocks of `block_s` seconds whose starts are `hop_s` apart [s]; the last, shorter rest is left out."""
        size, hop = block_hop(block_s, hop_s, self.sample_rate)
        start, base = 0, 0
        channels = self._reader.channels
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
                    yield SoundBlock(time, None, f"{self._topic} at {time:.2f} s: no sound was recorded")
                start += hop
            drop = min(start - base, len(held))
            held, there, base = held[drop:], there[drop:], base + drop

    def _pieces(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield pieces in order of their place, (m, c); a long gap is filled in steps, so that it needs no memory."""
        step, end = self.sample_rate, 0
        for place, samples in self._reader.pieces(self._contents(), self._places):
            while place - end > step:
                end += step
                yield end, np.empty((0, self._reader.channels), np.float32)
            fresh = samples[max(end - place, 0) :]
            if len(fresh):
                end = place + len(samples)
                yield end - len(fresh), fresh

    def _contents(self) -> Iterator[tuple[int, Any]]:
        """Yield each message's time [ns] and content, None where it cannot be decoded."""
        for _, message in zip(self._places, self._bag.messages({self._topic}), strict=False):
            try:
                content = decode(message)
            except DecodeError:
                yield message.time_ns, None
            else:
                yield stamp_ns(message, content), content
