"""The gate in front of a classifier: how far an item is from everything that was trained on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from sklearn.covariance import LedoitWolf

FALSE_REJECTION_RATE = 0.02
"""Share of held-out, in-distribution items that the gate may turn away."""


def room(distance: np.ndarray) -> np.ndarray:
    """Share of the quality that is left to items at distances (n,) over the gate's threshold: less from 0.8 on."""
    return np.clip(5.0 * (1.0 - distance), 0.0, 1.0)


@dataclass(frozen=True)
class Gate:
    """Distance in standardised feature space to the nearest class, with the covariance within classes (shrunk).

    The Mahalanobis distance of Lee et al. 2018 (arXiv:1807.03888, Eq. 2) with the covariance of Ledoit and Wolf
    2004 (doi:10.1016/S0047-259X(03)00096-4), over sqrt(d): about 1 for an item of the training classes.
    """

    whitening: np.ndarray
    centres: np.ndarray

    @staticmethod
    def fit(z: np.ndarray, y: np.ndarray, weight: np.ndarray, n_classes: int) -> Gate:
        """Fit to standardised features z (n, d) of classes y (n,), each row counting as `weight` (n,) says."""
        present = np.flatnonzero(np.bincount(y, minlength=n_classes))
        mean = np.stack([np.average(z[y == index], axis=0, weights=weight[y == index]) for index in present])
        residual = z - mean[np.searchsorted(present, y)]
        residual *= np.sqrt(weight / weight.mean())[:, None]
        values, vectors = np.linalg.eigh(LedoitWolf(assume_centered=True).fit(residual).covariance_)
        whitening = vectors / np.sqrt(np.maximum(values, 1e-6)) / np.sqrt(z.shape[1])
        return Gate(whitening, mean @ whitening)

    def distance(self, z: np.ndarray) -> np.ndarray:
        """Give the distance of each row of z (n, d) to the nearest class centre, (n,) [-].

        Columns beyond those that it was fitted to are passed over.
        """
        w = z[:, : len(self.whitening)] @ self.whitening
        square = (w**2).sum(axis=1)[:, None] - 2 * w @ self.centres.T + (self.centres**2).sum(axis=1)
        return np.sqrt(np.maximum(square.min(axis=1), 0.0))


def gate_threshold(distance: np.ndarray, weight: np.ndarray) -> float:
    """Give the distance that all but `FALSE_REJECTION_RATE` of held-out items (n,) lie within, by their weight."""
    order = np.argsort(distance)
    mass = np.cumsum(weight[order])
    return float(distance[order][min(np.searchsorted(mass, (1 - FALSE_REJECTION_RATE) * mass[-1]), len(order) - 1)])
