"""Every effect of the catalogue: it vanishes at its null, has the sign and the limits that its source says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bevameter import InputError
from bevameter.identification.effects.catalogue import REGISTRY, SLUGS, effects_for, forms_by_name
from bevameter.identification.effects.effect import (
    LOAD,
    PULL,
    SINKAGE,
    SLIP,
    TORQUE,
    Effect,
)
from bevameter.identification.effects.parse import (
    NamedEffect,
    choose,
    parse_effect,
    values_of,
)
from bevameter.identification.mechanics.augmented import AugmentedWheel
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.simulate import soil_vector
from effects_tried import (
    DRIVE,
    FORMS,
    IMPOSED,
    JANOSI,
    SITUATION,
    SOIL,
    WHEEL,
    change,
    identity,
    predict,
    textbook,
    untouched,
)  # fmt: skip
from hypothesis import given, settings
from hypothesis import strategies as st


def test_every_effect_is_a_module_of_its_name_with_a_description():
    for slug, kind in REGISTRY.items():
        assert kind.__module__.endswith(f".catalogue.{slug}")
        assert kind.title == kind.title.strip()
        assert kind.what_happens[0].islower()
        assert not kind.what_happens.endswith(".")
        assert not kind.check.endswith(".")
    assert list(SLUGS) == sorted(SLUGS, key=lambda slug: (REGISTRY[slug].kind != "physics", slug))


def test_every_slug_has_a_form_and_every_form_has_a_description():
    assert {effect.slug for effect in FORMS} == set(SLUGS)
    for effect in FORMS:
        assert effect.kind == REGISTRY[effect.slug].kind
        assert effect.equation
        assert effect.source
        for parameter in effect.parameters:
            assert parameter.source, identity(effect)
            assert parameter.low < parameter.high, identity(effect)
            assert parameter.low <= parameter.start <= parameter.high, identity(effect)
            assert parameter.scale > 0.0
        for start in effect.starts():
            assert len(start) == len(effect.parameters)
    with pytest.raises(InputError, match=r"'gravity'.*slip_sinkage"):
        effects_for(SITUATION, ["gravity"])


@pytest.mark.parametrize("effect", FORMS, ids=identity)
def test_an_effect_changes_the_channels_that_it_states(effect):
    values = [min(p.start + 0.3 * p.scale, p.high) for p in effect.parameters]
    answer = AugmentedWheel(WHEEL, (effect,)).predict(DRIVE, IMPOSED, np.concatenate([soil_vector(SOIL), values]))
    moved = [channel for channel in range(5) if not untouched(answer.channels - textbook(), channel)]
    assert set(moved) <= set(effect.changes)


WITHOUT_NULL = ("shear_hump", "rim_adhesion", "grousers[displacement of the tips]")


@pytest.mark.parametrize(
    "effect", [e for e in FORMS if e.slug not in WITHOUT_NULL and e.name not in WITHOUT_NULL], ids=identity
)
def test_an_effect_vanishes_at_its_null(effect):
    null = np.array([parameter.null for parameter in effect.parameters])
    model = AugmentedWheel(WHEEL, (effect,))
    channels = model.predict(DRIVE, IMPOSED, np.concatenate([soil_vector(SOIL), null])).channels
    expected = textbook()
    np.testing.assert_allclose(channels / np.abs(expected).max(axis=0), expected / np.abs(expected).max(axis=0),
                               atol=1e-5)  # fmt: skip


def test_effects_without_a_null_of_their_own_vanish_in_their_limits():
    assert untouched(change("rim_adhesion:form=strength,c_a=3e4,tan_delta=1.5"), *range(5))
    assert untouched(change("grousers:form=displacement of the tips,s=0"), *range(5))
    hump = next(each for each in forms_by_name("shear_hump", SITUATION) if not each.form)
    weaker = replace(SOIL, c_Pa=SOIL.c_Pa / JANOSI, phi_rad=math.atan(math.tan(SOIL.phi_rad) / JANOSI))
    vector = np.append(soil_vector(weaker), JANOSI)
    expected = textbook()
    channels = AugmentedWheel(WHEEL, (hump,)).predict(DRIVE, IMPOSED, vector).channels
    np.testing.assert_allclose(channels / expected.max(axis=0), expected / expected.max(axis=0), atol=1e-5)


def test_a_wheel_that_digs_sinks_as_on_ground_that_bears_as_much_less():
    """At half slip a layer of h z0 is dug out: the load is borne at 1 + h times the depth."""
    drive = replace(DRIVE, slip=np.full(len(DRIVE), 0.5))
    dug = predict("slip_sinkage:form=dig-out,h=0.4", replace(SITUATION, drive=drive))
    softer = replace(SOIL, stiffness_Pa=SOIL.stiffness_Pa * 1.4**-SOIL.n)
    imposed = np.column_stack([drive.load_N, drive.slip])
    expected = AugmentedWheel(WHEEL).predict(drive, imposed, soil_vector(softer)).channels
    np.testing.assert_allclose(dug, expected, rtol=1e-6)


@pytest.mark.parametrize("effect", FORMS, ids=identity)
def test_derivatives_are_those_of_the_prediction(effect):
    model = AugmentedWheel(WHEEL, (effect,))
    values = np.array([min(max(p.start + 0.2 * p.scale, p.low), p.high) for p in effect.parameters])
    if effect.slug == "rim_adhesion":
        values = np.array([200.0, 0.4])  # the soil's own strength nowhere near: where the two cross there is a kink
    vector = np.concatenate([soil_vector(SOIL), values])
    scale = np.concatenate([[500.0, 0.5, 1.0, 1.0, 0.5], [parameter.scale for parameter in effect.parameters]])
    if effect.slug == "soil_patch":
        scale[7:9] = 0.1 * effect.constants["edge"]
    # A delayed answer is that of another row, whose angle moves a little otherwise: its derivative is less exact.
    share = 0.05 if effect.slug == "time_lag" else 1e-3
    here = model.linearise(DRIVE, IMPOSED, vector, None)
    usual = np.abs(here.channels).max(axis=0)
    for index in range(len(vector)):
        step = 1e-3 * scale[index]
        up, down = vector.copy(), vector.copy()
        up[index] += step
        down[index] -= step
        if effect.slug == "time_lag" and index >= 5:
            continue  # interpolated samples have kinks; the step of its derivative is a share of a sample
        numeric = (model.predict(DRIVE, IMPOSED, up, here.theta_1).channels
                   - model.predict(DRIVE, IMPOSED, down, here.theta_1).channels) / (2.0 * step)  # fmt: skip
        error = np.abs(numeric - here.by_parameter[:, :, index]).max(axis=0)
        assert (error <= share * np.abs(numeric).max(axis=0) + 3e-6 * usual / step).all(), (index, error)
    for index, step in ((LOAD, 0.05), (1, 1e-4)):
        move = np.zeros_like(IMPOSED)
        move[:, index] = step
        numeric = (model.predict(DRIVE, IMPOSED + move, vector, here.theta_1).channels
                   - model.predict(DRIVE, IMPOSED - move, vector, here.theta_1).channels) / (2.0 * step)  # fmt: skip
        if effect.slug != "time_lag":
            error = np.abs(numeric - here.by_latent[:, :, index]).max(axis=0)
            assert (error <= share * np.abs(numeric).max(axis=0) + 3e-6 * usual / step).all(), (index, error)


@pytest.mark.filterwarnings("error")
def test_a_wheel_that_bears_less_the_deeper_it_stands_has_no_derivatives_and_warns_of_none():
    """A tyre softer than the soil, as a search may try."""
    (tyre,) = (each for each in FORMS if each.name == "tyre_deflection[pressure]")
    vector = np.array([0.0, 0.0, -4.42284863, 19.3098465, -1.30092787, 3.07e4])
    imposed = np.column_stack([np.linspace(60.0, 180.0, len(IMPOSED)), np.full(len(IMPOSED), -0.05)])
    here = AugmentedWheel(WHEEL, (tyre,)).linearise(DRIVE, imposed, vector, None)
    assert np.isfinite(here.channels).any()
    assert not np.isfinite(here.by_parameter).all()


@pytest.mark.parametrize("effect", [form for form in FORMS if not form.moves_wheel.all()], ids=identity)
def test_an_effect_that_does_not_move_the_wheel_leaves_the_entry_angle(effect):
    model = AugmentedWheel(WHEEL, (effect,))
    null = np.array([parameter.null for parameter in effect.parameters])
    changed = np.array([min(p.null + 0.5 * p.scale, p.high) for p in effect.parameters])
    soil = soil_vector(SOIL)
    here = model.linearise(DRIVE, IMPOSED, np.concatenate([soil, null]), None)
    there = model.linearise(
        DRIVE, IMPOSED, np.concatenate([soil, np.where(effect.moves_wheel, null, changed)]), here.entry(np.zeros(1))
    )
    np.testing.assert_array_equal(there.theta_1, here.theta_1)
    assert not np.array_equal(there.channels, here.channels)
    assert not here.theta_1_by_parameter[:, 5:][:, ~effect.moves_wheel].any()


@pytest.mark.parametrize("effect", [effect for effect in FORMS if effect.nested], ids=identity)
def test_at_its_null_an_effect_takes_over_the_derivatives_of_the_wheel_without_it(effect):
    soil, null = soil_vector(SOIL), np.array([parameter.null for parameter in effect.parameters])
    without = AugmentedWheel(WHEEL).linearise(DRIVE, IMPOSED, soil, None)
    model, vector = AugmentedWheel(WHEEL, (effect,)), np.concatenate([soil, null])
    whole = model.linearise(DRIVE, IMPOSED, vector, without.entry(np.zeros(5)))
    there = model.linearise(DRIVE, IMPOSED, vector, without.entry(np.zeros(5)), known=without)
    usual = np.abs(whole.by_parameter).max(axis=0) + 1e-6 * np.abs(whole.channels).max(axis=0)[:, None]
    np.testing.assert_allclose(there.by_parameter / usual, whole.by_parameter / usual, atol=1e-3)
    np.testing.assert_array_equal(there.by_parameter[..., 5:], whole.by_parameter[..., 5:])


def test_derivatives_are_not_taken_over_where_the_effect_acts():
    (lugs,) = [effect for effect in FORMS if effect.name == "grousers[radius]"]
    without = AugmentedWheel(WHEEL).linearise(DRIVE, IMPOSED, soil_vector(SOIL), None)
    model, vector = AugmentedWheel(WHEEL, (lugs,)), np.append(soil_vector(SOIL), 0.5)
    whole = model.linearise(DRIVE, IMPOSED, vector, None)
    assert not np.allclose(whole.channels, without.channels, rtol=1e-3)
    there = model.linearise(DRIVE, IMPOSED, vector, None, known=without)
    np.testing.assert_array_equal(there.by_parameter, whole.by_parameter)


@pytest.mark.parametrize("last", [effect for effect in FORMS if effect.nested], ids=identity)
def test_an_effect_at_its_null_leaves_every_other_effect_unchanged(last):
    """An effect changes a quantity from what other effects have set it to, and does not overwrite it."""
    null = np.array([parameter.null for parameter in last.parameters])
    for first in FORMS:
        if first.slug == last.slug:
            continue
        start = (*first.starts(), np.array([parameter.start for parameter in first.parameters]))[0]
        base = np.concatenate([soil_vector(SOIL), start])
        alone = AugmentedWheel(WHEEL, (first,)).predict(DRIVE, IMPOSED, base)
        combined = AugmentedWheel(WHEEL, (first, last)).predict(DRIVE, IMPOSED, np.append(base, null))
        np.testing.assert_allclose(combined.channels, alone.channels, rtol=1e-5, err_msg=first.name)


def test_a_lag_shifts_a_channel_in_time_while_the_clock_runs():
    lagging = SITUATION.drive.time_s[1] - SITUATION.drive.time_s[0]
    late, book = predict(f"time_lag:form=sinkage_m,tau={lagging}"), predict("torque_offset:T_0=0")
    np.testing.assert_allclose(late[1:, SINKAGE], book[:-1, SINKAGE], rtol=1e-9)
    assert late[0, SINKAGE] == pytest.approx(book[0, SINKAGE])
    stretches = np.repeat([0, 1], len(DRIVE) // 2)
    first = int(np.flatnonzero(stretches)[0])
    # A new pass that begins at once finds the instrument as the last one left it; after a rest it has settled.
    for rest, expected in ((0.0, book[first - 1]), (100.0, book[first])):
        drive = replace(DRIVE, stretch=stretches, time_s=DRIVE.time_s + rest * stretches)
        late = predict(f"time_lag:form=sinkage_m,tau={lagging}", replace(SITUATION, drive=drive))
        assert late[first, SINKAGE] == pytest.approx(expected[SINKAGE])


@pytest.mark.parametrize("named", ["slip_sinkage:n1=0.4", "slip_sinkage:form=ratio,p=0.8"])
def test_slip_sinkage_deepens_the_wheel_with_slip_and_changes_its_forces(named):
    away = change(named)
    assert (away[:, SINKAGE] > 0.0).all()
    same_load = replace(SITUATION, drive=replace(DRIVE, load_N=np.full(len(DRIVE), 100.0)))
    deeper = predict(named, same_load)[:, SINKAGE] / predict("torque_offset:T_0=0", same_load)[:, SINKAGE]
    assert (np.diff(deeper) > 0.0).all()
    assert (away[:, TORQUE] > 0.0).all()
    assert away[-1, PULL] < 0.0  # what the longer contact gains is lost where the wheel digs itself in


def test_soil_transport_deepens_the_rut_alone_by_the_ratio_of_lyasko():
    away = change("slip_sinkage:form=transport,p=1")
    assert untouched(away, LOAD, TORQUE, SLIP, PULL)
    ratio = (1.0 + DRIVE.slip) / (1.0 - 0.5 * DRIVE.slip)
    np.testing.assert_allclose((away + textbook())[:, SINKAGE], ratio * textbook()[:, SINKAGE], rtol=1e-4)


def test_transport_and_digging_deepen_the_rut_by_their_sum():
    both, lyasko = (predict(f"slip_sinkage:{named}") for named in ("form=transport, and dig-out,p=0.4,h=0.3",
                                                                   "form=transport,p=0.4"))  # fmt: skip
    away = np.minimum(np.abs(DRIVE.slip), 0.9)
    dug = 0.3 * away / (1.0 - away) * textbook()[:, SINKAGE]
    np.testing.assert_allclose(both[:, SINKAGE], lyasko[:, SINKAGE] + dug)
    np.testing.assert_array_equal(np.delete(both, SINKAGE, axis=1), np.delete(lyasko, SINKAGE, axis=1))


def test_the_stress_peak_moves_forward_with_slip_and_costs_pull():
    away = change("stress_peak_shift:a1=0.4")
    assert (away[:, PULL] < 0.0).all()
    back = change("stress_peak_shift:a0=0.3")
    assert (back[:, PULL] > 0.0).all()
    braked = replace(SITUATION, drive=replace(DRIVE, slip=-DRIVE.slip))
    np.testing.assert_allclose(predict("stress_peak_shift:a1=0.4", braked), predict("stress_peak_shift:a1=0", braked))


def test_what_braked_wheels_do_to_the_stress_peak_has_a_form_each_where_wheels_are_braked():
    halved = replace(DRIVE, slip=np.where(np.arange(len(DRIVE)) % 2 == 0, DRIVE.slip, -DRIVE.slip))
    braked = halved.slip < 0.0
    drive, usual = (
        replace(SITUATION, drive=halved),
        predict("stress_peak_shift:a1=0.2", replace(SITUATION, drive=halved)),
    )
    found = effects_for(drive, ["stress_peak_shift"])
    assert [effect.form for effect in found] == ["", "braked wheels back", "braked wheels alike"]
    assert [effect.form for effect in effects_for(SITUATION, ["stress_peak_shift"])] == [""]
    for form, as_if in (("braked wheels back", -1.0), ("braked wheels alike", 1.0)):
        away = predict(f"stress_peak_shift:form={form},a1=0.2", drive)
        # A braked wheel's peak is where that of a wheel without a1 would be, at another a0.
        there = 0.5 + as_if * 0.2 * np.abs(halved.slip)
        for row in np.flatnonzero(braked)[:3]:
            same = predict(f"stress_peak_shift:a0={there[row]:.12f}", drive)
            np.testing.assert_allclose(away[row], same[row], rtol=1e-9)
        np.testing.assert_allclose(away[~braked], usual[~braked])


def test_a_contact_behind_the_wheel_carries_part_of_the_load():
    away = change("exit_angle:c2=0.4")
    assert (away[:, SINKAGE] < 0.0).all()


@pytest.mark.parametrize("by_slip", [-1.5, -0.5, 1.5])
@pytest.mark.parametrize("form", ["peak kept", "peak midway"])
def test_an_exit_angle_may_grow_or_fall_with_slip(form, by_slip):
    """At each slip it is that of the same share, and never more than nearly the entry angle, nor ahead of the axle."""
    name = "c2" if form == "peak kept" else "s"
    away = predict(f"exit_angle:form={form}, by slip,{name}=0.3,b1={by_slip}")
    rows = range(0, len(DRIVE), 9)
    wanted = [0.3 + by_slip * DRIVE.slip[row] for row in rows]
    if abs(by_slip) > 1.0:
        assert min(wanted) < 0.0 or max(wanted) > 0.95
    for row, share in zip(rows, wanted, strict=True):
        same = predict(f"exit_angle:form={form},{name}={float(np.clip(share, 0.0, 0.95))!r}")
        np.testing.assert_allclose(away[row], same[row], rtol=1e-6)


def test_a_hump_takes_from_large_displacements_what_it_gives_to_middle_ones():
    spun = replace(SITUATION, drive=replace(DRIVE, slip=np.full(len(DRIVE), 0.9)))
    assert (predict("shear_hump:K_r=0.3", spun)[:, TORQUE] < predict("shear_hump:K_r=0.9", spun)[:, TORQUE]).all()


def test_soil_loaded_faster_is_stiffer_or_stronger_about_its_reference_speed():
    fast = DRIVE.rim_speed_m_s > 0.25
    stiffer = change("rate_dependence:m=0.2,v0=0.25")
    assert (stiffer[fast, SINKAGE] < 0.0).all()
    assert (stiffer[~fast, SINKAGE] > 0.0).all()
    stronger = change("rate_dependence:s=0.2,v0=0.25")
    assert (stronger[fast, PULL] > 0.0).all()
    alike = replace(SITUATION, drive=replace(DRIVE, rim_speed_m_s=np.full(len(DRIVE), 0.25)))
    np.testing.assert_allclose(predict("rate_dependence:m=0.3,v0=0.25", alike), textbook(), rtol=1e-4)


def test_an_unknown_form_is_refused_with_the_forms_there_are():
    with pytest.raises(InputError, match=r"'place' or 'time' or 'x' or 'y' or 'place, cohesion apart' or 'place, a"):
        change("soil_patch:form=nowhere,from=0.4,to=0.6,A=1")


def test_the_rim_caps_the_shear_stress_as_a_weaker_soil_would():
    weak = equilibrium(WHEEL, replace(SOIL, c_Pa=200.0, phi_rad=math.atan(0.4)), DRIVE.load_N, DRIVE.slip)
    capped = predict("rim_adhesion:form=strength,c_a=200,tan_delta=0.4")
    np.testing.assert_allclose(capped[:, TORQUE], weak.torque_Nm, rtol=1e-4)
    assert (change("rim_adhesion:form=strength,c_a=200,tan_delta=0.4")[:, TORQUE] < 0.0).all()


def test_a_rim_that_only_adheres_transmits_its_adhesion_over_the_contact():
    """Wet soil on metal: of a firmly spinning wheel the whole contact, from the entry angle down, is at c_a."""
    drive = replace(DRIVE, slip=np.full(len(DRIVE), 0.9))
    stuck = predict("rim_adhesion:form=cut off,c_a=50,tan_delta=0", replace(SITUATION, drive=drive))
    theta_1 = np.arccos(1.0 - stuck[:, SINKAGE] / WHEEL.radius_m)
    np.testing.assert_allclose(stuck[:, TORQUE], 50.0 * WHEEL.width_m * WHEEL.radius_m**2 * theta_1, rtol=0.02)


@pytest.mark.parametrize("named", ["bulldozing:s=1", "bulldozing:N=5", "bulldozing:share=3"])
def test_bulldozing_costs_pull_alone_and_grows_with_sinkage(named):
    away = change(named)
    assert untouched(away, LOAD, TORQUE, SINKAGE, SLIP)
    assert (away[:, PULL] < 0.0).all()
    order = np.argsort(textbook()[:, SINKAGE])
    assert (np.diff(away[order, PULL]) < 0.0).all()


def test_the_wedge_is_that_of_rankine_for_soil_without_friction():
    """Without friction X = 45 deg, cot X + tan X = 2: R_b = 2 b (c z + gamma z^2 / 2)."""
    clay = replace(SOIL, phi_rad=0.0, c_Pa=4e3)
    away = predict("bulldozing:s=1", soil=clay)[:, PULL] - predict("bulldozing:s=0", soil=clay)[:, PULL]
    z = predict("bulldozing:s=0", soil=clay)[:, SINKAGE]
    np.testing.assert_allclose(away, -2.0 * WHEEL.width_m * (4e3 * z + 15.7e3 * z**2 / 2.0), rtol=1e-6)


MOST_PARAMETERS = max(len(effect.parameters) for effect in FORMS)


@settings(max_examples=60, deadline=None)
@given(
    effect=st.sampled_from(FORMS),
    shares=st.lists(st.floats(0.0, 1.0), min_size=MOST_PARAMETERS, max_size=MOST_PARAMETERS),
    load=st.floats(5.0, 400.0),
    slip=st.floats(-0.95, 0.95),
)
def test_carried_loads_give_finite_channels_whatever_the_parameters(effect, shares, load, slip):
    drive = replace(DRIVE, load_N=np.full(len(DRIVE), load), slip=np.full(len(DRIVE), slip))
    values = [p.low + share * (p.high - p.low) for p, share in zip(effect.parameters, shares, strict=False)]
    imposed = np.column_stack([drive.load_N, drive.slip])
    answer = AugmentedWheel(WHEEL, (effect,)).predict(drive, imposed, np.concatenate([soil_vector(SOIL), values]))
    carried = np.isfinite(answer.theta_1)
    assert np.isfinite(answer.channels[carried]).all()
    assert np.isnan(answer.channels[~carried][:, [TORQUE, PULL]]).all()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gravity:g=1", "slip_sinkage"),
        ("slip_sinkage", "exponent.*n1"),
        ("slip_sinkage:n3=0.1", "no parameter 'n3'.*n1"),
        ("slip_sinkage:p=0.5", "form=ratio or form=transport"),
        ("slip_sinkage:form=plain,p=0.5", "form 'plain'.*ratio"),
        ("slip_sinkage:n1=nan", "a finite number"),
        ("slip_sinkage:n1=0.2 m", "a finite number"),
        ("slip_sinkage:n1=9", "to 3"),
        ("slip_sinkage:n1", "NAME=VALUE"),
        ("slip_sinkage:n1=1,n1=2", "once"),
        ("rim_adhesion:form=strength,c_a=100", "tan_delta"),
        ("side_wall_friction:form=stress,tau_s=2 m", r"\[Pa\]"),
        ("slope_gravity:s=__import__('os')", "finite"),
    ],
)
def test_a_bad_effect_is_refused_in_one_line_with_what_is_expected(text, said):
    with pytest.raises(InputError, match=said) as caught:
        predict(text)
    assert "\n" not in str(caught.value)


def test_quantities_carry_their_units_and_forms_their_beginnings():
    parsed = parse_effect("side_wall_friction:form=stress,tau_s=0.8 kPa")
    assert values_of(choose(parsed, forms_of("side_wall_friction")), parsed) == pytest.approx([800.0])
    parsed = parse_effect("inertia:J=2e4 kg cm**2")
    assert values_of(choose(parsed, forms_of("inertia")), parsed) == pytest.approx([2.0])
    parsed = NamedEffect("grousers", {"a_T": 0.1}, "ripple")
    assert choose(parsed, forms_of("grousers")).form == "ripple, 18 lugs"
    for named, form in (
        ("drift:form=torque,d1=0.3", "torque_Nm"),
        ("drift:form=torque_Nm,d1=0.3,d2=0.3", "torque_Nm, bent"),
        ("drift:form=torque_Nm,d1=0.3,d6=0.3", "torque_Nm, curved"),
        ("drift:form=torque,g1=0.1", "torque_Nm, gain"),
        ("drift:form=torque,d=0.1,tau=5 s", "torque_Nm, warming"),
    ):
        assert choose(parse_effect(named), forms_of("drift")).form == form
    braked = choose(parse_effect("slip_sinkage:form=transport, driven,p=0.3,h=0.2"), forms_of("slip_sinkage"))
    assert braked.form == "transport, driven, and dig-out"
    parsed = parse_effect("drift:d1=0.1,form=torque_Nm, curved")
    assert choose(parsed, forms_of("drift")).form == "torque_Nm, curved"


def forms_of(slug: str) -> list[Effect]:
    return forms_by_name(slug, SITUATION)
