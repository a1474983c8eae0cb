"""All cells of a site as files: the rows that queries give, in three formats; unknown is null."""

from __future__ import annotations

import csv
import json
import math

import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database.exports import answer_rows, csv_columns, flat
from bevameter.database.formats.cells import write_cells
from bevameter.database.snapshot import Snapshot
from pyarrow import parquet

NOW = 1.8e9


@pytest.fixture
def view(drive_with_soil) -> Snapshot:
    return Snapshot.derive("quarry", [drive_with_soil])


def asked(view: Snapshot) -> list[dict]:
    return answer_rows(view.box(-9.0, -9.0, 9.0, 9.0, normal_stress=1e4, confidence=0.9, now=NOW))


def test_parquet_holds_the_rows_of_a_query(view, tmp_path):
    assert write_cells(view, tmp_path / "c.parquet", normal_stress=1e4, confidence=0.9, now=NOW) == 4
    table = parquet.read_table(tmp_path / "c.parquet")
    assert table.column_names == csv_columns(view.class_names)
    assert table.to_pylist() == [{name: flat(row).get(name) for name in table.column_names} for row in asked(view)]
    about = json.loads(table.schema.metadata[b"bevameter"])
    assert about == {
        "schema": 1, "site": "quarry", "cell_size_m": 0.5, "normal_stress_Pa": 1e4, "confidence": 0.9,
        "ages_refer_to_s": NOW,
    }  # fmt: skip
    assert [kind for kind in map(str, table.schema.types) if kind not in ("double", "string", "bool", "int64")] == []


def test_csv_holds_the_rows_of_a_query(view, tmp_path):
    write_cells(view, tmp_path / "c.csv", normal_stress=1e4, confidence=0.9, now=NOW)
    with (tmp_path / "c.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row, known in zip(rows, map(flat, asked(view)), strict=True):
        assert {name: text or None for name, text in row.items()} == {
            name: None if known.get(name) is None else str(known[name]) for name in csv_columns(view.class_names)
        }


def test_geojson_holds_squares_of_the_sites_frame(view, tmp_path):
    write_cells(view, tmp_path / "c.GeoJSON", normal_stress=1e4, confidence=0.9, now=NOW)
    page = json.loads((tmp_path / "c.GeoJSON").read_text(encoding="utf-8"))
    assert page["site_frame"] == {"site": "quarry", "unit": "m", "origin": None}
    for feature, row in zip(page["features"], asked(view), strict=True):
        assert feature["properties"] == {name: row[name] for name in row if name not in ("x_m", "y_m")}
        (ring,) = feature["geometry"]["coordinates"]
        assert ring[0] == [row["x_m"] - 0.25, row["y_m"] - 0.25]
        assert ring[2] == [row["x_m"] + 0.25, row["y_m"] + 0.25]


def test_unknown_is_null_in_every_format(view, tmp_path):
    """Cell (2, 0) was too dark, (-3, -2) is asphalt, whose soil nobody measured."""
    for ending in ("parquet", "csv", "geojson"):
        write_cells(view, tmp_path / f"c.{ending}")
    table = parquet.read_table(tmp_path / "c.parquet").to_pylist()
    assert [row["known"] for row in table] == [False, True, True, False]
    for row in (table[0], table[3]):
        assert row["unknown"]
        assert all(row[name] is None for name in ("c_Pa", "tan_phi", "variance_c", "shear_strength_lower_Pa"))
    assert not any(isinstance(value, float) and math.isnan(value) for row in table for value in row.values())
    assert table[3]["probability_sand"] is None
    text = (tmp_path / "c.csv").read_text(encoding="utf-8") + (tmp_path / "c.geojson").read_text(encoding="utf-8")
    assert "nan" not in text.lower().replace("unknown", "")


def test_cells_at_the_end_of_the_grid_are_written_too(make, tmp_path):
    far = [(2**31 - 1, -(2**31) + 1), (-(2**31) + 1, 2**31 - 1)]
    view = Snapshot.derive("q", [make.drive(terrain=make.seen(far, [[0.1, 0.9]] * 2))])
    assert write_cells(view, tmp_path / "c.parquet") == 2
    assert set(parquet.read_table(tmp_path / "c.parquet")["class"].to_pylist()) == {"sand"}


def test_a_site_without_cells_has_a_header(tmp_path):
    with TerrainDatabase(tmp_path / "t.db") as database:
        database.make()
        view = database.snapshot()
    for ending in ("parquet", "csv", "geojson"):
        assert write_cells(view, tmp_path / f"c.{ending}") == 0
    assert (tmp_path / "c.csv").read_text().startswith("x_m,y_m,known,")
    assert parquet.read_table(tmp_path / "c.parquet").num_rows == 0


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("c.txt", {}, "expected .parquet or .csv or .geojson"), ("c", {}, "ends in ''"),
        ("no/c.csv", {}, "there is no folder"), ("c.csv", {"confidence": 1.0}, "confidence"),
        ("c.csv", {"normal_stress": -1.0}, "normal stress"),
    ],
)  # fmt: skip
def test_what_cannot_be_written_is_bad_input(view, tmp_path, name, options, said):
    with pytest.raises(InputError, match=said):
        write_cells(view, tmp_path / name, **options)
    assert list(tmp_path.iterdir()) == []
