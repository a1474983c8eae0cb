"""A database that may only be read is read; what would write says so in one line."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import tempfile
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database import connections, schema
from forked import answer
from old_schema import TO_FIRST
from refusals import everything
from still_database import read, write

pytestmark = pytest.mark.skipif(os.name == "nt", reason="folders of Windows have no write permission of this kind")


@contextmanager
def may_not_be_written(folder: Path):
    for each in folder.iterdir():
        each.chmod(0o444)
    folder.chmod(0o555)
    yield
    folder.chmod(0o755)


@contextmanager
def read_only_medium(folder: Path):
    if os.geteuid() != 0:
        pytest.skip("only root may mount a medium")
    for command in (["mount", "--bind", folder, folder], ["mount", "-o", "remount,ro,bind", folder]):
        if subprocess.run(command, capture_output=True).returncode:
            subprocess.run(["umount", folder], capture_output=True)
            pytest.skip("nothing may be mounted here")
    yield
    subprocess.run(["umount", folder], check=True)


@pytest.fixture(params=[may_not_be_written, read_only_medium])
def still(request, make, drive_with_soil):
    """A folder that may only be read, with a database that has something to prune, and one of an older schema."""
    with tempfile.TemporaryDirectory() as outer:  # that of pytest is closed to other users
        Path(outer).chmod(0o755)
        folder = Path(outer) / "still"
        folder.mkdir()
        with TerrainDatabase(folder / "t.db") as database:
            database.add_drive(make.drive("d1", model="m0"))
            database.add_drive(drive_with_soil)
        shutil.copy(folder / "t.db", folder / "old.db")
        with closing(sqlite3.connect(folder / "old.db")) as connection:
            connection.executescript(TO_FIRST)
        with request.param(folder):
            yield folder


def test_all_that_reads_does(still):
    before = everything(still)
    assert answer(read, still) == ([True], 14, (), 1, True, 1, "0001", None, True, 0)
    assert everything(still) == before


def test_all_that_writes_says_in_one_line_that_it_may_not(still, make):
    before = everything(still)
    for status, line in answer(write, still, make.drive("d3")):
        assert status == 2
        assert str(still) in line
        assert "\n" not in line
        assert any(said in line for said in ("readonly", "may not be written", "unable to open"))
    assert everything(still) == before


def test_a_file_that_changes_while_it_is_read_without_locks_is_not_believed(tmp_path, make, monkeypatch):
    path = tmp_path / "t.db"
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("d1"))
    monkeypatch.setattr(connections.os, "access", lambda path, mode: False)
    with TerrainDatabase(path, must_exist=True) as database:
        assert len(database.drives()) == 1
        with pytest.raises(InputError, match="was changed while it was read"), database.reading():
            another_process_writes(path)
        assert len(database.drives()) == 1
    with pytest.raises(InputError, match="was changed while it was read"), schema.opened_as_it_is(path):
        another_process_writes(path)


def another_process_writes(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE drive SET name = name || '.'")
