"""Sensors that remember: errors of which each row shares some with the row before, as behind a slow amplifier.

They are taken for autoregressions of first order. Rows less what the ones before foretell of their errors err as
independently as those of other sensors (D. Cochrane, G. H. Orcutt, J. Am. Stat. Assoc. 44 (1949), 32-61); the first row
of a stretch stays as it is (S. J. Prais, C. B. Winsten, Cowles Commission Discussion Paper 383 (1954)).
"""

from __future__ import annotations

import numpy as np

from ...effects.drive import Drive

FEWEST = 25
"""Rows below which a channel does not tell."""

SHOWN = 3.0
"""An autocorrelation counts from so many of its standard deviations on, as white noise has them [-]."""

STEPS_APART = (1, 2, 3)
"""Rows between those whose differences tell a memory."""

_SCATTER = 1.45
"""Standard deviation of the rho that differences show of white noise, times the root of the number of rows [-]."""

_MOST_ALIKE = 0.95
"""Neighbours are taken to be no more alike than so [-]."""

_GROSS = 5.0
"""Differences are cut off at so many of their medians [-]."""

_NEXT = 1.5
"""Usual steps of the clock within which a row is the next one [-]: others may be left out between them."""


class Memory:
    """Errors of answers that are correlated with those of the row before, (m,) [-].

    Parameters
    ----------
    rho : (m,)
        How much, 0 where errors are independent.
    seen : (n, m)
        True where an answer was observed.
    drive
        Of the rows, which stand in order of time in each of its stretches.
    """

    def __init__(self, rho: np.ndarray, seen: np.ndarray, drive: Drive) -> None:
        self.rho = rho
        self.any = bool(rho.any())
        self.log_scale = np.zeros(len(seen))
        """Logarithms (n,) of the shares of rows' errors that are new in them, summed over the answers."""
        self._scale = np.sqrt(1.0 - rho**2)
        self._follows = np.zeros_like(seen)
        if self.any:
            self._follows[1:] = _next_ones(drive)[:, None] & seen[1:] & seen[:-1] & (rho > 0.0)
            self.log_scale = self._follows @ np.log(self._scale)

    def new_in(self, values: np.ndarray) -> np.ndarray:
        """What is new in each row of values (n, m, ...), finite where seen, in the size that errors of it have.

        Of what ground that varies does to a row it takes the row before to stand on the same ground: right where that
        varies over many rows, and less than there is where it varies over a few.
        """
        if not self.any:
            return values
        answer = values.copy()
        for position in np.flatnonzero(self.rho):
            rows = np.flatnonzero(self._follows[:, position])
            new = values[rows, position] - self.rho[position] * values[rows - 1, position]
            answer[rows, position] = new / self._scale[position]
        return answer

    def of_independent(self, slopes: np.ndarray) -> np.ndarray:
        """What is new in each row by slopes (n, m, k) along quantities whose own errors are independent: load and slip.

        Each row has the one before it in it, too, so that they are as much larger; that two rows share one is left
        aside.
        """
        if not self.any:
            return slopes
        larger = np.where(self._follows, np.sqrt(1.0 + self.rho**2) / self._scale, 1.0)
        return slopes * larger[..., None]


def _next_ones(drive: Drive) -> np.ndarray:
    """(n - 1,) True where a row is the next one of its stretch, by the usual step of that."""
    step, inside = np.diff(drive.time_s), drive.stretch[1:] == drive.stretch[:-1]
    usual = np.full(len(step), np.nan)
    for rows in np.split(np.arange(len(step)), np.flatnonzero(np.diff(drive.stretch[1:])) + 1):
        forward = rows[inside[rows] & (step[rows] > 0.0)]
        usual[rows] = np.median(step[forward]) if len(forward) else np.nan
    with np.errstate(invalid="ignore"):
        return inside & (step < _NEXT * usual)


def rho_shown(series: list[np.ndarray], of_ground: np.ndarray | float = 0.0) -> float:
    """Correlation of neighbours in a first-order autoregression, from how much more two steps differ than one: 1 + rho
    times. Three differ 1 + rho + rho^2 times; ground that varies and misfit are smooth, and theirs differ more.

    Parameters
    ----------
    series
        Stretches of neighbours in time.
    of_ground : (3,)
        Mean squares of differences over one, two and three rows that are known to be the ground's
        (`remembering.ground_apart`).
    """
    squares, count = np.empty(len(STEPS_APART)), 0
    for index, step in enumerate(STEPS_APART):
        apart = np.concatenate([np.abs(values[step:] - values[:-step]) for values in series] or [np.empty(0)])
        apart = apart[np.isfinite(apart)]
        count = len(apart)
        if count < FEWEST or not np.median(apart) > 0.0:
            return 0.0
        # A gross error is cut off, or it would be most of it.
        squares[index] = np.mean(np.minimum(apart, _GROSS * np.median(apart)) ** 2)
    left = squares - of_ground
    if not left[0] > 0.0:
        return 0.0
    two, three = left[1:] / left[0] - 1.0
    scatter = _SCATTER / np.sqrt(count) * squares[0] / left[0]
    if not SHOWN * scatter < two < 1.0 + SHOWN * scatter or three > two * (1.0 + two) + 2.0 * SHOWN * scatter:
        return 0.0
    # Rather too little than too much: near one a small error of it is a large one of what it makes.
    return float(min(two - scatter, _MOST_ALIKE))


def rows_alike(rho: float) -> float:
    """Rows of an autoregression of first order that say the same as one of independent errors."""
    return (1.0 + rho) / (1.0 - rho)


def of_second_differences(rho: np.ndarray) -> np.ndarray:
    """Noise with a memory, (k,), over the white noise that second differences of neighbours would show instead."""
    return np.sqrt(3.0 / ((1.0 - rho) * (3.0 - rho)))
