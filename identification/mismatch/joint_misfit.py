"""What a fit leaves of slip and load in all channels together, each part of it too little to be a finding."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.linalg import orth

from .fitting import Fitted, Problem
from .samples import Samples
from .soil_variation import HUBER

_DEGREE, _DEGREE_OF_LOAD = 3, 2
"""Of the polynomials of slip, and of load."""

_HELD = 0.02
"""Loads that scatter by less, a share of their mean, are one load [-]."""

_APART = 1e-3
"""Columns whose part of their own is a smaller share tell nothing [-]."""


def nats_in_all(problem: Problem, fitted: Fitted, repeated: float = 1.0) -> float:
    """Nats by which what a fit leaves follows slip and load more closely than noise does; below zero where less.

    The score test (C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948), 50-57) of polynomials of slip and load that are added
    to all channels at once: what the fit's own parameters would take of them is taken off, and half a nat for each, by
    which noise follows them. A correction by one of them (`smooth_correction`) has to stand for itself.

    Parameters
    ----------
    problem, fitted
        The samples, and the fit that leaves it.
    repeated
        Number of neighbouring rows that say the same.
    """
    courses = _courses(problem.samples)
    count, channels = len(problem.measured), len(problem.answers)
    added = np.einsum("nk,cd->ncdk", courses, np.diag(fitted.noise.answers)).reshape(count, channels, -1)
    innovations, jacobian, columns = problem.whitened_columns(fitted, fitted.noise, added)
    left = np.clip(innovations, -HUBER, HUBER).ravel()
    own = orth(_of_one_size(jacobian.reshape(left.size, -1)))
    columns = _of_one_size(columns.reshape(left.size, -1))
    further = orth(columns - own @ (own.T @ columns), rcond=_APART)
    return 0.5 * (float(np.sum((further.T @ (left - own @ (own.T @ left))) ** 2)) / repeated - further.shape[1])


def _courses(samples: Samples) -> np.ndarray:
    """Polynomials (n, k) of slip, of load where it is not held, and their product."""
    drive = samples.drive
    by_slip = legvander(_within(drive.slip), _DEGREE)
    if drive.load_N.std() < _HELD * drive.load_N.mean():
        return by_slip
    load = _within(drive.load_N)
    return np.column_stack([by_slip, legvander(load, _DEGREE_OF_LOAD)[:, 1:], by_slip[:, 1] * load])


def _within(values: np.ndarray) -> np.ndarray:
    """Lay values (n,) from -1 to 1."""
    low, high = float(values.min()), float(values.max())
    return 2.0 * (values - low) / max(high - low, 1e-12) - 1.0


def _of_one_size(columns: np.ndarray) -> np.ndarray:
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
