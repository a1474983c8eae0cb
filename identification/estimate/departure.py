"""Does the soil under the wheels leave what is known of its class? A sequential test, with a stated false-alarm rate.

Two hypotheses: the soil of the stretch is that of a new place of the class, or it is another in one parameter or in
all. What a stretch says of its soil is an estimate y with covariance S, and the ratio of its likelihoods, N(y; mu, any
+ S) over that of the class, is that of all samples behind it, of which the estimate is the sufficient statistic. As
samples come it is a non-negative martingale of mean 1 where the first hypothesis is true, so that it ever exceeds 1 / a
with a probability of a at most, however often one looks (Ville's inequality; Ramdas, Gruenwald, Vovk & Shafer 2023,
"Game-theoretic statistics and safe anytime-valid inference", Statistical Science 38, 576, doi:10.1214/23-STS894). That
holds for Gaussian estimates of a linear model; `tests/identification/estimate/test_departure.py` holds the rate for the
wheel's.

A new place of a class is Student t about it (`database.posterior`): a mixture of Gaussians of several widths.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import chi2

FALSE_ALARMS = 0.01
"""Share of stretches of a class on which the test ever says otherwise, at most, unless stated [-]."""

ANY_SOIL_SD = np.array([10e3, 0.25, 1.0, 1.5, 0.4])
"""How far soils of all kinds scatter: c [Pa], tan phi, ln k, ln stiffness, ln n; half of the ranges of Wong 2010, Table
2.3, from sand to clay and snow."""

_WIDTHS = 16
"""Gaussians that make up a Student t."""


class DepartureTest:
    """Tests whether a wheel is on soil of a class, as often as there is an estimate of it.

    Parameters
    ----------
    mean, covariance : (5,), (5, 5)
        Of a new place of the class: c [Pa], tan phi [-], ln k [m], ln stiffness [Pa], ln n.
    freedom
        Degrees of freedom of that prediction, more than 0 [-].
    false_alarms
        Share of stretches of the class on which the test ever says otherwise, at most [-].

    Attributes
    ----------
    log_ratio
        Logarithm of the likelihood of any soil over that of the class's, by the last estimate.
    has_departed
        Whether the soil has left its class; once it has, it has for good.
    """

    def __init__(self, mean: np.ndarray, covariance: np.ndarray, freedom: float, *, false_alarms: float = FALSE_ALARMS):
        self._mean = np.asarray(mean, dtype=float)
        shares = (np.arange(_WIDTHS) + 0.5) / _WIDTHS
        self._class = [covariance * width for width in freedom / chi2.ppf(shares, freedom)]
        alone = np.diag(ANY_SOIL_SD**2)
        # One parameter leaves what the class has, or all do: each as probable.
        self._any = [covariance + each for each in (alone, *(alone * row for row in np.eye(len(alone))))]
        self._least = -math.log(false_alarms)
        self.log_ratio = 0.0
        self.has_departed = False

    def update(self, estimate: np.ndarray, covariance: np.ndarray) -> bool:
        """Take in the stretch's estimate (5,), and its covariance; say whether the soil has left its class by now."""
        off = np.asarray(estimate, dtype=float) - self._mean
        if np.isfinite(off).all() and np.isfinite(covariance).all():
            of_any, of_class = (
                _log_mean(off, [each + covariance for each in some]) for some in (self._any, self._class)
            )
            self.log_ratio = of_any - of_class
            self.has_departed |= self.log_ratio >= self._least
        return self.has_departed


def _log_mean(off: np.ndarray, covariances: list[np.ndarray]) -> float:
    """Logarithm of the mean of the densities of a deviation (d,)."""
    logs = np.array([_log_normal(off, each) for each in covariances])
    return float(np.logaddexp.reduce(logs)) - math.log(len(covariances))


def _log_normal(off: np.ndarray, covariance: np.ndarray) -> float:
    """Logarithm of the density of a deviation (d,)."""
    size = np.linalg.slogdet(2.0 * math.pi * covariance)[1]
    return -0.5 * float(off @ np.linalg.solve(covariance, off) + size)
