"""Soil and effects fitted together, with the sensors' noise and the soil's variation along the track.

Load and slip are measured with errors, which spread into all answers of a sample at once. The wheel is linearised where
they probably were, by their neighbours in time, and its answers then taken at what was measured: the errors stay as
white as the sensors' (R. J. Carroll et al., "Measurement Error in Nonlinear Models" (2006), Ch. 4). In steady trials
they are shrunk towards the mean instead, and where they really change from row to row towards their neighbours'
(`load_and_slip`). The fit is maximum a posteriori by damped Gauss-Newton on whitened residuals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....framework.core.soil import PARAMETERS, PLAUSIBLE, SoilKnowledge
from ...effects.effect import LOAD, SLIP
from ...mechanics.augmented import AugmentedWheel, Entry, Response
from ...mechanics.soil import slope_of_internal, to_internal
from .likeliest_noise import NoiseKnown, Weighed, likeliest
from .memory import Memory
from .samples import Samples
from .soil_variation import SMOOTHEST, NoiseModel, Ready, huber_loss, lay_out, neighbours, stretches
from .steps import Prior, covariance_of, is_longest, step_from, step_of

_NOISE_PRIOR = (0.5, 0.1)
"""Standard deviation of ln(noise) about what neighbours show, and about what the vehicle states."""

_SOIL_PRIOR = {
    "c_Pa": (0.0, 2e4), "phi_rad": (0.6, 0.4), "k_m": (math.log(0.012), 1.2), "stiffness_Pa": (0.0, math.inf),
    "n": (math.log(0.95), 0.5),
}  # fmt: skip
"""Mean and standard deviation in internal coordinates: the range of Wong (2010), Table 2.3, wide."""

_SMOOTHER = 1.0
"""Nats from which on ground is taken to vary more, or less, smoothly."""

ENOUGH = 0.02
"""The iteration ends when a step promises less than this [nats]."""

_HOPELESS = 0.02
"""It ends, too, when a step promises less than this share of what the fit is behind another one [-]."""


_USUAL, _LONGEST = 25, 100
"""Steps after which the iteration goes on only while they gain, and after which it ends whatever they do."""

_LOOKED_BACK, _STILL_GAINS = 5, 0.5
"""The steps looked back upon then, and what each of them has to have gained [nats]: along a ridge they are short."""


@dataclass(frozen=True)
class Fitted:
    """A fit.

    Parameters
    ----------
    model, vector, noise
        The simulator, its parameters (p,) and the noise that were found.
    score
        Log-posterior [nats], up to a constant that all fits of the same samples share.
    covariance : (p, p)
        Of the vector.
    residuals : (n, m)
        Of the answers, SI, NaN where not observed.
    innovations : (n, m)
        Whitened residuals, zero where not observed.
    jacobian : (n, m, p)
        Whitened derivatives of the answers.
    theta_1 : (n,)
        Entry angles [rad].
    response
        The simulator's answers and derivatives.
    """

    model: AugmentedWheel
    vector: np.ndarray
    noise: NoiseModel
    score: float
    covariance: np.ndarray
    residuals: np.ndarray
    innovations: np.ndarray
    jacobian: np.ndarray
    theta_1: np.ndarray
    response: Response


class Problem:
    """Samples made ready: what load and slip probably were, gaps between rows, and the priors.

    Ground varies by `roughest` at most (standard deviation of ln stiffness and ln strength).
    """

    def __init__(self, samples: Samples, known: SoilKnowledge | None = None, roughest: float = 1.0) -> None:
        self.samples, self.roughest = samples, roughest
        self.known = known or SoilKnowledge()
        self.answers = list(samples.answers)
        imposed, noise = samples.measured[:, [LOAD, SLIP]], samples.noise[[LOAD, SLIP]]
        if samples.drive.timed:
            self.imposed = np.column_stack([samples.drive.load_N, samples.drive.slip])
            self.latent_covariance, self._deviation = np.diag(noise**2), imposed - self.imposed
        else:
            self.imposed, self.latent_covariance = _calibrated(imposed, noise)
            self._deviation = np.zeros_like(imposed)
        self.order, self.gap = neighbours(samples.position, samples.lane)
        self._back = np.argsort(self.order)
        self.group = stretches(self.order, self.gap)
        self.seen = np.ascontiguousarray(samples.seen)
        self.measured = samples.measured[:, self.answers]
        self.memory = Memory(samples.memory[self.answers], self.seen, samples.drive)
        self._noise_known = self._known_noise()
        self.first_noise = self._noise_known.first
        self.most = self.unbounded
        self.weights: Response | None = None
        self._latest: tuple[Response, tuple[np.ndarray, np.ndarray, np.ndarray]] | None = None

    def _known_noise(self) -> NoiseKnown:
        finite = self.gap[np.isfinite(self.gap)]
        track = float(finite.sum()) if finite.size else 1.0
        shortest = float(np.median(finite[finite > 0.0])) if (finite > 0.0).any() else 1e-3
        longest = max(0.3 * track, 2.0 * shortest)
        first = NoiseModel(self.samples.noise[self.answers], np.array([0.02, 0.02]), math.sqrt(shortest * longest))
        sd = np.where(self.samples.stated[self.answers], _NOISE_PRIOR[1], _NOISE_PRIOR[0])
        return NoiseKnown(first, sd, shortest, longest)

    def prior(self, model: AugmentedWheel, told: bool = True) -> Prior:
        """Priors and bounds of a model's parameter vector, with what is known of the soil where it is `told`."""
        mean, sd, lower, upper = [], [], [], []
        for name in PARAMETERS:
            if told and name in self.known.values:
                at = to_internal(name, self.known.values[name])
                slope = slope_of_internal(name, self.known.values[name])
                mean.append(at)
                sd.append(max(self.known.sd.get(name, 0.0) / slope, 1e-6 * max(abs(at), 1.0)))
            else:
                usual = _SOIL_PRIOR[name]
                mean.append(usual[0])
                sd.append(usual[1])
            lower.append(to_internal(name, PLAUSIBLE[name][0]))
            upper.append(to_internal(name, PLAUSIBLE[name][1]))
        lower[0] = 0.0
        for effect, _ in model.slices():
            for parameter in effect.parameters:
                mean.append(parameter.null)
                sd.append(parameter.scale)
                lower.append(parameter.low)
                upper.append(parameter.high)
        sd = np.array(sd)
        return Prior(np.array(mean), np.where(np.isfinite(sd), 1.0 / sd**2, 0.0), np.array(lower), np.array(upper))

    def linearise(
        self, model: AugmentedWheel, vector: np.ndarray, entry: Entry | None, known: Response | None = None
    ) -> Response:
        """Answer of the model with derivatives, those that are `known` taken over, in the samples' order."""
        latent = self.weights is None
        return model.linearise(self.samples.drive, self.imposed, vector, entry, latent=latent, known=known)

    @property
    def unbounded(self) -> NoiseModel:
        """The most that noise and the soil's variation may be where nothing says less."""
        spread = np.full(2, self.roughest)
        return NoiseModel(self.first_noise.answers * math.exp(4.0), spread, self._noise_known.longest)

    def residuals(self, response: Response, weights: Response | None = None) -> np.ndarray:
        """What a model leaves of the answers (n, m), SI, taken at the load and slip measured."""
        moved, _, _ = self._weighed_by(self.weights or weights or response)
        return self.measured - response.channels[:, self.answers] - moved

    def _weighed_by(self, weights: Response) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How far answers are moved by what load and slip deviate, (n, m), SI; and, in the order in which the soil's
        variation is followed, how what is new in them answers that variation, and load and slip, (n, m, 2) each.
        """
        latest = self._latest
        if latest is None or latest[0] is not weights:
            by_latent = np.nan_to_num(weights.by_latent[:, self.answers])
            vary = np.nan_to_num(weights.by_ground[:, self.answers])
            moved = np.einsum("nca,na->nc", by_latent, self._deviation)
            vary, by_latent = self.memory.new_in(vary), self.memory.of_independent(by_latent)
            self._latest = latest = weights, (moved, vary[self.order], by_latent[self.order])
        return latest[1]

    def whitened(
        self, response: Response, noise: NoiseModel, weights: Response | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Innovations (n, m), their derivatives (n, m, p) by the parameters, and each row's loss (n,) [nats].

        Errors of load and slip and the soil's variation are carried as the `weights` answer them: models that are
        weighed alike can be compared, where each with its own weights would prefer what hides the errors.
        """
        ready = self._ready(response, weights)
        columns, log_scale = ready.filter(noise, self.latent_covariance, self.gap, derivatives=True)
        # What was not seen is zero in white columns, too.
        columns, log_scale = columns[self._back], log_scale[self._back]
        innovations = columns[..., 0]
        loss = huber_loss(innovations).sum(axis=1) + log_scale.sum(axis=1) + self.memory.log_scale
        return innovations, columns[..., 1:], loss

    def loss(self, residuals: np.ndarray, fitted: Fitted) -> np.ndarray:
        """Loss of each row (n,) [nats] for residuals (n, m), SI, NaN where nothing was predicted, by a fit's noise."""
        ready = self._ready(fitted.response)
        residuals = np.where(np.isfinite(residuals), residuals, self.measured)
        new = self.memory.new_in(np.where(self.seen, residuals, 0.0))
        ready = replace(ready, columns=new[self.order][..., None])
        columns, log_scale = ready.filter(fitted.noise, self.latent_covariance, self.gap, derivatives=False)
        answer = np.empty(len(residuals))
        answer[self.order] = huber_loss(np.where(ready.seen, columns[..., 0], 0.0)).sum(axis=1) + log_scale.sum(axis=1)
        return answer + self.memory.log_scale

    def whitened_columns(
        self, fitted: Fitted, noise: NoiseModel, extra: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Innovations (n, m) of a fit, their derivatives (n, m, p) and further columns (n, m, k) made white alike."""
        wider = np.zeros((len(self.measured), 5, extra.shape[-1]))
        wider[:, self.answers] = extra
        both = np.concatenate([fitted.response.by_parameter, wider], axis=-1)
        innovations, columns, _ = self.whitened(replace(fitted.response, by_parameter=both), noise)
        size = len(fitted.vector)
        return innovations, columns[..., :size], columns[..., size:]

    def _ready(self, response: Response, weights: Response | None = None) -> Ready:
        """Residuals and derivatives, of what is new in each row, in the order in which the variation is followed."""
        order, weights = self.order, self.weights or weights or response
        residual, seen = self.residuals(response, weights), self.seen
        carried = np.asarray(np.isfinite(response.channels[:, self.answers]).all(axis=1))
        # A wheel that the soil does not carry predicts nothing, which is as wrong as can be.
        residual[~carried] = self.measured[~carried]
        columns = np.empty((*seen.shape, 1 + response.by_parameter.shape[-1]))
        lay_out(residual, response.by_parameter, order, np.array(self.answers), seen, carried, columns)
        _, vary, latent = self._weighed_by(weights)
        if self.memory.any:
            columns = self.memory.new_in(columns[self._back])[order]
        return Ready(columns, seen[order], vary, latent)

    def noise_loss(self, noise: NoiseModel) -> float:
        """Minus the log-prior of the noise."""
        return self._noise_known.loss(noise)

    def best_noise(self, response: Response, vector: np.ndarray, start: NoiseModel, prior: Prior) -> NoiseModel:
        """Noise and variation of the soil that explain a response's residuals best, the parameters following along.

        Were the parameters held, what they leave unexplained would pass for variation of the soil, and they would not
        move once it does. They follow as far as one step goes: beyond, no line foretells what they would explain.
        """
        weigh = partial(self._weighed_beside, self._ready(response), vector, prior)
        return likeliest(weigh, start, self._noise_known.prior(self.most), self.latent_covariance, self.gap)

    def least_loss(self, response: Response, vector: np.ndarray, start: NoiseModel, prior: Prior) -> float:
        """Loss [nats] of a response's residuals beside the noise that explains them best (`best_noise`), and its."""
        noise = self.best_noise(response, vector, start, prior)
        return self._weighed_beside(self._ready(response), vector, prior, noise).loss + self.noise_loss(noise)

    def _weighed_beside(self, ready: Ready, vector: np.ndarray, prior: Prior, noise: NoiseModel) -> Weighed:
        loss, gradient, information = ready.weighed(noise, self.latent_covariance, self.gap)
        step, gained = step_from(gradient, information, prior, vector, 0.0)
        columns = np.stack([ready.columns[..., 0], ready.columns[..., 1:] @ step], axis=-1)
        return Weighed(loss - gained, replace(ready, columns=columns), at_rest=not is_longest(step))

    def repeated_noise(self, response: Response, repeat: np.ndarray) -> NoiseModel:
        """Noise and variation of the soil that explain how repeats of one trial differ, whatever the model.

        Parameters
        ----------
        response
            Of the textbook wheel, which takes out what small differences in load and slip do.
        repeat : (n,)
            Number of the trial that each row repeats, -1 where none.
        """
        ready = self._ready(response)
        rows = repeat[self.order] >= 0
        trial = repeat[self.order][rows]
        size = np.bincount(trial)
        mean = np.zeros((len(size), len(self.answers)))
        np.add.at(mean, trial, ready.columns[rows, :, 0])
        # Deviations from a mean of m repeats scatter less than repeats do.
        wider = np.sqrt(size / (size - 1.0))[trial, None]
        away = (ready.columns[rows, :, 0] - (mean / size[:, None])[trial]) * wider
        apart = Ready(away[..., None], ready.seen[rows], ready.by_variation[rows], ready.by_latent[rows])
        share = float(np.sum(size - 1.0)) / len(trial)
        alone = np.full(len(trial), np.inf)

        def weigh(noise: NoiseModel) -> Weighed:
            columns, log_scale = apart.filter(noise, self.latent_covariance, alone, derivatives=False)
            return Weighed(share * float(huber_loss(columns[..., 0]).sum() + log_scale.sum()), apart)

        prior = self._noise_known.prior(self.most)
        return likeliest(weigh, self.first_noise, prior, self.latent_covariance, alone, share)


def _calibrated(measured: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Expected load and slip of each sample (n, 2) given what was measured, and their covariance (2, 2)."""
    variance = noise**2
    mean, total = measured.mean(axis=0), np.var(measured, axis=0)
    truth = np.maximum(total - variance, 0.02 * total + 1e-30)
    share = truth / (truth + variance)
    return mean + share * (measured - mean), np.diag(share * variance)


def fit(
    problem: Problem,
    model: AugmentedWheel,
    vector: np.ndarray,
    noise: NoiseModel | None = None,
    theta_1: np.ndarray | None = None,
    iterations: int | None = None,
    settle: bool = True,
    rival: float = -math.inf,
) -> Fitted:
    """Fit a model from a start.

    Parameters
    ----------
    problem
        The samples.
    model
        The simulator.
    vector : (p,)
        Where to start.
    noise, theta_1
        Where the noise and the entry angles (n,) [rad] start.
    iterations
        At most this many steps; where absent as many as gain.
    settle
        Fit the noise as well.
    rival
        Score of another fit of the same samples: how exactly one far behind it fails is of no interest.
    """
    prior = problem.prior(model)
    vector = np.clip(vector, prior.lower, prior.upper)
    response = problem.linearise(model, vector, None if theta_1 is None else Entry(theta_1))
    damping, settled, since = 1e-3, 0, math.inf
    if noise is None:
        noise = problem.best_noise(response, vector, problem.first_noise, prior)
    innovations, jacobian, loss = problem.whitened(response, noise)
    total = float(loss.sum()) + prior.loss(vector)
    formerly = math.inf
    for iteration in range(_LONGEST if iterations is None else iterations):
        if iterations is None and iteration % _LOOKED_BACK == 0:
            lost = total + problem.noise_loss(noise)
            if iteration >= _USUAL and formerly - lost < _LOOKED_BACK * _STILL_GAINS:
                break
            formerly = lost
        step, promised = step_of(innovations, jacobian, prior, vector, damping)
        enough = max(ENOUGH, _HOPELESS * (rival + total + problem.noise_loss(noise)))
        if promised < enough:
            # A third of a nat decides nothing, for effects are asked for twelve; nor do more, far behind a rival.
            if not settle or settled > 3 or since - total < 15.0 * max(ENOUGH, enough - 1.0):
                break
            noise = problem.best_noise(response, vector, noise, prior)
            innovations, jacobian, loss = problem.whitened(response, noise)
            total = since = float(loss.sum()) + prior.loss(vector)
            settled += 1
            continue
        trial = np.clip(vector + step, prior.lower, prior.upper)
        answer = problem.linearise(model, trial, response.entry(trial - vector))
        looks = problem.whitened(answer, noise, response)
        reached = float(looks[2].sum()) + prior.loss(trial)
        if reached < total:
            vector, response, before = trial, answer, total
            again = settle and iteration == 2
            if again:
                noise = problem.best_noise(response, vector, noise, prior)
            if again or problem.weights is None:
                looks = problem.whitened(response, noise)
            innovations, jacobian, loss = looks
            total = float(loss.sum()) + prior.loss(vector)
            # By how well the step was foretold (H. B. Nielsen, IMM-REP-1999-05, Technical University of Denmark).
            change = max(1.0 / 3.0, 1.0 - (2.0 * (before - reached) / promised - 1.0) ** 3)
            # Weighed as it is itself it may be worse again: then by shorter steps, or two soils would take turns.
            damping = max(damping * change, 1e-6) if again or total <= before else max(damping, 1e-3) * 10.0
        else:
            damping = max(damping, 1e-4) * 10.0
            if damping > 1e6:
                break
    covariance = covariance_of(innovations, jacobian, prior, problem.group)
    residuals = np.where(problem.seen, problem.residuals(response), np.nan)
    score = -total - problem.noise_loss(noise)
    return Fitted(model, vector, noise, score, covariance, residuals, innovations, jacobian, response.theta_1, response)


def as_smooth_as_it_is(problem: Problem, fitted: Fitted, rival: float = -math.inf) -> Fitted:
    """Go on with a fit in ground that varies along the track more or less smoothly, as long as that gains."""
    if not np.isfinite(problem.gap).any():
        return fitted
    best, prior = fitted, problem.prior(fitted.model)
    for way in (1, -1):
        smooth = fitted.noise.smooth + way
        while 0 <= smooth <= SMOOTHEST:
            start = replace(best.noise, smooth=smooth)
            noise = problem.best_noise(best.response, best.vector, start, prior)
            lost = problem.whitened(best.response, noise)[2].sum() + prior.loss(best.vector) + problem.noise_loss(noise)
            if best.score + lost > -_SMOOTHER:
                break
            best = fit(problem, best.model, best.vector, noise, best.theta_1, rival=rival)
            smooth += way
    return best
