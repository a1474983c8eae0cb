"""Initial places along the track for fits of a patch of soil."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from ...framework.core.concurrency import together
from ..effects.catalogue.soil_patch import CELLS, SoilPatch, tracks_of
from .fit import Fitted
from .likelihood import Problem
from .steps import scaled_inverse
from .whitening import Noise

_PATCHES_EACH = 2
"""Patches that are returned for each noise model."""

_DISTINCT = CELLS // 12
"""Patches are distinct if either edge differs by more than so many cells."""

_MAX_SHARE = 0.9
"""Largest share of the track that a patch covers: beyond, the soil as a whole differs [-]."""

_LEAST, _MOST = 5, int(_MAX_SHARE * CELLS)
"""Least and largest number of cells of a patch."""


def best_patches(problem: Problem, fitted: Fitted) -> dict[str, list[np.ndarray]]:
    """Return parameter vectors (A, B, from, to) of the patches with the largest gain, by coordinate (`tracks_of`).

    The gain of the best A and B is computed for each pair of edges on a grid, to first order, the fit being updated. It
    is computed with the ground's variation as fitted, which may have absorbed the patch, and with a small one.
    """
    drive, noises = problem.samples.drive, (fitted.noise, problem.first_noise)
    edges = {name: _edges(getattr(drive, name)) for name in tracks_of(drive)}

    def gains_of(case: tuple[str, Noise]) -> tuple[np.ndarray, np.ndarray]:
        name, noise = case
        return _gains(*cell_scores(problem, fitted, noise, in_cells(getattr(drive, name), edges[name])))

    found = iter(together(gains_of, product(edges, noises)))
    return {name: _select_distinct([next(found) for _ in noises], edges[name]) for name in edges}


def _edges(where: np.ndarray) -> np.ndarray:
    """Edges (k + 1,) of the cells that a variable (n,) is divided into."""
    return np.linspace(np.nanmin(where), np.nanmax(where), CELLS + 1)


def in_cells(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(n, k) True for the cell between two edges (k + 1,) that each value (n,) lies in; for none where it is NaN."""
    cell = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    return (cell[:, None] == np.arange(len(edges) - 1)) & np.isfinite(values)[:, None]


def _select_distinct(gains: Sequence[tuple[np.ndarray, np.ndarray]], edges: np.ndarray) -> list[np.ndarray]:
    """Return the distinct patches with the largest gain, a few for each noise model (`_gains`)."""
    found: list[tuple[int, int]] = []
    answer = []
    for gain, change in gains:
        for _ in range(_PATCHES_EACH):
            for first, last in found:
                near = (
                    slice(max(first - _DISTINCT, 0), first + _DISTINCT + 1),
                    slice(max(last - _DISTINCT, 0), last + _DISTINCT + 1),
                )
                gain[near] = -np.inf
            first, last = (int(index) for index in np.unravel_index(int(np.argmax(gain)), gain.shape))
            found.append((first, last))
            answer.append(np.array([*change[first, last], edges[first], edges[last]]))
    return answer


def cell_scores(
    problem: Problem, fitted: Fitted, noise: Noise, inside: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Gradient (2, k) and information (2, k, 2, k) of ln stiffness and ln strength in each cell, the fit profiled out.

    `inside` (n, k) is True for the cell that a row lies in.
    """
    response, own = fitted.response, len(fitted.vector)
    by_cell = response.by_ground[:, problem.answers, :, None] * inside[:, None, None, :]
    by_cell = np.where(problem.seen[..., None], np.nan_to_num(by_cell.reshape(*problem.seen.shape, -1)), 0.0)
    white, _ = problem.whitener(noise, response).whiten(np.concatenate([problem.columns(response), by_cell], axis=-1))
    innovations, jacobian = white[..., 0], white[..., 1:]
    gradient, information = problem.normal_equations(innovations, jacobian)
    prior = problem.prior(fitted.model)
    gradient[:own] += prior.score(fitted.vector)
    information[:own, :own] += prior.precision
    along = information[own:, :own] @ scaled_inverse(information[:own, :own])
    gradient, information = (
        gradient[own:] - along @ gradient[:own],
        information[own:, own:] - along @ information[:own, own:],
    )
    count = inside.shape[1]
    return gradient.reshape(2, count), information.reshape(2, count, 2, count)


def _gains(gradient: np.ndarray, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gain (k + 1, k + 1) [nats] of a patch between each two edges, and its best A and B (k + 1, k + 1, 2).

    The gain of a patch that is too short or too long is minus infinity.
    """
    size = gradient.shape[1] + 1
    slope = np.zeros((2, size))
    slope[:, 1:] = np.cumsum(gradient, axis=1)
    curve = np.zeros((2, size, 2, size))
    curve[:, 1:, :, 1:] = information.cumsum(axis=1).cumsum(axis=3)
    first, last = np.triu_indices(size, _LEAST)
    short = last - first <= _MOST
    first, last = first[short], last[short]
    slope = slope[:, last] - slope[:, first]
    each = curve[:, last, :, last] - curve[:, last, :, first] - curve[:, first, :, last] + curve[:, first, :, first]
    each += np.diag([1.0 / parameter.scale**2 for parameter in SoilPatch.change])
    best = np.linalg.solve(each, slope.T[..., None])[..., 0]
    gain, change = np.full((size, size), -np.inf), np.zeros((size, size, 2))
    gain[first, last] = 0.5 * np.sum(slope.T * best, axis=1)
    change[first, last] = best
    return gain, change
