"""Physics that was found and stored is subtracted on later drives, and their soil and the planner gain by it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from bevameter.database.observations import Drive, TerrainObservations
from bevameter.database.store import TerrainDatabase
from bevameter.framework.core.evidence import ClassEvidence
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.recording.types import Labels, Recording, WheelTable
from bevameter.framework.core.track.way import track_of
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.framework.explain import explain, store
from bevameter.framework.known_physics import KnownPhysics
from bevameter.framework.scenario.write import write_scenario
from bevameter.framework.segments import class_track, learn_soil
from bevameter.framework.traverse import run_traverse
from bevameter.identification.effects.stored import AugmentedSimulator, StoredEffect
from bevameter.identification.later_drives import for_later_drives
from bevameter.identification.simulate import simulate

SOIL = {"c_Pa": 900.0, "phi_rad": 0.5, "k_m": 0.015, "stiffness_Pa": 3e5, "n": 1.0}
SLIP_SINKAGE = StoredEffect("slip_sinkage", "exponent", {"n1": Estimate(0.3, 0.01)})
TORQUE_ZERO = StoredEffect("torque_offset", "", {"T_0": Estimate(4.0, 0.1)})


def physics(*effects: StoredEffect, vehicle: str = "") -> AugmentedSimulator:
    return AugmentedSimulator(
        {name: Estimate(value, 0.01 * value) for name, value in SOIL.items()}, effects, (), vehicle
    )


def straight(vehicle: str = "rover", speed_m_s: float = 0.2) -> Recording:
    """Sand, then loam, along x; the wheel shows slip-sinkage on both, and its torque is 4 N m too high."""
    time_s = np.arange(0.0, 40.0, 0.5)
    columns = {
        "time_s": time_s, "load_N": np.full(80, 700.0), "slip": 0.3 + 0.2 * np.sin(time_s),
        "x_m": speed_m_s * time_s, "y_m": np.zeros(80), "travel_speed_m_s": np.full(80, speed_m_s),
    }  # fmt: skip
    rover = Vehicle(name=vehicle, wheels=(Wheel(radius_m=0.2, width_m=0.15),))
    table = WheelTable(columns, None, None, Path("wheel.csv"))
    wheel = physics(SLIP_SINKAGE, TORQUE_ZERO).simulate(rover, table)
    labels = Labels(np.array([0.0, 20.0]), np.array([20.0, 40.0]), ("sand", "loam"))
    return Recording("d", Path("d"), rover, None, "pit", "0" * 64, wheel, labels=labels)


def labelled(recording: Recording):
    """Track, and the classes that the labels state along it."""
    track = track_of(recording)
    times_s = track.every(0.5)
    at = recording.labels.at(0.5 * (times_s[:-1] + times_s[1:]))
    names = tuple(dict.fromkeys(recording.labels.classes))
    probabilities = (at[:, None] == np.array(names, dtype=object)).astype(float)
    return track, class_track(track, times_s, probabilities, at != "", names)


def test_what_is_known_of_a_class_is_subtracted_there():
    drive = straight()
    known = KnownPhysics({"sand": physics(SLIP_SINKAGE, TORQUE_ZERO)})
    bare, used, problems = known.taken_out(drive, *labelled(drive))
    textbook = simulate(drive.vehicle, physics().soil_values, drive.wheel)
    sand = drive.wheel["time_s"] < 19.0
    loam = drive.wheel["time_s"] > 21.0
    for name in ("torque_Nm", "sinkage_m", "drawbar_pull_N"):
        np.testing.assert_allclose(bare.wheel[name][sand], textbook[name][sand], rtol=1e-6)
        np.testing.assert_array_equal(bare.wheel[name][loam], drive.wheel[name][loam])
    assert [effect.slug for effect in used.effects("sand")] == ["slip_sinkage", "torque_offset"]
    assert not used.effects("loam")
    assert not problems


def test_what_needs_a_column_that_was_not_recorded_is_left_and_said():
    drive = straight()
    ruts = StoredEffect("multipass_compaction", "", {"stiffness_gain": Estimate(0.2, 0.01)})
    same, used, (problem,) = KnownPhysics({"sand": physics(ruts)}).taken_out(drive, *labelled(drive))
    assert "sand was not used" in problem
    assert not used.by_class
    np.testing.assert_array_equal(same.wheel["torque_Nm"], drive.wheel["torque_Nm"])


def test_faults_are_those_of_the_vehicle_that_had_them(tmp_path):
    patch = StoredEffect("drift", "torque_Nm", {"d1": Estimate(0.5, 0.1)}, {"t_first": 0.0, "t_last": 9.0})
    of_rover = physics(SLIP_SINKAGE, TORQUE_ZERO, patch, vehicle="rover")
    assert [each.slug for each in for_later_drives(of_rover, "rover").effects] == ["slip_sinkage", "torque_offset"]
    for other in ("another", ""):
        assert [each.slug for each in for_later_drives(of_rover, other).effects] == ["slip_sinkage"]
    with TerrainDatabase(tmp_path / "t.db") as database:
        database.add_physics("sand", of_rover, source="d", time=datetime(2026, 1, 1, tzinfo=UTC))
        database.add_physics("clay", physics(TORQUE_ZERO), source="d", time=datetime(2026, 1, 1, tzinfo=UTC))
        own, others = (KnownPhysics.of(database.physics(), straight(name)) for name in ("rover", "vehicle"))
        elsewhere = KnownPhysics.of(database.physics(), replace(straight(), site="elsewhere"))
    assert [each.slug for each in own.effects("sand")] == ["slip_sinkage", "torque_offset"]
    assert [each.slug for each in others.effects("sand")] == ["slip_sinkage"]
    assert not own.effects("clay")
    assert own.digest == elsewhere.digest != others.digest
    assert not KnownPhysics({}).digest


def test_a_drive_is_processed_again_once_physics_is_known(tmp_path):
    database, drive = tmp_path / "t.db", straight(speed_m_s=2.0)
    first = run_traverse(drive, database)
    assert run_traverse(drive, database).known
    with TerrainDatabase(database) as opened:
        opened.add_physics("sand", physics(SLIP_SINKAGE), source="d")
    assert not first.known
    assert not run_traverse(drive, database).known
    assert run_traverse(drive, database).known


@pytest.mark.slow
def test_what_explain_stored_makes_later_predictions_better(tmp_path):
    """On other drives, with other soils of the same classes: soil of a stretch, and pull at a slip of about 0.4."""
    earlier, *later = (read_recording(write_scenario("slip-sinkage", tmp_path / str(s), seed=s)) for s in (1, 7, 8, 9))
    exponents, pulls = [], []
    for path in (tmp_path / "without.db", tmp_path / "with.db"):
        if path.stem == "with":
            assert set(store(explain(earlier), path)) == {"sand", "loam", "clay"}
        with TerrainDatabase(path) as database:
            database.add_drive(_mapped(earlier, _soils(database, earlier)))
            soils = [each.estimate for each in _soils(database, later[0]) if each.estimate is not None]
            exponents.append([each.parameters["n"].value for each in soils])
            pulls.append(np.concatenate([_errors_of_pull(database, each) for each in later]))
    assert len(exponents[0]) > len(exponents[1]) == 3, "without it the law of sinkage changes with slip, not with place"
    np.testing.assert_allclose(exponents[1], [1.10, 0.70, 0.78], atol=0.06)
    without, with_it = (float(np.sqrt(np.mean(each**2))) for each in pulls)
    assert with_it < 0.9 * without


def _soils(database: TerrainDatabase, recording: Recording):
    track, along = labelled(recording)
    known = KnownPhysics.of(database.physics(), recording) if database.there else KnownPhysics({})
    bare, used, problems = known.taken_out(recording, track, along)
    assert not problems
    return learn_soil(bare, track, along, effects={name: used.effects(name) for name in used.by_class}).observations


def _mapped(recording: Recording, soils) -> Drive:
    """The drive, with a map of one cell of each class, side by side."""
    names = recording.labels.classes
    evidence = ClassEvidence(names, np.eye(3), np.ones(3), np.zeros(3, dtype=bool), 3 * ((),))
    terrain = TerrainObservations(
        0.5, np.arange(3), np.zeros(3, dtype=int), np.arange(3.0), np.full(3, "fused"), evidence
    )
    return Drive(recording.digest, "d", recording.site, "rover", None, {"camera": "a" * 64}, "test", terrain, soils)


def _errors_of_pull(database: TerrainDatabase, later: Recording) -> np.ndarray:
    """Predicted less mean measured drawbar pull of each class on a drive [N]."""
    places = np.column_stack([0.5 * np.arange(3) + 0.25, np.full(3, 0.25)])
    wheel, at = later.wheel, later.labels.at(later.wheel["time_s"])
    slip = 1.0 - wheel["travel_speed_m_s"] / (later.vehicle.wheels[0].radius_m * wheel["wheel_speed_rad_s"])
    rows = (np.abs(slip - 0.4) < 0.05) & (wheel["travel_speed_m_s"] < 0.5)
    load = float(np.mean(wheel["load_N"][rows]))
    pull = database.snapshot().along(places).drawbar_pull(later.vehicle, slip=0.4, load_N=load).mean
    measured = [np.mean(wheel["drawbar_pull_N"][rows & (at == name)]) for name in later.labels.classes]
    return pull - np.array(measured)
