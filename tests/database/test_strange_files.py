"""Files that are cut off, and files with strange names: each command answers, or says in one line why not."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database.check import check
from bevameter.database.info import info
from bevameter.database.maintenance import migrate, prune
from bevameter.database.rebuild import rebuild
from bevameter.framework.cli.main import app, main
from typer.testing import CliRunner

NAMES = [
    "with space and \u00fc \u8a9e.db", "a#b.db", "a?b=c&d.db", "a%20b%zz.db", "file:x.db", "'q\"u`o;te.db", "-x.db",
    "back\\slash.db", "new\nline.db", "no text \udcff.db",
]  # fmt: skip


def said(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["db", *map(str, arguments)])
    assert result.exit_code in (0, 1, 2), result.exception
    assert len(result.stderr.splitlines()) == (result.exit_code == 2)
    return result.exit_code, result.stderr or result.stdout


@pytest.mark.skipif(os.name == "nt", reason="Windows has none of these names")
@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_strange_names(tmp_path, monkeypatch, make, name):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / name
    try:
        path.touch()
        path.unlink()
    except OSError:
        pytest.skip("this file system has no such names")
    with TerrainDatabase(path) as database:
        database.add_drive(make.drive("d1", model="m0"))
        database.add_drive(make.drive("d1"))
    assert [each.name for each in tmp_path.iterdir()] == [name]
    with TerrainDatabase(name, must_exist=True) as database, TerrainDatabase("other.db") as other:
        assert database.snapshot().drives == 1
        assert other.merge(database).new == 4
        assert len(prune(database).drives) == 1
    assert check(path).sound
    assert info(path).sites[0].drives == 1
    assert migrate(path).copy is None
    copy = Path("copy " + name)
    assert rebuild(path, copy).faults == ()
    for command in (["info", path], ["check", path], ["merge", "union.db", path], ["export", path, "x.csv"]):
        output = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
        with monkeypatch.context() as patch:
            patch.setattr(sys, "argv", ["bevameter", "db", *map(str, command)])
            patch.setattr(sys, "stdout", output)
            with pytest.raises(SystemExit) as ended:
                main()
            output.flush()
        assert ended.value.code == 0
    assert said("rebuild", path, copy)[0] == 2  # it is there already
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted(
        [name, copy.name, "other.db", "union.db", "x.csv"]
    )


def test_a_path_with_a_zero_character():
    for work in (TerrainDatabase, check, info, migrate):
        for path in ("a\0b.db", "sqlite:///a\0b.db", "postgresql://me@host/a\0b"):
            with pytest.raises(InputError, match="without zero characters"):
                work(path)


def refusal(work: Callable[[], object]) -> str:
    """What is said where work is refused; nothing where it is done."""
    try:
        work()
    except InputError as error:
        return str(error)
    return ""


def test_a_file_that_is_cut_off_anywhere(tmp_path, drive_with_soil):
    path, cut, new = (tmp_path / name for name in ("whole.db", "cut.db", "new.db"))

    def answers() -> list[float]:
        with TerrainDatabase(cut if cut.exists() else path, must_exist=True) as database:
            return database.snapshot().along([[0.1, 0.1], [0.6, 0.1]]).shear_strength_lower.tolist()

    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
    whole, content, rebuilt = answers(), path.read_bytes(), 0
    for length in [1, 15, 16, 99, 100, 511, 513, 4095, 4097, *range(4096, len(content), 8192), len(content) - 1]:
        cut.write_bytes(content[:length])
        lines = [refusal(answers), refusal(lambda: check(cut)), refusal(lambda: rebuild(cut, new))]
        assert lines[0] or answers() == whole
        assert lines[1] or not check(cut).sound
        for line in filter(None, lines):
            assert "cut.db" in line
            assert "\n" not in line
        if not lines[2]:
            assert not [fault for fault in check(new).faults if fault.damaged]
            new.unlink()
            rebuilt += 1
        assert cut.read_bytes() == content[:length]
        assert {each.name for each in tmp_path.iterdir()} == {"whole.db", "cut.db"}
    assert rebuilt > 2
    cut.write_bytes(content[:5000])
    for command in (["info"], ["merge"], ["prune"], ["migrate"], ["export"]):
        status, line = said(*command, cut, *{"merge": [path], "export": ["x.csv"]}.get(command[0], []))
        assert status == 2
        assert "cut.db" in line
