"""Snapshots of a database that grows are those of all that it holds, and read only what is new."""

import dataclasses
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database import reader
from bevameter.database.maintenance import prune
from bevameter.identification.effects.stored import AugmentedSimulator


@pytest.fixture
def read(monkeypatch):
    """Names of the drives that were read from a database, in order."""
    names, original = [], reader.read_drive

    def noting(connection, row, senses):
        names.append(row.name)
        return original(connection, row, senses)

    monkeypatch.setattr(reader, "read_drive", noting)
    return names


def assert_same(view, other) -> None:
    assert (view.site, view.class_names, view.cell_size_m, view.drives) == (
        other.site, other.class_names, other.cell_size_m, other.drives,
    )  # fmt: skip
    for name in ("key", "probability", "seen_s", "looks"):
        np.testing.assert_array_equal(getattr(view.cells, name), getattr(other.cells, name))
    said, whole = ([each.reasons[number] for number in each.reason] for each in (view.cells, other.cells))
    assert said == whole
    assert view.soils.keys() == other.soils.keys()
    for name, soil in view.soils.items():
        np.testing.assert_array_equal(soil.strength.mean, other.soils[name].strength.mean)
    assert view.physics == other.physics


def patch(make, rng, name, *, classes=("clay", "sand"), size=0.5, soils=(), model="m1"):
    """A drive over some cells of a small site, looks of several qualities, some unknown."""
    cells = rng.integers(-4, 5, (12, 2))
    belief = rng.dirichlet(np.ones(len(classes)), 12)
    unknown = rng.random(12) < 0.3
    terrain = make.seen(
        [tuple(cell) for cell in cells.tolist()], belief.tolist(), classes=classes, quality=rng.random(12).tolist(),
        unknown=unknown.tolist(), reasons=[("too dark",) if dark else () for dark in unknown], cell_size_m=size,
    )  # fmt: skip
    return make.drive(name, terrain, soils, model=model)


def test_each_step_gives_what_a_whole_reading_gives_and_reads_one_drive(tmp_path, make, read):
    rng = np.random.default_rng(3)
    steps = [
        patch(make, rng, "a", soils=(make.soil({"sand": 1.0}),)),
        patch(make, rng, "b"),
        patch(make, rng, "c", soils=(make.soil({"sand": 1.0}, 2000.0), make.soil({"clay": 1.0}, at_s=20.0))),
        patch(make, rng, "b", model="m2"),  # processed again: what it was before counts no more
        patch(make, rng, "d", classes=("clay", "gravel")),
        patch(make, rng, "e", size=1.0),
        patch(make, rng, "f"),
    ]
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        following = database.reader("quarry")
        for step in steps:
            database.add_drive(step)
            read.clear()
            view = following.snapshot()
            assert read == [step.name]
            assert following.snapshot() is view
            assert_same(view, database.snapshot())
        database.add_drive(make.drive("elsewhere", site="heath"))
        assert following.snapshot() is view
        prune(database)
        assert following.snapshot() is view


def test_drives_that_come_back_into_use_or_in_between(tmp_path, make, read):
    rng = np.random.default_rng(4)
    first, again, other = patch(make, rng, "a"), patch(make, rng, "a", model="m2"), patch(make, rng, "b")
    with TerrainDatabase(tmp_path / "terrain.db") as database, TerrainDatabase(tmp_path / "other.db") as older:
        older.add_drive(patch(make, rng, "o"))
        for each in (first, other, again):
            database.add_drive(each)
        following = database.reader()
        following.snapshot()
        database.add_drive(first)
        assert_same(following.snapshot(), database.snapshot())
        database.merge(older)  # imported before all of them
        read.clear()
        assert_same(following.snapshot(), database.snapshot())
        assert read[0] == "drive o"


def test_observations_that_a_merge_brings_back_are_read(tmp_path, make, drive_with_soil):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database, TerrainDatabase(tmp_path / "copy.db") as copy:
        database.add_drive(drive_with_soil)
        copy.merge(database)
        with closing(sqlite3.connect(path)) as connection, connection:
            connection.execute("DELETE FROM terrain_observation WHERE cell_x = 0")
        following = database.reader()
        lacking = following.snapshot()
        database.merge(copy)
        assert len(following.snapshot().cells.key) == len(lacking.cells.key) + 1
        assert_same(following.snapshot(), database.snapshot())


def test_physics_and_sites_that_come_later(tmp_path, make, drive_with_soil):
    soil = dict(drive_with_soil.soils[-1].estimate.parameters)
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        following = database.reader()
        with pytest.raises(InputError, match="no such file"):
            following.snapshot()
        database.make()
        assert following.snapshot().drives == 0
        with pytest.raises(InputError, match="no site 'quarry'"):
            database.reader("quarry").snapshot()
        database.add_drive(drive_with_soil)
        before = following.snapshot()
        database.add_physics("sand", AugmentedSimulator(soil, ()), source="test")
        after = following.snapshot()
        assert list(after.physics) == ["sand"]
        assert after.cells.key.tolist() == before.cells.key.tolist()
        database.add_drive(dataclasses.replace(drive_with_soil, site="heath"))
        assert following.snapshot().site == "heath"  # the recording's newest processing is there
        database.add_drive(make.drive("other"))
        with pytest.raises(InputError, match="several sites"):
            following.snapshot()
