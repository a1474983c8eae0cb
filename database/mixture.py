"""Lower bounds of a mixture: what is exceeded with a given confidence where the class itself is uncertain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
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
        below = np.stack([np.searchsorted(column, nodes, side="right") for column in ordered.T], axis=1)
        return MixtureTable(nodes, below / len(ordered))

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
        least = np.einsum("nk,k->n", weight, self.distribution[0])
        low = np.zeros(len(weight), dtype=np.int64)
        high = np.full(len(weight), len(self.nodes) - 1)
        for _ in range(len(self.nodes).bit_length()):
            middle = (low + high) >> 1
            below = np.einsum("nk,nk->n", weight, self.distribution[middle]) <= level
            low = np.where(below, middle, low)
            high = np.where(below, high, middle)
        before = np.einsum("nk,nk->n", weight, self.distribution[low])
        after = np.einsum("nk,nk->n", weight, self.distribution[high])
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.clip((level - before) / (after - before), 0.0, 1.0)
        found = self.nodes[low] + np.where(after > before, share, 0.0) * (self.nodes[high] - self.nodes[low])
        return np.where(least > level, -np.inf, found)
