"""Effects at the rim and around it: stresses, and soil that pushes against front and flanks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from .effects import Effect, Setting
from .mechanics import Body, Channels, Contact, Drive, Ground, travel_ratio

HUMP_TOP = 1.0 - math.exp(-1.0)
"""What Janosi's build-up reaches at j = k."""


def flat(value: float | np.ndarray) -> float | np.ndarray:
    """Give a soil's parameter by row as (m,)."""
    return np.asarray(value)[:, 0] if np.ndim(value) == 2 else value


@dataclass(frozen=True)
class StressPeakShift(Effect):
    """The peak of normal stress moves forward with slip: theta_m = (a0 + a1 |i|) theta_1.

    J. Y. Wong, A. R. Reece, *Prediction of rigid wheel performance*, part I (1967), Eq. 11. ``forward``: a0 = 0.5, as
    in the textbook's wheel. ``balanced``: a0 = 0.5 - 0.3 a1, near their 0.43 and 0.32 for compact sand.
    """

    slug = "stress_peak_shift"
    forms = ("forward", "balanced")
    channels = ("torque_Nm", "drawbar_pull_N", "sinkage_m")
    variables = ("slip",)

    @property
    def bounds(self) -> tuple[float, float]:
        """Slopes a1 up to 0.6; Wong and Reece found 0.32 to 0.41."""
        return 0.0, 0.6

    @property
    def a0(self) -> float:
        """Where the peak lies without slip, as a share of theta_1."""
        return 0.5 if self.form == "forward" else 0.5 - 0.3 * self.magnitude

    def parameters(self) -> dict[str, float]:
        """Give a0 and a1 [-]."""
        return {"a0": self.a0, "a1": self.magnitude}

    def geometry(self, contact: Contact) -> None:
        share = np.clip(self.a0 + self.magnitude * np.abs(contact.drive.slip), 0.05, 0.95)[:, None]
        contact.theta_m = contact.theta_m + (share - 0.5) * (contact.theta_1 - contact.theta_2)


@dataclass(frozen=True)
class ExitAngle(Effect):
    """Soil rebounds: contact goes on behind bottom-dead-centre, the peak midway of the whole contact.

    ``proportional``: theta_2 = -s theta_1 (O. Onafeko, A. R. Reece 1967, measured stresses behind the bottom).
    ``rebound``: the soil rises again by s z, theta_2 = -acos(1 - s z/r) (G. Ishigami et al. 2007, Eq. 5).
    """

    slug = "exit_angle"
    forms = ("proportional", "rebound")
    channels = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
    variables = ("load_N", "sinkage_m", "slip")

    @property
    def bounds(self) -> tuple[float, float]:
        """Exit at most 0.7 of the entry angle; rebound of at most half the sinkage."""
        return (0.0, 0.7) if self.form == "proportional" else (0.0, 0.5)

    def parameters(self) -> dict[str, float]:
        """Give the ratio of the angles or of the depths [-]."""
        return {"exit_ratio" if self.form == "proportional" else "rebound_ratio": self.magnitude}

    def geometry(self, contact: Contact) -> None:
        """Lengthen the contact rearwards."""
        if self.form == "proportional":
            exit_angle = -self.magnitude * contact.theta_1
        else:
            exit_angle = -np.arccos(1.0 - self.magnitude * (1.0 - np.cos(contact.theta_1)))
        contact.theta_m = contact.theta_m + 0.5 * (exit_angle - contact.theta_2)
        contact.theta_2 = exit_angle


@dataclass(frozen=True)
class ShearHump(Effect):
    """Shear stress peaks, then falls.

    ``residual``: J. Y. Wong, J. Preston-Thomas (1983): Kr (1 + (1/(Kr (1 - 1/e)) - 1) exp(1 - j/K)) (1 - exp(-j/K)),
    the top at j = K, the residual Kr; the magnitude is 1 - Kr.
    ``decay``: M. G. Bekker, *Theory of Land Locomotion* (1956): the difference of two exponentials over its greatest
    value, (exp(-m j/k) - exp(-j/k)) / y_max; the magnitude is m.
    """

    slug = "shear_hump"
    forms = ("residual", "decay")
    channels = ("torque_Nm", "drawbar_pull_N", "sinkage_m")
    variables = ("slip",)

    @property
    def bounds(self) -> tuple[float, float]:
        """Residual strength from 0.97 to 0.3 of the top; decay up to 0.35 times as fast as the rise."""
        return (0.03, 0.7) if self.form == "residual" else (0.0, 0.35)

    def parameters(self) -> dict[str, float]:
        """Give the residual ratio Kr, or the ratio of the exponentials' lengths [-]."""
        if self.form == "residual":
            return {"residual_ratio": 1.0 - self.magnitude}
        return {"decay_ratio": self.magnitude}

    def shearing(self, contact: Contact) -> None:
        """Put the hump in place of Janosi's build-up."""
        scaled = np.abs(contact.displacement) / contact.ground.k_m
        strength = contact.ground.c_Pa + contact.pressure * np.tan(contact.ground.phi_rad)
        rise = -np.expm1(-scaled)
        if self.form == "residual":
            residual = 1.0 - self.magnitude
            built_up = residual * (1.0 + (1.0 / (residual * HUMP_TOP) - 1.0) * np.exp(1.0 - scaled)) * rise
        else:
            slow = max(self.magnitude, 1e-9)
            top = math.log(1.0 / slow) / (1.0 - slow)
            built_up = (np.exp(-slow * scaled) - np.exp(-scaled)) / (math.exp(-slow * top) - math.exp(-top))
        contact.shear = strength * np.sign(contact.displacement) * built_up


@dataclass(frozen=True)
class RimAdhesion(Effect):
    """Soil slips on the rim before it shears within: adhesion c_a < c and rim friction delta < phi.

    ``replaced``: the rim's c_a + sigma tan delta stands for the soil's strength and builds up as Janosi's does
    (A. R. Reece, *Principles of soil-vehicle mechanics*, 1965). ``capped``: the soil's own shear stress, cut off at
    c_a + sigma tan delta (M. G. Bekker 1956, external friction).
    """

    slug = "rim_adhesion"
    forms = ("replaced", "capped")
    channels = ("torque_Nm", "drawbar_pull_N", "sinkage_m")
    variables = ("slip", "load_N", "sinkage_m")
    adhesion_share: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Draw how much more of the cohesion than of the friction the rim lacks."""
        return cls(form, 0.0, adhesion_share=float(rng.uniform(0.8, 1.2)))

    @property
    def bounds(self) -> tuple[float, float]:
        """A rim that keeps a third of the soil's friction or more."""
        return 0.0, 0.65

    def parameters(self) -> dict[str, float]:
        """Give the rim's share of tan phi and of c [-]."""
        return {"friction_ratio": 1.0 - self.magnitude, "adhesion_ratio": self._adhesion()}

    def _adhesion(self) -> float:
        return max(1.0 - self.adhesion_share * self.magnitude, 0.0)

    def shearing(self, contact: Contact) -> None:
        rubbed = contact.pressure * np.tan(contact.ground.phi_rad) * (1.0 - self.magnitude)
        limit = contact.ground.c_Pa * self._adhesion() + rubbed
        if self.form == "capped":
            contact.shear = np.sign(contact.shear) * np.minimum(np.abs(contact.shear), limit)
            return
        built_up = -np.expm1(-np.abs(contact.displacement) / contact.ground.k_m)
        contact.shear = limit * np.sign(contact.displacement) * built_up


@dataclass(frozen=True)
class Bulldozing(Effect):
    """Soil is pushed up in front of the wheel and holds it back, by m times what a formula gives.

    ``hegedus``: E. Hegedus, *A simplified method for the determination of bulldozing resistance* (1960), a vertical
    blade of depth z, rupture at X = 45 deg - phi/2 (in G. Ishigami et al. 2007, Eq. 15).
    ``passive``: passive earth pressure, b (0.5 gamma z^2 N + 2 c z sqrt N), N = tan^2(45 deg + phi/2) (M. G. Bekker
    1969; E. McKyes, *Soil Cutting and Tillage*, 1985, with a smooth vertical blade).
    """

    slug = "bulldozing"
    forms = ("hegedus", "passive")
    channels = ("drawbar_pull_N",)
    variables = ("sinkage_m", "load_N")
    unit_weight: float = 15e3

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Draw the unit weight of the soil, 13 to 19 kN/m3."""
        return cls(form, 0.0, unit_weight=float(rng.uniform(13e3, 19e3)))

    @property
    def bounds(self) -> tuple[float, float]:
        """Up to three times the formula."""
        return 0.0, 3.0

    def parameters(self) -> dict[str, float]:
        """Give the multiple of the formula [-] and the unit weight [N/m3]."""
        return {"factor": self.magnitude, "unit_weight_N_m3": self.unit_weight}

    def forces(self, channels: Channels, drive: Drive, ground: Ground, body: Body) -> Channels:
        """Take the resistance from the drawbar pull."""
        z, c, phi = channels.sinkage_m, flat(ground.c_Pa), flat(ground.phi_rad)
        if self.form == "hegedus":
            rupture = math.pi / 4.0 - np.asarray(phi) / 2.0
            cot = 1.0 / np.tan(rupture)
            inner = z * c + 0.5 * self.unit_weight * z**2 * (cot + cot**2 * np.tan(phi))
            resistance = body.width_m * (cot + np.tan(rupture + phi)) * inner
        else:
            passive = np.tan(math.pi / 4.0 + np.asarray(phi) / 2.0) ** 2
            resistance = body.width_m * (0.5 * self.unit_weight * z**2 * passive + 2.0 * c * z * np.sqrt(passive))
        return replace(channels, drawbar_pull_N=channels.drawbar_pull_N - self.magnitude * resistance)


@dataclass(frozen=True)
class SideWallFriction(Effect):
    """The buried flanks of the wheel rub on soil: earth pressure at rest times friction, and half the cohesion.

    ``drag``: its moment M resists the axle, and the vehicle has to push with M/r (L. Ding et al. 2009): T rises by M
    and DP falls by M/r. ``field``: friction against the true motion of every point of the flank.
    """

    slug = "side_wall_friction"
    forms = ("drag", "drag", "drag", "field")
    channels = ("torque_Nm", "drawbar_pull_N")
    variables = ("sinkage_m", "load_N", "slip")

    @property
    def bounds(self) -> tuple[float, float]:
        """Up to five times the friction of soil at rest: the wheel presses it sideways too."""
        return 0.0, 5.0

    def parameters(self) -> dict[str, float]:
        """Give the multiple of friction at rest [-]."""
        return {"factor": self.magnitude}

    def forces(self, channels: Channels, drive: Drive, ground: Ground, body: Body) -> Channels:
        """Add the flanks' torque and drag."""
        r = body.radius_m
        theta_1 = np.arccos(np.clip(1.0 - channels.sinkage_m / r, -1.0, 1.0))[:, None, None]
        node, weight = np.polynomial.legendre.leggauss(8)
        node, weight = 0.5 * (node + 1.0), 0.5 * weight
        theta = theta_1 * node[None, :, None]
        inner = r * np.cos(theta_1) / np.cos(theta)
        rho = inner + (r - inner) * node[None, None, :]
        area = theta_1 * weight[None, :, None] * (r - inner) * weight[None, None, :] * rho
        phi, c = np.reshape(flat(ground.phi_rad), (-1, 1, 1)), np.reshape(flat(ground.c_Pa), (-1, 1, 1))
        lateral = 15e3 * (rho * np.cos(theta) - r * np.cos(theta_1)) * (1.0 - np.sin(phi))
        traction = 2.0 * self.magnitude * area * (lateral * np.tan(phi) + 0.5 * c)
        if self.form == "drag":
            moment = np.sum(traction * rho, axis=(1, 2))
            pull = -moment / r
        else:
            travel = travel_ratio(drive.slip)[:, None, None] * r
            forward = travel - rho * np.cos(theta)
            speed = np.hypot(forward, rho * np.sin(theta)) + 1e-6 * r
            pull = -np.sum(traction * forward / speed, axis=(1, 2))
            moment = np.sum(traction * rho * (rho - travel * np.cos(theta)) / speed, axis=(1, 2))
        return replace(channels, torque_Nm=channels.torque_Nm + moment, drawbar_pull_N=channels.drawbar_pull_N + pull)


EFFECTS: tuple[type[Effect], ...] = (
    StressPeakShift, ExitAngle, ShearHump, RimAdhesion, Bulldozing, SideWallFriction,
)  # fmt: skip
