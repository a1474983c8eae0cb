"""The topic map: which topic of a bag is which stream, where names and types of topics do not say so (`recognition`).

The map is TOML, each part of it optional; ``docs/recording.md`` shows it. Fields are paths such as ``wrench.force.z``,
``data[0]``, ``velocity[left_wheel]``. What it states overrides what is recognised; the rest is as without it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field

from ..files import load_toml
from ..models import FileModel, Finite, Positive, StatedOrigin, Whole, checked
from . import units
from .camera import BitDepth
from .column_names import stem_of
from .types import WHEEL_COLUMNS

SoundFormat = Literal["pcm8", "pcm16", "pcm24", "pcm32", "float32", "mp3"]


class Reading(FileModel):
    """A number of a message: the path of its field, its unit where that is not SI, and what makes it the channel: scale
    times the value in SI, plus offset.
    """

    field: str
    unit: str | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0


AnyReading = Annotated[Reading, BeforeValidator(lambda value: {"field": value} if isinstance(value, str) else value)]

_Fields = TypeVar("_Fields", bound=dict[str, Reading])


def _in_si(fields: _Fields) -> _Fields:
    """Put units into the scales."""
    for channel, reading in fields.items():
        if reading.unit is None:
            continue
        dimension = stem_of(channel)[1].replace("_", "/") or "1"
        factor = units.factor(reading.unit, dimension)
        if factor is None:
            raise ValueError(f"{channel} in {reading.unit!r}, expected one of {units.spelt(dimension)}")
        fields[channel] = reading.model_copy(update={"unit": None, "scale": reading.scale * factor})
    return fields


COLUMNS = (*WHEEL_COLUMNS[1:], "current_A", "roll_rad")
"""Wheel columns that a topic may give."""


def _wheel_column(name: str) -> str:
    if name not in COLUMNS:
        raise ValueError(f"no column of a wheel file, expected one of {', '.join(COLUMNS)}")
    return name


class WheelTopic(FileModel):
    """A topic with wheel channels."""

    topic: str
    wheel: str | None = None
    fields: Annotated[
        dict[Annotated[str, AfterValidator(_wheel_column)], AnyReading], AfterValidator(_in_si)
    ] = Field(default_factory=dict)  # fmt: skip

    @property
    def shares_speed(self) -> bool:
        """Whether it gives the travel speed of the vehicle, and not of a wheel."""
        return self.wheel is None and "travel_speed_m_s" in self.fields


class PoseTopic(FileModel):
    """A topic with poses; the path of its pose, or of x_m, y_m and yaw_rad; the origin of its metres."""

    topic: str
    fields: Annotated[
        dict[Literal["x_m", "y_m", "yaw_rad"], AnyReading], AfterValidator(_in_si)
    ] = Field(default_factory=dict)  # fmt: skip
    pose: str | None = None
    frame: str | None = None
    """Name of the poses' frame, where their messages do not say the right one."""
    origin: StatedOrigin | None = None
    """Where on Earth x = y = 0 lies. Of a NavSatFix the first fix where absent, of other poses found by fixes."""


class AttitudeTopic(FileModel):
    """A topic with the vehicle's attitude: the path of a quaternion in a frame whose z axis points up."""

    topic: str
    orientation: str | None = None


class CameraTopic(FileModel):
    """A topic with images or video, and how many bits samples make use of that come as 16."""

    topic: str
    bit_depth: BitDepth | None = None


class VibrationTopic(FileModel):
    """A topic of an inertial sensor that hears the ground."""

    topic: str


class SoundTopic(FileModel):
    """A topic with sound, and how its samples are written."""

    topic: str
    field: str | None = None
    format: SoundFormat | None = None
    sample_rate_Hz: Annotated[Whole, Field(ge=1000, le=768_000)] | None = None
    channels: Annotated[Whole, Field(ge=1, le=64)] | None = None


class TopicMap(FileModel):
    """Which topic is which."""

    name: str | None = None
    site: str = ""
    max_gap_s: Positive = 0.5
    wheel: Annotated[tuple[WheelTopic, ...], BeforeValidator(lambda v: [v] if isinstance(v, dict) else v)] = ()
    pose: PoseTopic | None = None
    attitude: AttitudeTopic | None = None
    camera: CameraTopic | None = None
    sound: SoundTopic | None = None
    vibration: VibrationTopic | None = None
    ignore: tuple[str, ...] = ()
    """Topics that are not used, whatever they are; ``*`` in a name stands for anything."""

    @property
    def parts(self) -> tuple[WheelTopic | PoseTopic | AttitudeTopic | CameraTopic | SoundTopic | VibrationTopic, ...]:
        """All topics that it names, with what is said of them."""
        streams = (self.pose, self.attitude, self.camera, self.sound, self.vibration)
        return (*self.wheel, *(each for each in streams if each is not None))


def load_topic_map(path: Path) -> TopicMap:
    """Read a topic map; raises `InputError` on an unknown key, a wrong value or a column that is none of a wheel's."""
    return checked(TopicMap, load_toml(path), path)
