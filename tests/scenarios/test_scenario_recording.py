"""A synthetic traverse is a recording as the contract has it, the same for a seed, and whole or not there at all."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import typer
from bevameter.framework.cli.scenario import command
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.vehicle import load_vehicle
from bevameter.framework.scenario.presets import PRESETS
from bevameter.framework.scenario.write import to_toml, vehicle_toml, write_scenario
from typer.testing import CliRunner


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scenario("short", tmp_path_factory.mktemp("traverse") / "short", seed=3, duration_s=25.0)


def _digests(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_reads_back_as_a_recording(folder: Path) -> None:
    recording = read_recording(folder)
    assert recording.problems == ()
    assert recording.vehicle == PRESETS["short"].vehicle
    assert recording.start_time is not None
    assert recording.wheel is not None
    assert len(recording.wheel) == 250
    assert set(PRESETS["short"].channels) <= set(recording.wheel.columns)
    assert recording.pose is not None
    assert np.hypot(np.diff(recording.pose.x_m), np.diff(recording.pose.y_m)).sum() > 4.0
    assert recording.labels is not None
    assert recording.labels.classes == ("sand",)
    assert recording.sound is not None
    assert recording.sound.sample_rate == 22050
    assert recording.sound.start_s == PRESETS["short"].sound_start_s
    assert recording.sound.duration_s == pytest.approx(25.0 - recording.sound.start_s, abs=0.01)
    assert "seed 3" in (folder / "recording.toml").read_text(encoding="utf-8")


def test_camera_drops_out_black_gone_and_cut_short(folder: Path) -> None:
    recording = read_recording(folder)
    assert recording.camera is not None
    frames = list(recording.camera.frames())
    time = np.array([frame.time_s for frame in frames])
    assert not ((time >= 20.0) & (time < 22.0)).any()
    assert ((time >= 16.0) & (time < 18.0)).sum() == 10
    for frame in frames:
        if 22.0 <= frame.time_s < 24.0:
            assert frame.image is None
            assert frame.problem
            continue
        assert frame.image is not None
        assert frame.image.shape == (480, 640, 3)
        if 18.0 <= frame.time_s < 20.0:
            assert frame.image.mean() < 4.0
        elif 8.0 <= frame.time_s < 9.0:
            assert np.mean(frame.image == 255) > 0.3
        else:
            assert 40.0 < frame.image.mean() < 200.0


def test_truth_and_labels_agree(folder: Path) -> None:
    truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    labels = read_recording(folder).labels
    assert labels is not None
    assert truth["seed"] == 3
    assert [stretch["class"] for stretch in truth["stretches"]] == list(labels.classes)
    assert [stretch["start_s"] for stretch in truth["stretches"]] == labels.start_s.tolist()
    assert truth["stretches"][0]["soil"]["c_Pa"] > 0
    assert {fault["kind"] for fault in truth["faults"]} >= {"camera_black", "camera_gap", "camera_truncated"}


def test_seed_makes_the_same_bytes_and_another_seed_others(tmp_path: Path) -> None:
    first = _digests(write_scenario("sandpit", tmp_path / "a", seed=7, duration_s=5.0))
    again = _digests(write_scenario("sandpit", tmp_path / "b", seed=7, duration_s=5.0))
    other = _digests(write_scenario("sandpit", tmp_path / "c", seed=8, duration_s=5.0))
    assert first == again
    assert first.keys() == other.keys()
    for name in ("wheel.csv", "pose.csv", "sound.flac", "camera/000003.jpg"):
        assert first[name] != other[name]


def test_four_wheels_are_read_back(tmp_path: Path) -> None:
    recording = read_recording(write_scenario("rover4", tmp_path / "rover", duration_s=5.0))
    assert recording.wheel is not None
    assert recording.wheel.wheel is not None
    assert set(recording.wheel.wheel.tolist()) == {"front_left", "front_right", "rear_left", "rear_right"}
    rear = np.char.startswith(recording.wheel.wheel.astype(str), "rear")
    assert np.array_equal(recording.wheel["pass"], np.where(rear, 2.0, 1.0))
    assert "drawbar_pull_N" not in recording.wheel


def test_interruption_leaves_nothing(tmp_path: Path) -> None:
    def interrupt(stage: str, share: float) -> None:
        if stage == "sound" and share > 0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_scenario("short", tmp_path / "short", duration_s=5.0, progress=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_progress_is_reported_by_stage(tmp_path: Path) -> None:
    calls: list[tuple[str, float]] = []
    write_scenario("testbed", tmp_path / "t", duration_s=5.0, progress=lambda *call: calls.append(call))
    assert calls == [("wheels", 0.0), ("wheels", 1.0)]
    assert not (tmp_path / "t" / "camera").exists()


def test_bad_requests_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no preset 'nowhere'.*demo.*short"):
        write_scenario("nowhere", tmp_path / "x")
    for duration in (1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="duration"):
            write_scenario("testbed", tmp_path / "x", duration_s=duration)
    with pytest.raises(InputError, match="seed -1"):
        write_scenario("testbed", tmp_path / "x", seed=-1)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        write_scenario("testbed", tmp_path / "full", duration_s=5.0)
    with pytest.raises(InputError, match="a file of that name"):
        write_scenario("testbed", tmp_path / "full" / "mine.txt", duration_s=5.0)
    with pytest.raises(InputError, match=r"mine\.txt"):
        write_scenario("testbed", tmp_path / "full" / "mine.txt" / "below", duration_s=5.0)
    assert [path.name for path in tmp_path.rglob("*")] == ["full", "mine.txt"]


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write_scenario("testbed", tmp_path / "out", duration_s=5.0)
    assert (tmp_path / "out" / "wheel.csv").is_file()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("name", PRESETS)
def test_vehicles_survive_toml(name: str, tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    path.write_text(vehicle_toml(PRESETS[name].vehicle), encoding="utf-8")
    assert load_vehicle(path) == PRESETS[name].vehicle


def test_toml_text_is_escaped() -> None:
    import tomllib

    table = {"a": 'quote " and \\ and\nline', "b": {"c": True, "d": [1.5, 2]}, "e": [{"f": 1}, {"f": 2}]}
    assert tomllib.loads(to_toml(table)) == table


def test_command_lists_and_writes(tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(command)
    listed = CliRunner().invoke(app, ["--list"])
    assert listed.exit_code == 0
    assert all(name in listed.output for name in PRESETS)
    written = CliRunner().invoke(app, ["testbed", str(tmp_path / "out"), "--seed", "4", "--duration", "6"])
    assert written.exit_code == 0
    assert json.loads((tmp_path / "out" / "truth.json").read_text())["seed"] == 4
    without = CliRunner().invoke(app, ["testbed"])
    assert isinstance(without.exception, InputError)
    assert "OUT missing" in str(without.exception)
