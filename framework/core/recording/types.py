"""A recorded drive: wheel channels, poses and labels in memory, camera and sound as streams."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Protocol

import numpy as np

from ..origin import Offset, Origin
from ..vehicle import Vehicle

WHEEL_COLUMNS = (
    "time_s", "load_N", "torque_Nm", "sinkage_m", "slip", "drawbar_pull_N", "wheel_speed_rad_s", "travel_speed_m_s",
    "wheel_angle_rad", "pitch_rad", "pass", "x_m", "y_m", "slip_angle_rad",
)  # fmt: skip
"""Numeric wheel columns (CONTRACTS.md). Columns ``<channel>_sd_<unit>`` hold the
scatter within a steady-state trial."""

TEXT_COLUMNS = ("wheel", "run", "soil")
"""Wheel columns of names: of the wheel, of the trial, and of the soil that a row is on."""


@dataclass(frozen=True)
class WheelTable:
    """Wheel channels of one recording, all wheels together.

    Parameters
    ----------
    columns
        Numeric channels by column name, each (n,), SI; NaN where a value was not observed.
    wheel
        (n,) names of the wheels, or None where there is one wheel.
    run
        (n,) names of steady-state trials, or None; rows of different runs are not neighbours in time.
    source
        The file they came from.
    soil
        (n,) names of the soil that each row is on, or None where the table does not say it.
    column_names
        Of each channel of a table, the name of its column; ``""`` where each wheel has one of its own.
    """

    columns: Mapping[str, np.ndarray]
    wheel: np.ndarray | None
    run: np.ndarray | None
    source: Path
    soil: np.ndarray | None = None
    column_names: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def get(self, name: str) -> np.ndarray | None:
        """Give the channel, (n,), or None where the recording has none of that name."""
        return self.columns.get(name)

    def observed(self, name: str) -> np.ndarray:
        """Give the values of a channel that were observed, (m,), in the order of the rows; none where it is absent."""
        values = self.columns.get(name)
        return np.empty(0) if values is None else values[np.isfinite(values)]

    def select(self, rows: np.ndarray) -> WheelTable:
        """Give the rows of a boolean mask or an index array, as a new table."""
        wheel, run, soil = (None if each is None else each[rows] for each in (self.wheel, self.run, self.soil))
        columns = {name: values[rows] for name, values in self.columns.items()}
        return replace(self, columns=columns, wheel=wheel, run=run, soil=soil)

    def with_columns(self, columns: Mapping[str, np.ndarray]) -> WheelTable:
        """Give the same rows with other channels, each (n,)."""
        return replace(self, columns=columns)

    def adding(self, channels: Mapping[str, np.ndarray]) -> WheelTable:
        """Give the same rows with further channels, each (n,), which take the place of those of the same names."""
        return self.with_columns({**self.columns, **channels})


@dataclass(frozen=True)
class Pose:
    """Where the vehicle's reference point was: time_s, x_m, y_m, yaw_rad, each (n,); yaw from the x axis, leftwards."""

    time_s: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    yaw_rad: np.ndarray


@dataclass(frozen=True)
class Labels:
    """Ground truth, where somebody wrote it down: m stretches of time, each of one class."""

    start_s: np.ndarray
    end_s: np.ndarray
    classes: tuple[str, ...]

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """Give the class at each time, (n,) of str, ``""`` where nobody labelled it."""
        answer = np.full(np.shape(time_s), "", dtype=object)
        for start, end, name in zip(self.start_s, self.end_s, self.classes, strict=True):
            answer[(time_s >= start) & (time_s < end)] = name
        return answer


@dataclass(frozen=True)
class Frame:
    """One camera image, (h, w, 3) uint8 BGR, or None with the problem that kept it from being read.

    What is seen on an `urgent` one is wanted at once, and not together with the next: the vehicle is driving.
    """

    time_s: float
    image: np.ndarray | None
    problem: str | None = None
    urgent: bool = False


@dataclass(frozen=True)
class SoundBlock:
    """A stretch of mono sound: samples (m,) float32 in [-1, 1], the first at `start_s`; or None with the problem.

    `channels`, (m, c), are what it was mixed of, where there were several: clipping shows in them and not in the mix.
    `urgent` is as in `Frame`.
    """

    start_s: float
    samples: np.ndarray | None
    problem: str | None = None
    channels: np.ndarray | None = None
    urgent: bool = False


Wanted = Callable[[float], bool]
"""Says of a time [s] whether the image that was taken then is wanted."""


def always(time_s: float) -> bool:
    """Want every image."""
    return True


class CameraStream(Protocol):
    """Images in order of time, decoded one at a time so that memory does not grow with the recording."""

    def __len__(self) -> int: ...

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        """Yield every image of the stream, also those that could not be read (then with their problem).

        Parameters
        ----------
        wanted
            Called with the time of each image [s] before it is decoded, after the one before it was yielded; an image
            for which it answers False is passed over.
        """
        ...


class SoundStream(Protocol):
    """Sound, read in blocks so that memory does not grow with the recording."""

    @property
    def sample_rate(self) -> int:
        """Samples a second [Hz]."""
        ...

    @property
    def start_s(self) -> float:
        """Time of the first sample on the recording's clock [s]."""
        ...

    @property
    def duration_s(self) -> float:
        """Length of what is readable [s]."""
        ...

    def blocks(self, block_s: float, hop_s: float) -> Iterator[SoundBlock]:
        """Yield blocks of `block_s` seconds whose starts are `hop_s` apart; the last, shorter rest is left out."""
        ...


@dataclass(frozen=True)
class VibrationRun:
    """Structure-borne sound: an inertial sensor's channels on a uniform clock, and the wheel drives' channels.

    Parameters
    ----------
    time_s : (n,)
        Uniform, `sample_rate_Hz` samples a second [s].
    names
        Names of the c inertial channels, as in the file (``wx`` ... ``az``).
    channels : (n, c)
        Inertial channels in the file's units; NaN where there was a gap.
    wheel_names
        Names of the w wheel channels (``curL`` ... ``velR``); empty where there was no wheel file.
    wheel : (n, w)
        Wheel channels interpolated on the same clock; NaN beyond what was recorded.
    sample_rate_Hz
        [Hz].
    source
        The inertial sensor's file.
    problems
        What is amiss, in words: gaps, a wheel speed that was not recorded.
    """

    time_s: np.ndarray
    names: tuple[str, ...]
    channels: np.ndarray
    wheel_names: tuple[str, ...]
    wheel: np.ndarray
    sample_rate_Hz: float
    source: Path
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Recording:
    """One drive, whatever it was read from.

    `problems` says in words what could not be read; what is readable is used. `notes` says what was converted or
    assumed in reading it: units, signs, the meaning of columns. `digest` is the SHA-256 of what was
    read, hexadecimal: two readings of the same drive have the same digest, and so add nothing to a database twice.
    `frame` names the frame of the places as it was recorded, empty where nothing says it. `origin` says where on Earth
    its x = y = 0 lies, where a satellite receiver was recorded or it is stated; `offset` where it lies in the site's
    frame, where that is stated. `part` says which part of what was recorded the wheel rows are, in words
    (`framework.part`); empty where they are all of it. `shared_speed` says that the wheel rows' travel speed is that of
    the vehicle's reference point.
    """

    name: str
    source: Path
    vehicle: Vehicle | None
    start_time: datetime | None
    site: str
    digest: str
    wheel: WheelTable | None = None
    pose: Pose | None = None
    labels: Labels | None = None
    camera: CameraStream | None = None
    sound: SoundStream | None = None
    problems: tuple[str, ...] = ()
    vibration: VibrationRun | None = None
    notes: tuple[str, ...] = ()
    origin: Origin | None = None
    offset: Offset | None = None
    frame: str = ""
    part: str = ""
    shared_speed: bool = False

    @property
    def synthetic(self) -> bool:
        """Whether it calls itself synthetic: the name of its site says so."""
        return "synthetic" in self.site.lower()

    @property
    def described(self) -> str:
        """Where it came from, and which part of that it is."""
        return f"{self.source}, {self.part}" if self.part else str(self.source)
