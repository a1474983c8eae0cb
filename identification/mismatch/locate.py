"""Where simulation and recording differ: which channel, against which variable, over which interval.

Each question adds a step function of one variable to one channel of the textbook wheel and asks how much better it then
fits, the soil no more certain than it is; residuals are white by then (`soil_variation`), so twice the gain is
chi-square. The share of false answers is controlled over all questions (Y. Benjamini, Y. Hochberg, J. R. Stat. Soc. B
57 (1995)). Of the questions answered with yes the best of each channel is told, then what others add to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, false_discovery_control

from ..augmented import SOIL_COUNT, AugmentedWheel
from ..effects.drive import rate_of_change
from ..forward import CHANNELS
from .explanation import Region
from .fitting import Fitted, NoiseModel, Problem, fit
from .soil_variation import huber_weight
from .steps import scaled_inverse
from .variables import CONSTANT, LAG, Variable, cycles, rank, variables

FALSE_DISCOVERIES = 0.01
"""Expected share of false statements among those made [-]."""

_STANDS_OUT = 2.5
"""A cell whose mean residual is this many standard errors from zero belongs to a region [-]."""

_WORTH_SAYING = 0.1
"""A further variable is named where it adds at least this share of what the first one explains [-]."""

_AS_GOOD = (0.05, 5.0)
"""Variables explain a misfit equally well when their gains differ by less than this share and so many nats."""

_Spans = tuple[tuple[float, float, float, float], ...]
"""Start, end, share and mean residual [noise] of each interval."""


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
        The best model that was found. The textbook wheel is asked on its soil and with its noise: its own soil has
        carried the mismatch of one channel over to the others, and its own noise takes mismatch for noise.
    """
    noise = best.noise
    textbook = fit(
        problem, AugmentedWheel(problem.samples.wheel), best.vector[:SOIL_COUNT], noise, best.theta_1, iterations=0
    )
    whites = _Whitened(problem, textbook, noise, scaled_inverse(best.covariance[:SOIL_COUNT, :SOIL_COUNT]))
    questions = [each for position in range(len(problem.answers)) for each in whites.questions(position)]
    if not questions:
        return ()
    gains = [whites.gain(each) for each in questions]
    p_values = [chi2.sf(2.0 * gain, each.columns.shape[1]) for gain, each in zip(gains, questions, strict=True)]
    corrected = false_discovery_control(np.maximum(p_values, 1e-300))
    sure = [
        (each, gain, p)
        for each, gain, p in zip(questions, gains, corrected.tolist(), strict=True)
        if p <= FALSE_DISCOVERIES
    ]
    through = {name for effect in best.model.effects for name in effect.needs}
    found = [
        (channel, *each)
        for position, channel in enumerate(problem.answers)
        for each in _told(whites, [each for each in sure if each[0].position == position], through)
    ]
    most = max((sum(gain for other, _, gain, _, _ in found if other == channel) for channel, *_ in found), default=1.0)
    answer = [
        Region(CHANNELS[channel], variable, start, end, share * gain / most, p, mean)
        for channel, variable, gain, p, spans in found
        for start, end, share, mean in spans
    ]
    return tuple(sorted(answer, key=lambda region: -region.share))


def _told(
    whites: _Whitened, sure: list[tuple[_Question, float, float]], through: set[str]
) -> list[tuple[str, float, float, _Spans]]:
    """Variables of one channel that are told, each with what it adds to those before [nats], its p and intervals."""
    answer: list[tuple[str, float, float, _Spans]] = []
    given = np.empty((len(whites), 0))
    while sure:
        top = max(gain for _, gain, _ in sure)
        if answer and (top < _WORTH_SAYING * answer[0][1] or top < min(_AS_GOOD[1], answer[0][1])):
            break
        good = [each for each in sure if each[1] >= (1.0 - _AS_GOOD[0]) * top - _AS_GOOD[1]]
        question, gain, p = min(good, key=lambda each: (rank(each[0].variable, through), -each[1]))
        answer.append((question.variable, gain, p, whites.spans(question, given)))
        given = np.concatenate([given, question.columns], axis=1)
        left = [each for each in sure if each[0].variable != question.variable]
        sure = [(each, whites.gain(each, given), p) for each, _, p in left]
        sure = [each for each in sure if chi2.sf(2.0 * each[1], each[0].columns.shape[1]) <= FALSE_DISCOVERIES]
    return answer


class _Whitened:
    """The textbook wheel's residuals and soil derivatives, ready for questions."""

    def __init__(self, problem: Problem, textbook: Fitted, noise: NoiseModel, precision: np.ndarray) -> None:
        self._problem, self._textbook, self._noise, self._precision = problem, textbook, noise, precision

    def __len__(self) -> int:
        return len(self._problem.samples)

    def questions(self, position: int) -> list[_Question]:
        """Give all that is asked of one channel."""
        samples, sinkage_m = self._problem.samples, self._textbook.response.channels[:, 2]
        asked = [self._constant(position), *(self._steps(each, position) for each in variables(samples, sinkage_m))]
        angle = samples.drive.wheel_angle_rad
        if np.isfinite(angle).any() and np.nanmax(angle) - np.nanmin(angle) > 2.0 * np.pi:
            asked.append(self._periodic(angle, position))
        if samples.drive.has("time_s"):
            asked.append(self._lag(position))
        return [each for each in asked if each is not None]

    def gain(self, question: _Question, given: np.ndarray | None = None) -> float:
        """What a question's columns add to those given (n, g) in explaining its channel [nats], soil refitted."""
        count = 0 if given is None else given.shape[1]
        columns = question.columns if given is None else np.concatenate([given, question.columns], axis=1)
        gradient, information = self._equations(columns, question.position)
        base = len(self._precision) + count
        alone = 0.5 * gradient[:base] @ scaled_inverse(information[:base, :base]) @ gradient[:base]
        together = 0.5 * gradient @ scaled_inverse(information) @ gradient
        return max(float(together - alone) - question.chance, 0.0)

    def spans(self, question: _Question, given: np.ndarray) -> _Spans:
        """Where a question's columns differ from zero, beside those given (n, g) and on the soil that was found."""
        columns = np.concatenate([given, question.columns], axis=1)
        gradient, information = self._equations(columns, question.position)
        gradient, information = gradient[len(self._precision) :], information[len(self._precision) :]
        information = information[:, len(self._precision) :]
        count = given.shape[1]
        beside = scaled_inverse(information[:count, :count]) @ gradient[:count] if count else np.empty(0)
        size = np.maximum(np.diag(information)[count:], 1e-12)
        mean = (gradient[count:] - information[count:, :count] @ beside) / size
        return question.read(mean, 1.0 / np.sqrt(size))

    def _equations(self, columns: np.ndarray, position: int) -> tuple[np.ndarray, np.ndarray]:
        """Gradient and information of the soil's parameters and of columns (n, k) added to a channel."""
        problem = self._problem
        extra = np.zeros((len(columns), len(problem.answers), columns.shape[1]))
        extra[:, position] = columns
        innovations, soil, added = problem.whitened_columns(self._textbook, self._noise, extra)
        weight = huber_weight(innovations).ravel()
        count = soil.shape[-1]
        full = np.concatenate([soil, added], axis=-1).reshape(len(weight), -1)
        information = (full * weight[:, None]).T @ full
        information[:count, :count] += self._precision
        return full.T @ (weight * innovations.ravel()), information

    def _constant(self, position: int) -> _Question:
        """Ask of one channel whether it is off by the same everywhere."""
        unit = self._noise.answers[position]

        def read(mean: np.ndarray, error: np.ndarray) -> _Spans:
            size, spread = float(mean[0]), 2.0 * float(error[0])
            return ((size - spread, size + spread, 1.0, size / unit),)

        return _Question(position, CONSTANT, self._problem.seen[:, position].astype(float)[:, None], read)

    def _steps(self, variable: Variable, position: int) -> _Question | None:
        """Ask of one channel whether it leaves the simulation somewhere along a variable."""
        columns = variable.indicators() * self._problem.seen[:, position][:, None]
        filled = columns.sum(axis=0) >= 1.0
        if filled.sum() < 2:
            return None
        columns = columns[:, filled]
        rows = columns.sum(axis=0)
        edges = np.column_stack([variable.edges[:-1], variable.edges[1:]])[filled]
        unit = self._noise.answers[position]

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

    def _periodic(self, angle: np.ndarray, position: int) -> _Question:
        """Ask of one channel whether it repeats with the wheel's rotation; the number of cycles is searched for."""
        waves = cycles(angle)
        seen = self._problem.seen[:, position]
        residual = np.where(seen, self._textbook.residuals[:, position], 0.0)
        power = np.sum(np.einsum("nkc,n->kc", waves, residual) ** 2, axis=1)
        strongest = int(np.argmax(power[1:])) + 1
        unit = self._noise.answers[position]

        def read(mean: np.ndarray, _: np.ndarray) -> _Spans:
            return ((0.0, 2.0 * np.pi / (strongest + 1), 1.0, float(np.hypot(*mean)) / unit),)

        # The strongest of many was picked: each had its chance.
        chance = float(np.log(len(power)))
        return _Question(position, "wheel_angle_rad", waves[:, strongest] * seen[:, None], read, chance)

    def _lag(self, position: int) -> _Question | None:
        """Ask of one channel whether it comes late: whether what is left follows its own rate of change."""
        samples, channel = self._problem.samples, self._problem.answers[position]
        predicted = self._textbook.response.channels[:, channel]
        rate = rate_of_change(predicted, samples.drive.time_s, samples.drive.stretch)
        column = np.where(np.isfinite(rate) & self._problem.seen[:, position], rate, 0.0)[:, None]
        if np.ptp(column) == 0.0:
            return None
        unit = self._noise.answers[position]

        def read(mean: np.ndarray, error: np.ndarray) -> _Spans:
            # Late by tau, a channel falls short of the simulation by tau times its rate.
            tau, spread = -float(mean[0]), 2.0 * float(error[0])
            size = float(np.sqrt(np.mean((tau * column) ** 2))) / unit
            return ((tau - spread, tau + spread, 1.0, size),)

        return _Question(position, LAG, column, read)
