"""What nothing in the catalogue explains: a smooth correction of channels against variables, added while it predicts.

Splines of one variable on one channel at a time enter by forward selection on held-out blocks; their coefficients have
a normal prior, and are fitted together with the model's parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...effects.effect import Effect
from ...mechanics.textbook import CHANNELS
from ..fit.fitting import Fitted, Problem
from ..fit.held_out import HeldOut, soil_nats, summed, told_alone
from ..fit.soil_variation import huber_loss, huber_weight
from ..fit.steps import scaled_solve
from .play import BEHIND_PLAY, held_back
from .variables import MOST_CYCLES, cycles, variables

STRENGTH = 20.0
"""Prior standard deviation of a spline's coefficient, in units of the channel's noise."""

_WORTH = 10.0
"""A group of splines is added where it gains more than this many nats on held-out blocks."""

_FELT = 2.0
"""As much, where it is of no interest what is left, but only whether anything is."""

_MOST_GROUPS = 6

_WANDERED = ("time_s", "x_m", "y_m", "distance_m")
"""Variables along which errors with a memory wander by chance."""

_RIDGE = 1e-9
"""Keeps columns that undo each other apart (`scaled_solve`) [-]."""

NO_WORSE = 1.05
"""A correction may not raise the mean square of what is left of its channel beyond this share [-]."""


@dataclass(frozen=True)
class Term:
    """A smooth function of a variable, `at` (n,), on a channel; `values` (n,) is what it adds, SI; `gain` in nats."""

    channel: str
    variable: str
    at: np.ndarray
    values: np.ndarray
    gain: float


@dataclass(frozen=True)
class SmoothCorrection:
    """Terms, what they gain in all on held-out blocks and by how much that scatters between them (standard deviation)
    [nats], what they add while held out (n, m), SI, and the whitened residuals (n, m) that they leave. `excused` where
    terms are left out that a named effect is the cause of.
    """

    terms: tuple[Term, ...]
    gain: float
    gain_sd: float
    held_out: np.ndarray
    innovations: np.ndarray
    excused: bool = False

    def beyond(self, effects: Iterable[Effect], gained: float) -> SmoothCorrection:
        """Leave out what a set's effects are the cause of (`Effect.any_course`), if they `gained` no less than that."""
        courses = {effect.any_course for effect in effects}
        others = tuple(term for term in self.terms if (term.channel, term.variable) not in courses)
        unknown = sum(term.gain for term in others)
        if len(others) == len(self.terms) or self.gain - unknown > gained:
            return self
        return replace(self, terms=others, gain=unknown, excused=True)

    @property
    def explained(self) -> np.ndarray:
        """What it makes of the residuals (n, m), SI; nothing where time or place is in it: a memory wanders so, too."""
        wanders = self.excused or any(term.variable in _WANDERED for term in self.terms)
        return np.zeros_like(self.held_out) if wanders else self.held_out


@dataclass(frozen=True)
class Group:
    """Columns (n, k) of a variable, `at` (n,), that may be missing from one of the answers, by its position; they are
    the strongest of so many.
    """

    position: int
    variable: str
    at: np.ndarray
    columns: np.ndarray
    of_many: int = 1

    @property
    def sought(self) -> float:
        """Nats of chance that the search for the strongest had."""
        return math.log(self.of_many)


def smooth_correction(problem: Problem, fitted: Fitted, alone: HeldOut) -> SmoothCorrection:
    """Find what a fit leaves that depends smoothly on something; `alone` is how the fit predicts by itself."""
    groups = _groups(problem, fitted)
    solver = Solver(problem, fitted, groups)
    without = solver.held_out([])

    def added(chosen: list[int]) -> np.ndarray:
        """What corrections add while held out (n, m), SI, the fit's parameters following."""
        return without - solver.held_out(chosen)

    def worsens(chosen: list[int], further: int) -> bool:
        """Say whether a further correction adds, while held out, to the error of its channel: it calms the steps from
        row to row and leaves the level wrong.
        """
        position = groups[further].position
        before, after = (alone.residuals - added(each) for each in (chosen, [*chosen, further]))
        return _error(after[:, position]) > NO_WORSE * _error(before[:, position])

    chosen, gains = _selected(solver, groups, _WORTH, worsens)
    held_out = added(chosen)
    terms = tuple(
        Term(CHANNELS[problem.answers[groups[index].position]], groups[index].variable, groups[index].at, values, gain)
        for index, values, gain in zip(chosen, solver.added(chosen), gains, strict=True)
    )
    _, scatter = summed(solver.predicted(chosen) - solver.predicted([]))
    return SmoothCorrection(terms, sum(gains), scatter, held_out, solver.left(chosen))


def nats_left(problem: Problem, fitted: Fitted, effects: Iterable[Effect]) -> float:
    """Nats that corrections gain in all beside a fit of some effects, those aside that such an effect is the cause of.

    Each may gain so little that it is no finding, and errors may grow with it: beside a right set they sum to nothing.
    """
    courses = {effect.any_course for effect in effects}
    groups = _groups(problem, fitted)
    groups = [group for group in groups if (CHANNELS[problem.answers[group.position]], group.variable) not in courses]
    return sum(_selected(Solver(problem, fitted, groups), groups, _FELT)[1])


def _selected(
    solver: Solver, groups: list[Group], least: float, useless: Callable[[list[int], int], bool] | None = None
) -> tuple[list[int], list[float]]:
    """Select groups forward while one gains `least` nats on held-out blocks and is not `useless` beside the others.

    Gives the groups' numbers, and the nats that each gained.
    """
    chosen: list[int] = []
    gains: list[float] = []
    others = set(range(len(groups)))
    best = solver.predictive([])
    while len(chosen) < _MOST_GROUPS and others:
        # The best of many is good by chance too.
        reached = {index: solver.predictive([*chosen, index]) - groups[index].sought for index in sorted(others)}
        winner = max(reached, key=lambda index: reached[index])
        gain = reached[winner] - best - math.log(len(others))
        if gain < least:
            break
        others.remove(winner)
        if useless is None or not useless(chosen, winner):
            gains.append(gain)
            best = reached[winner] + groups[winner].sought
            chosen.append(winner)
    return chosen, gains


def _error(residuals: np.ndarray) -> float:
    return float(np.nanmean(residuals**2))


def _groups(problem: Problem, fitted: Fitted) -> list[Group]:
    answer = []
    drive = problem.samples.drive
    bases = {
        variable.name: (variable.values, variable.smooth())
        for variable in variables(problem.samples, fitted.response.channels[:, 2])
    }
    if "slip" in bases and "load_N" in bases:
        product = (drive.slip - drive.slip.mean()) * (drive.load_N / drive.load_N.mean() - 1.0)
        bases["slip x load"] = product, product[:, None] / max(float(product.std()), 1e-12)
    if drive.timed:
        answer += _held_back(problem, fitted)
    ripples = (
        ripples_with_angle(problem, fitted.residuals / fitted.noise.answers) if drive.has("wheel_angle_rad") else []
    )
    positions = range(len(problem.answers))
    for name, (at, columns) in bases.items():
        if columns.shape[1]:
            answer += [Group(position, name, at, columns) for position in positions]
    return answer + ripples


def ripples_with_angle(problem: Problem, left: np.ndarray) -> list[Group]:
    """A ripple on each channel with the wheel's angle, of the number of cycles a turn that is strongest in what is left
    (n, m).
    """
    angle = problem.samples.drive.wheel_angle_rad
    waves = cycles(angle)
    power = np.sum(np.einsum("nkc,nm->kcm", waves, np.nan_to_num(left)) ** 2, axis=(1, 2))
    count = int(np.argmax(power)) + 1
    name = f"wheel_angle_rad ({count} cycle{'s' if count > 1 else ''} a turn)"
    positions = range(len(problem.answers))
    return [Group(position, name, angle, waves[:, count - 1], MOST_CYCLES) for position in positions]


def _held_back(problem: Problem, fitted: Fitted) -> list[Group]:
    """What play holds back of each answer: a joint of its linkage, or an amplifier that remembers which way it came."""
    answer = []
    for position, channel in enumerate(problem.answers):
        columns = held_back(fitted.response.channels[:, channel], problem.samples.drive.stretch)
        if columns.any():
            name = CHANNELS[channel] + BEHIND_PLAY
            answer.append(Group(position, name, columns[:, 0], columns - columns.mean(axis=0)))
    return answer


class Solver:
    """Whitened normal equations of a fit and all groups, by block."""

    def __init__(self, problem: Problem, fitted: Fitted, groups: list[Group]) -> None:
        self._problem, self._fitted, self._size = problem, fitted, len(fitted.vector)
        channels = len(problem.answers)
        widths = [group.columns.shape[1] for group in groups]
        starts = np.concatenate([[0], np.cumsum(widths)]).astype(int)
        extra = np.zeros((len(problem.measured), channels, int(starts[-1])))
        for group, start, width in zip(groups, starts[:-1], widths, strict=True):
            extra[:, group.position, start : start + width] = group.columns * fitted.noise.answers[group.position]
        self._extra = np.where(problem.seen[..., None], extra, 0.0)
        innovations, own, added = problem.whitened_columns(fitted, fitted.noise, self._extra)
        self._innovations = innovations.reshape(-1)
        self._columns = np.concatenate([own, added], axis=-1).reshape(len(self._innovations), -1)
        self._block = np.repeat(np.unique(problem.samples.block, return_inverse=True)[1], channels)
        self._shape = (len(problem.measured), channels)
        weight = huber_weight(self._innovations)
        prior = problem.prior(fitted.model).precision
        self._prior = np.concatenate([prior, np.full(int(starts[-1]), 1.0 / STRENGTH**2)])
        # The prior's pull on the model's own parameters is balanced at the fit.
        self._pull = prior * (problem.prior(fitted.model).mean - fitted.vector)
        self._where = [
            np.arange(start, start + width) + self._size for start, width in zip(starts[:-1], widths, strict=True)
        ]
        blocks = int(self._block.max()) + 1
        self._gradient, self._information = [], []
        for block in range(blocks):
            rows = self._block == block
            part = self._columns[rows]
            self._gradient.append(part.T @ (weight[rows] * self._innovations[rows]))
            self._information.append((part * weight[rows][:, None]).T @ part)
        self._all_gradient = np.sum(self._gradient, axis=0)
        self._all_information = np.sum(self._information, axis=0)
        # No other block tells these: they stay as they were found.
        own = np.array([np.diag(each)[: self._size] for each in self._information])
        self._alone = np.zeros((blocks, len(self._prior)), dtype=bool)
        self._alone[:, : self._size] = told_alone(fitted, problem.samples, own)

    def _chosen(self, groups: list[int]) -> np.ndarray:
        return np.concatenate([np.arange(self._size), *[self._where[index] for index in groups]])

    def _solve(self, which: np.ndarray, without: int | None) -> np.ndarray:
        gradient, information = self._all_gradient[which], self._all_information[np.ix_(which, which)]
        if without is not None:
            gradient = gradient - self._gradient[without][which]
            information = information - self._information[without][np.ix_(which, which)]
        gradient = gradient + np.concatenate([self._pull, np.zeros(len(which) - self._size)])
        information = information + np.diag(self._prior[which])
        free = np.ones(len(which), dtype=bool) if without is None else ~self._alone[without][which]
        answer = np.zeros(len(which))
        answer[free] = scaled_solve(information[np.ix_(free, free)], gradient[free], _RIDGE)
        return answer

    def predicted(self, groups: list[int]) -> np.ndarray:
        """Predictive log-likelihood of each block, held out (b,) [nats], up to a constant."""
        which = self._chosen(groups)
        answer = np.empty(len(self._gradient))
        for block in range(len(answer)):
            rows = self._block == block
            left = self._innovations[rows] - self._columns[np.ix_(rows, which)] @ self._solve(which, block)
            answer[block] = -float(huber_loss(left).sum())
        return answer

    def predictive(self, groups: list[int]) -> float:
        """Sum `predicted` over all blocks [nats]."""
        return float(self.predicted(groups).sum())

    def soil_nats(self, groups: list[int]) -> float:
        """Predictive log-density of what is known of the soil beside these groups [nats], 0 where nothing is."""
        if not self._problem.known.values:
            return 0.0
        which = self._chosen(groups)
        information = self._all_information[np.ix_(which, which)]
        return soil_nats(self._problem, self._fitted, self._all_gradient[which], information, STRENGTH)

    def left(self, groups: list[int]) -> np.ndarray:
        """Whitened residuals (n, m) of a fit with these groups."""
        which = self._chosen(groups)
        return (self._innovations - self._columns[:, which] @ self._solve(which, None)).reshape(self._shape)

    def added(self, groups: list[int]) -> list[np.ndarray]:
        """What each group adds (n,), SI."""
        solution = self._solve(self._chosen(groups), None)
        answer, start = [], self._size
        for index in groups:
            columns = self._where[index] - self._size
            own = solution[start : start + len(columns)]
            answer.append((self._extra[..., columns] @ own).sum(axis=1))
            start += len(columns)
        return answer

    def held_out(self, groups: list[int]) -> np.ndarray:
        """Residuals (n, m), SI, of rows that neither these groups nor the fit's parameters, to first order, saw."""
        which = self._chosen(groups)
        slopes = np.nan_to_num(self._fitted.response.by_parameter[:, self._problem.answers])
        columns = np.concatenate([slopes, self._extra[..., which[self._size :] - self._size]], axis=-1)
        answer, rows_block = self._fitted.residuals.copy(), self._block.reshape(self._shape)[:, 0]
        for block in range(len(self._gradient)):
            rows = rows_block == block
            answer[rows] -= columns[rows] @ self._solve(which, block)
        return answer
