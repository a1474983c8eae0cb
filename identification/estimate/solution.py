"""The samples of an estimate and the fit behind it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..mechanics.textbook import CHANNELS
from .computed_channels import Computed
from .likelihood import Problem
from .optimise import Fit

ANSWERS = np.array([False, True, True, False, True])
"""Channels that the soil answers with (T, z, DP): the model's error lives there; load and slip are imposed."""


@dataclass(frozen=True)
class Measured:
    """Samples for an estimate.

    Parameters
    ----------
    channels : (n, 5)
        Columns as `textbook.CHANNELS`, SI; NaN where not observed.
    noise : (5,)
        Standard deviations of the sensors, SI; NaN for absent channels.
    order : (n,)
        What neighbours are neighbours in: time, or slip for steady-state trials.
    stated : (5,)
        True where the noise stands; elsewhere it is what neighbours in time show, and perhaps too much.
    timed
        Neighbours are so in time: their noise may be autocorrelated.
    computed
        Errors of load and pull that all samples share, where these are computed; None where they are sensed.
    """

    channels: np.ndarray
    noise: np.ndarray
    order: np.ndarray
    stated: np.ndarray = field(default_factory=lambda: np.ones(len(CHANNELS), dtype=bool))
    timed: bool = True
    computed: Computed | None = None

    def select(self, rows: slice | np.ndarray) -> Measured:
        """Give some of the samples, by a slice or numbers of rows."""
        return replace(self, channels=self.channels[rows], order=self.order[rows])


@dataclass(frozen=True)
class Solution:
    """The fit behind a `SoilEstimate`.

    `inflation` multiplies the covariance, `widening` (p,) each parameter's variance where the form is wrong; `quantile`
    is Student's t at 97.5 %, `misfit`, of the textbook's form, as in `SoilEstimate`; `repeated` neighbouring rows count
    as one because the noise is autocorrelated; `timed` as in `Measured`.
    """

    problem: Problem
    fit: Fit
    inflation: float
    quantile: float
    misfit: float
    widening: np.ndarray | None = None
    repeated: float = 1.0
    timed: bool = True

    @property
    def free(self) -> np.ndarray:
        """(p,) True where a parameter was estimated."""
        return self.problem.free

    def covariance(self) -> np.ndarray:
        """Covariance (p, p) of the parameter vector, the model's error carried in it."""
        factor = np.sqrt([self.widened(index) for index in range(len(self.free))])
        return self.fit.covariance(self.free) * np.outer(factor, factor)

    def widened(self, index: int) -> float:
        """Factor on the variance of one parameter, the model's error carried in it."""
        return self.inflation * (1.0 if self.widening is None else float(self.widening[index]))
