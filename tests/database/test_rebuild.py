"""A damaged file is written anew: every sound row is kept, every other one named, the damaged file not touched."""

from __future__ import annotations

import os
import shutil
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database.check import check
from bevameter.database.rebuild import rebuild
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator
from hypothesis import given, settings
from hypothesis import strategies as st
from old_schema import TO_FIRST

PAGE = 4096
VALUES = dict(zip(PARAMETERS, (700.0, 0.5, 0.02, 4e5, 0.9), strict=True))
PHYSICS = AugmentedSimulator({name: Estimate(value, 0.0) for name, value in VALUES.items()})
TABLES = ("drive", "drive_import", "terrain_observation", "soil_observation", "class_physics")


@pytest.fixture(scope="module")
def whole(make, tmp_path_factory) -> Path:
    """Three drives of several pages each."""
    path = tmp_path_factory.mktemp("whole") / "t.db"
    rng = np.random.default_rng(3)
    with TerrainDatabase(path) as database:
        for number in range(3):
            cells = [(i, number) for i in range(150)]
            terrain = make.seen(cells, rng.dirichlet((1.0, 1.0), 150).tolist())
            soils = tuple(make.soil({"sand": 1.0}, at_s=10.0 * index) for index in range(6))
            database.add_drive(make.drive(f"d{number}", terrain, soils))
        database.add_physics("sand", PHYSICS, source="d1")
    return path


@pytest.fixture
def path(whole, tmp_path) -> Path:
    shutil.copy(whole, tmp_path / "t.db")
    return tmp_path / "t.db"


def rows(path: Path) -> dict[str, set]:
    with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as connection:
        return {table: set(connection.execute(f"SELECT * FROM {table}")) for table in TABLES}


def test_a_sound_file_comes_out_as_it_was(path):
    before = path.read_bytes()
    rebuilt = rebuild(path, path.with_name("new.db"))
    assert rebuilt.faults == ()
    assert rebuilt.rows == check(path).rows
    assert path.read_bytes() == before
    assert sorted(each.name for each in path.parent.iterdir()) == ["new.db", "t.db"]
    assert rows(path.with_name("new.db")) == rows(path)


def test_damaged_rows_are_left_out_and_named(path):
    before = rows(path)
    with closing(sqlite3.connect(path)) as connection, connection:
        spoilt = [row[0] for row in connection.execute("SELECT id FROM terrain_observation WHERE cell_x % 50 = 7")]
        connection.executemany("UPDATE terrain_observation SET quality = 7 WHERE id = ?", [(each,) for each in spoilt])
        connection.execute("UPDATE soil_observation SET id = CAST(x'ff00' AS TEXT) WHERE rowid = 4")
        connection.execute("UPDATE soil_observation SET id = x'ff01' WHERE rowid = 5")
    damaged = path.read_bytes()
    rebuilt = rebuild(path, path.with_name("new.db"))
    assert path.read_bytes() == damaged
    assert {fault.id for fault in rebuilt.faults if fault.table == "terrain_observation"} == set(spoilt)
    assert len([fault for fault in rebuilt.faults if fault.table == "soil_observation"]) == 2
    assert sum("of its rows of terrain_observation are lost" in fault.problem for fault in rebuilt.faults) == 3
    after = rows(path.with_name("new.db"))
    assert after["terrain_observation"] == {row for row in before["terrain_observation"] if row[0] not in spoilt}
    assert len(after["soil_observation"]) == 16
    assert after["soil_observation"] < before["soil_observation"]


def test_a_drive_that_is_lost_takes_its_observations_along(path):
    with closing(sqlite3.connect(path)) as connection, connection:
        (identity,) = connection.execute("SELECT id FROM drive WHERE name = 'drive d1'").fetchone()
        connection.execute("UPDATE drive SET site = 'elsewhere' WHERE id = ?", (identity,))
        connection.execute("DELETE FROM drive WHERE name = 'drive d2'")
    rebuilt = rebuild(path, path.with_name("new.db"))
    assert (rebuilt.rows["drive"], rebuilt.rows["terrain_observation"], rebuilt.rows["soil_observation"]) == (1, 150, 6)
    assert f"150 rows are lost with drive {identity}" in {fault.problem for fault in rebuilt.faults}
    assert check(path.with_name("new.db")).sound


def test_a_drive_whose_imports_are_lost_is_kept_as_the_older(path, make):
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("d1", make.seen([(0, 1)], [[1.0, 0.0]]), model="m2"))
        older = next(drive for drive in database.drives() if drive.models == {"camera": "m2"})
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("DELETE FROM drive_import WHERE drive_id = ?", (older.id.hex,))
    rebuilt = rebuild(path, path.with_name("new.db"))
    assert [(fault.table, fault.id) for fault in rebuilt.faults] == [("drive", older.id.hex)]
    with TerrainDatabase(path.with_name("new.db"), must_exist=True) as database:
        assert len(database.drives()) == 4
        assert older.id not in {drive.id for drive in database.drives(newest=True)}


def pages_of(path: Path, table: str) -> list[int]:
    """Numbers of the leaf pages of a table."""
    with closing(sqlite3.connect(path)) as connection:
        try:
            query = "SELECT pageno FROM dbstat WHERE name = ? AND pagetype = 'leaf'"
            return [row[0] for row in connection.execute(query, (table,))]
        except sqlite3.OperationalError:
            pytest.skip("this SQLite has no dbstat")


@pytest.mark.parametrize("which", [0, 1, -1])
def test_a_damaged_page_costs_its_rows_alone(path, which):
    before = rows(path)
    number = pages_of(path, "terrain_observation")[which]
    data = bytearray(path.read_bytes())
    data[(number - 1) * PAGE : number * PAGE] = b"\0" * PAGE
    path.write_bytes(data)
    rebuilt = rebuild(path, path.with_name("new.db"))
    assert path.read_bytes() == data
    after = rows(path.with_name("new.db"))
    lost = before["terrain_observation"] - after["terrain_observation"]
    assert after["terrain_observation"] < before["terrain_observation"]
    assert 1 <= len(lost) <= PAGE // 80
    assert all(after[table] == before[table] for table in TABLES if table != "terrain_observation")
    (unread,) = [fault for fault in rebuilt.faults if fault.table == "terrain_observation"]
    assert "cannot be read" in unread.problem
    # Who has the rest brings it back.
    path.write_bytes(b"")
    with TerrainDatabase(path.with_name("new.db")) as database:
        assert sum(len(drive.terrain) for drive in database.drives()) == 450 - len(lost)


def test_a_copy_brings_back_what_was_lost(path, whole, tmp_path):
    shutil.copy(whole, tmp_path / "copy.db")
    number = pages_of(path, "terrain_observation")[2]
    data = bytearray(whole.read_bytes())
    data[(number - 1) * PAGE : number * PAGE] = b"\x5a" * PAGE
    path.write_bytes(data)
    rebuild(path, tmp_path / "new.db")
    with TerrainDatabase(tmp_path / "new.db") as database, TerrainDatabase(tmp_path / "copy.db") as other:
        assert database.merge(other).new > 0
    assert rows(tmp_path / "new.db") == rows(tmp_path / "copy.db")
    assert check(tmp_path / "new.db").sound


@settings(max_examples=8, deadline=None)
@given(
    where=st.lists(st.tuples(st.integers(2, 40), st.integers(0, PAGE - 64)), min_size=1, max_size=4),
    what=st.binary(min_size=64, max_size=64),
)
def test_whatever_is_damaged_the_new_file_is_sound_or_says_what_it_lacks(whole, where, what):
    """Bytes anywhere past the list of tables."""
    data = bytearray(whole.read_bytes())
    for page, offset in where:
        start = min((page - 1) * PAGE + offset, len(data) - 64)
        data[start : start + 64] = what
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "t.db"
        path.write_bytes(data)
        rebuilt = rebuild(path, Path(folder) / "new.db")
        assert path.read_bytes() == data
        report = check(Path(folder) / "new.db")
        assert not [fault for fault in report.faults if fault.damaged]
        assert set(report.faults) <= set(rebuilt.faults)
        with TerrainDatabase(Path(folder) / "new.db", must_exist=True) as database:
            database.drives()


def test_a_file_that_is_cut_off_gives_what_is_left(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    rebuilt = rebuild(path, path.with_name("new.db"))
    assert rebuilt.faults
    assert rebuilt.rows["terrain_observation"] > 0
    assert not [fault for fault in check(path.with_name("new.db")).faults if fault.damaged]


def test_an_older_schema_is_rebuilt_at_the_newest(path):
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(TO_FIRST)
    assert rebuild(path, path.with_name("new.db")).faults == ()
    assert rows(path.with_name("new.db"))["class_physics"] == set()


@pytest.mark.parametrize(
    ("new", "said"), [("t.db", "is there already"), ("no/new.db", "there is no folder"), ("", "is there already")]
)
def test_a_new_file_has_to_be_one(path, new, said):
    before = path.read_bytes()
    with pytest.raises(InputError, match=said):
        rebuild(path, path.parent / new)
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == ["t.db"]


def test_what_cannot_be_rebuilt_is_bad_input(tmp_path, path):
    with pytest.raises(InputError, match="no such file"):
        rebuild(tmp_path / "none.db", tmp_path / "new.db")
    with pytest.raises(InputError, match="is no SQLite file"):
        rebuild("postgresql://me@nowhere/terrain", tmp_path / "new.db")
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match="list of tables cannot be read"):
        rebuild(path, tmp_path / "new.db")
    assert not (tmp_path / "new.db").exists()


def test_an_interrupted_rebuild_leaves_no_file(path):
    def stop(stage: str, share: float) -> None:
        if stage == "checking":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rebuild(path, path.with_name("new.db"), progress=stop)
    assert [each.name for each in path.parent.iterdir()] == ["t.db"]
