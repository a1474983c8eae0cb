"""What an inertial sensor on the body feels along a drive: a rigid body on sprung wheels that rolls over rough ground.

Each wheel meets the profile of its own track, averaged over the length of its contact. Tyre and soil are springs in
series: a wheel that sinks has a longer contact, a softer ground and more damping below it. Contact only pushes; a wheel
may leave the ground. The wheelbase acts as it does on a vehicle: the rear wheels meet the same heights later. Motors
and gears add nothing here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from scipy.signal import butter, sosfilt, sosfilt_zi

from .mechanics import equilibrium
from .plan import STEP_S, Plan
from .roughness import STEP_M, pressed, profiles
from .wheels import WHEEL_MASS_KG, slope

RATE_HZ = 100.0
"""Samples a second that the sensor gives [Hz]."""

CHANNELS = ("wx", "wy", "wz", "ax", "ay", "az")
"""Rates of rotation [rad/s] and specific forces [m/s^2]: x ahead, y to the left, z up."""

G_M_S2 = 9.81

NOISE = (math.radians(0.007), 180e-6 * G_M_S2)
"""Noise densities of rate [rad/s/sqrt(Hz)] and specific force [m/s^2/sqrt(Hz)]: data sheet of the Bosch BMI160."""

BANDWIDTH_HZ = 40.0
"""Of the sensor's own low pass of second order [Hz]: the BMI160 at 100 samples a second has 40.5 Hz."""

RATE_OFFSET_RAD_S = math.radians(0.1)
"""Standard deviation of what the rates read at rest [rad/s]: chosen, as left by a calibration at standstill."""

SENSOR_M = (0.12, 0.05, 0.15)
"""Place of the sensor, ahead, left and above the centre of mass [m]."""

_SUBSTEPS = 10
"""Steps of the simulation in a sample: 1 ms."""

_TYRE_DEFLECTION_M = 0.010
"""Deflection of the tyre below its load [m]: chosen, a stiff tyre."""

_TYRE_DAMPING, _SOIL_DAMPING = 0.05, 0.4
"""Damping ratio of the wheel on its tyre, and what soil adds where all compliance is its own [-]: chosen. Work on fresh
soil is mostly lost (Wong 2010, repetitive loading)."""

_SPRUNG_HZ, _SPRUNG_DAMPING = 2.0, 0.3
"""Natural frequency [Hz] and damping ratio [-] of the body on its springs: chosen, firmer than a car's 1 to 1.5 Hz."""

_GYRATION = 0.9
"""Radius of gyration squared over the product of the axles' distances from the centre of mass [-]: typical of cars."""

_BLEND_M = 0.4
"""Length over which one ground goes over into the next [m]."""

_LEAD_M = 2.0
"""Ground before the start and after the end of the track [m], for wheels ahead of and behind the reference point."""


@dataclass(frozen=True)
class _Contact:
    """The ground of one stretch below each wheel, (w,): length of contact [m], stiffness [N/m], damping [N s/m]."""

    length_m: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray


@dataclass(frozen=True)
class _Body:
    """A rigid body on w wheels, about its centre of mass.

    `arms_m` (w, 2) are places ahead and to the left; `inertia` (3,) is mass [kg], moments of pitch and roll [kg m^2];
    `spring` [N/m] and `damper` [N s/m] (w,) hold it on its wheels.
    """

    arms_m: np.ndarray
    inertia: np.ndarray
    spring: np.ndarray
    damper: np.ndarray

    @staticmethod
    def of(plan: Plan) -> _Body:
        load = np.array(plan.preset.loads_N)
        places = np.array([wheel.position_m for wheel in plan.preset.vehicle.wheels])
        arms = places - load @ places / load.sum()
        share = load / G_M_S2 - WHEEL_MASS_KG
        turn = 2.0 * math.pi * _SPRUNG_HZ
        inertia = np.array([share.sum(), *(_GYRATION * share @ arms**2)])
        return _Body(arms, inertia, share * turn**2, 2.0 * _SPRUNG_DAMPING * share * turn)


def felt(plan: Plan) -> Iterator[np.ndarray]:
    """Yield what the sensor feels, stretch by stretch: (m, 6) as `CHANNELS`, `RATE_HZ` samples a second from time 0 on.

    Raises
    ------
    ValueError
        The vehicle has no wheels on both sides of its centre of mass, ahead and behind: nothing holds the body.
    """
    body = _Body.of(plan)
    if (np.ptp(body.arms_m, axis=0) <= 0).any():
        raise ValueError("a vehicle with wheels ahead and behind, left and right is needed")
    contacts = [_contact(plan, number) for number in range(len(plan.stretches))]
    heights = _ground(plan, contacts)
    grade = np.gradient(heights, STEP_M, axis=1)
    sides = np.array([wheel.position_m[1] <= 0 for wheel in plan.preset.vehicle.wheels]).astype(int)
    ahead = np.array([wheel.position_m[0] for wheel in plan.preset.vehicle.wheels])
    load = np.array(plan.preset.loads_N)
    sections = butter(2, BANDWIDTH_HZ, fs=RATE_HZ * _SUBSTEPS, output="sos")
    rng = plan.generator(4)
    offset = np.concatenate([rng.normal(0.0, RATE_OFFSET_RAD_S, 3), np.zeros(3)])
    noise = np.repeat(NOISE, 3) * math.sqrt(1.11 * BANDWIDTH_HZ)  # what a low pass of second order lets through
    state, memory = np.zeros((2, 3 + len(load))), None
    edges = [0, *(round(s.end_s * RATE_HZ) for s in plan.stretches[:-1]), round(plan.duration_s * RATE_HZ)]
    for first, last in pairwise(edges):
        time = np.arange(first * _SUBSTEPS, last * _SUBSTEPS) / (RATE_HZ * _SUBSTEPS)
        way = plan.at(plan.way_m, time)
        place = way[:, None] + ahead
        number = plan.stretch_at(place)
        stiffness, damping = (
            np.stack([getattr(each, name) for each in contacts])[number, np.arange(len(load))]
            for name in ("stiffness", "damping")
        )
        row = (place + _LEAD_M) / STEP_M
        below, rise = (
            np.stack([np.interp(row[:, i], np.arange(len(part[0])), part[side]) for i, side in enumerate(sides)], 1)
            for part in (heights, grade)
        )
        if not first:
            state[0] = _at_rest(below[0], body.arms_m)
        moved, force = _ride(
            below, stiffness, damping, body.spring, body.damper, body.arms_m, body.inertia, WHEEL_MASS_KG, -load,
            state, 1.0 / (RATE_HZ * _SUBSTEPS),
        )  # fmt: skip
        pushed = -np.sum((load + force) * rise, axis=1) / (load.sum() / G_M_S2)
        raw = _felt_by_body(plan, time, way, moved, pushed)
        if memory is None:
            memory = sosfilt_zi(sections)[:, :, None] * raw[0]  # as after a long rest
        smooth, memory = sosfilt(sections, raw, axis=0, zi=memory)
        sampled = np.asarray(smooth)[_SUBSTEPS - 1 :: _SUBSTEPS]
        yield sampled + offset + noise * rng.standard_normal(sampled.shape)


def _at_rest(below: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Heave, pitch, roll and the wheels' heights, (3 + w,), of a vehicle that stands on heights `below` (w,)."""
    return np.concatenate([np.linalg.lstsq(np.column_stack([np.ones(len(arms)), arms]), below)[0], below])


def _contact(plan: Plan, number: int) -> _Contact:
    """Find how a stretch of ground carries each wheel, at the mean load."""
    soil, load = plan.stretches[number].soil, np.array(plan.preset.loads_N)
    wheel = plan.preset.vehicle.wheels[0]
    tyre = load / _TYRE_DEFLECTION_M
    sinkage, soft = np.zeros(len(load)), np.zeros(len(load))
    stiffness = tyre
    if soil is not None:
        found = equilibrium(wheel.radius_m, wheel.width_m, soil, load, np.full(len(load), 0.1)).sinkage_m
        # Bekker's load of a rigid wheel goes with z^(n + 1/2): so does its derivative, at the load.
        ground = load * (soil.n + 0.5) / found
        sinkage, soft = found, tyre / (tyre + ground)
        stiffness = tyre * ground / (tyre + ground)
    reach = np.sqrt(2.0 * wheel.radius_m * _TYRE_DEFLECTION_M)
    length = reach + np.sqrt(2.0 * wheel.radius_m * (_TYRE_DEFLECTION_M + sinkage))
    ratio = _TYRE_DAMPING + _SOIL_DAMPING * soft
    return _Contact(length, stiffness, 2.0 * ratio * np.sqrt(stiffness * WHEEL_MASS_KG))


def _ground(plan: Plan, contacts: list[_Contact]) -> np.ndarray:
    """Heights of both tracks as wheels meet them, (2, n) [m], from `_LEAD_M` before the start on."""
    apart = float(np.ptp([wheel.position_m[1] for wheel in plan.preset.vehicle.wheels]))
    place = np.arange(-_LEAD_M, float(plan.way_m[-1]) + _LEAD_M + STEP_M, STEP_M)
    heights = np.zeros((2, len(place)))
    for number, (stretch, contact) in enumerate(zip(plan.stretches, contacts, strict=True)):
        first = number == 0
        low = -_LEAD_M if first else stretch.start_m - _BLEND_M
        high = place[-1] if number == len(plan.stretches) - 1 else stretch.end_m + _BLEND_M
        rows = slice(*np.searchsorted(place, [low, high]))
        own = profiles(stretch.terrain, high - low + STEP_M, apart, plan.generator(5000 + number))
        own = pressed(own, float(contact.length_m.mean()))[:, : rows.stop - rows.start]
        here = np.clip((place[rows] - low) / (2.0 * _BLEND_M), 0.0, 1.0) if not first else np.ones(own.shape[1])
        heights[:, rows] = (1.0 - here) * heights[:, rows] + here * own
    return heights


def _felt_by_body(plan: Plan, time: np.ndarray, way: np.ndarray, moved: np.ndarray, pushed: np.ndarray) -> np.ndarray:
    """Rates and specific forces at the sensor, (m, 6), of motion `moved` and horizontal acceleration `pushed` (m,)."""
    heave, pitch, roll, pitch_rate, roll_rate, pitch_change, roll_change = moved.T
    speed = plan.at(plan.speed_m_s, time)
    yaw_rate = plan.at(np.gradient(plan.yaw_rad, STEP_S), time)
    hill = slope(plan, way)
    ahead, left, above = SENSOR_M
    forward = plan.at(np.gradient(plan.speed_m_s, STEP_S), time) + pushed
    return np.column_stack(
        [
            roll_rate,
            -(pitch_rate + np.gradient(hill, time)),  # nose up turns about y the other way
            yaw_rate,
            forward + G_M_S2 * np.sin(pitch + hill) - above * pitch_change,
            speed * yaw_rate + G_M_S2 * np.sin(roll) - above * roll_change,
            G_M_S2 * np.cos(pitch + hill) + heave + ahead * pitch_change + left * roll_change,
        ]
    )


@njit(cache=True, nogil=True)
def _ride(below, stiffness, damping, spring, damper, arms, inertia, wheel_mass, least, state, step):
    """Move the body and its wheels over heights `below` (m, w), by semi-implicit Euler steps [s].

    `state` (2, 3 + w) holds heave, pitch, roll and the wheels' heights, then their rates, and is moved on.
    Gives (m, 7): accelerations of heave, pitch and roll come first and last, pitch, roll and their rates between; and
    the change of each contact's force, (m, w) [N], which `least` (w,) bounds from below.
    """
    m, w = below.shape
    moved, force = np.empty((m, 7)), np.empty((m, w))
    place, rate = state
    change = np.empty(3 + w)
    before = below[0].copy()
    for t in range(m):
        change[:3] = 0.0
        for i in range(w):
            arm_x, arm_y = arms[i]
            corner = place[0] + arm_x * place[1] + arm_y * place[2]
            corner_rate = rate[0] + arm_x * rate[1] + arm_y * rate[2]
            hold = spring[i] * (place[3 + i] - corner) + damper[i] * (rate[3 + i] - corner_rate)
            rising = (below[t, i] - before[i]) / step
            push = stiffness[t, i] * (below[t, i] - place[3 + i]) + damping[t, i] * (rising - rate[3 + i])
            push = max(push, least[i])
            before[i] = below[t, i]
            force[t, i] = push
            change[3 + i] = (push - hold) / wheel_mass
            change[0] += hold / inertia[0]
            change[1] += arm_x * hold / inertia[1]
            change[2] += arm_y * hold / inertia[2]
        rate += step * change
        place += step * rate
        moved[t, 0] = change[0]
        moved[t, 1], moved[t, 2] = place[1], place[2]
        moved[t, 3], moved[t, 4] = rate[1], rate[2]
        moved[t, 5], moved[t, 6] = change[1], change[2]
    return moved, force
