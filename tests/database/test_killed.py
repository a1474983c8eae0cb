"""Processes that write a database are killed at random moments: nothing acknowledged is lost, nothing partial is seen,
and the same again brings the rest.
"""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
import tempfile
from collections import Counter
from contextlib import closing
from pathlib import Path

import pytest
from bevameter import TerrainDatabase
from bevameter.database.check import check
from bevameter.database.info import info
from bevameter.database.maintenance import migrate
from bevameter.database.schema import REVISIONS
from bevameter.database.tables import Base
from bevameter.database.urls import parse_url
from killed import ENDS, add_drives, bring_up_to_date, check_whole, drive, kill, merge, pace, pictures
from old_schema import TO_FIRST
from sqlalchemy import create_engine

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX has SIGKILL")

OWN, OTHERS = [drive(0)], [drive(number) for number in range(1, 6)]
WHOLE = pictures([*OWN, *OTHERS])


MEMORY = Path("/dev/shm")


@pytest.fixture
def folder():
    """An empty folder, in memory where that is possible: what a killed process wrote is there without a disk."""
    with tempfile.TemporaryDirectory(dir=MEMORY if os.access(MEMORY, os.W_OK) else None) as name:
        yield Path(name)


@pytest.fixture(scope="module")
def template(tmp_path_factory) -> Path:
    """A database with one drive, to be copied."""
    path = tmp_path_factory.mktemp("template") / "t.db"
    with TerrainDatabase(path) as database:
        database.add_drive(*OWN)
    return path


@pytest.fixture(scope="module")
def other(tmp_path_factory) -> Path:
    """A database with the drives that are to be merged."""
    path = tmp_path_factory.mktemp("other") / "other.db"
    with TerrainDatabase(path) as database:
        for each in OTHERS:
            database.add_drive(each)
    return path


def suite(chunks: int, chunks_if_slow: int):
    """Seeds of the trials that are always made, and further ones of the slow suite."""
    slow = [pytest.param(seed, marks=pytest.mark.slow) for seed in range(chunks, chunks_if_slow)]
    return pytest.mark.parametrize("seed", [*range(chunks), *slow])


def damaged(place) -> list:
    return [fault for fault in check(place).faults if fault.damaged]


@suite(8, 80)
def test_a_writer_that_is_killed(seed, folder, template):
    """25 trials: 200 in all, 2,000 in the slow suite."""
    rng, path, met = random.Random(seed), folder / "t.db", Counter()
    shutil.copy(template, path)
    paced = pace(add_drives, str(path), OTHERS)
    for _ in range(25):
        shutil.copy(template, path)
        said = kill(rng, paced, add_drives, str(path), OTHERS)
        found = check_whole(path, WHOLE, {OWN[0].id, *said} - {ENDS})
        assert check(path).sound
        met[len(said)] += 1
        with TerrainDatabase(path) as database:
            new = sum(database.add_drive(each).new > 0 for each in OTHERS)
        assert new == len(WHOLE) - len(found)
        assert check_whole(path, WHOLE, set(WHOLE)) == set(WHOLE)
    assert len(met) >= 4, "all were killed at the same moment"


@suite(2, 20)
def test_a_merge_that_is_killed(seed, folder, template, other):
    rng, path, met, before = random.Random(seed), folder / "t.db", Counter(), other.read_bytes()
    shutil.copy(template, path)
    paced = pace(merge, str(path), str(other))
    for _ in range(12):
        shutil.copy(template, path)
        said = kill(rng, paced, merge, str(path), str(other))
        merged(path, other, said, met)
    assert other.read_bytes() == before
    assert len(met) >= 2, "all were killed at the same moment"


@suite(2, 20)
def test_a_merge_into_postgresql_that_is_killed(seed, server, other):
    rng, met, engine = random.Random(seed), Counter(), create_engine(parse_url(server))
    paced = pace(merge, server, str(other))
    for _ in range(12):
        with engine.begin() as connection:
            for table in reversed(Base.metadata.sorted_tables):
                connection.execute(table.delete())
        with TerrainDatabase(server) as database:
            database.add_drive(*OWN)
        said = kill(rng, paced, merge, server, str(other))
        merged(server, other, said, met)
    engine.dispose()
    assert len(met) >= 2, "all were killed at the same moment"


def merged(place, other: Path, said: list, met: Counter) -> None:
    """See what is there after a merge was killed, and merge again."""
    found = check_whole(place, WHOLE, set(WHOLE) if ENDS in said else {OWN[0].id})
    met[len(found)] += 1
    assert not damaged(place)
    with TerrainDatabase(place) as database, TerrainDatabase(other, must_exist=True) as source:
        database.merge(source)
        assert database.merge(source).new == 0
    assert check_whole(place, WHOLE, set(WHOLE)) == set(WHOLE)
    assert check(place).sound


@suite(1, 10)
def test_a_migration_that_is_killed(seed, folder, template):
    rng, path, old = random.Random(seed), folder / "t.db", folder / "old"
    shutil.copy(template, old)
    with closing(sqlite3.connect(old)) as connection:
        connection.executescript(TO_FIRST)
    shutil.copy(old, path)
    paced = pace(bring_up_to_date, str(path))
    for _ in range(12):
        for each in folder.glob("*.db*"):
            each.unlink()
        shutil.copy(old, path)
        said = kill(rng, paced, bring_up_to_date, str(path))
        assert info(path).schema in (REVISIONS[-1:] if said else REVISIONS)
        assert check(path).sound
        for copy in folder.glob("t.schema-0001*.db"):
            assert info(copy).schema == "0001"
            assert check(copy).rows["terrain_observation"] == len(OWN[0].terrain)
        migrate(path)
        assert info(path).schema == REVISIONS[-1]
        assert check_whole(path, WHOLE, {OWN[0].id}) == {OWN[0].id}
        assert list(folder.glob("t.schema-0001*.db"))


@suite(1, 10)
def test_a_database_whose_making_is_killed(seed, folder):
    rng, path = random.Random(seed), folder / "t.db"
    paced = pace(bring_up_to_date, str(path))
    for _ in range(12):
        for each in folder.iterdir():
            each.unlink()
        said = kill(rng, paced, bring_up_to_date, str(path))
        with TerrainDatabase(path, must_exist=bool(said)) as database:
            database.add_drive(*OWN)
        assert check_whole(path, WHOLE, {OWN[0].id}) == {OWN[0].id}
        assert check(path).sound
