"""What the soil does beyond the textbook: the eleven effects of the ground under, before and beside the wheel."""

from __future__ import annotations

import numpy as np

from .contact import Array, Contact, Reaction, janosi
from .drives import Drive
from .effect import PULL, SINKAGE, TORQUE, Effect
from .scene import Scene


class SlipSinkage(Effect):
    """A slipping wheel digs itself in."""

    slug = "slip_sinkage"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("slip",)
        self.by_exponent = rng.random() < 0.5
        self.form = (
            "n = n0 + n1 i" if self.by_exponent else "z = z0 [1 + kappa (K_ss - 1)], K_ss = (1 + i) / (1 - i / 2)"
        )

    def parameters(self, strength: float) -> dict[str, float]:
        return {"n1": 0.8 * strength} if self.by_exponent else {"kappa": 1.5 * strength}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        if self.by_exponent:  # Ding et al. 2010
            contact.exponent = contact.exponent + 0.8 * strength * contact.slip
        else:  # Lyasko 2010: the soil under a sunken wheel is pressed as if it had sunk by z0 only
            slip = np.clip(contact.slip, 0.0, 0.98)
            deeper = 1.0 + 1.5 * strength * ((1.0 + slip) / (1.0 - 0.5 * slip) - 1.0)
            contact.stiffness = contact.stiffness * deeper**-contact.exponent


class StressPeakShift(Effect):
    """The peak of the normal stress moves forwards with slip (Wong & Reece 1967)."""

    slug = "stress_peak_shift"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("slip",)
        self.form = "theta_m = (a0 + a1 i) theta_1"
        self.shift = 0.0 if rng.random() < 0.5 else -rng.uniform(0.05, 0.12)  # of a0 from the textbook's 1/2
        self.slope = rng.uniform(0.35, 0.6)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"a0": 0.5 + self.shift * strength, "a1": self.slope * strength}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        moved = contact.peak_fraction + strength * (self.shift + self.slope * contact.slip)
        contact.peak_fraction = np.clip(moved, 0.1, 0.92)


class ExitAngle(Effect):
    """The soil rebounds behind bottom-dead-centre."""

    slug = "exit_angle"
    needs = frozenset({PULL})

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("sinkage_m", "load_N")
        self.by_depth = rng.random() < 0.5
        self.bound = 0.6 if self.by_depth else 0.7
        # Ishigami et al. 2007: ratio of the depths; Onafeko & Reece 1967, Wong & Reece 1967: ratio of the angles
        self.form = "cos theta_2 = 1 - lambda z / r" if self.by_depth else "theta_2 = -lambda theta_1"

    def parameters(self, strength: float) -> dict[str, float]:
        return {"lambda": self.bound * strength}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        contact.exit_by_depth = self.by_depth
        contact.exit_ratio = contact.exit_ratio + self.bound * strength


class ShearHump(Effect):
    """The shear stress peaks, then falls to a residue."""

    slug = "shear_hump"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("slip",)
        self.wong = rng.random() < 0.5
        self.residue = rng.uniform(0.3, 0.7)
        self.length = rng.uniform(1.5, 4.0) * scene.soil.shear_modulus
        self.form = "tau / tau_max = " + (
            "(1 - w) (1 - e^(-j/k)) + w K_r [1 + (1 / (K_r (1 - 1/e)) - 1) e^(1 - j/K_w)] (1 - e^(-j/K_w))"
            if self.wong
            else "(1 - e^(-j/k)) [K_r + (1 - K_r) e^(-j/K_w)]"
        )

    def parameters(self, strength: float) -> dict[str, float]:
        if self.wong:
            return {"w": strength, "K_r": self.residue, "K_w": self.length}
        return {"K_r": 1.0 - 0.8 * strength, "K_w": 3.0 * self.length}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        residue, length = self.residue, self.length

        def wong(displacement: Array, modulus: Array) -> Array:
            """Wong & Preston-Thomas 1983, Eq. 4, in a share w of the strength, the rest Janosi's."""
            ratio = np.maximum(displacement, 0.0) / length
            peak = 1.0 / (residue * (1.0 - np.exp(-1.0))) - 1.0
            hump = residue * (1.0 + peak * np.exp(1.0 - ratio)) * -np.expm1(-ratio)
            return (1.0 - strength) * janosi(displacement, modulus) + strength * hump

        def softening(displacement: Array, modulus: Array) -> Array:
            """Exponential decay to a residue, in the manner of Oida 1979."""
            left = 1.0 - 0.8 * strength
            decay = np.exp(-np.maximum(displacement, 0.0) / (3.0 * length))
            return janosi(displacement, modulus) * (left + (1.0 - left) * decay)

        contact.build_up = wong if self.wong else softening


class RateDependence(Effect):
    """Soil is stiffer or stronger when it is loaded faster."""

    slug = "rate_dependence"
    needs = frozenset({"wheel_speed_rad_s"})
    protocols = ("speed", "table")

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("wheel_speed_rad_s",)
        self.of_stiffness = rng.random() < 0.6
        self.speed = float(np.median(scene.drive.wheel_speed)) * scene.wheel.radius
        self.form = "stiffness ~ (r omega / v0)^m" if self.of_stiffness else "c, tan phi ~ 1 + q log10(r omega / v0)"

    def parameters(self, strength: float) -> dict[str, float]:
        return {"m" if self.of_stiffness else "q": 0.3 * strength, "v0": self.speed}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        ratio = np.maximum(drive.wheel_speed * contact.radius / self.speed, 1e-3)
        if self.of_stiffness:  # power of the speed: Pope 1969, Grahn 1991
            contact.stiffness = contact.stiffness * ratio ** (0.3 * strength)
        else:  # strength with the logarithm of the speed: Shmulevich et al. 1998
            factor = np.maximum(1.0 + 0.3 * strength * np.log10(ratio), 0.2)
            contact.cohesion, contact.tan_friction = contact.cohesion * factor, contact.tan_friction * factor


class MultipassCompaction(Effect):
    """Later passes meet soil that earlier wheels compacted."""

    slug = "multipass_compaction"
    needs = frozenset({"pass"})
    protocols = ("passes",)

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("pass",)
        self.saturating = rng.random() < 0.6
        self.passes = rng.uniform(0.8, 2.0)
        self.shear = rng.uniform(0.0, 0.4)  # how far strength follows stiffness
        self.form = (
            "stiffness ~ 1 + A (1 - e^(-(p-1)/p0)), c ~ its power s"
            if self.saturating
            else "stiffness ~ p^beta, c ~ p^(s beta)"
        )

    def parameters(self, strength: float) -> dict[str, float]:
        if self.saturating:
            return {"A": 2.0 * strength, "p0": self.passes, "s": self.shear}
        return {"beta": 0.7 * strength, "s": self.shear}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        earlier = drive.passes - 1.0
        if self.saturating:  # Holm 1969; Senatore & Iagnemma 2014
            factor = 1.0 + 2.0 * strength * -np.expm1(-earlier / self.passes)
        else:
            factor = drive.passes ** (0.7 * strength)
        contact.stiffness = contact.stiffness * factor
        contact.cohesion = contact.cohesion * factor**self.shear


class HardLayer(Effect):
    """A stiff layer at depth."""

    slug = "hard_layer"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("load_N", "sinkage_m")
        self.kink = rng.random() < 0.5
        deepest = 0.75 * float(np.quantile(scene.reference.sinkage, 0.98))  # of the soil under the stress peak
        self.depth = deepest * (rng.uniform(0.35, 0.65) if self.kink else rng.uniform(0.85, 1.1))
        self.form = "p + B p'(H) (z - H) for z > H" if self.kink else "p / (1 - (z/H)^4)"

    def parameters(self, strength: float) -> dict[str, float]:
        return {"H": self.depth, "B": 12.0 * strength} if self.kink else {"H": self.depth / max(strength, 1e-6)}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        width, depth = contact.width, self.depth
        stiffness, exponent = contact.stiffness[:, None], contact.exponent[:, None]
        extra = 12.0 * strength * stiffness * exponent / width * (depth / width) ** (exponent - 1.0)

        def kinked(at: Array, pressure: Array) -> Array:
            """Two-layer ground by a change of slope (layered media: Bekker 1969)."""
            return pressure + extra * np.maximum(at - depth, 0.0)

        def approached(at: Array, pressure: Array) -> Array:
            """Pressure that grows without bound towards the layer (after Wong 2010)."""
            return pressure / np.maximum(1.0 - (np.minimum(at, 10 * depth) * strength / depth) ** 4, 1e-3)

        contact.pressure_terms.append(kinked if self.kink else approached)


class SoilPatch(Effect):
    """The soil is another over a stretch of the track."""

    slug = "soil_patch"
    needs = frozenset({"x_m"})
    protocols = ("field", "bench", "passes")
    laps = True

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("x_m",)
        low, high = float(np.min(scene.drive.place)), float(np.max(scene.drive.place))
        length = (high - low) * rng.uniform(0.15, 0.4)
        self.start = rng.uniform(low + 0.05 * (high - low), high - length - 0.05 * (high - low))
        self.end = self.start + length
        self.edge = 0.0 if rng.random() < 0.5 else 0.1 * length
        self.change = rng.choice([-1.0, 1.0]) * np.array(
            [rng.uniform(0.4, 0.9), rng.uniform(0.3, 0.9), rng.uniform(0, 0.3)]
        )
        if rng.random() < 0.3:
            self.change[0] *= -1.0  # softer and stronger, or the reverse: another class of soil
        self.form = "soil changes between x0 and x1, edges " + ("sharp" if self.edge == 0.0 else "gradual")

    def parameters(self, strength: float) -> dict[str, float]:
        stiffness, cohesion, friction = np.exp(self.change * strength)
        return {
            "x0": self.start,
            "x1": self.end,
            "stiffness_factor": float(stiffness),
            "c_factor": float(cohesion),
            "tan_phi_factor": float(friction),
        }

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        if self.edge == 0.0:
            inside = ((drive.place >= self.start) & (drive.place < self.end)).astype(float)
        else:
            rise, fall = (drive.place - self.start) / self.edge, (drive.place - self.end) / self.edge
            inside = 0.5 * (np.tanh(2.0 * rise) - np.tanh(2.0 * fall))
        contact.stiffness = contact.stiffness * np.exp(self.change[0] * strength * inside)
        contact.cohesion = contact.cohesion * np.exp(self.change[1] * strength * inside)
        contact.tan_friction = contact.tan_friction * np.exp(self.change[2] * strength * inside)


class RimAdhesion(Effect):
    """Soil slips on the rim before it shears within."""

    slug = "rim_adhesion"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.capped = rng.random() < 0.5
        self.soil = scene.soil
        self.form = (
            "tau <= c_a + sigma tan delta" if self.capped else "tau_max = c_a + sigma tan delta, mobilised with k"
        )

    def parameters(self, strength: float) -> dict[str, float]:
        friction = np.arctan(np.tan(self.soil.friction_angle) * (1.0 - 0.65 * strength))
        return {"c_a": self.soil.cohesion * (1.0 - 0.9 * strength), "delta_rad": float(friction)}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        adhesion = contact.cohesion * (1.0 - 0.9 * strength)
        friction = contact.tan_friction * (1.0 - 0.65 * strength)
        if self.capped:  # external friction: Bekker 1956
            contact.rim_limit = lambda pressure: adhesion[:, None] + pressure * friction[:, None]
        else:  # soil-metal strength in the place of the soil's: Reece 1965
            contact.cohesion, contact.tan_friction = adhesion, friction


class Bulldozing(Effect):
    """Soil is pushed up and forwards by the front of the wheel."""

    slug = "bulldozing"
    needs = frozenset({PULL})

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.channels = (PULL,)
        self.variables = ("sinkage_m",)
        self.passive = rng.random() < 0.5
        self.weight = rng.uniform(12e3, 19e3)
        self.soil = scene.soil
        self.form = (
            "b (gamma z^2 K_p / 2 + 2 c z sqrt(K_p))" if self.passive else "b (0.67 c z K_pc + gamma z^2 K_pg / 2)"
        )

    def parameters(self, strength: float) -> dict[str, float]:
        return {"share": 1.2 * strength, "gamma": self.weight}

    def reaction(self, reaction: Reaction, contact: Contact, drive: Drive, strength: float) -> None:
        depth, tangent = reaction.sinkage, np.tan(self.soil.friction_angle)
        if self.passive:  # passive wall: McKyes 1985 without wall friction
            earth = np.tan(np.pi / 4 + self.soil.friction_angle / 2) ** 2
            force = 0.5 * self.weight * depth**2 * earth + 2.0 * self.soil.cohesion * depth * np.sqrt(earth)
        else:  # after Hegedus 1960, Bekker 1969 with Terzaghi's bearing factors
            bearing_q = np.exp(np.pi * tangent) * np.tan(np.pi / 4 + self.soil.friction_angle / 2) ** 2
            bearing_c, bearing_g = (bearing_q - 1.0) / tangent, 2.0 * (bearing_q + 1.0) * tangent
            cosine_squared = np.cos(self.soil.friction_angle) ** 2
            by_cohesion = (bearing_c - tangent) * cosine_squared
            by_weight = (2.0 * bearing_g / tangent + 1.0) * cosine_squared
            force = 0.67 * self.soil.cohesion * depth * by_cohesion + 0.5 * self.weight * depth**2 * by_weight
        reaction.pull = reaction.pull - 1.2 * strength * contact.width * force


class SideWallFriction(Effect):
    """The buried flanks of the wheel rub on the soil (Ding et al. 2009)."""

    slug = "side_wall_friction"
    needs = frozenset({PULL})

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.channels = (TORQUE, PULL)
        self.variables = (SINKAGE,)
        self.adhesive = rng.random() < 0.5
        self.adhesion = rng.uniform(0.3, 1.0) * max(scene.soil.cohesion, 0.1 * scene.mean_pressure)
        self.friction = rng.uniform(0.2, 0.5)  # wall friction times lateral pressure ratio
        self.back = rng.uniform(0.4, 0.9)  # share of the friction that holds the wheel back
        self.soil = scene.soil
        self.form = (
            "flank shear c_a over the buried segment" if self.adhesive else "flank shear mu K p(h) over the segment"
        )

    def parameters(self, strength: float) -> dict[str, float]:
        size = {"c_a": 2.0 * strength * self.adhesion} if self.adhesive else {"mu_K": 2.0 * strength * self.friction}
        return {**size, "pull_share": self.back}

    def reaction(self, reaction: Reaction, contact: Contact, drive: Drive, strength: float) -> None:
        fraction = (np.arange(40) + 0.5) / 40.0
        depth = reaction.sinkage[:, None] * fraction
        radius = contact.radius[:, None]
        chord = np.sqrt(np.maximum(radius**2 - (radius - reaction.sinkage[:, None] + depth) ** 2, 0.0))
        stress = (
            np.full_like(depth, self.adhesion)
            if self.adhesive
            else self.friction * self.soil.stiffness * (depth / contact.width) ** self.soil.exponent
        )
        force = 2.0 * 2.0 * strength * np.mean(stress * chord, axis=1) * reaction.sinkage  # both flanks
        reaction.torque = reaction.torque + force * contact.radius * 0.9
        reaction.pull = reaction.pull - self.back * force


SOIL_EFFECTS: tuple[type[Effect], ...] = (
    SlipSinkage,
    StressPeakShift,
    ExitAngle,
    ShearHump,
    RateDependence,
    MultipassCompaction,
    HardLayer,
    SoilPatch,
    RimAdhesion,
    Bulldozing,
    SideWallFriction,
)
