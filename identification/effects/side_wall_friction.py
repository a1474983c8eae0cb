"""The buried flanks of the wheel rub on soil."""

from __future__ import annotations

import numpy as np

from .effect import PULL, TORQUE, Contact, Drive, Effect, Parameter, Situation

_STRESS = Parameter("tau_s", "Pa", 0.0, 1e5, 500.0, 3e3)
_BY_DEPTH = Parameter("g_s", "Pa/m", 0.0, 1e7, 1e4, 1e5)


class SideWallFriction(Effect):
    """A shear stress over the buried part of both flanks, by cohesion alike everywhere, brakes rotation and travel."""

    slug = "side_wall_friction"
    form = "stress"
    equation = "T += 2 tau_s A r, DP -= 2 tau_s A; A the buried area of a flank ahead of the axle"
    source = "statics of a shear stress on the buried flanks, after L. Ding et al. (2009)"
    parameters = (_STRESS,)

    def freer(self) -> list[Effect]:
        return [FrictionWithDepth()]

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        theta, radius = contact.theta_1, contact.wheel.radius_m
        area = 0.5 * radius**2 * (theta - np.sin(theta) * np.cos(theta))
        force = 2.0 * self.stress_Pa(contact, values) * area
        channels[:, TORQUE] += force * radius
        channels[:, PULL] -= force

    def stress_Pa(self, contact: Contact, values: np.ndarray) -> float | np.ndarray:
        """Give the mean stress on the flanks [Pa]."""
        return values[0]


class FrictionByDepth(SideWallFriction):
    """The stress grows with depth: by friction."""

    form = "depth"
    equation = "T += 2 g_s z A r, DP -= 2 g_s z A; A the buried area of a flank ahead of the axle"
    parameters = (_BY_DEPTH,)

    def freer(self) -> list[Effect]:
        return []

    def stress_Pa(self, contact: Contact, values: np.ndarray) -> float | np.ndarray:
        return values[0] * contact.sinkage_m


class FrictionWithDepth(FrictionByDepth):
    """By cohesion and by friction, whose pressure grows with depth."""

    form = "stress and depth"
    freed = True
    equation = "T += 2 tau A r, DP -= 2 tau A, tau = tau_s + g_s z; A the buried area of a flank ahead of the axle"
    parameters = (_STRESS, _BY_DEPTH)

    def stress_Pa(self, contact: Contact, values: np.ndarray) -> float | np.ndarray:
        return values[0] + values[1] * contact.sinkage_m


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_NODES, _WEIGHTS = (_NODES + 1.0) / 2.0, _WEIGHTS / 2.0
_DOWN, _AHEAD = (each.ravel() for each in np.meshgrid(_NODES, _NODES))
_SHARE = np.outer(_WEIGHTS, _WEIGHTS).ravel()


class FlankRubbing(Effect):
    """The same stress, but against the way in which each point of a flank moves: below the hub it moves backwards."""

    slug = "side_wall_friction"
    form = "rubbing"
    equation = "F = -2 tau_s integral v/|v| dA over the buried part of a flank, v = omega (V/omega - y, x)"
    source = "Coulomb friction on the flanks (statics); kinematics of a rolling wheel"
    parameters = (_STRESS,)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        along, _, twist = _rubbed(contact)
        channels[:, TORQUE] += 2.0 * values[0] * twist
        channels[:, PULL] -= 2.0 * values[0] * along


class CarryingFlanks(FlankRubbing):
    """The same, and where a flank moves down, ahead of the axle, it carries load."""

    form = "rubbing, carrying"
    equation = f"{FlankRubbing.equation}; W += 2 tau_s integral x/|v/omega| dA"

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.lift_N = contact.lift_N + 2.0 * values[0] * _rubbed(contact)[1]


def _rubbed(contact: Contact) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrals over the buried part of a flank, (n,) each, of the direction in which its points move: along [m2] and
    down [m2], and of its moment about the axle against rotation [m3].
    """
    radius = contact.wheel.radius_m
    surface = radius * np.cos(contact.theta_1)[:, None]
    below = surface + (radius - surface) * _DOWN
    reach = np.sqrt(np.maximum(radius**2 - below**2, 0.0))
    forward, down = np.minimum(contact.advance_m, 1e6 * radius)[:, None] - below, reach * _AHEAD
    area = _SHARE * (radius - surface) * reach / np.maximum(np.hypot(forward, down), 1e-12)
    twist = down**2 - forward * below
    return (area * forward).sum(axis=1), (area * down).sum(axis=1), (area * twist).sum(axis=1)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: torque or drawbar pull has to be measured."""
    if not situation.seen(TORQUE, PULL):
        return ()
    return SideWallFriction(), FrictionByDepth(), FlankRubbing(), CarryingFlanks()
