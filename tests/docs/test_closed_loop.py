"""The closed loop: what is learnt slowly holds when driven fast, on the true ground of a synthetic site."""

from __future__ import annotations

import math

import closed_loop as script
import numpy as np
import pytest
from bevameter.database.speed import curvature_of
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.mechanics import soil as estimator
from bevameter.identification.mechanics.textbook import equilibrium
from proving_ground.driving import ARRIVED, IMMOBILISED, ride, stopping_m
from proving_ground.learn import learn
from proving_ground.planners import (
    REACTION_S,
    SIGHT_M,
    by_database,
    by_one_soil,
    by_truth,
    cells_along,
    draw_pairs,
    plan,
)
from proving_ground.score import Share, score, table
from proving_ground.site import CELLS, CLASSES, VEHICLE, make_site, vehicle_forces
from scipy.constants import g


@pytest.fixture(scope="module")
def site():
    return make_site(np.random.default_rng(3))


def test_true_forces_are_those_of_the_wheels(site):
    """Against the estimator's mechanics, which are other code."""
    for number in (0, 20, 40):
        soil = site.soils[number]
        same = estimator.Soil(soil.c_Pa, soil.phi_rad, soil.k_m, soil.stiffness_Pa, soil.n)
        pull = 0.0
        for load in (630.0, 710.0):
            slips = np.linspace(0.05, 0.85, 33)
            pull = pull + 2.0 * equilibrium(VEHICLE.wheels[0], same, np.full(33, load), slips).drawbar_pull_N
        found = vehicle_forces(soil, np.ones(1)).ravel()
        assert found[0] == pytest.approx(g * pull.max() / 2680.0, rel=0.02, abs=0.02)
        own = site.acceleration[site.patch == number]
        assert own.min() - 0.1 < found[0] < own.max() + 0.1
    assert isinstance(VEHICLE.wheels[0], Wheel)
    assert 0.02 < np.mean(site.acceleration < 0.0) < 0.15, "some of the ground immobilises"


def test_stops_on_the_straight_and_in_a_curve():
    speed, places = 5.0, 400
    straight = stopping_m(
        np.full(places, speed), np.full(places, 4.0), np.full(places, 5.0), np.zeros(places), np.full(places - 1, 0.25)
    )
    assert straight == pytest.approx(speed * REACTION_S + speed**2 / 8.0)
    bend = np.full(places, 0.15)
    curved = stopping_m(
        np.full(places, speed), np.full(places, 4.0), np.full(places, 5.0), bend, np.full(places - 1, 0.25)
    )
    square, way = speed**2, speed * REACTION_S
    while square > 0.0:
        square, way = square - 2e-3 * 4.0 * math.sqrt(1.0 - (0.15 * square / 5.0) ** 2), way + 1e-3
    assert curved == pytest.approx(way, abs=0.01)
    held = np.full(places, 3.7)
    assert stopping_m(np.full(places, speed), held, held, bend, np.full(places - 1, 0.25)) == math.inf


def test_who_knows_the_truth_arrives_and_stops_in_time_and_who_knows_nothing_is_immobilised(site):
    rng = np.random.default_rng(4)
    pairs = draw_pairs(site, rng, 25, np.ones(CELLS**2, dtype=bool))
    rides = {}
    for planner in (by_truth("truth", site), by_one_soil("one soil")):
        routes = plan(planner, pairs)
        for route in routes:
            assert route is not None
            assert cells_along(route.path)[[0, -1]].tolist() in pairs.tolist()
            np.testing.assert_allclose(route.bend, curvature_of(route.path))
        rides[planner.name] = [ride(site, planner, route, rng) for route in routes]
    found = score("truth", [rides["truth"]], [rides["truth"]], [np.arange(5)])
    assert found.outcomes[ARRIVED].value == 1.0
    assert found.longer.value == found.unseen.value == 0.0
    assert found.longer.count == 100
    assert {share.value for share in found.bounds} == {1.0}
    assert found.fresh.value == 1.0
    assert 0 < found.fresh.count < found.bounds[0].count
    assert found.time_ratio == (1.0, 1.0, 1.0, 25)
    blind = score("one soil", [rides["one soil"]], [rides["truth"]], [np.arange(5)])
    assert blind.outcomes[IMMOBILISED].value > 0.1
    assert blind.longer.value > 0.1
    assert min(share.value for share in blind.bounds) < 0.9
    assert table([found, blind]).count("\n| one soil |") == 2


def test_intervals_are_wilsons():
    share = Share.of(np.arange(200) < 190)
    shrink = 1.0 + 1.96**2 / 200
    centre, half = (0.95 + 1.96**2 / 400) / shrink, 1.96 * math.sqrt(0.95 * 0.05 / 200 + 1.96**2 / 400**2) / shrink
    assert (share.low, share.high) == pytest.approx((centre - half, centre + half), abs=1e-5)
    assert str(Share.of(np.zeros(0, dtype=bool))) == "none"


@pytest.mark.slow
def test_bounds_of_what_was_learnt_hold(site, tmp_path):
    """Of one site, so that a rate says little: nearly all bounds hold, and nobody is immobilised on known ground."""
    rng = np.random.default_rng(5)
    learnt = learn(site, rng, 6)
    assert 0.9 < learnt.right < 1.0
    used = [one for one in learnt.drive.soils if one.estimate is not None]
    assert len(used) >= 25
    planner = by_database("database", learnt.snapshot(tmp_path))
    known = planner.ground.known
    assert 0.8 < known.mean() < 0.98
    for bound, true in (
        (planner.ground.acceleration_lower, site.acceleration),
        (planner.ground.braking_lower, site.braking),
        (planner.ground.side_lower, site.side),
    ):
        assert np.mean(true.ravel()[known] >= bound[known]) > 0.93
    few = by_database("few", learnt.snapshot(tmp_path, 2))
    assert np.nanmean(few.ground.braking_lower[known]) < np.nanmean(planner.ground.braking_lower[known])
    pairs = draw_pairs(site, rng, 10, known)
    rides = [ride(site, planner, route, rng) for route in plan(planner, pairs)]
    stops = [stop for one in rides for stop in one.stops]
    assert np.mean([stop.achieved <= stop.predicted for stop in stops]) > 0.93
    assert max(stop.achieved for stop in stops) <= SIGHT_M
    assert sum(one.outcome == ARRIVED for one in rides) >= 7


@pytest.mark.slow
def test_the_script_draws_its_picture(tmp_path):
    found, text = script.main(tmp_path / "out.png", routes=4, sites=1, stretches=3)
    scores = {one.name: one for one in found}
    assert text.count("\n\n") == 2
    assert (tmp_path / "out.png").stat().st_size > 10_000
    assert scores[script.TRUTH].outcomes[ARRIVED].value == 1.0
    assert set(script.COLOURS) == set(CLASSES)
