"""Several recordings in one run: the same database whichever way they are processed, and what fails fails alone."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import bevameter
import pytest
from bevameter import FailedRecording, InputError, TerrainDatabase, read_recording, run_traverses
from bevameter.framework import batch, workers
from bevameter.framework.cli.main import app
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.recording.readers import load_readers
from bevameter.framework.scenario.write import write_scenario
from bevameter.identification.effects.stored import AugmentedSimulator, StoredEffect
from refusals import VEHICLE, WHEEL, picture, sound
from typer.testing import CliRunner

READERS = """
import os, signal, time
from bevameter.framework.core.recording.readers import Reader, register

@register
class Deadly(Reader):
    kinds = "a recording that kills the process that reads it (.deadly)"
    def sniff(self, path): return path.suffix == ".deadly"
    def read(self, path, *, vehicle, topics): os.kill(os.getpid(), signal.SIGKILL)

@register
class Endless(Reader):
    kinds = "a recording that is never read to its end (.endless)"
    def sniff(self, path): return path.suffix == ".endless"
    def read(self, path, *, vehicle, topics):
        path.with_suffix(".begun").write_text(str(os.getpid()))
        time.sleep(600)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Recordings: two of wheels, one of all senses, one that cannot be used, and two for the readers above."""
    path = tmp_path_factory.mktemp("recordings")
    for number in (1, 2):
        write_scenario("testbed", path / f"wheels{number}", seed=number, duration_s=5.0)
    drive = path / "senses"
    (drive / "camera").mkdir(parents=True)
    (drive / "wheel.csv").write_text(WHEEL)
    (drive / "vehicle.toml").write_text(VEHICLE)
    (drive / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0\n2,0.5,0,0\n4,1,0,0\n")
    (drive / "camera" / "camera.csv").write_text("time_s,file\n0.0,0.jpg\n0.5,1.jpg\n")
    for index in range(2):
        picture(drive / "camera" / f"{index}.jpg")
    sound(drive / "sound.wav")
    shutil.copytree(path / "wheels1", path / "spoilt")
    (path / "spoilt" / "wheel.csv").write_text("time_s,load_N\n0.0,abc\n")
    for name in ("a.deadly", "a.endless"):
        (path / name).write_text("")
    return path


@pytest.fixture(scope="module")
def readers(tmp_path_factory):
    """The readers above, as another distribution that processes find which start from now on, and not this one."""
    load_readers()
    path = tmp_path_factory.mktemp("readers")
    (path / "test_readers_of_batch.py").write_text(READERS)
    info = path / "readers_of_batch-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: readers-of-batch\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[bevameter.readers]\nbatch = test_readers_of_batch\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(path)
        patch.setenv("PYTHONPATH", str(path), prepend=os.pathsep)
        yield


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """A database that knows physics of a class, so that every drive over it is processed otherwise."""
    path = tmp_path_factory.mktemp("known") / "t.db"
    soil = {"c_Pa": 900.0, "phi_rad": 0.5, "k_m": 0.015, "stiffness_Pa": 3e5, "n": 1.0}
    effect = StoredEffect("slip_sinkage", "exponent", {"n1": Estimate(0.3, 0.01)})
    physics = AugmentedSimulator({name: Estimate(value, 0.01 * value) for name, value in soil.items()}, (effect,))
    with TerrainDatabase(path) as database:
        database.add_physics("sand", physics, source="a test", time=datetime(2026, 1, 1, tzinfo=UTC))
    return path


@pytest.fixture(scope="module")
def run_all(folder, known, small_models, tmp_path_factory):
    """Run over all recordings that a process survives, one of them twice; gives rows and outcomes."""

    def run(**options):
        database = shutil.copy(known, tmp_path_factory.mktemp("ways") / "t.db")
        given = [folder / name for name in ("wheels1", "senses", "spoilt", "wheels2", "wheels1", "nowhere")]
        finished = []
        outcomes = run_traverses(given, database, models=small_models, finished=finished.append, **options)
        assert outcomes == tuple(finished)
        return rows(database), [said(outcome) for outcome in outcomes]

    return run


def rows(database: Path) -> dict[str, list[tuple]]:
    """All rows in the order in which they were written, without what is of the import."""
    with closing(sqlite3.connect(database)) as connection:
        names = [row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        found = {name: connection.execute(f"SELECT * FROM {name} ORDER BY rowid").fetchall() for name in names}
        order = "SELECT drive_id FROM drive_import ORDER BY imported_at"
        return {**found, "drive_import": connection.execute(order).fetchall()}


def said(outcome):
    """An outcome without the time it took, the database's place and the formats that a process knows."""
    if isinstance(outcome, FailedRecording):
        return outcome.source, outcome.problem.split(" (expected")[0]
    return replace(outcome, seconds=0.0, database="", warnings=())


@pytest.fixture(scope="module")
def one_by_one(run_all):
    return run_all()


@pytest.fixture(scope="module")
def by_processes(run_all):
    return run_all(workers=2)


@pytest.fixture(scope="module")
def cluster(readers):
    """A cluster of one process, which is taken to have died when it died once."""
    distributed = pytest.importorskip("distributed", reason="Dask is not installed: the extra `fleet`")
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as started,
    ):
        yield started


@pytest.fixture(scope="module")
def by_cluster(cluster, run_all):
    with cluster.get_client() as client:
        return run_all(client=client)


def test_one_by_one_each_recording_is_stored_and_what_fails_is_reported(one_by_one, folder):
    stored, outcomes = one_by_one
    assert len(stored["drive"]) == 3
    assert len(stored["drive_import"]) == 3
    assert stored["terrain_observation"]
    assert len(stored["soil_observation"]) >= 3
    assert [isinstance(each, tuple) for each in outcomes] == [False, False, True, False, False, True]
    assert outcomes[2][1].startswith(str(folder / "spoilt" / "wheel.csv") + ", row 2, column load_N: 'abc'")
    assert [outcomes[index].known for index in (0, 1, 3, 4)] == [False, False, False, True]
    assert "physics" in str(stored["drive"])


@pytest.fixture(params=["by_processes", "by_cluster"])
def way(request):
    return request.getfixturevalue(request.param)


def test_processes_and_clusters_give_the_same_database_and_outcomes(way, one_by_one):
    stored, outcomes = way
    assert stored == one_by_one[0]
    assert outcomes == one_by_one[1]


@pytest.mark.end_to_end
def test_a_process_that_dies_costs_its_recording_alone(folder, readers, tmp_path):
    given = [folder / name for name in ("wheels1", "a.deadly", "wheels2")]
    outcomes = run_traverses(given, tmp_path / "t.db", workers=2)
    first, dead, last = outcomes
    assert dead.problem.startswith(f"{folder / 'a.deadly'}: its worker process died")
    assert first.observations_new
    assert last.observations_new
    assert len(rows(tmp_path / "t.db")["drive"]) == 2


@pytest.mark.end_to_end
def test_a_worker_of_a_cluster_that_dies_is_a_line_and_the_cluster_goes_on(folder, cluster, by_cluster, tmp_path):
    with cluster.get_client() as client:
        # One by one: this cluster takes for dead what waited at the same worker, too.
        (dead,) = run_traverses([folder / "a.deadly"], tmp_path / "t.db", client=client)
        (good,) = run_traverses([folder / "wheels2"], tmp_path / "t.db", client=client)
    assert "its worker on the cluster died" in dead.problem
    assert good.observations_new


@pytest.mark.end_to_end
@pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")
def test_ctrl_c_keeps_what_was_stored_and_leaves_no_process(folder, readers, tmp_path):
    database, begun = tmp_path / "t.db", folder / "a.begun"
    # A shell's background job hands SIGINT down as ignored, to the tests and from them to what they start.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += "from bevameter.framework.cli.main import app; app()"
    given = [str(folder / name) for name in ("wheels1", "a.endless", "wheels2")]
    process = subprocess.Popen(
        [sys.executable, "-c", code, "--quiet", "run", *given, "--workers", "2", "--db", str(database)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    try:
        until = time.monotonic() + 100.0
        while not (begun.exists() and begun.read_text() and names(database)):
            assert process.poll() is None
            assert time.monotonic() < until
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all processes
        out, error = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode in (130, -signal.SIGINT)
    assert out == ""
    assert error.splitlines() == [
        "bevameter: 1 of 3 recordings are stored; the same command processes the rest",
        "bevameter: interrupted; what was stored is whole",
    ]
    assert names(database) == ["testbed-1"]
    with pytest.raises(ProcessLookupError):
        os.kill(int(begun.read_text()), 0)
    again = run_traverses([folder / "wheels1", folder / "wheels2"], database)
    assert [each.known for each in again] == [True, False]


def names(database: Path) -> list[str]:
    opened = TerrainDatabase(database)
    return [drive.name for drive in opened.drives()] if opened.there else []


class Threads:
    """Stands for the processes of `LocalWorkers`, whose start takes seconds."""

    def __init__(self, count):
        self.pool = ThreadPoolExecutor(count)

    def submit(self, function, *arguments):
        return self.pool.submit(function, *arguments)

    def shared(self, value):
        return value

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.pool.shutdown()


def test_each_recording_gets_the_models_of_its_world(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "LocalWorkers", Threads)
    given = [tmp_path / "made", tmp_path / "real"]
    for path, site in zip(given, ("synthetic pit", "quarry"), strict=True):
        shutil.copytree(folder / "senses", path)
        (path / "recording.toml").write_text(f'site = "{site}"\nstart_time = 2025-06-01T09:00:00Z\n')
    for at_once, name in ((2, "t.db"), (1, "o.db")):
        synthetic, real = run_traverses(given, tmp_path / name, workers=at_once)
        used = [{each.sense: each.model for each in one.senses if each.model} for one in (synthetic, real)]
        assert used[0] == {"camera": "vision-synthetic", "microphone": "audio-synthetic"}
        assert used[1]["camera"] == "vision-real"
        assert any(warning.startswith("vision-real knows ") for warning in real.warnings)
        assert not any("vision" in warning for warning in synthetic.warnings)
    assert rows(tmp_path / "t.db") == rows(tmp_path / "o.db")


def test_what_waits_behind_a_slow_recording_is_bounded(tmp_path, monkeypatch):
    begun = []

    def attempt(recording, sent, placement):
        begun.append(recording.name)
        if recording.name == "0":
            time.sleep(0.5)
        return batch.FailedRecording(str(recording), f"{len(begun)} were begun")

    monkeypatch.setattr(batch, "LocalWorkers", Threads)
    monkeypatch.setattr(batch, "MOST_AHEAD", 2)
    monkeypatch.setattr(batch, "_attempt", attempt)
    given = [tmp_path / str(number) for number in range(5)]
    outcomes = run_traverses(given, tmp_path / "t.db", workers=4)
    assert [outcome.source for outcome in outcomes] == list(map(str, given))
    assert outcomes[0].problem == "2 were begun"


def test_a_defect_costs_its_recording_alone_and_its_place_is_named(folder, tmp_path, monkeypatch):
    def fault(path, **options):
        if path.name == "wheels1":
            raise ZeroDivisionError("division\nby zero")
        return read_recording(path, **options)

    monkeypatch.setattr("bevameter.framework.conditions.read_recording", fault)
    bad, good = run_traverses([folder / "wheels1", folder / "wheels2"], tmp_path / "t.db")
    assert bad.problem.startswith(f"{folder / 'wheels1'}: ZeroDivisionError: division by zero, test_batch.py line")
    assert good.observations_new


def test_what_the_callback_raises_ends_the_run(folder, tmp_path):
    def stop(stage, share):
        if stage == "reading":
            raise TimeoutError("long enough")

    with pytest.raises(TimeoutError, match="long enough"):
        run_traverses([folder / "wheels1", folder / "wheels2"], tmp_path / "t.db", progress=stop)
    assert not (tmp_path / "t.db").exists()


def test_a_site_that_no_database_takes_costs_its_recording_alone(folder, tmp_path):
    shutil.copytree(folder / "wheels1", tmp_path / "odd")
    about = tmp_path / "odd" / "recording.toml"
    kept = [line for line in about.read_text().splitlines() if not line.startswith("site")]
    about.write_text("\n".join([f'site = "{"x" * 300}"', *kept]) + "\n")
    bad, good = run_traverses([tmp_path / "odd", folder / "wheels2"], tmp_path / "t.db")
    assert bad.problem.startswith(f"{tmp_path / 'odd'}: ")
    assert "300 letters" in bad.problem
    assert good.observations_new


def test_a_worker_of_another_version_is_refused(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("bevameter.framework.traverse.METHOD", "another")  # conditions keep the version of the import
    (bad,) = run_traverses([folder / "wheels1"], tmp_path / "t.db")
    assert "worker: runs another (expected the version that the run was started with" in bad.problem


def test_what_all_recordings_share_is_refused_before_the_work(folder, tmp_path):
    given, database = [folder / "wheels1", folder / "wheels2"], tmp_path / "t.db"
    for said, recordings, options in (
        ("^recordings: ", str(given[0]), {}),
        ("^recordings: ", read_recording(given[0]), {}),
        ("^recordings: None", [None], {}),
        ("^recordings: 'testbed-1', which was read", [read_recording(given[0]), given[1]], {"workers": 2}),
        ("^workers: 0", given, {"workers": 0}),
        ("^workers: 1.5", given, {"workers": 1.5}),
        ("^workers: 2, and a cluster", given, {"workers": 2, "client": object()}),
        ("no model", given, {"models": tmp_path}),
        ("^vehicle: 5", given, {"vehicle": 5}),
        ("^topics: 5", given, {"topics": 5}),
    ):
        with pytest.raises(InputError, match=said):
            run_traverses(recordings, database, **options)
    assert not database.exists()
    assert bevameter.run_traverses([], database) == ()


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nonsense", "foo://here:1"])
def test_a_scheduler_that_does_not_answer_is_one_line(address, folder, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="Dask is not installed: the extra `fleet`")
    monkeypatch.setattr(workers, "CONNECT_S", 0.5)
    assert f"Dask scheduler {address!r}" in refused(folder, tmp_path, "--dask", address)


def test_without_dask_the_line_says_what_to_install(folder, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "bevameter[fleet]" in refused(folder, tmp_path, "--dask", "127.0.0.1:1")


def test_a_cluster_and_processes_exclude_each_other(folder, tmp_path):
    assert "expected one of them" in refused(folder, tmp_path, "--dask", "127.0.0.1:1", "--workers", "2")


def refused(folder: Path, tmp_path: Path, *options: str) -> str:
    result = CliRunner().invoke(app, ["run", str(folder / "wheels1"), "--db", str(tmp_path / "t.db"), *options])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "t.db").exists()
    return result.stderr
