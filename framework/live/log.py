"""What a drive's wheels, places and inertial sensor gave, row by row, and the recording that it makes in the end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.recording.bag_vibration import NAMES, vibration_of
from ..core.recording.topic_map import VibrationTopic
from ..core.recording.types import Frame, Pose, SoundBlock, VibrationRun, Wanted, WheelTable, always
from ..core.recording.wheel_file import derive_all
from ..core.vehicle import Vehicle
from .streams import SOURCE

POSE, WHEEL, IMU = "pose", "wheel", "imu"

Part = tuple[str, dict[str, np.ndarray]]
"""Rows of one stream: its name, and columns, each (n,)."""


@dataclass(frozen=True)
class WheelRow:
    """One sample of a wheel: its name, empty where there is one, and its channels."""

    wheel: str
    channels: Mapping[str, float]


class Log:
    """Rows of the streams in order of time, as they come; `cut` makes parts of them, to be written away."""

    def __init__(self) -> None:
        self._rows: dict[str, list[tuple[float, Any]]] = {POSE: [], WHEEL: [], IMU: []}

    def add(self, stream: str, time_s: float, row: Any) -> None:
        """Add a row: numbers, or a `WheelRow`."""
        self._rows[stream].append((time_s, row))

    def cut(self) -> list[Part]:
        """Make parts of the rows."""
        return [
            (stream, _wheel_columns(rows) if stream == WHEEL else _columns(rows))
            for stream, rows in self._rows.items()
            if rows
        ]


def pose_of(parts: Iterable[dict[str, np.ndarray]]) -> Pose | None:
    """Give the poses of parts; None where there is none."""
    columns = _joined(parts)
    return Pose(*(columns[name] for name in ("time_s", "0", "1", "2"))) if columns else None


def wheel_of(parts: Iterable[dict[str, np.ndarray]], vehicle: Vehicle) -> WheelTable | None:
    """Give the wheels' rows of parts, and what can be derived of them; None where there is none."""
    columns = _joined(parts)
    return derive_all(_table(columns), vehicle) if columns else None


def vibration_of_imu(
    parts: Iterable[dict[str, np.ndarray]], wheel: WheelTable | None
) -> tuple[VibrationRun | None, list[str]]:
    """Give what the inertial sensor heard, as a bag's, and what is wrong with it."""
    columns = _joined(parts)
    if not columns:
        return None, []
    origin_s = float(columns["time_s"][0])
    time_ns = np.round((columns["time_s"] - origin_s) * 1e9).astype(np.int64)
    channels = (columns[str(number)].tolist() for number in range(len(NAMES)))
    rows = list(zip(time_ns.tolist(), *channels, strict=True))
    shifted = wheel
    if wheel is not None:
        shifted = wheel.adding({"time_s": wheel["time_s"] - origin_s})
    run, problems = vibration_of(rows, 0, shifted, VibrationTopic(topic=IMU), SOURCE)
    return (None if run is None else replace(run, time_s=run.time_s + origin_s)), problems


def table_of_rows(rows: list[tuple[float, WheelRow]]) -> WheelTable:
    """Make a table of samples in order of time."""
    return _table(_wheel_columns(rows))


def _table(columns: dict[str, np.ndarray]) -> WheelTable:
    numbers = {name: values for name, values in columns.items() if name != "wheel"}
    wheel = columns["wheel"]
    return WheelTable(numbers, wheel.astype(object) if (wheel != "").any() else None, None, SOURCE)


def _columns(rows: list[tuple[float, Any]]) -> dict[str, np.ndarray]:
    values = np.array([row for _, row in rows], dtype=float)
    return {"time_s": np.array([time_s for time_s, _ in rows])} | {
        str(number): column for number, column in enumerate(values.T)
    }


def _wheel_columns(rows: list[tuple[float, Any]]) -> dict[str, np.ndarray]:
    names = dict.fromkeys(name for _, row in rows for name in row.channels)
    return {
        "time_s": np.array([time_s for time_s, _ in rows]),
        "wheel": np.array([row.wheel for _, row in rows]),
        **{name: np.array([row.channels.get(name, np.nan) for _, row in rows]) for name in names},
    }


def _joined(parts: Iterable[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Put parts one after the other; a channel that one lacks is NaN there."""
    given = list(parts)
    names = dict.fromkeys(name for part in given for name in part)
    return {
        name: np.concatenate([part.get(name, np.full(len(part["time_s"]), np.nan)) for part in given]) for name in names
    }


@dataclass(frozen=True)
class Taken:
    """Images and sound that were taken during a drive and are not kept: how many, how long, at which rate."""

    images: int
    duration_s: float
    sample_rate: int
    start_s: float = 0.0

    def __len__(self) -> int:
        return self.images

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield nothing: they were looked at when they came."""
        return iter(())

    def blocks(self, block_s: float, hop_s: float) -> Iterator[SoundBlock]:
        """Yield nothing: it was heard when it came."""
        return iter(())
