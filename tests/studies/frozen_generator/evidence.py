"""How strongly hidden effects show: log-likelihood gained over the textbook wheel with its soil refitted, in nats."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from .contact import Array, Soil
from .drives import Drive
from .effect import FIELD_OF, Effect
from .scene import Ground, Hidden, Scene, predict
from .sensors import LOAD, SLIP, Sensors

KnownSoil = dict[str, tuple[float, float]]
MOST_ROWS = 180  # in the search for strengths
MOST_CORRELATED = 400  # where the errors' correlation along the track is heeded


@dataclass(frozen=True)
class Observed:
    """Readings to explain: the drive as indicated, the rows compared and, on these, readings and their errors."""

    drive: Drive
    rows: Array
    readings: dict[str, Array]
    sd: dict[str, Array]
    known: KnownSoil
    factor: Array | None = (
        None  # Cholesky factor of the covariance of all readings, where their errors are not independent
    )


def sample_rows(count: int, most: int) -> Array:
    """At most so many of the rows, the same at each call."""
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(5).choice(count, most, replace=False))


@dataclass(frozen=True)
class Fit:
    """Least squares: soil, strength of the effect kept beside it, and half the sum of squares."""

    soil: Soil
    strength: float
    cost: float


@dataclass(frozen=True)
class Errors:
    """Errors of the answered channels on some rows: independent parts, and what each unit of ground variation does."""

    independent: dict[str, Array]  # variance of sensor, load and slip
    by_ground: list[dict[str, Array]]  # for stiffness, for strength: change by one standard deviation

    def sd(self) -> dict[str, Array]:
        """Standard deviation of each value, whatever its companions."""
        return {c: np.sqrt(v + sum(part[c] ** 2 for part in self.by_ground)) for c, v in self.independent.items()}

    def factor(self, drive: Drive, length: float, share: float) -> Array:
        """Cholesky factor of the covariance of all values; each row stands for 1 / share independent readings."""
        gap = np.subtract.outer(drive.place, drive.place) / max(length, 1e-12)
        alike = np.eye(drive.rows) if drive.steady else np.exp(-0.5 * gap**2)
        channels = list(self.independent)
        total = np.diag(np.concatenate([self.independent[c] for c in channels]) * share)
        for part in self.by_ground:
            change = np.concatenate([part[c] for c in channels])
            total += np.outer(change, change) * np.tile(alike, (len(channels), len(channels)))
        return np.linalg.cholesky(total)


def errors_of(scene: Scene, drive: Drive, hidden: Hidden, sensors: Sensors, ground: Ground, rows: Array) -> Errors:
    """Errors of the answered values: the sensor's own, and by finite differences those of load, slip and ground."""
    whole = any(effect.history for effect, _ in hidden)
    drive = drive if whole else drive.take(rows)
    kept = rows if whole else np.arange(drive.rows)
    base = predict(scene.wheel, scene.soil, drive, hidden)

    def change(moved: Drive, varied: Ground | None, size: Array | float) -> dict[str, Array]:
        other = predict(scene.wheel, scene.soil, moved, hidden, varied, base.entry_angle)
        changes = {c: size * (getattr(other, FIELD_OF[c]) - getattr(base, FIELD_OF[c])) for c in scene.answered}
        return {c: values[kept] for c, values in changes.items()}

    by_load = change(replace(drive, load=drive.load * 1.01), None, sensors.sd[LOAD] / (0.01 * drive.load))
    by_slip = change(replace(drive, slip=drive.slip + 0.005), None, sensors.sd[SLIP] / 0.005)
    one = np.ones(drive.rows)
    varied = [(Ground(1.02 * one, one), ground.stiffness_sd), (Ground(one, 1.02 * one), ground.strength_sd)]
    return Errors(
        {c: sensors.sd[c] ** 2 + by_load[c] ** 2 + by_slip[c] ** 2 for c in scene.answered},
        [change(drive, other, sd / 0.02) for other, sd in varied if sd > 0.0],
    )


def prior_residuals(soil: Soil, known: KnownSoil) -> Array:
    """Distance of a soil from what is known of it elsewhere, in standard deviations."""
    have = {"c_Pa": soil.cohesion, "phi_deg": np.rad2deg(soil.friction_angle)}
    return np.array([(have[name] - value) / sd for name, (value, sd) in known.items()])


def _weigh(observed: Observed, soil: Soil, answers: list[Array]) -> Array:
    """Residuals in units of their errors, those of what is known of the soil first."""
    raw = [values - answer for values, answer in zip(observed.readings.values(), answers, strict=True)]
    if observed.factor is None:
        parts = [r / sd for r, sd in zip(raw, observed.sd.values(), strict=True)]
    else:
        parts = [solve_triangular(observed.factor, np.nan_to_num(np.concatenate(raw)), lower=True)]
    joined = np.concatenate([prior_residuals(soil, observed.known), *parts])
    return np.nan_to_num(joined, nan=0.0, posinf=1e3, neginf=-1e3)


def cost_of(scene: Scene, observed: Observed, soil: Soil, hidden: Hidden) -> float:
    """Half the sum of squared residuals of a model with nothing free."""
    reaction = predict(scene.wheel, soil, observed.drive, hidden)
    answers = [getattr(reaction, FIELD_OF[column])[observed.rows] for column in observed.readings]
    return 0.5 * float(np.sum(_weigh(observed, soil, answers) ** 2))


def refit(
    scene: Scene,
    observed: Observed,
    start: Soil,
    kept: tuple[Effect, float] | None = None,
    evaluations: int = 12,
    precision: float = 1e-3,
) -> Fit:
    """Fit the textbook's five soil parameters (and the strength of one effect kept) by nonlinear least squares."""
    stress = scene.mean_pressure
    rows = observed.rows
    whole = kept is not None and kept[0].history
    drive = observed.drive if whole else observed.drive.take(rows)
    places = rows if whole else np.arange(drive.rows)
    guess: list[Array | None] = [None]

    def soil_of(x: Array) -> Soil:
        return Soil(
            cohesion=float(x[0] * stress),
            friction_angle=float(np.arctan(x[1])),
            shear_modulus=float(start.shear_modulus * np.exp(x[2])),
            stiffness=float(start.stiffness * np.exp(x[3])),
            exponent=float(x[4]),
        )

    def residuals(x: Array) -> Array:
        hidden = () if kept is None else [(kept[0], float(x[5]))]
        reaction = predict(scene.wheel, soil_of(x), drive, hidden, guess=guess[0])
        guess[0] = reaction.entry_angle
        answers = [getattr(reaction, FIELD_OF[column])[places] for column in observed.readings]
        return _weigh(observed, soil_of(x), answers)

    x = [start.cohesion / stress, np.tan(start.friction_angle), 0.0, 0.0, start.exponent]
    low, high = [0.0, 0.02, -4.0, -5.0, 0.15], [4.0, 1.4, 4.0, 5.0, 2.5]
    if kept is not None:
        x, low, high = [*x, kept[1]], [*low, 0.0], [*high, 2.0]
    x0 = np.clip(x, np.array(low) + 1e-6, np.array(high) - 1e-6)
    steps = np.full(len(x0), 1e-4)

    def jacobian(x: Array) -> Array:
        base = residuals(x)
        sides = np.where(x + steps < np.array(high), steps, -steps)
        return np.column_stack(
            [(residuals(x + side * axis) - base) / side for side, axis in zip(sides, np.eye(len(x)), strict=True)]
        )

    found = least_squares(
        residuals,
        x0,
        jacobian,
        (low, high),
        x_scale=[0.1, 0.1, 0.3, 0.3, 0.2, 0.3][: len(x0)],
        max_nfev=evaluations,
        ftol=precision,
        xtol=1e-5,
        gtol=1e-6,
    )
    return Fit(soil_of(found.x), float(found.x[5]) if kept is not None else 0.0, float(found.cost))
