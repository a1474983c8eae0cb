"""The digest of a recording: the same drive has the same one wherever its files lie and however they are packed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from .types import VibrationRun, WheelTable

_PIECE = 2**20


class StreamDigest:
    """A SHA-256 for each stream, joined by the streams' names, so that the order of reading does not matter."""

    def __init__(self) -> None:
        self._streams: dict[str, hashlib._Hash] = {}

    def add(self, stream: str, data: bytes | memoryview) -> None:
        """Add content to a stream."""
        self._streams.setdefault(stream, hashlib.sha256()).update(data)

    def add_columns(self, stream: str, columns: Mapping[str, np.ndarray | None]) -> None:
        """Add channels by name, in the order of their names; every NaN counts as the same."""
        for name in sorted(columns):
            values = columns[name]
            if values is None:
                continue
            self.add(stream, f"{name}\0{len(values)}\0".encode())
            if values.dtype.kind == "f":
                self.add(stream, np.where(np.isnan(values), np.nan, values).astype("<f8").tobytes())
            else:
                self.add(stream, "\0".join(map(str, values)).encode())

    def add_file(self, stream: str, path: Path) -> None:
        """Add the content of a file, piece by piece, after its length; a file that is missing adds that."""
        try:
            with path.open("rb") as file:
                self.add(stream, f"{path.stat().st_size}\0".encode())
                while piece := file.read(_PIECE):
                    self.add(stream, piece)
        except OSError:
            self.add(stream, b"missing\0")

    def add_numbers(self, stream: str, numbers: Iterable[float]) -> None:
        """Add a few numbers."""
        self.add(stream, np.asarray(list(numbers), dtype="<f8").tobytes())

    def add_wheel(self, table: WheelTable) -> None:
        """Add a wheel table as it was read."""
        soil = {} if table.soil is None else {"soil": table.soil}
        self.add_columns("wheel", {**table.columns, "wheel": table.wheel, "run": table.run, **soil})

    def add_vibration(self, run: VibrationRun) -> None:
        """Add a vibration run."""
        for names, values in ((run.names, run.channels), (run.wheel_names, run.wheel)):
            self.add_columns("vibration", {"time_s": run.time_s, **dict(zip(names, values.T, strict=True))})

    def hexdigest(self) -> str:
        """Give the SHA-256 of all streams, hexadecimal."""
        whole = hashlib.sha256(b"bevameter recording 1\0")
        for name in sorted(self._streams):
            whole.update(name.encode() + b"\0" + self._streams[name].digest())
        return whole.hexdigest()
