"""Lower bounds of a mixture: what is exceeded with a given confidence where the class itself is uncertain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import stdtr, stdtrit

_LEVELS = np.concatenate([np.geomspace(1e-7, 0.5, 96), 1.0 - np.geomspace(0.5, 1e-7, 96)[1:]])


@dataclass(frozen=True)
class MixtureTable:
    """Distribution functions of k classes on common nodes, so that a bound is a binary search.

    Parameters
    ----------
    nodes : (g,)
        Values, ascending.
    distribution : (g, k)
        Probability of not exceeding the node, by class.
    """

    nodes: np.ndarray
    distribution: np.ndarray

    @staticmethod
    def of_student(location: np.ndarray, scale: np.ndarray, freedom: np.ndarray, level: float) -> MixtureTable:
        """Tabulate Student t distributions, each (k,); nodes are their quantiles, that of `level` among them."""
        levels = np.append(_LEVELS, level)
        nodes = np.unique(location + scale * stdtrit(freedom, levels[:, None]))
        return MixtureTable(nodes, stdtr(freedom, (nodes[:, None] - location) / scale))

    @staticmethod
    def of_samples(samples: np.ndarray) -> MixtureTable:
        """Tabulate equally weighted samples, (s, k), finite or -inf."""
        ordered = np.sort(samples, axis=0)
        nodes = np.unique(ordered[np.isfinite(ordered)])
        if not len(nodes):
            nodes = np.zeros(1)
        below = np.zeros((len(nodes), samples.shape[1]))
        for each, column in enumerate(ordered.T):
            below[:, each] = np.searchsorted(column, nodes, side="right") / len(ordered)
        return MixtureTable(nodes, below)

    def lower_bound(self, weight: np.ndarray, level: np.ndarray) -> np.ndarray:
        """Find the value that each mixture stays below with probability `level`.

        Parameters
        ----------
        weight : (n, k)
            Class probabilities; they may sum to less than one, by the mass that is accounted for in `level`.
        level : (n,)
            Probability [-].

        Returns
        -------
        (n,)
            -inf where already the lowest node is reached with more than `level`.
        """
        return _lower_bounds(self.nodes, self.distribution, np.ascontiguousarray(weight), level)


@njit(cache=True, nogil=True)
def _lower_bounds(nodes, distribution, weight, level):
    answer = np.empty(len(weight))
    for at in range(len(weight)):
        low, high = 0, len(nodes) - 1
        before, after = _below(distribution[low], weight[at]), _below(distribution[high], weight[at])
        if before > level[at]:
            answer[at] = -np.inf
            continue
        while high - low > 1:
            middle = (low + high) >> 1
            below = _below(distribution[middle], weight[at])
            if below <= level[at]:
                low, before = middle, below
            else:
                high, after = middle, below
        share = min(max((level[at] - before) / (after - before), 0.0), 1.0) if after > before else 0.0
        answer[at] = nodes[low] + share * (nodes[high] - nodes[low])
    return answer


@njit(cache=True, nogil=True)
def _below(distribution, weight):
    """Probability that a mixture does not exceed a node."""
    total = 0.0
    for each in range(len(weight)):
        total += weight[each] * distribution[each]
    return total
