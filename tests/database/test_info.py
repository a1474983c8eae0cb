"""What a database is said to hold is what its snapshots rest on."""

from __future__ import annotations

import dataclasses
import json
import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta

import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database.info import info
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator
from old_schema import TO_FIRST

VALUES = dict(zip(PARAMETERS, (700.0, 0.5, 0.02, 4e5, 0.9), strict=True))
PHYSICS = AugmentedSimulator({name: Estimate(value, 0.0) for name, value in VALUES.items()})
FOUND = datetime(2026, 11, 2, 9, 0, tzinfo=UTC)


def test_an_empty_database(tmp_path):
    TerrainDatabase(tmp_path / "t.db").make()
    found = info(tmp_path / "t.db")
    assert (found.schema, found.sites, found.physics) == (found.newest_schema, (), ())
    assert found.size_bytes == (tmp_path / "t.db").stat().st_size
    json.dumps(found.as_dict())


def test_sites_are_described_as_snapshots_see_them(tmp_path, drive_with_soil, make):
    path = tmp_path / "t.db"
    gated = dataclasses.replace(make.soil({"sand": 1.0}, at_s=90.0), estimate=None, gate_reason="too fast")
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("d1", model="m0"))
        database.add_drive(drive_with_soil)
        coarse = make.seen([(0, 0), (7, 1)], [[0.1, 0.9], [0.9, 0.1]], cell_size_m=1.0)
        start = make.START + timedelta(days=1)
        database.add_drive(make.drive("d2", coarse, soils=(gated,), start_time=start))
        database.add_drive(make.drive("d3", make.seen([(0, 0)], [[0.2, 0.8]], sense="camera"), site="beach"))
        database.add_drive(make.drive("d4", start_time=None, site="moved"))
        database.add_drive(make.drive("d4", start_time=None, site="quarry", terrain=make.seen([], [])))
        database.add_physics("sand", PHYSICS, source="a", time=FOUND)
        database.add_physics("sand", PHYSICS, source="b", time=FOUND + timedelta(hours=1))
        database.add_physics("sand", PHYSICS, source="c", time=FOUND, site="beach")
        views = {site: database.snapshot(site) for site in database.sites()}
    before = path.read_bytes()
    found = info(path)
    assert path.read_bytes() == before
    beach, moved, quarry = found.sites
    for site in (beach, quarry):
        view = views[site.site]
        assert (site.drives, site.cells) == (view.drives, len(view.cells.key))
        assert (site.classes, site.classes_with_soil) == (view.class_names, tuple(view.soils))
    assert (moved.drives, moved.superseded, moved.cells, moved.bounds_m) == (0, 1, 0, None)
    assert (quarry.superseded, quarry.looks) == (1, {"camera": 0, "microphone": 0, "fused": 6})
    assert (quarry.stretches, quarry.stretches_with_soil) == (9, 8)
    assert quarry.bounds_m == (-1.5, -1.0, 8.0, 2.0)
    assert quarry.first == make.START
    assert quarry.last == make.START + timedelta(days=1, seconds=95)
    assert (beach.looks["camera"], beach.cells, beach.bounds_m) == (1, 0, (0.0, 0.0, 0.5, 0.5))
    assert [(each.class_name, each.site, each.stored, each.newest) for each in found.physics] == [
        ("sand", "", 2, FOUND + timedelta(hours=1)), ("sand", "beach", 1, FOUND),
    ]  # fmt: skip


def test_an_older_schema_is_described_and_not_migrated(tmp_path, drive_with_soil):
    path = tmp_path / "t.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(TO_FIRST)
    found = info(path)
    assert (found.schema, found.physics) == ("0001", ())
    assert found.sites[0].cells == 4
    assert info(path).schema == "0001"


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE soil_observation SET estimate = '{}'", "UPDATE drive SET start_time = 'x'",
        "UPDATE terrain_observation SET time_s = 'x'", "UPDATE terrain_observation SET time_s = 1e300",
        "UPDATE drive SET classes = '3'", "DELETE FROM bevameter_schema", "DROP TABLE drive",
    ],
)  # fmt: skip
def test_a_damaged_database_is_one_line(tmp_path, drive_with_soil, damage):
    path = tmp_path / "t.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(damage)
    with pytest.raises(InputError, match=r"t\.db: ") as caught:
        info(path)
    assert "\n" not in str(caught.value)
