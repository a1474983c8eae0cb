"""Where simulation and recording differ: which channel, against which variable, over which interval.

Each question adds a step function of one variable to one channel of the textbook wheel and asks how much better it then
fits, the soil no more certain than it is; residuals are white by then (`soil_variation`), so twice the gain is
chi-square. The share of false answers is controlled over all questions (Y. Benjamini, Y. Hochberg, J. R. Stat. Soc. B
57 (1995)).
"""

from __future__ import annotations

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
from .variables import Variable, cycles, variables

FALSE_DISCOVERIES = 0.01
"""Expected share of false statements among those made [-]."""

_STANDS_OUT = 2.5
"""A cell whose mean residual is this many standard errors from zero belongs to a region [-]."""

_WORTH_SAYING = 0.3
"""A variable is named where it explains at least this share of what the best variable of its channel does [-]."""


@dataclass(frozen=True)
class _Question:
    channel: int
    variable: str
    gain: float
    freedom: int
    regions: tuple[tuple[float, float, float, float], ...]


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
    questions = []
    noise = best.noise
    textbook = fit(
        problem, AugmentedWheel(problem.samples.wheel), best.vector[:SOIL_COUNT], noise, best.theta_1, iterations=0
    )
    soil = scaled_inverse(best.covariance[:SOIL_COUNT, :SOIL_COUNT])
    whites = _Whitened(problem, textbook, noise, soil)
    for variable in variables(problem.samples, textbook.response.channels[:, 2]):
        for position, channel in enumerate(problem.answers):
            questions.append(whites.steps(variable, position, channel))
    angle = problem.samples.drive.wheel_angle_rad
    if np.isfinite(angle).any() and np.nanmax(angle) - np.nanmin(angle) > 2.0 * np.pi:
        questions += [whites.periodic(angle, position, channel) for position, channel in enumerate(problem.answers)]
    if problem.samples.drive.has("time_s"):
        questions += [whites.lag(position, channel) for position, channel in enumerate(problem.answers)]
    questions = [question for question in questions if question.freedom > 0]
    if not questions:
        return ()
    p_values = np.array([float(chi2.sf(2.0 * each.gain, each.freedom)) for each in questions])
    corrected = false_discovery_control(np.maximum(p_values, 1e-300))
    sure = [(each, p) for each, p in zip(questions, corrected, strict=True) if p <= FALSE_DISCOVERIES]
    strongest = {each.channel: 0.0 for each in questions}
    for each, _ in sure:
        strongest[each.channel] = max(strongest[each.channel], each.gain)
    most = max(strongest.values())
    answer = [
        Region(
            CHANNELS[each.channel], each.variable, start, end, share * each.gain / most, float(p_value), mean,
        )
        for each, p_value in sure
        if each.gain >= _WORTH_SAYING * strongest[each.channel]
        for start, end, share, mean in each.regions
    ]  # fmt: skip
    return tuple(sorted(answer, key=lambda region: -region.share))


class _Whitened:
    """The textbook wheel's residuals and soil derivatives, ready for questions."""

    def __init__(self, problem: Problem, textbook: Fitted, noise: NoiseModel, precision: np.ndarray) -> None:
        self._problem, self._textbook, self._noise, self._precision = problem, textbook, noise, precision

    def _gain(self, columns: np.ndarray, position: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Gain of adding columns (n, k) to a channel [nats], their coefficients and standard errors, soil refitted."""
        problem = self._problem
        extra = np.zeros((len(columns), len(problem.answers), columns.shape[1]))
        extra[:, position] = columns
        innovations, soil, added = problem.whitened_columns(self._textbook, self._noise, extra)
        weight = huber_weight(innovations).ravel()
        count = soil.shape[-1]
        full = np.concatenate([soil, added], axis=-1).reshape(len(weight), -1)
        information = (full * weight[:, None]).T @ full
        information[:count, :count] += self._precision
        gradient = full.T @ (weight * innovations.ravel())
        alone = 0.5 * gradient[:count] @ scaled_inverse(information[:count, :count]) @ gradient[:count]
        together = scaled_inverse(information) @ gradient
        held = gradient[count:] / np.maximum(np.diag(information)[count:], 1e-12)
        error = 1.0 / np.sqrt(np.maximum(np.diag(information)[count:], 1e-12))
        return float(0.5 * gradient @ together - alone), held, error

    def steps(self, variable: Variable, position: int, channel: int) -> _Question:
        """Ask of one channel whether it leaves the simulation somewhere along a variable."""
        seen = self._problem.seen[:, position]
        columns = variable.indicators() * seen[:, None]
        filled = columns.sum(axis=0) >= 1.0
        if filled.sum() < 2:
            return _Question(channel, variable.name, 0.0, 0, ())
        columns = columns[:, filled]
        gain, mean, error = self._gain(columns, position)
        edges = np.column_stack([variable.edges[:-1], variable.edges[1:]])[filled]
        weight = np.maximum(mean**2 - error**2, 0.0) * columns.sum(axis=0)
        total = max(float(weight.sum()), 1e-300)
        unit = self._noise.answers[position]
        regions = []
        stands = np.where(np.abs(mean) > _STANDS_OUT * error, np.sign(mean), 0.0)
        borders = np.flatnonzero(np.diff(stands)) + 1
        for cells in np.split(np.arange(len(stands)), borders):
            if stands[cells[0]] != 0.0:
                share = float(weight[cells].sum()) / total
                level = float(np.average(mean[cells], weights=columns.sum(axis=0)[cells])) / unit
                regions.append((float(edges[cells[0], 0]), float(edges[cells[-1], 1]), share, level))
        regions = [region for region in regions if region[2] >= 0.1]
        return _Question(channel, variable.name, gain, int(filled.sum()), tuple(regions))

    def periodic(self, angle: np.ndarray, position: int, channel: int) -> _Question:
        """Ask of one channel whether it repeats with the wheel's rotation; the number of cycles is searched for."""
        waves = cycles(angle)
        seen = self._problem.seen[:, position]
        residual = np.where(seen, self._textbook.residuals[:, position], 0.0)
        power = np.sum(np.einsum("nkc,n->kc", waves, residual) ** 2, axis=1)
        strongest = int(np.argmax(power[1:])) + 1
        gain, mean, _ = self._gain(waves[:, strongest] * seen[:, None], position)
        # The strongest of many was picked: each had its chance.
        gain = max(gain - np.log(len(power)), 0.0)
        size = float(np.hypot(*mean)) / self._noise.answers[position]
        return _Question(channel, "wheel_angle_rad", gain, 2, ((0.0, 2.0 * np.pi / (strongest + 1), 1.0, size),))

    def lag(self, position: int, channel: int) -> _Question:
        """Ask of one channel whether it comes late: whether what is left follows its own rate of change."""
        samples, predicted = self._problem.samples, self._textbook.response.channels[:, channel]
        rate = rate_of_change(predicted, samples.drive.time_s, samples.drive.stretch)
        column = np.where(np.isfinite(rate) & self._problem.seen[:, position], rate, 0.0)[:, None]
        if np.ptp(column) == 0.0:
            return _Question(channel, "lag_s", 0.0, 0, ())
        gain, mean, error = self._gain(column, position)
        # Late by tau, a channel falls short of the simulation by tau times its rate.
        tau, spread = -float(mean[0]), 2.0 * float(error[0])
        size = float(np.sqrt(np.mean((tau * column) ** 2))) / self._noise.answers[position]
        return _Question(channel, "lag_s", gain, 1, ((tau - spread, tau + spread, 1.0, size),))
