"""Likelihood ratio of errors of form against soil that varies along the track.

Near a fit each sample's log-likelihood is quadratic in what the parameters differ by: s' d - d' I d / 2, with its
score s and its information I. The soil of the place differs from the mean soil by Gaussian processes that are forgotten
along the track, of cohesion, friction and stiffness; the freedoms of the form differ from the textbook's values by the
same everywhere. The processes are integrated out, their standard deviations and their length estimated with and without
the freedoms (a linear mixed model; D. A. Harville, J. Am. Stat. Assoc. 72 (1977), 320-338). So an error of form, which
goes with slip and load, is weighed against ground that happens to do so.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

_BINS = 60
"""Pieces of the track at most, in each of which the soil is one: a drive of a minute is resolved to a second."""

_LEAST, _MOST = 1e-4, 0.5
"""Range of the relative standard deviation of soil along a track [-]: different soils of a class differ by less."""

_SHORTEST, _LONGEST = 1.0, 0.5
"""Range of the length of the processes: from one piece to a share of the track."""


def likelihood_ratio(
    scores: np.ndarray, information: np.ndarray, precision: np.ndarray, prior: np.ndarray, ground: np.ndarray,
    soil: int,
) -> float:  # fmt: skip
    """Twice the log-likelihood that the freedoms of the form gain over soil that varies along the track.

    Parameters
    ----------
    scores, information : (n, p), (n, p, p)
        Of each sample in the order of the track, with respect to the soil and then the freedoms.
    precision, prior : (p,)
        Of their priors, and the scores of these; 0 where there is none.
    ground : (p, g)
        By what they change where the soil of the place varies by a share, for each of g processes.
    soil
        How many of the p are the soil's.
    """
    pieces = np.array_split(np.arange(len(scores)), min(_BINS, max(len(scores) // 4, 1)))
    by_piece = np.array([scores[rows].sum(axis=0) for rows in pieces])
    within = np.array([information[rows].sum(axis=0) for rows in pieces])
    apart = np.abs(np.subtract.outer(*2 * [np.arange(len(pieces))]))
    # The quadratic form in the processes at all pieces, (g b,), and in what all samples share, (p,).
    slope = np.concatenate([(by_piece @ ground).T.ravel(), by_piece.sum(axis=0) + prior])
    own = np.einsum("bpq,pk,ql->klb", within, ground, ground)
    curvature = np.block([[np.diag(each) for each in row] for row in own])
    shared = np.einsum("pk,bpq->kbq", ground, within).reshape(-1, len(precision))
    curvature = np.block([[curvature, shared], [shared.T, within.sum(axis=0) + np.diag(precision)]])
    soil += len(slope) - len(precision)
    bounds = [(np.log(_LEAST), np.log(_MOST))] * ground.shape[1]
    bounds.append((np.log(_SHORTEST), np.log(max(_LONGEST * len(pieces), 2.0))))
    begun = np.append(np.full(ground.shape[1], np.log(0.02)), np.log(max(0.1 * len(pieces), 1.5)))
    most = []
    for kept in (soil, len(slope)):
        given = slope[:kept], curvature[:kept, :kept], apart, soil
        try:
            most.append(-minimize(_loss, begun, given, "L-BFGS-B", jac=True, bounds=bounds).fun)
        except np.linalg.LinAlgError:
            return 0.0  # a matrix that is singular to rounding: the samples say nothing of the soil, nor of its form
    return 2.0 * (most[1] - most[0])


def _loss(
    parameters: np.ndarray, slope: np.ndarray, curvature: np.ndarray, apart: np.ndarray, soil: int
) -> tuple[float, np.ndarray]:  # fmt: skip
    """Minus the log-likelihood with the processes and the soil integrated out, and its gradient.

    Parameters
    ----------
    parameters : (g + 1,)
        Logarithms of the standard deviations of the processes and of their length [pieces].
    slope, curvature : (k,), (k, k)
        The quadratic form in the g processes at b pieces, then in what all samples share.
    apart : (b, b)
        Distances of the pieces.
    soil
        The first of the k that are integrated out; the others take their most likely values.
    """
    variances, length, count = np.exp(2.0 * parameters[:-1]), np.exp(parameters[-1]), len(apart)
    along = np.exp(-((apart / length) ** 2) / 2.0)
    prior = cho_factor(along + 1e-6 * np.eye(count), lower=True, check_finite=False)
    by_length = along * (apart / length) ** 2
    # d(R^-1) = -R^-1 dR R^-1, and d log|R| = tr(R^-1 dR).
    inverse = cho_solve(prior, np.eye(count), check_finite=False)
    bent = inverse @ by_length @ inverse
    blocks = [slice(at * count, (at + 1) * count) for at in range(len(variances))]
    whole = curvature.copy()
    for block, variance in zip(blocks, variances, strict=True):
        whole[block, block] += inverse / variance
    root = cho_factor(whole, lower=True, check_finite=False)
    best = cho_solve(root, slope, check_finite=False)
    # The leading block of the factor is the factor of the leading block.
    leading = root[0][:soil, :soil]
    posterior = cho_solve((leading, True), np.eye(soil), check_finite=False)
    value = 0.5 * float(slope @ best) - float(np.log(np.diag(leading)).sum())
    value -= len(blocks) * float(np.log(np.diag(prior[0])).sum()) + count * float(parameters[:-1].sum())
    gradient = np.zeros(len(parameters))
    for at, (block, variance) in enumerate(zip(blocks, variances, strict=True)):
        seconds = (np.outer(best[block], best[block]) + posterior[block, block]) / variance
        gradient[at] = float(np.sum(seconds * inverse)) - count
        gradient[-1] += 0.5 * float(np.sum(seconds * bent)) - 0.5 * float(np.sum(inverse * by_length))
    return -value, -gradient
