"""`diagnose` on installations that are made up: packages that are missing, old, broken, or overwritten by another."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from importlib import metadata
from pathlib import Path

import bevameter
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.framework.core.classifier import shipped
from bevameter.framework.core.classifier.shipped import shipped_models
from bevameter.framework.doctor import Check, diagnose


def install(
    site: Path, name: str, version: str, *lines: str, module: str = "", code: str = "", points: str = ""
) -> None:
    """Write what pip leaves of a distribution."""
    info = site / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir()
    header = ("Metadata-Version: 2.1", f"Name: {name}", f"Version: {version}", *lines)
    (info / "METADATA").write_text("\n".join(header) + "\n")
    (info / "entry_points.txt").write_text(points)
    if module:
        (site / module).mkdir(exist_ok=True)
        (site / module / "__init__.py").write_text(code)
        (info / "RECORD").write_text(f"{module}/__init__.py,,\n{info.name}/METADATA,,\n")


@pytest.fixture
def site(tmp_path, monkeypatch) -> Path:
    """A folder of packages that comes first, without more."""
    (tmp_path / "site").mkdir()
    monkeypatch.syspath_prepend(tmp_path / "site")
    return tmp_path / "site"


def needing(site: Path, *lines: str, version: str = bevameter.__version__) -> None:
    """Install a Bevameter whose metadata say that it needs other things."""
    install(site, "bevameter", version, *lines)


def by_name(*arguments) -> dict[str, Check]:
    return {check.name: check for check in diagnose(*arguments).checks}


@pytest.mark.end_to_end  # imports all that there is
def test_this_installation_needs_no_attention_and_all_that_it_requires_is_listed(site):
    found = diagnose()
    assert found.problems == ()
    lines = metadata.requires("bevameter") or []
    needed = {line.partition(">")[0] for line in lines if "extra ==" not in line}
    assert {check.name for check in found.checks if check.subject == "dependency"} == needed
    extras = metadata.metadata("bevameter").get_all("Provides-Extra")
    assert [check.name for check in found.checks if check.subject == "extra"] == extras


def test_a_package_that_is_missing_old_or_broken_is_named_with_what_to_do(site):
    install(site, "their-old", "1.2", module="their_old")
    install(site, "their-broken", "1.0", module="their_broken", code="raise OSError('libtheirs.so.2: no such file')")
    install(site, "their-good", "2.0rc1", "Requires-Dist: their-old<1", module="their_good")
    lines = ["their-absent>=2", "their-old>=1.3", "their-broken", "their-good>=1", "their-else; sys_platform == 'none'"]
    needing(site, *(f"Requires-Dist: {line}" for line in lines))
    found = diagnose()
    assert [(each.name, each.found, each.problem) for each in found.problems] == [
        ("their-absent", "none", "is not installed"),
        ("their-old", "1.2", ">=1.3 is required"),
        ("their-broken", "1.0", "cannot be imported: OSError: libtheirs.so.2: no such file"),
        ("their-old", "1.2", "their-good requires their-old<1"),
    ]
    assert found.problems[0].remedy == 'python -m pip install "their-absent>=2"'
    assert found.problems[2].remedy.endswith('--force-reinstall --no-deps "their-broken"')
    assert found.checks[-1].found.startswith("not looked at")
    assert not [each for each in found.checks if each.subject in ("model", "plug-in")]


def test_two_packages_that_bring_the_same_module_are_named_and_a_shared_namespace_is_not(site):
    install(site, "seer-headless", "1.0", module="seer")
    install(site, "seer", "1.0", module="seer")
    for name in ("space-one", "space-two"):
        install(site, name, "1.0")
        part = Path("space") / f"{name[-3:]}.py"
        (site / "space").mkdir(exist_ok=True)
        (site / part).write_text("")
        (site / f"{name.replace('-', '_')}-1.0.dist-info" / "RECORD").write_text(f"{part.as_posix()},,\n")
    needing(site, "Requires-Dist: seer-headless", "Requires-Dist: space-one")
    (problem,) = diagnose().problems
    assert problem.name == "seer-headless"
    assert problem.problem.startswith("seer brings seer, too")
    assert problem.remedy.startswith("python -m pip uninstall seer, then python -m pip install")


def test_an_extra_may_be_absent_but_not_too_old(site):
    install(site, "their-old", "1.2", module="their_old")
    install(site, "their-set", "1.0", "Provides-Extra: all", "Requires-Dist: their-part>=5; extra == 'all'")
    extras = {"half": ("their-old", "their-absent>=2"), "nested": ("their-set[all]>=1",), "old": ("their-old>=3",)}
    lines = [f"Requires-Dist: {need}; extra == '{name}'" for name, needs in extras.items() for need in needs]
    needing(site, *(f"Provides-Extra: {name}" for name in extras), *lines)
    found = by_name()
    assert (found["half"].found, found["half"].problem) == ("not installed: their-absent", "")
    assert found["half"].remedy == 'python -m pip install "their-absent>=2"'
    assert (found["nested"].found, found["nested"].problem) == ("not installed: their-part", "")
    assert found["old"].problem == "their-old is 1.2, and bevameter requires >=3"


def test_another_python_or_code_of_another_version_is_a_problem(site):
    needing(site, "Requires-Python: >=9.1", version="0.0.1")
    python, code, *_ = diagnose().problems
    assert (python.name, python.problem) == ("python", ">=9.1 is required")
    assert (code.name, code.found) == ("bevameter", "0.0.1")


def test_plug_in_models_and_database_that_are_not_in_order_are_named(site, tmp_path, monkeypatch):
    needing(site)
    install(site, "their-plugin", "1.0", points="[bevameter.tests]\nlost = no_such_module_of_theirs\n")
    (tmp_path / "t.models").mkdir()
    for name in ("vision", "visoin"):
        (tmp_path / "t.models" / f"{name}.skops").write_text("no model")
    with TerrainDatabase(tmp_path / "t.db") as database:
        database.make()
    with closing(sqlite3.connect(tmp_path / "t.db")) as connection, connection:
        connection.execute("DROP TABLE class_physics")
    before = {path: path.read_bytes() for path in tmp_path.glob("t*/**/*") if path.is_file()}
    found = diagnose(tmp_path / "t.db")
    problems = {check.subject + " " + Path(check.name).name: check.problem for check in found.problems}
    assert "no_such_module_of_theirs cannot be imported" in problems["plug-in bevameter.tests lost"]
    assert "vision.skops" in problems["model vision"]
    assert "no sense of this name" in problems["model visoin.skops"]
    assert "class_physics: the table is not there" in problems["database t.db"]
    assert len(problems) == len(found.problems) == 4
    assert before == {path: path.read_bytes() for path in before}
    assert not (tmp_path / "t.db-wal").exists()


def test_a_database_that_is_well_and_the_models_of_the_package_need_no_attention(site, tmp_path):
    needing(site)
    with TerrainDatabase(tmp_path / "t.db") as database:
        database.make()
    found = by_name(tmp_path / "t.db")
    assert not any(check.problem for check in found.values())
    assert found[str(tmp_path / "t.db")].found.startswith("sound; schema")
    for name, model in shipped_models().items():
        assert model.version[:12] in found[name].found


def test_a_model_of_the_package_that_is_damaged_is_named_with_what_to_do(site, tmp_path, monkeypatch):
    needing(site)
    shutil.copytree(shipped.FOLDER, tmp_path / "trained")
    (tmp_path / "trained" / "audio-synthetic.skops").write_bytes(b"no model")
    monkeypatch.setattr(shipped, "FOLDER", tmp_path / "trained")
    (problem,) = diagnose().problems
    assert (problem.subject, problem.name) == ("model", "audio-synthetic")
    assert "SHA-256" in problem.problem
    assert problem.remedy == "python -m pip install --force-reinstall --no-deps bevameter"


def test_no_database_is_bad_input(site, tmp_path):
    needing(site)
    with pytest.raises(InputError, match="absent"):
        diagnose(tmp_path / "absent.db")
