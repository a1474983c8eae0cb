"""Bad arguments from Python, through the front door: one line that names argument, value and what is expected."""

from __future__ import annotations

import math

import bevameter
import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase, Vehicle, WheelTable
from refusals import SOIL, VEHICLE, WHEEL

NO_VEHICLES = (5, {"radius_m": 0.15}, ["vehicle.toml"])


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    for name, text in (("wheel.csv", WHEEL), ("vehicle.toml", VEHICLE), ("soil.toml", SOIL)):
        (folder / name).write_text(text)
    return folder


def refused(said: str, call, *arguments, **options) -> None:
    with pytest.raises(InputError, match=said) as caught:
        call(*arguments, **options)
    assert len(str(caught.value)) < 400
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("call", [bevameter.explain, bevameter.identify], ids=["explain", "identify"])
def test_an_invalid_recording_vehicle_or_soil_is_named(call, files):
    for recording in (None, 5, {"time_s": [0.0]}, np.zeros(3)):
        refused("^recording: .*expected a Recording, or the path", call, recording)
    for vehicle in NO_VEHICLES:
        refused(
            "^vehicle: .*expected a Vehicle, or the path of its TOML file", call, files / "wheel.csv", vehicle=vehicle
        )
    for soil in (5, {"c_Pa": 300.0}):
        refused("^soil: .*expected a SoilKnowledge", call, files / "wheel.csv", soil=soil)


@pytest.mark.parametrize("seed", [-1, 1.5, "a", None, True])
def test_a_seed_is_a_whole_number(files, seed):
    refused("^seed: .*expected a whole number, not negative", bevameter.explain, files / "wheel.csv", seed=seed)


@pytest.mark.parametrize("catalogue", [5, "slip_sinkage", ["gravity"], [["slip_sinkage"]]])
def test_an_invalid_catalogue_or_simulation_is_named(files, catalogue):
    refused("^catalogue: ", bevameter.explain, files / "wheel.csv", catalogue=catalogue)
    refused("^simulated: 5 ", bevameter.explain, files / "wheel.csv", simulated=5)


def test_an_invalid_method_is_named(files):
    for method in ("least squares", None, ["ml"]):
        refused("^method: .*expected ml or linear", bevameter.identify, files / "wheel.csv", method=method)


def test_what_cannot_be_simulated_is_named(files):
    vehicle, soil, drive = (files / name for name in ("vehicle.toml", "soil.toml", "wheel.csv"))
    for given in (*NO_VEHICLES, None):
        refused("^vehicle: .*expected a Vehicle", bevameter.simulate, given, soil, drive)
    for given in (5, None, {"c_Pa": 300.0}):
        refused("^soil: ", bevameter.simulate, vehicle, given, drive)
        refused("^drive: .*expected a WheelTable", bevameter.simulate, vehicle, soil, given)
    for given in (5, None, "slip_sinkage:n1=0.2", [5], [None]):
        refused("^effects: .*expected a list of effects", bevameter.simulate, vehicle, soil, drive, given)
    assert isinstance(bevameter.simulate(str(vehicle), soil, drive), WheelTable)


def test_what_is_no_file_is_named(files):
    for call, name in ((bevameter.load_vehicle, "file"), (bevameter.read_recording, "recording")):
        for given in (None, 5, ["x"]):
            refused(f"^{name}: ", call, given)
    refused("^vehicle: 5 ", bevameter.read_recording, files / "wheel.csv", vehicle=5)


def test_what_cannot_be_run_is_named(files, tmp_path):
    database = tmp_path / "terrain.db"
    refused("^recording: None", bevameter.run_traverse, None, database)
    refused("^database: None", bevameter.run_traverse, files / "wheel.csv", None)
    refused("^vehicle: 5", bevameter.run_traverse, files / "wheel.csv", database, vehicle=5)
    refused("^models: 5", bevameter.run_traverse, files / "wheel.csv", database, models=5)
    for edge in ("a", None, -1.0, 0.0, math.nan, math.inf):
        refused("^cell_size_m: ", bevameter.run_traverse, files / "wheel.csv", database, cell_size_m=edge)
    assert not database.exists()


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    with TerrainDatabase(tmp_path_factory.mktemp("db") / "terrain.db") as database:
        database.make()
        return database.snapshot().at(0.0, 0.0)


def test_what_cannot_be_planned_with_is_named(answer, files):
    rover = Vehicle.model_validate({"wheel": {"radius_m": 0.2, "width_m": 0.1}})
    for slip in ("0.2", None, [0.2, 0.3], np.full(2, 0.2), True, math.nan, 2, 1e300):
        refused("^slip: .*expected a number between -1 and 1", answer.drawbar_pull, rover, slip=slip, load_N=60.0)
    for load in ("a", ["60"], [None], True, -5.0, math.nan):
        refused(r"^load_N: .*expected positive numbers \[N\]", answer.drawbar_pull, rover, slip=0.2, load_N=load)
        refused("^load_N: ", answer.mobility, rover, load_N=load)
    for vehicle in (*NO_VEHICLES, None):
        refused("^vehicle: .*expected a Vehicle", answer.drawbar_pull, vehicle, slip=0.2, load_N=60.0)
        refused("^vehicle: .*expected a Vehicle", answer.mobility, vehicle, load_N=60.0)
    refused("none.toml: no such file", answer.mobility, files / "none.toml", load_N=60.0)


def test_a_vehicle_is_planned_with_by_its_file(answer, files):
    path = files / "vehicle.toml"
    by_path, by_vehicle = (
        answer.drawbar_pull(vehicle, slip=0.2, load_N=60.0) for vehicle in (path, bevameter.load_vehicle(path))
    )
    assert by_path.reason.tolist() == by_vehicle.reason.tolist()
    assert answer.mobility(str(path), load_N=60.0).load_N == (60.0,)


def test_the_time_of_a_query_is_posix_seconds_or_a_datetime(answer):
    for now in ("today", None.__class__, [0.0], math.nan, True):
        refused("^now: .*expected POSIX seconds, or a datetime", answer.snapshot.at, 0.0, 0.0, now=now)
