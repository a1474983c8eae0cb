"""Cross-validation: predictive likelihood and residuals of blocks of rows that a model was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ...framework.core.concurrency import together
from .evidence import discrepancy
from .fit import Fitted, fit
from .likelihood import Problem

_UNTESTED_SHARE = 0.9
"""A block with more than this share of the information about a parameter does not test it [-]."""

_MOST_STEPS = 10
"""Most steps of a fit without a block, which starts near its optimum."""


@dataclass(frozen=True)
class HeldOut:
    """Predictive log-likelihood of each block [nats], and residuals (n, m), SI, of held-out rows.

    untested: whether one block alone determines some parameter, which is then fixed at the fit to all rows.
    """

    nats: np.ndarray
    residuals: np.ndarray
    untested: bool

    def gain(self, other: HeldOut) -> tuple[float, float]:
        """Gain over another model, and its standard deviation from the scatter between blocks [nats]."""
        each = self.nats - other.nats
        return float(each.sum()), float(np.std(each, ddof=1) * np.sqrt(len(each)))


def hold_out(problem: Problem, fitted: Fitted, *, discrepant: bool = False) -> HeldOut:
    """Predict each block by a fit to all others, with the noise of the fit to all rows.

    Where there are several classes of ground, the effects are fitted to the grounds of other classes only, but for
    those that act on one class; these and the soil are fitted to the other blocks of the same ground. The ground's
    variation is predicted from neighbouring rows. With `discrepant` a discrepancy is estimated from the other blocks
    as well.
    """
    block = problem.samples.block
    parts = [np.flatnonzero(block == each) for each in np.unique(block)]
    predictions = together(partial(_predicted, problem, fitted, discrepant), parts)
    residuals = np.full(problem.seen.shape, np.nan)
    for rows, (there, _, _) in zip(parts, predictions, strict=True):
        residuals[rows] = there
    return HeldOut(np.array([nats for _, nats, _ in predictions]), residuals, any(each[2] for each in predictions))


def _predicted(
    problem: Problem, fitted: Fitted, discrepant: bool, rows: np.ndarray
) -> tuple[np.ndarray, float, bool]:  # fmt: skip
    """Residuals (k, m) of rows by a fit to the others, their log-likelihood, and whether parameters were fixed."""
    same_class = problem.samples.of_class_of(rows)
    local, untested = (_determined_by(problem, fitted, each) for each in (same_class, rows))
    others = problem.without(same_class)
    refitted = fit(
        others, fitted.model, fitted.vector, fitted.noise, fitted.response.entry(), free=~local,
        steps=_MOST_STEPS, fit_noise=False,
    )  # fmt: skip
    if len(same_class) > len(rows):
        others, near = problem.without(rows), local & ~untested
        near[fitted.model.soils] = True
        start = np.where(near, fitted.vector, refitted.vector)
        refitted = fit(
            others, fitted.model, start, fitted.noise, fitted.response.entry(start - fitted.vector), free=near,
            steps=_MOST_STEPS, fit_noise=False,
        )  # fmt: skip
    residuals = problem.residuals(refitted.response)
    if discrepant:
        residuals -= discrepancy(others, refitted).change
    unexplained = np.where(np.isfinite(residuals), residuals, problem.measured)
    nats = -float(problem.loss(unexplained, fitted.noise, fitted.response)[rows].sum())
    return residuals[rows], nats, bool(untested.any())


def _determined_by(problem: Problem, fitted: Fitted, rows: np.ndarray) -> np.ndarray:
    """(p,) True for parameters of effects that hardly any other rows inform."""
    _, own = problem.normal_equations(fitted.white.innovations, fitted.white.jacobian, rows)
    answer = np.diag(own) > _UNTESTED_SHARE * np.diag(fitted.information(problem))
    answer[fitted.model.soils] = False
    return answer
