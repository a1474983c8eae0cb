"""A drive over several grounds, each with a soil of its own."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.core.track.grounds import Ground
from bevameter.identification.explain.explain import explain
from bevameter.identification.explain.soil_prior import BETWEEN_PLACES, SOIL_PRIOR, precision_about_mean
from ground_drive import CLAY, LOAM, SAND, ground_drive, simulation

GROUNDS = (Ground("sand", 0.0, 20.0), Ground("loam", 20.0, 40.0), Ground("clay", 40.0, 60.0))
SOILS = {"sand": SAND, "loam": LOAM, "clay": CLAY}
FEW = ("slip_sinkage", "torque_offset", "sinkage_offset")


@pytest.fixture(scope="module")
def null():
    return explain(ground_drive(SOILS), grounds=GROUNDS, catalogue=FEW)


def test_nothing_is_found_where_every_ground_has_a_soil_of_its_own(null):
    assert null.verdict == "none"
    assert [each.class_name for each in null.grounds] == list(SOILS)
    assert sum(each.n for each in null.grounds) == null.n


def test_the_soil_of_each_ground_is_within_its_interval(null):
    for ground in null.grounds:
        true = SOILS[ground.class_name]
        for name, value in (("c_Pa", true.c_Pa), ("phi_rad", true.phi_rad), ("n", true.n)):
            estimate = ground.soil[name]
            assert abs(estimate.value - value) < 3.0 * estimate.sd, (ground.class_name, name)


def test_where_there_are_several_soils_none_is_the_soil(null):
    assert null.soil == {}
    assert [each["class"] for each in null.to_json()["grounds"]] == list(SOILS)
    for number, ground in enumerate(null.grounds):
        stored = null.physics_of(number).soil
        assert stored["phi_rad"].value == pytest.approx(ground.soil["phi_rad"].value)


@pytest.fixture(scope="module")
def softened():
    """Sinkage grows with slip on sand only."""
    drive = ground_drive(SOILS, slip_sinkage={"sand": 0.5})
    return explain(drive, grounds=GROUNDS, catalogue=FEW)


def test_physics_of_one_class_is_named_with_the_class(softened):
    assert [each.effect for each in softened.missing] == ["slip_sinkage"]
    assert softened.missing[0].where == "on sand only"
    assert softened.to_json()["missing"][0]["belongs_to"] == "ground"


def test_physics_of_one_class_is_stored_with_that_class_alone(softened):
    effects = [[effect.slug for effect in softened.physics_of(number).effects] for number in range(3)]
    assert effects == [["slip_sinkage"], [], []]


@pytest.fixture(scope="module")
def faulty():
    """The torque sensor of the rear wheel has a wrong zero."""
    drive = ground_drive(
        {"sand": SAND, "loam": LOAM}, seconds=15.0, places=(0.4, -0.4), zeros={"w1": {"torque_Nm": 5.0}}
    )
    grounds = (Ground("sand", 0.0, 15.0), Ground("loam", 15.0, 30.0))
    return explain(drive, grounds=grounds, catalogue=("torque_offset", "sinkage_offset"))


def test_a_fault_of_one_wheel_is_named_with_the_wheel(faulty):
    assert [(each.effect, each.where) for each in faulty.missing] == [("torque_offset", "on w1 only")]
    assert faulty.missing[0].parameters["T_0"].value == pytest.approx(5.0, abs=0.5)


def test_rows_near_a_border_and_on_hard_ground_are_left_out_with_a_reason():
    hard = {"sand": SAND, "asphalt": SAND.__class__(c_Pa=0.0, phi_rad=0.6, k_m=0.01, stiffness_Pa=9e8, n=1.0)}
    grounds = (Ground("sand", 0.0, 20.0), Ground("asphalt", 20.0, 40.0))
    found = explain(ground_drive(hard), grounds=grounds, catalogue=("torque_offset",))
    assert [each.class_name for each in found.grounds] == ["sand"]
    assert any("asphalt" in note and "too hard" in note for note in found.notes)
    assert any("at a change of ground" in note for note in found.notes)


def test_soils_of_one_class_inform_each_other():
    """Their joint prior varies about the mean of the class: its precision is the inverse of that covariance."""
    spread, of_mean = BETWEEN_PLACES["n"], SOIL_PRIOR["n"][1]
    covariance = spread**2 * np.eye(3) + of_mean**2
    np.testing.assert_allclose(precision_about_mean(3, of_mean, spread), np.linalg.inv(covariance), rtol=1e-9)
    flat = precision_about_mean(3, math.inf, spread)
    np.testing.assert_allclose(flat.sum(axis=1), 0.0, atol=1e-9)


def unlabelled(grounds, **options):
    return replace(ground_drive(grounds, **options), labels=None, pose=None)


@pytest.fixture(scope="module")
def divided():
    return explain(unlabelled({"sand": SAND, "clay": CLAY}), catalogue=FEW)


def test_where_nothing_says_what_the_ground_was_its_changes_are_found(divided):
    assert divided.verdict == "none"
    first, second = divided.grounds
    assert first.end_s == pytest.approx(20.0, abs=1.0)
    assert second.start_s == pytest.approx(20.0, abs=1.0)
    for ground, soil in ((first, SAND), (second, CLAY)):
        estimate = ground.soil["phi_rad"]
        assert abs(estimate.value - soil.phi_rad) < 3.0 * estimate.sd
    assert any("soil changes at 20 s" in note for note in divided.notes)


def test_passes_follow_from_the_track_where_nothing_says_what_the_ground_was():
    drive = replace(ground_drive({"sand": SAND}, seconds=15.0, places=(0.4, -0.4)), labels=None)
    found = explain(drive, catalogue=("torque_offset",))
    number = found.rows.variables["pass"]
    assert sorted(np.unique(number)) == [1.0, 2.0]
    assert 0.3 < np.mean(number == 2.0) < 0.5, "the rear wheel begins behind the front one's first place"


@pytest.fixture(scope="module")
def undivided():
    return explain(unlabelled({"sand": SAND}, seconds=40.0, slip_sinkage={"sand": 0.5}), catalogue=FEW)


def test_one_soil_is_not_divided_whatever_is_missing(undivided):
    assert len(undivided.grounds) == 1
    assert [each.effect for each in undivided.missing] == ["slip_sinkage"]


@pytest.mark.slow
def test_another_simulator_is_compared_on_each_ground(tmp_path):
    drive = ground_drive(SOILS, slip_sinkage={"sand": 0.5})
    stiffer = {name: replace(soil, stiffness_Pa=1.2 * soil.stiffness_Pa) for name, soil in SOILS.items()}
    given = simulation(drive, stiffer, tmp_path / "simulated.csv")
    found = explain(drive, simulated=given, grounds=GROUNDS, catalogue=FEW)
    assert [(each.effect, each.where) for each in found.missing] == [("slip_sinkage", "on sand only")]
