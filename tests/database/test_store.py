import dataclasses
import math
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import textwrap
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database import store as store_module
from bevameter.database.observations import SoilEffect, TerrainObservations
from bevameter.database.store import Added
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import create_engine, inspect, make_url, text

TABLES = ("drive", "drive_import", "terrain_observation", "soil_observation")


def content(path: Path) -> dict[str, list]:
    """Every row of every table, in an order that does not depend on the order of insertion."""
    engine = create_engine(f"sqlite:///{path}")
    with engine.connect() as connection:
        rows = {table: sorted(map(repr, connection.execute(text(f"SELECT * FROM {table}")).all())) for table in TABLES}
    engine.dispose()
    return rows


def test_a_drive_is_stored_once(tmp_path, drive_with_soil):
    path = tmp_path / "terrain.db"
    total = len(drive_with_soil.terrain) + len(drive_with_soil.soils)
    with TerrainDatabase(path) as database:
        assert database.add_drive(drive_with_soil) == Added(total, 0)
    before = content(path)
    with TerrainDatabase(path) as database:
        assert database.add_drive(drive_with_soil) == Added(0, total)
    assert content(path) == before
    assert not path.with_name("terrain.db-wal").exists()  # one file to copy


def test_drives_come_back_as_they_went_in(tmp_path, make):
    vague = dataclasses.replace(make.estimate().parameters["k_m"], sd=math.inf)
    odd = dataclasses.replace(make.estimate(), misfit=math.nan, parameters={"k_m": vague})
    soils = (
        dataclasses.replace(make.soil({"sand": 0.7, "clay": 0.3}), estimate=odd, x_m=math.nan),
        dataclasses.replace(make.soil({}, at_s=20.0), estimate=None, gate_reason="too fast", load_N=math.nan),
        make.soil({"sand": 1.0}, at_s=40.0, effects=(SoilEffect("slip_sinkage", {"n1": 0.2}),)),
    )
    terrain = make.seen(
        [(-5, 7), (2**31 - 1, -(2**31) + 1)], [[0.25, 0.75], [0.5, 0.5]], unknown=[False, True],
        reasons=[(), ("too dark", "two\nlines")], quality=[0.5, 0.0], sense="camera",
    )  # fmt: skip
    given = make.drive(terrain=terrain, soils=soils)
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.add_drive(given)
        (read,) = database.drives()
    assert read.id == given.id
    assert (read.name, read.started) == (given.name, given.started)
    assert read.terrain.evidence.classes == ("clay", "sand")
    order = np.argsort(read.terrain.time_s)
    assert read.terrain.cell_x[order].tolist() == [-5, 2**31 - 1]
    assert read.terrain.cell_y[order].tolist() == [7, -(2**31) + 1]
    assert read.terrain.evidence.probabilities[order].tolist() == [[0.25, 0.75], [0.5, 0.5]]
    assert read.terrain.evidence.unknown[order].tolist() == [False, True]
    assert read.terrain.evidence.reasons == ((), ("too dark", "two lines"))
    assert read.terrain.sense.tolist() == ["camera", "camera"]
    first, closed, effect = read.soils
    assert math.isnan(first.x_m)
    assert math.isnan(first.estimate.misfit)
    assert first.estimate.parameters["k_m"].sd == math.inf
    np.testing.assert_array_equal(first.estimate.covariance_c_tan_phi, odd.covariance_c_tan_phi)
    assert dict(first.class_probabilities) == {"sand": 0.7, "clay": 0.3}
    assert (closed.estimate, closed.gate_reason) == (None, "too fast")
    assert effect == dataclasses.replace(soils[2], estimate=effect.estimate)


def test_a_drive_without_observations_is_known_afterwards(tmp_path, make):
    nothing = make.drive(terrain=TerrainObservations.nothing())
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        assert database.add_drive(nothing) == Added(0, 0)
        assert len(database.drives()) == 1
        assert database.snapshot().class_names == ()


@pytest.mark.parametrize("fault", [KeyboardInterrupt, RuntimeError])
def test_an_interrupted_drive_leaves_nothing(tmp_path, drive_with_soil, make, monkeypatch, fault):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("earlier"))
        before = content(path)

        def breaks_off(drive):
            rows = list(original(drive))
            yield from rows[:3]
            raise fault

        original = store_module.soil_rows
        monkeypatch.setattr(store_module, "soil_rows", breaks_off)
        with pytest.raises(fault):
            database.add_drive(drive_with_soil)
        assert content(path) == before
        monkeypatch.setattr(store_module, "soil_rows", original)
        assert database.add_drive(drive_with_soil).new == len(drive_with_soil.terrain) + len(drive_with_soil.soils)


_CHILD = textwrap.dedent("""
    import os, sys
    import numpy as np
    from bevameter import ClassEvidence, TerrainDatabase
    from bevameter.database import store
    from bevameter.database.observations import Drive, TerrainObservations

    path, fate, *digests = sys.argv[1:]
    m = 12000 if fate == "dies" else 3000  # rows of which some are written before the process dies
    evidence = ClassEvidence(("sand",), np.ones((m, 1)), np.ones(m), np.zeros(m, dtype=bool), ((),) * m)
    cells = np.arange(m)
    terrain = TerrainObservations(0.5, cells, cells, cells.astype(float), np.full(m, "fused"), evidence)
    if fate == "dies":
        original = store.terrain_columns

        class Dying:
            def __init__(self, column):
                self.column = column
            def __iter__(self):
                yield from self.column[:11000]
                os._exit(9)

        def terrain_columns(drive):
            columns = original(drive)
            return {**columns, "reasons": Dying(columns["reasons"])}

        store.terrain_columns = terrain_columns
    new = 0
    for digest in digests:
        with TerrainDatabase(path) as database:
            new += database.add_drive(Drive(digest, digest, "s", "v", None, {}, "m", terrain)).new
    print(new)
""")


def child(path: Path, fate: str, *digests: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", _CHILD, str(path), fate, *digests],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_a_process_that_dies_half_way_leaves_nothing(tmp_path):
    path = tmp_path / "terrain.db"
    dying = child(path, "dies", "a")
    assert dying.wait(60) == 9
    dying.communicate()
    with TerrainDatabase(path, must_exist=True) as database:
        assert database.drives() == []
    assert all(rows == [] for rows in content(path).values())


def test_two_processes_write_the_same_new_file(tmp_path):
    path = tmp_path / "terrain.db"
    both = [child(path, "lives", "a", "b", "c"), child(path, "lives", "c", "d", "a")]
    outputs = [process.communicate(timeout=120) for process in both]
    assert [process.returncode for process in both] == [0, 0], outputs
    assert sum(int(out) for out, _ in outputs) == 4 * 3000  # every drive was new to just one of them
    assert len(content(path)["terrain_observation"]) == 4 * 3000


def test_only_the_newest_processing_of_a_recording_counts(tmp_path, make):
    old = make.drive("d1", make.seen([(0, 0)], [[1.0, 0.0]]), model="m1")
    new = make.drive("d1", make.seen([(0, 0)], [[0.0, 1.0]]), model="m2")
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.add_drive(old)
        database.add_drive(new)
        assert database.snapshot().at(0.1, 0.1).labels() == ["sand"]
        assert database.snapshot().at(0.1, 0.1).observation_count.tolist() == [1]
        assert len(database.drives()) == 2
        assert [drive.id for drive in database.drives(newest=True)] == [new.id]


def test_sites_do_not_mix(tmp_path, make):
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.add_drive(make.drive("d1", make.seen([(0, 0)], [[1.0, 0.0]]), site="quarry"))
        database.add_drive(make.drive("d2", make.seen([(0, 0)], [[0.0, 1.0]]), site="beach"))
        assert database.sites() == ["beach", "quarry"]
        assert database.snapshot("quarry").at(0.1, 0.1).labels() == ["clay"]
        assert database.snapshot("beach").at(0.1, 0.1).labels() == ["sand"]
        with pytest.raises(InputError, match=r"several sites.*beach, quarry"):
            database.snapshot()
        with pytest.raises(InputError, match=r"no site 'moon'.*beach, quarry"):
            database.snapshot("moon")


def test_a_recording_whose_site_was_put_right_leaves_the_wrong_one(tmp_path, make):
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.add_drive(make.drive("d1", site="wrong"))
        database.add_drive(make.drive("d1", site="right"))
        assert database.sites() == ["right"]
        assert database.snapshot().site == "right"


@pytest.fixture(scope="module")
def empty_database(tmp_path_factory):
    path = tmp_path_factory.mktemp("empty") / "terrain.db"
    TerrainDatabase(path).make()
    return path


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(parts=st.lists(st.sets(st.tuples(st.integers(0, 3), st.integers(0, 1))), min_size=3, max_size=3))
def test_merging_is_set_union(tmp_path_factory, empty_database, make, parts):
    folder = tmp_path_factory.mktemp("merge")
    for name, part in zip("abc", parts, strict=True):
        shutil.copy(empty_database, folder / name)  # to make one takes longer than all that follows
        with TerrainDatabase(folder / name) as database:
            for digest, model in sorted(part):
                soils = (make.soil({"sand": 1.0}, 900.0 + digest),)
                database.add_drive(make.drive(str(digest), soils=soils, model=str(model)))

    def merged(*order: str) -> Path:
        path = folder / ("".join(order) + "-merged")
        shutil.copy(folder / order[0], path)
        with TerrainDatabase(path) as target:
            for name in order[1:]:
                with TerrainDatabase(folder / name, must_exist=True) as source:
                    target.merge(source)
        return path

    union = content(merged("a", "b", "c"))
    assert content(merged("c", "b", "a")) == union  # commutative, associative
    assert content(merged("a", "b", "c", "a", "b")) == union  # idempotent
    assert len(union["drive"]) == len(set.union(*parts))
    assert len(union["terrain_observation"]) == 2 * len(set.union(*parts))


def test_merging_says_what_was_new_and_does_not_touch_the_other(tmp_path, make):
    with TerrainDatabase(tmp_path / "a.db") as one, TerrainDatabase(tmp_path / "b.db") as two:
        one.add_drive(make.drive("d1"))
        two.add_drive(make.drive("d1"))
        two.add_drive(make.drive("d2", soils=(make.soil({"sand": 1.0}),)))
        before = content(tmp_path / "b.db")
        assert one.merge(two) == Added(3, 2)
        assert one.merge(two) == Added(0, 5)
        assert one.merge(one) == Added(0, 5)
        assert content(tmp_path / "b.db") == before
        assert two.merge(one) == Added(0, 5)


def test_merging_says_how_far_it_is(tmp_path, make):
    said = []
    with TerrainDatabase(tmp_path / "a.db") as one, TerrainDatabase(tmp_path / "b.db") as two:
        for digest in "abcd":
            two.add_drive(make.drive(digest))
        one.merge(two, progress=lambda *report: said.append(report))
    assert said == [("merging", share) for share in (0.0, 0.25, 0.5, 0.75, 1.0)]


def test_merging_adds_what_a_drive_has_lost(tmp_path, drive_with_soil):
    with TerrainDatabase(tmp_path / "a.db") as one, TerrainDatabase(tmp_path / "b.db") as two:
        for database in (one, two):
            database.add_drive(drive_with_soil)
        whole = content(tmp_path / "b.db")
        for name, rows in (("a.db", "cell_x > 0"), ("b.db", "cell_x <= 0")):  # as many, but others
            with closing(sqlite3.connect(tmp_path / name)) as connection, connection:
                connection.execute(f"DELETE FROM terrain_observation WHERE {rows}")
                connection.execute("DELETE FROM soil_observation WHERE start_s = 30.0")
        assert one.merge(two) == Added(2, 6)
        assert content(tmp_path / "a.db")["terrain_observation"] == whole["terrain_observation"]


_MERGING = textwrap.dedent("""
    import sys, time
    from bevameter import TerrainDatabase
    from bevameter.database import merge

    original, portions = merge.insert_columns, []

    def insert_columns(connection, row_type, columns):
        portions.append(columns)
        if len(portions) == 8:
            print("in the second portion of the third drive", flush=True)
            time.sleep(60)
        return original(connection, row_type, columns)

    merge.insert_columns, merge.PORTION = insert_columns, 2
    with TerrainDatabase(sys.argv[1]) as target, TerrainDatabase(sys.argv[2], must_exist=True) as source:
        target.merge(source)
""")


@pytest.mark.skipif(os.name == "nt", reason="POSIX has SIGKILL")
def test_a_merge_that_is_killed_goes_on_where_it_was(tmp_path, make):
    soils = tuple(make.soil({"sand": 1.0}, at_s=10.0 * index) for index in range(3))
    with TerrainDatabase(tmp_path / "a.db") as one, TerrainDatabase(tmp_path / "b.db") as two:
        one.add_drive(make.drive("own"))
        for digest in "abcde":
            two.add_drive(make.drive(digest, soils=soils))
    command = [sys.executable, "-c", _MERGING, str(tmp_path / "a.db"), str(tmp_path / "b.db")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "in the second portion of the third drive\n"
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    with TerrainDatabase(tmp_path / "a.db") as one, TerrainDatabase(tmp_path / "b.db") as two:
        assert [len(drive.soils) for drive in one.drives()] == [0, 3, 3]
        assert len(content(tmp_path / "a.db")["drive"]) == 4  # of the third a part, which nothing uses
        assert one.merge(two) == Added(3 * 5 - 2, 2 * 5 + 2)
        assert {drive.id for drive in two.drives()} < {drive.id for drive in one.drives()}
        assert [len(drive.terrain) for drive in one.drives()] == [2] * 6


def test_a_file_that_is_removed_is_missed_and_made_anew_only_by_writing(tmp_path, drive_with_soil):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
        path.unlink()
        assert not database.there
        with pytest.raises(InputError, match="no such file"):
            database.snapshot()
        assert not path.exists()
        assert database.add_drive(drive_with_soil).new > 0
        assert database.snapshot().drives == 1


def test_a_server_with_tables_of_another_program_is_left_alone(server, drive_with_soil):
    engine = create_engine(make_url(server).set(drivername="postgresql+psycopg"))
    with engine.begin() as connection:
        connection.execute(text("CREATE TABLE people (name TEXT)"))
    with pytest.raises(InputError, match="tables of another program \\(people\\)"):
        TerrainDatabase(server).add_drive(drive_with_soil)
    with engine.connect() as connection:
        assert inspect(connection).get_table_names() == ["people"]
    engine.dispose()
