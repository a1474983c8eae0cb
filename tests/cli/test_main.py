"""The command line as a whole: errors in one line, exit statuses, and that help costs no heavy import."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import bevameter
import pytest
from bevameter import TerrainDatabase
from bevameter.framework.cli import main as cli
from bevameter.framework.core.errors import InputError
from typer.testing import CliRunner

COMMANDS = (
    "scenario",
    "inspect",
    "vehicle",
    "run",
    "query",
    "db",
    "map",
    "view",
    "identify",
    "explain",
    "simulate",
    "train",
    "classify",
    "doctor",
)


def test_help_names_every_command():
    result = CliRunner().invoke(cli.app, ["--help"])
    assert result.exit_code == 0
    for command in COMMANDS:
        assert f"  {command} " in result.output


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command):
    result = CliRunner().invoke(cli.app, [command, "--help"])
    assert result.exit_code == 0
    assert "Usage" in result.output


def test_version():
    result = CliRunner().invoke(cli.app, ["--version"])
    assert result.output.strip() == f"bevameter {bevameter.__version__}"


def test_a_wrong_command_line_exits_with_status_2():
    result = CliRunner().invoke(cli.app, ["run"])
    assert result.exit_code == 2
    assert "RECORDING" in result.stderr
    assert CliRunner().invoke(cli.app, ["walk"]).exit_code == 2


def failing_with(error, monkeypatch):
    def fail(*arguments, **options):
        raise error

    monkeypatch.setattr("bevameter.framework.core.recording.readers.read_recording", fail)
    return CliRunner().invoke(cli.app, ["run", "somewhere", "--db", "t.db"])


def test_a_known_error_is_one_line_on_stderr_and_exit_2(monkeypatch):
    result = failing_with(InputError("wheel.csv", "'abc'", expected="a number", place="row 12"), monkeypatch)
    assert result.exit_code == 2
    assert result.stderr == "bevameter: wheel.csv, row 12: 'abc' (expected a number)\n"
    assert result.stdout == ""


def test_an_interrupt_is_one_line_and_exit_130(monkeypatch):
    result = failing_with(KeyboardInterrupt(), monkeypatch)
    assert result.exit_code == 130
    assert result.stderr.startswith("bevameter: interrupted")
    assert len(result.stderr.splitlines()) == 1


def test_an_unknown_error_keeps_its_traceback(monkeypatch):
    result = failing_with(ZeroDivisionError("a fault of ours"), monkeypatch)
    assert isinstance(result.exception, ZeroDivisionError)


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from bevameter.framework.cli import main\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'cv2', 'librosa', 'sklearn', 'numba', 'matplotlib', 'sqlalchemy', "
        "'pydantic', 'rich', 'pyarrow'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_installed_script_answers(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "bevameter.framework.cli.main", "map", "--db", "none.db", "--out", "map.png"],
        capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("bevameter: none.db")
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def into(target, *arguments, **options):
    """Run the command line with its output going somewhere, buffered or not as Python would have it."""
    code = "from bevameter.framework.cli.main import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], stdout=target, stderr=subprocess.PIPE, text=True, **options
    )  # fmt: skip


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["explain", "--help"], ["query", "classes"]])
def test_a_full_disk_is_one_line_and_exit_2(arguments, unbuffered, tmp_path):
    TerrainDatabase(f"sqlite:///{tmp_path}/terrain.db").make()
    with open("/dev/full", "w") as full:
        done = into(full, *arguments, cwd=tmp_path, env=os.environ | {"PYTHONUNBUFFERED": unbuffered})
    assert (done.returncode, done.stderr) == (2, "bevameter: the output cannot be written: No space left on device\n")


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [["--help"], ["explain", "--help"], ["query", "classes"]])
def test_a_closed_pipe_is_no_error_and_exit_141(arguments, unbuffered, tmp_path):
    TerrainDatabase(f"sqlite:///{tmp_path}/terrain.db").make()
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = into(writer, *arguments, cwd=tmp_path, env=os.environ | {"PYTHONUNBUFFERED": unbuffered})
    finally:
        os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


def test_a_full_disk_elsewhere_keeps_its_traceback(monkeypatch):
    """Only a failure of standard output is one line; any other OSError is an unexpected error."""
    result = failing_with(OSError(errno.ENOSPC, "No space left on device", "part.csv"), monkeypatch)
    assert isinstance(result.exception, OSError)
