"""Statistically efficient estimation of soil parameters, with intervals and a statement of what the data determine.

Maximum likelihood with errors in all channels (`optimise`); where residuals exceed the sensors' noise, a
discrepancy variance is estimated with the parameters and carried into the intervals (after M. C. Kennedy, A. O'Hagan,
"Bayesian calibration of computer models", J. R. Stat. Soc. B 63 (2001), Eq. 5, with an independent discrepancy), and
its correlation from sample to sample lowers the number of samples that count. Where the samples contradict the form of
the model, its form is uncertain too (`form_error`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.stats import t as t_distribution

from ...framework.core.errors import InputError
from ...framework.core.findings import Finding, warning
from ...framework.core.soil import PARAMETERS, PLAUSIBLE, WRONG_FORM, SoilEstimate, SoilKnowledge
from ...framework.core.vehicle import Wheel
from ..mechanics.soil import Soil, from_internal, slope_of_internal, soil_vector, to_internal
from ..mechanics.stresses import rim_forces
from ..mechanics.textbook import CHANNELS, TextbookWheel, contact_array, entry_angle
from . import form_error
from .autocorrelation import are_correlated, correlation_time, rows_in_noise
from .computed_channels import FARTHEST, NUISANCES, ComputedChannels
from .identifiability import advise, separable, strengths
from .intervals import consistent, hull, parameter_intervals
from .likelihood import Problem
from .optimise import Fit, best_start, fit
from .solution import ANSWERS, Measured, Solution

_EXPLAINED = 1.1
"""A channel whose standard deviation comes out within this factor of the sensor's is explained by the model [-]."""

LEAST_ROWS = len(PARAMETERS)
"""Samples below which nothing is estimated: fewer than there are parameters."""

_STARTS = ((0.8, 0.02), (1.1, 0.005), (0.5, 0.03))
"""Starting values of n and k [m]; cohesion and friction start at 1 kPa and 30 degrees, the stiffness from the load."""


def estimate_soil(measured: Measured, wheel: Wheel, known: SoilKnowledge | None = None) -> SoilEstimate:
    """Estimate c, phi, k, stiffness and n of one soil.

    Parameters
    ----------
    measured
        Samples of one soil. Slip and load are needed, in each row slip, load or sinkage, and three channels in all.
    wheel
        The wheel.
    known
        What is known from elsewhere: a value without a standard deviation is held, one with it is a prior.

    Raises
    ------
    InputError
        Too few channels or samples.
    """
    kept = usable(measured)
    return summarise(solve(kept, wheel, known or SoilKnowledge()), kept, wheel)


def summarise(solution: Solution, kept: Measured, wheel: Wheel, *, notes: tuple[Finding, ...] = ()) -> SoilEstimate:
    """Turn a fit into an estimate: intervals, strength, what is determined and what driving would do for the rest.

    The `notes` of what was done with the samples before come after the findings of the fit.
    """
    covariance, bounded = solution.covariance(), physical(solution)
    findings: tuple[Finding, ...] = ()
    other = None
    if form_error.rejected(solution, WRONG_FORM):
        freed = physical(_freed(solution, kept, wheel))
        other = parameter_intervals(freed, freed.covariance())
        findings = (_wrong_form(solution, freed),)
    elif solution.misfit > WRONG_FORM:
        findings = (warning("ground_variation", misfit=solution.misfit),)
    intervals = parameter_intervals(bounded, covariance, other)
    # The textbook's values stand, for they predict best with the textbook; the intervals hold both readings.
    intervals = intervals if other is None else hull(bounded, intervals, other)
    strength = strengths(bounded, covariance, intervals, wheel)
    covariance = consistent(covariance, bounded, intervals)
    determined = separable(intervals.quantities, strength, solution.free, solution.misfit)
    seen = np.asarray(np.isfinite(kept.channels).any(axis=0))
    return SoilEstimate(
        parameters=intervals.quantities,
        mean_c_tan_phi=bounded.fit.vector[:2].copy(),
        covariance_c_tan_phi=covariance[:2, :2].copy(),
        correlation=_correlations(covariance, solution.free),
        shear_strength=strength,
        separable=determined,
        advice=advise(kept.channels, determined, strength, solution.misfit),
        method="ml",
        channels=tuple(name for name, present in zip(CHANNELS, seen.tolist(), strict=True) if present),
        n=len(kept.channels),
        misfit=solution.misfit,
        findings=(*findings, *notes),
    )


def _freed(solution: Solution, kept: Measured, wheel: Wheel) -> Solution:
    """Let the form of the model vary, and carry what is left out even so."""
    freed = form_error.with_freedom(solution, _starting_points(kept, wheel, _held(solution.problem)))
    observations, dof = _counts(freed.problem)
    assert freed.widening is not None
    least = unexplained(freed.problem, freed.fit) * observations / max(dof, 1.0)
    return replace(freed, widening=np.maximum(freed.widening, least))


def _wrong_form(solution: Solution, freed: Solution) -> Finding:
    """Warn of a wrong form, with what the freer form says of the soil."""
    c_Pa, tan_phi = freed.fit.vector[:2].tolist()
    return warning(
        "wrong_form", misfit=solution.misfit, misfit_with_freedom=misfit(freed.problem, freed.fit),
        c_Pa=c_Pa, phi_rad=math.atan(tan_phi),
    )  # fmt: skip


def usable(measured: Measured) -> Measured:
    """Keep the rows that have slip, a load or a sinkage, and three channels."""
    seen = np.isfinite(measured.channels)
    for channel, remedy in ((3, "slip, or both speeds"), (0, "load_N: the wheel's share of the weight, if not sensed")):
        if not seen[:, channel].any():
            raise InputError("wheel channels", f"no {CHANNELS[channel]} was observed", expected=remedy)
    if not np.nanmedian(measured.channels[:, 0]) > 0.0:
        raise InputError("wheel channels", "load_N is 0 or less in most rows", expected="a wheel that carries a load")
    rows = seen[:, 3] & (seen[:, 0] | seen[:, 2]) & (seen.sum(axis=1) >= 3)
    if rows.sum() < LEAST_ROWS:
        raise InputError(
            "wheel channels",
            f"{int(rows.sum())} rows with slip, load or sinkage, and a third channel",
            expected=f"at least {LEAST_ROWS}",
        )
    kept = measured.select(rows)
    return kept.select(np.argsort(kept.order, kind="stable"))


def solve(measured: Measured, wheel: Wheel, known: SoilKnowledge) -> Solution:
    """Fit, with cohesion free to be negative, and the soil's answers as uncertain as the model cannot explain them."""
    problem = build_problem(measured, wheel, known)
    observations, dof = _counts(problem)
    if dof < 1.0:
        raise InputError("wheel channels", f"{int(problem.seen.sum())} observations", expected="more than unknowns")
    best = converge(problem, wheel, known)
    correlation, repeated = unexplained(problem, best), _repeated(problem, best) if measured.timed else 1.0
    if correlation == 0.0:
        return Solution(problem, best, 1.0, _two_sided(dof), misfit(problem, best), timed=measured.timed)
    # The maximum-likelihood variance spends no degrees of freedom on the parameters; neighbours repeat each other.
    quantile = _two_sided(max(dof / correlation, 1.0))
    inflation = observations / dof * correlation
    return Solution(problem, best, inflation, quantile, misfit(problem, best), repeated=repeated, timed=measured.timed)


def _two_sided(dof: float) -> float:
    return float(t_distribution.ppf(0.975, dof))


def _counts(problem: Problem) -> tuple[float, float]:
    """Count the observations, priors included, and the degrees of freedom that the parameters leave of them."""
    # Every sample spends two observations on its own latents.
    observations = float(problem.seen.sum() - 2 * len(problem.seen) + np.isfinite(problem.prior_sd).sum())
    return observations, observations - float(problem.free.sum())


def unexplained(problem: Problem, best: Fit) -> float:
    """How many neighbouring samples say the same of what a fit leaves; 0 where independent noise explains all."""
    ratio = np.exp(best.point.log_sd[problem.answers]) / problem.noise[problem.answers]
    residuals = _weighted(problem, best)
    if not (ratio > _EXPLAINED).any():
        residuals = residuals[:, are_correlated(residuals)]
    return correlation_time(residuals) if residuals.size else 0.0


def _weighted(problem: Problem, best: Fit) -> np.ndarray:
    """Residuals (n, m) of the answers, gross errors made small."""
    return best.residuals[:, problem.answers] * np.sqrt(best.weights)[:, None]


def _repeated(problem: Problem, best: Fit) -> float:
    """How many neighbouring samples count as one because the noise is autocorrelated."""
    driven = problem.measured[:, problem.answers] * np.exp(-best.point.log_sd[problem.answers])
    return rows_in_noise(_weighted(problem, best), driven)


def converge(problem: Problem, wheel: Wheel, known: SoilKnowledge) -> Fit:
    """Fit from the best of several starts."""
    return fit(problem, best_start(problem, _starting_points(problem, wheel, known)))


def _starting_points(
    samples: Measured | Problem, wheel: Wheel, known: SoilKnowledge
) -> list[tuple[np.ndarray, np.ndarray]]:
    if isinstance(samples, Measured):
        channels, computed = samples.channels, samples.computed is not None
    else:
        channels, computed = samples.measured, len(samples.held) > len(PARAMETERS)
    starts = [_start(channels, wheel, known, n, k) for n, k in _STARTS]
    return [(np.append(vector, np.zeros(NUISANCES * computed)), theta_1) for vector, theta_1 in starts]


def _held(problem: Problem) -> SoilKnowledge:
    """Give back what a problem holds."""
    held = zip(PARAMETERS, problem.held[: len(PARAMETERS)].tolist(), strict=True)
    return SoilKnowledge({name: from_internal(name, value) for name, value in held if not math.isnan(value)})


def misfit(problem: Problem, best: Fit) -> float:
    """Root mean square over the answering channels of their standard deviation in units of the sensor's [-]."""
    ratio = np.exp(best.point.log_sd[problem.answers]) / problem.noise[problem.answers]
    return math.sqrt(float(np.mean(ratio**2))) if ratio.size else 1.0


def physical(solution: Solution) -> Solution:
    """Give the same fit with cohesion kept from being negative."""
    lower = solution.problem.lower.copy()
    lower[0] = 0.0
    problem = replace(solution.problem, lower=lower)
    cohesion = float(solution.fit.vector[0])
    if cohesion >= 0.0:
        return replace(solution, problem=problem)
    # Friction and all else go with cohesion: from anywhere else than along that ridge the way back is long.
    covariance = solution.fit.covariance(problem.free)
    ridge = covariance[:, 0] / max(covariance[0, 0], 1e-300)
    vector = np.clip(solution.fit.vector - ridge * cohesion, problem.lower, problem.upper)
    return replace(solution, problem=problem, fit=fit(problem, replace(solution.fit.point, vector=vector)))


def build_problem(measured: Measured, wheel: Wheel, known: SoilKnowledge) -> Problem:
    """Lay out what is measured and what is known as a problem in the textbook wheel's parameters.

    Raises
    ------
    InputError
        A channel that was observed has no standard deviation above zero.
    """
    for channel in np.flatnonzero(np.isfinite(measured.channels).any(axis=0)):
        noise = float(measured.noise[channel])
        if not 0.0 < noise < math.inf:
            raise InputError(
                "noise", f"that of {CHANNELS[channel]} is {noise}", expected="a standard deviation above 0"
            )
    mean, sd = np.zeros(len(PARAMETERS)), np.full(len(PARAMETERS), np.inf)
    held = np.full(len(PARAMETERS), np.nan)
    for index, name in enumerate(PARAMETERS):
        if name in known.sd:
            mean[index] = to_internal(name, known.values[name])
            sd[index] = known.sd[name] / slope_of_internal(name, known.values[name])
        elif name in known.values:
            held[index] = to_internal(name, known.values[name])
    lower = np.array([to_internal(name, PLAUSIBLE[name][0]) for name in PARAMETERS])
    upper = np.array([to_internal(name, PLAUSIBLE[name][1]) for name in PARAMETERS])
    lower[0] = -upper[0]
    answers = ANSWERS & np.isfinite(measured.channels).any(axis=0)
    model: TextbookWheel | ComputedChannels = TextbookWheel(wheel)
    if measured.computed is not None:
        computed = measured.computed
        model, own = ComputedChannels(model, computed.mean_load_N, computed.towed), computed.prior_sd
        mean, sd = np.append(mean, np.zeros(NUISANCES)), np.append(sd, np.where(own > 0.0, own, np.inf))
        held = np.append(held, np.where(own > 0.0, math.nan, 0.0))
        lower, upper = np.append(lower, -FARTHEST * own), np.append(upper, FARTHEST * own)
    return Problem(model, measured.channels, measured.noise, answers, mean, sd, held, lower, upper)


def _start(
    channels: np.ndarray, wheel: Wheel, known: SoilKnowledge, n: float, k: float
) -> tuple[np.ndarray, np.ndarray]:
    """Starting vector and entry angles: from sinkage, and the stiffness so that the loads are carried."""
    load, sinkage, slip = channels[:, 0], channels[:, 2], channels[:, 3]
    typical = float(np.nanmedian(sinkage)) if np.isfinite(sinkage).any() else 0.1 * wheel.radius_m
    depth = np.where(np.isfinite(sinkage), sinkage, typical)
    if not np.isfinite(sinkage).any():
        depth = typical * (np.clip(load / np.nanmedian(load), 0.1, 10.0)) ** (1.0 / (n + 0.5))
    theta_1 = entry_angle(np.clip(depth, 0.2 * abs(typical) + 1e-6, wheel.radius_m), wheel.radius_m)
    slip = np.clip(slip, -0.98, 0.98)
    values = {"c_Pa": 1e3, "phi_rad": math.radians(30.0), "k_m": k, "stiffness_Pa": 1e5, "n": n, **known.values}
    if "stiffness_Pa" not in known.values and np.isfinite(load).any():
        carried = rim_forces(contact_array(theta_1, slip, Soil(**values), wheel), wheel.width_m)[:, 0]
        share = float(np.nanmedian(load / np.where(carried > 0.0, carried, np.nan)))
        low, high = PLAUSIBLE["stiffness_Pa"]
        values["stiffness_Pa"] = float(np.clip(1e5 * share, low, high)) if share > 0.0 else 1e5
    return soil_vector(values), theta_1


def _correlations(covariance: np.ndarray, free: np.ndarray) -> dict[str, float]:
    sd = np.sqrt(np.diag(covariance))
    answer = {}
    for first in range(len(PARAMETERS)):
        for second in range(first + 1, len(PARAMETERS)):
            if free[first] and free[second] and sd[first] > 0.0 and sd[second] > 0.0:
                answer[f"{PARAMETERS[first]},{PARAMETERS[second]}"] = float(
                    np.clip(covariance[first, second] / (sd[first] * sd[second]), -1.0, 1.0)
                )
    return answer
