"""Flanks that rub: each form has the sign and the limits that statics and the wheel's motion give it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter.identification.effects.effect import LOAD, PULL, SINKAGE, SLIP, TORQUE, Contact
from bevameter.identification.mechanics.textbook import contact_array
from effects_tried import DRIVE, FORMS, SITUATION, SOIL, WHEEL, change, predict, textbook, untouched


def test_flanks_rub_by_cohesion_and_by_depth_at_once():
    both = change("side_wall_friction:form=stress and depth,tau_s=800,g_s=4e4")
    each = change("side_wall_friction:form=stress,tau_s=800"), change("side_wall_friction:form=depth,g_s=4e4")
    np.testing.assert_allclose(both, each[0] + each[1], rtol=1e-9)
    np.testing.assert_array_equal(both, change("side_wall_friction:tau_s=800,g_s=4e4"))


def test_flanks_that_rub_along_their_motion_rub_harder_with_depth():
    alike = change("side_wall_friction:form=rubbing,tau_s=800")[:, TORQUE]
    by_depth = change("side_wall_friction:form=rubbing, with depth,tau_s=0,g_s=4e4")[:, TORQUE]
    both = change("side_wall_friction:form=rubbing, with depth,tau_s=800,g_s=4e4")[:, TORQUE]
    np.testing.assert_allclose(both, alike + by_depth, rtol=1e-9)
    # Where the wheel spins all points of a flank move alike: by the mean depth of a segment of a circle, 0.4 z.
    spins = DRIVE.slip > 0.3
    mean_depth = (by_depth / alike)[spins] * 800.0 / 4e4
    np.testing.assert_allclose(mean_depth, 0.4 * textbook()[spins, SINKAGE], rtol=0.1)


@pytest.mark.parametrize("named", ["side_wall_friction:form=stress,tau_s=800", "side_wall_friction:g_s=4e4"])
def test_flanks_cost_torque_and_pull_in_a_fixed_ratio(named):
    away = change(named)
    assert untouched(away, LOAD, SINKAGE, SLIP)
    assert (away[:, TORQUE] > 0.0).all()
    np.testing.assert_allclose(away[:, TORQUE], -away[:, PULL] * WHEEL.radius_m, rtol=1e-6)


def test_rubbing_flanks_hold_back_or_push_as_their_points_move():
    named = "side_wall_friction:form=rubbing,tau_s=800"
    rolling = replace(SITUATION, drive=replace(DRIVE, slip=np.full(len(DRIVE), 1e-3)))
    spinning = replace(SITUATION, drive=replace(DRIVE, slip=np.full(len(DRIVE), 0.95)))
    assert untouched(change(named), LOAD, SINKAGE, SLIP)
    for situation, sense in ((rolling, -1.0), (spinning, 1.0)):
        away = predict(named, situation) - predict("side_wall_friction:form=rubbing,tau_s=0", situation)
        assert (sense * away[:, PULL] > 0.0).all()  # a spinning wheel's flanks sweep backwards, and thrust
        assert (sense * away[:, TORQUE] > 0.0).all()  # a rolling one's are dragged forwards, and help to turn it


def test_flanks_that_move_down_carry_load_and_the_wheel_sinks_less():
    bare, rubbing, carrying = (
        predict(f"side_wall_friction:form={form},tau_s={stress}")
        for form, stress in (("rubbing", 0), ("rubbing", 3e3), ("rubbing, carrying", 3e3))
    )
    assert untouched(rubbing - bare, SINKAGE)
    assert (carrying[:, SINKAGE] < bare[:, SINKAGE]).all()
    # A wheel that spins in place has no point that moves up ahead of it: half a disc carries tau r^2 on its way down.
    half = Contact(contact_array(0.5 * np.pi, np.zeros(1), SOIL, WHEEL), WHEEL)
    half.advance_m = 0.0
    effect = next(each for each in FORMS if each.form == "rubbing, carrying")
    effect.contact(half, DRIVE, np.array([1e3]))
    quarter = 2.0 * 1e3 * WHEEL.radius_m**2 / 2.0  # both flanks, of the integral of sin(theta) rho over a quarter disc
    np.testing.assert_allclose(half.lift_N, quarter, rtol=2e-3)
