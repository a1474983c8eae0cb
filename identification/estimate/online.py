"""Identification while driving: the estimator of `estimate` on a sliding window, one warm-started step a sample."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, replace

import numpy as np

from ...framework.core.soil import PARAMETERS, PLAUSIBLE, Quantity, SoilKnowledge
from ...framework.core.vehicle import Wheel
from ..mechanics.soil import from_internal, slope_of_internal, to_internal
from ..mechanics.textbook import CHANNELS
from .estimate import build_problem, converge
from .identifiability import TWO_SIDED, advise, mean_stress, separable, wald_strengths
from .likelihood import Point, Problem
from .optimise import Fit, fit
from .solution import Measured

LEAST_SAMPLES = 40
"""Samples before the first estimate: four seconds at 10 Hz."""

SEARCH_AGAIN = 20
"""Samples between two searches, at least: a search takes several steps' time."""

MOST_IN_AGREEMENT = 0.75
"""Share of samples that are no gross errors below which the estimator searches again [-]."""

TRIALS = 4
"""Steps tried at a sample until one leads uphill; the first that does is enough."""


@dataclass(frozen=True)
class OnlineEstimate:
    """Soil over the window: parameters with Wald intervals, correlation of c and tan phi, and the samples used."""

    parameters: dict[str, Quantity]
    correlation: float
    n: int


class _Search:
    """A search for the soil from nothing, here or in a thread of its own."""

    def __init__(self, problem: Problem, wheel: Wheel, known: SoilKnowledge):
        self._given = problem, wheel, known
        self._fit: Fit | None = None
        self._error: Exception | None = None
        self.has_ended = False

    def begin(self) -> None:
        """Search in a thread."""
        threading.Thread(target=self.make, name="bevameter search", daemon=True).start()

    def make(self) -> None:
        """Search here."""
        try:
            self._fit = converge(*self._given)
        except Exception as error:
            self._error = error
        self.has_ended = True

    def found(self) -> Fit:
        """Give what was found; raises what the search raised."""
        if self._error is not None:
            raise self._error
        assert self._fit is not None
        return self._fit


class OnlineIdentifier:
    """Maximum likelihood with errors in all channels over the last samples of a drive.

    Each sample costs one step of the iteration from where the last one ended, so that the estimate follows the soil;
    the first comes after `LEAST_SAMPLES`, from a search as `estimate` does it, and so does the next where the soil
    has changed. Feed it only what the gate lets through.

    Parameters
    ----------
    wheel
        The wheel.
    noise
        Standard deviations of the sensors by channel name (`textbook.CHANNELS`), SI; a channel without one is not used.
    window
        Samples kept [-].
    known
        What is known of the soil from elsewhere.
    searches_apart
        Whether a search, which takes as long as a hundred steps, is made in a thread of its own (`is_searching`): the
        estimate stays as it was until that has ended, and no sample may be handed over.
    """

    def __init__(
        self, wheel: Wheel, noise: dict[str, float], *, window: int = 600, known: SoilKnowledge | None = None,
        searches_apart: bool = False,
    ) -> None:  # fmt: skip
        self._wheel, self._known, self._window = wheel, known or SoilKnowledge(), window
        self._noise = np.array([noise.get(name, math.nan) for name in CHANNELS])
        self._rows = np.empty((0, len(CHANNELS)))
        self._fit: Fit | None = None
        self._since_search = 0
        self._searches_apart = searches_apart
        self._search: _Search | None = None

    @property
    def is_searching(self) -> bool:
        """Whether a search goes on in a thread of its own: a sample has to wait."""
        return self._search is not None and not self._search.has_ended

    def update(
        self,
        *,
        load_N: float = math.nan,
        torque_Nm: float = math.nan,
        sinkage_m: float = math.nan,
        slip: float = math.nan,
        drawbar_pull_N: float = math.nan,
    ) -> OnlineEstimate | None:
        """Take in one sample, left out where load or slip is missing; give the estimate, None before the first."""
        row = np.array([load_N, torque_Nm, sinkage_m, slip, drawbar_pull_N])
        row[~np.isfinite(self._noise)] = math.nan
        if not (np.isfinite(row[0]) and np.isfinite(row[3]) and np.isfinite(row).sum() >= 3):
            return self.estimate()
        dropped = max(len(self._rows) + 1 - self._window, 0)
        self._rows = np.vstack([self._rows[dropped:], row])
        if len(self._rows) < LEAST_SAMPLES:
            return None
        measured = Measured(self._rows, self._noise, np.arange(len(self._rows)))
        problem = build_problem(measured, self._wheel, self._known)
        if self._search is not None:
            self._fit, self._search = self._search.found(), None
        self._since_search += 1
        if self._fit is None or self._lost():
            self._since_search = 0
            search = _Search(problem, self._wheel, self._known)
            if self._searches_apart:
                self._search = search
                search.begin()
            else:
                search.make()
                self._fit = search.found()
        else:
            point = extended(self._fit.point, problem, dropped)
            self._fit = fit(problem, point, iterations=TRIALS, enough=math.inf)
        return self.estimate()

    def _lost(self) -> bool:
        """Say whether the soil has changed: too many samples look like gross errors to go on from the last estimate."""
        assert self._fit is not None
        return self._since_search >= SEARCH_AGAIN and float(self._fit.weights.mean()) < MOST_IN_AGREEMENT

    def estimate(self) -> OnlineEstimate | None:
        """Give the present estimate; None before the first."""
        if self._fit is None:
            return None
        _, covariance = self.vector()
        quantities = {}
        for index, name in enumerate(PARAMETERS):
            centre, sd = float(self._fit.vector[index]), math.sqrt(max(covariance[index, index], 0.0))
            centre = max(centre, 0.0) if name == "c_Pa" else centre
            least, most = (to_internal(name, bound) for bound in PLAUSIBLE[name])
            low, high = max(centre - TWO_SIDED * sd, least), min(centre + TWO_SIDED * sd, most)
            value = from_internal(name, centre)
            quantities[name] = Quantity(
                value, sd * slope_of_internal(name, value), from_internal(name, low), from_internal(name, high)
            )
        spread = math.sqrt(covariance[0, 0] * covariance[1, 1])
        return OnlineEstimate(quantities, float(covariance[0, 1] / spread) if spread > 0.0 else 0.0, len(self._rows))

    def vector(self) -> tuple[np.ndarray, np.ndarray]:
        """Give c [Pa], tan phi, ln k, ln stiffness and ln n, (5,), and their covariance; NaN before the first."""
        if self._fit is None:
            return np.full(len(PARAMETERS), np.nan), np.full((len(PARAMETERS), len(PARAMETERS)), np.nan)
        held = [name in self._known.values and name not in self._known.sd for name in PARAMETERS]
        covariance = self._fit.covariance(~np.array(held))
        return self._fit.vector[: len(PARAMETERS)].copy(), covariance[: len(PARAMETERS), : len(PARAMETERS)]

    def advice(self) -> str:
        """Say what driving would determine what the window does not; empty where nothing lacks."""
        estimate = self.estimate()
        if self._fit is None or estimate is None:
            return ""
        values = {name: quantity.value for name, quantity in estimate.parameters.items()}
        mean, covariance = np.array([values["c_Pa"], math.tan(values["phi_rad"])]), self.vector()[1][:2, :2]
        stresses_Pa = np.percentile(mean_stress(self._fit.theta_1, values, self._wheel), [10, 50, 90])
        strength = wald_strengths(stresses_Pa, mean, covariance, TWO_SIDED)
        free = np.array([name not in self._known.values for name in PARAMETERS])
        determined = separable(estimate.parameters, strength, free, 1.0)
        return advise(self._rows, determined, strength, 1.0)


def extended(point: Point, problem: Problem, dropped: int) -> Point:
    """Let the `dropped` oldest samples go, begin the newest at what was measured."""
    newest = np.clip(problem.measured[-1:, [0, 3]], [0.02 * problem.load_scale, -0.98], [np.inf, 0.999])
    angles = np.full((1, point.theta_1.shape[1]), float(np.median(point.theta_1)))
    return replace(
        point,
        population=point.population.carried(problem.grid),
        imposed=np.vstack([point.imposed[dropped:], newest]),
        spread=np.concatenate([point.spread[dropped:], np.zeros((1, 2, 2))]),
        theta_1=np.vstack([point.theta_1[dropped:], angles]),
    )
