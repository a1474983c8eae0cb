"""The named traverses: where they lead, what goes wrong on the way, and in which vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from ..core.errors import InputError
from ..core.vehicle import Camera, Microphone, Vehicle, Wheel
from .concealed import Concealed

FaultKind = Literal[
    "camera_black", "camera_gap", "camera_truncated", "camera_overexposed", "wind", "engine", "microphone_dropout",
    "wheel_nan",
]  # fmt: skip

CHANNELS = (
    "load_N", "torque_Nm", "sinkage_m", "slip", "wheel_speed_rad_s", "travel_speed_m_s", "wheel_angle_rad", "pitch_rad",
)  # fmt: skip
"""Wheel channels that every preset records, besides the time."""


@dataclass(frozen=True)
class Leg:
    """One stretch of ground of one class: `slow_s` seconds of slip and load sweeps, then `fast_s` seconds fast."""

    terrain: str
    slow_s: float
    fast_s: float

    @property
    def duration_s(self) -> float:
        """How long it takes [s]."""
        return self.slow_s + self.fast_s


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong from `start_s` to `end_s` [s]."""

    kind: FaultKind
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Preset:
    """A traverse.

    Parameters
    ----------
    about
        What it is for, in one line.
    legs
        The ground in order.
    vehicle
        What drives there.
    faults
        What goes wrong, by time.
    drawbar_pull
        Whether the drawbar pull is recorded.
    camera_rate_Hz, sound_rate_Hz
        Images and sound samples a second; None where there is no camera or no microphone.
    inertial
        Whether an inertial sensor records vibration (`vibration.felt`); it takes a vehicle of four wheels.
    fast_speed_m_s
        Speed of the fast phases [m/s].
    sound_start_s
        When the microphone starts, later than the other sensors [s].
    loads_N
        Mean load on each wheel [N].
    concealed
        What the textbook wheel lacks, besides what any drive of the vehicle has (`wheels.physics_of`).
    recorded_as
        Name in `recording.toml` where the preset's own would give away what the drive conceals.
    """

    about: str
    legs: tuple[Leg, ...]
    vehicle: Vehicle
    faults: tuple[Fault, ...] = ()
    drawbar_pull: bool = True
    camera_rate_Hz: float | None = 5.0
    sound_rate_Hz: int | None = 22050
    inertial: bool = False
    wheel_rate_Hz: float = 10.0
    fast_speed_m_s: float = 3.2
    sound_start_s: float = 0.35
    loads_N: tuple[float, ...] = (700.0,)
    concealed: tuple[Concealed, ...] = ()
    recorded_as: str = ""

    @property
    def duration_s(self) -> float:
        """How long the traverse takes as it was laid out [s]."""
        return sum(leg.duration_s for leg in self.legs)

    @property
    def channels(self) -> tuple[str, ...]:
        """Wheel channels recorded, besides the time."""
        return (*CHANNELS, "drawbar_pull_N") if self.drawbar_pull else CHANNELS


SLOW_RIM_SPEED_M_S = 0.28
"""Speed of the rim in slow phases, r omega [m/s]: slip 0.05 to 0.6 makes 0.27 to 0.11 m/s of travel."""

_NOISE = {
    "load_N": 7.0, "torque_Nm": 1.2, "sinkage_m": 0.0006, "drawbar_pull_N": 7.0,
    "wheel_speed_rad_s": 0.005, "travel_speed_m_s": 0.002, "pitch_rad": 0.002,
}  # fmt: skip
"""Standard deviations of the sensors: one to three percent of what they range over."""


def _camera(distortion: tuple[float, ...] = ()) -> Camera:
    return Camera(
        matrix=((420.0, 0.0, 319.5), (0.0, 420.0, 239.5), (0.0, 0.0, 1.0)),
        width_px=640,
        height_px=480,
        height_m=0.9,
        pitch_rad=math.radians(25.0),
        forward_m=0.4,
        distortion=distortion,
        exposure_s=0.012,
    )


def _vehicle(
    name: str, wheels: tuple[Wheel, ...], camera: Camera | None, *, hears: bool = True, pulls: bool = True
) -> Vehicle:
    # Slip is made of the two speeds: its noise in slow phases follows from theirs (at a slip of 0.3, midway).
    rim_noise = 0.7 * wheels[0].radius_m * _NOISE["wheel_speed_rad_s"]
    slip_noise = math.hypot(_NOISE["travel_speed_m_s"], rim_noise) / SLOW_RIM_SPEED_M_S
    microphone = Microphone(position_m=(0.1, 0.3)) if hears else None
    noise = {**_NOISE, "slip": round(slip_noise, 5)}
    if not pulls:
        del noise["drawbar_pull_N"]
    return Vehicle(name=name, wheels=wheels, noise=noise, camera=camera, microphone=microphone)


_ONE_WHEEL = (Wheel(radius_m=0.25, width_m=0.2, name="wheel"),)
_FOUR_WHEELS = tuple(
    Wheel(radius_m=0.25, width_m=0.2, name=name, position_m=place)
    for name, place in (
        ("front_left", (0.45, 0.35)),
        ("front_right", (0.45, -0.35)),
        ("rear_left", (-0.45, 0.35)),
        ("rear_right", (-0.45, -0.35)),
    )
)

_FOUR_LOADS_N = (620.0, 640.0, 720.0, 700.0)
"""Weight on each of the four wheels, a little more on the rear axle [N]."""


def _concealing(recorded_as: str, about: str, cause: Concealed, *, legs: tuple[Leg, ...], four: bool = False) -> Preset:
    """Two minutes of wheel rows, slow with short fast phases, whose cause `bevameter explain` is to find."""
    name, wheels = ("four-wheeled rover", _FOUR_WHEELS) if four else ("single-wheel testbed", _ONE_WHEEL)
    return Preset(
        about=about,
        legs=legs,
        vehicle=_vehicle(name, wheels, None, hears=False),
        camera_rate_Hz=None,
        sound_rate_Hz=None,
        fast_speed_m_s=2.2,
        loads_N=_FOUR_LOADS_N if four else (700.0,),
        concealed=(cause,),
        recorded_as=recorded_as,
    )


_PRESETS: dict[str, Preset] = {
    "demo": Preset(
        about="five minutes on four wheels over sand, gravel, asphalt, loam, grass and clay, with every fault",
        legs=(
            Leg("sand", 32.0, 12.0), Leg("gravel", 32.0, 12.0), Leg("asphalt", 8.0, 12.0), Leg("loam", 32.0, 12.0),
            Leg("grass", 32.0, 12.0), Leg("clay", 32.0, 12.0), Leg("sand", 32.0, 12.0), Leg("gravel", 0.0, 16.0),
        ),
        vehicle=_vehicle("demo vehicle", _FOUR_WHEELS, _camera()),
        loads_N=_FOUR_LOADS_N,
        faults=(
            Fault("camera_overexposed", 60.0, 64.0), Fault("camera_black", 112.0, 117.0),
            Fault("camera_gap", 117.0, 122.0), Fault("camera_truncated", 122.0, 127.0), Fault("wind", 158.0, 176.0),
            Fault("engine", 205.0, 219.0), Fault("microphone_dropout", 252.0, 264.0), Fault("wheel_nan", 286.0, 289.0),
        ),
    ),
    "camera-imu": Preset(
        about="two minutes on four wheels over six grounds with camera and inertial sensor; the camera is often blind",
        legs=(
            Leg("asphalt", 0.0, 14.0), Leg("gravel", 12.0, 14.0), Leg("grass", 0.0, 14.0), Leg("loam", 14.0, 12.0),
            Leg("sand", 14.0, 14.0), Leg("clay", 0.0, 16.0),
        ),
        vehicle=_vehicle("demo vehicle", _FOUR_WHEELS, _camera(), hears=False),
        sound_rate_Hz=None,
        inertial=True,
        loads_N=_FOUR_LOADS_N,
        faults=(
            Fault("camera_black", 18.0, 38.0), Fault("camera_overexposed", 52.0, 56.0), Fault("camera_gap", 68.0, 78.0),
            Fault("camera_truncated", 96.0, 106.0),
        ),
    ),
    "short": Preset(
        about="seventy seconds over sand, loam and grass, each fault once: for tests",
        legs=(Leg("sand", 26.0, 6.0), Leg("loam", 26.0, 6.0), Leg("grass", 0.0, 6.0)),
        vehicle=_vehicle("one-wheeled vehicle", _ONE_WHEEL, _camera()),
        faults=(
            Fault("camera_overexposed", 8.0, 9.0), Fault("camera_black", 18.0, 20.0), Fault("camera_gap", 20.0, 22.0),
            Fault("camera_truncated", 22.0, 24.0), Fault("wind", 34.0, 39.0), Fault("engine", 42.0, 47.0),
            Fault("microphone_dropout", 50.0, 54.0), Fault("wheel_nan", 60.0, 62.0),
        ),
    ),
    "rover4": Preset(
        about="four wheels over sand, clay and gravel, the rear ones in the ruts of the front ones; no drawbar pull",
        legs=(Leg("sand", 30.0, 0.0), Leg("clay", 30.0, 8.0), Leg("gravel", 30.0, 8.0)),
        vehicle=_vehicle("four-wheeled rover", _FOUR_WHEELS, _camera((-0.08, 0.01, 0.0, 0.0)), pulls=False),
        drawbar_pull=False,
        fast_speed_m_s=2.2,
        loads_N=_FOUR_LOADS_N,
    ),
    "sandpit": Preset(
        about="one class only: eighty seconds of sand in one place, with camera and microphone",
        legs=(Leg("sand", 60.0, 20.0),),
        vehicle=_vehicle("one-wheeled vehicle", _ONE_WHEEL, _camera()),
    ),
    "testbed": Preset(
        about="a single wheel over five soils, slowly, without camera or microphone: for identification",
        legs=tuple(Leg(terrain, 60.0, 0.0) for terrain in ("sand", "loam", "gravel", "grass", "clay")),
        vehicle=_vehicle("single-wheel testbed", _ONE_WHEEL, None, hears=False),
        camera_rate_Hz=None,
        sound_rate_Hz=None,
    ),
    "slip-sinkage": _concealing(
        "exercise-1", "conceals slip-sinkage: the sinkage exponent grows with slip, on all ground",
        Concealed("slip_sinkage", {"n1": 0.3}),
        legs=tuple(Leg(terrain, 34.0, 6.0) for terrain in ("sand", "loam", "clay")),
    ),
    "sand-bulldozing": _concealing(
        "exercise-2", "conceals bulldozing on sand: soil piled up ahead costs pull there, and nowhere else",
        Concealed("bulldozing", {"share": 1.0}, terrain="sand"),
        legs=(Leg("loam", 24.0, 8.0), Leg("sand", 64.0, 8.0), Leg("grass", 24.0, 8.0)),
    ),
    "load-gain": _concealing(
        "exercise-3", "conceals a load gain: the wheel's share of the weight is stated 12 % too high",
        Concealed("load_gain", {"g": 0.12}),
        legs=tuple(Leg(terrain, 34.0, 6.0) for terrain in ("sand", "grass", "loam")),
    ),
    "torque-zero": _concealing(
        "exercise-4", "conceals a torque zero: one wheel of four, front_left, reads 9 N m too little",
        Concealed("torque_offset", {"T_0": -9.0}, wheel="front_left"),
        legs=tuple(Leg(terrain, 34.0, 6.0) for terrain in ("sand", "loam", "gravel")), four=True,
    ),
    "drivetrain-friction": _concealing(
        "exercise-5", "conceals drive-train friction: gears and bearings of all four wheels lose torque",
        Concealed("drivetrain_friction", {"T_c": 8.0, "b_v": 1.5}),
        legs=tuple(Leg(terrain, 34.0, 6.0) for terrain in ("loam", "gravel", "clay")), four=True,
    ),
}  # fmt: skip

PRESETS = MappingProxyType(_PRESETS)
"""By name."""


def preset(name: str) -> Preset:
    """Give the preset of that name; raises `InputError` listing the names where there is none."""
    if name not in PRESETS:
        raise InputError("scenario", f"no preset {name!r}", expected="one of " + ", ".join(PRESETS))
    return PRESETS[name]
