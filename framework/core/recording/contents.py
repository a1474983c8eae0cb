"""What is in a recording, and what reading makes of it: for people who want to know before they process it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import InputError
from .types import Recording


@dataclass(frozen=True)
class Source:
    """A topic of a bag, a column of a table or a file of a folder.

    Parameters
    ----------
    name, kind
        Its name, and the type of its messages or what kind of file it is.
    n
        Messages, rows or images; None where nobody counted them.
    start_s, end_s
        Time of the first and the last on the recording's clock [s]; None where it has none.
    feeds
        The streams and channels that are read from it, in words; empty where it is not used.
    remark
        The unit, frame and sign that are assumed, or why it is not used.
    """

    name: str
    kind: str
    n: int | None = None
    start_s: float | None = None
    end_s: float | None = None
    feeds: str = ""
    remark: str = ""

    @property
    def rate_Hz(self) -> float | None:
        """Messages or rows a second."""
        if self.n is None or self.n < 2 or self.start_s is None or self.end_s is None or not self.end_s > self.start_s:
            return None
        return (self.n - 1) / (self.end_s - self.start_s)


@dataclass(frozen=True)
class Contents:
    """What is in a recording.

    Parameters
    ----------
    sources
        What is in it, in order of names or columns.
    recording
        What reading gives; of a large bag of a part of it. None where it cannot be read.
    fault
        Why it cannot be read.
    problems, notes
        What lacks, and what was chosen or assumed, in words; those of the recording included.
    files
        Texts of files to edit, by name: what reading goes by, written down, and the vehicle where nobody described it.
    map_name
        How a file that says what is what is called; empty where there is none for such a recording.
    folder
        Where these files belong.
    """

    sources: tuple[Source, ...]
    recording: Recording | None
    fault: InputError | None = None
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict)
    map_name: str = ""
    folder: Path = Path()


def contents_of(read: Callable[[], Recording]) -> Contents:
    """Give what is in a recording by what is read of it: its streams; or the fault for which it cannot be read."""
    try:
        recording = read()
    except InputError as error:
        return Contents((), None, error)
    return Contents(tuple(streams_of(recording)), recording, None, recording.problems, recording.notes)


def streams_of(recording: Recording) -> Iterator[Source]:
    """Yield the streams of a recording."""
    wheel, pose, camera, sound = recording.wheel, recording.pose, recording.camera, recording.sound
    if wheel is not None:
        time_s = wheel.observed("time_s")
        yield Source("wheel", "wheel channels", len(wheel), *ends_of(time_s), feeds=", ".join(wheel.columns))
    if pose is not None:
        yield Source("pose", "poses", len(pose.time_s), *ends_of(pose.time_s), feeds="pose", remark="m, rad")
    if camera is not None:
        time_s = getattr(camera, "time_s", np.empty(0))
        yield Source("camera", "images", len(camera), *ends_of(time_s), feeds="camera")
    if sound is not None:
        start_s, end_s = sound.start_s, sound.start_s + sound.duration_s
        yield Source("sound", "sound", None, start_s, end_s, "sound", f"{sound.sample_rate} Hz")
    if (run := recording.vibration) is not None:
        channels = ", ".join((*run.names, *run.wheel_names))
        yield Source("vibration", "vibration", len(run.time_s), *ends_of(run.time_s), f"vibration: {channels}")
    if (labels := recording.labels) is not None:
        ends = ends_of(np.concatenate([labels.start_s, labels.end_s]))
        yield Source("labels", "stretches of classes", len(labels.classes), *ends, feeds="labels")


def ends_of(time_s: np.ndarray) -> tuple[float | None, float | None]:
    """Give the first and the last of times (n,) [s]; None where there are none."""
    return (float(np.min(time_s)), float(np.max(time_s))) if len(time_s) else (None, None)
