"""What the wheels feel along a drive: the full stress equations (paper Eq. 1-9) and, at speed, what comes on top."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..core.vehicle import Vehicle, Wheel
from .concealed import Concealed, strength
from .mechanics import bulldozing_resistance, equilibrium
from .plan import STEP_S, Plan
from .soils import HARD_FRICTION, HARD_ROLLING, HARD_SLIP_RATE

WHEEL_INERTIA_KG_M2 = 1.1
"""Moment of inertia of a wheel with its drive's rotor, geared up [kg m^2]."""

WHEEL_MASS_KG = 15.0
"""Unsprung mass of a wheel [kg]."""

VARIATION = 0.03
"""Standard deviation of cohesion and stiffness within one place, relative [-]; it goes along with the place."""

VARIATION_LENGTH_M = 0.8
"""How far apart two spots are before their soils have little in common [m]."""

RUT_STIFFENING = 1.35
"""Stiffness of soil in a rut over that of fresh soil [-]: a second pass meets what the first compacted (Holm 1969)."""

_PITCH_TO_LOAD = 0.6
"""Share of the weight that moves to the rear for a radian of pitch [-]: height of the centre of mass over wheelbase."""

_NAN_CHANNELS = ("torque_Nm", "sinkage_m")


@dataclass(frozen=True)
class WheelRows:
    """Wheel rows of a recording, in order of time: what was recorded, and the same without any sensor's noise."""

    recorded: dict[str, np.ndarray]
    true: dict[str, np.ndarray]
    wheel: np.ndarray


def wheel_rows(plan: Plan) -> WheelRows:
    """Compute the wheel channels of a drive, each (n,) with n = times x wheels.

    In slow phases every row is a wheel in equilibrium with its soil. At speed the load bounces, the drive's torque
    also turns the wheel faster, and part of the pull moves the wheel itself, so that Eq. 2-4 no longer hold between the
    recorded channels. What the preset conceals comes on top: physics in both `true` and `recorded`, faults of
    instruments in `recorded` only.
    """
    time = np.arange(0.0, plan.duration_s, 1.0 / plan.preset.wheel_rate_Hz)
    wheels = plan.preset.vehicle.wheels
    sides = list(dict.fromkeys(wheel.position_m[1] for wheel in wheels))
    fields = {side: [_soil_variation(plan, 2 * sides.index(side) + index) for index in range(2)] for side in sides}
    parts = [_one_wheel(plan, time, index, fields[wheel.position_m[1]]) for index, wheel in enumerate(wheels)]
    order = np.argsort(np.concatenate([time] * len(wheels)), kind="stable")
    true = {name: np.concatenate([part[name] for part in parts])[order] for name in parts[0]}
    names = np.repeat([wheel.name for wheel in wheels], len(time))[order]
    return WheelRows(_sensed(plan, true, names), true, names)


def physics_of(vehicle: Vehicle) -> tuple[Concealed, ...]:
    """Give what any drive of the vehicle has that the textbook wheel lacks: inertia, and ruts where axles follow."""
    inertia = Concealed("inertia", {"J": WHEEL_INERTIA_KG_M2, "m": WHEEL_MASS_KG})
    if all(_pass(wheel) == 1 for wheel in vehicle.wheels):
        return (inertia,)
    # In the catalogue's form ln stiffness grows by A (1 - exp(-(N - 1) / N0)) with the number of passes N.
    compaction = {"A": math.log(RUT_STIFFENING) / -math.expm1(-1.0), "B": 0.0, "N0": 1.0}
    return inertia, Concealed("multipass_compaction", compaction)


def slope(plan: Plan, way_m: np.ndarray) -> np.ndarray:
    """Slope of the ground along the track [rad], nose up positive: gentle waves, (n,)."""
    rng = plan.generator(1)
    waves = [(rng.uniform(0.6, 1.2), length, rng.uniform(0.0, 6.3)) for length in (11.0, 23.0, 47.0)]
    heights = [a * np.sin(2.0 * np.pi * way_m / length + p) for a, length, p in waves]
    return math.radians(0.9) * np.sum(heights, axis=0)


def _soil_variation(plan: Plan, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Relative variation of the soil along the track: places [m] and values, an autoregressive series."""
    rng = plan.generator(10 + index)
    step = 0.02
    place = np.arange(-5.0, float(plan.way_m[-1]) + 5.0, step)
    reach = np.arange(-3.0 * VARIATION_LENGTH_M, 3.0 * VARIATION_LENGTH_M, step)
    window = np.exp(-0.5 * (reach / (0.5 * VARIATION_LENGTH_M)) ** 2)
    white = rng.standard_normal(len(place) + len(window) - 1)
    return place, VARIATION * np.convolve(white, window / np.linalg.norm(window), mode="valid")


def _one_wheel(
    plan: Plan, time: np.ndarray, index: int, fields: list[tuple[np.ndarray, np.ndarray]]
) -> dict[str, np.ndarray]:
    wheel = plan.preset.vehicle.wheels[index]
    rng = plan.generator(100 + index)
    speed, slip = plan.at(plan.speed_m_s, time), plan.at(plan.slip, time)
    omega = plan.speed_m_s / (wheel.radius_m * (1.0 - plan.slip))
    spin, push = np.gradient(omega, STEP_S), np.gradient(plan.speed_m_s, STEP_S)
    way = plan.at(plan.way_m, time)
    pitch = slope(plan, way)
    load = _load(plan, time, index, pitch, rng)
    torque, sinkage, pull = _ground_forces(plan, wheel, way + wheel.position_m[0], load, slip, fields)
    torque = torque + WHEEL_INERTIA_KG_M2 * plan.at(spin, time) + _friction(plan, wheel, plan.at(omega, time))
    pull = pull - WHEEL_MASS_KG * plan.at(push, time)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (omega[1:] + omega[:-1]) * STEP_S)])
    rows = {
        "time_s": time,
        "load_N": load,
        "torque_Nm": torque,
        "sinkage_m": sinkage,
        "slip": slip,
        "wheel_speed_rad_s": plan.at(omega, time),
        "travel_speed_m_s": speed,
        "wheel_angle_rad": plan.at(angle, time),
        "pitch_rad": pitch,
        "drawbar_pull_N": pull,
    }
    if len(plan.preset.vehicle.wheels) > 1:
        rows["pass"] = np.full(len(time), float(_pass(wheel)))
    return rows


def _pass(wheel: Wheel) -> int:
    return 2 if wheel.position_m[0] < 0 else 1


def _load(plan: Plan, time: np.ndarray, index: int, pitch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Load on the wheel [N]: weight shifted to and fro when slow, bouncing when fast, moved rearwards by the slope."""
    mean = plan.preset.loads_N[index]
    rear = plan.preset.vehicle.wheels[index].position_m[0] < 0
    shift = 0.38 * np.sin(2.0 * np.pi * time / 13.0 + rng.uniform(0.0, 6.3))
    shift += 0.10 * np.sin(2.0 * np.pi * time / 4.7 + rng.uniform(0.0, 6.3))
    bounce = sum(
        rng.uniform(0.08, 0.16) * np.sin(2.0 * np.pi * f * time + rng.uniform(0.0, 6.3)) for f in (1.6, 2.3, 3.7)
    )
    fast = np.clip((plan.at(plan.speed_m_s, time) - 0.4) / 2.0, 0.0, 1.2)
    share = (1.0 - np.minimum(fast, 1.0)) * shift + fast * bounce + (1 if rear else -1) * _PITCH_TO_LOAD * pitch
    return mean * np.maximum(1.0 + share, 0.15)


def _ground_forces(
    plan: Plan,
    wheel: Wheel,
    way: np.ndarray,
    load: np.ndarray,
    slip: np.ndarray,
    fields: list[tuple[np.ndarray, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Torque [N m], sinkage [m] and drawbar pull [N] of a wheel in equilibrium with the ground where it stands."""
    torque, sinkage, pull = (np.empty(len(way)) for _ in range(3))
    cohesion, stiffness = (1.0 + np.interp(way, place, values) for place, values in fields)
    for number, stretch in enumerate(plan.stretches):
        rows = plan.stretch_at(way) == number
        if stretch.soil is None:
            grip = HARD_FRICTION * load[rows] * -np.expm1(-HARD_SLIP_RATE * slip[rows])
            torque[rows], sinkage[rows] = grip * wheel.radius_m, 0.0
            pull[rows] = grip - HARD_ROLLING * load[rows]
            continue
        firm = stiffness[rows] * (RUT_STIFFENING if _pass(wheel) > 1 else 1.0)
        place = {"terrain": stretch.terrain, "wheel": wheel.name}
        found = equilibrium(
            wheel.radius_m, wheel.width_m, stretch.soil, load[rows], slip[rows], cohesion=cohesion[rows],
            stiffness=firm, slip_sinkage=strength(plan.preset.concealed, "slip_sinkage", "n1", **place),
        )  # fmt: skip
        pushed = strength(plan.preset.concealed, "bulldozing", "share", **place)
        torque[rows], sinkage[rows] = found.torque_Nm, found.sinkage_m
        resistance = bulldozing_resistance(wheel.width_m, stretch.soil, found.sinkage_m)
        pull[rows] = found.drawbar_pull_N - pushed * resistance
    return torque, sinkage, pull


def _friction(plan: Plan, wheel: Wheel, omega: np.ndarray) -> np.ndarray:
    """Torque lost in gears and bearings [N m], T_c + b_v omega: B. Armstrong-Helouvry et al., Automatica 30 (1994)."""
    coulomb, viscous = (
        strength(plan.preset.concealed, "drivetrain_friction", name, wheel=wheel.name) for name in ("T_c", "b_v")
    )
    return coulomb * np.sign(omega) + viscous * omega


def _sensed(plan: Plan, true: dict[str, np.ndarray], names: np.ndarray) -> dict[str, np.ndarray]:
    """Add faults of instruments and noise, make slip of the two speeds as sensed, and lose what a fault takes away."""
    rng = plan.generator(2)
    noise = plan.preset.vehicle.noise
    sensed = {"time_s": true["time_s"]}
    reported = _reported(plan, true, names)
    for name in plan.preset.channels:
        sensed[name] = reported[name] + noise.get(name, 0.0) * rng.standard_normal(len(names))
    radius = {wheel.name: wheel.radius_m for wheel in plan.preset.vehicle.wheels}
    rim = sensed["wheel_speed_rad_s"] * np.array([radius[name] for name in names])
    travel = sensed["travel_speed_m_s"]
    sensed["slip"] = np.where(rim >= travel, 1.0 - travel / rim, rim / travel - 1.0)
    lost = plan.fault("wheel_nan", true["time_s"])
    for name in _NAN_CHANNELS:
        sensed[name] = np.where(lost, np.nan, sensed[name])
    if "pass" in true:
        sensed["pass"] = true["pass"]
    return sensed


def _reported(plan: Plan, true: dict[str, np.ndarray], names: np.ndarray) -> dict[str, np.ndarray]:
    """Give what instruments with wrong gains and zeros make of the true channels."""
    gain, zero = np.ones(len(names)), np.zeros(len(names))
    for wheel in plan.preset.vehicle.wheels:
        rows = names == wheel.name
        gain[rows] += strength(plan.preset.concealed, "load_gain", "g", wheel=wheel.name)
        zero[rows] = strength(plan.preset.concealed, "torque_offset", "T_0", wheel=wheel.name)
    return {**true, "load_N": true["load_N"] * gain, "torque_Nm": true["torque_Nm"] + zero}
