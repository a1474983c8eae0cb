"""Forms with a parameter more, tried where the usual form is found, and what follows from a drive's columns."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import Vehicle, Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.effects.drive import PresentDrive, drive_of
from bevameter.identification.effects.named import NamedEffect
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import Trial, situation, textbook_trial, try_adding
from bevameter.identification.simulate import simulate

WHEEL = Wheel(radius_m=0.2, width_m=0.15)
SOIL = Soil(1000.0, 0.52, 0.015, 3e5, 1.0)
VEHICLE = Vehicle(name="made", wheels=(WHEEL,))
ROWS = 240


def found(effect: NamedEffect, form: str, least_slip: float = 0.02, soil: Soil = SOIL) -> Trial:
    """Fit of one form to a noisy drive with an effect."""
    rng = np.random.default_rng(5)
    time_s = np.arange(ROWS) / 10.0
    columns = {
        "time_s": time_s,
        "load_N": 300.0 + 100.0 * np.sin(0.9 * time_s),
        "slip": least_slip + 0.28 + 0.28 * np.sin(0.37 * time_s),
        "wheel_speed_rad_s": 1.0 + 0.9 * np.sin(0.61 * time_s),
    }
    bare = WheelTable(columns, None, None, "made")
    made = simulate(VEHICLE, soil, bare, [effect])
    noise = {"load_N": 2.0, "slip": 0.002, "torque_Nm": 0.15, "sinkage_m": 1e-4, "drawbar_pull_N": 1.0}
    noisy = {name: made[name] + sd * rng.normal(size=ROWS) for name, sd in noise.items()}
    table = WheelTable({**columns, **noisy}, None, None, "made")
    problem, textbook = textbook_trial(gather(table, WHEEL, VEHICLE))
    forms = effects_for(situation(problem, textbook.fitted), [effect.slug])
    return try_adding(problem, textbook, textbook, next(each for each in forms if each.form == form))


COURSE = {"d1": "0.4", "d2": "-0.5", "d3": "0.3"}
PARTS = {"T_c": "0.5", "b_v": "1", "mu": "0.008"}
STRIBECK = {"T_c": "1", "T_s": "2.5", "omega_s": "0.4"}


@pytest.mark.parametrize(
    ("slug", "settings", "form", "freer"),
    [
        ("slip_sinkage", {"n1": "0.1", "n2": "0.5"}, "exponent", "exponent, squared"),
        ("slip_sinkage", {"n1": "0.3"}, "exponent", "exponent"),
        ("slip_sinkage", {"p": "0.1", "h": "0.3"}, "transport", "transport, and dig-out"),
        ("slip_sinkage", {"p": "0.4"}, "transport", "transport"),
        ("exit_angle", {"c2": "0.4", "b1": "-0.4"}, "peak kept", "peak kept, by slip"),
        ("exit_angle", {"s": "0.3"}, "peak midway", "peak midway"),
        ("drift", {"g1": "0.05", "g2": "-0.05", "g3": "0.02"}, "torque_Nm, gain", "torque_Nm, gain, curved"),
        ("drift", {"g1": "0.05"}, "torque_Nm, gain", "torque_Nm, gain"),
        ("drift", COURSE, "torque_Nm, bent", "torque_Nm, bent"),
        ("drift", {**COURSE, "d4": "0.3"}, "torque_Nm, bent", "torque_Nm, bent 3 times"),
        ("drift", {**COURSE, "d4": "0", "d5": "0", "d6": "0.2"}, "torque_Nm, bent", "torque_Nm, curved"),
        ("drivetrain_friction", {**STRIBECK, "b_v": "1.2"}, "stribeck", "stribeck+viscous"),
        ("drivetrain_friction", STRIBECK, "stribeck", "stribeck"),
        ("drivetrain_friction", PARTS, "coulomb+viscous", "coulomb+viscous+load"),
        ("drivetrain_friction", {"T_c": "1", "b_v": "1"}, "coulomb+viscous", "coulomb+viscous"),
        ("side_wall_friction", {"tau_s": "1000", "g_s": "3e5"}, "rubbing", "rubbing, with depth"),
        ("side_wall_friction", {"tau_s": "8000"}, "rubbing", "rubbing"),
    ],
)  # fmt: skip
def test_a_further_parameter_is_fitted_where_it_is_worth_it(slug, settings, form, freer):
    trial = found(NamedEffect(slug, settings, freer), form)
    (effect,) = trial.effects
    assert effect.form == freer
    sd = np.sqrt(np.diag(trial.fitted.covariance))
    ((_, where),) = trial.fitted.model.slices()
    truth = [float(settings[parameter.name]) for parameter in effect.parameters]
    # Friction that goes with nothing is part of the soil's, within a few of its standard deviations.
    assert np.all(np.abs(trial.fitted.vector[where] - truth) < 4.0 * sd[where])


@pytest.mark.parametrize(("made", "other"), [("", "sech"), ("sech", "")])
def test_a_hump_is_told_by_its_law(made, other):
    settings = {"K_r": "0.6"} if not made else {"h": "1.2"}
    soil = Soil(1000.0, 0.52, 0.006, 3e5, 1.0)
    right, wrong = (found(NamedEffect("shear_hump", settings, made), form, soil=soil) for form in (made, other))
    assert right.gain > max(wrong.gain, 0.0) + 12.0
    ((_, where),) = right.fitted.model.slices()
    sd = np.sqrt(np.diag(right.fitted.covariance))[where]
    assert abs(right.fitted.vector[where][0] - float(next(iter(settings.values())))) < 4.0 * sd[0]


@pytest.mark.parametrize(
    ("effect", "stress_Pa"),
    [
        (NamedEffect("side_wall_friction", {"tau_s": "28e3"}, "rubbing"), 28e3),
        (NamedEffect("rim_adhesion", {"c_a": "9e3", "tan_delta": "0.1"}, "strength"), 9e3),
    ],
)
def test_flanks_and_rims_may_hold_as_much_as_the_clay_they_are_in(effect, stress_Pa):
    trial = found(effect, effect.form, soil=Soil(12.7e3, 0.24, 0.004, 3.8e5, 0.67))
    ((_, where),) = trial.fitted.model.slices()
    sd = np.sqrt(np.diag(trial.fitted.covariance))[where]
    assert abs(trial.fitted.vector[where][0] - stress_Pa) < 2.0 * sd[0] < 0.3 * stress_Pa


@pytest.mark.parametrize(
    ("made", "least_slip", "form"),
    [
        ("ratio, driven", -0.25, "ratio, driven"),
        ("ratio", -0.25, "ratio"),
        # Where nothing brakes both say the same.
        ("ratio, driven", 0.02, "ratio"),
    ],
)
def test_braked_wheels_carry_soil_away_where_the_data_say_so(made, least_slip, form):
    trial = found(NamedEffect("slip_sinkage", {"p": "0.4"}, made), "ratio", least_slip)
    (effect,) = trial.effects
    assert effect.form == form
    ((_, where),) = trial.fitted.model.slices()
    sd = np.sqrt(np.diag(trial.fitted.covariance))[where]
    assert abs(trial.fitted.vector[where][0] - 0.4) < 4.0 * sd[0] < 0.4


@pytest.mark.parametrize(
    ("form", "settings"), [("ratio", {"p": "0.7"}), ("dig-out", {"h": "0.5"}), ("transport", {"p": "0.7"})]
)
def test_a_form_of_driven_wheels_leaves_braked_ones_as_they_are(form, settings):
    columns = {
        "time_s": np.arange(2.0), "load_N": np.full(2, 300.0), "slip": np.array([-0.3, 0.3]),
        "wheel_speed_rad_s": np.ones(2),
    }  # fmt: skip
    bare = WheelTable(columns, None, None, "made")
    plain, both, driven = (
        simulate(VEHICLE, SOIL, bare, effects)["sinkage_m"]
        for effects in (
            [],
            [NamedEffect("slip_sinkage", settings, form)],
            [NamedEffect("slip_sinkage", settings, f"{form}, driven")],
        )
    )
    np.testing.assert_allclose(driven, [plain[0], both[1]], rtol=1e-5)
    assert np.all(both > 1.05 * plain)


def test_of_slip_and_the_two_speeds_the_third_follows():
    slip = np.array([0.2, 0.0, -0.5, 1.0, np.nan])
    rate = np.array([2.0, 1.0, 1.0, 1.0, 1.0])
    travel = np.array([0.32, 0.2, 0.4, 0.0, np.nan])
    bare = {"load_N": np.full(5, 100.0), "slip": slip, "time_s": np.arange(5.0)}

    def drive(**speeds: np.ndarray) -> PresentDrive:
        return drive_of(WheelTable({**bare, **speeds}, None, None, "made"), WHEEL, np.zeros(5, dtype=int), PresentDrive)

    np.testing.assert_allclose(drive(wheel_speed_rad_s=rate).travel_speed_m_s, travel)
    derived = drive(travel_speed_m_s=travel).rim_speed_m_s
    np.testing.assert_allclose(derived, np.where(travel > 0.0, 0.2 * rate, np.nan))
    # What was measured stays as it is.
    both = drive(wheel_speed_rad_s=rate, travel_speed_m_s=2.0 * travel)
    np.testing.assert_array_equal(both.travel_speed_m_s, 2.0 * travel)
    assert not drive().has("travel_speed_m_s")
    assert not drive().has("rim_speed_m_s")
