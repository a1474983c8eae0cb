"""The augmented simulator in storage: JSON and back, simulation, and hostile documents."""

from __future__ import annotations

import copy
import json
import math
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, Vehicle, Wheel
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.catalogue import SLUGS, forms_by_name
from bevameter.identification.effects.effect import PULL, TORQUE, Effect
from bevameter.identification.effects.ensemble import channels, error_count, errors_of_fit, soils_off
from bevameter.identification.effects.parse import specimen
from bevameter.identification.effects.stored import AugmentedSimulator, StoredEffect
from bevameter.identification.mechanics.augmented import AugmentedWheel
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.simulate import simulate, soil_vector

SITUATION = specimen()
SOIL = Soil(c_Pa=500.0, phi_rad=math.radians(32.0), k_m=0.012, stiffness_Pa=2e5, n=0.9)
FORMS = [effect for slug in SLUGS for effect in forms_by_name(slug, SITUATION)]
SLIPS = np.array([0.1, 0.3, 0.6])


def fitted(*effects: Effect, sd: float = 0.0) -> AugmentedSimulator:
    model = AugmentedWheel(SITUATION.wheel, effects)
    values = [p.low + 0.3 * (p.high - p.low) for effect in effects for p in effect.parameters]
    vector = np.concatenate([soil_vector(SOIL), values])
    return AugmentedSimulator.of(model, vector, np.eye(len(vector)) * sd**2, vehicle="rover")


def physics(slug: str, sd: float = math.nan, **parameters: float) -> AugmentedSimulator:
    soil = {name: Estimate(getattr(SOIL, name), 0.01) for name in PARAMETERS}
    form = parameters.pop("form", "")
    named = {name: Estimate(value, sd) for name, value in parameters.items()}
    return AugmentedSimulator(soil, (StoredEffect(slug, str(form), named),))


@pytest.mark.parametrize("effect", FORMS, ids=lambda effect: effect.name + str(len(effect.parameters)))
def test_every_form_survives_json(effect):
    simulator = fitted(effect, sd=0.01)
    if effect.by_run:
        assert simulator.effects == ()
        return
    text = json.dumps(simulator.to_json(), allow_nan=False)
    again = AugmentedSimulator.from_json(json.loads(text))
    assert again.to_json() == simulator.to_json()
    assert again.vehicle == "rover"
    assert again.effects[0].constants == dict(effect.constants)
    assert again.soil["c_Pa"].value == pytest.approx(500.0)
    assert again.soil["k_m"].sd == pytest.approx(0.012 * 0.01)  # of ln k, taken back to k


def test_units_of_an_explanation_s_soil_are_not_written():
    soil = {name: Estimate(getattr(SOIL, name), 0.01, "SI") for name in PARAMETERS}
    assert AugmentedSimulator.from_json(AugmentedSimulator(soil).to_json()).soil["c_Pa"] == Estimate(500.0, 0.01)


def test_what_was_stored_simulates_as_what_was_fitted():
    (sinkage, *_), (rate, *_) = (forms_by_name(slug, SITUATION) for slug in ("slip_sinkage", "rate_dependence"))
    simulator = AugmentedSimulator.from_json(fitted(sinkage, rate).to_json())
    drive = SITUATION.drive
    columns = {
        "time_s": drive.time_s, "load_N": drive.load_N, "slip": drive.slip,
        "wheel_speed_rad_s": 2.0 * drive.rim_speed_m_s / SITUATION.wheel.radius_m,
    }  # fmt: skip
    table = WheelTable(columns, None, None, Path("drive.csv"))
    vector = np.concatenate([soil_vector(SOIL), [0.9, 0.18]])
    faster = type(drive)(**{**vars(drive), "rim_speed_m_s": 2.0 * drive.rim_speed_m_s})
    imposed = np.column_stack([drive.load_N, drive.slip])
    expected = AugmentedWheel(SITUATION.wheel, (sinkage, rate)).predict(faster, imposed, vector).channels
    answer = simulator.simulate(Vehicle(wheels=(SITUATION.wheel,)), table)
    # The speed that the stiffness refers to is that of the drive it was found on, not of this one.
    np.testing.assert_allclose(answer["torque_Nm"], expected[:, TORQUE], rtol=1e-6)
    effects = ["slip_sinkage:n1=0.9", "rate_dependence:m=0.18"]
    other = simulate(Vehicle(wheels=(SITUATION.wheel,)), SOIL, table, effects)
    assert np.abs(other["sinkage_m"] / answer["sinkage_m"] - 1.0).max() > 0.01


def test_faults_that_were_stored_as_unknown_are_read_by_their_names():
    page = physics("pull_gain", g=0.05).to_json()
    for form, name, parameter in (
        ("gain of drawbar_pull_N", "pull_gain", "g"), ("zero of load_N", "load_offset", "W_0"),
        ("torque_Nm in drawbar_pull_N", "torque_pull_crosstalk", "s"),
    ):  # fmt: skip
        page["effects"][0] |= {"slug": "unknown", "form": form, "parameters": {parameter: {"value": 0.05, "sd": None}}}
        (effect,) = AugmentedSimulator.from_json(page).effects
        assert effect.slug == name
        assert effect.parameters[parameter].value == 0.05
    page["effects"][0]["form"] = "something else"
    with pytest.raises(InputError, match="effect 'unknown'"):
        AugmentedSimulator.from_json(page)


def crossed() -> list:
    """Correlations that contradict each other."""
    answer = np.eye(6)
    answer[:3, :3] = [[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]]
    return answer.tolist()


def test_a_fit_without_correlations_is_written_without_them():
    page = physics("slip_sinkage", form="exponent", n1=0.5).to_json()
    assert page["schema"] == 1
    assert set(page) == {"schema", "soil", "effects"}
    assert AugmentedSimulator.from_json(page).correlation == ()


def broken() -> dict:
    """Faults by name: a change of a valid document, and the message expected."""

    def at(*path, value):
        def spoil(page):
            for key in path[:-1]:
                page = page[key]
            page[path[-1]] = value

        return spoil

    effect = ("effects", 0)
    return {
        "schema": (at("schema", value=4), "schema 4"),
        "schema true": (at("schema", value=True), "schema True"),
        "extra key": (at("code", value="import os"), "code"),
        "no soil": (at("soil", value=None), "an object with"),
        "soil not finite": (at("soil", "c_Pa", "value", value=math.inf), "a number from"),
        "soil not a number": (at("soil", "c_Pa", "value", value="5"), "a number from"),
        "soil no soil": (at("soil", "phi_rad", "value", value=3.0), "phi_rad"),
        "negative sd": (at("soil", "n", "sd", value=-1.0), "sd"),
        "huge": (at("soil", "n", "sd", value=10**400), "sd"),
        "no list": (at("effects", value={}), "no list"),
        "too many": (at("effects", value=[{}] * 1000), "at most"),
        "slug": (at(*effect, "slug", value="gravity"), "gravity"),
        "slug a list": (at(*effect, "slug", value=["exit_angle"]), "one of"),
        "form": (at(*effect, "form", value="x" * 10**5), "a form of the catalogue"),
        "lugs": (at(*effect, "form", value="ripple, " + "9" * 6000 + " lugs"), "a form of the catalogue"),
        "parameter": (at(*effect, "parameters", value={"n2": {"value": 1, "sd": None}}), "n2"),
        "none": (at(*effect, "parameters", value={}), "n1"),
        "out of bounds": (at(*effect, "parameters", "n1", "value", value=99.0), "from 0 to 3"),
        "not finite": (at(*effect, "parameters", "n1", "value", value=math.nan), "n1"),
        "constant": (at(*effect, "constants", value={"v0": 1.0}), "constants"),
        "probability": (at(*effect, "probability", value=1.5), "probability"),
        "no square": (at("correlation", value=[[1.0]]), "6 rows of 6 numbers"),
        "no rows": (at("correlation", value=[1.0] * 6), "6 rows of 6 numbers"),
        "not symmetric": (at("correlation", 0, 1, value=0.5), "symmetric"),
        "negative eigenvalue": (at("correlation", value=crossed()), "negative eigenvalues"),
        "no correlation": (at("correlation", 0, 1, value=math.nan), "correlation"),
        "no vehicle": (at("vehicle", value=3), "vehicle"),
        "long vehicle": (at("vehicle", value="x" * 201), "200 letters"),
        "too long a number": (at("schema", value=10**6000), "too large"),
    }


@pytest.mark.parametrize("fault", broken())
def test_hostile_documents_are_refused_in_one_line(fault):
    page = fitted(forms_by_name("slip_sinkage", SITUATION)[0]).to_json()
    AugmentedSimulator.from_json(copy.deepcopy(page))
    spoil, said = broken()[fault]
    spoil(page)
    with pytest.raises(InputError, match=said) as caught:
        AugmentedSimulator.from_json(page, "db, physics of sand")
    assert str(caught.value).startswith("db, physics of sand")
    assert len(str(caught.value)) < 1000
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("page", [None, [], 3, "{}", {"schema": 1}])
def test_text_that_is_no_document_is_refused(page):
    with pytest.raises(InputError, match="an object with"):
        AugmentedSimulator.from_json(page)


def draws(count: int = 40) -> np.ndarray:
    rng = np.random.default_rng(3)
    usual = np.array([500.0, math.radians(32.0), 0.012, 2e5, 0.9])
    return usual * rng.uniform(0.8, 1.2, (count, 5))


def test_many_soils_without_effects_of_the_ground_are_the_textbooks():
    soils = draws()
    for name in (physics("torque_gain", g=0.3), physics("drivetrain_friction", form="coulomb", T_c=0.5),
                 physics("slope_gravity", s=1.0), physics("rate_dependence", form="stiffness", m=0.3)):  # fmt: skip
        assert error_count(name) == 5
        pulls = channels(SITUATION.wheel, soils, 90.0, SLIPS, name, np.empty((len(soils), 5)))[..., PULL]
        for row, soil in zip(pulls, soils, strict=True):
            state = equilibrium(SITUATION.wheel, Soil(*soil.tolist()), np.full(3, 90.0), SLIPS)
            np.testing.assert_allclose(row, state.drawbar_pull_N, atol=1e-3)


def test_each_soil_and_draw_goes_through_the_effect_of_the_ground():
    soils = draws()
    ground = physics("slip_sinkage", sd=0.1, form="exponent", n1=0.5)
    errors = np.column_stack([np.zeros((len(soils), 5)), np.linspace(-0.2, 0.2, len(soils))])
    pulls = channels(SITUATION.wheel, soils, 90.0, SLIPS, ground, errors)[..., PULL]
    (effect, *_) = forms_by_name("slip_sinkage", SITUATION)
    drive = SITUATION.drive
    rows = type(drive)(**{**{name: values[:3] for name, values in vars(drive).items()},
                          "load_N": np.full(3, 90.0), "slip": SLIPS})  # fmt: skip
    for index in (0, 20, 39):
        vector = np.append(soil_vector(Soil(*soils[index].tolist())), 0.5 + errors[index, 5])
        imposed = np.column_stack([rows.load_N, rows.slip])
        expected = AugmentedWheel(SITUATION.wheel, (effect,)).predict(rows, imposed, vector).channels[:, PULL]
        np.testing.assert_allclose(pulls[index], expected, rtol=1e-3, atol=1e-3)


def test_errors_of_a_fit_follow_its_joint_covariance():
    (lag,), (sinkage, *_) = (forms_by_name(slug, SITUATION)[:1] for slug in ("torque_gain", "slip_sinkage"))
    model = AugmentedWheel(SITUATION.wheel, (lag, sinkage))
    root = np.diag([50.0, 0.02, 0.1, 0.2, 0.05, 0.01, 0.04]) @ np.linalg.cholesky(0.3 * np.eye(7) + 0.7)
    covariance = root @ root.T
    covariance[0, 1] *= 1.0 + 1e-15  # rounding, as of an inverse
    found = AugmentedSimulator.of(model, np.concatenate([soil_vector(SOIL), [0.02, 0.5]]), covariance)
    again = AugmentedSimulator.from_json(json.loads(json.dumps(found.to_json())))
    assert again == found
    normal = np.random.default_rng(5).normal(size=(40_000, error_count(again)))
    errors = errors_of_fit(again, normal)
    kept = [0, 1, 2, 3, 4, 6]  # errors of the instrument are no errors of the ground
    sd = np.sqrt(np.diag(covariance))[kept]
    np.testing.assert_allclose(np.cov(errors.T) / np.outer(sd, sd), np.full((6, 6), 0.7) + 0.3 * np.eye(6), atol=0.02)
    moved = soils_off(np.tile([500.0, SOIL.phi_rad, 0.012, 2e5, 0.9], (len(errors), 1)), errors)
    inside = np.column_stack([moved[:, 0], np.tan(moved[:, 1]), np.log(moved[:, 2:])])
    np.testing.assert_allclose(inside - soil_vector(SOIL), errors[:, :5], atol=1e-9)


def test_a_covariance_that_rounding_spoilt_is_read_back():
    (sinkage, *_) = forms_by_name("slip_sinkage", SITUATION)
    covariance = np.ones((6, 6))
    covariance[0, 1] = covariance[1, 0] = 1.0 - 1e-7  # the other elements are 1
    found = AugmentedSimulator.of(
        AugmentedWheel(SITUATION.wheel, (sinkage,)), np.append(soil_vector(SOIL), 0.5), covariance
    )
    again = AugmentedSimulator.from_json(json.loads(json.dumps(found.to_json())))
    np.testing.assert_allclose(np.array(again.correlation), covariance, atol=1e-6)


def test_errors_without_an_estimate_are_those_of_the_prior():
    ground = physics("slip_sinkage", form="exponent", n1=0.5)
    (effect, *_) = forms_by_name("slip_sinkage", SITUATION)
    errors = errors_of_fit(ground, np.eye(6))
    assert errors[5, 5] == pytest.approx(effect.parameters[0].scale)
    assert errors[0, 0] == pytest.approx(0.01)


def test_lugs_are_those_of_the_wheel_that_is_simulated():
    soils = draws(4)
    ground = physics("grousers", form="radius", s=0.8)
    errors = np.zeros((4, 6))
    smooth = channels(Wheel(radius_m=0.15, width_m=0.12), soils, 90.0, SLIPS, ground, errors)[..., PULL]
    lugged = channels(SITUATION.wheel, soils, 90.0, SLIPS, ground, errors)[..., PULL]
    assert (lugged > smooth).all()


def test_a_ripple_of_other_lugs_than_the_vehicle_s_can_be_simulated():
    """The vehicle's file may state the wrong number of lugs."""
    time_s = np.arange(200) / 20.0
    drive = WheelTable(
        {"time_s": time_s, "load_N": np.full(200, 90.0), "slip": np.full(200, 0.3), "wheel_angle_rad": 2.0 * time_s},
        None, None, Path("drive.csv"),
    )  # fmt: skip
    vehicle = Vehicle(wheels=(SITUATION.wheel.model_copy(update={"grouser_count": 10}),))
    soil = Soil(c_Pa=300.0, phi_rad=0.54, k_m=0.012, stiffness_Pa=9e4, n=0.9)
    found = StoredEffect("grousers", "ripple, 12 lugs", {"a_T": Estimate(0.5, 0.1)}, {})
    rippled = simulate(vehicle, soil, drive, [found.named])
    plain = simulate(vehicle, soil, drive)
    np.testing.assert_allclose(rippled["torque_Nm"] - plain["torque_Nm"], 0.5 * np.cos(24.0 * time_s), atol=1e-3)
