"""Effects of the soil from place to place, pass to pass, with speed, slip and depth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from .effects import Effect, Setting
from .mechanics import Body, Contact, Drive, Ground


def scaled_ground(ground: Ground, stiffness: np.ndarray, strength: np.ndarray) -> Ground:
    """Multiply stiffness, and c and tan phi together, by factors (m,)."""
    return replace(
        ground,
        stiffness_Pa=ground.stiffness_Pa * stiffness[:, None],
        c_Pa=ground.c_Pa * strength[:, None],
        phi_rad=np.arctan(np.tan(ground.phi_rad) * strength[:, None]),
    )


@dataclass(frozen=True)
class SlipSinkage(Effect):
    """Soil is carried out from under a slipping wheel, which sinks further.

    ``exponent``: n = n0 + n1 |i| (L. Ding et al., *Wheel slip-sinkage and its prediction model of lunar rover*, 2010).
    ``factor``: the sinkage that carries the load is multiplied by 1 + s ((1 + i)/(1 - 0.5 i) - 1), which at s = 1 is
    the factor of A. V. Vasil'ev et al. (1969) that M. Lyasko, *Slip sinkage effect in soil-vehicle mechanics* (2010)
    starts from: the pressure is that of the depth without what was carried away.
    """

    slug = "slip_sinkage"
    forms = ("exponent", "factor")
    channels = ("sinkage_m", "torque_Nm", "drawbar_pull_N")
    variables = ("slip",)

    @property
    def bounds(self) -> tuple[float, float]:
        """Ding's n1 up to 0.8; up to twice Vasil'ev's growth."""
        return (0.0, 0.8) if self.form == "exponent" else (0.0, 2.0)

    def parameters(self) -> dict[str, float]:
        """Give n1 [-], or the share s of Vasil'ev's growth [-]."""
        return {"n1" if self.form == "exponent" else "sinkage_growth": self.magnitude}

    def ground(self, ground: Ground, drive: Drive, body: Body) -> Ground:
        """Raise the exponent with slip."""
        if self.form != "exponent":
            return ground
        return replace(ground, n=ground.n + self.magnitude * np.abs(drive.slip)[:, None])

    def pressing(self, contact: Contact) -> None:
        """Press as at the depth without what was carried away."""
        if self.form != "factor":
            return
        slip = np.clip(contact.drive.slip, 0.0, 0.95)[:, None]
        growth = 1.0 + self.magnitude * ((1.0 + slip) / (1.0 - 0.5 * slip) - 1.0)
        contact.pressure = contact.pressure * growth**-contact.ground.n


@dataclass(frozen=True)
class RateDependence(Effect):
    """The soil is stiffer or stronger the faster it is loaded.

    ``power``: stiffness times (v / v0)^m, v = r omega (R. G. Pope 1969, form of his plate tests).
    ``logarithm``: stiffness and strength times 1 + a ln(v / v0), as clays in shear (in Shmulevich et al. 1998).
    ``penetration``: pressure times (w / w0)^m with the rate w = V sin theta at which the rim enters (M. Grahn 1991).
    v0 is the drive's typical speed: a rate law has no other zero.
    """

    slug = "rate_dependence"
    forms = ("power", "logarithm", "penetration")
    channels = ("sinkage_m", "torque_Nm", "drawbar_pull_N")
    variables = ("wheel_speed_rad_s", "travel_speed_m_s", "rim_speed_m_s")
    typical_m_s: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Take the geometric mean of the drive's rim speeds for v0."""
        rim = setting.body.radius_m * np.abs(setting.drive.wheel_speed)
        return cls(form, 0.0, typical_m_s=float(np.exp(np.mean(np.log(rim)))))

    @property
    def bounds(self) -> tuple[float, float]:
        """Exponents and logarithmic rates up to 0.35."""
        return 0.0, 0.35

    def parameters(self) -> dict[str, float]:
        """Give the exponent or rate [-] and the speed where it is 1 [m/s]."""
        name = "rate" if self.form == "logarithm" else "exponent"
        return {name: self.magnitude, "reference_speed_m_s": self.typical_m_s}

    def ground(self, ground: Ground, drive: Drive, body: Body) -> Ground:
        """Stiffen, or strengthen too, with rim speed."""
        ratio = body.radius_m * np.abs(drive.wheel_speed) / self.typical_m_s
        if self.form == "power":
            return scaled_ground(ground, ratio**self.magnitude, np.ones_like(ratio))
        if self.form == "logarithm":
            factor = np.maximum(1.0 + self.magnitude * np.log(ratio), 0.1)
            return scaled_ground(ground, factor, factor)
        return ground

    def pressing(self, contact: Contact) -> None:
        """Stiffen with the rate of penetration, of the angle ahead of the peak whose pressure it is."""
        if self.form != "penetration":
            return
        ahead = np.arccos(np.clip(contact.depth / contact.radius + np.cos(contact.theta_1), -1.0, 1.0))
        rate = np.abs(contact.drive.travel_speed)[:, None] * np.sin(ahead)
        contact.pressure = contact.pressure * (rate / (0.3 * self.typical_m_s)) ** self.magnitude


@dataclass(frozen=True)
class MultipassCompaction(Effect):
    """Later passes meet soil that earlier wheels compacted.

    ``exponential``: stiffness times 1 + a (1 - exp(-(p - 1)/p0)) at pass p: each pass compacts less (I. C. Holm 1969).
    ``density``: stiffness, and a fifth as much cohesion and tan phi, rise as 1 + a (1 - 1/p) with the density that
    C. Senatore, K. Iagnemma (2014) make the soil's parameters depend on.
    """

    slug = "multipass_compaction"
    forms = ("exponential", "density")
    channels = ("sinkage_m", "torque_Nm", "drawbar_pull_N")
    variables = ("pass",)
    passes: float = 1.5

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Draw the number of passes in which it saturates."""
        return cls(form, 0.0, passes=float(rng.uniform(0.8, 2.5)))

    @property
    def bounds(self) -> tuple[float, float]:
        """Stiffness at most three and a half times that of fresh soil."""
        return 0.0, 2.5

    def parameters(self) -> dict[str, float]:
        """Give the gain in stiffness after many passes [-], and the passes that it takes."""
        saturation = {"saturation_passes": self.passes} if self.form == "exponential" else {}
        return {"stiffness_gain": self.magnitude, **saturation}

    def ground(self, ground: Ground, drive: Drive, body: Body) -> Ground:
        """Stiffen with the pass."""
        earlier = drive.passes - 1.0
        if self.form == "exponential":
            done = -np.expm1(-earlier / self.passes)
            return scaled_ground(ground, 1.0 + self.magnitude * done, np.ones_like(done))
        done = 1.0 - 1.0 / drive.passes
        return scaled_ground(ground, 1.0 + self.magnitude * done, 1.0 + 0.2 * self.magnitude * done)


@dataclass(frozen=True)
class HardLayer(Effect):
    """A stiff layer at depth H.

    ``kink``: below H each unit of z/b adds m times the stiffness to the pressure (two layers, M. G. Bekker 1969).
    ``floor``: z = H (1 - exp(-p/p0)) near a floor that is not pushed in (J. Y. Wong 2010 gives it for snow on ice):
    Bekker's pressure times -ln(1 - z/H)/(z/H).
    """

    slug = "hard_layer"
    forms = ("kink", "floor")
    channels = ("sinkage_m", "torque_Nm", "drawbar_pull_N")
    variables = ("load_N", "sinkage_m")
    depth_m: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Lay the layer where a part of the drive reaches it: a wheel presses hardest at 3/4 of its sinkage."""
        share = rng.uniform(0.25, 0.7) if form == "kink" else 1.0
        depth = 0.75 if form == "kink" else 1.0
        return cls(form, 0.0, depth_m=depth * float(np.quantile(setting.textbook.sinkage_m, share)))

    @property
    def bounds(self) -> tuple[float, float]:
        """A layer up to 30 times as stiff; a floor no higher than 0.8 of the deepest sinkage without it."""
        return (0.0, 30.0) if self.form == "kink" else (0.0, 1.25)

    def parameters(self) -> dict[str, float]:
        """Give the depth [m] and how much stiffer the layer is [-]."""
        if self.form == "kink":
            return {"depth_m": self.depth_m, "stiffness_ratio": self.magnitude}
        return {"depth_m": self.depth_m / max(self.magnitude, 1e-9)}

    def pressing(self, contact: Contact) -> None:
        """Add the layer's pressure."""
        if self.form == "kink":
            into = np.maximum(contact.depth - self.depth_m, 0.0) / contact.body.width_m
            contact.pressure = contact.pressure + self.magnitude * contact.ground.stiffness_Pa * into
            return
        share = np.clip(contact.depth * self.magnitude / self.depth_m, 1e-9, None)
        near = np.minimum(share, 0.999)
        # beyond the floor the search for equilibrium still needs a pressure that rises
        contact.pressure = contact.pressure * (-np.log1p(-near) / near) * np.exp(20.0 * (share - near))


@dataclass(frozen=True)
class SoilPatch(Effect):
    """Another soil over a stretch of the track, on every pass and in every lane.

    ``sharp`` or ``blended`` borders; stiffness times exp(m s), c and tan phi times exp(m t), s and t drawn.
    """

    slug = "soil_patch"
    forms = ("sharp", "blended")
    channels = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
    variables = ("x_m",)
    start_m: float = 0.0
    end_m: float = 1.0
    border_m: float = 0.01
    stiffness: float = 1.0
    strength: float = 0.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Lay the patch over 15 to 40 % of the track, inside it; softer, firmer, weaker or stronger."""
        low, high = float(setting.drive.x_m.min()), float(setting.drive.x_m.max())
        length = (high - low) * rng.uniform(0.15, 0.4)
        start = rng.uniform(low + 0.1 * (high - low), high - length - 0.1 * (high - low))
        border = length * (0.01 if form == "sharp" else rng.uniform(0.05, 0.2))
        stiffness, strength = rng.choice([(1.0, 0.0), (-1.0, 0.0), (1.0, 0.4), (-1.0, -0.4), (0.3, 1.0), (0.3, -1.0)])
        return cls(form, 0.0, 1.0, start, start + length, border, stiffness, strength)

    @property
    def bounds(self) -> tuple[float, float]:
        """Up to 2.5 times as stiff or as strong."""
        return 0.0, 0.9

    def parameters(self) -> dict[str, float]:
        """Give the borders [m] and the factors of stiffness and strength [-]."""
        return {
            "from_m": self.start_m,
            "to_m": self.end_m,
            "stiffness_factor": float(np.exp(self.magnitude * self.stiffness)),
            "strength_factor": float(np.exp(self.magnitude * self.strength)),
        }

    def ground(self, ground: Ground, drive: Drive, body: Body) -> Ground:
        rise = 0.5 * (1.0 + np.tanh((drive.x_m - self.start_m) / self.border_m))
        fall = 0.5 * (1.0 + np.tanh((self.end_m - drive.x_m) / self.border_m))
        inside = self.magnitude * rise * fall
        return scaled_ground(ground, np.exp(self.stiffness * inside), np.exp(self.strength * inside))


EFFECTS: tuple[type[Effect], ...] = (SlipSinkage, RateDependence, MultipassCompaction, HardLayer, SoilPatch)
