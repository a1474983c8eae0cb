"""Nats that a set of effects gains though none of them explains anything."""

from __future__ import annotations

import numpy as np

from ...effects.effect import LOAD, SLIP
from .averaging import quietness
from .fitting import Fitted, Problem
from .soil_variation import huber_loss

_GROSS, _FEW = 5.0, 0.02
"""A value is gross where a fit leaves so many noises of it, and where no more than this share of all are [-]."""


def of_quiet(problem: Problem, fitted: Fitted) -> float:
    """Nats that a delay gains because errors of averaged load and slip are quieter there, and not for being right."""
    weights = problem.weights or fitted.response
    by_latent = np.nan_to_num(weights.by_latent[:, problem.answers])
    answer = 0.0
    for effect, where in fitted.model.slices():
        late = effect.delay(fitted.vector[where])
        if late is None:
            continue
        channel, lag = late
        own = by_latent
        if channel in (LOAD, SLIP):
            own = by_latent * (np.array([LOAD, SLIP]) == channel)
        spread = np.einsum("nca,ab,ncb->nc", own, problem.latent_covariance, own)
        everything = np.einsum("nca,ab,ncb->nc", by_latent, problem.latent_covariance, by_latent)
        share = problem.seen * spread / (everything + fitted.noise.answers**2)
        if channel not in (LOAD, SLIP):
            share = share[:, problem.answers.index(channel)]
        answer += 0.5 * max(1.0 - quietness(lag), 0.0) * float(share.sum())
    return answer


def of_gross_errors(before: np.ndarray, after: np.ndarray) -> float:
    """Nats that whitened residuals (n, m) gain where they stay gross: a fit that bends towards a few wrong values."""
    gross = np.abs(after) > _GROSS
    if not 0 < gross.sum() <= _FEW * np.count_nonzero(after):
        return 0.0
    return max(float((huber_loss(before[gross]) - huber_loss(after[gross])).sum()), 0.0)
