"""Where a patch of other soil is looked for: all pairs of edges weighed at once."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bevameter import Vehicle, Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.effects.soil_patch import CELLS, SoilPatch
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.fit.places import _gains, stretches_apart
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import ASKED_FOR, situation, textbook_trial, try_adding
from bevameter.identification.mismatch.locate.regions import locate
from bevameter.identification.mismatch.name.asked import is_bump
from bevameter.identification.mismatch.name.naming import name, why_not
from bevameter.identification.mismatch.name.search import search
from bevameter.identification.mismatch.name.tries import Search

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
SOIL = Soil(c_Pa=800.0, phi_rad=math.radians(31.0), k_m=0.012, stiffness_Pa=2.5e5, n=0.95)
ROWS, LENGTH_M = 600, 12.0
FROM_M, TO_M = 4.1, 7.3


def smooth(rng, spread: float, length_m: float) -> np.ndarray:
    """Ground that rises and falls smoothly along the track, (n,)."""
    cell = LENGTH_M / ROWS
    window = np.exp(-0.5 * (np.arange(-4.0 * length_m, 4.0 * length_m, cell) / length_m) ** 2)
    ground = np.convolve(rng.normal(size=ROWS + len(window) - 1), window, mode="valid")
    return spread * ground / float(np.linalg.norm(window))


def crossed(
    stiffer: float, variation: float, seed: int = 1, memory_m: float = 1.5, cohesive: float = 0.0,
    smooth_m: float = 0.0, noise: float = 0.01, offset_Nm: float = 0.0, began_m: float = 0.0, legs: int = 1,
    beside_m: float = 1.0,
):  # fmt: skip
    """Problem and textbook trial of a drive over ground that varies by itself, another over one stretch; to and fro on
    parallel legs, of which it lies across all.
    """
    rng = np.random.default_rng(seed)
    way_m = np.linspace(0.0, legs * LENGTH_M, ROWS)
    place_m = LENGTH_M - np.abs(way_m % (2.0 * LENGTH_M) - LENGTH_M)
    keep = math.exp(-legs * LENGTH_M / ROWS / memory_m)
    ground = smooth(rng, variation, smooth_m) if smooth_m else np.zeros(ROWS)
    for row in range(1, 0 if smooth_m else ROWS):
        ground[row] = keep * ground[row - 1] + math.sqrt(1.0 - keep**2) * variation * rng.normal()
    there = (place_m > FROM_M) & (place_m < TO_M)
    ground += stiffer * there
    cohesion_Pa = SOIL.c_Pa * np.exp(cohesive * there)
    load = 90.0 + 40.0 * np.sin(1.7 * way_m) + 15.0 * np.sin(4.3 * way_m)
    slip = 0.3 + 0.18 * np.sin(2.9 * way_m) + 0.08 * np.sin(6.1 * way_m)
    states = [
        equilibrium(WHEEL, replace(SOIL, c_Pa=c_Pa, stiffness_Pa=SOIL.stiffness_Pa * math.exp(each)), *imposed)
        for each, c_Pa, *imposed in zip(ground, cohesion_Pa, load, slip, strict=True)
    ]
    answers = np.array([(state.torque_Nm, state.sinkage_m, state.drawbar_pull_N) for state in states]).reshape(ROWS, 3)
    answers += noise * np.ptp(answers, axis=0) * rng.normal(size=answers.shape)
    answers[:, 0] += offset_Nm
    columns = {
        "time_s": 0.1 * np.arange(ROWS), "x_m": began_m + place_m, "y_m": beside_m * np.floor(way_m / LENGTH_M),
        "load_N": load + 0.5 * rng.normal(size=ROWS),
        "slip": slip + 0.002 * rng.normal(size=ROWS),
        **dict(zip(("torque_Nm", "sinkage_m", "drawbar_pull_N"), answers.T, strict=True)),
    }  # fmt: skip
    table = WheelTable(columns, None, None, "made")
    return textbook_trial(gather(table, WHEEL, Vehicle(name="made", wheels=(WHEEL,))))


@pytest.fixture(scope="module")
def small_patch():
    """A stretch that differs by three times as much as the ground varies anyway."""
    return crossed(stiffer=0.12, variation=0.04)


def test_a_stretch_is_seen_in_ground_that_varies_anyway(small_patch):
    problem, textbook = small_patch
    starts = stretches_apart(problem, textbook.fitted)["place_m"]
    away = [max(abs(start[2] - FROM_M), abs(start[3] - TO_M)) for start in starts]
    assert min(away) < 2.0 * LENGTH_M / CELLS
    assert starts[int(np.argmin(away))][0] > 0.0


def test_and_is_found_where_it_is(small_patch):
    problem, textbook = small_patch
    (patch,) = effects_for(situation(problem, textbook.fitted), ["soil_patch"])
    trial = try_adding(problem, textbook, textbook, patch)
    stiffer, _, start, end = trial.fitted.vector[5:]
    assert stiffer == pytest.approx(0.12, abs=0.05)
    assert start == pytest.approx(FROM_M, abs=0.05)
    assert end == pytest.approx(TO_M, abs=0.05)
    assert trial.gain > 12.0
    assert trial.sharp > 12.0


@pytest.mark.parametrize(("cohesive", "seed"), [(0.0, 1), (0.0, 2), (0.0, 3), (1.0, 1)])
def test_cohesion_apart_from_friction_is_told(cohesive, seed):
    problem, textbook = crossed(stiffer=0.12, variation=0.02, cohesive=cohesive, seed=seed)
    (patch,) = effects_for(situation(problem, textbook.fitted), ["soil_patch"])
    trial = try_adding(problem, textbook, textbook, patch)
    (found,) = trial.effects
    assert ("cohesion apart" in found.form) == bool(cohesive)
    if cohesive:
        sd = np.sqrt(np.diag(trial.fitted.covariance))
        stronger, more = trial.fitted.vector[[6, 9]]
        assert stronger == pytest.approx(0.0, abs=3.0 * sd[6])
        assert stronger + more == pytest.approx(cohesive, abs=3.0 * sd[9])


def test_and_is_told_from_edge_to_edge(small_patch):
    problem, textbook = small_patch
    (patch,) = effects_for(situation(problem, textbook.fitted), ["soil_patch"])
    region = locate(problem, try_adding(problem, textbook, textbook, patch).fitted)[0]
    assert region.variable == "x_m"
    assert region.start == pytest.approx(FROM_M, abs=0.05)
    assert region.end == pytest.approx(TO_M, abs=0.05)


@pytest.mark.parametrize(("beside_m", "along", "found"), [(1.0, {"place", "x", "y"}, "x"), (4.0, {"place"}, "place")])
def test_a_strip_across_the_legs_of_a_drive_is_one_place(beside_m, along, found):
    """Legs of one drive that turns, and such as the wheel was lifted over to: these are straight lanes."""
    problem, textbook = crossed(stiffer=0.15, variation=0.03, legs=4, beside_m=beside_m)
    forms = {form.form: form for form in effects_for(situation(problem, textbook.fitted), ["soil_patch"])}
    assert set(forms) == along
    trials = {form: try_adding(problem, textbook, textbook, patch) for form, patch in forms.items()}
    best = max(trials.values(), key=lambda trial: trial.gain)
    assert best is trials[found]
    assert best.gain > 12.0
    assert not best.held_out.untested, "each leg foretells the others"
    regions = [region for region in locate(problem, best.fitted) if region.variable == "x_m"]
    assert regions[0].start == pytest.approx(FROM_M, abs=0.1)
    assert regions[0].end == pytest.approx(TO_M, abs=0.1)


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_ground_that_only_varies_has_no_place_of_its_own(seed):
    problem, textbook = crossed(stiffer=0.0, variation=0.06, seed=seed)
    (patch,) = effects_for(situation(problem, textbook.fitted), ["soil_patch"])
    assert try_adding(problem, textbook, textbook, patch).gain < 12.0


@pytest.mark.parametrize("seed", [4, 5])
def test_a_smooth_rise_of_ground_that_varies_is_no_place(seed):
    problem, textbook = crossed(stiffer=0.0, variation=0.06, seed=seed, smooth_m=0.7, noise=0.002)
    assert textbook.fitted.noise.smooth > 0
    effects = effects_for(situation(problem, textbook.fitted), ["soil_patch"])
    found = search(problem, textbook, effects)
    assert not found.chosen.effects
    assert max((trial.gain for trial in found.trials), default=0.0) < ASKED_FOR


def test_what_no_edge_tells_is_no_place_whatever_it_gains():
    """Held to vary roughly, the same ground of three passes had a patch that gained 45 nats, told by no edge."""
    problem, textbook = crossed(stiffer=0.0, variation=0.06, seed=4, smooth_m=0.7, noise=0.002)
    effects = effects_for(situation(problem, textbook.fitted), ["soil_patch"])
    trial = replace(try_adding(problem, textbook, textbook, *effects), gain=45.0, sharp=0.0)
    assert is_bump(textbook, trial)
    assert "no edge" in why_not(trial, Search(textbook, (trial,), (), textbook), 1.0)
    edged = replace(trial, sharp=20.0)
    assert not is_bump(textbook, edged)
    assert "no edge" not in why_not(edged, Search(textbook, (edged,), (), textbook), 1.0)


@pytest.mark.parametrize("seed", [4, 5])
@pytest.mark.parametrize("offset_Nm", [0.007, 0.03])
def test_nor_is_it_one_beside_another_cause(seed, offset_Nm):
    problem, textbook = crossed(stiffer=0.0, variation=0.06, seed=seed, smooth_m=0.7, noise=0.002, offset_Nm=offset_Nm)
    effects = effects_for(situation(problem, textbook.fitted), ["soil_patch", "torque_offset"])
    found = search(problem, textbook, effects)
    assert found.chosen.slugs == {"torque_offset"}
    probable = name(found, 0.0).effects
    assert probable["torque_offset"] > 0.8 > 0.1 > probable["soil_patch"]


@pytest.mark.parametrize("began_m", [2e3, 5e5])
def test_a_patch_is_found_wherever_places_are_counted_from(small_patch, began_m):
    problem, textbook = crossed(stiffer=0.12, variation=0.04, began_m=began_m)
    (patch,) = effects_for(situation(problem, textbook.fitted), ["soil_patch"])
    here = effects_for(situation(small_patch[0], small_patch[1].fitted), ["soil_patch"])
    gained = try_adding(*small_patch, small_patch[1], *here).gain
    assert try_adding(problem, textbook, textbook, patch).gain == pytest.approx(gained, abs=1.0)


def test_a_patch_with_edges_is_no_such_rise(small_patch):
    problem, textbook = small_patch
    (patch,) = effects_for(situation(problem, textbook.fitted), ["soil_patch"])
    assert not is_bump(textbook, try_adding(problem, textbook, textbook, patch))


def test_each_stretch_is_weighed_as_a_regression_on_its_cells_would():
    rng = np.random.default_rng(5)
    by_cell = rng.normal(size=(40, 2, 12))
    residual = rng.normal(size=40)
    gradient = np.einsum("rak,r->ak", by_cell, residual)
    information = np.einsum("rak,rbl->akbl", by_cell, by_cell)
    gain, change = _gains(gradient, information)
    precision = np.diag([1.0 / parameter.scale**2 for parameter in SoilPatch.change])
    for first, last in ((0, 6), (3, 11), (5, 10)):
        columns = by_cell[:, :, first:last].sum(axis=2)
        best = np.linalg.solve(columns.T @ columns + precision, columns.T @ residual)
        left = residual - columns @ best
        gained = 0.5 * (residual @ residual - left @ left - best @ precision @ best)
        assert gain[first, last] == pytest.approx(gained)
        np.testing.assert_allclose(change[first, last], best)
    assert gain[4, 7] == -np.inf
    assert gain[7, 4] == -np.inf
