"""The gate in front of a classifier: how far an item is from everything that was trained on."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag
from sklearn.covariance import LedoitWolf

FALSE_REJECTION_RATE = 0.02
"""Share of held-out, in-distribution items that the gate may turn away."""
_ROUNDING = 1e-3


def room(distance: np.ndarray) -> np.ndarray:
    """Share of the quality that is left to items at distances (n,) over the gate's threshold: less from 0.8 on."""
    return np.clip(5.0 * (1.0 - distance), 0.0, 1.0)


@dataclass(frozen=True)
class Gate:
    """Distance in standardised feature space to the nearest class, with the covariance within classes (shrunk).

    The Mahalanobis distance of Lee et al. 2018 (arXiv:1807.03888, Eq. 2) with the covariance of Ledoit and Wolf
    2004 (doi:10.1016/S0047-259X(03)00096-4), over sqrt(d): about 1 for an item of the training classes. Features that
    tell of different things may be looked at block by block, so that many of one kind do not hide a few of another:
    then it is the largest of the blocks' distances, each over what `FALSE_REJECTION_RATE` of the training items exceed.
    `ends` are the columns at which blocks end.
    """

    whitening: np.ndarray
    centres: np.ndarray
    ends: tuple[int, ...]

    @staticmethod
    def fit(z: np.ndarray, y: np.ndarray, weight: np.ndarray, n_classes: int, ends: tuple[int, ...] = ()) -> Gate:
        """Fit to standardised features z (n, d) of classes y (n,), each row counting as `weight` (n,) says.

        It sees the columns before the last of `ends`; all, in one block, where there are none.
        """
        ends = ends or (z.shape[1],)
        parts = [_block(z[:, first:last], y, weight, n_classes) for first, last in pairwise((0, *ends))]
        if len(parts) > 1:
            for number, ((first, last), part) in enumerate(zip(pairwise((0, *ends)), parts, strict=True)):
                usual = gate_threshold(part.distance(z[:, first:last]), weight)
                usual = usual if usual > _ROUNDING else 1.0  # of one item a class nothing is known of what is usual
                parts[number] = Gate(part.whitening / usual, part.centres / usual, part.ends)
        whitening = np.asarray(block_diag(*(part.whitening for part in parts)))
        return Gate(whitening, np.concatenate([part.centres for part in parts], axis=1), ends)

    def distance(self, z: np.ndarray) -> np.ndarray:
        """Give the distance of each row of z (n, d) to the nearest class centre, (n,) [-].

        Columns beyond those that it was fitted to are passed over.
        """
        w = z[:, : len(self.whitening)] @ self.whitening
        square = [_squares(w[:, a:b], self.centres[:, a:b]).min(axis=1) for a, b in pairwise((0, *self.ends))]
        return np.sqrt(np.maximum(np.max(square, axis=0), 0.0))


def _squares(w: np.ndarray, centres: np.ndarray) -> np.ndarray:
    return (w**2).sum(axis=1)[:, None] - 2 * w @ centres.T + (centres**2).sum(axis=1)


def _block(z: np.ndarray, y: np.ndarray, weight: np.ndarray, n_classes: int) -> Gate:
    present = np.flatnonzero(np.bincount(y, minlength=n_classes))
    mean = np.stack([np.average(z[y == index], axis=0, weights=weight[y == index]) for index in present])
    residual = z - mean[np.searchsorted(present, y)]
    residual *= np.sqrt(weight / weight.mean())[:, None]
    values, vectors = np.linalg.eigh(LedoitWolf(assume_centered=True).fit(residual).covariance_)
    whitening = vectors / np.sqrt(np.maximum(values, 1e-6)) / np.sqrt(z.shape[1])
    return Gate(whitening, mean @ whitening, (z.shape[1],))


def gate_threshold(distance: np.ndarray, weight: np.ndarray) -> float:
    """Give the distance that all but `FALSE_REJECTION_RATE` of held-out items (n,) lie within, by their weight."""
    order = np.argsort(distance)
    mass = np.cumsum(weight[order])
    return float(distance[order][min(np.searchsorted(mass, (1 - FALSE_REJECTION_RATE) * mass[-1]), len(order) - 1)])
