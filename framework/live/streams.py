"""Streams of a recording that is being made: they wait for what comes, and end with the drive."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..core.recording.sound import block_hop, sound_block
from ..core.recording.sound_messages import MAX_JITTER_S
from ..core.recording.types import Frame, SoundBlock, Wanted, always
from .track import LiveTrack

MOST_IMAGES = 4
"""Images whose place is known that wait to be looked at: more of them make what is seen late."""

MOST_SOUND_S = 30.0
"""Sound that waits to be heard, at most [s]."""

MOST_WAITING = 64
"""Images that wait for a pose, at most."""

SOURCE = Path("live drive")
"""Stands for the file of a recording that has none."""

_POLL_S = 0.5


class Waiting:
    """What waits for its place to be known, or for its sense, in order of time; `changed` guards all of a drive.

    Attributes
    ----------
    is_used
        Whether a sense takes what comes; else it is only counted.
    is_waited_for
        Set once the sense has loaded what it needs, or has failed; streams of one sense may share it.
    from_s
        Of a drive that is resumed: what is earlier was observed before [s].
    count, dropped
        How much came, and how much of it was dropped: nothing of a `lossless` stream, whose callers wait.
    """

    def __init__(
        self, changed: threading.Condition, track: LiveTrack, *, lossless: bool = False,
        is_waited_for: threading.Event | None = None,
    ):  # fmt: skip
        self._changed, self._track, self._lossless = changed, track, lossless
        self._items: deque[tuple[float, Any]] = deque()
        self.is_used = False
        self.is_waited_for = threading.Event() if is_waited_for is None else is_waited_for
        self.from_s = -math.inf
        self.has_ended = False
        self.count = 0
        self.dropped = 0

    def ready(self) -> int:
        """Count what waits for nothing but its sense."""
        answer = 0
        for until_s, _ in self._items:
            if not self._track.covers(until_s):
                break
            answer += 1
        return answer

    def add(self, until_s: float, item: Any) -> None:
        """Take in what was observed up to `until_s` [s]; `changed` is held."""
        self._items.append((until_s, item))

    def drop_first(self) -> None:
        """Let go of the oldest; `changed` is held."""
        self._items.popleft()
        self.dropped += 1

    def end(self) -> None:
        """Say that nothing more will come; `changed` is held."""
        self.has_ended = True

    def leave(self) -> None:
        """Forget what waits, and end; `changed` is held."""
        self._items.clear()
        self.end()

    def unused(self) -> None:
        """Forget what waits, and only count from now on: its sense has failed."""
        with self._changed:
            self.is_used = False
            self.is_waited_for.set()
            self._items.clear()
            self._changed.notify_all()

    def take(self) -> Any:
        """Wait for the next one and give it; None at the end."""
        self.is_waited_for.set()
        with self._changed:
            while not (self._items and self._track.covers(self._items[0][0])):
                if self.has_ended and not self._items:
                    return None
                if not threading.main_thread().is_alive():  # the program has ended without closing the drive
                    return None
                self._changed.wait(_POLL_S)
            _, item = self._items.popleft()
            self._changed.notify_all()
            return item


class LiveCamera(Waiting):
    """A `CameraStream` of a drive that goes on."""

    def __len__(self) -> int:
        return self.count if self.has_ended else max(self.count, 1)

    def put(self, frame: Frame) -> None:
        """Take in an image; where too many wait, the oldest is dropped."""
        self.count += 1
        if not self.is_used or frame.time_s < self.from_s:
            return
        self.add(frame.time_s, frame)
        while not self._lossless and (len(self._items) > MOST_WAITING or self.ready() > MOST_IMAGES):
            self.drop_first()

    def is_full(self) -> bool:
        """Say whether as many images wait for their sense as may."""
        return self.ready() >= MOST_IMAGES

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield images as they come, those that are wanted where the vehicle is known to have been then."""
        self.is_used = True
        while isinstance(frame := self.take(), Frame):
            if wanted(frame.time_s):
                yield frame


class LiveSound(Waiting):
    """A `SoundStream` of a drive that goes on.

    Samples go on from those before at the stated rate; where they come more than `MAX_JITTER_S` apart from that, or at
    another rate, a new run begins, and what does not fill a block is left out, as at the end of a file.
    """

    def __init__(
        self, changed: threading.Condition, track: LiveTrack, *, lossless: bool = False,
        is_waited_for: threading.Event | None = None,
    ):  # fmt: skip
        super().__init__(changed, track, lossless=lossless, is_waited_for=is_waited_for)
        self.rate: int | None = None
        self._base_s, self._given, self._held = 0.0, 0, np.empty((0, 1), np.float32)
        self.samples = 0
        self._block: tuple[int, int] | None = None
        self._arrived: list[tuple[float, np.ndarray]] = []

    @property
    def sample_rate(self) -> int:
        """Samples a second [Hz], once the first came."""
        self.is_used = True
        self.is_waited_for.set()
        with self._changed:
            while self.rate is None and not self.has_ended and threading.main_thread().is_alive():
                self._changed.wait(_POLL_S)
        return self.rate or 1

    @property
    def start_s(self) -> float:
        """Time of the first sample [s]."""
        return self._base_s

    @property
    def duration_s(self) -> float:
        """Length of what has come [s]; infinite as long as nothing is known of it."""
        if not self.samples:
            return 0.0 if self.has_ended else np.inf
        return self.samples / (self.rate or 1)

    def put(self, time_s: float, samples: np.ndarray, rate: int) -> None:
        """Take in samples (m, c), the first at `time_s` [s]."""
        if self.rate is None:
            self.rate = rate
        known = max(round((self.from_s - time_s) * rate), 0) if np.isfinite(self.from_s) else 0
        time_s, samples = time_s + known / rate, samples[known:]
        if not len(samples):
            return
        self.samples += len(samples)
        self.count += 1
        if self._block is None and self.is_used:
            self._arrived.append((time_s, samples))
        elif self.is_used:
            self._cut(time_s, samples)

    def resume(self, from_s: float, samples: int, rate: int | None) -> None:
        """Go on with a drive that was heard up to `from_s` [s], and of which so many samples came at a rate."""
        self.from_s, self.samples, self.rate = from_s, samples, rate

    def _cut(self, time_s: float, samples: np.ndarray) -> None:
        assert self.rate is not None
        assert self._block is not None
        size, hop = self._block
        expected_s = self._base_s + (self._given + len(self._held)) / self.rate
        broken = abs(time_s - expected_s) > MAX_JITTER_S or samples.shape[1] != self._held.shape[1]
        if broken or not (self._given or len(self._held)):
            self._base_s, self._given, self._held = time_s, 0, samples
        else:
            self._held = np.concatenate([self._held, samples])
        while len(self._held) >= size:
            start_s = self._base_s + self._given / self.rate
            block = sound_block(start_s, self._held[:size])
            until_s = start_s + size / self.rate
            self.add(until_s, SoundBlock(start_s, block.samples, block.problem, block.channels, urgent=True))
            self._given, self._held = self._given + hop, self._held[hop:]
        while not self._lossless and len(self._items) * hop > MOST_SOUND_S * self.rate:
            self.drop_first()

    def is_full(self) -> bool:
        """Say whether as much sound waits for its sense as may."""
        return self._block is not None and self.ready() * self._block[1] > 0.5 * MOST_SOUND_S * (self.rate or 1)

    def blocks(self, block_s: float, hop_s: float) -> Iterator[SoundBlock]:
        """Yield blocks of `block_s` seconds whose starts are `hop_s` apart, as they come; for one reader."""
        self.is_used = True
        block = block_hop(block_s, hop_s, self.sample_rate)
        with self._changed:
            self._block = block
            for time_s, samples in self._arrived:
                self._cut(time_s, samples)
            self._arrived = []
        while isinstance(heard := self.take(), SoundBlock):
            yield heard
