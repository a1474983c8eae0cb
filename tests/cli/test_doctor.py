"""`bevameter doctor`: the answer comes first, exit statuses, JSON, and that it works where packages are missing."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import bevameter
import pytest
from bevameter import TerrainDatabase
from bevameter.framework.cli.main import app
from typer.testing import CliRunner


@pytest.fixture
def needs(tmp_path, monkeypatch):
    """Have a Bevameter that needs these packages only."""

    def install(*requirements: str) -> None:
        info = tmp_path / "site" / f"bevameter-{bevameter.__version__}.dist-info"
        info.mkdir(parents=True)
        ours = ("Name: bevameter", f"Version: {bevameter.__version__}", "Provides-Extra: ice")
        needs = ('their-ice; extra == "ice"', *requirements)
        lines = ("Metadata-Version: 2.1", *ours, *(f"Requires-Dist: {each}" for each in needs))
        (info / "METADATA").write_text("\n".join(lines) + "\n")
        monkeypatch.syspath_prepend(tmp_path / "site")
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")]))

    monkeypatch.chdir(tmp_path)
    return install


@pytest.mark.end_to_end  # imports what models need
def test_well(needs, tmp_path):
    needs("numpy>=1")
    TerrainDatabase("t.db").make()
    result = CliRunner().invoke(app, ["doctor", "t.db", "--json", "found.json"])
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("everything that the base needs works; extras that are not installed: ice\n")
    page = json.loads((tmp_path / "found.json").read_text())
    assert (page["schema"], page["problems"]) == (1, 0)
    numpy, ice = (next(each for each in page["checks"] if each["name"] == name) for name in ("numpy", "ice"))
    assert (numpy["subject"], numpy["required"]) == ("dependency", ">=1")
    assert ice["remedy"] == 'python -m pip install "their-ice"'


def test_a_problem_is_exit_status_1(needs):
    needs("their-absent>=2")
    result = CliRunner().invoke(app, ["doctor"])
    assert result.exit_code == 1
    first, problem, remedy, *_ = result.stdout.splitlines()
    assert first == "1 thing needs attention"
    assert problem == "  dependency their-absent: is not installed"
    assert remedy == '    python -m pip install "their-absent>=2"'


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["absent.db"], "absent.db"),
        (["mysql://host/db"], "mysql"),
        (["--json", "nowhere/found.json"], "there is no folder nowhere"),
        (["t.db", "--json", "t.db"], "would be written over t.db"),
    ],
)
def test_bad_input_is_one_line(needs, arguments, said):
    needs()
    TerrainDatabase("t.db").make()
    result = CliRunner().invoke(app, ["doctor", *arguments])
    assert (result.exit_code, result.stdout) == (2, "")
    assert said in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("blocked", "said"),
    [
        ("numpy", "dependency numpy: cannot be imported"),
        ("rich", "dependency rich: cannot"),
        ("packaging", "dependency packaging: is"),
    ],
)
def test_it_says_so_where_a_package_is_lost(needs, blocked, said):
    """Also one that the other commands print with."""
    needs("numpy", "rich", "packaging")
    code = (
        f"import sys; sys.modules[{blocked!r}] = None; sys.argv = ['bevameter', 'doctor', '--json', 'found.json']\n"
        "from bevameter.framework.cli.main import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (1, "")
    assert said in done.stdout
    assert done.stdout.startswith("1 thing needs attention\n")


@pytest.mark.parametrize(("words", "offered"), [("bevameter do", "doctor"), ("bevameter db mi", "migrate")])
def test_the_shell_completes_commands(words, offered):
    shell = {"_BEVAMETER_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    code = "import sys; sys.argv = ['bevameter']; from bevameter.framework.cli.main import main; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ | shell)
    assert done.stdout.split() == [offered]
