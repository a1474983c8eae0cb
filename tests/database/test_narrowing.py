"""Answers that are unknown by little, or bounded low, say why, and which drive would help."""

from __future__ import annotations

import pytest
from bevameter import Vehicle, Wheel
from bevameter.database.exports import answer_rows, class_rows
from bevameter.database.snapshot import Snapshot

CLASSES = ("clay", "grass", "sand")


@pytest.fixture
def derive(make):
    """A snapshot of one cell of a belief over clay, grass and sand, with soils of stretches that are places each."""

    def snapshot(belief, *soils):
        drives = [make.drive("d", make.seen([(0, 0)], [belief], classes=CLASSES))]
        elsewhere = make.seen([(9, 9)], [belief], classes=CLASSES)
        drives += [make.drive(f"d{number}", elsewhere, (soil,)) for number, soil in enumerate(soils)]
        return Snapshot.derive("quarry", drives)

    return snapshot


def test_a_sliver_of_a_class_without_soil_is_named_with_its_probability(derive, make):
    view = derive([0.02, 0.08, 0.90], make.soil({"sand": 1.0}), make.soil({"clay": 1.0}))
    belief = view.cells.probability[0]
    (reason,) = view.at(0.1, 0.1).reason
    assert reason.startswith("no soil data for class grass, and this may be grass: ")
    assert float(reason.split("may be grass: ")[1].split(" %")[0]) == pytest.approx(100 * belief[1], abs=0.1)
    assert reason.endswith("where 5 % are allowed; drive slowly on grass, or look at this ground again")
    assert not view.at(0.1, 0.1, confidence=0.5).reason[0], "with less confidence it is known"


def test_several_slivers_are_counted_together(derive, make):
    (reason,) = derive([0.03, 0.04, 0.93], make.soil({"sand": 1.0})).at(0.1, 0.1, confidence=0.97).reason
    assert "this may be grass or others without: " in reason


def test_a_low_bound_of_one_drive_says_that_other_places_would_raise_it(derive, make):
    stiff_clay = make.soil({"clay": 1.0}, 9000.0, 0.05)
    view = derive([0.999, 0.0005, 0.0005], stiff_clay)
    answer = view.at(0.1, 0.1)
    assert answer.shear_strength_lower[0] < 0.5 * answer.shear_strength[0]
    (row,) = answer_rows(answer)
    assert row["note"] == (
        "the lower bound is less than half of the expected strength: clay bounds it: how its places differ is hardly "
        "known from 1 stretch: drive slowly on it at other places"
    )
    clay, grass, _ = class_rows(view, normal_stress=20e3, confidence=0.95)
    assert clay["note"] == row["note"]
    assert grass["unknown"] == "no soil data for class grass"


def test_what_holds_the_bound_down_is_told_apart(derive, make):
    clays = [make.soil({"clay": 1.0}, c_Pa, 0.05) for c_Pa in (500.0, 14e3, 2e3, 9e3, 4e3, 12e3, 1e3, 7e3) * 3]
    (note,) = derive([1.0, 0.0, 0.0], *clays).at(0.1, 0.1).note
    assert note.endswith("clay bounds it: its places differ by so much, by 24 stretches")
    sands = [make.soil({"sand": 1.0}, 1000.0, 0.6) for _ in range(24)]
    weak = [make.soil({"clay": 1.0}, 1000.0 + each, 0.01) for each in range(24)]
    answer = derive([0.1, 0.0, 0.9], *sands, *weak).at(0.1, 0.1)
    assert "clay bounds it: " in answer.note[0]
    assert answer.note[0].endswith("or look at this ground again, which is probably another class")
    assert answer.labels() == ["sand"]


def test_a_negative_bound_of_the_pull_says_so_too(derive, make):
    rover = Vehicle(wheels=(Wheel(radius_m=0.15, width_m=0.12),))
    answer = derive([0.999, 0.0005, 0.0005], make.soil({"clay": 1.0}, 1500.0, 0.2)).at(0.1, 0.1)
    able = answer.mobility(rover)
    assert able.drawbar_pull_lower[0] < 0.0 < answer.drawbar_pull(rover, slip=float(able.best_slip[0])).mean[0]
    assert able.note.tolist() == [
        "the lower bound is negative: clay bounds it: how its places differ is hardly known from 1 stretch: drive "
        "slowly on it at other places"
    ]
    sands = [make.soil({"sand": 1.0}, 1000.0, 0.6) for _ in range(6)]
    assert derive([0.0005, 0.0005, 0.999], *sands).at(0.1, 0.1).mobility(rover).note.tolist() == [""]


def test_where_there_is_nothing_to_say_there_is_no_note(derive, make):
    sands = [make.soil({"sand": 1.0}, 1000.0, 0.6) for _ in range(6)]
    (row,) = answer_rows(derive([0.001, 0.001, 0.998], *sands).at(0.1, 0.1))
    assert row["known"]
    assert row["note"] is None
