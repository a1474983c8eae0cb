"""`bevameter db`: each command, its formats, its exit status."""

from __future__ import annotations

import csv
import io
import json
import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from bevameter import ClassEvidence, TerrainDatabase
from bevameter.database import schema
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.framework.cli.main import app
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator
from old_schema import TO_FIRST
from pyarrow import parquet
from typer.testing import CliRunner

VALUES = dict(zip(PARAMETERS, (700.0, 0.5, 0.02, 4e5, 0.9), strict=True))
PHYSICS = AugmentedSimulator({name: Estimate(value, 0.0) for name, value in VALUES.items()})
FOUND = datetime(2026, 11, 2, 9, 0, tzinfo=UTC)


def drive(digest: str, site: str = "quarry", method: str = "m") -> Drive:
    """Two cells and a stretch of which nothing was learnt."""
    evidence = ClassEvidence(
        ("grass", "sand"), np.array([[0.1, 0.9], [0.9, 0.1]]), np.ones(2), np.zeros(2, bool), ((),) * 2
    )
    terrain = TerrainObservations(0.5, np.array([0, 1]), np.array([0, 0]), np.zeros(2), np.full(2, "fused"), evidence)
    soil = SoilObservation(0.0, 1.0, 0.0, 0.0, {"sand": 1.0}, None, (1e3, 2e3), 80.0, gate_reason="too fast")
    return Drive(digest, f"drive {digest}", site, "rover", None, {}, method, terrain, (soil,))


@pytest.fixture
def db(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    with TerrainDatabase("t.db") as database:
        for each in (drive("d1", method="old"), drive("d1"), drive("d2")):
            database.add_drive(each)
        for source, time in (("a", FOUND), ("b", FOUND + timedelta(hours=1))):
            database.add_physics("sand", PHYSICS, source=source, time=time)
            database.add_physics("grass", PHYSICS, source=source, time=time, site="quarry")
    return tmp_path / "t.db"


def said(*arguments, status: int = 0) -> str:
    """Run `bevameter db ...`; give its stdout, or its stderr where it refuses, which is one line then."""
    result = CliRunner().invoke(app, ["db", *map(str, arguments)])
    assert result.exit_code == status, result.output
    if status == 2:
        assert len(result.stderr.splitlines()) == 1
        return result.stderr
    assert result.stderr == ""
    return result.stdout


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def changed(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(statement)


def test_info(db):
    page = json.loads(said("info", "t.db", "--format", "json"))
    assert (page["schema"], page["database"], page["schema_version"]) == (1, "t.db", schema.REVISIONS[-1])
    (site,) = page["sites"]
    assert (site["site"], site["drives"], site["superseded"], site["looks"]["fused"]) == ("quarry", 2, 1, 4)
    assert (site["first"], site["bounds_m"]) == (None, [0.0, 0.0, 1.0, 0.5])
    assert [(each["class"], each["site"], each["stored"]) for each in page["physics"]] == [
        ("grass", "quarry", 2), ("sand", "", 2),
    ]  # fmt: skip
    (row,) = rows(said("info", "t.db", "--format", "csv"))
    assert (row["site"], row["looks_fused"], row["first"], row["x_max_m"]) == ("quarry", "4", "", "1.0")
    assert row["classes"] == "grass;sand"
    text = said("info", "t.db")
    assert text.startswith(f"t.db: schema {schema.REVISIONS[-1]}, ")
    assert "2, 0 with soil" in text


def test_info_of_an_empty_database(tmp_path):
    TerrainDatabase(tmp_path / "e.db").make()
    assert "no drives" in said("info", tmp_path / "e.db")
    header = said("info", tmp_path / "e.db", "--format", "csv").strip()
    assert header.startswith("site,drives,superseded,")


def test_check(db):
    assert said("check", "t.db") == "sound: 3 drives, 9 observations, 4 physics of classes\n"
    assert json.loads(said("check", "t.db", "--format", "json"))["sound"] is True
    assert said("check", "t.db", "--format", "csv") == "table,id,problem\n"
    changed(db, "UPDATE terrain_observation SET quality = 7 WHERE rowid IN (1, 4)")
    lines = said("check", "t.db", status=1).splitlines()
    assert [line.split()[0] for line in lines] == ["terrain_observation", "terrain_observation", "2"]
    assert all("quality must lie in [0, 1]" in line for line in lines[:2])
    page = json.loads(said("check", "t.db", "--format", "json", status=1))
    assert (page["sound"], len(page["faults"])) == (False, 2)
    assert [row["table"] for row in rows(said("check", "t.db", "--format", "csv", status=1))] == [
        "terrain_observation"
    ] * 2
    assert "no such file" in said("check", "none.db", status=2)


def test_merge(db):
    with TerrainDatabase("a.db") as one, TerrainDatabase("b.db") as two:
        one.add_drive(drive("d3"))
        two.add_drive(drive("d3"))
        two.add_drive(drive("d4"))
    assert said("merge", "t.db", "a.db", "b.db") == (
        "a.db: 3 observations added, 0 known already\nb.db: 3 observations added, 3 known already\n"
    )
    assert "0 observations added, 6 known already" in said("merge", "t.db", "b.db")
    said("merge", "union.db", "t.db")
    assert said("check", "union.db") == said("check", "t.db")
    assert "no such file" in said("merge", "fresh.db", "a.db", "none.db", status=2)
    assert not Path("fresh.db").exists()


def test_export(db):
    assert said("export", "t.db", "c.parquet") == "written to c.parquet\n"
    assert parquet.read_table("c.parquet")["class"].to_pylist() == ["sand", "grass"]
    said("export", "t.db", "c.csv", "--normal-stress", "5 kPa", "--confidence", "0.9")
    assert [row["known"] for row in rows(Path("c.csv").read_text())] == ["False", "False"]
    said("export", "t.db", "c.geojson")
    assert len(json.loads(Path("c.geojson").read_text())["features"]) == 2
    assert "bounds: means nothing to csv" in said("export", "t.db", "d.csv", "--bounds", "0", "0", "1", "1", status=2)
    with TerrainDatabase("t.db") as database:
        database.add_drive(drive("d3", site="beach"))
    assert "several sites" in said("export", "t.db", "d.csv", status=2)
    assert "written to d.csv" in said("export", "t.db", "d.csv", "--site", "beach")
    assert "a file of kind '.txt'" in said("export", "t.db", "c.txt", "--site", "beach", status=2)
    Path("t.csv").write_bytes(db.read_bytes())
    assert "would be written over" in said("export", "t.csv", "t.csv", status=2)


def test_prune(db):
    before = db.read_bytes()
    text = said("prune", "t.db")
    assert "nothing was removed; --yes removes this for good" in text
    assert db.read_bytes() == before
    page = json.loads(said("prune", "t.db", "--format", "json"))
    assert page["removed"] is False
    assert [row["what"] for row in page["rows"]] == ["drive", "physics", "physics"]
    assert [row["observations"] for row in page["rows"]] == [3, None, None]
    assert {row["name"] for row in page["rows"]} == {"drive d1", "sand, a", "grass, a"}
    assert said("prune", "t.db", "--yes").splitlines()[-1] == "removed"
    assert said("prune", "t.db", "--yes") == "nothing is superseded\n"
    assert said("prune", "t.db", "--format", "csv") == "what,id,site,name,observations\n"
    assert said("check", "t.db") == "sound: 2 drives, 6 observations, 2 physics of classes\n"


def test_rebuild(db):
    changed(db, "UPDATE soil_observation SET effects = '3' WHERE rowid = 2")
    damaged = db.read_bytes()
    first, last = said("rebuild", "t.db", "new.db").splitlines()
    assert first.startswith("soil_observation ")
    assert "effects: " in first
    assert last == "new.db: 3 drives, 8 observations, 4 physics of classes"
    assert db.read_bytes() == damaged
    said("check", "new.db")
    assert "is there already" in said("rebuild", "t.db", "new.db", status=2)
    page = json.loads(said("rebuild", "t.db", "json.db", "--format", "json"))
    assert (len(page["faults"]), page["rows"]["soil_observation"]) == (1, 2)
    assert len(rows(said("rebuild", "t.db", "csv.db", "--format", "csv"))) == 1
    assert "is no SQLite file" in said("rebuild", "postgresql://me@nowhere/t", "x.db", status=2)


def test_migrate(db):
    newest = schema.REVISIONS[-1]
    assert said("migrate", "t.db") == f"schema {newest}, the newest: nothing to do\n"
    for statement in TO_FIRST.split(";"):
        changed(db, statement)
    assert f"schema 0001 (newest: {newest})" in said("info", "t.db")
    copy = "t.schema-0001.db"
    assert said("migrate", "t.db") == f"migrated from schema 0001 to {newest}; as it was before: {copy}\n"
    assert Path(copy).exists()
    assert "no such file" in said("migrate", "none.db", status=2)


@pytest.mark.parametrize("command", ["info", "check", "prune"])
def test_a_format_that_there_is_not(db, command):
    assert "'geojson' (expected table or json or csv)" in said(command, "t.db", "--format", "geojson", status=2)
    assert "--format: 'xml'" in said(command, "t.db", "--format", "xml", status=2)


@pytest.mark.parametrize("command", ["info", "check", "merge", "push", "pull", "export", "prune", "rebuild", "migrate"])
def test_every_command_has_help(command):
    assert "DB" in said(command, "--help")
