"""Soil from sensors whose noise is autocorrelated: rows that repeat each other are no change of soil."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from bevameter import Recording, Vehicle, Wheel, WheelTable, identify
from bevameter.framework.core.findings import codes
from bevameter.identification.estimate.autocorrelation import are_correlated, rows_in_noise
from bevameter.identification.estimate.identify import Segment
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from scipy.signal import butter, lfilter

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
SAND = Soil(1e3, np.radians(30.0), 0.015, 3e5, 0.9)
CLAY = Soil(4e3, np.radians(18.0), 0.008, 1.5e5, 0.75)
NOISE = {"load_N": 2.4, "torque_Nm": 0.18, "sinkage_m": 2.5e-4, "slip": 0.01, "drawbar_pull_N": 0.6}


def autoregressive(rho: float):
    """First-order autoregressive noise (n,) of unit variance."""
    return lambda n, rng: lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], rng.normal(size=n + 100))[100:]


def low_passed(n: int, rng: np.random.Generator) -> np.ndarray:
    """White noise (n,) at 50 Hz, low-passed at 2 Hz, of unit variance."""
    numerator, denominator = butter(2, 2.0 / 25.0)
    values = lfilter(numerator, denominator, rng.normal(size=n + 500))[500:]
    return values / 0.293  # Standard deviation of what the filter lets through.


def driven(seed: int, noise, soils=(SAND,), n: int = 300, step_s: float = 0.1) -> list[Segment]:
    """Segments identified in a drive over soils of equal length, with sensors of unstated noise."""
    rng = np.random.default_rng(seed)
    phase = 2.0 * np.pi * np.arange(n) / n
    load = 120.0 * (1.0 + 0.3 * np.sin(3.1 * phase + 0.3))
    slip = 0.325 + 0.275 * np.sin(2.0 * phase + 1.0)
    true = {"load_N": load, "slip": slip}
    states = [equilibrium(WHEEL, soil, load, slip) for soil in soils]
    for name in ("torque_Nm", "sinkage_m", "drawbar_pull_N"):
        by_soil = np.array([getattr(state, name) for state in states])
        true[name] = by_soil[np.arange(n) * len(soils) // n, np.arange(n)]
    columns = {name: values + NOISE[name] * noise(n, rng) for name, values in true.items()}
    table = WheelTable({"time_s": step_s * np.arange(n), **columns}, None, None, Path("wheel.csv"))
    found = identify(Recording("test", Path("wheel.csv"), Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=table))
    return [segment for segment in found.segments if segment.used]


def held(segment: Segment, soil: Soil) -> list[bool]:
    assert segment.estimate is not None
    quantities = segment.estimate.parameters
    return [
        quantities[each.name].low <= getattr(soil, each.name) <= quantities[each.name].high for each in fields(soil)
    ]


def test_one_soil_is_one_segment_and_its_intervals_hold():
    """First-order noise of 0.7; four of five intervals at least."""
    (segment,) = driven(0, autoregressive(0.7))
    assert np.mean(held(segment, SAND)) >= 0.8
    assert "autocorrelated_noise" in codes(segment.estimate.findings)


@pytest.mark.slow
def test_low_passed_sensors_cause_no_change_of_soil():
    (segment,) = driven(1, low_passed, n=600, step_s=0.02)
    assert all(held(segment, SAND)[:2])
    assert "autocorrelated_noise" in codes(segment.estimate.findings)
    assert segment.estimate.misfit < 1.5


@pytest.mark.slow
def test_a_change_of_soil_is_found_under_autocorrelated_noise():
    first, second = driven(1, autoregressive(0.8), (SAND, CLAY))
    assert second.start_s == pytest.approx(15.0, abs=0.3)
    assert all(held(first, SAND)[:2] + held(second, CLAY)[:2])


@pytest.mark.slow
def test_no_segment_is_shorter_than_the_gate_uses():
    """At 50 Hz the 30 rows required are 0.6 s, yet soils that change every second are not separated."""
    segments = driven(1, lambda n, rng: rng.normal(size=n), (SAND, CLAY) * 8, n=800, step_s=0.02)
    assert min(segment.end_s - segment.start_s for segment in segments) >= 5.0


def test_a_misfit_that_follows_what_is_driven_is_no_autocorrelated_noise(rng):
    slip = np.sin(np.arange(400) / 12.0)
    misfit = (slip**2 - 0.5)[:, None] + 0.1 * rng.normal(size=(400, 1))
    assert are_correlated(misfit).all()
    assert rows_in_noise(misfit, 50.0 * slip[:, None]) == 1.0


@pytest.mark.parametrize(("rho", "rows"), [(0.0, 1.0), (0.6, 4.0), (0.8, 9.0)])
def test_the_number_of_rows_per_independent_row_is_found(rho, rows):
    rng = np.random.default_rng(3)
    found = [
        rows_in_noise(autoregressive(rho)(2000, rng)[:, None], np.sin(np.arange(2000) / 50.0)[:, None])
        for _ in range(9)
    ]
    assert np.median(found) == pytest.approx(rows, rel=0.25)
