"""What tests of bad input share: a sound recording to spoil, and the check that a command refuses."""

from __future__ import annotations

import hashlib
from pathlib import Path

import cv2
import numpy as np
import soundfile
from bevameter.framework.cli.main import app
from typer.testing import CliRunner

HEADER = "time_s,load_N,slip,torque_Nm,sinkage_m"
ROWS = [f"{0.1 * i:.1f},{500 + i},{0.1 + 0.01 * i:.2f},{12 + 0.1 * i:.1f},{0.01 + 1e-4 * i:.4f}" for i in range(40)]
WHEEL = "\n".join([HEADER, *ROWS, ""])
VEHICLE = "[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n"
SOIL = "c_Pa = 500.0\nphi_deg = 30.0\nk_m = 0.02\nstiffness_Pa = 8e5\nn = 1.0\n"
VIBRATION = "time_s,wz,az\n" + "\n".join(f"{0.01 * i:.2f},{i % 7},{9.8 + 0.1 * (i % 5)}" for i in range(400)) + "\n"


def edited(row: int, old: str, new: str) -> str:
    """The wheel file with a change in the row of that number, the header being row 1."""
    lines = WHEEL.split("\n")
    assert old in lines[row - 1]
    lines[row - 1] = lines[row - 1].replace(old, new, 1)
    return "\n".join(lines)


def jpeg() -> bytes:
    noise = np.random.default_rng(3).integers(0, 255, (96, 128, 3)).astype(np.uint8)
    return cv2.imencode(".jpg", cv2.GaussianBlur(noise, (0, 0), 1.5))[1].tobytes()


def picture(path: Path, share: float = 1.0) -> Path:
    """A JPEG, or its beginning."""
    data = jpeg()
    path.write_bytes(data[: int(len(data) * share)])
    return path


def sound(path: Path, seconds: float = 2.0) -> Path:
    samples = 0.1 * np.random.default_rng(4).normal(size=int(seconds * 8000))
    soundfile.write(path, samples.astype(np.float32), 8000)
    return path


def everything(folder: Path) -> dict[str, str]:
    """Every file and folder under a folder, hidden ones included, with a digest of its content."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "folder"
        for path in folder.rglob("*")
    }


def refused(folder: Path, arguments, *said: str) -> str:
    before = everything(folder)
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 2, (result.exit_code, result.output, result.exception)
    assert len(result.stderr.splitlines()) == 1, result.stderr
    assert result.stderr.startswith("bevameter: ")
    assert result.stdout == ""
    for fragment in said:
        assert fragment in result.stderr
    assert everything(folder) == before
    return result.stderr


def run(tmp_path: Path, recording: Path, *more) -> list:
    return ["run", recording, "--db", tmp_path / "t.db", "--json", tmp_path / "o.json", *more]


def identify(tmp_path: Path, recording: Path, *more) -> list:
    return ["identify", recording, "--json", tmp_path / "o.json", *more]
