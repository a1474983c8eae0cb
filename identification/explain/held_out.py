"""How well a model predicts blocks of rows that it was not fitted to: the check of what the evidence says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..effects.drive import select_rows
from ..mechanics.augmented import SOIL_COUNT
from .fit import LONGEST, Fitted
from .likelihood import Problem
from .steps import normal_equations

_ALONE = 0.9
"""A block with more than this share of the information about a parameter does not test it: nothing else determines it.
"""

_RIDGE = 1e-9


@dataclass(frozen=True)
class HeldOut:
    """Predictive log-likelihood of each block [nats], and residuals (n, m), SI, of rows while held out.

    untested: True where a block alone determines a parameter, which stays as it was fitted then.
    """

    nats: np.ndarray
    residuals: np.ndarray
    untested: bool

    def gain(self, other: HeldOut) -> tuple[float, float]:
        """Nats gained over another model, and their standard deviation from the scatter between blocks."""
        each = self.nats - other.nats
        return float(each.sum()), float(np.std(each, ddof=1) * np.sqrt(len(each)))


def hold_out(problem: Problem, fitted: Fitted) -> HeldOut:
    """Predict each block from the fit to all others, which is one Newton step away from the fit to all rows.

    The prediction at the parameters so found is the full model's; the ground's variation is followed from neighbours.
    """
    samples, model, prior = problem.samples, fitted.model, problem.prior(fitted.model)
    white = fitted.white
    parts = [np.flatnonzero(samples.block == block) for block in np.unique(samples.block)]
    known = [normal_equations(white.innovations[rows], white.jacobian[rows]) for rows in parts]
    total = np.sum([own for _, own in known], axis=0)
    information = total + np.diag(prior.precision)
    own_share = np.array([np.diag(own) for _, own in known]) / np.maximum(np.diag(information), 1e-300)
    alone = own_share > _ALONE
    alone[:, :SOIL_COUNT] = False
    residuals, nats = np.full(problem.seen.shape, np.nan), np.empty(len(parts))
    at_fit, slopes = problem.residuals(fitted.response), fitted.response.by_parameter[:, problem.answers]
    remembers = any(effect.remembers for effect in model.effects)
    for number, (rows, (gradient, own)) in enumerate(zip(parts, known, strict=True)):
        free = ~alone[number]
        step = _step_without(information - own, gradient, free)
        leans = ((fitted.vector <= prior.lower) & (step < 0.0)) | ((fitted.vector >= prior.upper) & (step > 0.0))
        if leans.any():
            step = _step_without(information - own, gradient, free & ~leans)
        step *= min(1.0, 1.0 / max(float(np.max(np.abs(step[:SOIL_COUNT]) / LONGEST)), 1e-12))
        vector = np.clip(fitted.vector + step, prior.lower, prior.upper)
        if remembers:
            channels = model.predict(samples.drive, problem.imposed, vector, fitted.theta_1).channels[rows]
        else:
            part = select_rows(samples.drive, rows)
            channels = model.predict(part, problem.imposed[rows], vector, fitted.theta_1[rows]).channels
        # Rows around the block lie as the other parameters have them, to first order.
        there = at_fit - np.nan_to_num(slopes @ (vector - fitted.vector))
        there[rows] = np.where(problem.seen[rows], problem.measured[rows] - channels[:, problem.answers], np.nan)
        residuals[rows] = there[rows]
        missed = np.where(np.isfinite(there), there, problem.measured)
        nats[number] = -problem.loss(missed, fitted.noise, fitted.response)[rows].sum()
    return HeldOut(nats, np.where(problem.seen, residuals, np.nan), bool(alone.any()))


def _step_without(information: np.ndarray, gradient: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Newton step (p,) that takes a block's gradient out of a fit, by those parameters that are `free`."""
    step = np.zeros(len(gradient))
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information)[free], 1e-300))
    scaled = information[np.ix_(free, free)] * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += _RIDGE
    step[free] = -scale * np.linalg.solve(scaled, scale * gradient[free])
    return step
