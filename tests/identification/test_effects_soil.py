"""Effects by which the soil itself is another: where it was run over, deeper down, over a stretch of the track."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bevameter.identification.effects.catalogue.soil_patch import SoilPatch
from bevameter.identification.effects.effect import (
    COVARIATES,
    PULL,
    SINKAGE,
    TORQUE,
    Drive,
)
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from effects_tried import (
    DRIVE,
    SITUATION,
    SOIL,
    WHEEL,
    change,
    predict,
    textbook,
    untouched,
)  # fmt: skip


def test_later_passes_sink_less_and_by_less_and_less():
    numbers = np.array([1.0, 2.0, 3.0, 4.0, 20.0])
    drive = type(DRIVE)(**{name: getattr(DRIVE, name)[:5] for name in COVARIATES})
    drive = replace(drive, pass_number=numbers, load_N=np.full(5, 100.0), slip=np.full(5, 0.2))
    sinkage = predict("multipass_compaction:A=0.6,N0=1.5", replace(SITUATION, drive=drive))[:, SINKAGE]
    fresh = equilibrium(WHEEL, SOIL, np.array([100.0]), np.array([0.2])).sinkage_m[0]
    assert sinkage[0] == pytest.approx(fresh, rel=1e-5)
    steps = -np.diff(sinkage)
    assert (steps[:3] > 0.0).all()
    assert (np.diff(steps[:3]) < 0.0).all()
    firm = equilibrium(WHEEL, replace(SOIL, stiffness_Pa=SOIL.stiffness_Pa * math.exp(0.6)), np.array([100.0]), [0.2])
    assert sinkage[-1] == pytest.approx(firm.sinkage_m[0], rel=1e-4)


def test_ground_is_compacted_where_the_wheel_before_slipped():
    """Before with slip 0.1 and then 0.6 over two metres, and the same way again with 0.2."""
    place = np.tile(np.linspace(0.0, 2.0, 100), 2)
    numbers = np.repeat([1.0, 2.0], 100)
    slip = np.where(numbers > 1.0, 0.2, np.where(place < 1.0, 0.1, 0.6))
    columns = {name: np.resize(getattr(DRIVE, name), 200) for name in COVARIATES}
    drive = replace(
        Drive(**columns), pass_number=numbers, slip=slip, slip_before=np.where(place < 1.0, 0.1, 0.6),
        load_N=np.full(200, 100.0),
    )  # fmt: skip
    sinkage = predict("multipass_compaction:form=by slip,A=0.5,i0=0.2,q=0", replace(SITUATION, drive=drive))[:, SINKAGE]
    for before, rows in ((0.1, (numbers > 1.0) & (place < 0.95)), (0.6, (numbers > 1.0) & (place > 1.05))):
        firmer = replace(SOIL, stiffness_Pa=SOIL.stiffness_Pa * math.exp(-0.5 * math.expm1(-before / 0.2)))
        expected = equilibrium(WHEEL, firmer, np.array([100.0]), [0.2]).sinkage_m[0]
        np.testing.assert_allclose(sinkage[rows], expected, rtol=1e-5)


def test_a_hard_layer_holds_up_only_the_wheels_that_reach_it():
    """The law's deepest point is that of the stress peak, midway along the contact, where the depth is about 3/4 z."""
    reach = WHEEL.radius_m * (np.cos(0.5 * angle_of(textbook())) - np.cos(angle_of(textbook())))
    depth = float(np.median(reach))
    away = change(f"hard_layer:d={depth},ln_S_L=15")
    assert untouched(away[reach < depth], *range(5))
    assert (away[reach > 1.06 * depth, SINKAGE] < -1e-6).all()
    floor = predict(f"hard_layer:d={depth},ln_S_L=20")
    assert np.isfinite(floor).all()
    assert (np.cos(0.5 * angle_of(floor)) - np.cos(angle_of(floor))).max() * WHEEL.radius_m < 1.08 * depth


def angle_of(channels: np.ndarray) -> np.ndarray:
    return np.arccos(1.0 - channels[:, SINKAGE] / WHEEL.radius_m)


def test_a_patch_is_another_soil_between_its_ends():
    away = change("soil_patch:form=place,from=0.4,to=0.6,A=-0.5,B=-0.2")
    inside = (DRIVE.place_m > 0.45) & (DRIVE.place_m < 0.55)
    outside = (DRIVE.place_m < 0.3) | (DRIVE.place_m > 0.7)
    assert (away[inside, SINKAGE] > 0.0).all()
    assert (away[inside, PULL] < 0.0).all()
    assert (np.abs(away[outside]) < 1e-3 * np.abs(textbook()).max(axis=0)).all()


@pytest.mark.parametrize("form", ["place", "place, cohesion apart", "place,cohesion apart"])
def test_a_patch_may_have_a_cohesion_of_its_own(form):
    """Named in full, with or without blanks, or by its first word: the parameter tells."""
    inside = (DRIVE.place_m > 0.45) & (DRIVE.place_m < 0.55)
    tied = change("soil_patch:form=place,from=0.4,to=0.6,A=0,B=0.5")
    cohesive = change(f"soil_patch:form={form},from=0.4,to=0.6,A=0,B=0.5,C=-0.5")
    assert (cohesive[inside, TORQUE] < tied[inside, TORQUE]).all()
    alone = change(f"soil_patch:form={form},from=0.4,to=0.6,C=0.5")
    assert (alone[inside, TORQUE] > 0.0).all()


def test_a_patch_may_be_another_class_of_soil():
    """What differs there is the soil of the textbook wheel, which the same numbers describe."""
    inside = (DRIVE.place_m > 0.45) & (DRIVE.place_m < 0.55)
    other = Soil(SOIL.c_Pa * math.exp(0.7), math.atan(math.tan(SOIL.phi_rad) * math.exp(-0.2)),
                 SOIL.k_m * math.exp(-0.6), SOIL.stiffness_Pa * math.exp(0.3), SOIL.n * math.exp(0.25))  # fmt: skip
    state = equilibrium(WHEEL, other, DRIVE.load_N, DRIVE.slip)
    there = predict("soil_patch:from=0.4,to=0.6,A=0.3,B=-0.2,C=0.9,D=-0.6,E=0.25,form=place")[inside]
    np.testing.assert_allclose(there[:, TORQUE], state.torque_Nm[inside], rtol=1e-3)
    np.testing.assert_allclose(there[:, SINKAGE], state.sinkage_m[inside], rtol=1e-3)


@pytest.mark.parametrize("form", ["cohesion and shear modulus apart", "by slip, cohesion and shear modulus apart"])
def test_compaction_may_change_cohesion_and_shear_modulus_by_themselves(form):
    """What later passes meet is the soil of the textbook wheel, which the same numbers describe."""
    a, b, c, d = 0.3, -0.2, 0.9, -0.6
    own, worked = "N0=1.5", -np.expm1(-(DRIVE.pass_number - 1.0) / 1.5)
    if form.startswith("by slip"):
        own, again = "i0=0.3,q=0.1", DRIVE.pass_number - 1.0
        worked = np.where(again > 0.0, -np.expm1(-DRIVE.slip_before / 0.3) + 0.1 * again, 0.0)
    away = predict(f"multipass_compaction:form={form},A={a},B={b},C={c},D={d},{own}")
    rows = np.flatnonzero(DRIVE.pass_number > 1.0)[:6]
    assert len(rows)
    for row in (0, *rows):
        s = worked[row]
        soil = Soil(SOIL.c_Pa * math.exp((b + c) * s), math.atan(math.tan(SOIL.phi_rad) * math.exp(b * s)),
                    SOIL.k_m * math.exp(d * s), SOIL.stiffness_Pa * math.exp(a * s), SOIL.n)  # fmt: skip
        state = equilibrium(WHEEL, soil, DRIVE.load_N[row : row + 1], DRIVE.slip[row : row + 1])
        np.testing.assert_allclose(away[row, [TORQUE, SINKAGE]], [state.torque_Nm[0], state.sinkage_m[0]], rtol=1e-3)


@pytest.mark.parametrize("sinks", ["slip_sinkage:form=ratio,p=0.8", "slip_sinkage:n1=0.3"])
@pytest.mark.parametrize("ground", ["soil_patch:form=place,from=0.3,to=0.8,A=0.2,E=0.4", "multipass_compaction:A=0.8"])
def test_effects_of_the_soil_precede_effects_on_it_in_any_order_of_names(sinks, ground):
    together = predict(f"{sinks} + {ground}")
    np.testing.assert_allclose(together, predict(f"{ground} + {sinks}"), rtol=1e-6)
    assert np.abs(together - predict(ground))[:, SINKAGE].max() > 1e-4


def test_all_forms_of_a_patch_start_where_the_ground_seems_to_be_another():
    """A search once ended in an error where a freer form without a start replaced another form."""
    patch = SoilPatch("place", np.linspace(0.0, 5.0, 30), [np.array([0.2, -0.1, 1.0, 2.0])])
    assert [each.form for each in patch.extensions()] == ["place, cohesion apart", "place, another class"]
    for each in (patch, *patch.extensions()):
        (start,) = each.starts()
        assert len(start) == len(each.parameters)
        assert start[:4].tolist() == [0.2, -0.1, 1.0, 2.0]
        assert not start[4:].any()
