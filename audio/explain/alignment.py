"""Lines that stand still: tests of averages along multiples of a speed, against surrogates of the drive.

A line at a fixed multiple of the wheel's turns adds to every block where that multiple lies, and to no other place. Its
statistic is the mean of log(1 + R) along the multiple, R being the whitened spectrum: bounded enough that a door slam
counts little. The surrogates keep sound and speed as they are and exchange which belongs to which, so what stands at
a fixed frequency, or belongs to the ground, is in them too; for lines at fixed frequency they shift each stretch's
spectrum a little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import stats
from scipy.ndimage import uniform_filter1d

from .line_fit import LineFit, Spectra, fit_line

SURROGATES = 40
LEAST_BLOCKS = 20
"""A line must be looked for in at least so many blocks to be believed."""
_LEAST_SHAFT_HZ = 0.05
_SHIFT_BINS = (8, 40)


@njit(cache=True)
def _along(values: np.ndarray, speed: np.ndarray, per_hz: float, low: int, multiple: np.ndarray):  # pragma: no cover
    """Sums and counts of values (n, k) at the bins nearest to multiple (m,) times speed (n,), from bin `low` on."""
    total = np.zeros(multiple.size)
    count = np.zeros(multiple.size)
    for row in range(speed.size):
        scale = speed[row] * per_hz
        if scale <= 0.0:
            continue
        for index in range(multiple.size):
            at = int(multiple[index] * scale + 0.5)
            if at >= low and at < values.shape[1] and not np.isnan(values[row, at]):
                total[index] += values[row, at]
                count[index] += 1.0
    return total, count


@dataclass(frozen=True)
class Aligned:
    """A family of whitened spectra with the speed along which its lines are looked for.

    Parameters
    ----------
    name
        ``"order"``, ``"envelope"`` or ``"fixed"``.
    whitened : (n, k)
        Mean 1 under noise; NaN where a line that is already explained stood.
    speed : (n,)
        Turns a second [Hz]; ones for fixed frequencies.
    per_hz
        Bins per hertz [1/Hz].
    low_bin
        The first bin used.
    stretch : (n,)
        What is exchanged as a whole.
    multiples : (m,)
        What is looked for: orders [-], or frequencies [Hz].
    """

    name: str
    whitened: np.ndarray
    speed: np.ndarray
    per_hz: float
    low_bin: int
    stretch: np.ndarray
    multiples: np.ndarray

    @property
    def step(self) -> float:
        """Distance between multiples."""
        return float(self.multiples[1] - self.multiples[0]) if self.multiples.size > 1 else 1.0

    def means(self, multiples: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Mean of log(1 + R) along multiples (m,), and in how many blocks, each (m,)."""
        multiples = self.multiples if multiples is None else multiples
        total, count = _along(np.log1p(self.whitened), self.speed, self.per_hz, self.low_bin, multiples)
        return total / np.maximum(count, 1.0), count

    def along(self, multiple: float) -> np.ndarray:
        """R (n,) in each block at one multiple; NaN where it lies outside or was explained before."""
        at = np.floor(multiple * self.speed * self.per_hz + 0.5).astype(int)
        inside = (at >= self.low_bin) & (at < self.whitened.shape[1]) & (self.speed > _LEAST_SHAFT_HZ)
        rows = np.arange(len(at))
        return np.where(inside, self.whitened[rows, np.where(inside, at, 0)], np.nan)

    def mask(self, frequency_hz: np.ndarray, width_bins: int) -> None:
        """Take out the bins around a line at `frequency_hz` (n,): what is explained is not found twice."""
        at = np.floor(frequency_hz * self.per_hz + 0.5).astype(int)
        for offset in range(-width_bins, width_bins + 1):
            inside = (at + offset >= 0) & (at + offset < self.whitened.shape[1])
            self.whitened[np.flatnonzero(inside), at[inside] + offset] = np.nan


@dataclass(frozen=True)
class Null:
    """Means and standard deviations (m,) under the surrogates, how much their tail exceeds a normal one, their scores.

    `scores` is (SURROGATES, m): the surrogates themselves, standardised.
    """

    mean: np.ndarray
    sd: np.ndarray
    tail: float
    scores: np.ndarray

    def p_values(self, means: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Standard scores and one-sided p values (m,), 1 where too few blocks were there."""
        enough = count >= LEAST_BLOCKS
        score = np.where(enough, (means - self.mean) / self.sd, 0.0)
        return score, np.where(enough, stats.norm.sf(score / self.tail), 1.0)


def null_of(family: Aligned, rng: np.random.Generator) -> Null:
    """Draw the surrogates of a family; exact exchangeability is of whole stretches."""
    logs = np.log1p(family.whitened)
    drawn = np.empty((SURROGATES, family.multiples.size))
    count = np.zeros(family.multiples.size)
    for index in range(SURROGATES):
        if family.name == "fixed":
            values, speed = _shifted(logs, family.stretch, rng), family.speed
        else:
            values, speed = logs, _exchanged(family.speed, family.stretch, rng)
        total, count = _along(values, speed, family.per_hz, family.low_bin, family.multiples)
        drawn[index] = total / np.maximum(count, 1.0)
    mean = drawn.mean(axis=0)
    # The scatter changes smoothly along the multiples, so neighbours steady what 40 draws leave uncertain.
    sd = np.sqrt(np.maximum(uniform_filter1d(drawn.var(axis=0, ddof=1), 41, mode="nearest"), 1e-10))
    scores = (drawn - mean) / (sd * np.sqrt(1.0 - 1.0 / SURROGATES))
    score = scores[:, count >= LEAST_BLOCKS]
    share = max(1e-4, 10.0 / max(score.size, 1))
    tail = float(np.quantile(score, 1.0 - share) / stats.norm.isf(share)) if score.size > 100 else 1.0
    return Null(mean, sd * np.sqrt(1.0 + 1.0 / SURROGATES), max(tail, 1.0), scores)


def _exchanged(speed: np.ndarray, stretch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Speeds (n,) with the stretches in another order, then turned round by a random number of blocks."""
    order = rng.permutation(np.unique(stretch))
    mixed = np.concatenate([speed[stretch == number] for number in order])
    return np.roll(mixed, int(rng.integers(len(mixed))))


def _shifted(values: np.ndarray, stretch: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Spectra (n, k) shifted along frequency, each stretch by its own 8 to 40 bins up or down."""
    answer = np.empty_like(values)
    for number in np.unique(stretch):
        own = stretch == number
        shift = int(rng.integers(*_SHIFT_BINS)) * int(rng.choice([-1, 1]))
        answer[own] = np.roll(values[own], shift, axis=1)
    return answer


@dataclass(frozen=True)
class HeldOut:
    """What a model gains where it was not fitted.

    Parameters
    ----------
    by_stretch
        Held-out log-likelihood gained, by stretch [nats].
    before_dB2, after_dB2, n
        Sums of squared errors of the log spectrum without and with it, and over how many cells.
    """

    by_stretch: np.ndarray
    before_dB2: float
    after_dB2: float
    n: int

    @property
    def nats(self) -> float:
        """Held-out log-likelihood gained."""
        return float(self.by_stretch.sum())

    @property
    def closer(self) -> bool:
        """Whether held-out spectra come closer to contact sound by it."""
        return self.after_dB2 < self.before_dB2


@dataclass(frozen=True)
class HeldOutGain(HeldOut):
    """What a line gains where it was not fitted; `line` is where it stands and how strong it is, from all blocks."""

    line: LineFit


_CLIP = 30.0
"""One block counts no more than this as evidence [-]: a line is what stands in many."""
_OVERLAP = 0.6
"""Half-overlapping Hann blocks are worth so much of as many independent ones (Welch 1967), less a little [-]."""
_LOG_MEAN_DB = -10.0 * np.euler_gamma / np.log(10.0)
"""Mean of 10 log10 of an exponential variable of mean 1 [dB]."""
FOLDS = 5


def held_out_gain(family: Aligned, multiple: float) -> HeldOutGain:
    """Fit a line near a multiple on four fifths of the stretches and score it on the rest, five times.

    The power in a bin is taken as exponentially distributed with mean 1 + s; the place is fitted again each time.
    """
    numbers = np.unique(family.stretch)
    fold = np.searchsorted(numbers, family.stretch) % FOLDS
    spectra = Spectra(family.whitened, family.speed * family.per_hz, family.low_bin, family.stretch)
    turning = family.speed > _LEAST_SHAFT_HZ
    middle, reach = _roughly(family, multiple), 1.5 * family.step
    whole = fit_line(spectra, np.flatnonzero(turning), middle, reach)
    total = np.zeros(len(fold))
    before, after, n = 0.0, 0.0, 0
    for held in range(FOLDS):
        line = fit_line(spectra, np.flatnonzero(turning & (fold != held)), middle, reach, whole)
        at = line.multiple * spectra.bins_each
        values = family.along(line.multiple)
        seen = ~np.isnan(values)
        train, test = seen & (fold != held), seen & (fold == held)
        s = max(float(np.mean(np.minimum(values[train], _CLIP))) - 1.0, 0.0) if train.any() else 0.0
        total[test] = _OVERLAP * (np.minimum(values[test], _CLIP) * s / (1.0 + s) - np.log1p(s))
        error = 10.0 * np.log10(np.maximum(values[test], 1e-4)) - _LOG_MEAN_DB
        fitted = 10.0 * np.log10(1.0 + line.over_noise(np.floor(at[test] + 0.5) - at[test]))
        before, after = before + float(np.sum(error**2)), after + float(np.sum((error - fitted) ** 2))
        n += int(test.sum())
    by_stretch = np.array([total[family.stretch == number].sum() for number in numbers])
    return HeldOutGain(by_stretch, before, after, n, whole)


def _roughly(family: Aligned, multiple: float) -> float:
    """The middle of the places near a multiple where most of the spectra stand out, to a quarter of a step."""
    fine = multiple + np.linspace(-1.5, 1.5, 13) * family.step
    values = np.log1p(np.stack([family.along(place) for place in fine]))
    seen = ~np.isnan(values)
    mean = np.where(seen, values, 0.0).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    # All places in one bin stand out alike.
    return float(fine[mean >= mean.max() - 1e-9].mean())
