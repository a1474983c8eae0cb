"""The package as pip installs it: what the wheel holds, that an editable install works, and that imports stay light."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import bevameter
import pytest
from bevameter.framework.core.classifier.shipped import shipped_models

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE_THE_PACKAGE = {"tests", "docs", "build", "dist", "demo"}
TRAINED = "bevameter/framework/core/trained/"
HEAVY = (
    "numpy", "scipy", "pandas", "pyarrow", "cv2", "librosa", "soundfile", "sklearn", "skops", "numba", "matplotlib",
    "sqlalchemy", "alembic", "pydantic", "pint", "rosbags", "mcap", "rich",
)  # fmt: skip


def code_folders(root: Path) -> set[Path]:
    """Folders with Python files that belong to the package, relative to the root; the root itself is `Path()`."""
    files = (file.relative_to(root) for file in root.rglob("*.py"))
    return {
        file.parent
        for file in files
        if not any(part.startswith(".") for part in file.parts) and file.parts[0] not in OUTSIDE_THE_PACKAGE
    }


def pip(*arguments: str) -> None:
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    """A copy of the tree in a folder of another name, with what a checkout may have lying about."""
    pytest.importorskip("setuptools", minversion="77")
    folder = tmp_path_factory.mktemp("elsewhere") / "a checkout of any name"
    folder.mkdir()
    for name in (*{part.parts[0] for part in code_folders(ROOT) if part.parts}, "tests"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("__init__.py", "py.typed", "pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, folder / name)
    return folder


@pytest.fixture(scope="module")
def wheel_names(checkout) -> list[str]:
    out = checkout.parent / "wheels"
    pip("wheel", "--no-deps", "--no-build-isolation", "-w", str(out), str(checkout))
    (wheel,) = out.glob("bevameter-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        return archive.namelist()


def test_every_folder_with_code_is_listed():
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"]
    assert len(set(listed)) == len(listed)
    assert {".".join(("bevameter", *folder.parts)) for folder in code_folders(ROOT)} == set(listed)


def test_the_wheel_holds_the_code_and_nothing_else(wheel_names):
    code = {Path("bevameter", *folder.parts, file.name).as_posix() for folder in code_folders(ROOT)
            for file in (ROOT / folder).glob("*.py")}  # fmt: skip
    packed = {name for name in wheel_names if ".dist-info/" not in name and not name.startswith(TRAINED)}
    templates = {f"bevameter/framework/core/vehicles/{file.name}"
                 for file in (ROOT / "framework" / "core" / "vehicles").glob("*.toml")}  # fmt: skip
    assert len(templates) > 4
    assert packed == code | templates | {"bevameter/py.typed"}
    assert "bevameter/database/migrations/versions/r0001_observations.py" in packed
    assert not [name for name in wheel_names if "test" in name.lower()]


def test_the_wheel_brings_the_models_with_their_cards_and_examples(wheel_names):
    brought = {name.removeprefix(TRAINED) for name in wheel_names if name.startswith(TRAINED)}
    models = shipped_models().values()
    files = {file for one in models for file in (one.file.name, f"{one.name}.md", one.example)}
    assert brought == files | {"index.json"}


def test_the_wheel_brings_the_command(wheel_names, checkout):
    (wheel,) = (checkout.parent / "wheels").glob("bevameter-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        (points,) = (name for name in wheel_names if name.endswith("entry_points.txt"))
        assert "bevameter = bevameter.framework.cli.main:main" in archive.read(points).decode()


def test_an_editable_install_runs_the_checkout(checkout):
    where = checkout.parent / "editable"
    pip("install", "--no-deps", "--no-build-isolation", "--target", str(where), "-e", str(checkout))
    code = (
        f"import site; site.addsitedir({str(where)!r})\n"
        "import bevameter, bevameter.database.migrations.versions as deep\n"
        "print(bevameter.__file__); print(deep.__file__)"
    )
    # -S: without the site-packages of this environment, in which bevameter is installed already
    done = subprocess.run([sys.executable, "-S", "-P", "-c", code], capture_output=True, text=True, cwd=where)
    assert done.returncode == 0, done.stderr
    front, deep = map(Path, done.stdout.splitlines())
    assert os.path.samefile(front, checkout / "__init__.py")
    assert os.path.samefile(deep, checkout / "database" / "migrations" / "versions" / "__init__.py")


def test_the_lock_holds_names_and_versions_only_and_all_that_is_needed():
    lines = (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!-]+", pin) for pin in pins)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [need for needs in project["optional-dependencies"].values() for need in needs]
    needed = {re.split(r"[\[<>=~!; ]", need)[0] for need in (*project["dependencies"], *extras)}
    assert {normal(name) for name in needed} <= {normal(pin.split("==")[0]) for pin in pins}


def test_every_library_imported_is_a_dependency():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed, of_view = (
        {normal(re.split(r"[\[<>=~!; ]", need)[0]) for need in needs}
        for needs in (project["dependencies"], project["optional-dependencies"]["view"])
    )
    called = {"cv2": "opencv-python-headless", "PIL": "pillow", "sklearn": "scikit-learn"}
    imported: dict[bool, set[str]] = {False: set(), True: set()}
    for folder in code_folders(ROOT):
        for file in (ROOT / folder).glob("*.py"):
            found = re.findall(r"^\s*(?:from|import) ([A-Za-z_]\w*)", _code(file), re.MULTILINE)
            others = set(found) - set(sys.stdlib_module_names)
            imported[folder == Path("framework/view")] |= {normal(called.get(name, name)) for name in others}
    assert imported[False] == needed
    assert of_view <= imported[True] <= of_view | needed


def _code(file: Path) -> str:
    """The file without its docstrings, whose prose may begin lines with `from`, and what is for types only."""
    code = re.sub(r'"""(?:.|\n)*?"""', "", file.read_text(encoding="utf-8"))
    return re.sub(r"^if TYPE_CHECKING:\n(?:    .*\n|\n)+", "", code, flags=re.MULTILINE)


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.mark.parametrize("code", ["import bevameter", "from bevameter.framework.cli import main"])
def test_importing_the_package_imports_nothing_heavy(code):
    program = f"import sys; {code}; print(sorted(set({HEAVY!r}) & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_load():
    for name in bevameter.__all__:
        assert getattr(bevameter, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        bevameter.nonsense  # noqa: B018
