"""What a merge leaves that did not end, and everything that meets it."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing

import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database import merge as merge_module
from bevameter.database.check import check
from bevameter.database.fingerprints import Fingerprint, of_drives, of_parts
from bevameter.database.info import info
from bevameter.database.maintenance import prune
from bevameter.database.rebuild import rebuild
from bevameter.database.store import Added
from bevameter.database.tables import TerrainRow


@pytest.fixture
def large(make):
    """A drive of 400 looks and two stretches."""
    terrain = make.seen([(index, 0) for index in range(400)], [[0.1, 0.9]] * 400)
    return make.drive("large", terrain, (make.soil({"sand": 1.0}), make.soil({"clay": 1.0}, at_s=10.0)))


@pytest.fixture
def unfinished(tmp_path, make, large, monkeypatch):
    """A database with one drive, and a part of another one: the merge that brings it was ended."""
    monkeypatch.setattr(merge_module, "PORTION", 100)

    def ends(stage: str, share: float) -> None:
        if 0.2 < share < 1.0:
            raise KeyboardInterrupt

    with TerrainDatabase(tmp_path / "source.db") as source, TerrainDatabase(tmp_path / "part.db") as target:
        source.add_drive(large)
        target.add_drive(make.drive("own"))
        with pytest.raises(KeyboardInterrupt):
            target.merge(source, progress=ends)
        yield target


def looks(database: TerrainDatabase) -> int:
    with closing(sqlite3.connect(database.name)) as connection:
        return connection.execute("SELECT count(*) FROM terrain_observation").fetchone()[0]


def test_a_drive_that_is_not_complete_is_used_by_nothing(unfinished, large, tmp_path, make):
    assert looks(unfinished) == 102
    assert unfinished.drive(large.id) is None
    assert [drive.name for drive in unfinished.drives()] == ["drive own"]
    assert len(unfinished.snapshot().cells.key) == 2
    assert prune(unfinished).drives == ()
    found = info(unfinished.name)
    assert (found.unfinished_drives, found.sites[0].drives, found.sites[0].looks["fused"]) == (1, 1, 2)
    assert json.loads(json.dumps(found.as_dict()))["unfinished_drives"] == 1
    (fault,) = check(unfinished.name).faults
    assert (fault.table, fault.id, fault.damaged) == ("drive", large.id.hex, False)
    assert "run the merge, push or pull that brings it again" in fault.problem
    with TerrainDatabase(tmp_path / "other.db") as other:  # nor is it handed on
        assert other.merge(unfinished) == Added(2, 0)
        assert other.merge(unfinished) == Added(0, 2)
        assert check(other.name).sound
    rebuilt = rebuild(unfinished.name, tmp_path / "new.db")
    assert [fault.id for fault in rebuilt.faults] == [large.id.hex]
    with TerrainDatabase(tmp_path / "new.db") as new:
        assert new.drive(large.id) is None


def test_the_same_merge_completes_it(unfinished, tmp_path, large):
    with TerrainDatabase(tmp_path / "source.db", must_exist=True) as source:
        assert unfinished.merge(source) == Added(302, 100)
    read = unfinished.drive(large.id)
    assert (len(read.terrain), len(read.soils)) == (400, 2)
    assert check(unfinished.name).sound


def test_processing_the_recording_completes_it(unfinished, large):
    assert unfinished.add_drive(large) == Added(302, 100)
    assert unfinished.add_drive(large) == Added(0, 402)
    assert check(unfinished.name).sound


def test_only_the_sites_that_are_named(tmp_path, make):
    with TerrainDatabase(tmp_path / "a.db") as one, TerrainDatabase(tmp_path / "b.db") as two:
        one.add_drive(make.drive("d1", site="quarry"))
        one.add_drive(make.drive("d1", site="beach", model="m2"))  # put right since
        one.add_drive(make.drive("d2", site="quarry"))
        one.add_drive(make.drive("d3", site="moor"))
        with pytest.raises(InputError, match=r"no site 'moon' .expected one of beach, moor, quarry"):
            two.merge(one, sites=["moon"])
        for wrong in ("quarry", [], 3):
            with pytest.raises(InputError, match="sites"):
                two.merge(one, sites=wrong)
        assert two.merge(one, sites=["quarry"]) == Added(6, 0)
        assert two.sites() == ["beach", "quarry"]
        assert two.snapshot("quarry").drives == one.snapshot("quarry").drives == 1
        assert two.merge(one, sites=["beach", "moor"]) == Added(2, 4)


def test_a_fingerprint_says_which_part_lacks_a_row(tmp_path, large):
    drives = {}
    for name in ("a.db", "b.db"):
        with TerrainDatabase(tmp_path / name) as database:
            database.add_drive(large)
    with closing(sqlite3.connect(tmp_path / "b.db")) as connection, connection:
        lost = connection.execute("DELETE FROM terrain_observation WHERE cell_x = 7 RETURNING id").fetchone()[0]
    for name in ("a.db", "b.db"):
        with TerrainDatabase(tmp_path / name) as database, database.reading() as connection:
            whole = of_drives(connection, TerrainRow, [large.id])[large.id]
            parts = of_parts(connection, TerrainRow, large.id, 1)
            assert Fingerprint(*map(sum, zip(*parts.values(), strict=True))) == whole
            drives[name] = whole, parts
    (one, ones), (other, others) = drives.values()
    assert (one.rows, one.total) == (other.rows + 1, other.total + int(lost[-8:], 16))
    assert {name for name in ones if ones[name] != others.get(name)} == {lost[0]}


def test_what_is_pruned_while_it_is_brought_comes_whole(tmp_path, make):
    cells = [(index, 0) for index in range(20)]
    first = make.drive("d1", make.seen(cells, [[0.1, 0.9]] * 20))
    newer = make.drive("d1", make.seen(cells, [[0.9, 0.1]] * 20), model="m2")
    with TerrainDatabase(tmp_path / "a.db") as source, TerrainDatabase(tmp_path / "b.db") as target:
        for each in (first, newer):
            source.add_drive(each)
        target.merge(source)
        source.add_drive(first)  # in use again, there
        reports = []

        def pruned(stage, share):
            reports.append(share)
            if len(reports) == 1:
                prune(target)

        target.merge(source, progress=pruned)
        assert [drive.id for drive in target.drives(newest=True)] == [first.id]
        assert len(target.drive(first.id).terrain) == 20
        assert check(tmp_path / "b.db").sound
