"""What the ground bears of acceleration, braking and side force, and the speed that this allows."""

import math

import numpy as np
import pytest
from bevameter import InputError, Vehicle, Wheel
from bevameter.database.snapshot import Snapshot
from bevameter.database.speed import AHEAD, CURVE, SIGHT, STUCK, VEHICLE, speed_limit_of_each
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from scipy.constants import g

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
ROVER = Vehicle(wheels=(WHEEL,))
SAND, CLAY, MUD, DARK = "sand", "clay", "mud", "dark"
SOILS = {SAND: (500.0, 0.6), CLAY: (3000.0, 0.4), MUD: (0.0, 0.15)}


@pytest.fixture(scope="module")
def view(make):
    """Lanes of 2 m along x, each of one ground: sand, clay, mud, and ground that nobody recognised."""
    cells = [(x, lane) for lane in range(4) for x in range(-20, 60)]
    names = list(SOILS)
    belief = [[float(name == names[min(lane, 2)]) for name in sorted(names)] for _, lane in cells]
    terrain = make.seen(
        cells, belief, classes=tuple(sorted(names)), unknown=[lane == 3 for _, lane in cells], cell_size_m=2.0
    )
    soils = tuple(
        make.soil({name: 1.0}, c + 5.0 * index, t, at_s=10.0 * index)
        for name, (c, t) in SOILS.items()
        for index in range(30)
    )
    return Snapshot.derive("quarry", [make.drive(terrain=terrain, soils=soils)])


def lane(name: str, x: np.ndarray) -> np.ndarray:
    return np.column_stack([x, np.full(len(x), 1.0 + 2.0 * [SAND, CLAY, MUD, DARK].index(name))])


def test_forces_are_those_of_the_wheel_on_the_soil(view):
    answer = view.along([(1.0, 1.0), (1.0, 3.0)])
    found = answer.traction(ROVER, load_N=80.0)
    for at, name in enumerate((SAND, CLAY)):
        soil = Soil(SOILS[name][0] + 75.0, math.atan(SOILS[name][1]), 0.025, 8e5, 1.0)
        slips = np.linspace(0.05, 0.8, 16)
        pull = equilibrium(WHEEL, soil, np.full(16, 80.0), slips).drawbar_pull_N
        assert found.acceleration[at] == pytest.approx(g * pull.max() / 80.0, rel=0.05)
        state = equilibrium(WHEEL, soil, np.array([80.0]), np.array([0.15]))
        length = math.sqrt(0.15**2 - (0.15 - state.sinkage_m[0]) ** 2)
        thrust = soil.c_Pa * 0.12 * length + 80.0 * math.tan(soil.phi_rad)
        assert found.side[at] == pytest.approx(g * thrust / 80.0, rel=0.03)
        assert found.braking[at] <= found.side[at] * 1.03, "no more than the patch bears"
    for name in ("acceleration", "braking", "side"):
        assert np.all(getattr(found, f"{name}_lower") < getattr(found, name))


@pytest.mark.parametrize("pitch", [0.15, -0.35])
def test_on_a_slope_the_wheels_carry_less(view, pitch):
    answer = view.along([(1.0, 1.0), (1.0, 3.0), (1.0, 5.0)])
    found = answer.traction(ROVER, pitch=pitch, load_N=80.0)
    lighter = answer.traction(ROVER, load_N=80.0 * math.cos(pitch))  # its accelerations are of the smaller mass
    for name, against in (("acceleration", math.sin(pitch)), ("braking", -math.sin(pitch))):
        for end in ("", "_lower"):
            direct = math.cos(pitch) * getattr(lighter, name + end) - g * against
            np.testing.assert_allclose(getattr(found, name + end), direct, atol=0.01)
    mixed = answer.traction(ROVER, pitch=[0.0, pitch, 0.0], load_N=80.0)
    level = answer.traction(ROVER, load_N=80.0)
    np.testing.assert_allclose(mixed.side[[0, 2]], level.side[[0, 2]])
    np.testing.assert_allclose(mixed.braking_lower[1], found.braking_lower[1])
    aside = answer.traction(ROVER, roll=-0.2, load_N=80.0)
    np.testing.assert_allclose(
        aside.side,
        math.cos(0.2) * answer.traction(ROVER, load_N=80.0 * math.cos(0.2)).side - g * math.sin(0.2),
        atol=0.01,
    )


def test_on_a_straight_path_the_vehicle_can_stop_within_what_it_sees(view):
    answer = view.along(lane(SAND, np.linspace(0.0, 50.0, 101)))
    braking = answer.traction(ROVER).braking_lower[0]
    found = answer.speed_limit(ROVER, sight_m=8.0, most_m_s=50.0)
    np.testing.assert_allclose(found.limit_m_s, math.sqrt(2.0 * braking * 8.0))
    assert set(found.reason) == {SIGHT}
    late = answer.speed_limit(ROVER, sight_m=8.0, most_m_s=50.0, reaction_s=0.5).limit_m_s
    np.testing.assert_allclose(late * 0.5 + late**2 / (2.0 * braking), 8.0)
    slow = answer.speed_limit(ROVER, sight_m=8.0, most_m_s=2.0)
    assert slow.limit_m_s.tolist() == [2.0] * 101
    assert set(slow.reason) == {VEHICLE}


def test_in_a_curve_the_ground_holds_the_vehicle(view):
    angle = np.linspace(0.0, 1.0, 60)
    path = np.column_stack([40.0 + 0.9 * np.sin(angle), 1.9 - 0.9 * np.cos(angle)])
    answer = view.along(path)
    side = answer.traction(ROVER).side_lower[0]
    found = answer.speed_limit(ROVER, sight_m=100.0, most_m_s=50.0)
    np.testing.assert_allclose(found.limit_m_s, math.sqrt(side * 0.9), rtol=1e-3)
    assert set(found.reason) == {CURVE}
    given = answer.speed_limit(ROVER, sight_m=100.0, most_m_s=50.0, curvature=np.full(60, -0.5))
    np.testing.assert_allclose(given.limit_m_s, math.sqrt(side / 0.5))


def test_in_a_curve_it_stops_within_what_it_sees_by_what_side_force_leaves(view):
    """Braking in steps of 1 mm along the curve, from the limit: the vehicle stands after the distance seen."""
    path = lane(SAND, np.linspace(0.0, 50.0, 501))
    answer = view.along(path)
    bend, ground = np.full(501, 0.1), answer.traction(ROVER)
    braking, side = ground.braking_lower[0], ground.side_lower[0]
    for reaction in (0.0, 0.4):
        found = answer.speed_limit(ROVER, sight_m=4.0, most_m_s=50.0, reaction_s=reaction, curvature=bend)
        assert set(found.reason) == {SIGHT}
        speed = found.limit_m_s[0]
        assert speed**2 * 0.1 < side
        square, way = speed**2, speed * reaction
        while square > 0.0:
            square -= 2.0 * braking * math.sqrt(1.0 - (0.1 * square / side) ** 2) * 1e-3
            way += 1e-3
        assert way == pytest.approx(4.0, rel=1e-3)
        straight = answer.speed_limit(ROVER, sight_m=4.0, most_m_s=50.0, reaction_s=reaction, curvature=np.zeros(501))
        assert speed < straight.limit_m_s[0] - 0.01


def test_ground_within_sight_counts_for_its_own_part_of_the_way(view):
    path = np.concatenate([lane(SAND, np.linspace(0.0, 20.0, 81)), lane(CLAY, np.linspace(20.25, 40.0, 80))])
    answer = view.along(path)
    found = answer.speed_limit(ROVER, sight_m=6.0, most_m_s=50.0, curvature=np.zeros(len(path))).limit_m_s
    sand, clay = (answer.traction(ROVER).braking_lower[[0, -1]]).tolist()
    at = 72  # 2 m before the last place of sand
    on_sand, weaker = (2.0, 4.0) if clay <= sand else (2.25, 3.75)
    np.testing.assert_allclose(found[at], math.sqrt(2.0 * (sand * on_sand + clay * weaker)))
    np.testing.assert_allclose(found[0], math.sqrt(2.0 * sand * 6.0))
    unknown = np.concatenate([path[:81], lane(DARK, np.linspace(20.25, 22.0, 8))])
    slow = view.along(unknown).speed_limit(
        ROVER, sight_m=6.0, most_m_s=50.0, unknown_m_s=0.5, curvature=np.zeros(len(unknown))
    )
    np.testing.assert_allclose(slow.limit_m_s[at] ** 2, slow.limit_m_s[80] ** 2 + 2.0 * sand * 2.0)
    assert slow.limit_m_s[80:].tolist() == [0.5] * 9
    assert set(slow.reason[57:81]) == {AHEAD}


def test_it_slows_down_for_unknown_ground_and_for_ground_that_may_not_carry_it_on(view):
    for name, limit, why in ((DARK, 0.5, "seen, but not recognised"), (MUD, 0.0, STUCK)):
        path = np.concatenate([lane(CLAY, np.linspace(0.0, 20.0, 81)), lane(name, np.linspace(20.25, 30.0, 40))])
        answer = view.along(path)
        braking = answer.traction(ROVER).braking_lower[0]
        found = answer.speed_limit(ROVER, sight_m=100.0, most_m_s=6.0, unknown_m_s=0.5, curvature=np.zeros(len(path)))
        assert found.limit_m_s[81:].tolist() == [limit] * 40
        assert set(found.reason[81:]) == {why}
        before = np.flatnonzero(found.reason == AHEAD)
        assert np.array_equal(before, np.arange(before[0], 81))
        # Nothing is promised of braking on the step to the other ground.
        speed, way = found.limit_m_s[before], 20.0 - path[before, 0]
        weaker = braking if name == DARK else min(braking, answer.traction(ROVER).braking_lower[-1])
        assert weaker > 0.0
        np.testing.assert_allclose(speed[:-1] ** 2, speed[-1] ** 2 + 2.0 * braking * way[:-1])
        assert set(found.reason[: before[0]]) == {VEHICLE}


def test_paths_as_they_come(view):
    """Places repeated where two segments meet, a place that is no number, a path that turns back, no path at all."""
    corner = np.array([(5.0, 1.0), (6.0, 1.0), (7.0, 1.0), (7.0, 1.9), (7.0, 1.95)])
    repeated = corner[[0, 1, 2, 2, 3, 4]]
    limits = [view.along(path).speed_limit(ROVER, sight_m=50.0, most_m_s=8.0).limit_m_s for path in (corner, repeated)]
    np.testing.assert_allclose(limits[1], limits[0][[0, 1, 2, 2, 3, 4]])
    assert limits[0][2] < 4.0
    path = lane(SAND, np.linspace(0.0, 10.0, 11))
    path[5] = math.nan
    found = view.along(path).speed_limit(ROVER, sight_m=50.0, most_m_s=8.0)
    assert found.limit_m_s[[4, 5]].tolist() == [0.0, 0.0]
    assert found.reason[[4, 5]].tolist() == [AHEAD, "the place is not a finite number"]
    there_and_back = lane(SAND, np.concatenate([np.arange(1.0, 11.0), np.arange(9.0, 1.0, -1.0)]))
    found = view.along(there_and_back).speed_limit(ROVER, sight_m=50.0, most_m_s=8.0)
    assert (found.limit_m_s[9], found.reason[9]) == (0.0, CURVE)
    assert found.limit_m_s[[0, 17]].min() > 1.0
    nowhere = view.along(np.zeros((0, 2)))
    assert len(nowhere.speed_limit(ROVER, sight_m=5.0, most_m_s=8.0).limit_m_s) == 0
    endless = view.along(lane(SAND, np.arange(9.0))).speed_limit(ROVER, sight_m=math.inf, most_m_s=math.inf)
    assert np.isinf(endless.limit_m_s).all()


def test_a_load_that_level_ground_does_not_carry(view):
    answer = view.along([(1.0, 1.0)])
    least = math.acos(0.9)
    found = answer.traction(ROVER, pitch=least, load_N=40_000.0)
    assert found.acceleration_lower.tolist() == [-math.inf]


def test_age_makes_no_ground_known(make):
    """Spread over all classes, that whose soil is lacking weighs less."""
    names = tuple(f"class {letter}" for letter in "abcd")
    terrain = make.seen([(0, 0)], [[0.9, 0.05, 0.03, 0.02]], classes=names)
    soils = tuple(make.soil({name: 1.0}) for name in names[1:])
    view = Snapshot.derive("quarry", [make.drive(terrain=terrain, soils=soils)])
    old = view.at(0.1, 0.1, confidence=0.6, half_life=86400.0, now=4e9)
    assert (old.known.tolist(), old.reason.tolist()) == ([False], ["no soil data for class class a"])
    assert np.isnan(old.shear_strength[0])
    assert np.isnan(old.drawbar_pull(ROVER, 0.2).lower[0])
    assert old.speed_limit(ROVER, sight_m=5.0, most_m_s=3.0).limit_m_s.tolist() == [0.0]


def test_braking_in_a_curve_is_what_side_force_leaves(view):
    """The friction ellipse: from a limit ahead back along a curve, speeds rise more slowly than on the straight."""
    path = np.concatenate([lane(CLAY, np.linspace(0.0, 20.0, 81)), lane(MUD, np.linspace(20.25, 22.0, 8))])
    answer = view.along(path)
    straight, curved = (
        answer.speed_limit(ROVER, sight_m=100.0, most_m_s=9.0, curvature=np.full(len(path), bend))
        for bend in (0.0, 0.1)
    )
    slower = straight.limit_m_s - curved.limit_m_s
    assert np.all(slower >= 0.0)
    assert slower[:81].max() > 0.2
    ground = answer.traction(ROVER)
    square = curved.limit_m_s[:81] ** 2
    along, middle = 0.5 * np.abs(np.diff(square)) / 0.25, 0.5 * (square[1:] + square[:-1])
    share = (along / ground.braking_lower[:80]) ** 2 + (0.1 * middle / ground.side_lower[:80]) ** 2
    assert share.max() < 1.001, "but for the step"
    assert share[np.flatnonzero(curved.reason == AHEAD)[0] : 80].min() > 0.999


def test_more_confidence_than_the_draws_can_bear(view):
    with pytest.raises(InputError, match=r"confidence: 0\.999 .expected at most 0\.9961 for what wheels do"):
        view.along([(1.0, 1.0)], confidence=0.999).traction(ROVER)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"sight_m": -1.0}, "sight_m: -1.0 .expected a number, not negative"),
        ({"most_m_s": math.nan}, "most_m_s: nan"),
        ({"unknown_m_s": "slow"}, "unknown_m_s: 'slow'"),
        ({"reaction_s": math.inf}, "reaction_s: inf .expected a finite time"),
        ({"curvature": [0.0]}, "curvature: 1 numbers"),
        ({"pitch": 2.0}, "pitch: 2 .expected a slope within"),
        ({"roll": [0.1, 0.1]}, "roll: 2 numbers"),
    ],
)
def test_questions_that_make_no_sense(view, options, said):
    answer = view.along(lane(SAND, np.linspace(0.0, 5.0, 11)))
    with pytest.raises(InputError, match=said):
        answer.speed_limit(ROVER, **{"sight_m": 5.0, "most_m_s": 3.0, **options})


def test_the_limit_of_each_place_is_that_of_a_long_straight_path_over_its_like(view):
    x = np.arange(-30.0, 100.0, 0.5)
    rest = {"sight_m": 6.0, "most_m_s": 8.0, "reaction_s": 0.3, "load_N": 80.0}
    places = np.array([lane(name, np.array([5.0]))[0] for name in (SAND, CLAY, MUD, DARK)])
    found = speed_limit_of_each(view.along(places), ROVER, **rest)
    for at, name in enumerate((SAND, CLAY, MUD)):
        path = view.along(lane(name, x)).speed_limit(ROVER, **rest)
        middle = len(x) // 2
        assert found.limit_m_s[at] == pytest.approx(path.limit_m_s[middle], rel=1e-6)
        assert found.reason[at] == path.reason[middle]
    assert np.isnan(found.limit_m_s[3])
    assert "not recognised" in found.reason[3]
    reversed_ = speed_limit_of_each(view.along(places[::-1]), ROVER, **rest)
    np.testing.assert_array_equal(found.limit_m_s[::-1], reversed_.limit_m_s)  # no place counts for another
    with pytest.raises(InputError, match="sight_m"):
        speed_limit_of_each(view.along(places), ROVER, sight_m=math.inf, most_m_s=8.0)
