"""Where simulation and recording differ: which channel, against which variable, over which interval.

Each question adds a step function of one variable to one channel of the textbook wheel and asks how much better it then
fits, the soil no more certain than it is; residuals are white by then (`soil_variation`), so twice the gain is
chi-square. The share of false answers is controlled over all questions (Y. Benjamini, Y. Hochberg, J. R. Stat. Soc. B
57 (1995)). Of the questions answered with yes the best is told, then what others add to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import chi2, false_discovery_control

from ..effects.drive import rate_of_change
from ..mechanics.augmented import SOIL_COUNT, AugmentedWheel, Entry
from ..mechanics.textbook import CHANNELS
from .explanation import Region
from .fit import Fitted, fit
from .likelihood import Problem
from .steps import scaled_inverse
from .variables import CONSTANT, LAG, Variable, cycles, public_name, rank, span_of, variables
from .whitening import Noise, robust_weight

FALSE_DISCOVERIES = 0.01
"""Expected share of false statements among those made [-]."""

_STANDS_OUT = 2.5
"""A cell whose mean residual is this many standard errors from zero belongs to a region [-]."""

_WORTH_SAYING = 0.1
"""A further variable is named where it adds at least this share of what the first one explains [-]."""

_AS_GOOD = (0.05, 5.0)
"""Variables explain a misfit equally well when their gains differ by less than this share and so many nats."""

_HELD = 1e8
"""How much more certain the soil is taken to be where it is held [-]."""

_Spans = tuple[tuple[float, float, float, float], ...]
"""Start, end, share and mean residual [noise] of each interval."""


@dataclass(frozen=True)
class _Stretch:
    """Where an effect that was found acts: between two values of an attribute of `Drive`; what it adds to the channels
    there (n, 5), SI. Searching for it in all channels gains `chance` on average [nats].
    """

    attribute: str
    low: float
    high: float
    adds: np.ndarray
    chance: float


@dataclass(frozen=True)
class _Question:
    """Columns (n, k) that may be missing from a channel, and what their coefficients and standard errors (k,) say.

    `chance` is what searching for the question gains on average [nats].
    """

    position: int
    variable: str
    columns: np.ndarray
    read: Callable[[np.ndarray, np.ndarray], _Spans]
    chance: float = 0.0


def locate(problem: Problem, best: Fitted) -> tuple[Region, ...]:
    """Find the regions, the strongest first.

    Parameters
    ----------
    problem
        The samples.
    best
        The best model that was found. The textbook wheel is tested on its soil and with its noise: its own soil has
        carried the mismatch of one channel over to the others, and its own noise takes mismatch for noise.
    """
    noise = best.noise
    textbook = fit(
        problem, AugmentedWheel(problem.samples.wheel), best.vector[:SOIL_COUNT], noise, Entry(best.theta_1), steps=0
    )
    precision = scaled_inverse(best.covariance(problem)[:SOIL_COUNT, :SOIL_COUNT])
    stretches = _stretches(problem, best)
    whites = Whitened(problem, textbook, noise, precision, stretches)
    if not whites.questions:
        return ()
    sure, corrected = _sure(whites)
    if not sure and best.model.effects:
        # Another soil would make up for each channel by itself, and not for all: what was found is taken at its word.
        whites = Whitened(problem, textbook, noise, _HELD * precision, stretches)
        sure, corrected = _sure(whites)
    told = _told(whites, sure, {name for effect in best.model.effects for name in effect.needs})
    total = sum(gain for _, gain, _ in told)
    answer = [
        Region(
            CHANNELS[problem.answers[whites.questions[each].position]], whites.questions[each].variable, start, end,
            share * gain / total, float(corrected[each]), mean,
        )
        for each, gain, spans in told
        for start, end, share, mean in spans
    ]  # fmt: skip
    return tuple(sorted(answer, key=lambda region: -region.share))


def _stretches(problem: Problem, best: Fitted) -> list[_Stretch]:
    """Stretches over which what was found acts."""
    answer = []
    for effect, where in best.model.slices():
        extent = effect.extent(best.vector[where])
        if extent is not None:
            nothing = best.vector.copy()
            nothing[where] = [parameter.null for parameter in effect.parameters]
            without = best.model.predict(problem.samples.drive, problem.imposed, nothing).channels
            answer.append(_Stretch(*extent, best.response.channels - without, 0.0))
    return answer


def _sure(whites: Whitened) -> tuple[dict[int, float], np.ndarray]:
    """Questions answered with yes, by number, with their gains [nats], and the corrected p-values of all, (q,)."""
    everything = range(len(whites.questions))
    gains = [whites.gain(each) for each in everything]
    p_values = chi2.sf(2.0 * np.array(gains), [whites.freedom(each) for each in everything])
    corrected = false_discovery_control(np.maximum(p_values, 1e-300))
    return {each: gains[each] for each in everything if corrected[each] <= FALSE_DISCOVERIES}, corrected


def _told(whites: Whitened, sure: dict[int, float], through: set[str]) -> list[tuple[int, float, _Spans]]:
    """Questions that are told, by number, each with what it adds to those before [nats], and its intervals.

    Channels are tested together: soil that varies ties them, and what is off in one looks like ground in the others.
    """
    answer: list[tuple[int, float, _Spans]] = []
    while sure:
        top = max(sure.values())
        if answer and top < _WORTH_SAYING * answer[0][1]:
            break
        channel = whites.questions[max(sure, key=lambda each: sure[each])].position
        good = [
            each for each, gain in sure.items()
            if gain >= (1.0 - _AS_GOOD[0]) * top - _AS_GOOD[1] and whites.questions[each].position == channel
        ]  # fmt: skip
        # Of two about one variable that of fewer columns: each gains half a nat by chance.
        earned = {each: sure[each] - 0.5 * whites.freedom(each) for each in good}
        chosen = min(good, key=lambda each: (rank(whites.questions[each].variable, through), -earned[each]))
        given = [each for each, *_ in answer]
        answer.append((chosen, sure[chosen], whites.spans(chosen, given)))
        added = {each: whites.gain(each, [*given, chosen]) for each in sure if each != chosen}
        sure = {
            each: gain for each, gain in added.items() if chi2.sf(2.0 * gain, whites.freedom(each)) <= FALSE_DISCOVERIES
        }
    return answer


class Whitened:
    """The textbook wheel's residuals, soil derivatives and all questions' columns, made white together.

    Parameters
    ----------
    problem, textbook
        The samples, and the textbook wheel on the soil that was found.
    noise
        Noise and the soil's variation.
    precision : (5, 5)
        Of the soil: how far it may move to make up for what is tested.
    stretches
        Stretches that are tested about besides.
    """

    def __init__(
        self, problem: Problem, textbook: Fitted, noise: Noise, precision: np.ndarray,
        stretches: Sequence[_Stretch] = (),
    ) -> None:  # fmt: skip
        self._problem, self._textbook, self._noise, self._stretches = problem, textbook, noise, stretches
        self._residuals = problem.residuals(textbook.response)
        tested = [question for position in range(len(problem.answers)) for question in self._tested(position)]
        self.questions = tested
        self._soil = len(precision)
        ends = self._soil + np.cumsum([0] + [each.columns.shape[1] for each in tested])
        self._places = [np.arange(low, high) for low, high in pairwise(ends)]
        extra = np.zeros((len(problem.samples), len(problem.answers), int(ends[-1]) - self._soil))
        for question, place in zip(tested, self._places, strict=True):
            extra[:, question.position, place - self._soil] = question.columns
        columns = np.concatenate([problem.columns(textbook.response), extra], axis=-1)
        white, _ = problem.whitener(noise, textbook.response).whiten(columns)
        innovations = white[..., 0]
        weight = robust_weight(innovations).ravel()
        full = white[..., 1:].reshape(len(weight), -1)
        self._gradient = full.T @ (weight * innovations.ravel())
        self._information = (full * weight[:, None]).T @ full
        self._information[: self._soil, : self._soil] += precision

    def freedom(self, number: int) -> int:
        """Count the columns of a question."""
        return len(self._places[number])

    def gain(self, number: int, given: Sequence[int] = ()) -> float:
        """What a question adds to those given, all by number, in explaining the residuals [nats], the soil refitted."""
        base = np.concatenate([np.arange(self._soil), *(self._places[each] for each in given)])
        together = np.concatenate([base, self._places[number]])
        more = self._explained(together) - self._explained(base)
        return max(more - self.questions[number].chance, 0.0)

    def spans(self, number: int, given: Sequence[int]) -> _Spans:
        """Where a question's columns differ from zero, beside those given and on the soil that was found."""
        own, rest = self._places[number], np.concatenate([np.empty(0, int), *(self._places[each] for each in given)])
        gradient = self._gradient[own]
        if len(rest):
            beside = scaled_inverse(self._information[np.ix_(rest, rest)]) @ self._gradient[rest]
            gradient = gradient - self._information[np.ix_(own, rest)] @ beside
        size = np.maximum(np.diag(self._information)[own], 1e-12)
        return self.questions[number].read(gradient / size, 1.0 / np.sqrt(size))

    def _explained(self, columns: np.ndarray) -> float:
        gradient = self._gradient[columns]
        return 0.5 * float(gradient @ scaled_inverse(self._information[np.ix_(columns, columns)]) @ gradient)

    def _tested(self, position: int) -> list[_Question]:
        """Give all that is tested of one channel."""
        samples, sinkage_m = self._problem.samples, self._textbook.response.channels[:, 2]
        tested = [self._constant(position), *(self._steps(each, position) for each in variables(samples, sinkage_m))]
        tested += [self._inside(each, position) for each in self._stretches]
        angle = samples.drive.wheel_angle_rad
        if span_of(angle) > 2.0 * np.pi:
            tested.append(self._periodic(angle, position))
        if samples.drive.timed:
            tested.append(self._lag(position))
        return [each for each in tested if each is not None]

    def _constant(self, position: int) -> _Question:
        """Test whether one channel it is off by the same everywhere."""
        unit = self._noise.sd[position]

        def read(mean: np.ndarray, error: np.ndarray) -> _Spans:
            size, spread = float(mean[0]), 2.0 * float(error[0])
            return ((size - spread, size + spread, 1.0, size / unit),)

        return _Question(position, CONSTANT, self._problem.seen[:, position].astype(float)[:, None], read)

    def _steps(self, variable: Variable, position: int) -> _Question | None:
        """Test whether one channel it leaves the simulation somewhere along a variable."""
        columns = variable.indicators() * self._problem.seen[:, position][:, None]
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
            stands = np.where(np.abs(mean) > _STANDS_OUT * error, np.sign(mean), 0.0)
            borders = np.flatnonzero(np.diff(stands)) + 1
            spans = []
            for cells in np.split(np.arange(len(stands)), borders):
                if stands[cells[0]] != 0.0:
                    level = float(np.average(mean[cells], weights=rows[cells])) / unit
                    share = float(weight[cells].sum()) / total
                    spans.append((float(edges[cells[0], 0]), float(edges[cells[-1], 1]), share, level))
            return tuple(span for span in spans if span[2] >= 0.1)

        return _Question(position, variable.name, columns, read)

    def _inside(self, stretch: _Stretch, position: int) -> _Question | None:
        """Test whether one channel it leaves the simulation as what acts over a stretch has it."""
        adds = stretch.adds[:, self._problem.answers[position]]
        column = np.where(self._problem.seen[:, position], np.nan_to_num(adds), 0.0)
        where = getattr(self._problem.samples.drive, stretch.attribute)
        inside = (where >= stretch.low) & (where <= stretch.high)
        if not column[inside].any():
            return None
        unit = float(np.mean(column[inside])) / self._noise.sd[position]

        def read(mean: np.ndarray, _: np.ndarray) -> _Spans:
            return ((stretch.low, stretch.high, 1.0, float(mean[0]) * unit),)

        chance = stretch.chance / len(self._problem.answers)
        return _Question(
            position, public_name(self._problem.samples.drive, stretch.attribute), column[:, None], read, chance
        )

    def _periodic(self, angle: np.ndarray, position: int) -> _Question:
        """Test whether one channel it repeats with the wheel's rotation; the number of cycles is searched for."""
        waves = cycles(angle)
        seen = self._problem.seen[:, position]
        residual = np.where(seen, self._residuals[:, position], 0.0)
        power = np.sum(np.einsum("nkc,n->kc", waves, residual) ** 2, axis=1)
        strongest = int(np.argmax(power[1:])) + 1
        unit = self._noise.sd[position]

        def read(mean: np.ndarray, _: np.ndarray) -> _Spans:
            return ((0.0, 2.0 * np.pi / (strongest + 1), 1.0, float(np.hypot(*mean)) / unit),)

        # The strongest of many was picked: each had its chance.
        chance = float(np.log(len(power)))
        return _Question(position, "wheel_angle_rad", waves[:, strongest] * seen[:, None], read, chance)

    def _lag(self, position: int) -> _Question | None:
        """Test whether one channel it comes late: whether what is left follows its own rate of change."""
        samples, channel = self._problem.samples, self._problem.answers[position]
        predicted = self._textbook.response.channels[:, channel]
        rate = rate_of_change(predicted, samples.drive.time_s, samples.drive.stretch)
        column = np.where(np.isfinite(rate) & self._problem.seen[:, position], rate, 0.0)[:, None]
        if np.ptp(column) == 0.0:
            return None
        unit = self._noise.sd[position]

        def read(mean: np.ndarray, error: np.ndarray) -> _Spans:
            # Late by tau, a channel falls short of the simulation by tau times its rate.
            tau, spread = -float(mean[0]), 2.0 * float(error[0])
            size = float(np.sqrt(np.mean((tau * column) ** 2))) / unit
            return ((tau - spread, tau + spread, 1.0, size),)

        return _Question(position, LAG, column, read)
