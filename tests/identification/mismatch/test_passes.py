"""Passes on the same ground, and passes on ground that the one before has stirred."""

from __future__ import annotations

import math
from dataclasses import replace

import bevameter.identification.mismatch.explain as module
import numpy as np
import pytest
from bevameter import Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.fit.lanes import passes_apart
from bevameter.identification.mismatch.fit.samples import gather

WHEEL = Wheel(radius_m=0.15, width_m=0.15)
SOIL = Soil(c_Pa=300.0, phi_rad=math.radians(30.0), k_m=0.011, stiffness_Pa=2.9e5, n=1.1)
ROWS, PIECE, PASSES, VARIES = 250, 10, 2, 0.035


def two_passes(folder, *, same_ground: bool, compaction: float, torque: float = 1.0, seed: int = 5):
    """Write a drive twice along a track whose ground varies, the second time on the same ground or not."""
    rng = np.random.default_rng(seed)
    pieces = ROWS // PIECE
    steps = rng.normal(size=(2, PASSES * pieces))
    keep = math.exp(-1.0 / 4.0)
    along = np.zeros_like(steps)
    along[:, 0] = steps[:, 0]
    for piece in range(1, PASSES * pieces):
        along[:, piece] = keep * along[:, piece - 1] + math.sqrt(1.0 - keep**2) * steps[:, piece]
    if same_ground:
        along = np.tile(along[:, :pieces], PASSES)
    time_s = 0.1 * np.arange(PASSES * ROWS)
    load = 90.0 + 40.0 * np.sin(time_s / 3.1) + 15.0 * np.sin(time_s / 1.3)
    slip = 0.3 + 0.2 * np.sin(time_s / 2.3)
    number = 1 + np.arange(len(time_s)) // ROWS
    answers = np.empty((len(time_s), 3))
    for piece in range(PASSES * pieces):
        rows = slice(piece * PIECE, (piece + 1) * PIECE)
        stiffer = VARIES * along[0, piece] + compaction * (piece >= pieces)
        stronger = math.exp(VARIES * along[1, piece])
        soil = replace(
            SOIL, stiffness_Pa=SOIL.stiffness_Pa * math.exp(stiffer), c_Pa=SOIL.c_Pa * stronger,
            phi_rad=math.atan(math.tan(SOIL.phi_rad) * stronger),
        )  # fmt: skip
        state = equilibrium(WHEEL, soil, load[rows], slip[rows])
        answers[rows] = np.column_stack([state.torque_Nm, state.sinkage_m, state.drawbar_pull_N])
    answers[:, 0] *= torque
    answers += 0.01 * np.ptp(answers, axis=0) * rng.normal(size=answers.shape)
    place = 0.02 * (np.arange(len(time_s)) % ROWS)
    columns = [time_s, load + 0.2 * rng.normal(size=len(load)), slip + 0.002 * rng.normal(size=len(slip))]
    table = np.column_stack([*columns, *answers.T, place, number])
    path = folder / "wheel.csv"
    head = "time_s,load_N,slip,torque_Nm,sinkage_m,drawbar_pull_N,x_m,pass"
    np.savetxt(path, table, delimiter=",", header=head, comments="")
    return path


@pytest.mark.parametrize(
    ("same_ground", "compaction", "verdict"), [(False, 0.0, "none"), (True, 0.0, "none"), (True, 0.1, "physics")]
)
def test_ground_that_varies_anew_in_each_pass_is_no_compaction(tmp_path, same_ground, compaction, verdict):
    path = two_passes(tmp_path, same_ground=same_ground, compaction=compaction)
    vehicle = Vehicle(name="made", wheels=(WHEEL,))
    answer = explain(path, vehicle=vehicle, catalogue=["multipass_compaction"])
    assert answer.verdict == verdict
    assert any("ground of its own" in note for note in answer.notes) != same_ground


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_ground_of_its_own_takes_the_place_of_one_of_two_effects(tmp_path, seed):
    """Beside an effect, too, what passes differ by is no compaction and no drift where their ground is not the same."""
    path = two_passes(tmp_path, same_ground=False, compaction=0.0, torque=1.1, seed=seed)
    vehicle = Vehicle(name="made", wheels=(WHEEL,))
    answer = explain(path, vehicle=vehicle, catalogue=["multipass_compaction", "torque_gain", "drift"])
    assert {each.effect for each in answer.missing} == {"torque_gain"}
    (note,) = [note for note in answer.notes if "ground of its own" in note]
    assert "found with the same ground in all, " in note
    assert "torque gain" in note.partition("in all, ")[2]


def test_sensors_that_remember_and_other_ground_are_searched_together(tmp_path, monkeypatch):
    searches, sought = [], module._sought

    def remembering_nothing(samples, problem, trial, known):
        there, textbook = module.textbook_trial(samples, known)
        again = module.again(there, textbook, trial)
        return samples, there, module.Search(textbook, (again,), (), again)

    def counted(*given):
        searches.append(given)
        return sought(*given)

    monkeypatch.setattr(module, "_as_remembered", remembering_nothing)
    monkeypatch.setattr(module, "_sought", counted)
    path = two_passes(tmp_path, same_ground=False, compaction=0.0, torque=1.1)
    vehicle = Vehicle(name="made", wheels=(WHEEL,))
    answer = explain(path, vehicle=vehicle, catalogue=["multipass_compaction", "torque_gain"])
    assert len(searches) == 2
    assert {each.effect for each in answer.missing} == {"torque_gain"}
    assert any("ground of its own" in note for note in answer.notes)


@pytest.mark.parametrize(("gained", "compaction", "enough"), [(0.0, 0.1, True), (1e5, 0.1, False), (1e5, 0.3, True)])
def test_beside_other_ground_an_effect_has_to_gain_as_much_as_beside_another_effect_or_to_calm_it(
    tmp_path, monkeypatch, gained, compaction, enough
):
    path = two_passes(tmp_path, same_ground=True, compaction=compaction)
    monkeypatch.setattr(
        module, "_on_other_ground", lambda samples, known, *_: (*module.textbook_trial(samples, known), gained)
    )
    answer = explain(path, vehicle=Vehicle(name="made", wheels=(WHEEL,)), catalogue=["multipass_compaction"])
    assert any(each.effect == "multipass_compaction" for each in answer.missing) == enough


def test_passes_lie_apart_whichever_way_they_are_driven(tmp_path):
    opened = open_recording(
        two_passes(tmp_path, same_ground=True, compaction=0.0), Vehicle(name="made", wheels=(WHEEL,))
    )
    rows = felt_rows(opened)
    samples = gather(rows.table, rows.wheel, rows.vehicle)
    second = samples.drive.pass_number == 2
    assert not samples.lane.any()
    there_and_back = np.where(second, samples.drive.place_m[::-1], samples.drive.place_m)
    for place in (samples.drive.place_m, there_and_back):
        apart = passes_apart(replace(samples, drive=replace(samples.drive, place_m=place)))
        assert np.array_equal(apart.lane, second)


def passed_twice(rows: int, **columns) -> WheelTable:
    """A track of twenty metres that is driven twice, its slip a ramp in space the first time."""
    along = np.tile(np.linspace(0.0, 20.0, rows), PASSES)
    number = np.repeat([1.0, 2.0], rows)
    slip = np.where(number > 1.0, 0.2, 0.1 + 0.2 * np.sin(along) ** 2)
    return WheelTable({
        "time_s": 0.1 * np.arange(PASSES * rows), "load_N": 80.0 + 5.0 * np.sin(np.arange(PASSES * rows) / 7.0),
        "slip": slip, "torque_Nm": 3.0 + 4.0 * slip, "x_m": along, "pass": number, **columns,
    }, None, None, "made")  # fmt: skip


@pytest.mark.parametrize("rows", [600, 6000])
def test_passes_that_are_thinned_keep_their_common_ground_and_what_ran_there(rows):
    drive = gather(passed_twice(rows), WHEEL, Vehicle(wheels=(WHEEL,))).drive
    later = drive.pass_number == 2.0
    first = np.sort(drive.place_m[~later])
    at = np.clip(np.searchsorted(first, drive.place_m[later]), 1, len(first) - 1)
    nearest = np.minimum(np.abs(first[at] - drive.place_m[later]), np.abs(first[at - 1] - drive.place_m[later]))
    assert np.mean(nearest < 0.2) > 0.95
    np.testing.assert_allclose(drive.slip_before[later], 0.1 + 0.2 * np.sin(drive.place_m[later]) ** 2, atol=0.05)


@pytest.mark.parametrize(("lost", "left_out"), [(40, True), (600, False)])
def test_few_lost_places_do_not_cost_the_passes_their_common_ground(lost, left_out):
    table = passed_twice(600)
    table.columns["x_m"][:lost] = np.nan
    table.columns["x_m"][100:200] = np.where(np.arange(100) % 2, np.nan, table["x_m"][100:200])
    samples = gather(table, WHEEL, Vehicle(wheels=(WHEEL,)))
    assert any("have no place and are left out" in note for note in samples.notes) == left_out
    assert np.array_equal(samples.position, samples.drive.place_m) == left_out


def test_a_place_that_never_changes_is_none():
    still = passed_twice(300, x_m=np.zeros(600))
    samples = gather(still, WHEEL, Vehicle(wheels=(WHEEL,)))
    np.testing.assert_array_equal(samples.position, samples.drive.time_s)
