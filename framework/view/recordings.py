"""The recordings that a database's drives came from, found again by their digest."""

from __future__ import annotations

import io
import os
import threading
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import soundfile

from ...database.observations import Drive
from ..core.errors import BevameterError
from ..core.recording.readers import read_recording
from ..core.recording.types import Recording

_SOUND_S = 2.0
"""Length of the sound that is played [s]."""

_WIDEST_PX = 960
"""Wider frames are made smaller."""

_MOST_ENTRIES = 100_000
"""So many files and folders are looked at."""


@dataclass
class Recordings:
    """Recordings in a folder, by digest.

    The database knows a recording's digest and name, and not where it lies. `search` reads what it finds in the folder,
    which takes as long as reading takes; what was found is there at once.

    Parameters
    ----------
    folder
        Where they may lie, at any depth; None where none is stated.
    """

    folder: Path | None = None

    def __post_init__(self) -> None:
        self._found: dict[str, Recording] = {}
        self._searching = False

    @property
    def is_searching(self) -> bool:
        """Whether more may be found."""
        return self._searching

    def of(self, digest: str) -> Recording | None:
        """Give the recording of a digest; None where it has not been found."""
        return self._found.get(digest)

    def why_not(self, drive: Drive) -> str:
        """Say why a drive's recording is not there, and what would bring it."""
        if self.folder is None:
            return (
                "Frames and sound: the database does not store where a recording lies; bevameter view --recordings "
                "FOLDER looks for it there."
            )
        if self._searching:
            return f"Frames and sound: the recording is still being looked for in {self.folder}; select the cell again."
        return f"Frames and sound: no recording that could be read in {self.folder} has the digest of {drive.name}."

    def start(self, wanted: frozenset[str]) -> threading.Thread | None:
        """Search in a thread of its own, which ends with the program; None where there is no folder."""
        if self.folder is None:
            return None
        self._searching = True
        thread = threading.Thread(target=self.search, args=(wanted,), daemon=True)
        thread.start()
        return thread

    def search(self, wanted: frozenset[str]) -> None:
        """Read what lies in the folder until all wanted digests are found; what is no recording is entered."""
        waiting = [] if self.folder is None else [self.folder]
        looked_at = 0
        try:
            while waiting and looked_at < _MOST_ENTRIES and not wanted <= self._found.keys():
                path, looked_at = waiting.pop(0), looked_at + 1
                try:
                    recording = read_recording(path)
                except BevameterError:
                    if path.is_dir() and not path.is_symlink() and os.access(path, os.R_OK | os.X_OK):
                        waiting += sorted(each for each in path.iterdir() if not each.name.startswith("."))
                    continue
                if recording.digest in wanted:
                    self._found.setdefault(recording.digest, recording)
        finally:
            self._searching = False


def frame_jpeg(recording: Recording, time_s: float) -> bytes | None:
    """Give the camera's frame nearest to a time [s] as JPEG; None where there is none that can be read."""
    camera = recording.camera
    if camera is None:
        return None
    # The times first, without decoding; then the nearest image alone.
    times: list[float] = []

    def note(time: float) -> bool:
        times.append(time)
        return False

    for _ in camera.frames(note):
        pass
    if not times:
        return None
    nearest = min(times, key=lambda time: abs(time - time_s))
    frame = next(iter(camera.frames(lambda time: time == nearest)), None)
    if frame is None or frame.image is None:
        return None
    image = frame.image
    if image.shape[1] > _WIDEST_PX:
        scale = _WIDEST_PX / image.shape[1]
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(".jpg", image)
    return data.tobytes() if done else None


def sound_wav(recording: Recording, time_s: float) -> bytes | None:
    """Give two seconds of sound around a time [s] as WAV; None where there is none that can be read."""
    sound = recording.sound
    if sound is None:
        return None
    best: np.ndarray | None = None
    for block in sound.blocks(_SOUND_S, 0.25 * _SOUND_S):
        if block.start_s > time_s:
            break
        if block.samples is not None and block.start_s + _SOUND_S >= time_s:
            best = block.samples
            if block.start_s + 0.5 * _SOUND_S >= time_s:
                break
    if best is None:
        return None
    file = io.BytesIO()
    soundfile.write(file, best, sound.sample_rate, format="WAV", subtype="PCM_16")
    return file.getvalue()
