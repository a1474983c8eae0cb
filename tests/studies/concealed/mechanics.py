"""Mechanics of a rigid wheel on soft soil, with places where an effect can change them.

K. Iagnemma, S. Dubowsky, *Terrain estimation for high-speed rough-terrain autonomous vehicle navigation* (2002),
Eq. 1-9; the braked wheel after J. Y. Wong, A. R. Reece, *Prediction of rigid wheel performance based on the analysis of
soil-wheel stresses*, part II (1967). Composite Gauss-Legendre quadrature on the two parts of the contact, each mapped
so that the powers of the normal stress at its ends are smooth, and a bracketed secant (Illinois) for the equilibrium.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

NODES = 12
"""Gauss-Legendre nodes in each of the two parts of the contact: forces within 1e-6 for n from 0.3 to 1.6."""

LEAST_ANGLE, MOST_ANGLE = 0.01, 1.5
"""Between these entry angles the equilibrium is looked for [rad]."""


@dataclass(frozen=True)
class Ground:
    """Soil under the wheel: cohesion [Pa], friction angle [rad], k [m], stiffness k1 + k2 b [Pa], exponent n [-].

    Each is a number, or (m, 1) with one value for each row.
    """

    c_Pa: float | np.ndarray
    phi_rad: float | np.ndarray
    k_m: float | np.ndarray
    stiffness_Pa: float | np.ndarray
    n: float | np.ndarray


@dataclass(frozen=True)
class Body:
    """The wheel: radius r and width b [m], height [m] and number of its lugs."""

    radius_m: float
    width_m: float
    lug_height_m: float = 0.0
    lugs: int = 0


@dataclass(frozen=True)
class Drive:
    """What the wheel does, free of noise; each (m,), SI.

    `lane` tells parallel tracks apart, `run` is the number of a steady trial or -1 in a continuous recording.
    """

    time_s: np.ndarray
    load_N: np.ndarray
    slip: np.ndarray
    wheel_speed: np.ndarray
    travel_speed: np.ndarray
    wheel_acceleration: np.ndarray
    travel_acceleration: np.ndarray
    wheel_angle: np.ndarray
    pitch_rad: np.ndarray
    passes: np.ndarray
    x_m: np.ndarray
    lane: np.ndarray
    run: np.ndarray

    def __len__(self) -> int:
        return len(self.load_N)


@dataclass
class Contact:
    """The contact of every row at the quadrature's nodes, which effects may read and change.

    `theta`, `depth` z(theta) [m], `pressure` sigma [Pa], `displacement` j [m] and `shear` tau [Pa] are (m, q);
    `theta_1`, `theta_2`, `theta_m` and `radius` (of the rim that presses), `shear_radius` (of the surface that shears)
    and `arm` (of its torque) are (m, 1).
    """

    body: Body
    drive: Drive
    ground: Ground
    theta_1: np.ndarray
    theta_2: np.ndarray
    theta_m: np.ndarray
    radius: np.ndarray
    shear_radius: np.ndarray
    arm: np.ndarray
    theta: np.ndarray = field(default_factory=lambda: np.empty(0))
    depth: np.ndarray = field(default_factory=lambda: np.empty(0))
    pressure: np.ndarray = field(default_factory=lambda: np.empty(0))
    displacement: np.ndarray = field(default_factory=lambda: np.empty(0))
    shear: np.ndarray = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class Channels:
    """What the wheel answers, (m,) each, and the load and slip that go with it."""

    load_N: np.ndarray
    slip: np.ndarray
    torque_Nm: np.ndarray
    sinkage_m: np.ndarray
    drawbar_pull_N: np.ndarray

    def answers(self) -> np.ndarray:
        """Give torque, sinkage and drawbar pull, (m, 3)."""
        return np.column_stack([self.torque_Nm, self.sinkage_m, self.drawbar_pull_N])


ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
"""The channels that the model answers, in the order of `Channels.answers`."""


class Change:
    """An effect: every place where one can act. The textbook's wheel has none, and each method here changes nothing."""

    def changes(self, *methods: str) -> bool:
        """Say whether any of these methods, by name, changes something."""
        return any(getattr(type(self), name) is not getattr(Change, name) for name in methods)

    @property
    def acts_in_contact(self) -> bool:
        """Whether the contact is changed, and not only the soil before or the forces after."""
        return self.changes("geometry", "pressing", "shearing")

    def ground(self, ground: Ground, drive: Drive, body: Body) -> Ground:
        """Change the soil by row."""
        return ground

    def geometry(self, contact: Contact) -> None:
        """Change radius, shear radius, exit and peak angle, all (m, 1), in place."""

    def pressing(self, contact: Contact) -> None:
        """Change `contact.pressure`, (m, q), in place."""

    def shearing(self, contact: Contact) -> None:
        """Change `contact.shear`, (m, q), in place."""

    def forces(self, channels: Channels, drive: Drive, ground: Ground, body: Body) -> Channels:
        """Change the forces of the wheel at equilibrium, or its sinkage."""
        return channels

    def reported(self, channels: Channels, drive: Drive) -> Channels:
        """Change what the instruments report."""
        return channels


def _rule(nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1] for a part of the contact, measured from its end where sigma is a power: u = v^3."""
    v, w = np.polynomial.legendre.leggauss(nodes)
    v, w = 0.5 * (v + 1.0), 0.5 * w
    return v**3, 3.0 * w * v**2


_RULES = {nodes: _rule(nodes) for nodes in (8, NODES)}


def travel_ratio(slip: np.ndarray) -> np.ndarray:
    """Give V/(r omega): 1 - i when driving, 1/(1 + i) when braking (slip i as in CONTRACTS.md)."""
    return np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + np.minimum(slip, 0.0)))


def loaded(
    theta_1: np.ndarray, slip: np.ndarray, ground: Ground, body: Body, drive: Drive, changes: Sequence[Change] = (),
    nodes: int = NODES,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Give load, torque, drawbar pull (Eq. 2-4) and sinkage (Eq. 7) at given entry angles.

    Parameters
    ----------
    theta_1 : (m,)
        Entry angle [rad].
    slip : (m,)
        Slip of the wheel [-].
    ground
        Soil, already changed by row.
    body, drive, changes
        The wheel, what it does, and what acts beyond the textbook.
    nodes
        Quadrature nodes in each of the two parts.

    Returns
    -------
    tuple of np.ndarray
        W [N], T [N m], DP [N], z [m], each (m,).
    """
    column = theta_1[:, None]
    radius = np.full_like(column, body.radius_m)
    contact = Contact(body, drive, ground, column, np.zeros_like(column), column / 2.0, radius, radius, radius)
    for change in changes:
        change.geometry(contact)
    weight = _place(contact, nodes)
    _press(contact)
    for change in changes:
        change.pressing(contact)
    _shear(contact, slip)
    for change in changes:
        change.shearing(contact)
    sine, cosine = np.sin(contact.theta), np.cos(contact.theta)
    sigma = contact.pressure * weight * (contact.radius * body.width_m)
    tau = contact.shear * weight * (contact.shear_radius * body.width_m)
    load = np.sum(sigma * cosine + tau * sine, axis=1)
    pull = np.sum(tau * cosine - sigma * sine, axis=1)
    torque = contact.arm[:, 0] * np.sum(tau, axis=1)
    return load, torque, pull, contact.radius[:, 0] * (1.0 - np.cos(theta_1))


def _place(contact: Contact, nodes: int) -> np.ndarray:
    """Lay the nodes of both parts, (m, 2 q), and give their weights [rad]."""
    share, weight = _RULES[nodes]
    front = contact.theta_1 - contact.theta_m
    rear = contact.theta_m - contact.theta_2
    contact.theta = np.concatenate([contact.theta_1 - front * share, contact.theta_2 + rear * share], axis=1)
    # behind the peak the pressure is that of the angle ahead of it in the same proportion (Eq. 9)
    depth = contact.radius * (np.cos(contact.theta_1 - front * share) - np.cos(contact.theta_1))
    depth = np.maximum(depth, 0.0)  # rounding
    contact.depth = np.concatenate([depth, depth], axis=1)
    return np.concatenate([front * weight, rear * weight], axis=1)


def _press(contact: Contact) -> None:
    """Normal stress in Reece's form (Eq. 6); behind the peak it is the same as ahead of it."""
    depth = contact.depth[:, : contact.depth.shape[1] // 2]
    pressure = contact.ground.stiffness_Pa * (depth / contact.body.width_m) ** contact.ground.n
    contact.pressure = np.concatenate([pressure, pressure], axis=1)


def _shear(contact: Contact, slip: np.ndarray) -> None:
    """Shear displacement and stress (Eq. 1 and 5), against the motion where the rim is slower than the ground."""
    ratio = travel_ratio(slip)[:, None]
    turned = contact.theta_1 - contact.theta
    run = np.sin(contact.theta_1) - np.sin(contact.theta)
    contact.displacement = contact.shear_radius * (turned - ratio * run)
    strength = contact.ground.c_Pa + contact.pressure * np.tan(contact.ground.phi_rad)
    built_up = -np.expm1(-np.abs(contact.displacement) / contact.ground.k_m)
    contact.shear = strength * np.sign(contact.displacement) * built_up


def equilibrium(
    ground: Ground, body: Body, drive: Drive, changes: Sequence[Change] = (), *, nodes: int = NODES,
    slip: np.ndarray | None = None, load_N: np.ndarray | None = None, guess: np.ndarray | None = None,
    tolerance: float = 1e-9,
) -> tuple[np.ndarray, Ground]:  # fmt: skip
    """Find the entry angles that carry the load.

    Returns
    -------
    theta_1 : (m,)
        Entry angle [rad]; NaN where no angle below `MOST_ANGLE` carries the load.
    ground
        The soil with the changes by row.
    """
    slip = drive.slip if slip is None else slip
    load = drive.load_N if load_N is None else load_N
    for change in changes:
        ground = change.ground(ground, drive, body)
    acting = [change for change in changes if change.acts_in_contact]

    def miss(log_angle: np.ndarray) -> np.ndarray:
        carried = loaded(np.exp(log_angle), slip, ground, body, drive, acting, nodes)[0]
        return np.log(np.maximum(carried, 1e-9 * load)) - np.log(load)

    low, high = np.full_like(load, np.log(LEAST_ANGLE)), np.full_like(load, np.log(MOST_ANGLE))
    if guess is not None:
        start = np.log(np.clip(guess, LEAST_ANGLE, MOST_ANGLE))
        low, high = np.maximum(low, start - 0.1), np.minimum(high, start + 0.1)
    root = _illinois(miss, low, high, tolerance)
    return np.exp(root), ground


def _illinois(function, low: np.ndarray, high: np.ndarray, tolerance: float) -> np.ndarray:
    """Find the roots of a function that rises with each element, (m,): regula falsi with Illinois's weights.

    The brackets are widened once to the whole range where they hold no root; NaN where that holds none.
    """
    f_low, f_high = function(low), function(high)
    if np.any((f_low > 0) | (f_high < 0)):
        low = np.where(f_low > 0, np.log(LEAST_ANGLE), low)
        high = np.where(f_high < 0, np.log(MOST_ANGLE), high)
        f_low, f_high = function(low), function(high)
    lost = (f_low > 0) | (f_high < 0) | ~np.isfinite(f_low + f_high)
    side = np.zeros(len(low))
    middle = low
    for step in range(60):
        slope = f_high - f_low
        middle = np.where(slope > 0, (low * f_high - high * f_low) / np.where(slope > 0, slope, 1.0), low)
        if step % 8 == 7:  # a bisection now and then bounds the worst case
            middle = 0.5 * (low + high)
        value = function(middle)
        if np.all((np.abs(value) < tolerance) | lost):
            break
        up = value > 0
        high, low = np.where(up, middle, high), np.where(up, low, middle)
        f_low = np.where(up, np.where(side == 1, 0.5 * f_low, f_low), value)
        f_high = np.where(up, value, np.where(side == -1, 0.5 * f_high, f_high))
        side = np.where(up, 1, -1)
    return np.where(lost, np.nan, middle)


def simulate(
    ground: Ground, body: Body, drive: Drive, changes: Sequence[Change] = (), *, nodes: int = NODES,
    slip: np.ndarray | None = None, load_N: np.ndarray | None = None, guess: np.ndarray | None = None,
) -> tuple[Channels, np.ndarray]:  # fmt: skip
    """Give what ideal sensors, but for faults among the changes, report of a drive, and the entry angles.

    Parameters
    ----------
    ground
        Soil, the same everywhere or by row.
    slip, load_N : (m,)
        Instead of the drive's own.
    guess : (m,)
        Entry angles near the answer, which save time [rad].
    """
    slip = drive.slip if slip is None else slip
    load = drive.load_N if load_N is None else load_N
    drive = replace(drive, slip=slip, load_N=load)
    theta_1, soil = equilibrium(ground, body, drive, changes, nodes=nodes, guess=guess)
    acting = [change for change in changes if change.acts_in_contact]
    _, torque, pull, sinkage = loaded(theta_1, slip, soil, body, drive, acting, nodes)
    channels = Channels(load, slip, torque, sinkage, pull)
    for change in changes:
        channels = change.forces(channels, drive, soil, body)
    for change in changes:
        channels = change.reported(channels, drive)
    return channels, theta_1
