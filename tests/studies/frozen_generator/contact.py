"""The textbook wheel: stresses along a rigid rim, integrated and balanced against the load.

Baseline equations as numbered in the terrain-estimation paper (Eq. 1-9), which go back to Reece 1965
(pressure-sinkage),
Janosi & Hanamoto 1961 (shear build-up) and Wong & Reece 1967 (stresses about the rim). Effects change a `Contact`
before it
is solved; with nothing changed it is the paper's wheel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray
PressureTerm = Callable[[Array, Array], Array]
SMALLEST_ANGLE, LARGEST_ANGLE = 1e-3, 1.45


@dataclass(frozen=True)
class Wheel:
    """Rigid wheel: radius and width in metres, lugs where there are any."""

    radius: float
    width: float
    grouser_height: float = 0.0
    grouser_count: int = 0


@dataclass(frozen=True)
class Soil:
    """The five parameters of the textbook soil, SI units; `stiffness` is k1 + k2 b of Eq. 6."""

    cohesion: float
    friction_angle: float
    shear_modulus: float
    stiffness: float
    exponent: float


def janosi(displacement: Array, modulus: Array) -> Array:
    """Mobilised share of the shear strength (Janosi & Hanamoto 1961)."""
    return -np.expm1(-displacement / modulus)


@dataclass
class Contact:
    """Everything that decides the stresses under the wheel, one value a row; effects change it in place."""

    load: Array
    slip: Array
    radius: Array
    width: float
    cohesion: Array
    tan_friction: Array
    shear_modulus: Array
    stiffness: Array
    exponent: Array
    peak_fraction: Array  # theta_m / theta_1
    exit_ratio: Array  # 0: no contact behind bottom-dead-centre
    exit_by_depth: bool = False  # exit_ratio is one of depths (Ishigami 2007) instead of angles
    lug_reach: Array | float = 0.0  # shear surface outside the rim, m
    deflection: Array | float = 0.0  # flattening of a tyre, m
    build_up: Callable[[Array, Array], Array] = janosi
    strength: Callable[[Array, Array], Array] | None = None  # (stress, Mohr-Coulomb strength) -> strength
    rim_limit: Callable[[Array], Array] | None = None  # cap on the shear stress, from the normal stress
    pressure_terms: list[PressureTerm] = field(default_factory=list)  # (depth, pressure) -> pressure


@dataclass
class Reaction:
    """What the contact answers, one value a row."""

    entry_angle: Array
    sinkage: Array
    torque: Array
    pull: Array


def textbook_contact(wheel: Wheel, soil: Soil, load: Array, slip: Array) -> Contact:
    """Contact of the paper's wheel on a soil."""
    load, slip = np.asarray(load, float), np.asarray(slip, float)
    rows = np.ones_like(load)
    return Contact(
        load=load.copy(),
        slip=slip.copy(),
        radius=wheel.radius * rows,
        width=wheel.width,
        cohesion=soil.cohesion * rows,
        tan_friction=np.tan(soil.friction_angle) * rows,
        shear_modulus=soil.shear_modulus * rows,
        stiffness=soil.stiffness * rows,
        exponent=soil.exponent * rows,
        peak_fraction=0.5 * rows,
        exit_ratio=0.0 * rows,
    )


def _cubic_simpson(intervals: int) -> tuple[Array, Array]:
    """Places u and weights of Simpson's rule in s for u = s**3 on [0, 1].

    The stresses leave their ends like a power n of the distance, which the cube smooths.
    """
    s = np.linspace(0.0, 1.0, intervals + 1)
    weight = np.where(np.arange(intervals + 1) % 2 == 1, 4.0, 2.0)
    weight[[0, -1]] = 1.0
    return s**3, weight / (3.0 * intervals) * 3.0 * s**2


_RULES: dict[int, tuple[Array, Array]] = {}


def forces(contact: Contact, entry_angle: Array, intervals: int = 28) -> tuple[Array, Array, Array, Array]:
    """Load carried, drawbar pull, torque and sinkage (Eq. 2-4, 7) of a wheel that meets the soil at `entry_angle`."""
    if intervals not in _RULES:
        _RULES[intervals] = _cubic_simpson(intervals)
    u, weight = _RULES[intervals]
    theta_1 = entry_angle[:, None]
    versine = 2.0 * np.sin(0.5 * theta_1) ** 2
    nominal = contact.radius[:, None]
    deflection = np.broadcast_to(contact.deflection, entry_angle.shape)[:, None]
    # Circle that replaces a flattened tyre, D*/D = (sqrt(1 + f/z) + sqrt(f/z))^2 (Schmid 1995), solved for theta_1
    radius = nominal + 2.0 * np.sqrt(deflection * nominal / versine)
    shear_radius = radius + np.broadcast_to(contact.lug_reach, entry_angle.shape)[:, None]
    lever = np.where(deflection > 0.0, nominal - deflection, shear_radius)
    theta_m = contact.peak_fraction[:, None] * theta_1
    ratio = contact.exit_ratio[:, None]
    theta_2 = -np.arccos(1.0 - np.clip(ratio * versine, 0.0, 1.0)) if contact.exit_by_depth else -ratio * theta_1

    ahead = theta_1 - (theta_1 - theta_m) * u
    behind = theta_2 + (theta_m - theta_2) * u  # Eq. 9 gives it the pressure of `ahead` at the same u
    sine_1, cosine_ahead = np.sin(theta_1), np.cos(ahead)
    depth = radius * np.maximum(cosine_ahead - np.cos(theta_1), 0.0)
    pressure = contact.stiffness[:, None] * (depth / contact.width) ** contact.exponent[:, None]
    for term in contact.pressure_terms:
        pressure = term(depth, pressure)

    limit = contact.cohesion[:, None] + pressure * contact.tan_friction[:, None]
    if contact.strength is not None:
        limit = contact.strength(pressure, limit)
    cap = None if contact.rim_limit is None else contact.rim_limit(pressure)
    carried, pull, torque = 0.0, 0.0, 0.0
    parts = ((ahead, cosine_ahead, theta_1 - theta_m), (behind, np.cos(behind), theta_m - theta_2))
    for theta, cosine, span in parts:
        sine = np.sin(theta)
        travelled = theta_1 - theta - (1.0 - contact.slip[:, None]) * (sine_1 - sine)
        shear = limit * contact.build_up(shear_radius * travelled, contact.shear_modulus[:, None])
        if cap is not None:
            shear = np.minimum(shear, cap)
        area = span * weight * contact.width
        normal_area, shear_area = radius * area, shear_radius * area
        carried = carried + np.sum(normal_area * pressure * cosine + shear_area * shear * sine, axis=1)
        pull = pull + np.sum(shear_area * shear * cosine - normal_area * pressure * sine, axis=1)
        torque = torque + np.sum(lever * shear_area * shear, axis=1)
    return carried, pull, torque, (radius * versine)[:, 0]


def _bracket(residual: Callable[[Array], Array], guess: Array | None, rows: int) -> tuple[Array, Array, Array, Array]:
    """Two entry angles a row with the root between them, narrow about a guess where it holds."""
    if guess is None:
        low, high = np.full(rows, 0.02), np.full(rows, 1.2)
    else:
        low, high = np.clip(0.9 * guess, SMALLEST_ANGLE, 1.3), np.clip(1.1 * guess, 2 * SMALLEST_ANGLE, LARGEST_ANGLE)
    at_low, at_high = residual(low), residual(high)
    if np.any(at_low > 0.0):
        low = np.where(at_low > 0.0, SMALLEST_ANGLE, low)
        at_low = np.minimum(residual(low), 0.0)
    if np.any(at_high < 0.0):
        high = np.where(at_high < 0.0, LARGEST_ANGLE, high)
        at_high = np.maximum(residual(high), 0.0)
    return low, high, at_low, at_high


def _secant(residual: Callable[[Array], Array], guess: Array) -> Array | None:
    """Roots next to a good guess, or nothing where it was not good enough."""
    before = np.clip(guess, 2.0 * SMALLEST_ANGLE, 0.99 * LARGEST_ANGLE)
    at_before = residual(before)
    angle = before * (1.0 - np.clip(0.4 * at_before, -0.02, 0.02) + 1e-9)
    for _ in range(4):
        at_angle = residual(angle)
        if np.max(np.abs(at_angle)) < 1e-8:
            return angle
        slope = (at_angle - at_before) / (angle - before)
        if not np.all(slope > 0.0):
            return None
        before, at_before, step = angle, at_angle, at_angle / slope
        angle = np.clip(angle - np.where(step == 0.0, 1e-12, step), SMALLEST_ANGLE, LARGEST_ANGLE)
    return None


def entry_angles(contact: Contact, guess: Array | None = None, intervals: int = 28) -> Array:
    """Entry angle at which the contact carries its load, each row by itself (method of Chandrupatla 1997)."""

    def residual(angle: Array) -> Array:
        return forces(contact, angle, intervals)[0] / contact.load - 1.0

    if guess is not None:
        near = _secant(residual, guess)
        if near is not None:
            return near
    a, b, at_a, at_b = _bracket(residual, guess, len(contact.load))
    fraction = np.where(at_b != at_a, at_a / np.where(at_b != at_a, at_a - at_b, 1.0), 0.5)  # first step: secant
    best, at_best = a, at_a
    for _ in range(60):
        new = a + np.clip(fraction, 1e-9, 1.0 - 1e-9) * (b - a)
        at_new = residual(new)
        same = np.sign(at_new) == np.sign(at_a)
        c, at_c = np.where(same, a, b), np.where(same, at_a, at_b)
        b, at_b = np.where(same, b, a), np.where(same, at_b, at_a)
        a, at_a = new, at_new
        nearer = np.abs(at_a) < np.abs(at_b)
        best, at_best = np.where(nearer, a, b), np.where(nearer, at_a, at_b)
        if np.all((np.abs(at_best) < 1e-10) | (np.abs(b - a) < 1e-12)):
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            xi, phi = (a - b) / (c - b), (at_a - at_b) / (at_c - at_b)
            curved = at_a / (at_b - at_a) * at_c / (at_b - at_c)
            curved = curved + (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b)
            trusted = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi) & np.isfinite(curved)
        fraction = np.where(trusted, curved, 0.5)
    return best


def solve(contact: Contact, guess: Array | None = None, intervals: int = 28) -> Reaction:
    """Balance the contact against its load and give what the wheel answers."""
    angle = entry_angles(contact, guess, intervals)
    _, pull, torque, sinkage = forces(contact, angle, intervals)
    return Reaction(angle, sinkage, torque, pull)


def stiffness_for(wheel: Wheel, soil: Soil, load: float, slip: float, sinkage: float) -> float:
    """Soil stiffness with which the textbook wheel sinks to `sinkage`: the load carried is linear in it."""
    angle = np.array([np.arccos(1.0 - sinkage / wheel.radius)])
    one = np.ones(1)
    contact = textbook_contact(wheel, soil, load * one, slip * one)
    contact.stiffness = 0.0 * one
    by_cohesion = forces(contact, angle)[0][0]
    contact.stiffness = one
    by_pressure = forces(contact, angle)[0][0] - by_cohesion
    return float((load - by_cohesion) / by_pressure)
