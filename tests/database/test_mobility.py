import dataclasses
import math

import numpy as np
import pytest
from bevameter import InputError, Vehicle, Wheel
from bevameter.database.class_draws import DRAWS, soil_draws
from bevameter.database.mobility import SLIPS
from bevameter.database.snapshot import Snapshot
from bevameter.framework.core.soil import PARAMETERS, PLAUSIBLE
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium

SAND, CLAY, DARK, ASPHALT = (0.1, 0.1), (0.6, 0.1), (1.2, 0.1), (-1.3, -0.8)
WHEEL = Wheel(radius_m=0.15, width_m=0.12)
ROVER = Vehicle(wheels=(WHEEL,))


@pytest.fixture(scope="module")
def view(make):
    terrain = make.seen(
        [(0, 0), (1, 0), (2, 0), (-3, -2)],
        [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1 / 3, 1 / 3, 1 / 3], [0.9, 0.05, 0.05]],
        classes=("asphalt", "clay", "sand"),
        unknown=[False, False, True, False],
    )
    soils = tuple(
        make.soil({name: 1.0}, c, t, at_s=10.0 * index)
        for name, c, t in (("clay", 3000.0, 0.4), ("sand", 500.0, 0.6))
        for index in range(40)
    )
    return Snapshot.derive("quarry", [make.drive(terrain=terrain, soils=soils)])


def test_the_pull_is_that_of_the_wheel_on_the_soil(view):
    answer = view.along([SAND, CLAY, DARK, ASPHALT])
    pull = answer.drawbar_pull(ROVER, slip=0.3)
    assert pull.load_N == (80.0,)  # the load under which the soil was identified
    assert pull.known.tolist() == [True, True, False, False]
    assert pull.reason.tolist() == answer.reason.tolist()
    for index, (c_Pa, tan_phi) in enumerate(((500.0, 0.6), (3000.0, 0.4))):
        soil = Soil(c_Pa, math.atan(tan_phi), 0.025, 8e5, 1.0)
        exact = equilibrium(WHEEL, soil, np.array([80.0]), np.array([0.3])).drawbar_pull_N[0]
        assert pull.mean[index] == pytest.approx(exact, abs=1.5)
        assert pull.lower[index] < pull.mean[index]
    assert np.all(np.isnan(pull.mean[2:]))
    assert np.all(np.isnan(pull.lower[2:]))


def test_the_bound_follows_the_confidence_and_repeats(view):
    bounds = [view.along([SAND], confidence=p).drawbar_pull(ROVER, slip=0.3).lower[0] for p in (0.6, 0.8, 0.95)]
    assert bounds[0] > bounds[1] > bounds[2]
    assert view.along([SAND]).drawbar_pull(ROVER, slip=0.3).lower[0] == bounds[2]


def test_wheels_add_up(view):
    four = Vehicle(wheels=tuple(WHEEL.model_copy(update={"name": name}) for name in "abcd"))
    answer = view.along([SAND])
    one = answer.drawbar_pull(ROVER, slip=0.2, load_N=60.0)
    assert answer.drawbar_pull(four, slip=0.2, load_N=60.0).mean == pytest.approx(4 * one.mean)
    uneven = answer.drawbar_pull(four, slip=0.2, load_N=[60.0, 60.0, 30.0, 30.0])
    other = answer.drawbar_pull(ROVER, slip=0.2, load_N=30.0)
    assert uneven.mean == pytest.approx(2 * one.mean + 2 * other.mean)


def test_mobility(view):
    answer = view.along([SAND, CLAY, DARK])
    able = answer.mobility(ROVER)
    assert able.known.tolist() == [True, True, False]
    assert np.all(able.go_probability[:2] > 0.95)
    assert np.all(np.isin(able.best_slip[:2], SLIPS))
    assert np.all(np.isnan(able.best_slip[2:]))
    for index, place in enumerate((SAND, CLAY)):
        at_best = view.along([place]).drawbar_pull(ROVER, slip=float(able.best_slip[index]))
        assert able.drawbar_pull_lower[index] == pytest.approx(at_best.lower[0])
    np.testing.assert_allclose(np.sin(able.slope_lower[:2]) * 80.0, able.drawbar_pull_lower[:2])


def test_ground_that_swallows_the_wheel_does_not_carry_it(view, make):
    mud = dataclasses.replace(make.estimate(50.0, 0.05))
    soft = {**mud.parameters, "stiffness_Pa": dataclasses.replace(mud.parameters["stiffness_Pa"], value=200.0, sd=10.0)}
    soils = (dataclasses.replace(make.soil({"clay": 1.0}), estimate=dataclasses.replace(mud, parameters=soft)),) * 5
    terrain = make.seen([(0, 0)], [[1.0, 0.0]])
    answer = Snapshot.derive("q", [make.drive(terrain=terrain, soils=soils)]).at(0.1, 0.1)
    assert answer.drawbar_pull(ROVER, slip=0.2, load_N=500.0).lower[0] == -math.inf
    assert answer.mobility(ROVER, load_N=500.0).go_probability[0] < 0.1


def test_without_the_other_parameters_there_is_no_prediction(make):
    estimate = make.estimate()
    bare = dataclasses.replace(
        estimate, parameters={name: value for name, value in estimate.parameters.items() if name != "k_m"}
    )
    soils = (dataclasses.replace(make.soil({"sand": 1.0}), estimate=bare),)
    terrain = make.seen([(0, 0)], [[0.0, 1.0]])
    answer = Snapshot.derive("q", [make.drive(terrain=terrain, soils=soils)]).at(0.1, 0.1)
    assert answer.known[0]  # the strength is known
    pull = answer.drawbar_pull(ROVER, slip=0.2)
    assert (pull.known[0], pull.reason[0]) == (False, "no shear modulus k known of class sand")
    assert math.isnan(answer.mobility(ROVER).go_probability[0])


def test_draws_are_soils_with_the_classes_spread(view):
    draws = soil_draws(view.soils["sand"])
    low, high = np.array([PLAUSIBLE[name] for name in PARAMETERS]).T
    assert draws.shape == (DRAWS, 5)
    assert np.all((draws >= low) & (draws <= high))
    strength = view.soils["sand"].strength
    np.testing.assert_allclose(draws[:, 0].mean(), strength.mean[0], rtol=0.03)
    freedom = strength.predict(np.array([1.0, 17.5e3]))[2]
    student_sd = math.sqrt(strength.predictive_covariance[0, 0] * freedom / (freedom - 2.0))
    np.testing.assert_allclose(draws[:, 0].std(), student_sd, rtol=0.1)
    np.testing.assert_allclose(np.median(draws[:, 2]), 0.025, rtol=0.03)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"slip": 1.0}, "slip"),
        ({"slip": math.nan}, "slip"),
        ({"slip": 0.2, "load_N": -5.0}, "positive"),
        ({"slip": 0.2, "load_N": [1.0, 2.0]}, "2 numbers"),
    ],
)
def test_questions_that_make_no_sense(view, options, said):
    with pytest.raises(InputError, match=said):
        view.along([SAND]).drawbar_pull(ROVER, **options)


def test_a_load_must_be_known(make):
    soils = (dataclasses.replace(make.soil({"sand": 1.0}), load_N=math.nan),)
    answer = Snapshot.derive("q", [make.drive(soils=soils)]).at(0.1, 0.1)
    with pytest.raises(InputError, match="none"):
        answer.drawbar_pull(ROVER, slip=0.2)
