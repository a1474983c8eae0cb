"""The sequential test whether soil leaves its class: its rate of false alarms, and what it notices."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import OnlineIdentifier, Wheel
from bevameter.identification.estimate.departure import DepartureTest
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from scipy.stats import binom

WHEEL = Wheel(radius_m=0.25, width_m=0.2)
NOISE = {"load_N": 7.0, "torque_Nm": 1.2, "sinkage_m": 0.0006, "slip": 0.008, "drawbar_pull_N": 7.0}
MEAN = np.array([1500.0, 0.6, np.log(0.02), np.log(2e5), np.log(0.9)])
SD = np.array([500.0, 0.06, 0.4, 0.5, 0.15])


def departs(vector, rng, freedom, samples, false_alarms) -> int | None:
    """After how many samples a drive on a soil (c, tan phi, ln k, ln stiffness, ln n) is said to leave its class."""
    soil = Soil(max(vector[0], 0.0), np.arctan(max(vector[1], 0.02)), *np.exp(vector[2:]))
    row = np.arange(samples)
    load = 600.0 + 60.0 * np.sin(row / 7.0) + rng.normal(0.0, 20.0, samples)
    slip = np.clip(0.2 + 0.1 * np.sin(row / 11.0), 0.02, 0.8)
    state = equilibrium(WHEEL, soil, load, slip)
    measured = {name: getattr(state, name) + rng.normal(0.0, NOISE[name], samples) for name in NOISE}
    identifier = OnlineIdentifier(WHEEL, NOISE, window=200)
    test = DepartureTest(MEAN, np.diag(SD**2), freedom, false_alarms=false_alarms)
    for number in range(samples):
        if identifier.update(**{name: float(values[number]) for name, values in measured.items()}) is None:
            continue
        if test.update(*identifier.vector()):
            return number
    return None


def alarms(drives, freedom, samples, false_alarms=0.01) -> int:
    """Of drives on new places of the class, how many are said to leave it."""
    count = 0
    for seed in range(drives):
        rng = np.random.default_rng(seed)
        place = MEAN + SD * rng.normal(size=5) * np.sqrt(freedom / rng.chisquare(freedom))
        count += departs(place, rng, freedom, samples, false_alarms) is not None
    return count


def test_places_of_the_class_raise_no_alarm():
    assert alarms(10, 4.0, 50) == 0


@pytest.mark.slow
@pytest.mark.parametrize("freedom", [2.0, 30.0])
def test_the_rate_of_false_alarms_is_what_is_stated(freedom):
    """However often one looks: after each of 60 samples, of 150 places. At 5 %, where more can be counted."""
    assert alarms(150, freedom, 60, 0.05) <= binom.ppf(0.95, 150, 0.05)


@pytest.mark.parametrize(
    "off", [(0.0, -0.4, 0.0, 0.0, 0.0), (8000.0, 0.0, 0.0, 0.0, 0.0), (-800.0, -0.35, 0.0, -1.5, 0.0)]
)
def test_another_soil_is_noticed_with_the_first_estimates(off):
    assert all(departs(MEAN + off, np.random.default_rng(seed), 30.0, 60, 0.01) is not None for seed in range(3))
