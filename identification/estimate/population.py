"""The population that the true load and slip of the samples of a drive come from, estimated with the soil.

Slip is measured with error, so the population decides where a sample's true slip is sought. A driver who swings between
two slips, or holds one and then another, leaves no normal distribution, and an estimator that takes it for one is
biased. Here slip is a mixture of normal kernels at fixed places whose shares are estimated (N. Laird, J. Am. Stat.
Assoc. 73 (1978), Sec. 3; smooth kernels and a penalty after B. Efron, Biometrika 103 (2016), Sec. 2), and load is
normal about a smooth curve in slip: on slopes both follow the ground, and hardly ever along a straight line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from .spline import Spline

_MOST_KERNELS = 40

_FINE = 10.0
"""Kernels in one standard deviation of slip, as far as there are kernels enough."""

_FINEST = 0.3
"""Least width of a kernel [noise]: finer detail does not show."""

_LEAST_NOISE = 1e-3
"""Slip is never known better than this [-]."""

_CENTRAL = (0.03, 0.97)
"""Quantiles of the measured slips between which, and a little beyond, the narrow kernels lie."""

_ANYWHERE = 0.01
"""Prior share of samples whose slip is uniform over the range measured [-]."""

_WORTH = 10.0
"""Weight of the normal distribution as a prior, in samples: few samples determine no more than mean and spread."""

_ROUNDS = 10
"""Rounds of expectation and maximisation of the shares in a step, which cost far less than the mechanics."""

_KNOTS, _REACH = 6, 4.0
"""Knots in the width of a kernel (the spline is right to 2e-4 nats), and how far out they go [widths]."""

LEAST_SPREAD = 0.1
"""Least standard deviation of the population [noise]."""

_LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class Grid:
    """Places and widths (m,) of the kernels of slip [-], narrow ones of one width and last a wide one for slips that
    are anywhere; the shares (m,) that make up a nearly normal distribution; and the spline that load follows.
    """

    places: np.ndarray
    widths: np.ndarray
    normal: np.ndarray
    spline: Spline

    @classmethod
    def over(cls, slip: np.ndarray, noise: float) -> Grid:
        """Lay kernels over measured slips (n,) with white noise of a standard deviation `noise`; NaN is left out."""
        slip, noise = slip[np.isfinite(slip)], max(noise, _LEAST_NOISE)
        least, middle, most = float(slip.min()), float(np.median(slip)), float(slip.max())
        # Quartiles and not extremes, for gross errors have a hand in those.
        spread = min(0.7413 * float(np.subtract(*np.quantile(slip, [0.75, 0.25]))), float(np.std(slip)))
        variance = max(spread**2 - noise**2, (LEAST_SPREAD * noise) ** 2)
        low, high = np.quantile(slip, _CENTRAL) + 2.0 * noise * np.array([-1.0, 1.0])
        low, high = max(float(low), least), min(float(high), most)
        width = max(float(np.sqrt(variance)) / _FINE, _FINEST * noise, (high - low) / (_MOST_KERNELS - 1))
        count = int(np.ceil((high - low) / width)) + 1
        places = 0.5 * (low + high) + width * (np.arange(count) - 0.5 * (count - 1))
        shares = np.exp(-0.5 * (places - middle) ** 2 / max(variance - width**2, 0.25 * width**2))
        # None is so unlikely that it could not be learnt.
        normal = np.append(shares / shares.sum() + 0.1 * _ANYWHERE / count, _ANYWHERE)
        return cls(
            np.append(places, 0.5 * (least + most)),
            np.append(np.full(count, width), max(0.5 * (most - least), width)),
            normal / normal.sum(),
            Spline.over(slip, noise),
        )


@dataclass(frozen=True)
class Population:
    """Shares (m,) of the kernels of slip and how far they are shifted [-]; mean load [N], coefficients (k,) of its
    curve by slip [N] and its deviation from that [N].
    """

    grid: Grid
    shares: np.ndarray
    shift: float
    level: float
    curve: np.ndarray
    deviation: float

    @classmethod
    def beginning(cls, grid: Grid, load: np.ndarray, noise: float, least_deviation: float) -> Population:
        """Take slip to be normal and load not to go with it; measured loads (n,) and their noise [N]."""
        variance = max(float(np.var(load)) - noise**2, least_deviation**2)
        flat = np.zeros(len(grid.spline))
        return cls(grid, grid.normal, 0.0, float(np.mean(load)), flat, float(np.sqrt(variance)))

    @cached_property
    def middle(self) -> float:
        """Mean slip, not shifted."""
        return float(self.shares @ self.grid.places)

    @cached_property
    def _mean_basis(self) -> np.ndarray:
        """Mean (k,) of the basis over the kernels' places."""
        return self.shares @ self.grid.spline.basis(self.grid.places)[0]

    def basis(self, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the curve's coefficients are multiplied by at slips (...), and its derivative by slip: (..., k) each."""
        basis, slope = self.grid.spline.basis(slip - self.shift)
        return basis - self._mean_basis, slope

    def load_by_slip(self, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean load at slips (...) [N], and its slope by slip [N]: (...) each."""
        load, slope = self.grid.spline.curve(self.curve, slip - self.shift)
        return self.level - float(self._mean_basis @ self.curve) + load, slope

    def log_density(self, nodes: np.ndarray) -> np.ndarray:
        """Logarithm of the density at loads and slips (..., 2): (...)."""
        load, slip = nodes[..., 0], nodes[..., 1]
        away = (load - self.load_by_slip(slip)[0]) / self.deviation
        return self._log_slip(slip - self.shift) - 0.5 * away**2 - np.log(self.deviation) - _LOG_2PI

    def nearby(self, imposed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the normal population that this one is like near loads and slips (n, 2), the curve there its tangent.

        Returns
        -------
        away : (n, 2)
            The loads and slips, less the mean and in units of the root of the covariance.
        root : (n, 2, 2)
            A root R of the covariance R R^T.
        """
        mean, slope = self.load_by_slip(imposed[:, 1])
        deviation = float(np.sqrt(self.moments[1][1, 1]))
        away = np.column_stack(
            [(imposed[:, 0] - mean) / self.deviation, (imposed[:, 1] - self.shift - self.middle) / deviation]
        )
        root = np.zeros((len(imposed), 2, 2))
        root[:, 0, 0], root[:, 0, 1], root[:, 1, 1] = self.deviation, slope * deviation, deviation
        return away, root

    def _log_slip(self, slip: np.ndarray) -> np.ndarray:
        """Log-density of slip times the root of 2 pi, by a spline near the narrow kernels: there are many slips."""
        places, width = self.grid.places[:-1], self.grid.widths[0]
        knots = np.arange(places[0] - _REACH * width, places[-1] + _REACH * width, width / _KNOTS)
        answer = CubicSpline(knots, self._log_mixture(knots))(slip)
        far = (slip < knots[0]) | (slip > knots[-1])
        answer[far] = self._log_mixture(slip[far])
        return answer

    def _log_mixture(self, slip: np.ndarray) -> np.ndarray:
        away = (slip[:, None] - self.grid.places) / self.grid.widths
        exponent = -0.5 * away**2 + np.log(self.shares / self.grid.widths)
        peak = exponent.max(axis=-1)
        return peak + np.log(np.exp(exponent - peak[:, None]).sum(axis=-1))

    def log_prior(self) -> float:
        """Log-density of the population itself, zero for a normal one whose load does not go with slip [nats]."""
        normal = self.grid.normal
        shape = float(_WORTH * np.sum(normal * np.log(self.shares / normal)))
        return shape - 0.5 * float(self.curve @ self.grid.spline.straight @ self.curve) / self.deviation**2

    @cached_property
    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (2,) and covariance (2, 2) of load and slip."""
        places, squares = self.grid.places - self.middle, self.grid.widths**2
        load, slope = self.load_by_slip(self.grid.places + self.shift)
        load = load - self.level
        variance = float(self.shares @ (places**2 + squares))
        shared = float(self.shares @ (load * places + slope * squares))
        of_load = self.deviation**2 + float(self.shares @ (load**2 + slope**2 * squares))
        return np.array([self.level, self.middle + self.shift]), np.array([[of_load, shared], [shared, variance]])

    def carried(self, grid: Grid) -> Population:
        """Give the population on another grid."""
        old, new = self.grid.places[:-1], grid.places[:-1]
        shares = np.interp(new, old, self.shares[:-1], left=0.0, right=0.0)
        wide = min(float(self.shares[-1]), 0.5)
        shares = (1.0 - wide) * shares / shares.sum() if shares.sum() > 0.0 else grid.normal[:-1]
        shares = np.append(shares, wide) + _ANYWHERE * grid.normal
        shares = shares / shares.sum()
        # The curve on other knots, as near as they come to it where slips are.
        basis = grid.spline.basis(grid.places)[0]
        load = self.load_by_slip(grid.places + self.shift)[0]
        root = np.sqrt(shares)
        level, *curve = np.linalg.lstsq(
            root[:, None] * np.column_stack([np.ones(len(basis)), basis - shares @ basis]), root * load
        )[0]
        return replace(self, grid=grid, shares=shares, level=float(level), curve=np.array(curve))

    def _with_shares(self, shares: np.ndarray) -> Population:
        """Change the shares and leave the curve of load by slip where it is."""
        other = replace(self, shares=shares)
        return replace(other, level=self.level + float((other._mean_basis - self._mean_basis) @ self.curve))

    def moved(self, level: float, shift: float, log_deviation: float, curve: np.ndarray, least: float) -> Population:
        """Give the population with its mean load [N], slips, logarithm of the deviation and curve (k,) [N] moved; the
        deviation [N] is `least` or more.
        """
        # A step of scoring that is right for a variance; up with care, for where it is least samples seem far off.
        deviation = max(self.deviation * float(np.sqrt(np.clip(1.0 + 2.0 * log_deviation, 0.1, 1.5))), least)
        return replace(
            self, level=self.level + level, shift=self.shift + shift, curve=self.curve + curve, deviation=deviation
        )

    def improved(self, slips: np.ndarray, responsibility: np.ndarray, weights: np.ndarray) -> Population:
        """Give the population after some rounds of expectation and maximisation of the shares.

        Parameters
        ----------
        slips, responsibility : (n, q)
            Latent slips of each sample, and their posterior weights under the present population.
        weights : (n,)
            Probability that a sample is no gross error.
        """
        slip = slips - self.shift
        kernels = np.exp(-0.5 * ((slip[..., None] - self.grid.places) / self.grid.widths) ** 2) / self.grid.widths
        shares, worth = self.shares, _WORTH * self.grid.normal
        kernels = kernels.reshape(-1, len(shares))
        base = responsibility / np.maximum(kernels @ shares, 1e-200).reshape(responsibility.shape)
        for _ in range(_ROUNDS):
            likelihood = np.sum(base * (kernels @ shares).reshape(base.shape), axis=1)
            counts = shares * ((base * (weights / np.maximum(likelihood, 1e-300))[:, None]).ravel() @ kernels)
            shares = (counts + worth) / (counts.sum() + _WORTH)
        return self._with_shares(shares)
