"""What the README and the pages under docs/ say: that examples run, commands parse, names and links are right."""

from __future__ import annotations

import contextlib
import re
import runpy
import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest
import typer
from bevameter.database.grid import LAYERS
from bevameter.framework.cli.main import app
from bevameter.framework.core.recording.formats.folder import About
from bevameter.framework.core.recording.topic_map import load_topic_map
from bevameter.framework.core.recording.types import TEXT_COLUMNS, WHEEL_COLUMNS
from bevameter.framework.core.vehicle import load_vehicle
from bevameter.framework.scenario.plan import make_plan
from bevameter.framework.scenario.presets import PRESETS
from bevameter.framework.scenario.write import truth
from ruamel.yaml import YAML
from terrain_folder import write_terrain

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("framework", "database", "identification", "vision", "audio")
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("[!_]*/*.md")])


def text(page: str = "README.md") -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text(page), re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    """Every command line of every page, in fenced and indented blocks and between single backquotes."""
    found = []
    for page in PAGES:
        lines = re.findall(r"^(?: {4}|\$ )?(bevameter .*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
        spans = re.findall(r"`(bevameter [^`\n]* [^`\n]*)`", page.read_text(encoding="utf-8"))
        found += [line.split(" #")[0].strip() for line in (*lines, *spans)]
    return sorted(set(found))


def parsed(line: str) -> str:
    """Parse a command line without running it; give the full name of the command that would run."""
    _, *arguments = shlex.split(line)
    command, name = typer.main.get_command(app), "bevameter"
    while hasattr(command, "commands"):
        assert arguments, f"{name} needs a command"
        assert arguments[0] in command.commands, f"{line}: no command {arguments[0]}"
        command, name = command.commands[arguments[0]], f"{name} {arguments.pop(0)}"
    with contextlib.suppress(typer.Exit):  # of --help
        command.make_context(name, arguments)
    return name


def test_every_command_line_on_a_page_parses():
    # Text names a command by its first words, too: no line to parse
    lines = [line for line in commands() if not re.fullmatch(r"bevameter (train|query|db)( [\w|]+)?", line)]
    ran = {parsed(line) for line in lines}
    queries = {f"bevameter query {name}" for name in ("classes", "class", "at", "along", "near")}
    others = {
        f"bevameter {name}"
        for name in (
            "scenario",
            "inspect",
            "vehicle",
            "run",
            "map",
            "identify",
            "explain",
            "simulate",
            "train",
            "classify",
            "doctor",
        )
    }
    care = {f"bevameter db {name}" for name in ("info", "check", "merge", "export", "prune", "rebuild", "migrate")}
    assert queries | others | care <= ran, "every command has an example"


@pytest.mark.parametrize(
    "line", ["bevameter query at 1", "bevameter run drive", "bevameter map --nonsense 1 --out a.png"]
)
def test_a_wrong_command_line_does_not_parse(line):
    with pytest.raises(Exception, match=r"Missing|No such option"):
        parsed(line)


@pytest.fixture
def terrain(tmp_path) -> Path:
    """A folder as `make demo` leaves it: ten metres of sand with soil, five of grass without, and the vehicle."""
    (tmp_path / "demo" / "recording").mkdir(parents=True)
    write_terrain(tmp_path / "demo" / "terrain.db")
    vehicle = blocks("docs/recording.md", "toml")[1]
    (tmp_path / "demo" / "recording" / "vehicle.toml").write_text(vehicle, encoding="utf-8")
    return tmp_path


def test_the_planners_example_runs(terrain, monkeypatch, capsys):
    (example,) = blocks("README.md", "python")
    (terrain / "example.py").write_text(example, encoding="utf-8")
    monkeypatch.chdir(terrain)
    runpy.run_path("example.py")
    printed = capsys.readouterr().out
    assert "sand" in printed
    assert "grass" in printed


def test_the_examples_of_the_exports_page_run(terrain, monkeypatch):
    """One after the other, as one script."""
    (terrain / "exports.py").write_text("\n".join(blocks("docs/exports.md", "python")), encoding="utf-8")
    monkeypatch.chdir(terrain)
    strength = runpy.run_path("exports.py")["strength"]
    assert strength.shape == (60, 40)
    assert np.isfinite(strength).sum() == 40
    assert {"costs.yaml", "costs.pgm", "speed.yaml", "classes.yaml"} <= {path.name for path in terrain.iterdir()}


def test_the_exports_page_names_every_layer():
    rows = [line.split("|")[1] for line in text("docs/exports.md").splitlines() if line.startswith("| `")]
    assert set(LAYERS) <= {name for row in rows for name in re.findall(r"`(\w+)`", row)}


def test_the_example_of_the_planning_page_runs(terrain, monkeypatch, capsys):
    (terrain / "example.py").write_text("\n".join(blocks("docs/planning.md", "python")), encoding="utf-8")
    monkeypatch.chdir(terrain)
    runpy.run_path("example.py")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 29
    assert "m/s by " in lines[0]
    assert "0.3 m/s by no soil data for class grass" in lines[-1]


def test_the_examples_of_the_recording_page_are_read(tmp_path):
    about, vehicle, motor, topics = blocks("docs/recording.md", "toml")
    About.model_validate(tomllib.loads(about))
    (tmp_path / "vehicle.toml").write_text(vehicle, encoding="utf-8")
    assert [wheel.name for wheel in load_vehicle(tmp_path / "vehicle.toml").wheels] == ["front_left", "front_right"]
    (tmp_path / "topics.toml").write_text(topics, encoding="utf-8")
    assert len(load_topic_map(tmp_path / "topics.toml").wheel) == 2
    (robot,) = blocks("docs/tutorial.md", "toml")
    (tmp_path / "robot.toml").write_text(robot + motor, encoding="utf-8")
    assert len(load_vehicle(tmp_path / "robot.toml").wheels) == 4


def test_the_recording_page_names_every_wheel_column():
    section = text("docs/recording.md").split("## Wheel columns")[1].split("## ")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert named == {*WHEEL_COLUMNS, *TEXT_COLUMNS}


def test_the_page_of_synthetic_drives_names_every_one_and_every_key_of_the_truth():
    drives, _, keys = text("docs/scenarios.md").partition("## The wheels")
    assert re.findall(r"^\| `([\w-]+)` \|", drives, re.MULTILINE) == list(PRESETS)
    first_cells = [line.split("|")[1] for line in keys.splitlines() if line.startswith("| `")]
    named = {name for cell in first_cells for name in re.findall(r"`(\w+)`", cell)}
    assert named == set(truth(make_plan(PRESETS["rover4"], 0, 5.0), "rover4")) - {"schema"}


def test_the_code_has_what_the_nomenclature_says_of_it():
    code = "\n".join(file.read_text(encoding="utf-8") for part in PARTS for file in (ROOT / part).rglob("*.py"))
    rows = [line.split("|")[4] for line in text("docs/glossary.md").splitlines() if line.count("|") == 5]
    names = {name for row in rows for name in re.findall(r"`(?:\w+\.)?(\w+)(?:\(\))?`", row)}
    assert {"load_N", "c_Pa", "entry_angle"} <= names
    assert not {name for name in names if not re.search(rf"\b{name}\b", code)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        assert "://" in target or (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_pictures_are_small():
    pictures = list((ROOT / "docs" / "images").glob("*"))
    assert pictures
    assert all(picture.stat().st_size < 200_000 for picture in pictures)


def test_the_make_targets_named_are_there():
    made = set(re.findall(r"^(\w+):", text("Makefile"), re.MULTILINE))
    assert {"demo", "test"} <= set(re.findall(r"make (\w+)", text())) <= made


def test_the_readme_names_every_extra():
    project = tomllib.loads(text("pyproject.toml"))["project"]
    named = set(re.findall(r"^\| `(\w+)` \|", text(), re.MULTILINE))
    assert set(project["optional-dependencies"]) - {"dev"} <= named


def test_the_citation_is_of_this_version_and_of_the_form_that_its_schema_asks_for():
    """Of schema 1.2.0: the keys that must be there, and those of persons and entities."""
    cited = YAML(typ="safe").load(text("CITATION.cff"))
    project = tomllib.loads(text("pyproject.toml"))["project"]
    assert cited["cff-version"] == "1.2.0"
    assert (cited["title"].lower(), cited["version"]) == (project["name"], project["version"])
    assert cited["authors"] == project["authors"]
    assert cited["abstract"].strip() == project["description"]
    assert cited["keywords"] == project["keywords"]
    assert cited["message"]
    assert ("license" in cited) == ("license" in project)
    (paper,) = cited["references"]
    assert {"type", "title", "authors"} <= set(paper)
    assert all(set(author) == {"family-names", "given-names"} for author in paper["authors"])
    written = " and ".join(f"{author['given-names']} {author['family-names']}" for author in paper["authors"])
    assert f"{written}, *{paper['title']}* ({paper['year']})" in " ".join(text().split())
