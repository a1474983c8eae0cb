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
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize

_BINS = 60
"""Pieces of the track at most, in each of which the soil is one: a drive of a minute is resolved to a second."""

_LEAST, _MOST = 1e-4, 0.5
"""Range of the relative standard deviation of soil along a track [-]: different soils of a class differ by less."""

_SHORTEST, _LONGEST = 1.0, 0.5
"""Range of the length of the processes: from one piece to a share of the track."""


def likelihood_ratio(
    scores: np.ndarray, information: np.ndarray, precision: np.ndarray, ground: np.ndarray, soil: int
) -> float:  # fmt: skip
    """Twice the log-likelihood that the freedoms of the form gain over soil that varies along the track.

    Parameters
    ----------
    scores, information : (n, p), (n, p, p)
        Of each sample in the order of the track, with respect to the soil and then the freedoms.
    precision : (p,)
        Of their priors; 0 where there is none.
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
    slope = np.concatenate([(by_piece @ ground).T.ravel(), by_piece.sum(axis=0)])
    own = np.einsum("bpq,pk,ql->klb", within, ground, ground)
    curvature = np.block([[np.diag(each) for each in row] for row in own])
    shared = np.einsum("pk,bpq->kbq", ground, within).reshape(-1, len(precision))
    curvature = np.block([[curvature, shared], [shared.T, within.sum(axis=0) + np.diag(precision)]])
    soil += len(slope) - len(precision)

    def gain(parameters: np.ndarray, kept: int) -> float:
        """Log-likelihood of the first `kept` numbers, the processes and the soil integrated out."""
        sd, length = np.exp(parameters[:-1]), np.exp(parameters[-1])
        along = np.exp(-((apart / length) ** 2) / 2.0) + 1e-6 * np.eye(len(pieces))
        prior = np.linalg.cholesky(along)
        inverse = cho_solve((prior, True), np.eye(len(pieces)))
        whole = curvature.copy()
        count = ground.shape[1] * len(pieces)
        whole[:count, :count] += block_diag(*(inverse / each**2 for each in sd))
        whole = whole[:kept, :kept]
        root = cho_factor(whole, lower=True)
        best = solve_triangular(root[0], slope[:kept], lower=True)
        log_prior = sum(2.0 * (len(pieces) * np.log(each) + np.log(np.diag(prior)).sum()) for each in sd)
        return 0.5 * float(best @ best) - float(np.log(np.diag(root[0])[:soil]).sum()) - 0.5 * float(log_prior)

    bounds = [(np.log(_LEAST), np.log(_MOST))] * ground.shape[1]
    bounds.append((np.log(_SHORTEST), np.log(max(_LONGEST * len(pieces), 2.0))))
    begun = np.append(np.full(ground.shape[1], np.log(0.02)), np.log(max(0.1 * len(pieces), 1.5)))
    most = [
        -minimize(lambda at, kept=kept: -gain(at, kept), begun, method="L-BFGS-B", bounds=bounds).fun
        for kept in (soil, len(slope))
    ]
    return 2.0 * (most[1] - most[0])
