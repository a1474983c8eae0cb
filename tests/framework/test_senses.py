"""The registry of senses: a sense from outside the package is one class that registers itself."""

from __future__ import annotations

import base64
import io
import json
import sys
import warnings
from importlib.metadata import EntryPoint
from pathlib import Path

import cv2
import numpy as np
import pytest
import soundfile
from bevameter import InputError, Recording, TerrainDatabase, run_traverse
from bevameter.framework import senses
from bevameter.framework.cli.main import app
from bevameter.framework.core.classifier.labelled import LabelledFile
from bevameter.framework.core.recording.types import Pose, VibrationRun
from bevameter.framework.senses import sense_named
from typer.testing import CliRunner

SENSE = """
import numpy as np
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.senses import Observation, Sense, register

def features(file):
    return np.loadtxt(file, ndmin=2)

@register
class Thermometer(Sense):
    name, instrument = "warmth", "thermometer"

    def train(self, labelled, rng, *, notes=()):
        x = [features(item.file) for item in labelled]
        counts = [len(rows) for rows in x]
        return TerrainClassifier.train(
            np.concatenate(x), np.repeat([item.class_name for item in labelled], counts),
            np.repeat([item.group for item in labelled], counts), modality=self.name, feature_names=("a", "b"),
            settings={}, rng=rng, candidates=("logistic",), notes=notes,
        )

    def classify(self, files, model):
        rows = []
        for file in files:
            x = features(file)
            rows += model.evidence(x, np.ones(len(x)), [()] * len(x)).as_rows(file)
        return rows

    def absence(self, recording):
        return "" if recording.name == "warm" else "no thermometer in the recording"

    def observe(self, recording, track, model, cell_size_m):
        start = np.arange(0.0, 18.0, 0.5)
        x = np.where(start[:, None] < 10.0, [0.0, 0.0], [5.0, 5.0])
        evidence = model.evidence(x, np.full(len(x), 0.8), [()] * len(x))
        yield Observation.under_wheels(evidence, start, start + 0.5, recording, track, cell_size_m)
"""


@pytest.fixture
def thermometer_module(tmp_path, monkeypatch):
    """A module with a sense outside of the package, whose import is all that it takes."""
    senses.senses()
    before = dict(senses.SENSES)
    (tmp_path / "thermometer_sense.py").write_text(SENSE)
    monkeypatch.syspath_prepend(tmp_path)
    yield "thermometer_sense"
    senses.SENSES.clear()
    senses.SENSES.update(before)
    sys.modules.pop("thermometer_sense", None)


@pytest.fixture
def thermometer(thermometer_module):
    __import__(thermometer_module)


@pytest.fixture
def labelled(tmp_path, rng) -> Path:
    folder = tmp_path / "labelled"
    for name, middle in (("sand", 0.0), ("loam", 5.0)):
        (folder / name).mkdir(parents=True)
        for index in range(6):
            np.savetxt(folder / name / f"{index}.csv", middle + rng.normal(size=(10, 2)))
    return folder


def said(*arguments) -> str:
    result = CliRunner().invoke(app, [*map(str, arguments)])
    assert result.exit_code == 0, result.output
    return result.output


def recording(name="warm", **streams) -> Recording:
    t = np.arange(0.0, 20.0, 0.1)
    pose = Pose(t, t, np.full_like(t, 0.2), np.zeros_like(t))
    return Recording(name, Path(name), None, None, "field", "ab" * 32, pose=pose, **streams)


def test_a_sense_from_outside_the_package_is_trained_classifies_and_is_fused(thermometer, labelled, tmp_path):
    models = tmp_path / "models"
    models.mkdir()
    assert "warmth" in said("train", "warmth", labelled, "--out", models / "warmth.skops")
    out = tmp_path / "rows.json"
    said("classify", "warmth", labelled / "sand" / "0.csv", "--model", models / "warmth.skops", "--json", out)
    rows = json.loads(out.read_text())["rows"]
    assert {row["class"] for row in rows} == {"sand"}

    summary = run_traverse(recording(), tmp_path / "t.db", models=models)
    by_name = {one.sense: one for one in summary.senses}
    assert list(by_name) == ["camera", "microphone", "thermometer", "vibration sensor"]
    assert by_name["camera"].absent == "no camera in the recording"
    warm = by_name["thermometer"]
    assert (warm.absent, warm.items, warm.trusted_share) == ("", 36, 1.0)
    assert set(warm.said) == {"sand", "loam"}
    assert warm.model == str(models / "warmth.skops")
    with TerrainDatabase(tmp_path / "t.db") as database:
        (drive,) = database.drives()
        answer = database.snapshot().along(np.array([[3.0, 0.2], [15.0, 0.2]]))
    assert list(drive.models) == ["thermometer"]
    named = np.array(answer.class_names)[np.argmax(answer.class_probability, axis=1)]
    assert named.tolist() == ["sand", "loam"]


def test_a_sense_without_a_model_is_absent_and_reported(thermometer, tmp_path):
    summary = run_traverse(recording(), tmp_path / "t.db")
    (warm,) = (one for one in summary.senses if one.sense == "thermometer")
    assert warm.absent == "no model"


def test_vibration_is_observed_under_the_wheels(tmp_path, rng):
    """The class follows the vibration: weak for 10 s, then ten times as strong."""
    from bevameter.audio.vibration_train import train_vibration
    from bevameter.framework.core.classifier.labelled import LabelledFile

    def shaken(strength):
        t = np.arange(len(strength)) / 100.0
        return t, strength[:, None] * rng.normal(size=(len(strength), 3))

    runs = []
    for name, strength in (("clay", 0.1), ("gravel", 1.0)):
        for index in range(4):
            t, values = shaken(np.full(2000, strength))
            file = tmp_path / f"{name}{index}.csv"
            np.savetxt(file, np.column_stack([t, values]), delimiter=",", header="time_s,ax,ay,az", comments="")
            runs.append(LabelledFile(file, name, f"{name}{index}"))
    (tmp_path / "models").mkdir()
    train_vibration(runs, np.random.default_rng(1)).classifier.save(tmp_path / "models" / "vibration.skops")

    t, values = shaken(np.where(np.arange(2000) < 1000, 0.1, 1.0))
    run = VibrationRun(t, ("ax", "ay", "az"), values, (), np.empty((len(t), 0)), 100.0, Path("vibration.csv"))
    summary = run_traverse(recording(vibration=run), tmp_path / "t.db", models=tmp_path / "models")
    (sensor,) = (one for one in summary.senses if one.sense == "vibration sensor")
    assert sensor.items == 12
    assert summary.track_m["clay"] == pytest.approx(10.0, abs=2.5)  # a window is of 5 s
    assert summary.track_m["gravel"] == pytest.approx(10.0, abs=2.5)


def test_an_unknown_sense_is_an_error():
    with pytest.raises(InputError, match=r"no sense 'smell' .*vision"):
        senses.sense_named("smell")
    result = CliRunner().invoke(app, ["train", "smell", "x", "--out", "m.skops"])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert all(name in result.stderr for name in ("smell", "vision", "audio", "vibration"))


def test_a_sense_of_an_entry_point_is_loaded_and_a_broken_one_is_left_out(thermometer_module, monkeypatch):
    points = [EntryPoint(name, module, "bevameter.senses")
              for name, module in (("broken", "no_such_module"), ("warmth", thermometer_module))]  # fmt: skip
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: points)
    senses.load_senses.cache_clear()
    with pytest.warns(UserWarning, match=r"broken = no_such_module of .* \(bevameter\.senses\) is left out") as caught:
        assert senses.sense_named("warmth").instrument == "thermometer"
    assert len(caught) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # said once
        assert {sense.name for sense in senses.senses()} >= {"warmth", "vision", "audio", "vibration"}


def test_samples_are_shown_in_reports_as_pictures_and_sounds(tmp_path, rng):
    """What stands in the page is whole: a small JPEG, and the stretch of sound that was misheard."""
    image, sound = tmp_path / "a.png", tmp_path / "a.flac"
    cv2.imwrite(str(image), rng.integers(0, 256, (300, 600, 3)).astype(np.uint8))
    soundfile.write(sound, 0.01 * rng.normal(size=44100 * 3), 44100)

    def content(name, sample):
        shown = sense_named(name).excerpt(sample)
        return base64.b64decode(shown.split("base64,")[1].split('"')[0])

    shown = cv2.imdecode(np.frombuffer(content("vision", LabelledFile(image, "sand", "a")), np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape == (80, 160, 3)
    heard, rate = soundfile.read(io.BytesIO(content("audio", LabelledFile(sound, "sand", "a", 1.0, 1.5))))
    assert len(heard) == pytest.approx(0.5 * rate, abs=2)
    assert np.abs(heard).max() == pytest.approx(0.5, abs=0.01)
    assert sense_named("vibration").excerpt(LabelledFile(sound, "sand", "a")) == ""
