"""`bevameter photographs`: known ground of a drive as photographs to train from."""

from __future__ import annotations

import csv
import re

import cv2
import numpy as np
import pytest
from bevameter import read_recording
from bevameter.framework.cli.main import app
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.track.way import track_of
from bevameter.vision.photographs import SIDE_M, photographs
from bevameter.vision.quality import well_lit
from typer.testing import CliRunner


def taken(*arguments) -> str:
    result = CliRunner().invoke(app, ["photographs", *map(str, arguments)])
    assert result.exit_code == 0, result.output
    return result.stdout


def test_stretches_of_a_drive_become_a_labelled_folder(short_drive, tmp_path):
    folder, labels = tmp_path / "photos", read_recording(short_drive).labels
    stretches = list(zip(labels.classes, labels.start_s, labels.end_s, strict=True))
    for name, start_s, end_s in stretches:
        said = taken(short_drive, "--class", name, "--from", start_s, "--to", end_s, "--out", folder)
        assert re.match(rf"\d+ photographs of {name} added to ", said)
    found = read_labelled(folder)
    assert {each.class_name for each in found} == set(labels.classes)
    assert len({each.group for each in found}) == len(stretches)
    image = cv2.imread(str(found[0].file))
    assert image.shape == (256, 256, 3)
    assert image.std() > 3.0

    # a second time, with one's own column in the index: nothing is there twice, and the column stays
    index = folder / "index.csv"
    rows = list(csv.DictReader(index.open(encoding="utf-8")))
    lines = index.read_text(encoding="utf-8").splitlines()
    index.write_text("\n".join([lines[0] + ",light", *(line + ",dusk" for line in lines[1:])]) + "\n")
    name, start_s, end_s = stretches[0]
    taken(short_drive, "--class", name, "--from", start_s, "--to", end_s, "--out", folder)
    again = list(csv.DictReader(index.open(encoding="utf-8")))
    assert sorted(row["file"] for row in again) == sorted(row["file"] for row in rows)
    assert {row["light"] for row in again if row["class"] != name} == {"dusk"}


def test_photographs_are_a_metre_apart_and_bad_frames_are_none(short_drive):
    recording = read_recording(short_drive)
    found = list(photographs(recording))
    track = track_of(recording)
    way = np.interp([each.time_s for each in found if each.image is not None], track.time_s, track.way_m)
    assert len(way) > 20
    assert np.diff(way).min() >= SIDE_M
    assert all(each.problem for each in found if each.image is None)
    good = np.stack([each.image for each in found if each.image is not None])
    assert well_lit(good).all()
    assert not well_lit(np.concatenate([good // 20, good // 60 + 120, np.minimum(good, 55) + 200])).any()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--class", "unknown", "--out", "photos"], "unknown"),
        (["--class", "sand", "--out", "photos", "--from", "9", "--to", "3"], "--from before --to"),
        (["--class", "sand", "--out", "photos", "--from", "900"], "no frame with a known place from 900 s"),
        (["--class", "sand", "--out", "full"], "full: holds mine.jpg and no index.csv"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(short_drive, arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.jpg").write_bytes(b"")
    result = CliRunner().invoke(app, ["photographs", str(short_drive), *arguments])
    assert result.exit_code == 2, result.output
    assert len(result.stderr.splitlines()) == 1
    assert said in result.stderr
    assert not (tmp_path / "photos").exists()


def test_a_drive_without_a_camera_is_refused(tmp_path):
    (tmp_path / "vehicle.toml").write_text("[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n")
    (tmp_path / "wheel.csv").write_text("time_s,x_m,y_m,load_N\n0,0,0,100\n1,1,0,100\n")
    result = CliRunner().invoke(app, ["photographs", str(tmp_path), "--class", "sand", "--out", str(tmp_path / "p")])
    assert result.exit_code == 2
    assert "no images (expected images, places and the camera's geometry)" in result.stderr
