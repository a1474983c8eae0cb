import dataclasses
import uuid
from dataclasses import replace
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
from bevameter.database.observations import SoilObservation, TerrainObservations
from bevameter.database.rows import pack_estimate, unpack_estimate
from bevameter.framework.core.findings import note, warning


def test_the_same_processing_is_the_same_drive(make):
    drive = make.drive()
    assert drive.id == make.drive().id
    assert drive.row_ids("terrain", 2) == [uuid.uuid5(drive.id, f"terrain/{index}") for index in range(2)]
    assert len({*drive.row_ids("terrain", 3), *drive.row_ids("soil", 3)}) == 6


@pytest.mark.parametrize(
    "changes",
    [
        {"recording_digest": "other"},
        {"models": {"camera": "m2"}},
        {"method": "method 2"},
        {"site": "beach"},
        {"vehicle_name": "truck"},
        {"start_time": None},
    ],
)
def test_anything_that_affects_the_result_makes_another_drive(make, changes):
    assert dataclasses.replace(make.drive(), **changes).id != make.drive().id


def test_the_start_time_is_a_moment_not_a_text(make):
    here = make.START.astimezone(timezone(timedelta(hours=2)))
    assert make.drive(start_time=here).id == make.drive().id
    assert make.drive(start_time=make.START.replace(tzinfo=None)).id == make.drive().id  # no zone: UTC
    assert make.drive(start_time=datetime(2020, 1, 1)).id != make.drive().id


def test_the_name_is_for_people_only(make):
    assert dataclasses.replace(make.drive(), name="renamed").id == make.drive().id


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cell_size_m": 0.0}, "cell_size_m"),
        ({"cell_x": np.array([0.5, 1.0])}, "whole numbers"),
        ({"cell_x": np.array([0, 2**40])}, "whole numbers"),
        ({"time_s": np.zeros(3)}, "time_s"),
        ({"time_s": np.array([0.0, np.nan])}, "finite"),
        ({"sense": np.array(["fused", "nose"])}, "nose"),
    ],
)
def test_terrain_that_makes_no_sense_is_refused(make, changes, said):
    good = make.seen([(0, 0), (1, 0)], [[0.1, 0.9], [0.5, 0.5]])
    with pytest.raises(ValueError, match=said):
        dataclasses.replace(good, **changes)


@pytest.mark.parametrize("row", [[0.5, 0.6], [1.2, -0.2], [np.nan, 0.5]])
def test_probabilities_must_be_probabilities(make, row):
    with pytest.raises(ValueError, match="sum to one"):
        make.seen([(0, 0)], [row])


def test_soil_without_estimate_needs_a_reason(make):
    with pytest.raises(ValueError, match="reason"):
        SoilObservation(0.0, 1.0, 0.0, 0.0, {}, None, (0.0, 1.0), 10.0)
    with pytest.raises(ValueError, match="none"):
        SoilObservation(2.0, 1.0, 0.0, 0.0, {}, None, (0.0, 1.0), 10.0, gate_reason="too fast")
    with pytest.raises(ValueError, match="sum to one"):
        make.soil({"sand": 0.8, "clay": 0.8})


def test_a_drive_without_observations_is_a_drive():
    assert len(TerrainObservations.nothing()) == 0


def test_findings_are_stored_as_data_and_sentences_of_before_are_still_read(make):
    estimate = replace(make.estimate(), findings=(warning("wrong_form", misfit=2.0),))
    packed = pack_estimate(estimate)
    assert unpack_estimate(packed).findings == estimate.findings
    before = {**{key: value for key, value in packed.items() if key != "findings"}, "problems": ["it does not fit"]}
    assert unpack_estimate(before).findings == (note("stored", text="it does not fit"),)
