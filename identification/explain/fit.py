"""Maximum a posteriori fits of soil, effects and noise, by damped Gauss-Newton steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...framework.core.concurrency import together
from ...framework.core.errors import InputError
from ...framework.core.soil import SoilKnowledge
from ..effects.effect import LOAD, SLIP, Effect
from ..mechanics.augmented import SOIL_COUNT, AugmentedWheel, Entry, Response
from .likelihood import Problem, White
from .samples import Samples
from .steps import Prior, scaled_inverse, solve_step
from .whitening import MAX_SMOOTHNESS, Noise

_LARGEST_STEP = np.array([np.inf, 0.5, 1.0, 1.0, 0.5])
"""Steps of c, tan phi, ln k, ln stiffness and ln n beyond which the linearisation fails."""

_LEAST_EXPECTED_GAIN = 0.02
"""The iteration ends when the expected gain of a step is below this [nats]."""

_MOST_NOISE_FITS, _MOST_STEPS = 3, 60
"""Most fits of the noise, and most steps, in a fit."""

_COARSE_NOISE = 0.1
"""Noise in the first search for a soil, relative to a channel's standard deviation [-]."""

_LEAST_CARRIED = 0.5
"""Least share of the rows whose load the fitted soil carries [-]."""

_DISTINCT = 0.02
"""Soils that differ by less in tan phi, ln k, ln stiffness and ln n are one initial value [-]."""

_SHARE_STEP, _LEAST_SHARE, _LEAST_SHARE_GAIN = 0.3, 0.01, 3.0
"""Factor between the shares of sensor noise that are compared [-], the least share [-], and the least gain of another
[nats]: an incorrect model inflates the noise."""

_LN_STATED_SD = 0.3
"""Standard deviation of ln of the noise of load or slip about what is stated: engineering judgement, as much of what is
stated was copied from a data sheet."""


@dataclass(frozen=True)
class Fitted:
    """A fit.

    Parameters
    ----------
    model, vector, noise
        The simulator, its parameters (p,) and the noise.
    score
        Log-posterior [nats], up to a constant that all fits of the same samples share.
    white
        Innovations and their derivatives.
    response
        The simulator's channels and derivatives.
    """

    model: AugmentedWheel
    vector: np.ndarray
    noise: Noise
    score: float
    white: White
    response: Response

    @property
    def theta_1(self) -> np.ndarray:
        """Entry angles (n,) [rad]."""
        return self.response.theta_1

    def information(self, problem: Problem) -> np.ndarray:
        """Information (p, p) of the log-posterior."""
        _, information = problem.normal_equations(self.white.innovations, self.white.jacobian)
        return information + problem.prior(self.model).precision

    def covariance(self, problem: Problem) -> np.ndarray:
        """Covariance (p, p) of the parameters."""
        return scaled_inverse(self.information(problem))


def fit(
    problem: Problem, model: AugmentedWheel, vector: np.ndarray, noise: Noise | None = None,
    entry: Entry | None = None, *, known: Response | None = None, free: np.ndarray | None = None,
    steps: int = _MOST_STEPS, fit_noise: bool = True,
) -> Fitted:  # fmt: skip
    """Fit a model from an initial value.

    Parameters
    ----------
    problem, model
        The samples and the simulator.
    vector : (p,)
        Initial parameters.
    noise, entry
        Initial noise and entry angles.
    known
        Response of the model less its last effect at the initial value.
    free : (p,)
        Which parameters are fitted; all where absent.
    steps
        Most steps.
    fit_noise
        Whether to fit the noise as well.
    """
    prior = problem.prior(model)
    vector = np.clip(vector, prior.lower, prior.upper)
    response = problem.linearise(model, vector, entry, known)
    if noise is None:
        noise = problem.best_noise(response, vector, problem.first_noise, model)
    white = problem.white(response, noise)
    total = float(white.loss.sum()) + prior.loss(vector)
    damping, noise_fits = 1e-3, 0
    for _ in range(steps):
        step, expected = _step(problem, white, prior, vector, damping, free)
        if expected < _LEAST_EXPECTED_GAIN:
            if not fit_noise or noise_fits == _MOST_NOISE_FITS:
                break
            before = total + problem.noise_loss(noise)
            refitted = problem.best_noise(response, vector, noise, model)
            noise_fits += 1
            trial_white = problem.white(response, refitted)
            there = float(trial_white.loss.sum()) + prior.loss(vector)
            converged = before - there - problem.noise_loss(refitted) < 5.0 * _LEAST_EXPECTED_GAIN
            noise, white, total = refitted, trial_white, there
            if converged:
                break
            continue
        trial = np.clip(vector + step, prior.lower, prior.upper)
        trial_response = problem.linearise(model, trial, response.entry(trial - vector))
        trial_white = problem.white(trial_response, noise)
        reached = float(trial_white.loss.sum()) + prior.loss(trial)
        if reached < total:
            gain = (total - reached) / expected
            # By the ratio of actual to expected gain (H. B. Nielsen, IMM-REP-1999-05, Technical University of Denmark).
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3), 1e-6)
            vector, response, white, total = trial, trial_response, trial_white, reached
        else:
            damping = max(damping, 1e-4) * 10.0
            if damping > 1e6:
                break
    return Fitted(model, vector, noise, -total - problem.noise_loss(noise), white, response)


def _step(
    problem: Problem, white: White, prior: Prior, vector: np.ndarray, damping: float, free: np.ndarray | None
) -> tuple[np.ndarray, float]:
    """Damped step (p,), limited to the range of the linearisation, and its expected gain [nats]."""
    gradient, information = problem.normal_equations(white.innovations, white.jacobian)
    step, expected = solve_step(gradient, information, prior, vector, damping, free)
    soils = step[: SOIL_COUNT * problem.grounds].reshape(-1, SOIL_COUNT)
    share = min(1.0, 1.0 / max(float(np.max(np.abs(soils) / _LARGEST_STEP)), 1e-12))
    return share * step, expected * share * (2.0 - share)


def fit_textbook(samples: Samples, known: SoilKnowledge | None = None) -> tuple[Problem, Fitted]:
    """Fit the textbook wheel from several soils, and fix the propagation of errors at the fit.

    Raises
    ------
    InputError
        No soil carries the load of most rows.
    """
    problem = Problem(samples, known, _stated_shares(samples))
    model, starts = AugmentedWheel(samples.wheel, grounds=problem.grounds), _first_fits(problem)
    fits = together(lambda start: fit(problem, model, start[0], None, Entry(start[1])), starts)
    best = max(fits, key=lambda fitted: fitted.score)
    carried = np.isfinite(best.theta_1)
    if carried.mean() < _LEAST_CARRIED:
        load_N = float(np.median(samples.drive.load_N[~carried]))
        raise InputError(
            "column load_N", f"no soil carries {load_N:.3g} N, the median of {int((~carried).sum())} of {len(carried)} "
            "rows", expected=f"newtons on a wheel of {samples.wheel.radius_m:g} m radius",
        )  # fmt: skip
    if np.isfinite(problem.gap).any():
        smoother = together(
            lambda smoothness: _fit_with_smoothness(problem, best, smoothness), range(1, MAX_SMOOTHNESS + 1)
        )
        best = max([best, *smoother], key=lambda fitted: fitted.score)
    problem, best = _fit_with_own_passes(problem, best)
    problem, best = _fit_noise_shares(problem, best)
    problem.reference = best.response
    return problem, fit(problem, model, best.vector, best.noise, best.response.entry())


def _fit_with_own_passes(problem: Problem, best: Fitted) -> tuple[Problem, Fitted]:
    """Fit ground that varies anew in each pass over a track, and return it if it explains the drive better."""
    samples = problem.samples
    parts = np.column_stack([samples.lane, np.nan_to_num(samples.drive.pass_number)])
    own = np.unique(parts, axis=0, return_inverse=True)[1].ravel()
    if len(np.unique(own)) == len(np.unique(samples.lane)) or not np.isfinite(problem.gap).any():
        return problem, best
    apart = Problem(replace(samples, lane=own), problem.known, problem.noise_share)
    fitted = fit(apart, best.model, best.vector, best.noise, Entry(best.theta_1))
    return (apart, fitted) if fitted.score > best.score else (problem, best)


def _fit_noise_shares(problem: Problem, best: Fitted) -> tuple[Problem, Fitted]:
    """Fit the shares of sensor noise in the white parts of slip and load.

    Smaller ones than the whole where the vehicle does not state the noise; larger ones than stated where it does, with
    the prior of a stated noise: much of what is stated was copied from a data sheet.
    """
    samples = problem.samples
    for index, channel in ((1, SLIP), (0, LOAD)) if samples.drive.timed else ():
        stated, first = samples.stated[channel], problem.noise_share[index]
        share, cost_before = first, 0.0
        while (share := min(share / _SHARE_STEP, 1.0) if stated else share * _SHARE_STEP) != problem.noise_share[index]:
            shares = list(problem.noise_share)
            shares[index] = share
            tried = Problem(samples, problem.known, (shares[0], shares[1]))
            fitted = fit(tried, best.model, best.vector, best.noise, Entry(best.theta_1))
            # The standard deviation goes as the root of the share.
            cost = 0.5 * (0.5 * math.log(share / first) / _LN_STATED_SD) ** 2 if stated else 0.0
            better = fitted.score - cost >= best.score - cost_before + _LEAST_SHARE_GAIN
            if better:
                problem, best, cost_before = tried, fitted, cost
            if share == 1.0 if stated else not better or share < _LEAST_SHARE:
                break
    return problem, best


def _fit_with_smoothness(problem: Problem, fitted: Fitted, smoothness: int) -> Fitted:
    """Fit again with smoother variation of the ground."""
    return fit(
        problem, fitted.model, fitted.vector, replace(fitted.noise, smoothness=smoothness), Entry(fitted.theta_1)
    )


def _stated_shares(samples: Samples) -> tuple[float, float]:
    """Shares of the stated sensor noise in the largest white parts of load and slip; 1 where none is stated."""
    shares = []
    for channel, path in ((LOAD, samples.load), (SLIP, samples.slip)):
        stated, white = samples.noise[channel] ** 2, float(np.max(path.white_sd**2))
        shares.append(min(1.0, max(stated / max(white, 1e-300), 1e-3)) if samples.stated[channel] else 1.0)
    return shares[0], shares[1]


def _first_fits(problem: Problem) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return soils (5 g,) of all grounds and entry angles (n,) [rad], the best first: each ground is fitted alone.

    The soil first, with uniform ground: variation along the track would explain the residuals of any soil.
    """
    samples, grounds = problem.samples, range(problem.grounds)
    rows = [np.flatnonzero(samples.drive.ground == ground) for ground in grounds]
    alone = [Problem(samples.on_ground(ground), problem.known, problem.noise_share) for ground in grounds]
    cases = [(each, soil) for each in alone for soil in first_soils(each)]
    fits = iter(together(lambda case: _fit_coarsely(*case), cases))
    distinct: list[list[Fitted]] = []
    for each in alone:
        distinct.append([])
        for start in sorted((next(fits) for _ in first_soils(each)), key=lambda fitted: -fitted.score):
            if not any(np.allclose(start.vector[1:], other.vector[1:], atol=_DISTINCT) for other in distinct[-1]):
                distinct[-1].append(start)
    answer = []
    for rank in range(max(map(len, distinct))):
        chosen = [of_ground[min(rank, len(of_ground) - 1)] for of_ground in distinct]
        theta_1 = np.empty(len(samples))
        for own, each in zip(rows, chosen, strict=True):
            theta_1[own] = each.theta_1
        answer.append((np.concatenate([each.vector for each in chosen]), theta_1))
    return answer


def _fit_coarsely(problem: Problem, soil: np.ndarray) -> Fitted:
    """Fit the textbook wheel on uniform ground, with noise in proportion to each channel's standard deviation."""
    scatter = np.nanstd(problem.samples.measured[:, problem.answers], axis=0)
    sd = np.where(scatter > 0.0, _COARSE_NOISE * scatter, problem.first_noise.sd)
    noise = replace(problem.first_noise, sd=sd, ground_sd=np.full(2, 1e-3))
    return fit(problem, AugmentedWheel(problem.samples.wheel), soil, noise, steps=15, fit_noise=False)


def first_soils(problem: Problem) -> list[np.ndarray]:
    """Initial soil vectors (5,): typical soils, stiff enough to carry the load at the sinkage measured."""
    samples = problem.samples
    radius, width = samples.wheel.radius_m, samples.wheel.width_m
    sinkage = samples.measured[:, 2]
    depth = float(np.nanmedian(sinkage)) if np.isfinite(sinkage).any() else 0.1 * radius
    depth = float(np.clip(depth, 2e-3 * radius, radius))
    load = float(np.median(problem.imposed[:, 0]))
    answer = []
    for n, k, friction in ((0.8, 0.02, 0.55), (1.1, 0.006, 0.6), (0.6, 0.03, 0.3)):
        # W is about the mean stress over the chord of the contact.
        chord = math.sqrt(2.0 * radius * depth)
        stress = load / (0.75 * width * chord)
        stiffness = stress * (n + 1.0) / (depth / width) ** n
        answer.append(np.array([500.0, friction, math.log(k), math.log(stiffness), math.log(n)]))
    return answer


def with_effect(base: Fitted, effect: Effect, start: np.ndarray) -> tuple[AugmentedWheel, np.ndarray]:
    """Return the model of a fit with one more effect, and its initial parameters (p,)."""
    soils, others = np.split(base.vector, [base.model.soils.stop])
    initial = [effect.initial_soil(soil) for soil in soils.reshape(-1, SOIL_COUNT)]
    return base.model.with_effects((*base.model.effects, effect)), np.concatenate([*initial, others, start])
