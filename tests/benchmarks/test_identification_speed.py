"""Speed of the wheel-soil mechanics and of the estimators, against quadrature and root finding by scipy.

python -m pytest tests/benchmarks/test_identification_speed.py --benchmark-only
"""

from __future__ import annotations

import time
from itertools import islice

import numpy as np
import pytest
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.estimate.online import OnlineIdentifier
from bevameter.identification.mechanics.linearised import OnlineEstimator
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import CHANNELS, equilibrium, normal_stress, shear_stress
from scipy.integrate import quad
from scipy.optimize import brentq

WHEEL = Wheel(radius_m=0.25, width_m=0.2)
SOIL = Soil(c_Pa=1e3, phi_rad=np.radians(30.0), k_m=0.02, stiffness_Pa=2e5, n=0.9)
LOADS = np.linspace(300.0, 2500.0, 1000)
SLIPS = np.linspace(0.05, 0.9, 1000)


def by_quadrature_and_root_finding(loads: np.ndarray, slips: np.ndarray) -> np.ndarray:
    """Entry angles by `scipy.integrate.quad` in `scipy.optimize.brentq`: the straightforward way."""

    def carried(theta_1: float, slip: float) -> float:
        def integrand(theta: float) -> float:
            sigma = float(normal_stress(theta, theta_1, SOIL, WHEEL))
            tau = float(shear_stress(theta, theta_1, slip, SOIL, WHEEL))
            return sigma * np.cos(theta) + tau * np.sin(theta)

        parts = ((0.0, theta_1 / 2.0), (theta_1 / 2.0, theta_1))
        return WHEEL.radius_m * WHEEL.width_m * sum(quad(integrand, *part, epsrel=1e-10)[0] for part in parts)

    return np.array(
        [
            brentq(lambda angle, i=slip, w=load: carried(angle, i) - w, 0.01, 1.5, xtol=1e-12)
            for load, slip in zip(loads, slips, strict=True)
        ]
    )


@pytest.mark.benchmark(group="equilibrium, per 1000 samples")
def test_equilibrium(benchmark):
    """Wheel in equilibrium, 1,000 samples."""
    equilibrium(WHEEL, SOIL, LOADS[:2], SLIPS[:2])
    state = benchmark(equilibrium, WHEEL, SOIL, LOADS, SLIPS)
    few = [0, 500, 999]
    np.testing.assert_allclose(
        state.theta_1_rad[few], by_quadrature_and_root_finding(LOADS[few], SLIPS[few]), rtol=1e-8
    )


@pytest.mark.benchmark(group="equilibrium, 100000 samples", timer=time.process_time)
def test_equilibrium_of_a_hundred_thousand_samples_takes_17_us_each_at_most(benchmark):
    """Wheel in equilibrium, 100,000 samples, processor time of all threads."""
    loads, slips = np.linspace(300.0, 2500.0, 100_000), np.random.default_rng(0).uniform(0.05, 0.9, 100_000)
    equilibrium(WHEEL, SOIL, LOADS[:2], SLIPS[:2])
    state = benchmark.pedantic(equilibrium, args=(WHEEL, SOIL, loads, slips), rounds=3)
    assert np.isfinite(state.theta_1_rad).all()
    if benchmark.enabled:  # tests in parallel would distort the time
        each = benchmark.stats.stats.min / len(loads)
        benchmark.extra_info["us a sample"] = 1e6 * each
        assert each <= 17e-6


@pytest.mark.benchmark(group="equilibrium, per 1000 samples")
def test_quadrature_and_root_finding_of_three_samples(benchmark):
    """Three samples by `scipy.integrate.quad` and `brentq`: multiply by 333 to compare."""
    benchmark.pedantic(by_quadrature_and_root_finding, args=(LOADS[::400], SLIPS[::400]), rounds=3)
    benchmark.extra_info["samples"] = 3


@pytest.mark.benchmark(group="equilibrium, per 1000 samples")
def test_a_thousand_times_the_throughput_of_quadrature_and_root_finding(benchmark):
    """Wheel in equilibrium, 1,000 samples, against quadrature and root finding."""
    few = slice(0, 1000, 200)
    began = time.perf_counter()
    by_quadrature_and_root_finding(LOADS[few], SLIPS[few])
    slow = (time.perf_counter() - began) / len(LOADS[few])
    equilibrium(WHEEL, SOIL, LOADS[:2], SLIPS[:2])
    benchmark(equilibrium, WHEEL, SOIL, LOADS, SLIPS)
    if benchmark.enabled:  # tests in parallel would distort the time
        ratio = slow / (benchmark.stats.stats.median / len(LOADS))
        benchmark.extra_info["times_faster"] = ratio
        assert ratio >= 1000.0


def drive(samples: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    time_s = np.arange(samples) / 10.0
    load, slip = 1200.0 + 500.0 * np.sin(time_s / 2.0), 0.3 + 0.2 * np.sin(time_s / 1.3)
    state = equilibrium(WHEEL, SOIL, load, slip)
    truth = np.column_stack([load, state.torque_Nm, state.sinkage_m, slip, state.drawbar_pull_N])
    noise = 0.03 * np.abs(truth).max(axis=0)
    return truth + noise * rng.normal(size=truth.shape), noise


@pytest.mark.benchmark(group="one sample while driving")
def test_linear_update(benchmark):
    """One update of the closed form."""
    rows, _ = drive(10)
    estimator = OnlineEstimator(WHEEL, 0.02, window=300)
    for row in rows:
        estimator.update(*row[:4])
    benchmark(estimator.update, *rows[0][:4])


@pytest.mark.slow
@pytest.mark.benchmark(group="one sample while driving")
def test_maximum_likelihood_update_with_600_samples_in_the_window(benchmark):
    """One update of the on-line estimator, 600 samples in its window."""
    window = 600
    rows, noise = drive(window + 40)
    identifier = OnlineIdentifier(WHEEL, dict(zip(CHANNELS, noise, strict=True)), window=window)
    samples = iter([dict(zip(CHANNELS, row, strict=True)) for row in rows])
    for sample in islice(samples, window + 10):
        identifier.update(**sample)
    benchmark.pedantic(lambda: identifier.update(**next(samples)), rounds=25)
    estimate = identifier.estimate()
    assert estimate is not None
    assert estimate.n == window
