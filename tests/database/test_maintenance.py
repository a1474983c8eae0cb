"""Pruning keeps what snapshots answer; migrating keeps a copy of what was."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import textwrap
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database import maintenance, schema
from bevameter.database.check import check
from bevameter.database.info import info
from bevameter.database.maintenance import Migrated, Superseded, migrate, prune, superseded
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator
from old_schema import TO_FIRST

FOUND = datetime(2026, 11, 2, 9, 0, tzinfo=UTC)


def physics(c_Pa: float) -> AugmentedSimulator:
    values = dict(zip(PARAMETERS, (c_Pa, 0.5, 0.02, 4e5, 0.9), strict=True))
    return AugmentedSimulator({name: Estimate(value, 0.0) for name, value in values.items()})


@pytest.fixture
def path(tmp_path, drive_with_soil, make) -> Path:
    """A recording in three processings, one at another site, another recording, and physics of three times."""
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("d1", make.seen([(0, 0)] * 9, [[1.0, 0.0]] * 9), model="m0"))
        database.add_drive(make.drive("d1", soils=(make.soil({"sand": 1.0}, 9000.0),), site="wrong"))
        database.add_drive(drive_with_soil)
        database.add_drive(make.drive("d2", make.seen([(0, 0), (5, 5)], [[0.4, 0.6], [0.2, 0.8]])))
        for hour, site in enumerate(("", "", "quarry", "beach", "")):
            database.add_physics(
                "sand", physics(700.0 + hour), source="x", time=FOUND + timedelta(hours=hour), site=site
            )
    return path


def answers(path: Path) -> list:
    """All that a snapshot answers, as bytes."""
    with TerrainDatabase(path, must_exist=True) as database:
        assert database.sites() == ["quarry"]
        view = database.snapshot()
    every = view.box(-50.0, -50.0, 50.0, 50.0, now=FOUND)
    columns = ("class_probability", "cohesion", "friction_angle", "covariance", "shear_strength_lower", "age", "known")
    return [view.drives, *(np.asarray(getattr(every, name)).tobytes() for name in columns), every.reason.tolist(),
            {name: each.to_json() for name, each in view.physics.items()}]  # fmt: skip


def test_what_is_superseded_is_found_and_stays_until_it_is_pruned(path, drive_with_soil):
    before = path.read_bytes()
    with TerrainDatabase(path) as database:
        found = superseded(database)
    assert path.read_bytes() == before
    assert [(drive.site, drive.observations) for drive in found.drives] == [("quarry", 9), ("wrong", 3)]
    assert drive_with_soil.id not in {drive.id for drive in found.drives}
    assert [(each.class_name, each.site) for each in found.physics] == [("sand", ""), ("sand", "")]


def test_pruning_keeps_what_a_snapshot_answers_exactly(path):
    before, size = answers(path), path.stat().st_size
    with TerrainDatabase(path) as database:
        found = superseded(database)
        assert prune(database) == found
        assert superseded(database) == Superseded((), ())
        assert prune(database) == Superseded((), ())
        assert len(database.drives()) == 2
        assert [each.physics.soil["c_Pa"].value for each in database.physics()] == [702.0, 703.0, 704.0]
    assert answers(path) == before
    assert check(path).sound
    assert path.stat().st_size <= size
    assert not path.with_name("terrain.db-wal").exists()


def test_pruning_gives_room_back(tmp_path, make):
    path, many = tmp_path / "t.db", [(i, 0) for i in range(4000)]
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("d1", make.seen(many, [[0.5, 0.5]] * 4000)))
        database.add_drive(make.drive("d1", model="m2"))
    size = path.stat().st_size
    with TerrainDatabase(path) as database:
        prune(database)
    assert path.stat().st_size < size / 4


def test_a_drive_that_comes_back_into_use_meanwhile_stays(path, make, monkeypatch):
    back = make.drive("d1", make.seen([(0, 0)] * 9, [[1.0, 0.0]] * 9), model="m0")

    def find(database):
        found = original(database)
        with TerrainDatabase(path) as other:
            other.add_drive(back)  # what was found is in use again
        return found

    original = maintenance.superseded
    monkeypatch.setattr(maintenance, "superseded", find)
    with TerrainDatabase(path) as database:
        removed = prune(database)
        assert [drive.site for drive in removed.drives] == ["wrong"]
        assert database.drive(back.id) is not None
    assert check(path).sound


_PRUNING = textwrap.dedent("""
    import sys, time
    from bevameter import TerrainDatabase
    from bevameter.database import maintenance

    original = maintenance._remove_drive

    def remove(database, drive_id):
        remove.drives += 1
        if remove.drives == 2:
            print("one is removed", flush=True)
            time.sleep(60)
        return original(database, drive_id)

    remove.drives = 0
    maintenance._remove_drive = remove
    maintenance.prune(TerrainDatabase(sys.argv[1]))
""")


@pytest.mark.skipif(os.name == "nt", reason="POSIX has SIGKILL")
def test_pruning_that_is_killed_goes_on(path):
    before = answers(path)
    process = subprocess.Popen([sys.executable, "-c", _PRUNING, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "one is removed\n"
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    assert answers(path) == before
    assert check(path).sound
    with TerrainDatabase(path) as database:
        assert len(prune(database).drives) == 1
    assert answers(path) == before


def test_merging_with_who_still_has_it_brings_it_back(path, tmp_path):
    whole = tmp_path / "whole.db"
    whole.write_bytes(path.read_bytes())
    before = answers(path)
    with TerrainDatabase(path) as database, TerrainDatabase(whole) as other:
        prune(database)
        database.merge(other)
        assert len(superseded(database).drives) == 2
    assert answers(path) == before


def older(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(TO_FIRST)


def test_migrating_says_from_where_to_where_and_keeps_a_copy(path):
    older(path)
    before = path.read_bytes()
    copy = path.with_name("terrain.schema-0001.db")
    assert migrate(path) == Migrated("0001", schema.REVISIONS[-1], copy)
    assert info(path).schema == schema.REVISIONS[-1]
    assert info(copy).schema == "0001"
    assert check(path).sound
    assert check(copy).rows == {name: count for name, count in check(path).rows.items() if name != "class_physics"}
    assert migrate(path) == Migrated(schema.REVISIONS[-1], schema.REVISIONS[-1], None)
    path.write_bytes(before)  # who goes back keeps the first copy, too
    assert migrate(path).copy == path.with_name("terrain.schema-0001-2.db")
    assert sorted(each.name for each in path.parent.iterdir()) == [
        "terrain.db", "terrain.schema-0001-2.db", "terrain.schema-0001.db",
    ]  # fmt: skip


def test_a_migration_that_is_interrupted_leaves_the_database_as_it_was(path, monkeypatch):
    older(path)

    def stop(*arguments, **options):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("alembic.operations.Operations.create_table", stop)
        with pytest.raises(KeyboardInterrupt):
            migrate(path)
    assert info(path).schema == "0001"
    assert check(path).sound
    assert migrate(path).before == "0001"
    assert info(path).schema == schema.REVISIONS[-1]


def test_a_log_goes_into_the_copy(path, make):
    older(path)
    keeps = sqlite3.connect(path)
    keeps.execute("PRAGMA wal_autocheckpoint = 0")
    keeps.execute("UPDATE drive SET name = 'in the log'")
    keeps.commit()
    copy = migrate(path).copy
    keeps.close()
    assert copy is not None
    with closing(sqlite3.connect(copy)) as connection:
        assert connection.execute("SELECT DISTINCT name FROM drive").fetchall() == [("in the log",)]


def test_what_is_no_older_database_is_not_migrated(path, tmp_path):
    with pytest.raises(InputError, match="no such file"):
        migrate(tmp_path / "none.db")
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE bevameter_schema SET version_num = '9999'")
    before = path.read_bytes()
    with pytest.raises(InputError, match="of a newer version"):
        migrate(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
