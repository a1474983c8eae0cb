"""The senses observe a recording, all of them at once."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait

import numpy as np
from threadpoolctl import threadpool_limits

from .core.classifier.classifier import TerrainClassifier
from .core.recording.types import Recording
from .core.track.way import Places, Track
from .sense_map import Progress, SenseMap, SenseRecord
from .senses import Observation, Sense, senses

_POLL_S = 0.1


def observe(
    recording: Recording,
    track: Track | None,
    models: Mapping[str, TerrainClassifier],
    cell_size_m: float,
    progress: Progress | None = None,
) -> tuple[SenseRecord, ...]:
    """Observe the ground of a recording with every sense that there is, concurrently.

    Parameters
    ----------
    recording
        Its streams are read once, in order, a few frames and blocks at a time.
    track
        Where the vehicle was; without one nothing can be placed on the ground, and all senses stay unused.
    models
        Classifiers by name of their sense.
    cell_size_m
        Edge of a ground cell [m].
    progress
        Called with each sense and the share of it that is done.

    Returns
    -------
    tuple of SenseRecord
        One a sense, with the reason where it is absent.
    """
    jobs = begin_observing(recording, track, models, cell_size_m)
    if track is not None:
        _run_concurrently([(record, given) for record, given in jobs if given is not None], track, progress)
    return tuple(record for record, _ in jobs)


def begin_observing(
    recording: Recording, track: Track | None, models: Mapping[str, TerrainClassifier], cell_size_m: float
) -> list[tuple[SenseRecord, Iterator[Observation] | None]]:
    """Give what each sense will observe, for its record; None where it is absent, with the reason in the record.

    Parameters
    ----------
    recording, track, models, cell_size_m
        As in `observe`.
    """
    return [begin_sense(sense, recording, track, models, cell_size_m) for sense in senses()]


def begin_sense(
    sense: Sense,
    recording: Recording,
    track: Places | None,
    models: Mapping[str, TerrainClassifier],
    cell_size_m: float,
) -> tuple[SenseRecord, Iterator[Observation] | None]:
    """Give what one sense will observe, as `begin_observing` does for each; the streams of a recording that is being
    made end with the drive.
    """
    absent = sense.absence(recording) or ("no places in the recording" if track is None else "")
    if not absent and sense.name not in models:
        absent = "no model"
    record = SenseRecord(sense.instrument, sense.name, SenseMap(sense.instrument), absent=absent)
    if absent or track is None:
        return record, None
    return record, sense.observe(recording, track, models[sense.name], cell_size_m)


def _run_concurrently(
    jobs: Sequence[tuple[SenseRecord, Iterator[Observation]]], track: Track, progress: Progress | None
) -> None:
    """One thread a sense: OpenCV, numpy and FFTs let go of the interpreter's lock, so two cores are used."""
    if not jobs:
        return
    stop = threading.Event()
    done = {record.sense: 0.0 for record, _ in jobs}
    start, length = float(track.time_s[0]), float(np.ptp(track.time_s))

    def work(record: SenseRecord, observations: Iterator[Observation]) -> None:
        for observation in observations:
            if stop.is_set():
                return
            record.add(observation)
            until = float(np.max(observation.time_s, initial=start))
            done[record.sense] = float(np.clip((until - start) / max(length, 1e-9), 0.0, 1.0))

    # The threads fill the cores by themselves: more of BLAS's own would only wait for each other.
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
