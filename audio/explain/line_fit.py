"""Where a line stands and how strong it is, from the spectra of all blocks together.

A steady line adds to the spectrum of a block the power response of its Hann window, a hump four bins wide. So the place
within a bin, the strength, and how much the hump is smeared (by a speed that was not measured well, or a tone that
wanders) are fitted to the bins around it, as means of exponentially distributed powers (Whittle 1953). A tone in noise
scatters less than that and a line that comes and goes scatters more: the covariance is that of the stretches' own
scores (a sandwich: White 1982, doi:10.2307/1912526), not of the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

REACH_BINS = 1.5
"""Bins this far from the line are fitted: further off they hold more of what smears it than of itself."""
LEAST_SD_BINS = 0.01
"""Lines are not placed better than this: the spectrum around a line is taken to be flat [bins]."""
NOISE_BINS = 1.5
"""Noise bandwidth of a Hann window [bins]."""
_MOST_SMEARED = 2.0
_SKIRT = 0.05
"""A share of the noise that moves no statistic [-]."""
_SKIRT_SEEN_BINS = 8
"""A skirt wider than this on each side is most of what the noise around a line is taken from [bins]."""
_LEAST_GROUPS = 3
"""Fewest stretches whose scatter gives the error of a line's place: of two, 14 % of the intervals missed."""
_ROUNDS = 30
_CLOSE = 1e-3
"""The fit ends where a step is smaller than this [bins, natural logarithms]."""
_LOG_STRENGTH = (np.log(1e-3), np.log(1e12))
_GRID = np.linspace(-3.0, 3.0, 6001)


def hann_power(bins: np.ndarray) -> np.ndarray:
    """Power response of a Hann window to a line so many bins off (n,): 1 at 0, 0.25 at 1, 0 from 2 on at whole ones."""
    off = np.where(np.abs(np.abs(bins) - 1.0) < 1e-6, 1.0 + 1e-6, bins)
    return np.square(np.sinc(off) / (1.0 - off**2))


_HUMP = hann_power(_GRID)
_SLOPE = np.gradient(_HUMP, _GRID)


def skirt_bins(excess: float) -> int:
    """How far a line of this excess stands out of noise: past the hump its power falls with the sixth of distance."""
    return int(np.ceil((excess / (np.pi**2 * _SKIRT)) ** (1.0 / 6.0)))


@dataclass(frozen=True)
class LineFit:
    """A line as fitted.

    Parameters
    ----------
    multiple, sd
        Where it stands, and the standard deviation of that.
    peak
        Height of its hump over the noise of a bin [-].
    smeared
        How much wider the hump is than the window's own, 1 to 2 [-].
    """

    multiple: float
    sd: float
    peak: float
    smeared: float

    def theta(self, scale: float) -> list[float]:
        """Place [bins], log peak and log smearing, where a unit of the multiple is `scale` bins."""
        return [self.multiple * scale, float(np.log(max(self.peak, 1e-3))), float(np.log(self.smeared))]

    @property
    def excess(self) -> float:
        """Its power over that of the noise in one bin, however smeared [-]."""
        return self.peak * self.smeared

    @property
    def excess_known(self) -> bool:
        """Whether `excess` is the line's: not where its skirt hides the noise, or its hump is wider than is fitted."""
        return skirt_bins(self.excess) <= _SKIRT_SEEN_BINS and self.smeared < _MOST_SMEARED

    def over_noise(self, bins: np.ndarray) -> np.ndarray:
        """What it adds so many bins off (n,), over the noise of a bin [-]."""
        return self.peak * np.interp(bins / self.smeared, _GRID, _HUMP)


@dataclass(frozen=True)
class Spectra:
    """What a line is looked for in: whitened (n, k) as far as it was observed, NaN where it was not.

    `bins_each` (n,) are the bins for each unit of a multiple, `low_bin` the first bin used, and blocks of one `group`
    (n,), a stretch, are not independent of each other.
    """

    whitened: np.ndarray
    bins_each: np.ndarray
    low_bin: int
    group: np.ndarray

    def around(self, place: float, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns (e,) of the bins within `REACH_BINS` of a multiple, of blocks `rows` (m,)."""
        at = place * self.bins_each[rows]
        columns = np.floor(at).astype(int)[:, None] + np.arange(-1, 3)
        near = np.abs(columns - at[:, None]) <= REACH_BINS
        of, which = np.nonzero(near & (columns >= self.low_bin) & (columns < self.whitened.shape[1]))
        row, column = rows[of], columns[of, which]
        seen = ~np.isnan(self.whitened[row, column])
        return row[seen], column[seen]


def fit_line(spectra: Spectra, rows: np.ndarray, middle: float, reach: float, start: LineFit | None = None) -> LineFit:
    """Fit a line to blocks `rows` (m,), at a multiple that lies within `reach` of `middle`.

    `start` is the fit to other blocks, where there is one.
    """
    most = 2.0 * reach / np.sqrt(12.0)
    scale = float(np.median(spectra.bins_each[rows])) if rows.size else 1.0
    theta = np.array([middle * scale, 0.0, 0.0] if start is None else start.theta(scale))
    place, row, column = np.inf, rows[:0], rows[:0]
    score, information = np.zeros((0, 3)), np.eye(3)
    low = [(middle - reach) * scale, _LOG_STRENGTH[0], 0.0]
    high = [(middle + reach) * scale, _LOG_STRENGTH[1], np.log(_MOST_SMEARED)]
    for _ in range(_ROUNDS):
        if abs(theta[0] - place) > 0.25:
            # Other bins only once the line has moved: else the fit would hop between two sets of them.
            place = float(theta[0])
            row, column = spectra.around(place / scale, rows)
            if row.size == 0:
                return LineFit(middle, most, 0.0, 1.0)
        score, information = _scores(spectra, row, column, theta, scale)
        moved = np.clip(theta + _step(score.sum(axis=0), information, theta), low, high)
        step, theta = np.abs(moved - theta).max(), moved
        if step < _CLOSE:
            break
    sd = float(np.hypot(_place_sd(score, information, spectra.group[row], theta), LEAST_SD_BINS)) / scale
    return LineFit(float(theta[0]) / scale, min(sd, most), float(np.exp(theta[1])), float(np.exp(theta[2])))


def _scores(
    spectra: Spectra, row: np.ndarray, column: np.ndarray, theta: np.ndarray, scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the log-likelihood (e, 3) by place, log peak and log smearing, and the expected information.

    Those by place and smearing are freed, block by block, of what a louder or softer block would do to them: loudness
    goes with speed, and so with where in a bin the line falls.
    """
    peak, smeared, bins_each = np.exp(theta[1]), np.exp(theta[2]), spectra.bins_each[row]
    off = (column - theta[0] / scale * bins_each) / smeared
    hump, slope = np.interp(off, _GRID, _HUMP), np.interp(off, _GRID, _SLOPE)
    mean = 1.0 + peak * hump
    by_place, by_peak, by_smear = peak / mean * np.stack([-slope * bins_each / (scale * smeared), hump, -slope * off])
    block = np.cumsum(np.diff(row, prepend=row[:1]) != 0)
    norm = np.bincount(block, by_peak**2) + 1e-12
    by_place, by_smear = (
        each - (np.bincount(block, each * by_peak) / norm)[block] * by_peak for each in (by_place, by_smear)
    )
    gradient = np.stack([by_place, by_peak, by_smear], axis=1)
    return (spectra.whitened[row, column] / mean - 1.0)[:, None] * gradient, gradient.T @ gradient


def _free(theta: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Which parameters (3,) are not held at a bound that the scores `total` push against."""
    at_low, at_high = theta[2] <= 1e-9 and total[2] < 0.0, theta[2] >= np.log(_MOST_SMEARED) - 1e-9 and total[2] > 0.0
    return np.array([True, True, not (at_low or at_high)])


def _step(total: np.ndarray, information: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """One step (3,) of Fisher's scoring, no further than the hump's own shape holds."""
    free = _free(theta, total)
    step = np.zeros(3)
    own = information[np.ix_(free, free)]
    step[free] = np.linalg.solve(own + 1e-9 * (np.trace(own) + 1e-9) * np.eye(len(own)), total[free])
    return np.clip(step, [-0.3, -1.5, -0.3], [0.3, 1.5, 0.3])


def _place_sd(score: np.ndarray, information: np.ndarray, group: np.ndarray, theta: np.ndarray) -> float:
    """Standard deviation of the place [bins] from scores (e, 3) summed over groups (e,): only those are independent.
    Infinite where they are too few to scatter.
    """
    free = _free(theta, score.sum(axis=0))
    _, own = np.unique(group, return_inverse=True)
    count = int(own.max()) + 1
    if count < _LEAST_GROUPS:
        return np.inf
    summed = np.stack([np.bincount(own, score[:, index]) for index in np.flatnonzero(free)], axis=1)
    inner = information[np.ix_(free, free)]
    by_group = summed @ np.linalg.inv(inner + 1e-9 * (np.trace(inner) + 1e-9) * np.eye(len(inner)))[:, 0]
    # The scatter of few groups is itself uncertain: the variance is that of Student's t.
    freedom = max(count - 1, 3)
    return float(np.sqrt(np.sum(by_group**2) * count / max(count - 1, 1) * freedom / (freedom - 2)))
