"""Where simulation and recording differ: which channel, against which variable, over which interval.

Each test adds a step function of one variable to one channel of the textbook wheel; the soil is refitted within its
uncertainty. Residuals are white, so that twice the gain in log-likelihood is chi-squared. The false discovery rate is
controlled over all tests (Y. Benjamini, Y. Hochberg, J. R. Stat. Soc. B 57 (1995), 289-300). Significant tests are
reported by forward selection, the largest gain first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import chi2, false_discovery_control

from ..effects.drive import rate_of_change
from ..mechanics.augmented import Entry
from ..mechanics.textbook import CHANNELS
from .explanation import Region
from .fit import Fitted, fit
from .likelihood import Problem
from .places import in_cells
from .steps import scaled_inverse
from .variables import CONSTANT, LAG, Variable, cycles, public_name, rank, span_of, variables
from .whitening import Noise

FALSE_DISCOVERIES = 0.01
"""False discovery rate [-]."""

_SIGNIFICANT_ERRORS = 2.5
"""Mean residual of a cell, in standard errors, from which on it belongs to a region [-]."""

_LEAST_ADDED = 0.1
"""Least gain of a further variable, relative to the first one [-]."""

_TIED = (0.05, 5.0)
"""Variables are tied when their gains differ by less than this share of the largest plus so many nats."""

_FIXED_SOIL = 1e8
"""Factor of the soil's precision that fixes it [-]."""

_Spans = tuple[tuple[float, float, float, float], ...]
"""Start, end, share and mean residual [noise] of each interval."""


@dataclass(frozen=True)
class _Stretch:
    """Interval of an attribute of `Drive` on which an effect acts, and what it adds to the channels (n, 5), SI."""

    attribute: str
    low: float
    high: float
    adds: np.ndarray


@dataclass(frozen=True)
class _Test:
    """A test of columns (n, k) added to a channel.

    `read` returns intervals from their coefficients and standard errors (k,). `chance` is the gain expected under the
    null hypothesis from a search over columns [nats].
    """

    position: int
    variable: str
    columns: np.ndarray
    read: Callable[[np.ndarray, np.ndarray], _Spans]
    chance: float = 0.0


def locate(problem: Problem, best: Fitted) -> tuple[Region, ...]:
    """Locate the regions, the largest share first.

    Parameters
    ----------
    problem
        The samples.
    best
        The best model. The textbook wheel is tested with its soil and noise: a separate fit would distribute the misfit
        of one channel over the others, and count misfit as noise.
    """
    noise, soils = best.noise, best.model.soils
    textbook = fit(problem, best.model.with_effects(()), best.vector[soils], noise, Entry(best.theta_1), steps=0)
    precision = scaled_inverse(best.covariance(problem)[soils, soils])
    stretches = _stretches(problem, best)
    whitened = Whitened(problem, textbook, noise, precision, stretches)
    if not whitened.tests:
        return ()
    significant, corrected = _significant(whitened)
    if not significant and best.model.effects:
        # A change of soil can compensate for each single channel, though not for all together: it is fixed.
        whitened = Whitened(problem, textbook, noise, _FIXED_SOIL * precision, stretches)
        significant, corrected = _significant(whitened)
    reported = _reported(whitened, significant, {name for effect in best.model.effects for name in effect.needs})
    total = sum(gain for _, gain, _ in reported)
    answer = [
        Region(
            CHANNELS[problem.answers[whitened.tests[each].position]], whitened.tests[each].variable, start, end,
            share * gain / total, float(corrected[each]), mean,
        )
        for each, gain, spans in reported
        for start, end, share, mean in spans
    ]  # fmt: skip
    return tuple(sorted(answer, key=lambda region: -region.share))


def _stretches(problem: Problem, best: Fitted) -> list[_Stretch]:
    """Intervals on which fitted effects act."""
    answer = []
    for effect, where in best.model.slices():
        extent = effect.extent(best.vector[where])
        if extent is not None:
            null = best.vector.copy()
            null[where] = [parameter.null for parameter in effect.parameters]
            without = best.model.predict(problem.samples.drive, problem.imposed, null).channels
            answer.append(_Stretch(*extent, best.response.channels - without))
    return answer


def _significant(whitened: Whitened) -> tuple[dict[int, float], np.ndarray]:
    """Significant tests, by number, with their gains [nats], and the corrected p-values of all, (q,)."""
    numbers = range(len(whitened.tests))
    gains = [whitened.gain(each) for each in numbers]
    p_values = chi2.sf(2.0 * np.array(gains), [whitened.freedom(each) for each in numbers])
    corrected = false_discovery_control(np.maximum(p_values, 1e-300))
    return {each: gains[each] for each in numbers if corrected[each] <= FALSE_DISCOVERIES}, corrected


def _reported(whitened: Whitened, significant: dict[int, float], through: set[str]) -> list[tuple[int, float, _Spans]]:
    """Selected tests, by number, each with its gain over those before [nats] and its intervals.

    Channels are tested together, because varying ground correlates them.
    """
    answer: list[tuple[int, float, _Spans]] = []
    while significant:
        top = max(significant.values())
        if answer and top < _LEAST_ADDED * answer[0][1]:
            break
        channel = whitened.tests[max(significant, key=lambda each: significant[each])].position
        good = [
            each for each, gain in significant.items()
            if gain >= (1.0 - _TIED[0]) * top - _TIED[1] and whitened.tests[each].position == channel
        ]  # fmt: skip
        # Each column gains half a nat by chance.
        net_gain = {each: significant[each] - 0.5 * whitened.freedom(each) for each in good}
        chosen = min(good, key=lambda each: (rank(whitened.tests[each].variable, through), -net_gain[each]))
        given = [each for each, *_ in answer]
        answer.append((chosen, significant[chosen], whitened.spans(chosen, given)))
        added = {each: whitened.gain(each, [*given, chosen]) for each in significant if each != chosen}
        p_values = {each: chi2.sf(2.0 * gain, whitened.freedom(each)) for each, gain in added.items()}
        significant = {each: added[each] for each, p_value in p_values.items() if p_value <= FALSE_DISCOVERIES}
    return answer


class Whitened:
    """The textbook wheel's residuals, soil derivatives and the columns of all tests, whitened together.

    Parameters
    ----------
    problem, textbook
        The samples, and the textbook wheel on the fitted soil.
    noise
        Noise model.
    precision : (5 g, 5 g)
        Prior precision of the soils of g grounds, which are refitted with each test.
    stretches
        Intervals that are tested as well.
    """

    def __init__(
        self, problem: Problem, textbook: Fitted, noise: Noise, precision: np.ndarray,
        stretches: Sequence[_Stretch] = (),
    ) -> None:  # fmt: skip
        self._problem, self._textbook, self._noise, self._stretches = problem, textbook, noise, stretches
        self._residuals = problem.residuals(textbook.response)
        tested = [test for position in range(len(problem.answers)) for test in self._tested(position)]
        self.tests = tested
        self._soil = len(precision)
        ends = self._soil + np.cumsum([0] + [each.columns.shape[1] for each in tested])
        self._columns_of = [np.arange(low, high) for low, high in pairwise(ends)]
        extra = np.zeros((len(problem.samples), len(problem.answers), int(ends[-1]) - self._soil))
        for test, own in zip(tested, self._columns_of, strict=True):
            extra[:, test.position, own - self._soil] = test.columns
        columns = np.concatenate([problem.columns(textbook.response), extra], axis=-1)
        white, _ = problem.whitener(noise, textbook.response).whiten(columns)
        self._gradient, self._information = problem.normal_equations(white[..., 0], white[..., 1:])
        self._information[: self._soil, : self._soil] += precision

    def freedom(self, number: int) -> int:
        """Count the columns of a test."""
        return len(self._columns_of[number])

    def gain(self, number: int, given: Sequence[int] = ()) -> float:
        """Gain of a test over those given, all by number [nats], the soil refitted."""
        base = np.concatenate([np.arange(self._soil), *(self._columns_of[each] for each in given)])
        together = np.concatenate([base, self._columns_of[number]])
        more = self._explained(together) - self._explained(base)
        return max(more - self.tests[number].chance, 0.0)

    def spans(self, number: int, given: Sequence[int]) -> _Spans:
        """Intervals over which a test's coefficients differ from zero, tests given included, on the fitted soil."""
        own = self._columns_of[number]
        rest = np.concatenate([np.empty(0, int), *(self._columns_of[each] for each in given)])
        gradient = self._gradient[own]
        if len(rest):
            others = scaled_inverse(self._information[np.ix_(rest, rest)]) @ self._gradient[rest]
            gradient = gradient - self._information[np.ix_(own, rest)] @ others
        size = np.maximum(np.diag(self._information)[own], 1e-12)
        return self.tests[number].read(gradient / size, 1.0 / np.sqrt(size))

    def _explained(self, columns: np.ndarray) -> float:
        gradient = self._gradient[columns]
        return 0.5 * float(gradient @ scaled_inverse(self._information[np.ix_(columns, columns)]) @ gradient)

    def _tested(self, position: int) -> list[_Test]:
        """Return all tests of one channel."""
        samples, sinkage_m = self._problem.samples, self._textbook.response.channels[:, 2]
        tested = [self._constant(position), *(self._steps(each, position) for each in variables(samples, sinkage_m))]
        tested += [self._inside(each, position) for each in self._stretches]
        angle = samples.drive.wheel_angle_rad
        if span_of(angle) > 2.0 * np.pi:
            tested.append(self._periodic(angle, position))
        if samples.drive.timed:
            tested.append(self._lag(position))
        return [each for each in tested if each is not None]

    def _constant(self, position: int) -> _Test:
        """Test for an offset."""
        unit = self._noise.sd[position]

        def read(mean: np.ndarray, error: np.ndarray) -> _Spans:
            size, margin = float(mean[0]), 2.0 * float(error[0])
            return ((size - margin, size + margin, 1.0, size / unit),)

        return _Test(position, CONSTANT, self._problem.seen[:, position].astype(float)[:, None], read)

    def _steps(self, variable: Variable, position: int) -> _Test | None:
        """Test for a step function of a variable."""
        inside = in_cells(variable.values, variable.edges)
        columns = (inside & self._problem.seen[:, position][:, None]).astype(float)
        filled = columns.sum(axis=0) >= 1.0
        if filled.sum() < 2:
            return None
        columns = columns[:, filled]
        rows = columns.sum(axis=0)
        edges = np.column_stack([variable.edges[:-1], variable.edges[1:]])[filled]
        unit = self._noise.sd[position]

        def read(mean: np.ndarray, error: np.ndarray) -> _Spans:
            weight = np.maximum(mean**2 - error**2, 0.0) * rows
            total = max(float(weight.sum()), 1e-300)
            sign = np.where(np.abs(mean) > _SIGNIFICANT_ERRORS * error, np.sign(mean), 0.0)
            borders = np.flatnonzero(np.diff(sign)) + 1
            spans = []
            for cells in np.split(np.arange(len(sign)), borders):
                if sign[cells[0]] != 0.0:
                    level = float(np.average(mean[cells], weights=rows[cells])) / unit
                    share = float(weight[cells].sum()) / total
                    spans.append((float(edges[cells[0], 0]), float(edges[cells[-1], 1]), share, level))
            return tuple(span for span in spans if span[2] >= 0.1)

        return _Test(position, variable.name, columns, read)

    def _inside(self, stretch: _Stretch, position: int) -> _Test | None:
        """Test for the contribution of an effect on its interval."""
        adds = stretch.adds[:, self._problem.answers[position]]
        column = np.where(self._problem.seen[:, position], np.nan_to_num(adds), 0.0)
        where = getattr(self._problem.samples.drive, stretch.attribute)
        inside = (where >= stretch.low) & (where <= stretch.high)
        if not column[inside].any():
            return None
        unit = float(np.mean(column[inside])) / self._noise.sd[position]

        def read(mean: np.ndarray, _: np.ndarray) -> _Spans:
            return ((stretch.low, stretch.high, 1.0, float(mean[0]) * unit),)

        return _Test(position, public_name(self._problem.samples.drive, stretch.attribute), column[:, None], read)

    def _periodic(self, angle: np.ndarray, position: int) -> _Test:
        """Test for the strongest harmonic of the wheel's rotation."""
        waves = cycles(angle)
        seen = self._problem.seen[:, position]
        residual = np.where(seen, self._residuals[:, position], 0.0)
        power = np.sum(np.einsum("nkc,n->kc", waves, residual) ** 2, axis=1)
        strongest = int(np.argmax(power[1:])) + 1
        unit = self._noise.sd[position]

        def read(mean: np.ndarray, _: np.ndarray) -> _Spans:
            return ((0.0, 2.0 * np.pi / (strongest + 1), 1.0, float(np.hypot(*mean)) / unit),)

        # Expected largest of as many independent exponential variables.
        chance = float(np.log(len(power)))
        return _Test(position, "wheel_angle_rad", waves[:, strongest] * seen[:, None], read, chance)

    def _lag(self, position: int) -> _Test | None:
        """Test for a delay: residuals in proportion to the rate of change."""
        samples, channel = self._problem.samples, self._problem.answers[position]
        predicted = self._textbook.response.channels[:, channel]
        rate = rate_of_change(predicted, samples.drive.time_s, samples.drive.stretch)
        column = np.where(np.isfinite(rate) & self._problem.seen[:, position], rate, 0.0)[:, None]
        if np.ptp(column) == 0.0:
            return None
        unit = self._noise.sd[position]

        def read(mean: np.ndarray, error: np.ndarray) -> _Spans:
            # A channel delayed by tau differs by -tau times its rate of change.
            tau, margin = -float(mean[0]), 2.0 * float(error[0])
            size = float(np.sqrt(np.mean((tau * column) ** 2))) / unit
            return ((tau - margin, tau + margin, 1.0, size),)

        return _Test(position, LAG, column, read)
