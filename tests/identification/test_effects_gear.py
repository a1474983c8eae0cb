"""Effects of running gear, vehicle and instruments: each has the sign and the limits that its source says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from bevameter.identification.effects.catalogue import SLUGS, effects_for, forms_by_name
from bevameter.identification.effects.catalogue.drift import ChannelDrift, curves_predicted
from bevameter.identification.effects.catalogue.grousers import LugRipple, lug_counts
from bevameter.identification.effects.catalogue.time_lag import TimeLag
from bevameter.identification.effects.catalogue.zeros_by_run import ZerosByRun
from bevameter.identification.effects.drive import select_rows
from bevameter.identification.effects.effect import LOAD, PULL, SINKAGE, SLIP, TORQUE, Contact, Drive, Effect
from bevameter.identification.effects.parse import (
    choose,
    lugs_of,
    parse_effect,
    specimen,
)
from bevameter.identification.mechanics.textbook import contact_array, equilibrium
from effects_tried import DRIVE, IMPOSED, SITUATION, SOIL, WHEEL, change, predict, textbook, untouched


def test_lugs_shear_farther_out_and_ripple_once_a_lug():
    away = change("grousers:s=0.8")
    assert (away[:, TORQUE] > 0.0).all()
    assert (away[:, PULL] > 0.0).all()
    # What shears farther out with the slip that was reported shears sooner, as with a smaller k, on a longer lever.
    ratio = 1.0 + 0.8 * WHEEL.grouser_height_m / WHEEL.radius_m
    hard = replace(SOIL, stiffness_Pa=1e9)
    there = predict("grousers:form=radius with its slip,s=0.8", soil=hard)
    sooner = predict("grousers:s=0", soil=replace(hard, k_m=SOIL.k_m / ratio))
    np.testing.assert_allclose(there[:, TORQUE], ratio**2 * sooner[:, TORQUE], rtol=0.02)
    ripple = change("grousers:a_T=0.5,b_T=0.2")
    assert untouched(ripple, LOAD, SINKAGE, SLIP, PULL)
    phase = WHEEL.grouser_count * DRIVE.wheel_angle_rad
    np.testing.assert_allclose(ripple[:, TORQUE], 0.5 * np.cos(phase) + 0.2 * np.sin(phase), atol=1e-9)


def test_lugs_may_drag_soil_along_without_a_longer_lever():
    tips, radius = (predict(f"grousers:form={form},s=1") for form in ("displacement of the tips", "radius"))
    longer = 1.0 + WHEEL.grouser_height_m / WHEEL.radius_m
    np.testing.assert_allclose(radius[:, TORQUE], longer * tips[:, TORQUE], rtol=1e-9)
    np.testing.assert_allclose(radius[:, [SINKAGE, PULL]], tips[:, [SINKAGE, PULL]], rtol=1e-9)
    assert (change("grousers:form=displacement of the tips,s=1")[:, [TORQUE, PULL]] > 0.0).all()


def test_lugs_may_ripple_evenly_in_addition_to_their_radius():
    lugs, ripple = "radius and even ripple, 18 lugs", "a_T=0.5,b_DP=2,a_z=1e-4"
    away = change(f"grousers:form={lugs},s=0.7,{ripple}") - change("grousers:s=0.7")
    phase = WHEEL.grouser_count * DRIVE.wheel_angle_rad
    np.testing.assert_allclose(away[:, TORQUE], 0.5 * np.cos(phase), atol=1e-9)
    np.testing.assert_allclose(away[:, PULL], 2.0 * np.sin(phase), atol=1e-9)
    np.testing.assert_allclose(away[:, SINKAGE], 1e-4 * np.cos(phase), atol=1e-12)


def test_the_faces_of_lugs_push_with_what_the_soil_resists_passively():
    away = change("grousers:form=thrust of the lugs,s=1")
    assert untouched(away, LOAD, SINKAGE, SLIP)
    slipping = DRIVE.slip > 0.05
    assert (away[slipping][:, [TORQUE, PULL]] > 0.0).all()
    theta_1 = np.arccos(1.0 - textbook()[:, SINKAGE] / WHEEL.radius_m)
    # A thrust at half the lugs' height, whose share along the track is that of the arc's chord.
    arm = (WHEEL.radius_m + 0.5 * WHEEL.grouser_height_m) * theta_1 / np.sin(theta_1)
    np.testing.assert_allclose(away[:, TORQUE], arm * away[:, PULL], rtol=1e-3, atol=1e-6)
    # Without mobilisation left to go, a lug of a wheel on clay pushes with 2 c a unit of its face, and its surcharge.
    clay = replace(SOIL, phi_rad=0.0, c_Pa=2e4, k_m=1e-5)
    bare, lugged = (predict(f"grousers:form=thrust of the lugs,s={share}", soil=clay) for share in (0, 1))
    theta_1 = np.arccos(1.0 - bare[:, SINKAGE] / WHEEL.radius_m)
    stress = 4e4 + DRIVE.load_N / (WHEEL.width_m * WHEEL.radius_m * np.sin(theta_1))
    force = WHEEL.grouser_count * WHEEL.width_m * WHEEL.grouser_height_m * stress * np.sin(theta_1) / (2.0 * np.pi)
    np.testing.assert_allclose((lugged - bare)[slipping, PULL], force[slipping], rtol=1e-3)


def test_the_sides_of_the_block_between_lugs_shear_too():
    """Bekker's thrust of a track's spuds: its factors on cohesion and on friction, of the contact's length and load."""
    effect = "grousers:form=sides of the lugs,s="
    height, width = WHEEL.grouser_height_m, WHEEL.width_m
    for soil in (replace(SOIL, phi_rad=0.0, c_Pa=2e4, k_m=1e-6), replace(SOIL, c_Pa=0.0, k_m=1e-6)):
        bare, lugged = (predict(f"{effect}{share}", soil=soil) for share in (0, 1))
        slipping = DRIVE.slip > 0.05
        theta_1 = np.arccos(1.0 - bare[slipping, SINKAGE] / WHEEL.radius_m)
        length, away = WHEEL.radius_m * theta_1, (lugged - bare)[slipping]
        flat = width * length * soil.c_Pa + DRIVE.load_N[slipping] * np.tan(soil.phi_rad)
        acot = np.arctan2(width, height)
        factor = 1.0 + (2.0 * height / width if soil.c_Pa else 0.64 * height / width * acot)
        np.testing.assert_allclose(away[:, PULL], (factor - 1.0) * flat * np.sin(theta_1) / theta_1, rtol=1e-3)
        np.testing.assert_allclose(away[:, TORQUE], (factor - 1.0) * flat * (WHEEL.radius_m + height), rtol=1e-3)


def test_lugs_that_the_vehicle_states_are_likely_before_anything_is_measured():
    stated, unstated = SITUATION, replace(SITUATION, wheel=WHEEL.model_copy(update={"grouser_count": 0}))
    assert {form.prior_probability for form in forms_by_name("grousers", stated)} == {0.5}
    typical = np.ones(5)
    for count, prior in ((WHEEL.grouser_count, 0.5), (2 * WHEEL.grouser_count, 0.5), (7, None)):
        assert LugRipple(count, typical, WHEEL).prior_probability == prior
    ripple = LugRipple(7, typical, unstated.wheel)
    assert ripple.prior_probability is None
    assert "count the wheel's lugs" in ripple.check
    others = [form for slug in SLUGS if slug != "grousers" for form in forms_by_name(slug, SITUATION)]
    assert {form.prior_probability for form in others} == {None}


def test_lugs_of_unstated_height_are_a_tenth_of_the_radius_high():
    unstated, stated = (
        replace(SITUATION, wheel=WHEEL.model_copy(update={"grouser_height_m": share * WHEEL.radius_m}))
        for share in (0.0, 0.1)
    )
    named = "grousers:s=0.5,form=radius and ripple,a_T=0.1"
    np.testing.assert_allclose(predict(named, unstated), predict(named, stated), rtol=1e-12)
    (form,) = [e for e in forms_by_name("grousers", unstated) if e.form == "radius and ripple, 18 lugs"]
    assert "h = 0.1 r" in form.equation


def test_every_form_of_lugs_is_found_again_by_its_name():
    here = specimen(24)
    found = [each for form in effects_for(here, ["grousers"]) for each in (form, *form.extensions())]
    assert {effect.form for effect in found} >= {
        "radius with its slip", "ripple, 24 lugs, overtone", "radius with its slip and ripple, 24 lugs",
        "radius and even ripple, 24 lugs", "radius and even ripple, 24 lugs, overtone",
        "radius with its slip and ripple, 24 lugs, overtone", "sides of the lugs and ripple, 24 lugs",
        "thrust of the lugs and ripple, 24 lugs, overtone",
    }  # fmt: skip
    for effect in found:
        again = forms_by_name("grousers", specimen(lugs_of(effect.form)))
        names = [parameter.name for parameter in effect.parameters]
        assert [each.form for each in again].count(effect.form) == 1
        assert names in [
            [parameter.name for parameter in each.parameters] for each in again if each.form == effect.form
        ]


def test_a_flattened_wheel_sinks_less():
    away = change("tyre_deflection:compliance=1e-4")
    assert (away[:, SINKAGE] < 0.0).all()
    assert untouched(change("tyre_deflection:compliance=0"), *range(5))


@pytest.mark.parametrize(
    ("form", "larger"),
    [
        ("circle", lambda share: 1.0 + share),
        ("substitute circle", lambda share: (np.sqrt(1.0 + share) + np.sqrt(share)) ** 2),
    ],
)
def test_a_flattened_wheel_is_as_much_larger_as_its_source_prints(form, larger):
    (effect,) = (each for each in forms_by_name("tyre_deflection", SITUATION) if each.form == form)
    contact = Contact(contact_array(np.linspace(0.05, 0.9, len(DRIVE)), DRIVE.slip, SOIL, WHEEL), WHEEL)
    contact.advance_m = 0.15
    effect.contact(contact, DRIVE, np.array([2e-5]))
    by_angle = 1.0 - np.cos(contact.theta_1)
    np.testing.assert_allclose(contact.sinkage_m, contact.radius_m * by_angle)
    share = 2e-5 * DRIVE.load_N / contact.sinkage_m
    np.testing.assert_allclose(contact.radius_m / WHEEL.radius_m, larger(share))
    np.testing.assert_allclose(contact.advance_m / 0.15, larger(share))


def test_a_slope_takes_its_share_of_the_weight():
    away = change("slope_gravity:s=1")
    assert untouched(away, LOAD, TORQUE, SINKAGE, SLIP)
    np.testing.assert_allclose(away[:, PULL], -DRIVE.load_N * np.tan(DRIVE.pitch_rad), atol=1e-9)


def test_inertia_is_newtons():
    away = change("inertia:J=0.2,m=12")
    assert untouched(away, LOAD, SINKAGE, SLIP)
    np.testing.assert_allclose(away[:, TORQUE], 0.2 * DRIVE.angular_acceleration_rad_s2, atol=1e-9)
    np.testing.assert_allclose(away[:, PULL], -12.0 * DRIVE.acceleration_m_s2, atol=1e-9)


def test_drivetrain_friction_costs_torque_alone():
    load, rate = DRIVE.load_N, DRIVE.rim_speed_m_s / WHEEL.radius_m
    for named, expected in (
        ("T_c=0.3", np.full(len(DRIVE), 0.3)), ("b_v=0.1", 0.1 * rate), ("mu=0.004", 0.004 * load),
        ("T_c=0.3,mu=0.004", 0.3 + 0.004 * load), ("T_c=0.3,b_v=0.1", 0.3 + 0.1 * rate),
    ):  # fmt: skip
        away = change(f"drivetrain_friction:{named}")
        assert untouched(away, LOAD, SINKAGE, SLIP, PULL)
        np.testing.assert_allclose(away[:, TORQUE], expected, atol=1e-9)
    backwards = replace(SITUATION, drive=replace(DRIVE, rim_speed_m_s=-DRIVE.rim_speed_m_s))
    less = predict("drivetrain_friction:T_c=0.3", backwards) - predict("drivetrain_friction:T_c=0", backwards)
    np.testing.assert_allclose(less[:, TORQUE], -0.3, atol=1e-9)


def test_constant_faults_change_what_is_reported_and_nothing_else():
    assert np.allclose(change("torque_offset:T_0=0.4")[:, TORQUE], 0.4, atol=1e-9)
    np.testing.assert_allclose(predict("torque_gain:g=0.1")[:, TORQUE], 1.1 * predict("torque_gain:g=0")[:, TORQUE])
    assert np.allclose(change("sinkage_offset:z_0=-0.002")[:, SINKAGE], -0.002, atol=1e-9)
    drift = change("drift:form=torque_Nm,d1=0.3")[:, TORQUE]
    np.testing.assert_allclose(drift, np.linspace(0.0, 0.6, len(DRIVE)), atol=1e-9)
    warm = predict("drift:form=torque_Nm, gain,g1=0.1")[:, TORQUE] / predict("drift:form=torque_Nm,d1=0")[:, TORQUE]
    np.testing.assert_allclose(warm, np.linspace(1.0, 1.2, len(DRIVE)), atol=1e-9)
    true = equilibrium(WHEEL, SOIL, DRIVE.load_N / 1.2, DRIVE.slip)
    heavy = predict("load_gain:g=0.2")
    np.testing.assert_allclose(heavy[:, SINKAGE], true.sinkage_m, rtol=1e-5)
    np.testing.assert_allclose(heavy[:, LOAD], DRIVE.load_N)


def test_faults_of_force_and_sinkage_sensors_change_what_is_reported_and_nothing_else():
    book = textbook()
    for named, channel, expected in (
        ("pull_offset:DP_0=3", PULL, book[:, PULL] + 3.0),
        ("pull_gain:g=0.1", PULL, 1.1 * book[:, PULL]),
        ("sinkage_gain:g=-0.1", SINKAGE, 0.9 * book[:, SINKAGE]),
        ("load_in_pull:s=0.03", PULL, book[:, PULL] + 0.03 * DRIVE.load_N),
        ("torque_pull_crosstalk:l=0.01", TORQUE, book[:, TORQUE] + 0.01 * book[:, PULL]),
        ("torque_pull_crosstalk:s=0.05", PULL, book[:, PULL] + 0.05 * book[:, TORQUE] / WHEEL.radius_m),
        ("frame_compliance:c=1e-5", SINKAGE, book[:, SINKAGE] + 1e-5 * book[:, PULL]),
    ):
        away = predict(named)
        np.testing.assert_allclose(away[:, channel], expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())
        assert untouched(away - book, *(each for each in range(5) if each != channel)), named


def test_a_wrong_zero_of_the_load_cell_is_another_load():
    true = equilibrium(WHEEL, SOIL, DRIVE.load_N - 5.0, DRIVE.slip)
    off = predict("load_offset:W_0=5")
    np.testing.assert_allclose(off[:, SINKAGE], true.sinkage_m, rtol=1e-5)
    np.testing.assert_allclose(off[:, LOAD], DRIVE.load_N)


@pytest.mark.parametrize("form", ["soft", "hard"])
def test_a_torque_that_saturates_is_itself_while_small_and_never_beyond_its_limit(form):
    share, usual = 4.0, 0.05 * textbook()[:, TORQUE].max()
    power = {"soft": 2.5, "hard": 8.0}[form]
    reported = predict(f"torque_saturation:form={form},s={share},T_usual={usual}")[:, TORQUE]
    assert (reported < usual * share ** (-1.0 / power)).all()
    small = predict(f"torque_saturation:form={form},s=0.1,T_usual={1e3 * usual}")[:, TORQUE]
    np.testing.assert_allclose(small, textbook()[:, TORQUE], rtol=1e-3)


def test_a_wrong_radius_is_a_wrong_slip_and_leaves_the_angle_of_the_wheel():
    wrong = predict("rolling_radius:e=0.05")
    true = equilibrium(WHEEL, SOIL, DRIVE.load_N, 1.0 - (1.0 - DRIVE.slip) / 1.05)
    np.testing.assert_allclose(wrong[:, TORQUE], true.torque_Nm, rtol=1e-5)
    np.testing.assert_allclose(wrong[:, SLIP], DRIVE.slip)
    parsed = parse_effect("rolling_radius:e=0.05")
    before = DRIVE.wheel_angle_rad.copy()
    choose(parsed, forms_by_name("rolling_radius", SITUATION)).impose(IMPOSED.copy(), DRIVE, np.array([0.05]))
    np.testing.assert_array_equal(DRIVE.wheel_angle_rad, before)


def test_lines_of_white_residuals_stand_out_of_noise_and_overtones_are_no_lugs_of_their_own():
    rng = np.random.default_rng(11)
    rows = 1200
    angle = np.cumsum(rng.uniform(0.02, 0.06, rows))
    drive = cast(Drive, SimpleNamespace(wheel_angle_rad=angle))
    bare = WHEEL.model_copy(update={"grouser_count": 0, "grouser_height_m": 0.0})

    def counts(sizes: dict[int, float], channels: list[int], wheel=bare, lost: float = 0.0) -> list[int]:
        white = np.full((rows, 5), np.nan)
        wave = sum((size * np.cos(line * angle + line) for line, size in sizes.items()), np.zeros(rows))
        white[:, channels] = rng.normal(size=(rows, len(channels))) + wave[:, None]
        white[rng.random(rows) < lost] = np.nan
        return lug_counts(wheel, drive, white)

    every = [TORQUE, SINKAGE, PULL]
    assert counts({18: 0.3}, every) == [18]
    assert counts({18: 0.3, 5: 0.4}, every, lost=0.2) == [5, 18]
    assert counts({18: 0.3, 36: 0.35}, every) == [18]
    # A misfit may come and go with any number of turns.
    assert counts({3: 0.4, 18: 0.3}, every) == [3, 18]
    assert counts({18: 0.5}, [PULL]) == [18]
    # The stated count is always tried, and one further line.
    assert counts({5: 0.4, 18: 0.3}, every, WHEEL) == [WHEEL.grouser_count, 5]
    assert counts({WHEEL.grouser_count: 0.4}, every, WHEEL) == [WHEEL.grouser_count]
    assert counts({2 * WHEEL.grouser_count: 0.4}, every, WHEEL) == [WHEEL.grouser_count, 2 * WHEEL.grouser_count]
    # One recording in a hundred has a line by chance, whatever the number of channels.
    for channels in (every, [PULL]):
        assert sum(bool(counts({}, channels)) for _ in range(150)) <= 6
    assert lug_counts(bare, drive, np.zeros((rows, 5))) == []


def test_what_warms_settles():
    drive = replace(DRIVE, time_s=3.0 + 0.5 * np.arange(len(DRIVE)))
    (effect,) = (
        each for each in forms_by_name("drift", replace(SITUATION, drive=drive)) if each.form == "torque_Nm, warming"
    )
    channels = np.zeros((len(drive), 5))
    effect.report(channels, drive, np.array([2.0, 4.0]))
    assert channels[0, TORQUE] == 0.0
    assert channels[8, TORQUE] == pytest.approx(2.0 * (1.0 - np.exp(-1.0)))
    assert (np.diff(channels[:, TORQUE]) > 0.0).all()
    assert (channels[:, TORQUE] < 2.0).all()
    np.testing.assert_array_equal(np.delete(channels, TORQUE, axis=1), 0.0)


def test_what_warms_was_cold_on_a_drive_that_began_before():
    """It was once too large by a factor of e^(t_first / tau)."""
    drive = replace(DRIVE, time_s=3000.0 + 0.5 * np.arange(len(DRIVE)))
    effect = forms_by_name("drift", replace(SITUATION, drive=drive))
    effect = next(each for each in effect if each.form == "torque_Nm, warming")
    channels = np.zeros((len(drive), 5))
    effect.report(channels, replace(drive, time_s=drive.time_s - 3000.0), np.array([2.0, 4.0]))
    np.testing.assert_array_equal(channels, 0.0)


def test_zeros_of_each_run_are_offered_where_slip_changes_within_runs():
    """With one slip for each run, zeros of the runs would replace any law of slip."""
    run, along = np.repeat(np.arange(4), 50), np.tile(np.linspace(0.0, 1.0, 50), 4)
    longer = replace(select_rows(DRIVE, np.arange(200) % len(DRIVE)), time_s=0.1 * np.arange(200), run=run)
    load = 100.0 + 20.0 * np.sin(9.0 * along)

    def offered(slip: np.ndarray, load_N: np.ndarray, drive: Drive = longer) -> Sequence[Effect]:
        return ZerosByRun.forms(replace(SITUATION, drive=replace(drive, slip=slip, load_N=load_N)))

    torque, *_, every = offered(0.05 + 0.5 * along, load)
    assert torque.form == "torque_Nm"
    assert [parameter.name for parameter in torque.parameters] == [f"T_0_run{number}" for number in range(1, 5)]
    assert len(every.parameters) == 12
    assert every.remark == ""
    assert "depend on the load" in offered(0.05 + 0.5 * along, 80.0 + 10.0 * run)[0].remark
    assert not offered(0.1 + 0.1 * run, load)
    trials = replace(longer, time_s=np.full(200, np.nan), stretch=np.arange(200))
    assert len(offered(0.05 + 0.5 * along, load, trials)) == 4
    assert not offered(0.05 + 0.5 * along, load, replace(longer, run=np.zeros(200, dtype=int)))
    assert not offered(0.05 + 0.5 * along, load, replace(longer, run=np.arange(200) // 8))


def test_zeros_of_a_run_are_none_of_another_drive():
    run = np.repeat([0, 2], 5)
    drive = replace(select_rows(DRIVE, np.arange(10)), run=run, slip=np.tile(np.linspace(0.1, 0.5, 5), 2))
    zeros = ZerosByRun([SINKAGE], np.ones(5), np.unique(drive.run))
    channels = np.zeros((10, 5))
    zeros.report(channels, replace(drive, run=np.repeat([0, 1, 2, 3, 9], 2)), np.array([0.3, -0.2]))
    np.testing.assert_allclose(channels[:, SINKAGE], np.repeat([0.3, 0.0, -0.2, 0.0, 0.0], 2))
    assert not channels[:, [each for each in range(5) if each != SINKAGE]].any()


def test_a_course_that_slip_and_load_foretell_is_offered_by_name_only():
    """A ramp of slip for each load, one after the other: whatever bends with time may be what a law leaves out."""
    count = 400
    longer = select_rows(DRIVE, np.arange(count) % len(DRIVE))
    longer = replace(longer, time_s=0.1 * np.arange(count))

    def bends(*loads: float) -> bool:
        along = len(loads) * np.arange(count) / count
        ramp = along.astype(int)
        drive = replace(longer, slip=0.05 + 0.5 * (along - ramp), load_N=50.0 * np.array(loads)[ramp])
        situation = replace(SITUATION, drive=drive)
        assert choose(parse_effect("drift:d1=0.1,form=torque_Nm, bent"), ChannelDrift.forms_by_name(situation))
        forms = [effect.form for effect in ChannelDrift.forms(situation)]
        assert "torque_Nm" in forms
        (gain,) = (each for each in ChannelDrift.forms(situation) if each.form == "torque_Nm, gain")
        assert bool(gain.extensions()) == ("torque_Nm, bent" in forms) == ("torque_Nm, warming" in forms)
        return "torque_Nm, bent" in forms

    for loads in ((1.0, 1.5, 2.0), (2.0, 1.0, 1.5), (0.7, 1.0, 1.5, 2.0), (1.0, 0.6, 2.0, 1.4, 3.0)):
        assert not bends(*loads)
    # The same load again, and what changed between is time.
    for loads in ((1.0, 1.5, 1.0), (1.0, 1.0, 1.0), (0.7, 1.0, 1.5, 0.7), (1.0, 0.6, 2.0, 1.4, 1.0)):
        assert bends(*loads)
    few = select_rows(longer, np.linspace(0, count - 1, 12).astype(int))
    assert not curves_predicted(
        replace(few, load_N=np.linspace(50.0, 90.0, 12)[np.random.default_rng(2).permutation(12)])
    )


def test_no_delay_of_slip_is_offered_where_it_rises_at_one_rate():
    """It would be an offset, which the differences between published laws explain as well."""
    count = 400
    longer = select_rows(DRIVE, np.arange(count) % len(DRIVE))
    along = 4.0 * np.arange(count) / count
    ramp = along.astype(int)

    def lags(slip: np.ndarray) -> set[str]:
        drive = replace(longer, time_s=0.1 * np.arange(count), slip=slip, stretch=ramp)
        forms = TimeLag.forms(replace(SITUATION, drive=drive))
        return {effect.form for effect in forms if "low-pass" not in effect.form}

    up = lags(0.05 + 0.5 * (along - ramp))
    up_and_down = lags(0.05 + np.abs(along - ramp - 0.5))
    assert up_and_down - up == {"slip"}
    assert "torque_Nm" in up


def test_further_overtones_are_those_that_rows_are_close_enough_to_show():
    """Twelve rows a lug resolve the fourth harmonic; seven resolve the third at most."""
    for rows_a_lug, expected in ((12.0, ["2 overtones", "3 overtones"]), (7.0, ["2 overtones"]), (5.0, [])):
        angle = np.arange(len(DRIVE)) * 2.0 * np.pi / (WHEEL.grouser_count * rows_a_lug)
        angle = np.maximum(angle, 4.0 * (np.arange(len(DRIVE)) == len(DRIVE) - 1))
        drive = replace(DRIVE, wheel_angle_rad=angle)
        found = effects_for(replace(SITUATION, drive=drive), ["grousers"])
        (form,) = [each for each in found if each.form == f"radius and ripple, {WHEEL.grouser_count} lugs, overtone"]
        more = [each.form.rpartition(", ")[2] for each in form.extensions() if each.form.startswith(form.form[:20])]
        assert [each for each in more if each != "overtone"] == expected
        others = [each for each in form.extensions() if each.form.endswith(", overtone")]
        assert others
        assert all(len(other.extensions()) == len(expected) for other in others)
        (once,) = [each for each in found if each.form == f"radius and ripple, {WHEEL.grouser_count} lugs"]
        assert not any("overtone" in each.form for each in once.extensions())


def test_waves_of_each_order_come_round_so_many_times_a_turn():
    angle = np.linspace(0.0, 2.0 * np.pi, len(DRIVE))
    situation = replace(SITUATION, drive=replace(DRIVE, wheel_angle_rad=angle))
    count = WHEEL.grouser_count
    for order in (3, 4):
        away = predict(f"grousers:form=radius and even ripple,b{order}_DP=2", situation) - textbook()
        np.testing.assert_allclose(away[:, PULL], 2.0 * np.sin(order * count * angle), atol=1e-4)
