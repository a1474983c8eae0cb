import os
import socket
import sqlite3
from contextlib import closing
from pathlib import Path

import bevameter.database.migrations
import pytest
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from bevameter import InputError, TerrainDatabase
from bevameter.database import schema
from bevameter.database.check import check
from bevameter.database.info import info
from bevameter.database.maintenance import Migrated, migrate, prune
from bevameter.database.store import Added
from bevameter.database.tables import Base
from sqlalchemy import create_engine, text


def foreign(path: Path, statements: str) -> None:
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(statements)


def test_the_revisions_are_those_in_the_folder():
    config = Config()
    config.set_main_option("script_location", str(Path(bevameter.database.migrations.__file__).parent))
    found = [script.revision for script in ScriptDirectory.from_config(config).walk_revisions()]
    assert tuple(reversed(found)) == schema.REVISIONS


def test_migrations_make_the_tables_that_the_code_expects(tmp_path):
    TerrainDatabase(tmp_path / "terrain.db").close()
    engine = create_engine(f"sqlite:///{tmp_path / 'terrain.db'}")
    with engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"version_table": schema.VERSION_TABLE})
        differences = [entry for entry in compare_metadata(context, Base.metadata) if entry[0] != "remove_table"]
        assert differences == []
        assert context.get_current_revision() == schema.REVISIONS[-1]
    engine.dispose()


def test_a_new_database_opens_again_for_reading(tmp_path, drive_with_soil):
    path = tmp_path / "with space % and ü.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
    before = path.read_bytes()
    with TerrainDatabase(f"sqlite:///{path}", must_exist=True) as database:
        assert database.name == str(path)
        assert database.snapshot().drives == 1
    assert path.read_bytes() == before


def test_opening_for_reading_makes_nothing(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        TerrainDatabase(tmp_path / "missing.db", must_exist=True)
    (tmp_path / "empty.db").touch()
    with pytest.raises(InputError, match="is empty"):
        TerrainDatabase(tmp_path / "empty.db", must_exist=True)
    assert [path.name for path in tmp_path.iterdir()] == ["empty.db"]
    assert (tmp_path / "empty.db").stat().st_size == 0


@pytest.mark.parametrize("must_exist", [True, False])
@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("CREATE TABLE people (name TEXT)", "another program.*people"),
        ("PRAGMA journal_mode = WAL; CREATE TABLE people (name TEXT)", "another program.*people"),
        ("CREATE TABLE drive (name TEXT)", "another program"),
        ("PRAGMA application_id = 77; CREATE TABLE t (x)", "another program"),
        ("PRAGMA application_id = 77; CREATE TABLE t (x); DROP TABLE t", "another program"),
        ("CREATE TABLE bevameter_schema (version_num TEXT); INSERT INTO bevameter_schema VALUES ('9999')", "newer"),
        ("CREATE TABLE bevameter_schema (version_num TEXT); INSERT INTO bevameter_schema VALUES ('0001')", "lacks"),
    ],
)
def test_databases_of_others_are_left_alone(tmp_path, content, said, must_exist):
    path = tmp_path / "other.db"
    foreign(path, content)
    before = path.read_bytes()
    with pytest.raises(InputError, match=said) as caught:
        TerrainDatabase(path, must_exist=must_exist)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("must_exist", [True, False])
def test_files_that_are_no_database_are_left_alone(tmp_path, must_exist):
    text = tmp_path / "notes.db"
    text.write_text("dear diary\n" * 100)
    with pytest.raises(InputError, match=r"notes\.db: is not a database"):
        TerrainDatabase(text, must_exist=must_exist)
    with pytest.raises(InputError, match="is a folder"):
        TerrainDatabase(tmp_path, must_exist=must_exist)
    assert text.read_text() == "dear diary\n" * 100


def test_a_truncated_database_is_one_line(tmp_path, drive_with_soil):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
    path.write_bytes(path.read_bytes()[:9000])
    with pytest.raises(InputError) as caught, TerrainDatabase(path, must_exist=True) as database:
        database.snapshot()
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "column", "value", "said"),
    [
        ("soil_observation", "estimate", "{}", "soil from 0.0 s to 5.0 s: estimate: no 'mean_c_tan_phi'"),
        ("soil_observation", "estimate", "[]", "estimate: "),
        ("soil_observation", "class_probabilities", "[1]", "class_probabilities: "),
        ("soil_observation", "class_probabilities", "null", "class_probabilities: "),
        ("soil_observation", "class_probabilities", '{"sand": [1]}', "class_probabilities: "),
        ("soil_observation", "effects", "3", "effects: "),
        ("soil_observation", "effects", '[{"slug": "x"}]', "effects: no 'parameters'"),
        ("terrain_observation", "quality", "good", "drive 'drive d1': .*good"),
        ("terrain_observation", "cell_x", 1.5e300, "drive 'drive d1': "),
        ("terrain_observation", "probabilities", b"abc", "drive 'drive d1': "),
        ("terrain_observation", "probabilities", "text", "drive 'drive d1': "),
        ("drive", "classes", "[1, 2, 3]", "classes .*expected names"),
        ("drive", "classes", "null", "drive 'drive d1': "),
        ("drive", "models", "4", "drive 'drive d1': "),
    ],
)
def test_what_is_damaged_is_named_in_one_line(tmp_path, drive_with_soil, table, column, value, said):
    path = tmp_path / "t.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(f"UPDATE {table} SET {column} = ?", (value,))
    with (
        TerrainDatabase(path, must_exist=True) as database,
        pytest.raises(InputError, match=rf"t.db: holds what cannot be read: .*{said}") as caught,
    ):
        database.snapshot()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("mean", [[-5000, -3], [1e9, 0.5], [500, 40]])
def test_an_estimate_of_no_soil_is_not_answered(tmp_path, drive_with_soil, mean):
    path = tmp_path / "t.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
    with closing(sqlite3.connect(path)) as connection, connection:
        statement = "UPDATE soil_observation SET estimate = json_set(estimate, '$.mean_c_tan_phi', json(?))"
        connection.execute(statement, (str(mean),))
    with (
        TerrainDatabase(path, must_exist=True) as database,
        pytest.raises(InputError, match=r"mean_c_tan_phi .*no soil"),
    ):
        database.snapshot()


def test_a_missing_folder_is_reported(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        TerrainDatabase(tmp_path / "nowhere" / "terrain.db")


@pytest.mark.skipif(
    os.name == "nt" or not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere"
)
def test_a_file_that_may_not_be_written_is_reported(tmp_path, drive_with_soil):
    path = tmp_path / "terrain.db"
    TerrainDatabase(path).close()
    path.chmod(0o444)
    with TerrainDatabase(path) as database, pytest.raises(InputError, match="readonly"):
        database.add_drive(drive_with_soil)


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("", "an empty path"),
        ("sqlite://", "no file is named"),
        ("sqlite:///:memory:", "no file is named"),
        ("mysql://root@host/terrain", "'mysql'"),
        ("://nonsense", "not a URL"),
        ("sqlite:///x.db?timeout=abc", "x.db.*: an option that cannot be read: .*'abc'"),
        ("sqlite:///x.db?timeout=1&timeout=2", "x.db.*: an option that cannot be read"),
        ({}, "database: {} .expected a path or an SQLAlchemy URL"),
        (None, "database: None"),
    ],
)
def test_urls_that_cannot_be_used(url, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=said):
        TerrainDatabase(url)
    assert not list(tmp_path.iterdir())


def test_a_server_that_does_not_answer_is_one_line_without_its_password():
    pytest.importorskip("psycopg")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError) as caught:
        TerrainDatabase(f"postgresql://me:s3cret@127.0.0.1:{port}/terrain")
    assert "\n" not in str(caught.value)
    assert "s3cret" not in str(caught.value)


def test_the_same_on_postgresql(server, tmp_path, drive_with_soil, make):
    total = len(drive_with_soil.terrain) + len(drive_with_soil.soils)
    with pytest.raises(InputError, match="holds no terrain database"):
        TerrainDatabase(server, must_exist=True)
    with TerrainDatabase(server) as database, TerrainDatabase(tmp_path / "terrain.db") as file:
        assert database.add_drive(drive_with_soil) == Added(total, 0)
        assert database.add_drive(drive_with_soil) == Added(0, total)
        file.add_drive(make.drive("d2", soils=(make.soil({"sand": 1.0}),)))
        assert database.merge(file) == Added(3, 0)
        assert file.merge(database) == Added(total, 3)
        there, here = database.snapshot(), file.snapshot()
        place = [[0.1, 0.1], [0.6, 0.1], [1.1, 0.1]]
        assert there.along(place).shear_strength_lower.tolist()[:2] == pytest.approx(
            here.along(place).shear_strength_lower.tolist()[:2]
        )
        assert there.along(place).reason.tolist() == here.along(place).reason.tolist()
        assert [drive.id for drive in database.drives()] == [drive_with_soil.id, make.drive("d2").id]


def test_care_of_a_database_on_postgresql(server, drive_with_soil, make):
    with TerrainDatabase(server) as database:
        database.add_drive(make.drive("d1", model="m0"))
        database.add_drive(drive_with_soil)
        database.add_drive(drive_with_soil)
        before = database.snapshot().along([[0.1, 0.1]]).shear_strength_lower.tolist()
        (superseded,) = prune(database).drives
        assert superseded.observations == 2
        assert database.drive(superseded.id) is None
        assert database.snapshot().along([[0.1, 0.1]]).shear_strength_lower.tolist() == before
        drives = len(database.drives())
    assert check(server).faults == ()
    assert check(server).rows["drive"] == drives
    found = info(server)
    assert (found.schema, found.sites[0].drives) == (schema.REVISIONS[-1], drives)
    assert found.sites[0].bounds_m is not None
    assert found.size_bytes > 10_000
    assert migrate(server) == Migrated(schema.REVISIONS[-1], schema.REVISIONS[-1], None)
    identity = drive_with_soil.id.hex
    engine = create_engine(schema.parse_url(server))
    with engine.begin() as connection:
        rows = connection.execute(text("UPDATE terrain_observation SET quality = 7 WHERE cell_x = 2 RETURNING id"))
        (spoilt,) = [row.id.hex for row in rows]
        connection.execute(
            text("DELETE FROM terrain_observation WHERE cell_x = 0 AND drive_id = :id"), {"id": identity}
        )
        connection.execute(text("UPDATE soil_observation SET effects = '3' WHERE start_s = 30 AND \"c_Pa\" > 2000"))
    engine.dispose()
    faults = {fault.id: (fault.table, fault.problem) for fault in check(server).faults}
    assert faults.pop(spoilt) == ("terrain_observation", "quality must lie in [0, 1]")
    assert faults.pop(identity) == ("drive", "1 of its rows of terrain_observation are lost")
    ((table, problem),) = faults.values()
    assert table == "soil_observation"
    assert "effects: " in problem


def test_what_is_acknowledged_is_on_the_disk(tmp_path):
    """Also where another process has the file open, which keeps what is added in the log."""
    with TerrainDatabase(tmp_path / "t.db") as database, database.writing() as connection:
        assert connection.exec_driver_sql("PRAGMA synchronous").scalar() == 2
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
