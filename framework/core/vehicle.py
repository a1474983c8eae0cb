"""The vehicle: its wheels, its camera, its microphone, and the noise of its sensors."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, AliasChoices, Field, ValidationInfo, field_validator, model_validator

from .arguments import refused
from .errors import InputError
from .files import load_toml
from .models import FileModel, Finite, NonNegative, Number, Positive, Whole, checked

_LARGEST_M = 10.0
"""No wheel has a length beyond it: the largest are two metres in radius."""


def _coefficients(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) not in (0, 4, 5):
        raise ValueError(f"{len(values)} numbers, expected k1, k2, p1, p2, or these and k3")
    return values


def _length(value: float) -> float:
    if not 0.0 < value <= _LARGEST_M:
        raise ValueError(f"{value:g}, expected metres, greater than 0 and less than or equal to {_LARGEST_M:g}")
    return value


Length = Annotated[Number, AfterValidator(_length)]

_IN_LINE_M = 0.01
"""Wheels whose places differ by less from a line lie on it [m]."""

NOISY_COLUMNS = (
    "load_N", "torque_Nm", "sinkage_m", "slip", "drawbar_pull_N", "wheel_speed_rad_s", "travel_speed_m_s",
    "wheel_angle_rad", "pitch_rad", "x_m", "y_m", "slip_angle_rad",
)  # fmt: skip
"""Wheel columns whose noise a vehicle may state."""


class Wheel(FileModel):
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
    load_N: Positive | None = None
    """Load that it carries on level ground [N], where it is not sensed."""
    driven: bool | None = None
    """Whether a motor drives it. A castor, say, carries weight and makes no pull; None: driven, if rows are of it."""

    @model_validator(mode="before")
    @classmethod
    def _radius(cls, data: object) -> object:
        if isinstance(data, dict) and (name := next((n for n in ("diameter_m", "diameter") if n in data), None)):
            raise ValueError(f"{name} = {data[name]!r:.20}, expected radius_m = diameter / 2")
        return data

    @field_validator("grouser_height_m")
    @classmethod
    def _lower_than_the_wheel(cls, height_m: float, info: ValidationInfo) -> float:
        radius_m = info.data.get("radius_m", math.inf)  # where the radius is at fault itself, that is what is said
        if height_m > radius_m:
            raise ValueError(f"{height_m:g}, expected metres, at most the wheel's radius, {radius_m:g}")
        return height_m


_WIDEST_RAD = math.radians(160.0)
"""No lens of a greater field of view is a pinhole. A matrix that nobody filled in, such as the unit matrix, has one."""


class Camera(FileModel):
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

    @model_validator(mode="after")
    def _a_lens(self) -> Camera:
        for axis, size_px in enumerate((self.width_px, self.height_px)):
            focal_px = self.matrix[axis][axis]
            if focal_px < 0.5 * size_px / math.tan(0.5 * _WIDEST_RAD):
                raise ValueError(
                    f"a focal length of {focal_px:g} px for {size_px} px: expected a field of view of at most "
                    f"{math.degrees(_WIDEST_RAD):.0f} deg"
                )
        return self

    @property
    def intrinsics(self) -> np.ndarray:
        """The (3, 3) intrinsic matrix [px]."""
        return np.asarray(self.matrix, dtype=float)


class CameraMount(FileModel):
    """Where a camera is whose intrinsics a bag's CameraInfo gives; as in `Camera`."""

    height_m: Positive
    pitch_rad: Annotated[Number, Field(gt=0, le=math.pi / 2)]
    forward_m: Finite = 0.0
    left_m: Finite = 0.0


class Motor(FileModel):
    """What makes torque at a wheel of the current of its motor.

    T = torque_constant_Nm_A x gear_ratio x efficiency x current - friction_Nm while the motor drives; while it brakes
    the losses lie on the other side of the gear, and the torque is divided by the efficiency.
    """

    torque_constant_Nm_A: Positive
    gear_ratio: Positive = 1.0
    efficiency: Annotated[Number, Field(gt=0, le=1)] = 1.0
    friction_Nm: NonNegative = 0.0
    """Torque lost at the wheel whatever the load [N m]: the torque above at the current of a free spin."""

    free_spin_s: tuple[Finite, Finite] | None = None
    """From when to when in the recording the wheels turn in the air [s]: the friction is what they take there."""

    @model_validator(mode="after")
    def _one_friction(self) -> Motor:
        if self.free_spin_s is not None:
            if self.friction_Nm:
                raise ValueError("friction_Nm and free_spin_s: expected one of them")
            if not self.free_spin_s[0] < self.free_spin_s[1]:
                raise ValueError(f"free_spin_s {list(self.free_spin_s)}: expected a start before the end")
        return self


class Microphone(FileModel):
    """A microphone near the wheels: its place in the vehicle frame [m] and its gain [dB]."""

    position_m: tuple[Finite, Finite] = (0.0, 0.0)
    gain_dB: Finite = 0.0


_UNNAMED = "vehicle"


class Vehicle(FileModel):
    """A vehicle as `vehicle.toml` describes it.

    `noise` gives standard deviations of the wheel channels by column name (``load_N = 5.0``); a channel that is
    absent there has its noise estimated from the data. `mass_kg`, and `centre_of_mass_m` in the vehicle frame (x
    forward, y left, z above the ground), give the load on the wheels where it is not sensed; without the latter the
    mass lies midway between the wheels, on the ground. `motor` makes torque of the motors' current where no torque is
    sensed. A vehicle with a camera needs no wheels: it makes a map of classes, and no soil.
    """

    name: str = _UNNAMED
    wheels: Annotated[tuple[Wheel, ...], Field(min_length=1)] = ()
    noise: dict[str, Positive] = Field(default_factory=dict)
    mass_kg: Positive | None = None
    centre_of_mass_m: tuple[Finite, Finite, NonNegative] | None = None
    motor: Motor | None = None
    camera: Camera | None = None
    camera_mount: CameraMount | None = None
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
    def _wheels_or_camera(self) -> Vehicle:
        if self.camera is not None and self.camera_mount is not None:
            raise ValueError("both [camera] and [camera_mount] are given")
        if not self.wheels and self.camera is None and self.camera_mount is None:
            raise ValueError("no wheel geometry, expected a [wheel] table with radius_m and width_m, or a [camera]")
        return self

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

    @model_validator(mode="after")
    def _one_weight(self) -> Vehicle:
        if self.centre_of_mass_m is not None and self.mass_kg is None:
            raise ValueError("centre_of_mass_m without mass_kg")
        if self.mass_kg is not None and any(wheel.load_N is not None for wheel in self.wheels):
            raise ValueError("both mass_kg and the load_N of a wheel are given")
        if self.mass_kg is not None and len(self.wheels) < 2:
            many = "one wheel" if self.wheels else "no wheels"
            raise ValueError(f"mass_kg with {many}, expected load_N of the wheel, or the places of all in [[wheels]]")
        if self.mass_kg is None:
            return self
        place = np.array([wheel.position_m for wheel in self.wheels])
        if np.linalg.matrix_rank(place - place.mean(axis=0), tol=_IN_LINE_M) < 2:
            names = ", ".join(wheel.name for wheel in self.wheels)
            raise ValueError(
                f"mass_kg on wheels in one line ({names}), which do not hold a vehicle. Give position_m of every wheel "
                "that carries weight, a castor with driven = false, or load_N of each wheel instead of mass_kg"
            )
        if (shares := self.shares_of_weight()) is not None and (shares <= 0.0).any():
            lifted = self.wheels[int(np.argmin(shares))].name
            raise ValueError(
                f"centre_of_mass_m lifts wheel {lifted} off level ground, expected metres between the wheels; a castor "
                "that carries weight is one of them, with driven = false"
            )
        return self

    @model_validator(mode="after")
    def _some_driven(self) -> Vehicle:
        if self.wheels and all(wheel.driven is False for wheel in self.wheels):
            raise ValueError("driven = false of every wheel, expected one that is driven")
        return self

    def shares_of_weight(
        self, forward_m: np.ndarray | float = 0.0, left_m: np.ndarray | float = 0.0
    ) -> np.ndarray | None:
        """Share of the weight on each wheel [-], (k, ...), the centre of mass moved forward and left [m]; None without
        a mass.

        Of all loads that balance the weight these are the smallest, a plane over the wheels' places: those of a rigid
        vehicle whose wheels are equally stiff.
        """
        if self.mass_kg is None:
            return None
        place = np.array([wheel.position_m for wheel in self.wheels])
        x_m, y_m = place.mean(axis=0) if self.centre_of_mass_m is None else self.centre_of_mass_m[:2]
        moment = np.broadcast_arrays(1.0, x_m + np.asarray(forward_m), y_m + np.asarray(left_m))
        return np.tensordot(np.linalg.pinv(np.vstack([np.ones(len(place)), place.T])), np.stack(moment), axes=1)

    @property
    def identity(self) -> str:
        """Its name, by which it is known again; empty if it has none of its own."""
        return "" if self.name == _UNNAMED else self.name

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
            f"no wheel named {name!r}" if self.wheels else "no wheels",
            expected="one of " + ", ".join(wheel.name for wheel in self.wheels) if self.wheels else "[[wheels]]",
        )


def load_vehicle(path: str | Path) -> Vehicle:
    """Read `vehicle.toml`.

    Raises
    ------
    InputError
        The file is missing, is not TOML, or a key is missing, unknown or out of range; the text names the key.
    """
    data = load_toml(path)
    if not data.keys() & {"wheel", "wheels", "camera", "camera_mount"}:
        raise InputError(path, "no wheel geometry", expected="a [wheel] table with radius_m and width_m, or a [camera]")
    return checked(Vehicle, data, path, {"wheels.0": "wheel"} if "wheels" not in data else {})


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
