"""Bad input through the command line: one line naming file, place, value and expectation, exit 2, nothing written."""

from __future__ import annotations

import subprocess
import sys

import pytest
from bevameter.framework.cli.main import app
from refusals import (
    HEADER,
    VEHICLE,
    WHEEL,
    edited,
    everything,
    identify,
    refused,
    run,
    sound,
)
from typer.testing import CliRunner

# A library's warning would be a second line on the user's stderr.
pytestmark = pytest.mark.filterwarnings("error")

WHEEL_FAULTS = {
    "unit misspelt": (WHEEL.replace("load_N", "load_rpm", 1), ("column load_rpm", "expected load_N")),
    "another unit": (WHEEL.replace("torque_Nm", "torque_kN", 1), ("column torque_kN", "expected torque_Nm")),
    "column misspelt": (WHEEL.replace("sinkage_m", "sinkgae_m", 1), ("column sinkgae_m", "expected sinkage_m")),
    "a column twice": (WHEEL.replace("slip", "load_N", 1), ("load_N stands twice",)),
    "time backwards": (edited(9, "0.7,", "0.35,"), ("row 9, column time_s", "0.35 s", "does not decrease")),
    "text": (edited(5, "503", "5o3"), ("row 5, column load_N", "'5o3'", "a number")),
    "infinite": (edited(5, "503", "inf"), ("row 5, column load_N", "inf", "a finite number")),
    "no time in a row": (edited(5, "0.3,", ","), ("row 5, column time_s", "a finite number")),
    "slip in percent": (edited(12, "0.20", "20.0"), ("row 12, column slip", "20", "[-1, 1]")),
    "a short row": (edited(12, ",0.0110", ""), ("row 12", "4 cells", "5")),
    "header only": (HEADER + "\n", ("a header without rows", "at least one row")),
    "empty": ("", ("an empty file",)),
    "blank lines": ("\n\n", ("an empty file",)),
    "binary": ("time_s,load_N\n\0\1,2\n", ("binary data",)),
    "no channel": ("time_s,remark\n0,a\n1,b\n", ("no wheel channel",)),
    "nothing measured": ("time_s,load_N,slip\n0,,\n1,,\n", ("no wheel channel has a value",)),
}


@pytest.mark.parametrize("command", [run, identify])
@pytest.mark.parametrize("fault", WHEEL_FAULTS)
def test_a_bad_wheel_file(fault, command, drive, tmp_path):
    text, said = WHEEL_FAULTS[fault]
    (drive / "wheel.csv").write_text(text)
    refused(tmp_path, command(tmp_path, drive), "wheel.csv", *said)


@pytest.mark.parametrize("command", [run, identify])
def test_a_wheel_file_without_time_names_the_columns_that_may_be_it(command, drive, tmp_path):
    (drive / "wheel.csv").write_text(WHEEL.replace("time_s", "clock", 1))
    result = CliRunner().invoke(app, [str(argument) for argument in command(tmp_path, drive)])
    first, *others = result.stderr.splitlines()
    assert result.exit_code == 2
    assert first.endswith("wheel.csv: 1 fault, and 1 in doubt")
    assert others[0].startswith("  neither column time_s nor column run")
    assert 'CHANNEL = { column = "clock"' in others[1]


@pytest.mark.parametrize("command", [run, identify])
def test_a_wheel_file_that_is_not_utf8(command, drive, tmp_path):
    (drive / "wheel.csv").write_bytes(WHEEL.replace("slip", "sl\x81p").encode("latin-1"))
    refused(tmp_path, command(tmp_path, drive), "wheel.csv", "not UTF-8")


@pytest.mark.parametrize("command", [run, identify])
def test_a_damaged_parquet_file(command, drive, tmp_path):
    (drive / "wheel.csv").unlink()
    (drive / "wheel.parquet").write_bytes(b"PAR1 and nothing more")
    refused(tmp_path, command(tmp_path, drive), "wheel.parquet", "no readable Parquet")


VEHICLE_FAULTS = {
    "typing error": (VEHICLE + "raduis_m = 0.2\n", ("raduis_m",)),
    "negative radius": ("[wheel]\nradius_m = -0.2\nwidth_m = 0.1\n", ("radius_m", "-0.2", "greater than 0")),
    "text": ("[wheel]\nradius_m = 'wide'\nwidth_m = 0.1\n", ("radius_m", "'wide'")),
    "no width": ("[wheel]\nradius_m = 0.2\n", ("width_m",)),
    "no geometry": ("name = 'x'\n", ("no wheel geometry", "[wheel]")),
    "no TOML": ("radius 0.2", ("valid TOML",)),
    "no wheel in the list": ("wheels = []\n", ("wheels",)),
    "unknown noise": (VEHICLE + "[noise]\nload_n = 5.0\n", ("load_n",)),
}


@pytest.mark.parametrize("where", ["inside", "given"])
@pytest.mark.parametrize("command", [run, identify])
@pytest.mark.parametrize("fault", VEHICLE_FAULTS)
def test_a_bad_vehicle(fault, command, where, drive, tmp_path):
    text, said = VEHICLE_FAULTS[fault]
    file = drive / "vehicle.toml" if where == "inside" else tmp_path / "other.toml"
    file.write_text(text)
    more = () if where == "inside" else ("--vehicle", file)
    refused(tmp_path, command(tmp_path, drive, *more), file.name, *said)


def test_no_wheel_geometry_at_all(drive, tmp_path):
    (drive / "vehicle.toml").unlink()
    refused(tmp_path, identify(tmp_path, drive), "drive", "no wheel geometry", "vehicle.toml")
    refused(tmp_path, identify(tmp_path, drive / "wheel.csv"), "wheel.csv", "no wheel geometry")
    refused(tmp_path, identify(tmp_path, drive, "--vehicle", tmp_path / "none.toml"), "none.toml", "no such file")


ABOUT_FAULTS = {
    "typing error": ("strat_time = 2024-05-01T10:00:00Z\n", ("strat_time",)),
    "no such stream": ("streams = ['wheel', 'cammera']\n", ("streams", "cammera")),
    "no date": ("start_time = 'yesterday'\n", ("start_time", "yesterday")),
    "missing stream": ("streams = ['vibration']\n", ("vibration", "no such file")),
    "missing file": ("[sound]\nfile = 'mic.wav'\n", ("mic.wav", "no such file")),
    "way out": ("[sound]\nfile = '../../x.wav'\n", ("leads out of the folder",)),
    "no TOML": ("name = ", ("valid TOML",)),
}


@pytest.mark.parametrize("fault", ABOUT_FAULTS)
def test_a_bad_recording_toml(fault, drive, tmp_path):
    text, said = ABOUT_FAULTS[fault]
    (drive / "recording.toml").write_text(text)
    refused(tmp_path, run(tmp_path, drive), *said)


def write(path: str, content: str | bytes):
    return lambda folder: (folder / path).write_bytes(content.encode() if isinstance(content, str) else content)


SOUND_FAULTS = {
    "text named wav": (write("sound.wav", "hello, I am a text\n"), "no sound that can be read"),
    "sound without a sample": (lambda folder: sound(folder / "sound.wav", 0), "no sample"),
    "empty sound file": (write("sound.wav", b""), "an empty file"),
}


@pytest.mark.parametrize("fault", SOUND_FAULTS)
def test_bad_sound_is_left_out_and_refused_where_nothing_else_is(fault, drive, models, tmp_path):
    spoil, said = SOUND_FAULTS[fault]
    alone = tmp_path / "alone"
    alone.mkdir()
    spoil(alone)
    refused(tmp_path, run(tmp_path, alone), "sound.wav", said)
    spoil(drive)
    result = CliRunner().invoke(app, [str(argument) for argument in run(tmp_path, drive, "--models", models)])
    assert result.exit_code == 0, result.output
    (line,) = (line for line in result.output.splitlines() if "sound is left out" in line)
    assert "sound.wav" in line
    assert said in line


STREAM_FAULTS = {
    "two sounds": (lambda folder: sound(folder / "sound.flac"), ("sound.wav and sound.flac",)),
    "pose column": (write("pose.csv", "time_s,x_m,y\n0,1,2\n"), ("pose.csv", "no column y_m")),
    "pose backwards": (
        write("pose.csv", "time_s,x_m,y_m,yaw_rad\n1,0,0,0\n0,1,0,0\n"),
        ("pose.csv", "row 3, column time_s", "time runs backwards"),
    ),
    "camera index gone": (lambda folder: (folder / "camera" / "camera.csv").unlink(), ("camera.csv", "no such file")),
    "camera column": (write("camera/camera.csv", "time_s,image\n0,0.jpg\n"), ("camera.csv", "no column file")),
    "images gone": (write("camera/camera.csv", "time_s,file\n0,a.jpg\n1,b.jpg\n"), ("a.jpg", "no such file")),
    "image outside": (write("camera/camera.csv", "time_s,file\n0,../../a.jpg\n"), ("row 2, column file", "leads out")),
    "labels": (write("labels.csv", "start_s,end_s,class\n5,1,sand\n"), ("labels.csv", "row 2")),
}


@pytest.mark.parametrize("fault", STREAM_FAULTS)
def test_a_bad_stream(fault, drive, tmp_path):
    spoil, said = STREAM_FAULTS[fault]
    spoil(drive)
    refused(tmp_path, run(tmp_path, drive), *said)


def test_a_text_file_named_flac(tmp_path, models):
    (tmp_path / "sound.flac").write_text("this is no sound\n")
    arguments = ["classify", "audio", tmp_path / "sound.flac", "--model", models / "audio.skops"]
    said = ("sound.flac", "no sound that can be read", "WAV, FLAC")
    refused(tmp_path, [*arguments, "--json", tmp_path / "o.json"], *said)


@pytest.mark.parametrize("command", [run, identify])
def test_no_recording(command, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "notes.log").write_text("hello")
    for name in ("x.bag", "x.mcap", "x.db3"):
        (tmp_path / name).write_text("hello, I am a text")
        refused(tmp_path, command(tmp_path, tmp_path / name), name)
    refused(tmp_path, command(tmp_path, tmp_path / "none"), "none", "no such file or folder", "a recording's folder")
    refused(tmp_path, command(tmp_path, tmp_path / "empty"), "empty", "no stream", "wheel.csv")
    refused(tmp_path, command(tmp_path, tmp_path / "notes.log"), "notes.log", "'.log'")


def test_a_bad_topic_map(drive, tmp_path):
    topics = tmp_path / "topics.toml"
    topics.write_text("[wheel]\ntopic = '/wheel'\n")
    refused(tmp_path, run(tmp_path, drive, "--topics", topics), "topics.toml", "a topic map, which a bag needs")


def test_soil_that_cannot_be_identified(drive, tmp_path):
    (drive / "wheel.csv").unlink()
    refused(tmp_path, identify(tmp_path, drive), "no wheel channels", "wheel.csv")


@pytest.mark.parametrize("command", [run, identify])
def test_the_real_command_prints_one_line_and_writes_nothing(command, drive, tmp_path):
    """As a user's shell sees it: no traceback, no warning of a library, no database, no part of a file."""
    (drive / "wheel.csv").write_text(edited(9, "0.7,", "0.35,"))
    before = everything(tmp_path)
    arguments = [sys.executable, "-m", "bevameter.framework.cli.main", *map(str, command(tmp_path, drive))]
    done = subprocess.run(arguments, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"bevameter: {drive / 'wheel.csv'}, row 9, column time_s: ")
    assert everything(tmp_path) == before


N = range(300)
ODD = {
    "five rows": WHEEL.split("\n")[:6],
    "constant": [HEADER, *(f"{0.1 * i:.1f},500,0.2,12,0.01" for i in N)],
    "standstill": [HEADER, *(f"{0.1 * i:.1f},500,0,0,0.01" for i in N)],
    "no load": [HEADER, *(f"{0.1 * i:.1f},0,0.2,0,0" for i in N)],
    "huge": [HEADER, *(f"{0.1 * i:.1f},{5 + i % 7}e290,0.2,{1 + i % 5}e300,{i % 3}e305" for i in N)],
    "far in time": [HEADER, *(f"{1.7e9 + 0.1 * i:.1f},{500 + i % 9},{0.1 + i % 30 / 60},12,0.01" for i in N)],
    "half missing": [HEADER, *(f"{0.1 * i:.1f},{500 + i % 9},{0.1 + i % 30 / 60},,{'0.01' * (i % 2)}" for i in N)],
}  # fmt: skip


@pytest.mark.parametrize("kind", ODD)
def test_odd_numbers_get_an_answer_without_a_warning(kind, drive, tmp_path):
    """The files are valid: there is an answer, if only that the soil cannot be identified."""
    (drive / "wheel.csv").write_text("\n".join(ODD[kind]) + "\n")
    for arguments in (
        identify(tmp_path, drive),
        ["identify", drive, "--method", "linear"],
        ["run", drive / "wheel.csv", "--db", tmp_path / "t.db"],
    ):
        result = CliRunner().invoke(app, [str(argument) for argument in arguments])
        said = result.exit_code == 2 and result.stderr.startswith("bevameter: ")
        assert said or (result.exit_code == 0 and result.stderr == ""), (result.output, result.exception)
