"""The vehicle: its wheels, its camera, its microphone, and the noise of its sensors."""

from __future__ import annotations

import math
import os
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import (
    AfterValidator,
    AliasChoices,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from .arguments import path_of, refused
from .errors import InputError

_SHOWN = 80
"""Characters of a value that are shown at most [-]."""

_LARGEST_M = 10.0
"""No wheel has a length beyond it: the largest are two metres in radius."""


def _number(value: object) -> object:
    """Refuse what pydantic would take for a number though a file that says it has another meaning."""
    if isinstance(value, bool | str):
        raise ValueError(f"{value!r:.{_SHOWN}}, expected a number")
    return value


def _coefficients(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) not in (0, 4, 5):
        raise ValueError(f"{len(values)} numbers, expected k1, k2, p1, p2, or these and k3")
    return values


def _length(value: float) -> float:
    if not 0.0 < value <= _LARGEST_M:
        raise ValueError(f"{value:g}, expected metres, greater than 0 and less than or equal to {_LARGEST_M:g}")
    return value


Number = Annotated[float, BeforeValidator(_number)]
Whole = Annotated[int, BeforeValidator(_number)]
Positive = Annotated[Number, Field(gt=0, allow_inf_nan=False)]
Length = Annotated[Number, AfterValidator(_length)]
NonNegative = Annotated[Number, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[Number, Field(allow_inf_nan=False)]

NOISY_COLUMNS = (
    "load_N", "torque_Nm", "sinkage_m", "slip", "drawbar_pull_N", "wheel_speed_rad_s", "travel_speed_m_s",
    "wheel_angle_rad", "pitch_rad", "x_m", "y_m", "slip_angle_rad",
)  # fmt: skip
"""Wheel columns whose noise a vehicle may state."""


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Wheel(_Part):
    """A rigid wheel: radius r [m], width b [m], and its grousers (lugs)."""

    radius_m: Length
    width_m: Length
    grouser_height_m: NonNegative = 0.0
    grouser_count: Annotated[Whole, Field(ge=0)] = 0
    name: str = "wheel"
    position_m: Annotated[
        tuple[Finite, Finite], Field(validation_alias=AliasChoices("position_m", "position"))
    ] = (0.0, 0.0)  # fmt: skip
    """Place in the vehicle frame: x forward, y left [m]; `position` in a file is the same."""

    @field_validator("grouser_height_m")
    @classmethod
    def _lower_than_the_wheel(cls, height_m: float, info: ValidationInfo) -> float:
        radius_m = info.data.get("radius_m", math.inf)  # where the radius is at fault itself, that is what is said
        if height_m > radius_m:
            raise ValueError(f"{height_m:g}, expected metres, at most the wheel's radius, {radius_m:g}")
        return height_m


class Camera(_Part):
    """A pinhole camera that looks ahead and down at flat ground.

    The optical axis is `pitch_rad` below the horizon, `height_m` above the ground, at `forward_m` ahead of the
    vehicle's reference point and `left_m` to its left. `matrix` is the 3x3 intrinsic matrix [px], `distortion` the
    OpenCV coefficients (k1, k2, p1, p2[, k3]).
    """

    matrix: tuple[tuple[Finite, Finite, Finite], tuple[Finite, Finite, Finite], tuple[Finite, Finite, Finite]]
    width_px: Annotated[Whole, Field(gt=0, le=20000)]
    height_px: Annotated[Whole, Field(gt=0, le=20000)]
    height_m: Positive
    pitch_rad: Annotated[Number, Field(gt=0, le=math.pi / 2)]
    forward_m: Finite = 0.0
    left_m: Finite = 0.0
    distortion: Annotated[tuple[Finite, ...], AfterValidator(_coefficients)] = ()
    exposure_s: Positive | None = None
    """Exposure time [s], if known: motion blur is travel speed times exposure."""

    @property
    def intrinsics(self) -> np.ndarray:
        """The (3, 3) intrinsic matrix [px]."""
        return np.asarray(self.matrix, dtype=float)


class Microphone(_Part):
    """A microphone near the wheels: its place in the vehicle frame [m] and its gain [dB]."""

    position_m: tuple[Finite, Finite] = (0.0, 0.0)
    gain_dB: Finite = 0.0


class Vehicle(_Part):
    """A vehicle as `vehicle.toml` describes it.

    `noise` gives standard deviations of the wheel channels by column name (``load_N = 5.0``); a channel that is
    absent there has its noise estimated from the data.
    """

    name: str = "vehicle"
    wheels: Annotated[tuple[Wheel, ...], Field(min_length=1)]
    noise: dict[str, Positive] = {}
    camera: Camera | None = None
    microphone: Microphone | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_wheel(cls, data: object) -> object:
        if isinstance(data, dict) and "wheel" in data:
            if "wheels" in data:
                raise ValueError("both [wheel] and [[wheels]] are given")
            data = {**{key: value for key, value in data.items() if key != "wheel"}, "wheels": [data["wheel"]]}
        return data

    @model_validator(mode="after")
    def _known_noise(self) -> Vehicle:
        for name in self.noise:
            if name not in NOISY_COLUMNS:
                raise ValueError(f"noise of {name!r}: no such wheel column, expected one of {', '.join(NOISY_COLUMNS)}")
        return self

    @model_validator(mode="after")
    def _distinct_wheels(self) -> Vehicle:
        names = [wheel.name for wheel in self.wheels]
        if len(set(names)) != len(names):
            raise ValueError(f"wheels must have different names, got {', '.join(names)}")
        return self

    def wheel(self, name: str | None = None) -> Wheel:
        """Give the wheel of that name; the only one where `name` is None or there is just one.

        Raises
        ------
        InputError
            There is no such wheel.
        """
        if len(self.wheels) == 1:
            return self.wheels[0]
        for wheel in self.wheels:
            if wheel.name == name:
                return wheel
        raise InputError(
            f"vehicle {self.name!r}",
            f"no wheel named {name!r}",
            expected="one of " + ", ".join(wheel.name for wheel in self.wheels),
        )


_INTEGERS = "one of no more than 64 bits; write it with a decimal point"


def load_toml(path: str | Path) -> dict:
    """Read a TOML file; raises `InputError` where it is missing, no TOML, or holds a number of more than 64 bits."""
    path = path_of("file", path, "the path of a TOML file")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
        _check_integers(path, data)
    except FileNotFoundError:
        raise InputError(path, "no such file", expected="a TOML file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, str(error), expected="a readable TOML text file") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, str(error), expected="valid TOML") from error
    except RecursionError:
        raise InputError(path, "nested too deeply", expected="valid TOML, a few tables deep") from None
    except ValueError:  # Python turns no longer text into a whole number
        limit = sys.get_int_max_str_digits()
        raise InputError(path, f"a whole number of more than {limit} digits", expected=_INTEGERS) from None
    return data


def _check_integers(path: Path, value: object, key: str = "") -> None:
    """Refuse whole numbers that TOML does not have, in tables and arrays however deep: no float may hold them."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, part in parts:
        _check_integers(path, part, f"{key}.{name}" if key else str(name))
    if isinstance(value, int) and value.bit_length() > 63:
        digits = f"a whole number of {len(str(abs(value)))} digits"
        raise InputError(path, digits, expected=_INTEGERS, place=f"key {key}")


def load_vehicle(path: str | Path) -> Vehicle:
    """Read `vehicle.toml`.

    Raises
    ------
    InputError
        The file is missing, is not TOML, or a key is missing, unknown or out of range; the text names the key.
    """
    data = load_toml(path)
    if "wheel" not in data and "wheels" not in data:
        raise InputError(path, "no wheel geometry", expected="a [wheel] table with radius_m and width_m")
    try:
        return Vehicle.model_validate(data)
    except ValidationError as error:
        raise input_error(path, error, {"wheels.0": "wheel"} if "wheels" not in data else {}) from None


def as_vehicle(vehicle: object) -> Vehicle:
    """Give the vehicle that an argument is, or that its file describes.

    Raises
    ------
    InputError
        It is neither a `Vehicle` nor a path, or what is wrong with the file (`load_vehicle`).
    """
    if isinstance(vehicle, Vehicle):
        return vehicle
    if not isinstance(vehicle, str | os.PathLike):
        raise refused("vehicle", vehicle, "a Vehicle, or the path of its TOML file")
    return load_vehicle(Path(vehicle))


def input_error(path: str | Path, error: ValidationError, written: Mapping[str, str] | None = None) -> InputError:
    """Turn the first fault that pydantic found into one line naming file, key (as it was `written`) and value.

    A key that nothing reads comes before one that is missing: the former is often the latter, misspelt.
    """
    fault = min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
    key = ".".join(str(part) for part in fault["loc"]) or None
    for read, wrote in (written or {}).items():
        key = key and key.replace(read, wrote, 1)
    if fault["type"] == "extra_forbidden":
        return InputError(path, "no such key", place=key and f"key {key}")
    shown = "" if fault["type"] in ("missing", "value_error") else f"{fault['input']!r:.{_SHOWN}}: "
    return InputError(path, f"{shown}{fault['msg'].removeprefix('Value error, ')}", place=key and f"key {key}")
