"""The buried flanks of the wheel rub on soil."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import PULL, TORQUE, Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_MOST_Pa, _MOST_Pa_m = 1e5, 1e7

_USUAL = 0.5
"""Stress on the flanks, which are pressed less than the rim, as a share of the soil's strength below the rim [-]."""

_PRIOR = "engineering judgement: half the soil's strength below the rim, for flanks are pressed less"


@register
class SideWallFriction(Effect):
    """A shear stress over the buried part of both flanks, by cohesion uniform, resists rotation and travel.

    Parameters
    ----------
    usual_Pa, depth_m
        Usual stress on the flanks, and the depth at which it is reached where it grows with depth.
    """

    slug = "side_wall_friction"
    title = "side-wall friction"
    what_happens = "the buried flanks of the wheel rub on soil"
    check = "drive the same with smooth, greased discs at the sides of the wheel, or with a narrower wheel"
    of_any_wheel = True
    belongs_to = "ground"
    form = "stress"
    equation = "T += 2 tau_s A r, DP -= 2 tau_s A; A the buried area of a flank ahead of the axle"
    source = "statics of a shear stress on the buried flanks, after L. Ding et al. (2009)"
    changes = (TORQUE, PULL)
    _with: tuple[bool, bool] = True, False
    """Whether there is a stress at the surface, and one that grows with depth."""

    def __init__(self, usual_Pa: float, depth_m: float) -> None:
        self._usual = usual_Pa, depth_m
        stress, growth = min(usual_Pa, _MOST_Pa), min(usual_Pa / depth_m, _MOST_Pa_m)
        every = (
            Parameter("tau_s", "Pa", 0.0, _MOST_Pa, 0.2 * stress, stress, _PRIOR),
            Parameter("g_s", "Pa/m", 0.0, _MOST_Pa_m, 0.2 * growth, growth, f"{_PRIOR}, at the usual sinkage"),
        )
        self.parameters = tuple(each for each, there in zip(every, self._with, strict=True) if there)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        if not situation.measures(*cls.changes):
            return ()
        usual = _USUAL * situation.strength_Pa, situation.depth_m
        return SideWallFriction(*usual), FrictionByDepth(*usual), FlankRubbing(*usual), CarryingFlanks(*usual)

    def extensions(self) -> list[Effect]:
        return [FrictionWithDepth(*self._usual)]

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
    _with = False, True

    def extensions(self) -> list[Effect]:
        return []

    def stress_Pa(self, contact: Contact, values: np.ndarray) -> float | np.ndarray:
        return values[0] * contact.sinkage_m


class FrictionWithDepth(FrictionByDepth):
    """By cohesion and by friction, whose pressure grows with depth."""

    form = "stress and depth"
    equation = "T += 2 tau A r, DP -= 2 tau A, tau = tau_s + g_s z; A the buried area of a flank ahead of the axle"
    _with = True, True

    def stress_Pa(self, contact: Contact, values: np.ndarray) -> float | np.ndarray:
        return values[0] + values[1] * contact.sinkage_m


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_NODES, _WEIGHTS = (_NODES + 1.0) / 2.0, _WEIGHTS / 2.0
_DOWN, _AHEAD = (each.ravel() for each in np.meshgrid(_NODES, _NODES))
_SHARE = np.outer(_WEIGHTS, _WEIGHTS).ravel()


class FlankRubbing(SideWallFriction):
    """The same stress, but against the motion of each point of a flank: below the hub it moves backwards."""

    form = "rubbing"
    equation = "F = -2 tau_s integral v/|v| dA over the buried part of a flank, v = omega (V/omega - y, x)"
    source = "Coulomb friction on the flanks (statics); kinematics of a rolling wheel"

    def extensions(self) -> list[Effect]:
        return [RubbingWithDepth(*self._usual)]

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        along, _, twist = _rubbed(contact, values)
        channels[:, TORQUE] += 2.0 * twist
        channels[:, PULL] -= 2.0 * along


class RubbingWithDepth(FlankRubbing):
    """The same, by cohesion and by friction, whose pressure grows with depth."""

    form = "rubbing, with depth"
    default_form = False
    equation = "F = -2 integral (tau_s + g_s z) v/|v| dA over the buried part of a flank, v = omega (V/omega - y, x)"
    _with = True, True

    def extensions(self) -> list[Effect]:
        return []


class CarryingFlanks(FlankRubbing):
    """The same, and where a flank moves down, ahead of the axle, it carries load."""

    form = "rubbing, carrying"
    equation = f"{FlankRubbing.equation}; W += 2 tau_s integral x/|v/omega| dA"
    changes = Effect.changes

    def extensions(self) -> list[Effect]:
        return []

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.lift_N = contact.lift_N + 2.0 * _rubbed(contact, values)[1]


def _rubbed(contact: Contact, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrals over the buried part of a flank, (n,) each, of the stress along the motion of its points.

    `values` are the stress at the surface [Pa] and, where it has one, its growth with depth [Pa/m]. The integrals are
    along the track [N], down [N], and against rotation [N m].
    """
    radius = contact.wheel.radius_m
    surface = radius * np.cos(contact.theta_1)[:, None]
    below = surface + (radius - surface) * _DOWN
    reach = np.sqrt(np.maximum(radius**2 - below**2, 0.0))
    forward, down = np.minimum(contact.advance_m, 1e6 * radius)[:, None] - below, reach * _AHEAD
    area = _SHARE * (radius - surface) * reach / np.maximum(np.hypot(forward, down), 1e-12)
    area *= values[0] if len(values) == 1 else values[0] + values[1] * (below - surface)
    twist = down**2 - forward * below
    return (area * forward).sum(axis=1), (area * down).sum(axis=1), (area * twist).sum(axis=1)
