"""A smooth curve in slip: natural cubic splines.

T. Hastie et al., *The Elements of Statistical Learning*, 2nd ed. (2009), Sec. 5.2.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

_MOST_KNOTS, _SAMPLES_PER_KNOT, _APART = 7, 15, 4.0
"""Knots at most, samples to each at least, and slip between them at least [noise]."""

_ENDS = (0.03, 0.97)
"""Quantiles of the slips at the outermost knots; beyond them the curve is straight."""

_PSEUDO_SAMPLES = 2.0
"""Weight of the prior that the curve is straight, and level where slip varies by no more than its noise, in samples."""


@dataclass(frozen=True)
class Spline:
    """A basis without the constant: k terms with k + 1 knots [-], of mean squares 1 over the slips.

    The first term is linear. `straight` (k, k) is the precision of the coefficients' prior, for samples that scatter
    about the curve by 1.
    """

    terms: CubicSpline
    straight: np.ndarray

    def __len__(self) -> int:
        return len(self.straight)

    @classmethod
    def over(cls, slip: np.ndarray, noise: float) -> Spline:
        """Lay knots over slips (n,) that were measured with a noise of that standard deviation."""
        most = min(_MOST_KNOTS, max(len(slip) // _SAMPLES_PER_KNOT, 2))
        wanted = np.quantile(slip, np.linspace(*_ENDS, most)).tolist()
        kept = wanted[:1]
        for place in wanted[1:]:
            if place - kept[-1] >= _APART * noise:
                kept.append(place)
        knots = np.array(kept if len(kept) > 1 else [kept[0], kept[0] + noise])
        # Values at the knots: the slip itself, and one at a knot between the outermost each.
        values = np.column_stack([knots, np.eye(len(knots))[:, 1:-1]])
        basis = _at(CubicSpline(knots, values, bc_type="natural"), slip)[0]
        line = np.column_stack([np.ones(len(slip)), slip])
        bends = basis - line @ np.linalg.lstsq(line, basis)[0]
        level = np.diag([noise**2, *np.zeros(len(knots) - 2)])
        square = np.cov(basis.T, bias=True).reshape(level.shape) + level
        mix = np.linalg.inv(np.linalg.cholesky(square + 1e-12 * np.diag(np.diag(square)))).T
        straight = _PSEUDO_SAMPLES * mix.T @ (bends.T @ bends / len(slip) + level) @ mix
        return cls(CubicSpline(knots, values @ mix, bc_type="natural"), straight)

    def curve(self, coefficients: np.ndarray, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sum of the terms times coefficients (k,) at slips (...), and its derivative by slip: (...) each."""
        return _at(PPoly.construct_fast(self.terms.c @ coefficients, self.terms.x), slip)

    def basis(self, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Terms at slips (...), and their derivatives by slip: (..., k) each."""
        return _at(self.terms, slip)


def _at(terms: PPoly, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and derivatives of splines at slips (...), which go on as straight lines beyond the outermost knots."""
    inside = np.clip(slip, terms.x[0], terms.x[-1])
    slopes = terms(inside, 1)
    beyond = (slip - inside).reshape(*slip.shape, *[1] * (slopes.ndim - slip.ndim))
    return terms(inside) + slopes * beyond, slopes
