"""The frozen generator of concealed physics: its wheel, its determinism, its nulls, its secrecy."""

import csv
import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from frozen_generator.contact import Soil, Wheel, solve, textbook_contact
from frozen_generator.evidence import Observed, cost_of, errors_of, refit
from frozen_generator.generate import make, write
from frozen_generator.plan import CYCLE, LISTED, make_plan
from frozen_generator.scene import draw_scene, predict
from frozen_generator.sensors import LOAD, SLIP, draw_ground, draw_sensors, read_off
from scipy.integrate import quad
from scipy.optimize import brentq

CONTACTS = [
    (Wheel(0.15, 0.12), Soil(800.0, 0.55, 0.012, 3e5, 0.9), 120.0, 0.25),
    (Wheel(0.5, 0.3), Soil(1000.0, 0.52, 0.005, 2e5, 0.7), 1500.0, 0.05),
    (Wheel(0.07, 0.06), Soil(200.0, 0.6, 0.004, 2e5, 1.25), 30.0, 0.7),
]


def by_quadrature(wheel: Wheel, soil: Soil, load: float, slip: float) -> tuple[float, float, float]:
    """Sinkage, torque and drawbar pull straight from Eq. 1-9 of the paper, adaptive quadrature and Brent's root."""
    r, b, k = wheel.radius, wheel.width, soil.shear_modulus

    def stresses(theta: float, first: float) -> tuple[float, float]:
        peak = first / 2
        front = theta if theta > peak else first - theta / peak * (first - peak)
        height = max(np.cos(front) - np.cos(first), 0.0)
        sigma = soil.stiffness * (r / b) ** soil.exponent * height**soil.exponent
        sheared = first - theta - (1 - slip) * (np.sin(first) - np.sin(theta))
        tau = (soil.cohesion + sigma * np.tan(soil.friction_angle)) * (1 - np.exp(-r / k * sheared))
        return sigma, tau

    def integral(weight, first: float) -> float:
        def integrand(theta: float) -> float:
            return weight(theta, *stresses(theta, first))

        halves = ((0.0, first / 2), (first / 2, first))
        return sum(quad(integrand, *half, epsabs=1e-10, epsrel=1e-9, limit=200)[0] for half in halves)

    def carried(first: float) -> float:
        return r * b * integral(lambda t, sigma, tau: sigma * np.cos(t) + tau * np.sin(t), first) - load

    first = brentq(carried, 1e-3, 1.4, xtol=1e-12)
    torque = r**2 * b * integral(lambda t, sigma, tau: tau, first)
    pull = r * b * integral(lambda t, sigma, tau: tau * np.cos(t) - sigma * np.sin(t), first)
    return r * (1 - np.cos(first)), torque, pull


@pytest.mark.parametrize(("wheel", "soil", "load", "slip"), CONTACTS)
def test_contact_agrees_with_adaptive_quadrature(wheel, soil, load, slip):
    sinkage, torque, pull = by_quadrature(wheel, soil, load, slip)
    one = np.ones(1)
    reaction = solve(textbook_contact(wheel, soil, load * one, slip * one), intervals=60)
    assert reaction.sinkage[0] == pytest.approx(sinkage, rel=1e-6)
    assert reaction.torque[0] == pytest.approx(torque, rel=1e-6)
    assert reaction.pull[0] == pytest.approx(pull, abs=1e-6 * load)


def test_same_seed_gives_the_same_recording():
    first, second = make(14), make(14)
    assert first.truth == second.truth
    for name, values in first.columns.items():
        np.testing.assert_array_equal(values, second.columns[name])


def null_fit(seed: int, protocol: str) -> tuple[int, float, float]:
    """Number of readings of a textbook wheel; half their chi squared, whitened, at the truth and after a refit."""
    rng = np.random.default_rng(seed)
    scene = draw_scene(rng, protocol, lugs=False, laps=False, has_pull=True)
    sensors, ground = draw_sensors(rng, scene), draw_ground(rng, scene.drive)
    sensors = replace(sensors, memory=0.0, grain={})
    reaction = predict(scene.wheel, scene.soil, scene.drive, (), ground)
    columns = read_off(rng, scene, scene.drive, reaction, sensors)
    rows = np.arange(scene.drive.rows)[:: max(1, scene.drive.rows // 250)]
    seen = scene.drive.take(rows)
    faultless_inputs = replace(sensors, sd={**sensors.sd, LOAD: 0.0, SLIP: 0.0})
    errors = errors_of(scene, scene.drive, (), faultless_inputs, ground, rows)
    measured = {name: columns[name][rows] for name in scene.answered}
    factor = errors.factor(seen, ground.length, 1.0)
    observed = Observed(seen, np.arange(len(rows)), measured, errors.sd(), {}, factor)
    truth = cost_of(scene, observed, scene.soil, ())
    return 3 * len(rows), truth, refit(scene, observed, scene.soil, precision=1e-5).cost


@pytest.mark.parametrize(("seed", "protocol"), [(1, "bench"), (2, "table"), (3, "field"), (4, "passes"), (5, "speed")])
def test_nulls_fit_the_textbook_within_noise(seed, protocol):
    values, truth, fitted = null_fit(seed, protocol)
    assert abs(2.0 * fitted / (values - 5) - 1.0) < 5.0 * np.sqrt(2.0 / values)
    assert -0.1 <= truth - fitted < 13.0  # five free parameters gain 2.5 nats of noise, hardly ever more than 13


def test_a_null_says_so():
    truth = make(2).truth
    assert (truth["level"], truth["effects"], truth["nats"]) == ("null", [], 0.0)


def test_truth_is_never_in_the_folder(tmp_path):
    folder, truths = tmp_path / "r13", tmp_path / "truths"
    write(13, folder, truths)
    assert {path.name for path in folder.iterdir()} <= {"wheel.csv", "vehicle.toml", "recording.toml", "soil.toml"}
    truth = json.loads((truths / "r13.json").read_text())
    text = "".join(path.read_text() for path in folder.iterdir())
    for word in ("seed", "effect", "truth", "nats", *(effect["effect"] for effect in truth["effects"])):
        assert word not in text
    assert tomllib.loads((folder / "recording.toml").read_text())["streams"] == ["wheel"]
    recording = make(13)
    rows = list(csv.DictReader((folder / "wheel.csv").open()))
    read = [float(row["torque_Nm"] or "nan") for row in rows]
    np.testing.assert_allclose(read, recording.columns["torque_Nm"], rtol=1e-5)


def test_every_effect_comes_up_evenly():
    plans = [make_plan(seed, 0) for seed in range(23 * CYCLE)]
    singles = [plan.effects[0] for plan in plans if len(plan.effects) == 1 and plan.effects[0] in LISTED]
    assert {singles.count(kind) for kind in LISTED} == {9}
