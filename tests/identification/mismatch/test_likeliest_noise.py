"""The noise that residuals ask for: found as exactly as a search that knows nothing of it finds it, and recovered."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bevameter.identification.mismatch.fit.likeliest_noise import NoiseKnown, Weighed, likeliest
from bevameter.identification.mismatch.fit.noise_score import told_of
from bevameter.identification.mismatch.fit.soil_variation import NoiseModel, Ready, huber_loss, huber_weight
from bevameter.identification.mismatch.fit.steps import Prior, is_longest, step_from
from scipy.optimize import minimize

LATENT = np.diag([0.02, 0.03]) ** 2
GUESS = NoiseModel(np.array([0.2, 0.2]), np.array([0.02, 0.02]), 0.3)
KNOWN = NoiseKnown(GUESS, np.array([0.5, 0.5]), 0.05, 20.0)
MOST = NoiseModel(np.array([10.0, 10.0]), np.ones(2), 20.0)


def track(rng, noise: NoiseModel, rows: int = 1500) -> tuple[Ready, np.ndarray]:
    """Residuals of two channels over ground that varies as told, and the gaps between rows."""
    gap = np.concatenate([[np.inf], np.full(rows - 1, 0.05)])
    by_variation, by_latent = rng.normal(size=(2, rows, 2, 2))
    ground, keep = np.empty((rows, 2)), math.exp(-0.05 / noise.length)
    ground[0] = rng.normal(size=2)
    for row in range(1, rows):
        ground[row] = keep * ground[row - 1] + math.sqrt(1.0 - keep**2) * rng.normal(size=2)
    residual = np.einsum("nca,na->nc", by_variation, noise.spread * ground) + noise.answers * rng.normal(size=(rows, 2))
    residual += np.einsum("nca,na->nc", by_latent, rng.normal(size=(rows, 2)) @ np.sqrt(LATENT))
    seen = rng.random((rows, 2)) > 0.1
    return Ready(np.where(seen, residual, 0.0)[..., None], seen, by_variation, by_latent), gap


def weighing(ready: Ready, gap: np.ndarray):
    def weigh(noise: NoiseModel) -> Weighed:
        columns, log_scale = ready.filter(noise, LATENT, gap, derivatives=False)
        return Weighed(float(huber_loss(columns[..., 0]).sum() + log_scale.sum()), ready)

    return weigh


@pytest.mark.parametrize("spread", [(0.0, 0.0), (0.05, 0.1), (0.4, 0.02)])
def test_it_is_the_noise_of_the_least_loss(spread, rng):
    made = NoiseModel(np.array([0.05, 0.3]), np.array(spread), 1.0)
    ready, gap = track(rng, made)
    weigh, prior = weighing(ready, gap), KNOWN.prior(MOST)
    found = likeliest(weigh, GUESS, prior, LATENT, gap)

    def loss(vector: np.ndarray) -> float:
        noise = NoiseModel(np.exp(vector[:2]), vector[2:4], math.exp(vector[4]))
        return weigh(noise).loss + KNOWN.loss(noise)

    start = np.concatenate([np.log(made.answers), np.maximum(made.spread, 1e-3), [0.0]])
    bounds = np.column_stack([prior.lower, prior.upper])
    best = minimize(loss, start, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-12, "eps": 1e-6})
    assert weigh(found).loss + KNOWN.loss(found) < best.fun + 0.1
    np.testing.assert_allclose(found.answers, made.answers, rtol=0.1)
    np.testing.assert_allclose(found.spread, made.spread, rtol=0.3, atol=0.02)


@pytest.mark.parametrize(("away", "cut"), [(0.2, False), (3.0, True)])
def test_parameters_follow_the_noise_as_far_as_one_step_goes(away, cut, rng):
    ready, gap = track(rng, NoiseModel(np.array([0.05, 0.3]), np.array([0.05, 0.1]), 1.0))
    slopes = rng.normal(size=(*ready.seen.shape, 5)) * ready.seen[..., None]
    columns = np.concatenate([ready.columns + away * slopes[..., 1:2], slopes], axis=-1)
    ready, nothing = replace(ready, columns=columns), np.zeros(5)
    calls = []
    anywhere = Prior(nothing, np.full(5, 0.01), np.full(5, -np.inf), np.full(5, np.inf))

    def weigh(noise: NoiseModel) -> Weighed:
        loss, gradient, information = ready.weighed(noise, LATENT, gap)
        step, gained = step_from(gradient, information, anywhere, nothing, 0.0)
        assert is_longest(step) == cut
        calls.append(noise)
        two = np.stack([columns[..., 0], slopes @ step], axis=-1)
        return Weighed(loss - gained, replace(ready, columns=two), at_rest=not cut)

    prior = KNOWN.prior(MOST)
    found = likeliest(weigh, GUESS, prior, LATENT, gap)
    # Each of the five numbers is tried where the parameters cannot go where they would.
    assert (len(calls) > 21) == cut

    def loss(vector: np.ndarray) -> float:
        noise = NoiseModel(np.exp(vector[:2]), vector[2:4], math.exp(vector[4]))
        return weigh(noise).loss + KNOWN.loss(noise)

    start = np.concatenate([np.log(found.answers), np.maximum(found.spread, 1e-3), [math.log(found.length)]])
    bounds = np.column_stack([prior.lower, prior.upper])
    best = minimize(loss, start, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-12, "eps": 1e-6})
    assert weigh(found).loss + KNOWN.loss(found) < best.fun + 0.1


def test_it_stays_within_what_repeats_show(rng):
    ready, gap = track(rng, NoiseModel(np.array([0.3, 0.3]), np.array([0.2, 0.2]), 1.0))
    most = replace(MOST, answers=np.array([0.25, 10.0]), spread=np.array([0.05, 1.0]))
    found = likeliest(weighing(ready, gap), GUESS, KNOWN.prior(most), LATENT, gap)
    assert found.answers[0] == pytest.approx(0.25)
    assert found.spread[0] == pytest.approx(0.05)


@pytest.mark.parametrize("smooth", [0, 1, 2])
def test_noises_side_by_side_tell_what_they_tell_one_by_one(smooth, rng):
    ready, gap = track(rng, NoiseModel(np.array([0.05, 0.3]), np.array([0.05, 0.1]), 1.0), rows=300)
    columns = np.concatenate([ready.columns, 0.1 * rng.normal(size=(300, 2, 1)) * ready.seen[..., None]], axis=-1)
    # A gross error, and a second track.
    columns[40, :, 0] += 3.0 * ready.seen[40]
    gap[150] = np.inf
    ready, noise, steps = replace(ready, columns=columns), replace(GUESS, smooth=smooth), np.full(3, 1e-6)
    others = [
        replace(noise, answers=noise.answers * np.array([1.0 + 1e-6, 1.0])),
        replace(noise, spread=noise.spread + np.array([0.0, 1e-6])),
        replace(noise, length=noise.length * (1.0 + 1e-6)),
    ]

    def look(there: NoiseModel):
        white, log_scale = ready.filter(there, LATENT, gap, derivatives=True)
        residual, taken = white[ready.seen, 0], white[ready.seen, 1]
        gained = huber_weight(residual) * taken * (residual - 0.5 * taken)
        loss = huber_loss(residual) + log_scale[ready.seen] - gained
        return residual - taken, log_scale[ready.seen], loss.sum()

    left, log_scale, loss = look(noise)
    moved, widened, lost = (np.array(each) for each in zip(*map(look, others), strict=True))
    moved, widened = (moved - left) / 1e-6, (widened - log_scale) / 1e-6
    score, information = told_of(ready, [noise, *others], steps, LATENT, gap)
    np.testing.assert_allclose(score, (loss - lost) / 1e-6, rtol=1e-4)
    expected = (moved * huber_weight(left)) @ moved.T + widened @ widened.T
    np.testing.assert_allclose(information, expected, rtol=1e-4)
