"""Every kind of damage that is put into a database is found, and named by table, row and value."""

from __future__ import annotations

import dataclasses
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database.check import check
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator

VALUES = dict(zip(PARAMETERS, (700.0, 0.5, 0.02, 4e5, 0.9), strict=True))
PHYSICS = AugmentedSimulator({name: Estimate(value, 0.0) for name, value in VALUES.items()})


@pytest.fixture
def path(tmp_path, drive_with_soil, make) -> Path:
    """Two drives, eight stretches, physics of a class."""
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
        database.add_drive(make.drive("d2", start_time=None))
        database.add_physics("sand", PHYSICS, source="drive d1")
    return path


def changed(path: Path, statement: str, *values) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        connection.execute(statement, values)


def first_id(path: Path, table: str, where: str = "1") -> str:
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute(f"SELECT id FROM {table} WHERE {where} ORDER BY rowid").fetchone()[0]


def test_a_sound_database_has_no_fault_and_is_not_changed(path):
    before, beside = path.read_bytes(), sorted(path.parent.iterdir())
    report = check(path)
    assert report.sound
    assert report.faults == ()
    assert report.rows == {
        "drive": 2, "drive_import": 2, "terrain_observation": 6, "soil_observation": 8, "class_physics": 1,
    }  # fmt: skip
    assert path.read_bytes() == before
    assert sorted(path.parent.iterdir()) == beside


def test_a_log_that_was_left_behind_is_read_and_stays(path, make):
    keeps = sqlite3.connect(path)
    keeps.execute("SELECT * FROM drive").fetchall()  # the log stays as long as somebody reads
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("d3"))
    log = path.with_name("terrain.db-wal")
    before = path.read_bytes(), log.read_bytes()
    assert check(path).rows["drive"] == 3
    assert (path.read_bytes(), log.read_bytes()) == before
    keeps.close()


@pytest.mark.parametrize(
    ("table", "column", "value", "said"),
    [
        ("terrain_observation", "quality", "good", "quality: 'good', expected float"),
        ("terrain_observation", "quality", 1.5, "quality must lie in"),
        ("terrain_observation", "cell_x", 1.5e300, "cell_x: 1.5e"),
        ("terrain_observation", "cell_x", 2**40, "cell_x must be whole numbers"),
        ("terrain_observation", "probabilities", b"abc", "probabilities of another number of classes than 3"),
        ("terrain_observation", "probabilities", b"\xff" * 12, "probabilities must lie in"),
        ("terrain_observation", "probabilities", "text", "probabilities: 'text', expected bytes"),
        ("terrain_observation", "sense", "nose", "sense 'nose' is none of"),
        ("terrain_observation", "unknown", 7, "unknown: 7, expected true or false"),
        ("terrain_observation", "reasons", b"x", "reasons: b'x', expected str"),
        ("soil_observation", "estimate", "{}", "estimate: no 'mean_c_tan_phi'"),
        ("soil_observation", "estimate", "{", "estimate: "),
        ("soil_observation", "class_probabilities", '{"unknown": 1.0}', "the answer of a closed gate"),
        ("soil_observation", "class_probabilities", "[1]", "class_probabilities: "),
        ("soil_observation", "effects", '[{"slug": "x"}]', "effects: no 'parameters'"),
        ("soil_observation", "x_m", "west", "x_m: 'west', expected float"),
        ("soil_observation", "end_s", -1.0, "is none"),
        ("drive", "classes", '["Sand", "sand", "clay"]', "'Sand' and 'sand'"),
        ("drive", "classes", "[1, 2, 3]", "expected names"),
        ("drive", "models", "4", "drive 'drive d1': "),
        ("drive", "start_time", "yesterday", "start_time: "),
        ("drive", "cell_size_m", -1.0, "cell_size_m must be positive"),
        ("drive", "site", "elsewhere", "is not what its identity says"),
        ("drive", "recording_digest", "d9", "is not what its identity says"),
        ("drive", "method", "method 2", "is not what its identity says"),
        ("drive_import", "imported_at", "?", "imported_at: "),
        ("class_physics", "physics", '{"schema": 1, "soil": {}, "effects": []}', "physics"),
        ("class_physics", "source", "drive d9", "is not what its identity says"),
        ("class_physics", "class_name", "unknown", "the answer of a closed gate"),
    ],
)  # fmt: skip
def test_a_damaged_row_is_named(path, table, column, value, said):
    identity = first_id(path, table)
    changed(path, f"UPDATE {table} SET {column} = ? WHERE id = ?", value, identity)
    report = check(path)
    assert not report.sound
    (fault, *further) = [each for each in report.faults if each.damaged and each.id]
    assert (fault.table, fault.id, further) == (table, identity, [])
    assert said in fault.problem
    assert "\n" not in fault.as_dict()["problem"]


@pytest.mark.parametrize("table", ["drive", "terrain_observation", "soil_observation", "class_physics"])
@pytest.mark.parametrize("kept", [b"no \xff text", "0123", "A" * 32])
def test_an_identity_that_is_none_is_named(path, table, kept):
    statement = f"UPDATE {table} SET id = CAST(? AS TEXT) WHERE id = ?"
    changed(path, statement, kept, first_id(path, table))
    shown = kept.decode(errors="surrogateescape") if isinstance(kept, bytes) else kept
    (fault,) = [each for each in check(path).faults if each.damaged and each.id]
    assert (fault.table, fault.id) == (table, shown)
    fault.as_dict()["id"].encode()


def test_text_that_is_none_is_named(path):
    identity = first_id(path, "soil_observation")
    changed(path, "UPDATE soil_observation SET gate_reason = CAST(? AS TEXT) WHERE id = ?", b"\xff\xfe", identity)
    (fault,) = check(path).faults
    assert (fault.table, fault.id) == ("soil_observation", identity)
    assert "gate_reason" in fault.problem


def test_two_damaged_rows_of_one_drive_are_named_both(path):
    with closing(sqlite3.connect(path)) as connection:
        identities = [row[0] for row in connection.execute("SELECT id FROM terrain_observation ORDER BY rowid")]
    # One too long, one too short: together they have the right length.
    for identity, packed in ((identities[1], b"\0" * 8), (identities[3], b"\0" * 16)):
        changed(path, "UPDATE terrain_observation SET probabilities = ? WHERE id = ?", packed, identity)
    faults = check(path).faults
    assert {fault.id for fault in faults} == {identities[1], identities[3]}


def test_a_row_of_another_identity_is_named(path):
    other = "0" * 31 + "1"
    changed(path, "UPDATE terrain_observation SET id = ? WHERE id = ?", other, first_id(path, "terrain_observation"))
    strange, lost = check(path).faults
    assert (strange.table, strange.id) == ("terrain_observation", other)
    assert "that of no row of drive" in strange.problem
    assert (lost.table, lost.damaged) == ("drive", False)
    assert lost.problem == "1 of its rows of terrain_observation are lost"


@pytest.mark.parametrize("table", ["terrain_observation", "soil_observation"])
def test_lost_rows_are_counted(path, table):
    for _ in range(2):
        changed(path, f"DELETE FROM {table} WHERE id = ?", first_id(path, table))
    (fault,) = check(path).faults
    assert fault.problem == f"2 of its rows of {table} are lost"


def test_observations_without_their_drive_are_named(path):
    identity = first_id(path, "drive")
    changed(path, "DELETE FROM drive WHERE id = ?", identity)
    faults = {fault.table: fault.problem for fault in check(path).faults}
    assert faults == {
        "drive_import": f"1 of drive {identity}, which is not there",
        "terrain_observation": f"4 of drive {identity}, which is not there",
        "soil_observation": f"8 of drive {identity}, which is not there",
    }


def test_a_drive_that_was_never_imported_is_named(path):
    identity = first_id(path, "drive")
    changed(path, "DELETE FROM drive_import WHERE drive_id = ?", identity)
    (fault,) = check(path).faults
    assert (fault.table, fault.id, fault.damaged) == ("drive", identity, False)


def test_class_names_that_are_one_are_named(path, make):
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("d3", make.seen([(0, 0)], [[0.1, 0.9]], classes=("Clay", "sand"))))
    (fault,) = check(path).faults
    assert "'Clay' and 'clay' differ in case or spaces only" in fault.problem


def test_a_table_that_is_not_there_and_a_version_that_is_not_stated_are_named(path):
    changed(path, "DROP TABLE class_physics")
    changed(path, "DELETE FROM bevameter_schema")
    assert {(fault.table, fault.problem) for fault in check(path).faults} == {
        ("class_physics", "the table is not there"), ("bevameter_schema", "no version is stated"),
    }  # fmt: skip


def test_an_older_schema_is_no_fault_and_is_not_migrated(path):
    changed(path, "DROP TABLE class_physics")
    changed(path, "UPDATE bevameter_schema SET version_num = '0001'")
    before = path.read_bytes()
    assert check(path).sound
    assert path.read_bytes() == before


def test_a_damaged_page_is_named(path):
    data = bytearray(path.read_bytes())
    with closing(sqlite3.connect(path)) as connection:
        root = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'soil_observation'").fetchone()[0]
    data[(root - 1) * 4096 : root * 4096] = b"\xa5" * 4096
    path.write_bytes(data)
    problems = [(fault.table, fault.problem) for fault in check(path).faults]
    assert any(problem.startswith("integrity check of SQLite: ") for table, problem in problems if not table)
    assert any(table == "soil_observation" and "malformed" in problem for table, problem in problems)


def test_a_file_that_is_cut_off_is_named(path):
    path.write_bytes(path.read_bytes()[:9000])
    assert not check(path).sound


def test_an_index_that_differs_from_its_table_is_named(path):
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(
            "PRAGMA writable_schema = ON;"
            "UPDATE sqlite_master SET sql = replace(sql, 'drive_id, sense', 'drive_id, reasons')"
            " WHERE name = 'ix_terrain_observation_drive_sense'"
        )
    assert any("integrity check" in fault.problem for fault in check(path).faults)


def test_what_is_no_database_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        check(tmp_path / "none.db")
    (tmp_path / "notes.db").write_text("dear diary\n" * 100)
    with pytest.raises(InputError, match="is not a database"):
        check(tmp_path / "notes.db")


def test_a_newer_schema_is_bad_input(path):
    changed(path, "UPDATE bevameter_schema SET version_num = '9999'")
    with pytest.raises(InputError, match=r"terrain\.db: its schema '9999' is of a newer version"):
        check(path)


def test_a_cell_size_in_whole_metres_is_the_same_drive(tmp_path, make):
    drive = make.drive(terrain=make.seen([(0, 0)], [[0.1, 0.9]], cell_size_m=1))
    assert drive.id == dataclasses.replace(drive, terrain=make.seen([(0, 0)], [[0.1, 0.9]], cell_size_m=1.0)).id
    with TerrainDatabase(tmp_path / "t.db") as database:
        database.add_drive(drive)
    assert check(tmp_path / "t.db").sound
