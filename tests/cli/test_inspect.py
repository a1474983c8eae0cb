"""`bevameter inspect`: the answer first, the files that it writes, and bad input in one line."""

from __future__ import annotations

import json

import pytest
from bevameter.framework.cli.main import app
from typer.testing import CliRunner

TABLE = "Time [s],Fz [N],DP [N],T [Nm],Slip [%],Sinkage [mm]\n" + "".join(
    f"{0.1 * i:.1f},{100 + i},{10 + i},{3 + i},{10 + i},{12 + i}\n" for i in range(60)
)


def run(*arguments):
    return CliRunner().invoke(app, ["inspect", *map(str, arguments)])


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text(TABLE)
    return path


def test_the_answer_comes_first_with_what_lacks_and_its_mend(table, tmp_path):
    page = tmp_path / "out.json"
    result = run(table, "--json", page)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0].startswith("class map: no, ")
    assert lines[1] == "soil (c, phi): no, it lacks the wheel's geometry"
    assert lines[2].startswith("explain: no, ")
    assert "radius_m and width_m under [wheel]" in result.stdout
    assert "Sinkage [mm]" in result.stdout
    written = json.loads(page.read_text())
    assert written["schema"] == 1
    assert written["soil"]["possible"] is False
    assert written["soil"]["missing"][0]["what"] == "the wheel's geometry"
    assert [each["feeds"] for each in written["sources"]][1] == "load_N"


def test_files_are_written_and_not_over_others(table, tmp_path):
    result = run(table, "--write")
    assert result.exit_code == 0, result.output
    assert (tmp_path / "columns.toml").is_file()
    vehicle = tmp_path / "vehicle.toml"
    assert "--columns " in result.stdout.splitlines()[-1]
    refused = run(table)
    assert refused.exit_code == 2
    assert "vehicle.toml, key wheel.radius_m" in refused.stderr
    vehicle.write_text("[wheel]\nradius_m = 0.15\nwidth_m = 0.1\n")
    again = run(table, "--write")
    assert again.exit_code == 2
    assert "columns.toml: is there already" in again.stderr
    done = run(table, "--columns", tmp_path / "columns.toml", "--write")
    assert done.exit_code == 0
    assert "soil (c, phi): yes" in done.stdout
    assert "nothing to write" in done.stdout


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.mcap", b"\x89MCAP0\r\n" + bytes(range(256))),
        ("a.bag", b"#ROSBAG V2.0\n\0\0"),
        ("a.db3", b"SQLite format 3\0"),
        ("a.csv", b""),
        ("a.csv", bytes(range(256))),
        ("a.xyz", b"1"),
    ],
)
def test_a_broken_file_is_one_line(name, content, tmp_path):
    path = tmp_path / name
    path.write_bytes(content)
    result = run(path, "--write")
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert name in result.stderr
    assert list(tmp_path.iterdir()) == [path]
