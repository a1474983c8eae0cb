"""How well load and slip are known: neighbours show how noisy they are at most, answers that follow them how little.

A slip that really changes from row to row looks like one that is measured badly. What the wheel answers tells them
apart: it follows the former, and not the latter.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar

from ....framework.core.recording.types import WheelTable
from ....framework.core.soil import SoilKnowledge
from ....framework.core.vehicle import Vehicle, Wheel
from ...effects.effect import LOAD, SLIP
from ...noise import in_time, least_noise, noise_of_series
from ...restless import TOLD, said
from .fitting import Fitted, Problem
from .samples import Samples, gather
from .textbook import fit_textbook

_LEAST, _NEAR = math.log(0.05), 0.1
"""ln of the least share of the noise that neighbours show, and how near it is sought [-]."""

_MUCH_LESS = 0.7
"""Share of the noise that neighbours in an answer show below which what is left of them tells it better [-]."""


def gathered(table: WheelTable, wheel: Wheel, vehicle: Vehicle, known: SoilKnowledge) -> Samples:
    """Choose and lay out the rows as `gather` does, with the noise of each channel that the answers bear out.

    Parameters
    ----------
    table, wheel, vehicle
        As in `gather`; what the vehicle states of the noise stands.
    known
        What is known of the soil from elsewhere.

    Raises
    ------
    InputError
        As in `gather`, or no soil carries the load of most rows.
    """
    samples = gather(table, wheel, vehicle)
    if not samples.drive.timed or samples.stated[[LOAD, SLIP, *samples.answers]].all():
        return samples
    problem, fitted = fit_textbook(samples, known)
    noise = _of_answers(samples, problem, fitted)
    load, slip = noise_shares(Problem(replace(problem.samples, noise=noise), known), fitted).tolist()
    if min(load, slip) < 1.0:
        shown = samples.noise[[LOAD, SLIP]]
        samples = gather(table, wheel, vehicle, (load, slip))
        noise[[LOAD, SLIP]] = samples.noise[[LOAD, SLIP]]
        samples = replace(samples, notes=(*samples.notes, *said(shown, shown * [load, slip])))
    return replace(samples, noise=noise)


def _of_answers(samples: Samples, problem: Problem, fitted: Fitted) -> np.ndarray:
    """Noise (5,) of all channels, that of the answers less than neighbours show where load and slip make most of it.

    What errors of load and slip leave in them counts with it: it is rather too much.
    """
    noise = samples.noise.copy()
    free = 1.0 - len(fitted.vector) / max(np.count_nonzero(problem.seen), len(fitted.vector) + 1)
    for position, channel in enumerate(problem.answers):
        left = noise_of_series(in_time(fitted.residuals[:, position], samples.drive.stretch)) / math.sqrt(free)
        if not samples.stated[channel] and left < _MUCH_LESS * noise[channel]:
            noise[channel] = max(left, least_noise(samples.measured[:, channel]))
    return noise


def noise_shares(problem: Problem, fitted: Fitted) -> np.ndarray:
    """Shares (2,) of the noise of load and of slip beside which a fit's residuals are likeliest.

    It is 1 where the noise is stated, or less of it is not much likelier. A form that is wrong leaves more than there
    is: the shares are rather too large. They are those of all rows together.
    """
    samples, shares = problem.samples, np.ones(2)
    for index, channel in ((1, SLIP), (0, LOAD)):
        lowest = max(_LEAST, math.log(least_noise(samples.measured[:, channel]) / samples.noise[channel]))
        if samples.stated[channel] or lowest > -_NEAR:
            continue
        loss = partial(_loss, problem, fitted, shares, index)
        found = minimize_scalar(loss, bounds=(lowest, 0.0), method="bounded", options={"xatol": _NEAR})
        if loss(0.0) - found.fun > TOLD:
            shares[index] = math.exp(found.x)
    return shares


def _loss(problem: Problem, fitted: Fitted, shares: np.ndarray, index: int, log_share: float) -> float:
    """Loss [nats] of a fit beside the likeliest noise of the answers, with another share of one of load and slip."""
    tried = shares.copy()
    tried[index] = math.exp(log_share)
    other = copy(problem)
    other.latent_covariance = problem.latent_covariance * np.outer(tried, tried)
    return other.least_loss(fitted.response, fitted.vector, fitted.noise, problem.prior(fitted.model))
