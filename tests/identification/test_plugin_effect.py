"""An effect in one file outside the package: simulated, named, reported and stored, and no other file edited."""

from __future__ import annotations

import importlib
import json
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import bevameter
import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase, Vehicle, Wheel, simulate
from bevameter.framework.cli.main import app
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.recording.wheel_file import read_wheel_file, write_wheel_file
from bevameter.identification.effects import Effect, Parameter, catalogue, register
from bevameter.identification.effects.catalogue import REGISTRY
from bevameter.identification.effects.parse import specimen
from bevameter.identification.effects.stored import AugmentedSimulator
from bevameter.identification.explain.report.page import report_html
from bevameter.identification.mechanics.soil import Soil
from typer.testing import CliRunner

SOIL = Soil(c_Pa=400.0, phi_rad=np.radians(31.0), k_m=0.012, stiffness_Pa=9e4, n=0.9)
NOISE = {"torque_Nm": 0.05, "sinkage_m": 2e-4, "drawbar_pull_N": 0.3, "load_N": 0.1, "slip": 1e-3}
VEHICLE = Vehicle(name="testbed", wheels=(Wheel(radius_m=0.15, width_m=0.12),), noise=NOISE)
W = 4.0


@pytest.fixture
def cable():
    """Register the effect for one test."""
    sys.modules.pop("cable_drag", None)
    importlib.import_module("cable_drag")
    yield "cable_drag"
    del REGISTRY["cable_drag"]


def drive(rows: int = 150) -> WheelTable:
    time_s = 0.1 * np.arange(rows)
    columns = {
        "time_s": time_s,
        "load_N": 100.0 + 20.0 * np.sin(1.1 * time_s),
        "slip": 0.25 + 0.2 * np.sin(0.7 * time_s),
        "x_m": 0.1 * time_s,
    }
    return WheelTable(columns, None, None, "drive")


def recorded(folder: Path) -> Path:
    """Write a drive on which the cable was dragged, with noise."""
    rng = np.random.default_rng(5)
    table = simulate(VEHICLE, SOIL, drive(), [f"cable_drag:w={W}"])
    noisy = {
        name: values + NOISE.get(name, 0.0) * rng.normal(size=len(table)) for name, values in table.columns.items()
    }
    write_wheel_file(WheelTable(noisy, None, None, "drive"), folder / "wheel.csv")
    return folder / "wheel.csv"


def test_it_is_simulated_by_its_name(cable, tmp_path):
    write_wheel_file(drive(), tmp_path / "drive.csv")
    (tmp_path / "vehicle.toml").write_text("[wheel]\nradius_m = 0.15\nwidth_m = 0.12\n")
    (tmp_path / "soil.toml").write_text("c_Pa = 400.0\nphi_deg = 31.0\nk_m = 0.012\nstiffness_Pa = 9e4\nn = 0.9\n")
    files = [str(tmp_path / name) for name in ("drive.csv", "vehicle.toml", "soil.toml")]
    for effect, out in ((["--effect", f"{cable}:w={W}"], "with.csv"), ([], "without.csv")):
        command = ["simulate", files[0], "--vehicle", files[1], "--soil", files[2], *effect, "--out"]
        done = CliRunner().invoke(app, [*command, str(tmp_path / out)])
        assert done.exit_code == 0, done.output
    pulls = [read_wheel_file(tmp_path / name)["drawbar_pull_N"] for name in ("with.csv", "without.csv")]
    np.testing.assert_allclose(pulls[1] - pulls[0], W * drive()["x_m"], rtol=1e-3, atol=1e-3)


@pytest.fixture
def answer(cable, tmp_path):
    """What is found on the drive with the cable."""
    return bevameter.explain(recorded(tmp_path), vehicle=VEHICLE, catalogue=[cable, "slip_sinkage"])


def test_it_is_named_reported_and_stored(cable, answer, tmp_path):
    (found,) = answer.missing
    assert (found.effect, found.kind) == (cable, "physics")
    assert found.probability > 0.8
    assert abs(found.parameters["w"].value - W) < 4.0 * found.parameters["w"].sd
    assert answer.summary.startswith("Missing: cable drag (")
    assert "the wheel drags a cable along" in answer.summary.lower()
    assert "pull the cable by hand" in answer.summary
    assert json.loads(json.dumps(answer.to_json()))["missing"][0]["effect"] == cable
    assert "Cable drag" in report_html(answer)
    again = AugmentedSimulator.from_json(json.loads(json.dumps(answer.physics.to_json())))
    assert again.effects[0].slug == cable
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.add_physics("sand", again, source="drive")
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        (stored,) = database.physics("sand")
    there = stored.physics.simulate(VEHICLE, drive())
    assert abs(float(np.polyfit(drive()["x_m"], simulate(VEHICLE, stored.physics.soil_values, drive())["drawbar_pull_N"]
                                - there["drawbar_pull_N"], 1)[0]) - W) < 0.3  # fmt: skip


def test_plug_ins_are_entry_points_and_one_that_does_not_load_is_left_out_with_a_warning(monkeypatch):
    monkeypatch.delitem(sys.modules, "cable_drag", raising=False)
    monkeypatch.delitem(REGISTRY, "cable_drag", raising=False)
    points = [EntryPoint(name, module, "bevameter.effects")
              for name, module in (("broken", "no_such_module"), ("cable_drag", "cable_drag"))]  # fmt: skip
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: points)
    with pytest.warns(UserWarning, match=r"broken = no_such_module of .* \(bevameter\.effects\) is left out") as caught:
        importlib.reload(catalogue)
    assert len(caught) == 1
    assert "cable_drag" in catalogue.SLUGS
    del REGISTRY["cable_drag"]


PARAMETER = Parameter("w", "N/m", 0.0, 20.0, 0.5, 2.0, "engineering judgement")
COMPLETE = {
    "slug": "new_effect", "title": "a title", "what_happens": "something", "check": "measure it",
    "equation": "DP -= w x", "source": "definition", "parameters": (PARAMETER,),
}  # fmt: skip


def made(*absent: str, **stated) -> type[Effect]:
    return type("New", (Effect,), {name: COMPLETE[name] for name in COMPLETE if name not in absent} | stated)


def test_a_complete_effect_is_registered():
    new = made()
    try:
        assert register(new) is new
        assert REGISTRY["new_effect"] is new
    finally:
        del REGISTRY["new_effect"]


@pytest.mark.parametrize(
    ("new", "said"),
    [
        (made(slug="slip_sinkage"), "another slug"),
        (made(slug="unknown"), "not unknown"),
        (made(slug="a b"), "letters"),
        (made("slug"), "slug ''"),
        (made(check=" "), "lacks a valid check "),
        (made("title", "what_happens", "equation", "source", "parameters"),
         "lacks a valid title, what_happens, equation, source, parameters "),
        (made(kind="sensor"), "lacks a valid kind .*physics or instrument"),
        (made(parameters=()), "lacks a valid parameters "),
        (made(parameters=PARAMETER), "lacks a valid parameters "),
        (made(needs=("place",)), "lacks a valid needs "),
        (made(changes=(5,)), "lacks a valid changes "),
        (made(__init__=lambda self, usual: None), "cannot be constructed: .*usual.*`forms` of its own"),
    ],
)  # fmt: skip
def test_an_incomplete_effect_is_refused_when_it_is_registered(new, said):
    with pytest.raises(InputError, match=rf"New: .*{said}"):
        register(new)
    assert "new_effect" not in REGISTRY


def test_an_incomplete_form_of_an_effect_is_refused_when_it_is_built():
    """A class with forms of its own may leave equation and parameters to them."""
    form = made("equation")
    register(made("equation", "parameters", forms=classmethod(lambda cls, situation: [form()])))
    try:
        with pytest.raises(InputError, match=r"New: lacks a valid equation "):
            catalogue.forms_by_name("new_effect", specimen())
        with pytest.raises(InputError, match=r"New: lacks a valid equation "):
            catalogue.effects_for(specimen(), ["new_effect"])
    finally:
        del REGISTRY["new_effect"]
