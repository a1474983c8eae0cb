"""How well a model predicts blocks of rows that it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....framework.core.soil import PARAMETERS
from ...effects.drive import select_rows
from ...mechanics.augmented import SOIL_COUNT, Response
from .fitting import Fitted, Problem
from .samples import Samples
from .steps import LONGEST, Prior, normal_equations, scaled_inverse, scaled_solve, step_of

_LEAST_LEVERAGE = 1e-9

_ALONE = 0.9
"""A block with more than this share of what is known of a parameter does not test it: nothing else tells it [-]. Of two
crossings neither has so much. With neighbours in time it has what a crossing tells of an edge between them."""

_OF_AN_EDGE = 0.1
"""Share of what is known of an edge from which on a block is one of those neighbours [-]."""

_FAR, _LONG = 2.0, 0.2
"""Nats that the other rows gain by a step, and share of the longest ones [-], beyond which it is not taken at its word:
along a ridge on which parameters trade off, a long one gains little and leads astray."""

_STEPS, _ENOUGH = 12, 0.2
"""Steps in which the other rows are fitted again, and what one promises [nats] before which it is not taken."""

_VAGUE = 0.1
"""Precision where there is no prior, that is of ln stiffness: it is known to three or so."""


@dataclass(frozen=True)
class HeldOut:
    """Predictive log-likelihood of each block [nats], what is known of the soil being one more where anything is, and
    the residuals (n, m), SI, of rows while held out; `untested` where a block alone tells what a place is like,
    or where it ends, or two neighbours do.
    """

    nats: np.ndarray
    residuals: np.ndarray
    untested: bool = False

    def error(self, problem: Problem) -> float:
        """Mean logarithm of the channels' errors on held-out rows; what was not predicted is off by all of it."""
        left = np.where(np.isfinite(self.residuals), self.residuals, problem.measured)
        squares = np.nanmean(np.where(problem.seen, left, np.nan) ** 2, axis=0)
        return float(np.mean(np.log(np.maximum(squares, 1e-300))))

    def gain(self, other: HeldOut) -> tuple[float, float]:
        """Nats gained over another model, and their standard deviation from the scatter between blocks."""
        return summed(self.nats - other.nats)


def summed(each: np.ndarray) -> tuple[float, float]:
    """Sum what blocks (b,) gain, and give its standard deviation from the scatter between them."""
    return float(each.sum()), float(np.std(each, ddof=1) * np.sqrt(len(each)))


def hold_out(problem: Problem, fitted: Fitted, *, again: bool = True) -> HeldOut:
    """Predict each block from a fit to all others.

    The fit without a block is one Newton step away from the fit with it, its rows taken out of the normal equations;
    where that step is long or crosses a bound, the other rows are fitted `again`. The prediction at the parameters
    found is then the full model's, not a linear one.

    A place that is crossed once tells alone what its ground is like, and where it ends; and a run that is one block
    what its zeros were. The block that holds it is predicted with these parameters as they are, and charged with what
    they take from it: as many nats as it has parameters of its own (H. Akaike, IEEE Trans. Autom. Control 19 (1974),
    716-723).
    """
    samples = problem.samples
    blocks = np.unique(samples.block)
    prior = problem.prior(fitted.model)
    parts = [samples.block == block for block in blocks]
    told = [normal_equations(fitted.innovations[rows], fitted.jacobian[rows]) for rows in parts]
    told_by_one = told_alone(fitted, samples, np.array([np.diag(own) for _, own in told]))
    local, places = of_places(fitted), of_places(fitted, runs=False)
    information = np.sum([own for _, own in told], axis=0) + np.diag(prior.precision)
    residuals = np.full_like(problem.measured, np.nan)
    nats, untested = np.empty(len(blocks)), False
    response = fitted.response
    at_fit = problem.residuals(response)
    slopes = response.by_parameter[:, problem.answers]
    for number, (rows, (gradient, own), alone) in enumerate(zip(parts, told, told_by_one, strict=True)):
        untested |= bool((alone & places).any())
        step = _step_without(information - own, gradient, ~alone)
        # What leans on a bound stays there, and the others do not make up for its leaving.
        leans = ((fitted.vector <= prior.lower) & (step < 0.0)) | ((fitted.vector >= prior.upper) & (step > 0.0))
        if leans.any():
            step = _step_without(information - own, gradient, ~alone & ~leans)
        vector = np.clip(fitted.vector + step, prior.lower, prior.upper)
        # Load and slip are corrected as at the fit; the soil's variation is followed from the neighbours as they look
        # at these parameters.
        long = np.any(vector != fitted.vector + step) or np.any(np.abs(step[:SOIL_COUNT]) > _LONG * LONGEST)
        if again and (long or 0.5 * float(step @ (information - own) @ step) > _FAR):
            # Where a place ends is for its own rows to say: without them it would end anywhere.
            start = np.where(local, vector, fitted.vector)
            channels = _fitted_to(problem, fitted, start, ~rows, prior.holding(start, local)).channels
            there = at_fit - (channels - response.channels)[:, problem.answers]
        else:
            channels = _predicted(problem, fitted, vector, rows)
            there = at_fit - slopes @ (vector - fitted.vector)
            there[rows] = at_fit[rows] - (channels - response.channels[rows])[:, problem.answers]
        residuals[rows] = there[rows]
        nats[number] = -problem.loss(there, fitted)[rows].sum() - _taken(information, own, alone)
    if problem.known.values:
        nats = np.append(nats, soil_nats(problem, fitted, *normal_equations(fitted.innovations, fitted.jacobian)))
    return HeldOut(nats, np.where(problem.seen, residuals, np.nan), untested)


def of_places(fitted: Fitted, *, edges: bool = False, runs: bool = True) -> np.ndarray:
    """(p,) True for parameters of a place along the track, or of a run where those of `runs` are meant, too; or for
    those of a place's `edges` alone.
    """
    answer = np.zeros(len(fitted.vector), dtype=bool)
    for effect, where in fitted.model.slices():
        own = answer[where]
        own[effect.edges if edges else slice(None)] = effect.local or (effect.by_run and runs and not edges)
    return answer


def told_alone(fitted: Fitted, samples: Samples, own: np.ndarray) -> np.ndarray:
    """(b, p) True for parameters of a place or a run that a block tells alone, of which it has `own` (b, p)
    information, or an edge that it tells alone with the blocks before and after it, in which the way goes on and does
    not turn.
    """
    known, edges = own.sum(axis=0), of_places(fitted, edges=True)
    block, stretch = samples.block, samples.drive.stretch
    number = np.unique(block, return_inverse=True)[1]
    ends = np.flatnonzero((np.diff(number) == 1) & (np.diff(stretch) == 0))
    goes_on = np.zeros((len(own) - 1, 1))
    for end in number[ends]:
        # Out and back are two crossings.
        way = np.diff(samples.position[(number == end) | (number == end + 1)])
        goes_on[end] = float(not ((way > 0.0).any() and (way < 0.0).any()))
    near = own.copy()
    near[1:] += goes_on * own[:-1]
    near[:-1] += goes_on * own[1:]
    shared = edges & (own > _OF_AN_EDGE * known) & (near > _ALONE * known)
    return (of_places(fitted) & (own > _ALONE * known)) | shared


def _step_without(information: np.ndarray, gradient: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Newton step (p,) that takes a block's gradient out of a fit, by those parameters that are `free` to move."""
    step = np.zeros(len(gradient))
    step[free] = -scaled_solve(information[np.ix_(free, free)], gradient[free], _LEAST_LEVERAGE)
    return step


def _fitted_to(problem: Problem, fitted: Fitted, vector: np.ndarray, kept: np.ndarray, prior: Prior) -> Response:
    """Answers of a model fitted again, from a vector (p,), to the rows that are `kept` (n,), noise as it is."""
    response, damping = fitted.response, 1e-3
    if not np.array_equal(vector, fitted.vector):
        response = problem.linearise(fitted.model, vector, response.entry(vector - fitted.vector))
    innovations, jacobian, loss = problem.whitened(response, fitted.noise)
    total = float(loss[kept].sum()) + prior.loss(vector)
    for _ in range(_STEPS):
        step, promised = step_of(innovations[kept], jacobian[kept], prior, vector, damping)
        if promised < _ENOUGH:
            break
        trial = np.clip(vector + step, prior.lower, prior.upper)
        answer = problem.linearise(fitted.model, trial, response.entry(trial - vector))
        looks = problem.whitened(answer, fitted.noise, fitted.response)
        reached = float(looks[2][kept].sum()) + prior.loss(trial)
        if reached < total:
            vector, response, total, damping = trial, answer, reached, max(damping / 6.0, 1e-6)
            innovations, jacobian, _ = looks
        else:
            damping *= 10.0
    return response


def _taken(information: np.ndarray, own: np.ndarray, alone: np.ndarray) -> float:
    """Parameters that a block tells alone [nats]: how much of them comes from it, and not from the prior."""
    inside = np.ix_(alone, alone)
    return float(np.trace(scaled_inverse(information[inside]) @ own[inside])) if alone.any() else 0.0


def soil_nats(
    problem: Problem, fitted: Fitted, gradient: np.ndarray, information: np.ndarray, sd: float = np.inf
) -> float:
    """Predictive log-density of what is known of the soil, by a fit that is not told it [nats].

    A model that explains the recording with another soil than the one that was measured explains the two less well than
    one that needs no other.

    Parameters
    ----------
    problem, fitted
        The samples, and the fit.
    gradient, information
        Of the log-likelihood (p,), (p, p) by the fit's parameters, and by corrections beside them, if there are any.
    sd
        Standard deviation of these before any data.
    """
    where = [PARAMETERS.index(name) for name in problem.known.values]
    further = len(gradient) - len(fitted.vector)
    told, untold = problem.prior(fitted.model), problem.prior(fitted.model, told=False).beside(further, sd)
    vector = np.concatenate([fitted.vector, np.zeros(further)])
    gradient = gradient + untold.precision * (untold.mean - vector)
    vague = np.where(untold.precision > 0.0, untold.precision, _VAGUE)
    spread = scaled_inverse(information + np.diag(vague))
    predicted = np.clip(vector + spread @ gradient, untold.lower, untold.upper)[where]
    covariance = spread[np.ix_(where, where)] + np.diag(1.0 / told.precision[where])
    away = told.mean[where] - predicted
    return -0.5 * float(away @ np.linalg.solve(covariance, away) + np.linalg.slogdet(2.0 * np.pi * covariance)[1])


def _predicted(problem: Problem, fitted: Fitted, vector: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Channels (k, 5) of some rows at other parameters; from the whole drive where an effect remembers."""
    drive, model = problem.samples.drive, fitted.model
    if any(effect.remembers for effect in model.effects):
        return model.predict(drive, problem.imposed, vector, fitted.theta_1).channels[rows]
    return model.predict(select_rows(drive, rows), problem.imposed[rows], vector, fitted.theta_1[rows]).channels
