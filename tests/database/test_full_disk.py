"""On a full disk each command says so in one line, nothing that was stored is lost, and it works once there is room."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

import pytest
from bevameter import TerrainDatabase
from bevameter.database.check import check
from bevameter.database.info import info
from bevameter.database.schema import REVISIONS
from forked import answer
from full_disk import attempt
from killed import check_whole, drive, pictures
from old_schema import TO_FIRST

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX limits files")

THERE, ADDED, MERGED = drive(0), [drive(1, 1500)], [drive(number, 1500) for number in range(2, 5)]
WHOLE = pictures([THERE, *ADDED, *MERGED])


@pytest.fixture
def disk(tmp_path):
    """A disk of its own, of 24 MB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=24m", "tmpfs", folder]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no disk may be mounted here")
    yield folder
    subprocess.run(["umount", folder], check=True)


@pytest.fixture
def other(tmp_path) -> Path:
    with TerrainDatabase(tmp_path / "other.db") as database:
        for each in MERGED:
            database.add_drive(each)
    return tmp_path / "other.db"


def store(folder: Path) -> None:
    """Store a drive, and the same in an older schema."""
    with TerrainDatabase(folder / "t.db") as database:
        database.add_drive(THERE)
    shutil.copy(folder / "t.db", folder / "old.db")
    with closing(sqlite3.connect(folder / "old.db")) as connection:
        connection.executescript(TO_FIRST)


def nothing_is_lost(folder: Path) -> None:
    found = check_whole(folder / "t.db", WHOLE, {THERE.id})
    assert found == {THERE.id}
    assert check(folder / "t.db").sound
    assert info(folder / "old.db").schema == "0001"
    assert check(folder / "old.db").sound
    left = {each.name.removesuffix("-wal").removesuffix("-shm") for each in folder.iterdir()}
    assert left <= {"t.db", "old.db", "new.db", "filling"}


def works_with_room(folder: Path, other: Path) -> None:
    said = answer(attempt, folder, other, ADDED)
    assert set(said.values()) == {""}
    assert check_whole(folder / "t.db", WHOLE, set(WHOLE)) == set(WHOLE)
    assert check(folder / "t.db").sound
    assert info(folder / "old.db").schema == REVISIONS[-1]
    assert len(list(folder.glob("x.*"))) == 4


def test_a_disk_that_is_full(disk, other):
    store(disk)
    with (disk / "filling").open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass
    said = answer(attempt, disk, other, ADDED)
    assert said["read"] == ""
    for name, line in said.items():
        assert "\n" not in line
        if name not in ("read", "prune"):
            assert any(what in line for what in ("full", "No space left", "no space")), (name, line)
    nothing_is_lost(disk)
    (disk / "filling").unlink()
    works_with_room(disk, other)


@pytest.mark.parametrize("most_bytes", [40_000, 100_000])
def test_files_that_may_not_grow(tmp_path, other, most_bytes):
    folder = tmp_path / "folder"
    folder.mkdir()
    store(folder)
    said = answer(attempt, folder, other, ADDED, most_bytes)
    assert all("\n" not in line for line in said.values())
    assert {name for name, line in said.items() if line} >= {"add", "merge"}
    found = check_whole(folder / "t.db", WHOLE, {THERE.id})
    assert found == {THERE.id}
    assert check(folder / "t.db").sound
    works_with_room(folder, other)
