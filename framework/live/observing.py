"""The senses at work during a drive, each in a thread of its own."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..core.cell_sums import CellSums
from ..core.errors import InputError
from ..core.evidence import ClassEvidence
from ..core.recording.types import Recording
from ..core.track.way import Track
from ..sense_map import SenseMap, SenseRecord
from ..senses import Observation
from .log import Part

_POLL_S = 0.05

_MOST_UNSAVED = 100
"""Observations that wait for one that is open, at most."""

_MOST_PARTS = 1000
"""Lists of cells that are kept before each cell is kept once."""

_SUMS = ("keys", "sums", "logs", "reasons", "last_s")
_COUNTS = ("items", "opened", "quality_sum", "said", "closed", "doubted")


class Observing:
    """One sense, and what it has observed by now.

    Parameters
    ----------
    record
        What is known of the ground by now: what was observed under the wheels lies where they were believed to be when
        it was observed.
    observations
        What the sense observes as the drive goes on; ends with the drive.
    failed
        Called where it raises.
    is_provisional
        Whether the whole drive is observed again when it is closed.

    Attributes
    ----------
    last
        The last observation; None before the first.
    fault
        Why the sense observes no more; empty where it does.
    """

    def __init__(
        self, record: SenseRecord, observations: Iterator[Observation], failed: Callable[[], None], *,
        is_provisional: bool = False,
    ):  # fmt: skip
        self.record, self._observations, self._failed = record, observations, failed
        self.is_provisional = is_provisional
        self.last: Observation | None = None
        self.fault = ""
        self._touched: list[np.ndarray] = []
        self._unsaved: list[Observation] = []
        self._saved = _empty(record)
        self._has_left = False
        self._from_s: float | None = None
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._work, name=f"bevameter {record.sense}", daemon=True)

    def begin(self) -> None:
        """Begin to observe."""
        self._thread.start()

    def wait_for(self, loaded: threading.Event, most_s: float) -> None:
        """Wait until the sense has loaded what it needs, or has ended, but no longer than a time [s]."""
        until_s = time.monotonic() + most_s
        while not loaded.wait(_POLL_S) and self._thread.is_alive() and time.monotonic() < until_s:
            pass

    def end(self) -> None:
        """Wait until all that came was observed."""
        self._thread.join()

    def leave(self) -> None:
        """Take in no further observation: the drive is to be resumed."""
        with self._lock:
            self._has_left = True

    def _work(self) -> None:
        try:
            for observation in self._observations:
                with self._lock:
                    if not self._has_left:
                        self._add(observation)
        except Exception as error:  # one sense that fails takes nothing from the others
            self.fault = described(error)
            self._failed()

    def _add(self, observation: Observation) -> None:
        self.record.add(observation)
        self.last = observation
        self._touched.append(observation.cells)
        if len(self._touched) > _MOST_PARTS:  # nobody takes snapshots
            self._touched = [np.unique(np.concatenate(self._touched), axis=0)]
        self._unsaved.append(observation)

    def take_touched(self) -> np.ndarray:
        """Give the cells (m, 2) that were observed since the last time that this was called."""
        with self._lock:
            touched, self._touched = self._touched, []
        return np.unique(np.concatenate(touched), axis=0) if touched else np.empty((0, 2), dtype=np.int64)

    def take_unsaved(self) -> tuple[list[Part], dict[str, Any]]:
        """Give what was observed since the last time that this was called, to be written away, and the state.

        The newest observation that is open is left to be observed again where the drive is resumed, with what followed:
        which image is looked at next, and which window of sound is heard, depends on it. ``from_s`` says from when on.
        """
        name = self.record.name
        with self._lock:
            is_open = [bool(np.any(~each.evidence.unknown)) for each in self._unsaved]
            last = max((at for at, one in enumerate(is_open) if one), default=0)
            if len(self._unsaved) - last > _MOST_UNSAVED:
                last = len(self._unsaved) - 1
            done, self._unsaved = self._unsaved[:last], self._unsaved[last:]
            next_one = self._unsaved[0] if self._unsaved else None
        parts: list[Part] = []
        for each in done:
            self._saved.add(each)
            if each.window_s is not None:
                parts.append((f"heard {name}", _columns_of(each)))
        if any(each.window_s is None for each in done):
            own = self._saved.map
            names = {"classes": own.classes, "reason_names": own.reason_names}
            texts = {name: np.array(each, dtype=str) for name, each in names.items()}
            parts.append((f"seen {name}", {**vars(own.settle()), **texts}))
        self._saved = replace(self._saved, map=SenseMap(self.record.sense))
        state: dict[str, Any] = {each: getattr(self._saved, each) for each in _COUNTS}
        if next_one is not None:
            self._from_s = float(np.min(next_one.time_s if next_one.window_s is None else next_one.window_s[:, 0]))
        if self._from_s is not None:
            state["from_s"] = self._from_s
        return parts, state

    def restore(
        self,
        seen: Iterable[dict[str, np.ndarray]],
        heard: Iterable[dict[str, np.ndarray]],
        state: dict[str, Any],
        place: tuple[Recording, Track, float] | None,
    ) -> None:
        """Take in what another one has written away, before this one begins.

        Parameters
        ----------
        seen, heard
            Parts of its streams, as `take_unsaved` named them.
        state
            Its state.
        place
            The recording, its track and the edge of a cell [m], to lay on the ground what was heard; None where nobody
            knows the places.
        """
        for each in seen:
            sums = CellSums(**{name: each[name] for name in _SUMS})
            names = (tuple(map(str, each[name].tolist())) for name in ("classes", "reason_names"))
            self.record.map.restore(sums, *names)
        windows = [_observation_of(each) for each in heard]
        if windows and place is not None:
            self.record.map.add(*_looks(_under_wheels(windows, *place)))
        self._from_s = state.get("from_s")
        for record in (self.record, self._saved):
            for name in _COUNTS:
                value = state.get(name, 0)
                setattr(record, name, Counter(value) if isinstance(value, dict) else value)

    def concluded(
        self, recording: Recording, track: Track, cell_size_m: float, heard: Iterable[dict[str, np.ndarray]]
    ) -> SenseRecord:
        """Give the record of the whole drive: what was observed under the wheels lies where they are known to have
        been in the end; `heard` is what was written away of it.
        """
        windows = [_observation_of(each) for each in heard]
        windows += [each for each in self._unsaved if each.window_s is not None]
        if not windows:
            return self.record
        record = _empty(self.record)
        record.add(_under_wheels(windows, recording, track, cell_size_m))
        return record


def described(error: Exception) -> str:
    """Say what was raised; its kind, too, where it is none that a user can put right."""
    return str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"


def faults(senses: Sequence[Observing]) -> tuple[str, ...]:
    """Say which senses failed during the drive, and why."""
    return tuple(f"{each.record.sense}: it observed no more: {each.fault}" for each in senses if each.fault)


def _empty(record: SenseRecord) -> SenseRecord:
    return SenseRecord(record.sense, record.name, SenseMap(record.sense))


def _under_wheels(
    windows: Sequence[Observation], recording: Recording, track: Track, cell_size_m: float
) -> Observation:
    start_s, end_s = np.concatenate([each.window_s for each in windows if each.window_s is not None]).T
    evidence = ClassEvidence.concatenate([each.evidence for each in windows])
    return Observation.under_wheels(evidence, start_s, end_s, recording, track, cell_size_m)


def _looks(observation: Observation) -> tuple[np.ndarray, ClassEvidence, np.ndarray]:
    item = observation.item
    return observation.cells, observation.evidence.select(item), observation.time_s[item]


def _columns_of(observation: Observation) -> dict[str, np.ndarray]:
    evidence, window_s = observation.evidence, observation.window_s
    assert window_s is not None
    return {
        "window_s": window_s, "classes": np.array(evidence.classes, dtype=str), "quality": evidence.quality,
        "probabilities": evidence.probabilities, "unknown": evidence.unknown,
        "reasons": np.array([json.dumps(texts) for texts in evidence.reasons], dtype=str),
    }  # fmt: skip


def _observation_of(columns: dict[str, np.ndarray]) -> Observation:
    evidence = ClassEvidence(
        tuple(map(str, columns["classes"].tolist())), columns["probabilities"], columns["quality"], columns["unknown"],
        tuple(tuple(json.loads(texts)) for texts in columns["reasons"].tolist()),
    )  # fmt: skip
    none = np.empty(0, dtype=np.int64)
    window_s = columns["window_s"]
    return Observation(evidence, window_s.mean(axis=1), none, np.empty((0, 2), dtype=np.int64), window_s)
