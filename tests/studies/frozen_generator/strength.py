"""Search for the strengths at which hidden effects show as plainly as planned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .drives import Drive
from .effect import FIELD_OF, Effect
from .evidence import MOST_CORRELATED, MOST_ROWS, KnownSoil, Observed, errors_of, refit, sample_rows
from .plan import NATS
from .scene import Ground, Hidden, Scene, plausible, predict
from .sensors import Sensors

BOUNDS = (1.0, 0.75, 0.5, 0.35, 0.2, 0.1)
LEVELS = list(NATS)  # strongest first
IMPLAUSIBLE = -1.0
CLOSE = 0.08  # of the nats planned


def staged(drive: Drive, hidden: Hidden) -> Drive:
    """The drive as the effects have it."""
    for effect, strength in hidden:
        drive = effect.drive(drive, strength)
    return drive


@dataclass
class Found:
    """Strengths, the level that they reach, and the nats of each effect (of two: beside the other)."""

    hidden: list[tuple[Effect, float]]
    level: str
    nats: list[float]
    reached: bool


class Search:
    """Nats as a function of the strengths on one scene."""

    def __init__(self, scene: Scene, sensors: Sensors, ground: Ground, known: KnownSoil) -> None:
        self.scene, self.sensors, self.ground = scene, sensors, ground
        self.start = scene.soil  # of the next fit: the soil of the last
        truth = {"c_Pa": scene.soil.cohesion, "phi_deg": float(np.rad2deg(scene.soil.friction_angle))}
        self.known = {name: (truth[name], known_sd) for name, (_, known_sd) in known.items()}  # expected evidence

    def observed(self, hidden: Hidden, most: int, *, correlated: bool = False) -> Observed | None:
        """Noise-free readings of the true wheel on a sample of rows, or nothing where they are not plausible."""
        scene, drive = self.scene, staged(self.scene.drive, hidden)
        reaction = predict(scene.wheel, scene.soil, drive, hidden)
        if not plausible(scene, reaction):
            return None
        rows = sample_rows(drive.rows, most)
        share = len(rows) / drive.rows
        readings = {column: getattr(reaction, FIELD_OF[column])[rows] for column in scene.answered}
        errors = errors_of(scene, drive, hidden, self.sensors, self.ground, rows)
        sd = {column: values * np.sqrt(share) for column, values in errors.sd().items()}  # a row stands for several
        factor = errors.factor(drive.take(rows), self.ground.length, share) if correlated else None
        return Observed(drive, rows, readings, sd, self.known, factor)

    @staticmethod
    def most_rows(hidden: Hidden) -> int:
        """Rows that stand for all; more for effects of history, which show in few rows (after each step)."""
        return MOST_ROWS * (4 if any(effect.history for effect, _ in hidden) else 1)

    def gain(self, hidden: Hidden, kept: tuple[Effect, float] | None = None) -> float:
        """Nats that the true model is better than the textbook (with one of the effects kept, its strength free)."""
        observed = self.observed(hidden, self.most_rows(hidden))
        if observed is None:
            return IMPLAUSIBLE
        fit = refit(self.scene, observed, self.scene.soil if kept else self.start, kept)
        if kept is None:
            self.start = fit.soil
        return fit.cost

    def nats(self, hidden: Hidden) -> tuple[float, float]:
        """Nats on all rows, and those that remain when the ground's correlation along the track is heeded."""
        few, whole = self.observed(hidden, self.most_rows(hidden)), self.observed(hidden, self.scene.drive.rows)
        correlated = self.observed(hidden, MOST_CORRELATED, correlated=True)
        if not hidden or few is None or whole is None or correlated is None:
            return 0.0, 0.0
        start = refit(self.scene, few, self.scene.soil).soil
        plain = refit(self.scene, whole, start, evaluations=3, precision=1e-5).cost
        return plain, min(
            plain, *(refit(self.scene, correlated, s, precision=1e-4).cost for s in (start, self.scene.soil))
        )

    def single(self, effect: Effect, level: str) -> Found | None:
        """The strength of a lone effect at the level planned, or at the strongest below it that its bounds allow."""
        for bound in BOUNDS:
            most = self.gain([(effect, bound)])
            if most > IMPLAUSIBLE:
                break
        else:
            return None
        for lower in LEVELS[LEVELS.index(level) :]:
            if most >= NATS[lower] * (1.0 - CLOSE):
                strength, nats = self._bisect(effect, NATS[lower], bound, most)
                return Found([(effect, strength)], lower, [nats], reached=bool(abs(np.log(nats / NATS[lower])) < 0.4))
        return Found([(effect, bound)], "buried", [most], reached=False)

    def _bisect(self, effect: Effect, target: float, high: float, at_high: float) -> tuple[float, float]:
        """Strength with `target` nats: bisection of the logarithms, guided by nats growing like strength squared."""
        low, strength, nats = 0.0, high, at_high
        for step in range(9):
            if abs(nats / target - 1.0) < CLOSE:
                break
            if nats > target:
                high = strength
            else:
                low = strength
            guided = strength * float(np.sqrt(target / max(nats, 1e-3)))
            middle = np.sqrt(low * high) if low > 0.0 else 0.3 * high
            inside = low < guided < high
            strength = float(guided if inside and step < 5 else middle)
            found = self.gain([(effect, strength)])
            if found == IMPLAUSIBLE:
                high, nats = strength, np.inf
            else:
                nats = found
        return strength, float(nats)

    def pair(self, first: Effect, second: Effect, level: str) -> Found | None:
        """Strengths of two effects, each at least at the level beside the other."""
        alone = [self.single(effect, "plain") for effect in (first, second)]
        if any(found is None or found.level == "buried" for found in alone):
            return None
        strengths = [found.hidden[0][1] for found in alone if found is not None]
        target = NATS[level]
        strengths = [s * np.sqrt(target / f.nats[0]) for s, f in zip(strengths, alone, strict=True) if f is not None]
        nats = [0.0, 0.0]
        for _ in range(4):
            strengths = [min(float(s), 1.0) for s in strengths]
            hidden = list(zip((first, second), strengths, strict=True))
            nats = [self.gain(hidden, kept) for kept in reversed(hidden)]
            if min(nats) == IMPLAUSIBLE:
                return None
            if min(nats) >= 0.9 * target and max(nats) <= 1.6 * target:
                break
            factors = [np.clip(np.sqrt(1.1 * target / max(n, 1.0)), 0.3, 3.0) for n in nats]
            strengths = [s * f for s, f in zip(strengths, factors, strict=True)]
        reached = next((name for name in ("plain", "hidden") if min(nats) >= 0.85 * NATS[name]), None)
        glaring = (
            max(nats) > 3.0 * target or self.gain(hidden) > 8.0 * target
        )  # two alike, or one that drowns the other
        return None if reached is None or glaring else Found(hidden, reached, nats, reached=True)
