"""Information in a recording: the textbook's wheel refitted, and the nats that it loses against the truth.

The misfit of the refitted textbook model is weighed, channel by channel, by the covariance of everything that is random
in it: noise of the answer, noise of the inputs carried through the model, and the soil's variation along the track,
which couples rows of the same place (generalised least squares; the variation's covariance has low rank and is
projected out, Woodbury). That the same variation shows in several channels is not used: whoever explains a recording
does not know which parameters of the soil vary, and how.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from .effects import Effect
from .mechanics import Body, Change, Channels, Drive, Ground, loaded, simulate
from .sensors import Sensors, Variation

COARSE = 8
"""Quadrature nodes of the refit: forces within 1e-5."""

BOUNDS = np.log([[0.5, 0.02, 1e-4, 10.0, 0.1], [3e5, 2.5, 0.3, 1e9, 3.0]])
"""Between which c [Pa], tan phi, k [m], stiffness [Pa] and n are refitted (logarithms)."""


@dataclass(frozen=True)
class Weights:
    """Whitens misfits (m, c, ...).

    `scale` (m, c) is one over the standard deviation of what is independent from row to row; `basis`, one (m, q) for
    each channel, orthonormal, spans what varies with the soil, and `damping` (q,) is what is taken off along it;
    `variance` (m, c) is the whole variance of each answer.
    """

    scale: np.ndarray
    basis: tuple[np.ndarray, ...]
    damping: tuple[np.ndarray, ...]
    variance: np.ndarray

    def whiten(self, misfit: np.ndarray) -> np.ndarray:
        """Give independent unit misfits, (m c, ...), of misfits (m, c, ...)."""
        rows = misfit * self.scale.reshape(*self.scale.shape, *([1] * (misfit.ndim - 2)))
        parts = []
        for channel, (basis, damping) in enumerate(zip(self.basis, self.damping, strict=True)):
            own = rows[:, channel]
            along = (basis.T @ own) * damping.reshape(-1, *([1] * (own.ndim - 1)))
            parts.append(own - basis @ along)
        return np.concatenate(parts)


@dataclass(frozen=True)
class Case:
    """Everything that is random in a recording, for the weighing: wheel, soil, drive, sensors, variation, channels."""

    body: Body
    ground: Ground
    drive: Drive
    sensors: Sensors
    variation: Variation
    pulls: bool
    known: dict[str, tuple[float, float]]
    """Soil parameters known from elsewhere, ``c_Pa`` and ``tan_phi``: value and standard deviation."""

    @property
    def names(self) -> tuple[str, ...]:
        """Answers that are recorded."""
        return ("torque_Nm", "sinkage_m", "drawbar_pull_N")[: 3 if self.pulls else 2]

    def answers(self, channels: Channels) -> np.ndarray:
        """Give the recorded answers, (m, c)."""
        return channels.answers()[:, : len(self.names)]


def vector(ground: Ground) -> np.ndarray:
    """Give the soil's five parameters as logarithms."""
    tan_phi = float(np.tan(ground.phi_rad))
    return np.log(np.array([ground.c_Pa, tan_phi, ground.k_m, ground.stiffness_Pa, ground.n], dtype=float))


def soil(parameters: np.ndarray) -> Ground:
    """Give the soil of five logarithms."""
    c, tan_phi, k, stiffness, n = np.exp(parameters[:5]).tolist()
    return Ground(c, float(np.arctan(tan_phi)), k, stiffness, n)


def weights(case: Case, changes: Sequence[Change], truth: Channels, theta_1: np.ndarray) -> Weights:
    """Make the weights of a recording at its truth.

    The derivatives by load, slip, stiffness and strength are differences of the true model, effects included.
    """
    at_rest = case.answers(simulate(case.ground, case.body, case.drive, changes, nodes=COARSE, guess=theta_1)[0])

    def slope(
        ground: Ground = case.ground, load_N: np.ndarray | None = None, slip: np.ndarray | None = None
    ) -> np.ndarray:
        moved, _ = simulate(
            ground, case.body, case.drive, changes, nodes=COARSE, guess=theta_1, load_N=load_N, slip=slip
        )
        return case.answers(moved) - at_rest

    step = 0.01
    load_gain = float(np.mean(truth.load_N) / np.mean(case.drive.load_N))
    by_load = slope(load_N=case.drive.load_N * (1.0 + step)) / (step * case.drive.load_N[:, None]) / load_gain
    by_slip = slope(slip=case.drive.slip + 0.002) / 0.002
    by_stiffness = slope(ground=_firmer(case.ground, step, 0.0)) / step
    by_strength = slope(ground=_firmer(case.ground, 0.0, step)) / step
    inputs = (by_load * case.sensors.deviation("load_N")) ** 2
    inputs = inputs + (by_slip * case.sensors.slip_deviation(case.drive)[:, None]) ** 2
    own = np.array([case.sensors.deviation(name) for name in case.names]) ** 2
    varied = (by_stiffness * case.variation.stiffness_sd) ** 2 + (by_strength * case.variation.strength_sd) ** 2
    variance = own + inputs + varied
    if case.variation.length_m == 0.0:  # each trial on soil of its own
        empty = tuple(np.empty((len(variance), 0)) for _ in case.names)
        return Weights(variance**-0.5, empty, tuple(np.empty(0) for _ in case.names), variance)
    scale = (own + inputs) ** -0.5
    sizes = (np.sqrt(varied) * scale).T
    found = [_soil_directions(case.variation.bumps, size) for size in sizes]
    return Weights(scale, tuple(basis for basis, _ in found), tuple(damping for _, damping in found), variance)


def _soil_directions(bumps: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give the orthonormal basis (m, q) of the soil's variation in a channel, and the damping along it (q,)."""
    shape = bumps * size[:, None]
    power, along = np.linalg.eigh(shape.T @ shape)
    kept = power > 1e-3
    return (shape @ along[:, kept]) / np.sqrt(power[kept]), 1.0 - 1.0 / np.sqrt(1.0 + power[kept])


def _firmer(ground: Ground, stiffness: float, strength: float) -> Ground:
    return replace(
        ground, stiffness_Pa=ground.stiffness_Pa * (1.0 + stiffness), c_Pa=ground.c_Pa * (1.0 + strength),
        phi_rad=np.arctan(np.tan(ground.phi_rad) * (1.0 + strength)),
    )  # fmt: skip


@dataclass(frozen=True)
class Refit:
    """A model refitted: the soil as logarithms, the nats lost, its answers (m, c), R2 by channel."""

    parameters: np.ndarray
    nats: float
    answers: np.ndarray
    r2: np.ndarray


def refit_textbook(case: Case, observed: Channels, weight: Weights, start: np.ndarray) -> Refit:
    """Refit the textbook's soil to noise-free reported channels, and give the nats that the truth gains over it.

    The textbook model takes the reported load and slip for true. The data being free of noise, the nats are the
    expectation of the difference in log-likelihood, but for half a nat a parameter.
    """
    data = case.answers(observed)
    inputs = replace(case.drive, load_N=observed.load_N, slip=observed.slip)
    last: dict[str, np.ndarray] = {}

    def predict(parameters: np.ndarray) -> np.ndarray:
        channels, theta_1 = simulate(soil(parameters), case.body, inputs, nodes=COARSE, guess=last.get("theta_1"))
        if not np.isnan(theta_1).any():
            last["theta_1"] = theta_1
        return np.nan_to_num(case.answers(channels), nan=1e6)

    def misfit(parameters: np.ndarray) -> np.ndarray:
        return np.concatenate([weight.whiten(predict(parameters) - data), _prior(case, parameters)])

    def slopes(parameters: np.ndarray) -> np.ndarray:
        jacobian = weight.whiten(soil_slopes(case, inputs, parameters, last["theta_1"]))
        step = 1e-5
        prior = [(_prior(case, parameters + step * e) - _prior(case, parameters)) / step for e in np.eye(5)]
        return np.concatenate([jacobian, np.reshape(prior, (5, -1)).T])

    fit = least_squares(
        misfit, np.clip(start, BOUNDS[0] + 1e-3, BOUNDS[1] - 1e-3), slopes,  # pyright: ignore[reportArgumentType]
        bounds=(BOUNDS[0], BOUNDS[1]), x_scale=1.0, ftol=1e-4, xtol=1e-5, max_nfev=25,
    )  # fmt: skip
    answers = predict(fit.x)
    return Refit(fit.x, float(fit.cost), answers, _r2(answers, data, weight))


def _r2(answers: np.ndarray, data: np.ndarray, weight: Weights) -> np.ndarray:
    """R2 that noisy data would show, (c,): the misfit and all that is random against the spread of the channel."""
    noise = weight.variance.mean(axis=0)
    lost = np.mean((answers - data) ** 2, axis=0) + noise
    return 1.0 - lost / (np.var(data, axis=0) + noise)


def _prior(case: Case, parameters: np.ndarray) -> np.ndarray:
    values = {"c_Pa": np.exp(parameters[0]), "tan_phi": np.exp(parameters[1])}
    return np.array([(values[name] - value) / sd for name, (value, sd) in case.known.items()])


def soil_slopes(case: Case, inputs: Drive, parameters: np.ndarray, theta_1: np.ndarray) -> np.ndarray:
    """Derivatives of the textbook's answers by the five logarithms at equilibrium, (m, c, 5): implicit function."""

    def forces(ground: Ground, angle: np.ndarray) -> np.ndarray:
        load, torque, pull, sinkage = loaded(angle, inputs.slip, ground, case.body, inputs, (), COARSE)
        return np.column_stack([load, torque, sinkage, pull])

    here = forces(soil(parameters), theta_1)
    by_angle = (forces(soil(parameters), theta_1 * (1.0 + 1e-5)) - here) / (theta_1[:, None] * 1e-5)
    columns = []
    for shift in np.eye(5) * 1e-5:
        held = (forces(soil(parameters + shift), theta_1) - here) / 1e-5
        turned = -held[:, :1] / by_angle[:, :1]
        columns.append((held + turned * by_angle)[:, 1 : 1 + len(case.names)])
    return np.stack(columns, axis=2)


def refit_with(
    case: Case, observed: Channels, weight: Weights, effect: Effect, start: np.ndarray
) -> tuple[Refit, float]:  # fmt: skip
    """Refit the soil together with the magnitude of one effect; give the fit and the magnitude.

    The model takes the reported load and slip for true, but for what the effect itself makes of them: the fit
    shows whether this effect alone could stand for all that is hidden.
    """
    data = case.answers(observed)
    low, high = effect.bounds
    scale = max(effect.magnitude, 1e-3 * high)

    def predict(parameters: np.ndarray) -> np.ndarray:
        acting = effect.scaled(float(np.clip(parameters[5] * scale, low, high)))
        load, slip = acting.inputs(observed.load_N, observed.slip)
        channels, _ = simulate(soil(parameters), case.body, case.drive, [acting], nodes=COARSE, load_N=load, slip=slip)
        return np.nan_to_num(case.answers(channels), nan=1e6)

    def misfit(parameters: np.ndarray) -> np.ndarray:
        return np.concatenate([weight.whiten(predict(parameters) - data), _prior(case, parameters)])

    bounds = (np.append(BOUNDS[0], low / scale - 1e-9), np.append(BOUNDS[1], high / scale + 1e-9))
    fit = least_squares(misfit, np.append(start, 1.0), bounds=bounds, ftol=1e-3, xtol=1e-4, max_nfev=8)
    answers = predict(fit.x)
    return Refit(fit.x[:5], float(fit.cost), answers, _r2(answers, data, weight)), float(fit.x[5] * scale)


def still(channels: Channels, theta_1: np.ndarray) -> bool:
    """Whether every row has an equilibrium that is no deeper than a wheel can be driven through."""
    return bool(np.isfinite(theta_1).all() and theta_1.max() < 1.25 and (channels.sinkage_m > 0).all())
