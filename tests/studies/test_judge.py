"""`judge.py`: sets of recordings, the cache, runs that go on where they stopped, and what stays frozen."""

from __future__ import annotations

import json
import sys
import types

import judge
import numpy as np
import pytest
from concealed import study
from concealed.effects import catalogue
from concealed.vehicle import study as vehicle_study
from judging import answers, recordings
from measured import read

NONE = {"schema": 1, "verdict": "none", "missing": [], "located": [], "fit": {"channels": {}}}


def test_the_study_draws_nulls_pairs_and_every_effect():
    hidden = [study.draw(seed)[0] for seed in range(400)]
    assert np.mean([not effects for effects in hidden]) == pytest.approx(0.30, abs=0.01)
    assert np.mean([len(effects) == 2 for effects in hidden]) == pytest.approx(0.15, abs=0.01)
    assert {effects[0] for effects in hidden if len(effects) == 1} == set(catalogue())


def test_a_protocol_that_cannot_show_what_is_hidden_gives_way_to_a_bench_test():
    drawn = [study.draw(seed, "ramps") for seed in range(60)]
    assert {protocol for _, _, protocol in drawn} == {"bench", "ramps"}
    assert all(("inertia" in effects) is (protocol == "bench") for effects, _, protocol in drawn)
    # Effects and level do not depend on the protocol.
    assert [row[:2] for row in drawn] == [study.draw(seed)[:2] for seed in range(60)]


def test_no_set_shares_a_recording_with_a_frozen_one():
    names = [set(each.named()) for each in recordings.SETS.values()]
    assert sum(map(len, names)) == len(set().union(*names))
    assert {name for name, each in recordings.SETS.items() if each.frozen} == {
        "frozen",
        "frozen-generator",
        "frozen-drives",
    }
    nulls = [not study.draw(seed)[0] for seed in recordings.FROZEN_SEEDS]
    assert np.mean(nulls) == pytest.approx(0.3, abs=0.02)


@pytest.fixture
def cache(tmp_path):
    """The truths of three recordings of the study, and empty folders of them."""
    hidden = {920000: (), 920001: ("drift",), 920002: ("drift", "exit_angle")}
    for seed, effects in hidden.items():
        recordings.folder_of(tmp_path, f"study-{seed}").mkdir(parents=True)
        path = recordings.truth_path(tmp_path, f"study-{seed}")
        path.parent.mkdir(exist_ok=True)
        listed = [{"effect": slug, "kind": "physics"} for slug in effects]
        path.write_text(json.dumps({"level": "plain" if effects else "null", "effects": listed}))
    return tmp_path


def command(stage, cache, *more, seeds=("920000", "3")):
    judge.main([stage, "--seeds", *seeds, "--cache", str(cache), *map(str, more)])


def test_making_resumes_where_it_stopped(monkeypatch, tmp_path):
    monkeypatch.setattr(study, "draw", lambda seed, protocol: ((), "hidden", protocol or "steady"))
    ramps = recordings.RecordingSet("study", range(2), "ramps")
    for name, seed in ramps.named().items():
        recordings.make_one(tmp_path, ramps, name, seed)
    assert sorted(recordings.stored_truths(tmp_path, ramps)) == ["study-ramps-0", "study-ramps-1"]
    folder = recordings.folder_of(tmp_path, "study-ramps-0")
    assert sorted(path.name for path in folder.iterdir()) == ["recording.toml", "vehicle.toml", "wheel.csv"]
    assert list(recordings.make(tmp_path, ramps, 1)) == []
    assert {path.name for path in tmp_path.iterdir()} == {"recordings", "truth"}


def test_the_frozen_generator_writes_its_own_recordings(monkeypatch, tmp_path):
    def write(seed, folder, truth_folder):
        folder.mkdir()
        truth_folder.mkdir()
        (truth_folder / "any.json").write_text(json.dumps({"seed": seed, "effects": []}))

    generate = types.SimpleNamespace(write=write)
    monkeypatch.setitem(sys.modules, "frozen_generator.generate", generate)
    chosen = recordings.SETS["frozen-generator"]
    recordings.make_one(tmp_path, chosen, "frozen_generator-5003", 5003)
    assert recordings.stored_truths(tmp_path, chosen) == {"frozen_generator-5003": {"seed": 5003, "effects": []}}


def test_whole_drives_are_recordings_of_a_generator_of_their_own(monkeypatch, tmp_path):
    monkeypatch.setattr(vehicle_study, "draw", lambda seed: ((), (), "hidden"))
    drives = recordings.RecordingSet("drives", range(3, 4))
    assert not drives.frozen
    recordings.make_one(tmp_path, drives, "drives-3", 3)
    truth = recordings.stored_truths(tmp_path, drives)["drives-3"]
    assert truth["level"] == "null"
    assert len(truth["grounds"]) >= 2
    assert (recordings.folder_of(tmp_path, "drives-3") / "labels.csv").is_file()


def test_a_recording_that_fails_is_reported_and_the_others_are_made(monkeypatch, tmp_path, capsys):
    def make(*_):
        yield "study-920000", "ValueError: no drive"
        yield "study-920001", None

    monkeypatch.setattr(recordings, "make", make)
    with pytest.raises(SystemExit, match="study-920000: ValueError: no drive"):
        command("make", tmp_path)


def test_runs_resume_where_they_stopped_and_are_scored(cache, monkeypatch, capsys):
    ran = []

    def run(folders, left_out, processes, timeout_s):
        for name in folders:
            ran.append((name, left_out.get(name, [])))
            yield {"name": name, "left_out": left_out.get(name, []), "seconds": 1.0, "answer": NONE}

    monkeypatch.setattr(answers, "run", run)
    out = cache / "answers.jsonl"
    command("run", cache, "--out", out, "--limit", 2)
    command("run", cache, "--out", out)
    assert [name for name, _ in ran] == ["study-920000", "study-920001", "study-920002"]
    lines = out.read_text().splitlines()
    out.write_text("\n".join(lines[:2]) + '\n{"name": "study-9200')  # cut off while the last line was written
    command("run", cache, "--out", out)
    command("run", cache, "--out", out, "--leave-one-out")
    assert ran[3:] == [("study-920002", []), ("study-920001", ["drift"])]
    other = cache / "other.jsonl"
    other.write_text(lines[0] + "\n")
    monkeypatch.setattr("measured.FOLDER", cache)
    command("score", cache, out, "--write", "scored")
    assert "| recordings | 4 |" in capsys.readouterr().out
    assert read("scored").cell("recordings", out.name) == "4"
    command("score", cache, out, "--compare", other, "--each")
    printed = capsys.readouterr().out
    assert "| recordings | 1 | 1 |" in printed
    assert printed.count("| study-920000 | null | null |") == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("score", "--set", "frozen", "answers.jsonl", "--each"), "nobody sees more than aggregates"),
        (("score", "--set", "frozen-generator", "answers.jsonl", "--each"), "nobody sees more than aggregates"),
        (("score", "--set", "frozen-drives", "answers.jsonl", "--each"), "nobody sees more than aggregates"),
        (("run", "--seeds", "880100", "2", "--out", "a.jsonl"), "holds frozen ones"),
        (("run", "--seeds", "890100", "2", "--generator", "drives", "--out", "a.jsonl"), "holds frozen ones"),
        (("make", "--seeds", "1", "2", "--generator", "drives", "--protocol", "ramps"), "goes with the study"),
        (("make", "--set", "training", "--protocol", "ramps"), "a named set draws its own"),
    ],
)
def test_frozen_sets_show_aggregates_only(arguments, message, tmp_path, capsys):
    with pytest.raises(SystemExit):
        judge.main([*arguments, "--cache", str(tmp_path)])
    assert message in capsys.readouterr().err


@pytest.fixture
def tool(tmp_path, monkeypatch):
    """A package `bevameter` of one module that answers, fails, ends or hangs as the recording's name has it."""
    package = tmp_path / "tool" / "bevameter"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(
        "import os, time\n"
        "class Answer(dict):\n"
        "    to_json = lambda self: dict(self)\n"
        "def explain(folder, **options):\n"
        "    if folder.name == 'hangs': time.sleep(60.0)\n"
        "    if folder.name == 'dies': os._exit(3)\n"
        "    if folder.name == 'fails': raise RuntimeError('no idea')\n"
        "    return Answer(options={name: str(value) for name, value in options.items()})\n"
    )
    monkeypatch.setattr(sys, "path", [str(tmp_path / "tool"), *sys.path])
    folders = {name: tmp_path / name for name in ("hangs", "dies", "fails", "answers")}
    for folder in folders.values():
        folder.mkdir()
    (folders["answers"] / "soil.toml").touch()
    return folders


def test_a_tool_that_hangs_dies_or_fails_is_counted_and_the_run_goes_on(tool):
    rows = {row["name"]: row for row in answers.run(tool, {}, 1, 2.0)}
    assert rows["hangs"]["failure"] == "no answer after 2 s"
    assert rows["dies"]["failure"] == "the process died"
    assert rows["fails"]["failure"] == "RuntimeError: no idea"
    assert rows["answers"]["answer"] == {"options": {"soil": str(tool["answers"] / "soil.toml")}}


def test_the_effects_left_out_are_not_in_the_catalogue_that_the_tool_is_given(monkeypatch, tmp_path):
    import bevameter
    from bevameter.identification.effects.catalogue import SLUGS

    options_given = []

    class Answer:
        def to_json(self):
            return NONE

    def explain(folder, **options):
        options_given.append(options)
        return Answer()

    monkeypatch.setattr(bevameter, "explain", explain, raising=False)
    assert answers.answer_of(tmp_path, ["drift"]) == NONE
    assert options_given == [{"catalogue": [slug for slug in SLUGS if slug != "drift"]}]
