"""`bevameter live`: what it prints and stores, and how it ends."""

from __future__ import annotations

import io
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from bevameter import TerrainDatabase
from bevameter.framework.cli.main import app
from every_bag import Drive
from mcap_drive import header, make, write
from rrd_file import WITHOUT, File
from typer.testing import CliRunner

VEHICLE = "[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n"


@pytest.fixture
def whole(rng, tmp_path) -> Path:
    """A drive of four seconds, and its vehicle beside it."""
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    Drive(rng, ros1=False).write_mcap(tmp_path / "drive.mcap")
    return tmp_path / "drive.mcap"


def drives(path):
    with TerrainDatabase(path) as database:
        return database.drives()


def test_a_finished_file_is_stored_and_run_knows_it(whole, tmp_path):
    options = ["--db", str(tmp_path / "t.db"), "--site", "field"]
    result = CliRunner().invoke(app, ["live", "--mcap", str(whole), *options])
    assert result.exit_code == 0, result.output
    first, *rest = result.stdout.splitlines()
    assert first.endswith("drive.mcap: places, wheels, camera, sound")
    assert any("drive by vehicle: 1.9 m in 4 s" in line for line in rest), rest
    again = CliRunner().invoke(app, ["run", str(whole), *options])
    assert "known" in again.stdout or "already" in again.stdout
    assert len(drives(tmp_path / "t.db")) == 1


def test_a_drive_is_shown_in_the_rerun_viewer(whole, tmp_path):
    pytest.importorskip("rerun.chunk", reason=WITHOUT)
    options = ["--db", str(tmp_path / "t.db"), "--rerun", str(tmp_path / "d.rrd")]
    result = CliRunner().invoke(app, ["live", "--mcap", str(whole), *options])
    assert result.exit_code == 0, result.output
    rows = File(tmp_path / "d.rrd").rows
    shown_s = max(time for time, _ in rows["/world/vehicle"] if time is not None)
    assert shown_s > 3.9 - 1.0 - 0.2  # all but what waits for earlier samples, and the last step
    assert rows["/camera/image"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--mcap", "nowhere.mcap"], "nowhere.mcap: no such file"),
        (["--mcap", "."], "a folder .expected an MCAP file, or `-`"),
        (["--mcap", "other.mcap", "--idle", "0.1"], "other.mcap: .*damaged"),
        (["--mcap", "drive.mcap", "--resume", "nowhere"], "nowhere: no such file"),
        (["--mcap", "drive.mcap", "--heading", "3"], "--heading"),
        (["--mcap", "drive.mcap", "--rerun", "d.txt"], "d.txt: .*a name that ends with .rrd"),
    ],
)
def test_bad_input_is_one_line(whole, arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.mcap").write_text("my diary, a long one")
    result = CliRunner().invoke(app, ["live", *arguments, "--db", "t.db"])
    assert result.exit_code == 2, result.output
    assert len(result.stderr.splitlines()) == 1
    assert re.search(said, result.stderr), result.stderr
    assert not (tmp_path / "t.db").exists()


def twenty_seconds() -> bytes:
    """An MCAP file of poses and a wheel, without its end."""
    kind, number, file = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/Float64", io.BytesIO()
    turn = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    given = []
    for time_s in np.arange(0.0, 20.0, 0.05).tolist():
        place = make("geometry_msgs/msg/Point", x=0.3 * time_s, y=0.0, z=0.0)
        pose = make("geometry_msgs/msg/Pose", position=place, orientation=turn)
        given.append((time_s, "/pose", kind, make(kind, header=header(time_s, "map"), pose=pose)))
        given.append((time_s, "/wheel/load_N", number, make(number, data=500.0)))
    write(file, iter(given))
    return file.getvalue()[: -len(file.getvalue()) // 10]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_drive_and_stores_it(tmp_path, number):
    """Of standard input that nobody closes."""
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    command = [sys.executable, "-P", "-m", "bevameter.framework.cli.main", "live", "--mcap", "-", "--site", "field",
               "--db", str(tmp_path / "t.db"), "--vehicle", str(tmp_path / "vehicle.toml")]  # fmt: skip
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    ended = threading.Timer(60.0, process.kill)
    ended.start()
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(twenty_seconds())
    process.stdin.flush()
    assert process.stdout.readline().startswith(b"standard input: places, wheels")
    time.sleep(1.0)
    process.send_signal(number)
    said = process.stdout.read().decode()
    assert process.wait() == 128 + number
    ended.cancel()
    assert "`bevameter run` on the whole file" in said
    (drive,) = drives(tmp_path / "t.db")
    assert drive.name == "standard input"
