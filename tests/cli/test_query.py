import csv
import io
import json
import subprocess
import sys

import numpy as np
import pytest
from bevameter import TerrainDatabase
from bevameter.database.exports import flat
from bevameter.framework.cli.main import main
from small_site import some_drive


@pytest.fixture
def query(tmp_path, monkeypatch, capsys):
    """Run `bevameter query ...` on a small database; give exit status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    with TerrainDatabase("terrain.db") as database:
        database.add_drive(some_drive())

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["bevameter", "query", *arguments])
        with pytest.raises(SystemExit) as leaving:
            main()
        said = capsys.readouterr()
        return int(leaving.value.code or 0), said.out, said.err

    return run


def test_classes(query):
    status, out, _ = query("classes", "--format", "json")
    page = json.loads(out)
    assert (status, page["schema"], page["site"]) == (0, 1, "quarry")
    asphalt, sand = page["classes"]
    assert (asphalt["class"], asphalt["known"], asphalt["unknown"]) == (
        "asphalt", False, "no soil data for class asphalt",
    )  # fmt: skip
    assert "c_Pa" not in asphalt
    assert (sand["observations"], sand["cells"]) == (6, 1)
    assert sand["c_Pa"] == pytest.approx(800.0)
    assert sand["shear_strength_Pa"] == pytest.approx(800.0 + 20e3 * 0.55)
    assert 0 < sand["shear_strength_lower_Pa"] < sand["shear_strength_Pa"]
    assert sand["k_m"]["value"] == pytest.approx(0.02)
    status, out, _ = query("classes")
    assert "unknown: no soil data for class asphalt" in out
    assert "shear strength at 20 kPa normal stress" in out


def test_one_class(query):
    _, out, _ = query("class", "sand", "--normal-stress", "5000", "--format", "json")
    (sand,) = json.loads(out)["classes"]
    assert sand["shear_strength_Pa"] == pytest.approx(800.0 + 5e3 * 0.55)
    assert query("class", "snow")[0::2] == (2, "bevameter: class: 'snow' (expected one of asphalt, sand)\n")


def test_at_a_place(query):
    _, out, _ = query("at", "0.2", "0.3", "--format", "json")
    (place,) = json.loads(out)["places"]
    assert (place["class"], place["known"], place["unknown"], place["age_s"]) == ("sand", True, None, None)
    assert sum(place["class_probabilities"].values()) == pytest.approx(1.0)
    assert np.shape(place["covariance_c_tan_phi"]) == (2, 2)
    status, out, err = query("at", "-3.5", "2")
    assert (status, err) == (0, "")
    assert "-3.50" in out
    assert "unknown: seen, but not recognised: too dark" in out
    assert "unknown: nobody has seen this ground" in query("at", "-3.5", "-2e1")[1]


def test_unknown_is_null_never_a_number(query):
    for place in (("0.7", "0.1"), ("9", "9"), ("-3.4", "2.1")):
        (row,) = json.loads(query("at", *place, "--format", "json")[1])["places"]
        assert row["known"] is False
        assert row["unknown"]
        for name in ("c_Pa", "tan_phi", "phi_rad", "shear_strength_Pa", "shear_strength_lower_Pa", "age_s"):
            assert row[name] is None


def test_along_a_path(query, tmp_path):
    (tmp_path / "path.csv").write_text("name,x_m,y_m\na,0.1,0.1\nb,0.6,0.1\nc,-9,0\n")
    _, out, _ = query("along", "path.csv", "--format", "csv", "--confidence", "0.9")
    rows = list(csv.DictReader(io.StringIO(out)))
    assert [row["known"] for row in rows] == ["True", "False", "False"]
    assert float(rows[0]["shear_strength_lower_Pa"]) > 0
    assert (rows[1]["shear_strength_lower_Pa"], rows[1]["probability_asphalt"][:4]) == ("", "0.99")
    assert rows[2]["unknown"] == "nobody has seen this ground"


def test_near_a_place(query):
    _, out, _ = query("near", "0", "0", "--radius", "1", "--format", "geojson")
    page = json.loads(out)
    assert page["type"] == "FeatureCollection"
    assert page["site_frame"] == {"site": "quarry", "unit": "m", "origin": None}
    assert [feature["properties"]["class"] for feature in page["features"]] == ["sand", "asphalt"]
    assert page["features"][0]["geometry"]["coordinates"][0][0] == [0.0, 0.0]
    assert page["features"][0]["geometry"]["coordinates"][0][2] == [0.5, 0.5]
    assert json.loads(query("near", "-3.4", "2.1", "--radius=1", "--format", "json")[1])["places"][0]["x_m"] == -3.25
    assert "nobody has seen ground there" in query("near", "99", "99", "--radius", "1")[1]
    point = json.loads(query("at", "-1", "-1", "--format", "geojson")[1])["features"][0]["geometry"]
    assert point == {"type": "Point", "coordinates": [-1.0, -1.0]}


def test_the_columns_of_csv_are_the_same_whatever_is_found(query, tmp_path):
    (tmp_path / "path.csv").write_text("x_m,y_m\n0.1,0.1\n")
    queries = (
        ("at", "0.2", "0.3"), ("at", "9", "9"), ("along", "path.csv"),
        ("near", "0", "0", "--radius", "1"), ("near", "99", "99", "--radius", "1"),
    )  # fmt: skip
    pages = [query(*arguments, "--format", "csv")[1].splitlines() for arguments in queries]
    assert [len(page) for page in pages] == [2, 2, 2, 3, 1]
    (header,) = {page[0] for page in pages}
    assert header.startswith("x_m,y_m,known,unknown,class,probability_asphalt,probability_sand,c_Pa,")
    place = json.loads(query("at", "0.2", "0.3", "--format", "json")[1])["places"][0]
    assert list(flat(place)) == header.split(",")


def test_stress_in_any_unit(query):
    answers = [query("class", "sand", "--normal-stress", text, "--format", "json")[1] for text in ("20 kPa", "0.2 bar")]
    assert json.loads(answers[0])["normal_stress_Pa"] == pytest.approx(json.loads(answers[1])["normal_stress_Pa"])


def test_several_sites(query):
    with TerrainDatabase("terrain.db") as database:
        database.add_drive(some_drive("beach"))
    status, _, err = query("classes")
    assert status == 2
    assert "several sites" in err
    assert "beach, quarry" in err
    assert json.loads(query("classes", "--site", "beach", "--format", "json")[1])["site"] == "beach"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["classes", "--db", "missing.db"], "missing.db: no such file"),
        (["classes", "--db", "notes.txt"], "notes.txt: is not a database"),
        (["classes", "--db", "."], "is a folder"),
        (["classes", "--db", "mysql://host/x"], "'mysql'"),
        (["classes", "--site", "moon"], "no site 'moon'"),
        (["classes", "--format", "xml"], "'xml'"),
        (["classes", "--format", "geojson"], "'geojson'"),
        (["classes", "--confidence", "1.5"], "confidence"),
        (["classes", "--normal-stress", "3 m"], "'3 m'"),
        (["classes", "--normal-stress", "-1 kPa"], "'-1 kPa'"),
        (["classes", "--normal-stress", "__import__('os')"], "--normal-stress"),
        (["at", "here", "0"], "X: 'here'"),
        (["at", "0", "nan"], "Y: 'nan'"),
        (["near", "0", "0", "--radius", "-1"], "radius"),
        (["along", "missing.csv"], "missing.csv: no such file"),
        (["along", "."], "."),
        (["along", "notes.txt"], "notes.txt: a file of kind '.txt'"),
        (["along", "other.csv"], "other.csv: no column x_m (expected columns x_m, y_m, found x, y_m)"),
        (["along", "bad.csv"], "bad.csv, row 3, column y_m: 'abc'"),
        (["along", "short.csv"], "short.csv, row 2: 1 cell"),
        (["along", "cut.csv"], "cut.csv, row 3: cut off in mid-row"),
        (["along", "long.csv"], "long.csv, row 3: 3 cells"),
        (["along", "blank.csv"], "blank.csv, row 3: "),
        (["along", "twice.csv"], "twice.csv, row 1: column x_m stands twice"),
        (["along", "grouped.csv"], "grouped.csv, row 2, column x_m: '1_0'"),
        (["along", "empty.csv"], "empty.csv, row 2, column y_m: 'nan'"),
        (["along", "nothing.csv"], "nothing.csv: a header without rows"),
        (["along", "binary.csv"], "binary.csv"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(query, tmp_path, arguments, said):
    (tmp_path / "notes.txt").write_text("dear diary")
    (tmp_path / "bad.csv").write_text("x_m,y_m\n1,2\n3,abc\n")
    (tmp_path / "short.csv").write_text("x_m,y_m\n1\n")
    (tmp_path / "other.csv").write_text("x,y_m\n1,2\n")
    (tmp_path / "cut.csv").write_text("x_m,y_m\n1,2\n3")
    (tmp_path / "long.csv").write_text("x_m,y_m\n1,2\n3,4,5\n")
    (tmp_path / "blank.csv").write_text("x_m,y_m\n1,2\n\n3,4\n")
    (tmp_path / "twice.csv").write_text("x_m,x_m,y_m\n1,2,3\n")
    (tmp_path / "grouped.csv").write_text("x_m,y_m\n1_0,2\n")
    (tmp_path / "empty.csv").write_text("x_m,y_m\n1,\n")
    (tmp_path / "nothing.csv").write_text("x_m,y_m\n")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01" * 50)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    status, out, err = query(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith("bevameter: ")
    assert err.count("\n") == 1
    assert said in err
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_command_loads_nothing_heavy():
    code = "import sys; import bevameter.framework.cli.query; print(sorted(sys.modules))"
    heavy = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "'typer'" in heavy
    assert "'sqlalchemy'" not in heavy
    assert "'pint'" not in heavy


def test_a_class_that_the_model_does_not_fit_is_noted(query, tmp_path):
    assert "does not fit" not in query("classes")[1]
    with TerrainDatabase(str(tmp_path / "wrong.db")) as database:
        database.add_drive(some_drive(misfit=4.0))
    assert "sand: the textbook wheel does not fit" in query("classes", "--db", "wrong.db")[1]
    asphalt, sand = json.loads(query("classes", "--db", "wrong.db", "--format", "json")[1])["classes"]
    assert sand["misfits"]
    assert "misfits" not in asphalt


def test_strength_that_is_extrapolated_is_noted(query):
    near, far = (query("at", "0.1", "0.1", "--normal-stress", stress)[1] for stress in ("20 kPa", "1e9 Pa"))
    assert "extrapolated" not in near
    assert "note: the normal stress is far from those driven" in far
    (place,) = json.loads(query("at", "0.1", "0.1", "--normal-stress", "1e9 Pa", "--format", "json")[1])["places"]
    assert "extrapolated" in place["note"]
