"""Effects of the running gear and the vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from .effects import GRAVITY, Effect, Setting
from .mechanics import Body, Channels, Contact, Drive, Ground


@dataclass(frozen=True)
class Grousers(Effect):
    """Lugs move the shear surface outwards and make the forces ripple as each of them enters.

    The soil shears at r + m h (L. Ding et al., *Experimental study and analysis on driving wheels' performance for
    planetary exploration rovers*, 2011: shear radius r + lambda h); the ripple has as many cycles a turn as the wheel
    has lugs. ``sine``: one harmonic. ``pulses``: two, as of the passive pressure on each lug while it passes through
    the soil (R. A. Irani et al. 2011).
    """

    slug = "grousers"
    forms = ("sine", "pulses")
    channels = ("torque_Nm", "drawbar_pull_N", "sinkage_m")
    variables = ("wheel_angle_rad",)
    ripple: float = 0.1
    phase: float = 0.0
    lag: float = 0.5

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Draw the ripple's share of the forces at full effect, its phase, and how far the pull's is behind."""
        return cls(
            form, 0.0, ripple=float(rng.uniform(0.06, 0.2)), phase=float(rng.uniform(0.0, 2.0 * math.pi)),
            lag=float(rng.uniform(0.0, 1.5)),
        )  # fmt: skip

    @property
    def bounds(self) -> tuple[float, float]:
        """From smooth rim to the full height of the lugs and the full ripple."""
        return 0.0, 1.2

    def parameters(self) -> dict[str, float]:
        """Give the share m of the height [-], and amplitude [-] and phase [rad] of the torque's ripple."""
        return {
            "height_share": self.magnitude,
            "torque_ripple": self.magnitude * self.ripple,
            "ripple_phase_rad": self.phase,
        }

    def geometry(self, contact: Contact) -> None:
        """Shear outside the rim."""
        contact.shear_radius = contact.shear_radius + self.magnitude * contact.body.lug_height_m
        contact.arm = contact.arm + self.magnitude * contact.body.lug_height_m

    def forces(self, channels: Channels, drive: Drive, ground: Ground, body: Body) -> Channels:
        """Add the ripple; its size goes with the torque, and the wheel rides up a little on each lug."""
        angle = body.lugs * drive.wheel_angle + self.phase
        second = 0.4 if self.form == "pulses" else 0.0
        size = self.magnitude * self.ripple * np.abs(channels.torque_Nm)
        wave = np.sin(angle) + second * np.sin(2.0 * angle)
        late = np.sin(angle - self.lag) + second * np.sin(2.0 * (angle - self.lag))
        rise = 0.1 * self.magnitude * body.lug_height_m * np.cos(angle)
        return replace(
            channels,
            torque_Nm=channels.torque_Nm + size * wave,
            drawbar_pull_N=channels.drawbar_pull_N + 0.7 * size / body.radius_m * late,
            sinkage_m=channels.sinkage_m - rise,
        )


@dataclass(frozen=True)
class TyreDeflection(Effect):
    """The wheel flattens.

    ``circle``: a larger substitute circle, r*/r = (sqrt(1 + f/z) + sqrt(f/z))^2 with the deflection f = W/stiffness
    (I. Schmid 1995; C. Harnisch et al. 2005). ``flat``: the rim presses no harder than inflation and carcass do, p_g
    (M. G. Bekker 1969); the magnitude is how far p_g lies below the drive's greatest pressure.
    """

    slug = "tyre_deflection"
    forms = ("circle", "flat")
    channels = ("sinkage_m", "torque_Nm", "drawbar_pull_N")
    variables = ("load_N",)
    typical_load_N: float = 1.0
    top_pressure_Pa: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Take the drive's typical load, and its greatest pressure at the peak midway."""
        theta_1 = np.arccos(1.0 - setting.textbook.sinkage_m / setting.body.radius_m)
        depth = setting.body.radius_m * (np.cos(theta_1 / 2.0) - np.cos(theta_1))
        pressure = setting.ground.stiffness_Pa * (depth / setting.body.width_m) ** setting.ground.n
        return cls(
            form, 0.0, typical_load_N=float(setting.drive.load_N.mean()), top_pressure_Pa=float(np.max(pressure))
        )

    @property
    def bounds(self) -> tuple[float, float]:
        """Deflection of up to 0.2 of the radius at the typical load; a pressure limit down to 0.35 of the greatest."""
        return (0.0, 0.2) if self.form == "circle" else (0.0, 0.65)

    def _stiffness(self, body: Body) -> float:
        return self.typical_load_N / (max(self.magnitude, 1e-12) * body.radius_m)

    def parameters(self) -> dict[str, float]:
        """Give the deflection at the typical load, by radius [-], or the pressure limit [Pa]."""
        if self.form == "circle":
            return {"deflection_share": self.magnitude, "typical_load_N": self.typical_load_N}
        return {"pressure_limit_Pa": (1.0 - self.magnitude) * self.top_pressure_Pa}

    def geometry(self, contact: Contact) -> None:
        """Put the substitute circle in place of the rim.

        With q = 1 - cos theta_1 of that circle, z = r* q gives z = r q + 2 sqrt(r q f).
        """
        if self.form != "circle":
            return
        r = contact.body.radius_m
        deflection = contact.drive.load_N[:, None] / self._stiffness(contact.body)
        flatness = 1.0 - np.cos(contact.theta_1)
        larger = r + 2.0 * np.sqrt(r * deflection / flatness)
        contact.radius = contact.shear_radius = larger
        contact.arm = np.full_like(larger, r) - deflection

    def pressing(self, contact: Contact) -> None:
        """Hold the pressure at its limit."""
        if self.form == "flat":
            contact.pressure = np.minimum(contact.pressure, (1.0 - self.magnitude) * self.top_pressure_Pa)


@dataclass(frozen=True)
class SlopeGravity(Effect):
    """On a slope the weight has a component along the track, which the sensor of drawbar pull measures.

    ``mass``: an axle of fixed mass, -m g sin(pitch). ``load``: in proportion to the load, -s W tan(pitch), W being
    normal to the ground. Statics.
    """

    slug = "slope_gravity"
    forms = ("mass", "load")
    channels = ("drawbar_pull_N",)
    variables = ("pitch_rad",)
    typical_load_N: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Take the drive's typical load as the unit of the mass."""
        return cls(form, 0.0, typical_load_N=float(setting.drive.load_N.mean()))

    @property
    def bounds(self) -> tuple[float, float]:
        """Up to twice the load on the wheel."""
        return 0.0, 2.0

    def parameters(self) -> dict[str, float]:
        """Give the mass [kg], or the share of the load [-]."""
        if self.form == "mass":
            return {"mass_kg": self.magnitude * self.typical_load_N / GRAVITY}
        return {"load_share": self.magnitude}

    def forces(self, channels: Channels, drive: Drive, ground: Ground, body: Body) -> Channels:
        """Add the component along the track."""
        if self.form == "mass":
            along = self.magnitude * self.typical_load_N * np.sin(drive.pitch_rad)
        else:
            along = self.magnitude * drive.load_N * np.tan(drive.pitch_rad)
        return replace(channels, drawbar_pull_N=channels.drawbar_pull_N - along)


@dataclass(frozen=True)
class Inertia(Effect):
    """Wheel and carriage accelerate: T gains J domega/dt, DP loses m dV/dt (Newton).

    ``both``, or the ``wheel`` alone, or the ``carriage`` alone.
    """

    slug = "inertia"
    forms = ("both", "wheel", "carriage")
    channels = ("torque_Nm", "drawbar_pull_N")
    variables = ("angular_acceleration_rad_s2", "acceleration_m_s2", "time_s")
    typical_load_N: float = 1.0
    radius_m: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Take the drive's typical load as the unit of the mass."""
        if not setting.pulls:
            form = "wheel"
        return cls(form, 0.0, typical_load_N=float(setting.drive.load_N.mean()), radius_m=setting.body.radius_m)

    @property
    def bounds(self) -> tuple[float, float]:
        """A carriage, or what turns with the wheel by way of the gear, of up to 20 times the load's mass."""
        return 0.0, 20.0

    def parameters(self) -> dict[str, float]:
        """Give moment of inertia [kg m2] and mass [kg]."""
        mass = self.magnitude * self.typical_load_N / GRAVITY
        turning = {} if self.form == "carriage" else {"wheel_inertia_kg_m2": 0.5 * mass * self.radius_m**2}
        return {**turning, **({} if self.form == "wheel" else {"mass_kg": mass})}

    def forces(self, channels: Channels, drive: Drive, ground: Ground, body: Body) -> Channels:
        """Add what accelerates wheel and carriage."""
        own = self.parameters()
        return replace(
            channels,
            torque_Nm=channels.torque_Nm + own.get("wheel_inertia_kg_m2", 0.0) * drive.wheel_acceleration,
            drawbar_pull_N=channels.drawbar_pull_N - own.get("mass_kg", 0.0) * drive.travel_acceleration,
        )


@dataclass(frozen=True)
class DrivetrainFriction(Effect):
    """Torque measured at the motor includes the losses of gear and bearings.

    B. Armstrong-Helouvry et al., *A survey of models, analysis tools and compensation methods for the control of
    machines with friction* (1994): ``viscous``: b omega; ``load``: mu r W/10 on a bearing of a tenth of the wheel's
    radius; ``stribeck``: T_c (1 + 1.5 exp(-(omega/omega_s)^2)), falling from stiction;
    ``coulomb_viscous``: T_c + b omega.
    """

    slug = "drivetrain_friction"
    forms = ("viscous", "load", "stribeck", "coulomb_viscous")
    channels = ("torque_Nm",)
    variables = ("wheel_speed_rad_s", "load_N", "travel_speed_m_s", "rim_speed_m_s")
    typical_torque: float = 1.0
    typical_speed: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Take the textbook's torque and the drive's wheel speed for units."""
        speed = float(np.mean(np.abs(setting.drive.wheel_speed)))
        return cls(form, 0.0, 1.0, float(np.mean(np.abs(setting.textbook.torque_Nm))), speed)

    @property
    def bounds(self) -> tuple[float, float]:
        """Losses of up to 0.8 of the mean torque; bearing friction of up to 1."""
        return (0.0, 1.0) if self.form == "load" else (0.0, 0.8)

    def parameters(self) -> dict[str, float]:
        """Give the coefficients: Coulomb [N m], viscous [N m s], of the bearing [-]."""
        torque = self.magnitude * self.typical_torque
        return {
            "viscous": {"viscous_Nms": torque / self.typical_speed},
            "load": {"bearing_friction": self.magnitude},
            "stribeck": {"coulomb_Nm": torque, "stribeck_rad_s": 0.7 * self.typical_speed},
            "coulomb_viscous": {"coulomb_Nm": 0.5 * torque, "viscous_Nms": 0.5 * torque / self.typical_speed},
        }[self.form]

    def forces(self, channels: Channels, drive: Drive, ground: Ground, body: Body) -> Channels:
        """Add the losses to the torque."""
        own = self.parameters()
        turning = np.sign(drive.wheel_speed)
        loss = own.get("viscous_Nms", 0.0) * drive.wheel_speed
        loss = loss + own.get("bearing_friction", 0.0) * 0.1 * body.radius_m * drive.load_N * turning
        stiction = 0.0
        if self.form == "stribeck":
            stiction = 1.5 * np.exp(-((drive.wheel_speed / own["stribeck_rad_s"]) ** 2))
        loss = loss + own.get("coulomb_Nm", 0.0) * turning * (1.0 + stiction)
        return replace(channels, torque_Nm=channels.torque_Nm + loss)


EFFECTS: tuple[type[Effect], ...] = (
    Grousers, TyreDeflection, SlopeGravity, Inertia, DrivetrainFriction,
)  # fmt: skip
