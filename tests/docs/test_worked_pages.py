"""Pages that a reader works through say what the commands print."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from bevameter import simulate
from bevameter.framework.scenario.ground import paint_tile
from bevameter.framework.scenario.write import write_scenario
from robot_bag import VEHICLE_TOML, RobotBag, drive
from terrain_folder import write_terrain
from worked_page import compare, work_through

DOCS = Path(__file__).resolve().parents[2] / "docs"
LOADS_N, SLIPS = (60.0, 100.0, 150.0, 200.0), (0.05, 0.1, 0.2, 0.3, 0.4, 0.6)


@pytest.fixture(scope="module")
def sand_images(tmp_path_factory):
    """What the camera of a synthetic drive over sand saw: files."""
    written = write_scenario("sandpit", tmp_path_factory.mktemp("sand") / "sandpit", seed=4, duration_s=15.0)
    return [path.read_bytes() for path in sorted((written / "camera").glob("*.jpg"))]


@pytest.fixture(scope="module")
def short():
    return drive(15.0)


@pytest.fixture(scope="module")
def two_bags(short, sand_images, tmp_path_factory):
    """A folder with the bags of two vehicles with cameras and no wheel channels."""
    folder = tmp_path_factory.mktemp("bags")
    for seed, name in enumerate(("monday", "tuesday"), 1):
        RobotBag(short, images=sand_images, wheels=False, gps=False, seed=seed).write(folder / name)
    return folder


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """A folder with simulated tables of wheel tests in which slip-sinkage is concealed."""
    folder = tmp_path_factory.mktemp("laboratory")
    (folder / "vehicle.toml").write_text("[wheel]\nradius_m = 0.15\nwidth_m = 0.1\n")
    (folder / "soil.toml").write_text("c_Pa = 800.0\nphi_deg = 30.0\nk_m = 0.012\nstiffness_Pa = 120e3\nn = 1.0\n")
    load, slip = (each.ravel() for each in np.meshgrid(LOADS_N, SLIPS, indexing="ij"))
    plan = pd.DataFrame({"run": [f"t{row}" for row in range(len(load))], "load_N": load, "slip": slip})
    plan.to_csv(folder / "plan.csv", index=False)
    files = folder / "vehicle.toml", folder / "soil.toml", folder / "plan.csv"
    true, textbook = simulate(*files, ["slip_sinkage:n1=0.25"]), simulate(*files)
    rng = np.random.default_rng(0)

    def read(values, size=0.0):
        return values + 0.015 * (np.abs(values) + size) * rng.standard_normal(len(values))

    table = pd.DataFrame({
        "Fz [N]": read(true["load_N"]), "DP [N]": read(true["drawbar_pull_N"], 20.0), "T [Nm]": read(true["torque_Nm"]),
        "Slip [%]": read(100 * true["slip"]), "Sinkage [mm]": read(1e3 * true["sinkage_m"]),
    }).round(3)  # fmt: skip
    table.to_csv(folder / "wheel.csv", index=False)
    table.rename(columns={"T [Nm]": "Kraftmoment"}).to_csv(folder / "raw.csv", index=False)
    text = table.astype(object)
    text.loc[1, "T [Nm]"] = "abc"
    text.to_csv(folder / "typo.csv", index=False)
    table.assign(Test=plan["run"]).to_csv(folder / "tests.csv", index=False)
    answers = {name: textbook[name] for name in ("torque_Nm", "sinkage_m", "drawbar_pull_N")}
    plan.assign(**answers).to_csv(folder / "simulated.csv", index=False)
    plan.assign(**answers, run=[f"u{row}" for row in range(len(plan))]).to_csv(folder / "other.csv", index=False)
    return folder


def copied(source: Path, target: Path) -> Path:
    shutil.copytree(source, target, dirs_exist_ok=True)
    return target


@pytest.mark.end_to_end
def test_tutorial(sand_images, tmp_path):
    RobotBag(drive(40.0), images=sand_images).write(tmp_path / "lap")
    work_through(DOCS / "tutorial.md", tmp_path)


@pytest.mark.end_to_end
def test_my_bag(short, sand_images, two_bags, tmp_path):
    copied(two_bags, tmp_path)
    robots = RobotBag(short, images=sand_images, effort=False, odometry="wheels", robots=("/r1", "/r2"))
    robots.write(tmp_path / "rover")
    (tmp_path / "vehicle.toml").write_text(VEHICLE_TOML)
    work_through(DOCS / "howto" / "bag.md", tmp_path)


@pytest.mark.end_to_end
def test_my_table(laboratory, tmp_path):
    work_through(DOCS / "howto" / "testbed.md", copied(laboratory, tmp_path))
    page = (tmp_path / "soil.html").read_text(encoding="utf-8")
    assert page.index("form does not hold: it misses") < page.index("<figure>")


@pytest.mark.end_to_end
def test_my_classes(two_bags, tmp_path):
    copied(two_bags, tmp_path)
    rng = np.random.default_rng(3)
    for name in ("sand", "grass", "gravel"):
        (tmp_path / "photos" / name).mkdir(parents=True)
        for number in range(8):
            picture = paint_tile(name, rng, size=512)[128:384, 128:384]
            cv2.imwrite(str(tmp_path / "photos" / name / f"{number}.jpg"), picture)
    (tmp_path / "new").mkdir()
    for name in ("sand", "clay"):
        picture = paint_tile(name, np.random.default_rng(9), size=512)[:256, :256]
        cv2.imwrite(str(tmp_path / "new" / f"{name}.jpg"), picture)
    for number, name in enumerate(("a", "b")):
        (tmp_path / "mixed" / name).mkdir(parents=True)
        shutil.copy(tmp_path / "photos" / "sand" / "0.jpg", tmp_path / "mixed" / name / f"{number}.jpg")
    work_through(DOCS / "howto" / "classes.md", tmp_path)


@pytest.mark.end_to_end
def test_my_simulator(laboratory, tmp_path):
    write_terrain(tmp_path / "terrain.db")
    work_through(DOCS / "howto" / "simulator.md", copied(laboratory, tmp_path))


@pytest.mark.end_to_end
def test_a_fleet(two_bags, tmp_path):
    work_through(DOCS / "howto" / "fleet.md", copied(two_bags, tmp_path))


def test_a_planner(tmp_path):
    write_terrain(tmp_path / "terrain.db")
    (tmp_path / "vehicle.toml").write_text(VEHICLE_TOML)
    work_through(DOCS / "howto" / "planner.md", tmp_path)


@pytest.mark.parametrize("printed", ["sand 41, 3.5 kPa\n", "sand 40, 3.5 kPa, and more\n", "rock 40, 3.5 kPa\n"])
def test_another_answer_than_the_one_shown_fails(printed):
    compare("sand 40, ... kPa\n", "sand   40, 3.5 kPa\n", "the command")
    if "41" in printed:
        compare("sand 40, ... kPa\n", printed, "the command")  # within 5 %
        printed = printed.replace("41", "48")
    with pytest.raises(AssertionError, match="the command"):
        compare("sand 40, ... kPa\n", printed, "the command")
