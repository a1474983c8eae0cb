"""Camera and microphone of a recording, run side by side, each summed up on its map of the ground."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import dataclass, field

import numpy as np
from threadpoolctl import threadpool_limits

from ..audio.listen import SoundEvidence, listen
from ..vision.observe import GroundEvidence, observe_ground
from .core.classifier.classifier import TerrainClassifier
from .core.evidence import ClassEvidence
from .core.pooling import cells_of
from .core.recording.types import Recording
from .core.track.way import Track, cells_under_wheels
from .core.vehicle import Vehicle
from .sense_map import SenseMap, kind_of_reason

CAMERA, MICROPHONE = "camera", "microphone"

Progress = Callable[[str, float], None]
"""Called with the name of a stage and the share of it that is done, in [0, 1]. What it raises ends the work."""

_POLL_S = 0.1
_NOWHERE = "where no place was recorded"

_Batch = tuple[np.ndarray, ClassEvidence, np.ndarray]
"""Cells (m, 2), m looks, and their times (m,) [s]."""


@dataclass
class SenseRecord:
    """What one sense did during a recording.

    Parameters
    ----------
    sense
        Its name.
    map
        What it saw of the ground.
    items
        Looks at a cell (camera) or windows of sound (microphone).
    opened
        How many of them had an open gate.
    quality_sum
        Sum of the open ones' qualities [-].
    said
        How many open items named a class, by class.
    closed, doubted
        How many items were closed, or open with a reservation, by reason.
    absent
        Why the sense was not there at all; empty where it was.
    """

    sense: str
    map: SenseMap
    items: int = 0
    opened: int = 0
    quality_sum: float = 0.0
    said: Counter[str] = field(default_factory=Counter)
    closed: Counter[str] = field(default_factory=Counter)
    doubted: Counter[str] = field(default_factory=Counter)
    absent: str = ""

    def count(self, evidence: ClassEvidence) -> None:
        """Take n items into the counts."""
        is_open = ~evidence.unknown & (evidence.quality > 0)
        self.items += len(evidence)
        self.opened += int(is_open.sum())
        self.quality_sum += float(evidence.quality[is_open].sum())
        best = np.argmax(evidence.probabilities[is_open], axis=1)
        for index, number in enumerate(np.bincount(best, minlength=len(evidence.classes)).tolist()):
            if number:
                self.said[evidence.classes[index]] += number
        for texts, one_open in zip(evidence.reasons, is_open.tolist(), strict=True):
            if texts:
                (self.doubted if one_open else self.closed).update(map(kind_of_reason, texts))


def perceive(
    recording: Recording,
    track: Track | None,
    vehicle: Vehicle | None,
    models: dict[str, TerrainClassifier],
    cell_size_m: float,
    progress: Progress | None = None,
) -> tuple[SenseRecord, SenseRecord]:
    """Run the camera and the microphone of a recording over its ground.

    Parameters
    ----------
    recording
        Its streams are read once, in order, a few frames and blocks at a time.
    track
        Where the vehicle was; without one nothing can be placed on the ground, and both senses stay unused.
    vehicle
        Holds the camera's geometry and the wheels' places.
    models
        Classifiers by sense, ``"vision"`` and ``"audio"``.
    cell_size_m
        Edge of a ground cell [m].
    progress
        Told how far each sense has come.

    Returns
    -------
    tuple of SenseRecord
        Camera, then microphone.
    """
    camera, microphone = SenseRecord(CAMERA, SenseMap(CAMERA)), SenseRecord(MICROPHONE, SenseMap(MICROPHONE))
    jobs: list[tuple[SenseRecord, Iterator[_Batch]]] = []
    lens = vehicle.camera if vehicle is not None else None
    if recording.camera is None or "vision" not in senses_of(recording):
        camera.absent = "no camera in the recording"
    elif lens is None:
        camera.absent = "the vehicle's description has no [camera], so images cannot be laid on the ground"
    elif track is None:
        camera.absent = "no places in the recording"
    else:
        looks = observe_ground(recording.camera, lens, track.place_at, track.speed_at, models["vision"], cell_size_m)
        jobs.append((camera, _looks_ahead(camera, looks, cell_size_m)))
    if recording.sound is None or "audio" not in senses_of(recording):
        microphone.absent = "no sound in the recording"
    elif track is None:
        microphone.absent = "no places in the recording"
    else:
        windows = listen(recording.sound, models["audio"])
        jobs.append((microphone, _heard_below(microphone, windows, track, vehicle, cell_size_m)))
    if jobs and track is not None:
        _run_side_by_side(jobs, track, progress)
    return camera, microphone


def senses_of(recording: Recording) -> tuple[str, ...]:
    """Say which models a recording needs: ``"vision"`` where it has images, ``"audio"`` where it has sound."""
    seen = recording.camera is not None and len(recording.camera) > 0
    heard = recording.sound is not None and recording.sound.duration_s > 0
    return (*(("vision",) if seen else ()), *(("audio",) if heard else ()))


def _run_side_by_side(
    jobs: list[tuple[SenseRecord, Iterator[_Batch]]], track: Track, progress: Progress | None
) -> None:
    """One thread a sense: OpenCV, numpy and FFTs let go of the interpreter's lock, so both cores are used."""
    stop = threading.Event()
    done = {record.sense: 0.0 for record, _ in jobs}
    start, length = float(track.time_s[0]), float(np.ptp(track.time_s))

    def work(record: SenseRecord, batches: Iterator[_Batch]) -> None:
        for cells, evidence, time_s in batches:
            if stop.is_set():
                return
            record.map.add(cells, evidence, time_s)
            until = float(np.max(time_s, initial=start))
            done[record.sense] = float(np.clip((until - start) / max(length, 1e-9), 0.0, 1.0))

    # The two threads fill the cores by themselves: more of BLAS's own beside them only wait for each other.
    with threadpool_limits(1), ThreadPoolExecutor(len(jobs)) as pool:
        futures = [pool.submit(work, *job) for job in jobs]
        try:
            pending = set(futures)
            while pending:
                finished, pending = wait(pending, timeout=_POLL_S, return_when=FIRST_EXCEPTION)
                for future in finished:
                    future.result()
                if progress is not None:
                    for sense, share in done.items():
                        progress(sense, share)
        except BaseException:
            stop.set()
            raise
    if progress is not None:
        for sense in done:
            progress(sense, 1.0)


def _looks_ahead(record: SenseRecord, looks: Iterator[GroundEvidence], cell_size_m: float) -> Iterator[_Batch]:
    for batch in looks:
        record.count(batch.evidence)
        there = np.isfinite(batch.x_m) & np.isfinite(batch.y_m) & np.isfinite(batch.time_s)
        cells = cells_of(batch.x_m[there], batch.y_m[there], cell_size_m)
        yield cells, take(batch.evidence, there), batch.time_s[there]


def _heard_below(
    record: SenseRecord, windows: Iterator[SoundEvidence], track: Track, vehicle: Vehicle | None, cell_size_m: float
) -> Iterator[_Batch]:
    for batch in windows:
        record.count(batch.evidence)
        window, cells = cells_under_wheels(track, vehicle, batch.start_s, batch.end_s, cell_size_m)
        middle = 0.5 * (batch.start_s + batch.end_s)
        nowhere = len(batch.evidence) - len(np.unique(window))
        if nowhere:
            record.doubted[_NOWHERE] += nowhere
        yield cells, take(batch.evidence, window), middle[window]


def take(evidence: ClassEvidence, rows: np.ndarray) -> ClassEvidence:
    """Give the rows of a boolean mask or an index array, as new evidence."""
    index = np.flatnonzero(rows) if rows.dtype == bool else rows
    return ClassEvidence(
        evidence.classes,
        evidence.probabilities[index],
        evidence.quality[index],
        evidence.unknown[index],
        tuple(evidence.reasons[row] for row in index.tolist()),
    )
