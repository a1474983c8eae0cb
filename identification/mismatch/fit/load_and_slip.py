"""How well load and slip are known: neighbours show how noisy they are at most, answers that follow them how little.

`restless` tells it beside one soil that is the same everywhere; here the ground varies, too, and what varies looks like
errors of load and slip.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar

from ....framework.core.errors import InputError
from ....framework.core.recording.types import WheelTable
from ....framework.core.soil import SoilKnowledge
from ....framework.core.vehicle import Vehicle, Wheel
from ...effects.effect import LOAD, SLIP
from ...errors_in_variables import Fit
from ...estimation import Measured, solve, usable
from ...mechanics.augmented import Entry
from ...noise import in_time, least_noise, noise_of_series
from ...restless import FEWEST, TOLD, beside_any_noise, said
from .fitting import Fitted, Problem, fit
from .samples import Samples, comparable, laid_out
from .soil_variation import NoiseModel
from .textbook import QUIET, fit_textbook
from .together import together

_LEAST, _MOST, _NEAR = math.log(0.05), -1e-3, 0.1
"""ln of the least share of the noise that neighbours show, of the whole of it, and how near a share is sought [-]."""

_MUCH_LESS = 0.7
"""Share of the noise that neighbours in an answer show below which what is left of them tells it better [-]."""

_ENOUGH = 300
"""Rows that tell where to look: they know a noise to four parts in a hundred."""


def gathered(table: WheelTable, wheel: Wheel, vehicle: Vehicle, known: SoilKnowledge) -> Samples:
    """Choose and lay out the rows as `gather` does, with the noise of each channel that the answers bear out.

    Parameters
    ----------
    table, wheel, vehicle
        As in `comparable`; what the vehicle states of the noise stands.
    known
        What is known of the soil from elsewhere.

    Raises
    ------
    InputError
        As in `comparable`, or no soil carries the load of most rows.
    """
    chosen = comparable(table, wheel, vehicle)
    samples = laid_out(chosen)
    if not samples.drive.timed or samples.stated[[LOAD, SLIP, *samples.answers]].all():
        return samples
    problem, fitted = fit_textbook(samples, known)
    cleared, alike = problem.samples, _one_soil(problem.samples, known)
    least = _of_answers(samples, problem, fitted, alike)

    def of_less_noise(shares: np.ndarray) -> Samples:
        """Give the rows with shares (2,) of the noise that neighbours show of load and slip."""
        return _with_noise(laid_out(chosen, tuple(shares.tolist())), least)

    def without_gross_errors(shares: np.ndarray) -> Samples:
        answer = of_less_noise(shares)
        measured = np.where(np.isfinite(cleared.measured), answer.measured, math.nan)
        return replace(answer, measured=measured)

    shares = noise_shares(samples, without_gross_errors, known, fitted, alike)
    if shares.min() == 1.0:
        return _with_noise(samples, _of_answers(samples, problem, fitted, []))
    answer, shown = of_less_noise(shares), samples.noise[[LOAD, SLIP]]
    return replace(answer, notes=(*answer.notes, *said(shown, shown * shares)))


def _with_noise(samples: Samples, noise: np.ndarray) -> Samples:
    """Give the samples with a noise (5,) of the answers; that of load and slip stays."""
    noise = noise.copy()
    noise[[LOAD, SLIP]] = samples.noise[[LOAD, SLIP]]
    return replace(samples, noise=noise)


def _of_answers(samples: Samples, problem: Problem, fitted: Fitted, alike: list[Fit]) -> np.ndarray:
    """Noise (5,) of all channels, that of the answers less than neighbours show where load and slip make most of it.

    What errors of load and slip leave in them counts with it, but in the fits beside any noise of these (`alike`).
    """
    noise = samples.noise.copy()
    free = 1.0 - len(fitted.vector) / max(np.count_nonzero(problem.seen), len(fitted.vector) + 1)
    for position, channel in enumerate(problem.answers):
        left = noise_of_series(in_time(fitted.residuals[:, position], samples.drive.stretch)) / math.sqrt(free)
        less = [left] if left < _MUCH_LESS * noise[channel] else []
        less += [float(np.exp(each.point.log_sd[channel])) / math.sqrt(free) for each in alike]
        if less and not samples.stated[channel]:
            noise[channel] = max(min(*less, noise[channel]), least_noise(samples.measured[:, channel]))
    return noise


def _one_soil(samples: Samples, known: SoilKnowledge) -> list[Fit]:
    """Fit one soil beside the likeliest noise of all channels, and of load and slip alone; none where rows are few."""
    if len(samples) < FEWEST:
        return []
    rows = np.linspace(0, len(samples) - 1, min(len(samples), _ENOUGH)).astype(int)
    compared = [LOAD, SLIP, *samples.answers]
    channels, noise = np.full_like(samples.measured[rows], math.nan), np.full_like(samples.noise, math.nan)
    channels[:, compared], noise[compared] = samples.measured[rows][:, compared], samples.noise[compared]
    free = ~samples.stated & np.isfinite(noise)
    try:
        measured = usable(Measured(channels, noise, samples.drive.time_s[rows], samples.stated))
        solution = solve(measured, samples.wheel, known)
    except InputError:
        return []
    imposed = free & np.isin(np.arange(len(free)), [LOAD, SLIP])
    found = [beside_any_noise(solution, measured, each) for each in (free, imposed) if each.any()]
    return [each for each in found if each.log_likelihood > solution.fit.log_likelihood + TOLD]


def noise_shares(
    samples: Samples, laid_out: Callable[[np.ndarray], Samples], known: SoilKnowledge, fitted: Fitted, alike: list[Fit]
) -> np.ndarray:
    """Shares (2,) of the noise of load and of slip beside which the textbook wheel's residuals are likeliest.

    It is 1 where the noise is stated, or less of it is not much likelier. A form that is wrong leaves more than there
    is: the shares are rather too large. They are those of all rows together.

    Parameters
    ----------
    samples
        With the noise that neighbours show.
    laid_out
        Gives them with shares of it.
    known
        What is known of the soil from elsewhere.
    fitted, alike
        The textbook wheel beside that noise, and beside the likeliest on ground that is the same everywhere.
    """
    fitted = _likeliest(samples, laid_out, known, fitted, alike)
    shares = np.ones(2)

    def loss(index: int, log_share: float) -> float:
        tried = shares.copy()
        tried[index] = math.exp(log_share)
        problem = Problem(laid_out(tried), known)
        response = problem.linearise(fitted.model, fitted.vector, Entry(fitted.theta_1))
        return problem.least_loss(response, fitted.vector, fitted.noise, problem.prior(fitted.model))

    def likeliest(index: int) -> float:
        channel = (LOAD, SLIP)[index]
        lowest = max(_LEAST, math.log(least_noise(samples.measured[:, channel]) / samples.noise[channel]))
        if samples.stated[channel] or lowest > -_NEAR:
            return 1.0
        of_one = partial(loss, index)
        found = minimize_scalar(of_one, bounds=(lowest, _MOST), method="bounded", options={"xatol": _NEAR})
        # A share next to one says the same of what really changes, where one itself leaves it open.
        return math.exp(found.x) if of_one(_MOST) - found.fun > TOLD else 1.0

    shares[1] = likeliest(1)
    shares[0] = likeliest(0)
    if shares[0] < 1.0:
        # Errors of the one hide those of the other.
        shares[1] = likeliest(1)
    return shares


def _likeliest(
    samples: Samples, laid_out: Callable[[np.ndarray], Samples], known: SoilKnowledge, fitted: Fitted, alike: list[Fit]
) -> Fitted:
    """Fit beside less noise of load and slip, too: where neighbours show much too much the soil may be wrong."""
    starts = [(np.ones(2), fitted.vector, fitted.noise)] if alike else []
    for each in alike:
        less = np.where(samples.stated, 1.0, np.fmin(np.exp(each.point.log_sd) / samples.noise, 1.0))
        shares = less[[LOAD, SLIP]]
        quiet = replace(fitted.noise, spread=np.full(2, QUIET))
        starts += [(shares, each.vector, quiet), (shares, fitted.vector, fitted.noise)]

    def refitted(start: tuple[np.ndarray, np.ndarray, NoiseModel]) -> Fitted:
        shares, vector, noise = start
        return fit(Problem(laid_out(shares), known), fitted.model, vector, noise, fitted.theta_1)

    return max(together(refitted, starts), key=lambda each: each.score, default=fitted)
