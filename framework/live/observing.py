"""The senses at work during a drive, each in a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence

import numpy as np

from ..core.errors import InputError
from ..core.evidence import ClassEvidence
from ..core.recording.types import Recording
from ..core.track.way import Track
from ..sense_map import SenseMap, SenseRecord
from ..senses import Observation


class Observing:
    """One sense, and what it has observed by now.

    Parameters
    ----------
    record
        What is known of the ground by now: what was observed under the wheels lies where they were believed to be when
        it was observed.
    observations
        What the sense observes as the drive goes on; ends with the drive.

    Attributes
    ----------
    last
        The last observation; None before the first.
    fault
        Why the sense observes no more; empty where it does.
    """

    def __init__(self, record: SenseRecord, observations: Iterator[Observation]):
        self.record, self._observations = record, observations
        self.last: Observation | None = None
        self.fault = ""
        self._windows: list[Observation] = []
        self._touched: list[np.ndarray] = []
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._work, name=f"bevameter {record.sense}", daemon=True)

    def begin(self) -> None:
        """Begin to observe."""
        self._thread.start()

    def end(self) -> None:
        """Wait until all that came was observed."""
        self._thread.join()

    def _work(self) -> None:
        try:
            for observation in self._observations:
                with self._lock:
                    self._add(observation)
        except InputError as error:
            self.fault = str(error)
        except Exception as error:  # one sense that fails takes nothing from the others
            self.fault = f"{type(error).__name__}: {error}"

    def _add(self, observation: Observation) -> None:
        self.record.add(observation)
        self.last = observation
        self._touched.append(observation.cells)
        if observation.window_s is not None:
            self._windows.append(observation)

    def take_touched(self) -> np.ndarray:
        """Give the cells (m, 2) that were observed since the last time that this was called."""
        with self._lock:
            touched, self._touched = self._touched, []
        return np.unique(np.concatenate(touched), axis=0) if touched else np.empty((0, 2), dtype=np.int64)

    def concluded(self, recording: Recording, track: Track, cell_size_m: float) -> SenseRecord:
        """Give the record of the whole drive: what was observed under the wheels lies where they are known to have
        been in the end.
        """
        record = self.record
        if self._windows:
            record = SenseRecord(record.sense, record.name, SenseMap(record.sense))
            start_s, end_s = np.concatenate([each.window_s for each in self._windows if each.window_s is not None]).T
            evidence = ClassEvidence.concatenate([each.evidence for each in self._windows])
            record.add(Observation.under_wheels(evidence, start_s, end_s, recording, track, cell_size_m))
        return record


def faults(senses: Sequence[Observing]) -> tuple[str, ...]:
    """Say which senses failed during the drive, and why."""
    return tuple(f"{each.record.sense}: it observed no more: {each.fault}" for each in senses if each.fault)
