"""Configuration of the documentation site: `make docs` builds it, and warnings are errors."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import bevameter
from sphinx_gallery.scrapers import figure_rst

project = "Bevameter"
author = "The Bevameter developers"
release = bevameter.__version__
language = "en"

sys.path.insert(0, str(Path(__file__).resolve().parent))
extensions = [
    "mathml",
    "measured_table",
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_gallery.gen_gallery",
    "numpydoc",
]
exclude_patterns = ["_build", "_templates", "gallery"]
html_theme = "pydata_sphinx_theme"
html_math_renderer = "mathml"
html_title = f"Bevameter {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_sidebars = {"tutorial": []}
html_show_sourcelink = False
html_theme_options = {"show_toc_level": 2}

myst_enable_extensions = ["dollarmath"]
templates_path = ["_templates"]
myst_heading_anchors = 4

suppress_warnings = ["config.cache"]  # the gallery's settings hold functions
autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False


HERE = Path(__file__).resolve().parent
SAND = HERE.parents[1] / "shared" / "data" / "single-wheel-sand" / "wheel.csv"


class Arguments:
    """What each script of the gallery is called with: files to read, and the picture to write."""

    def __repr__(self) -> str:
        return "Arguments()"

    def __call__(self, _: Any, script: dict[str, Any]) -> list[str]:
        name = Path(script["src_file"]).stem
        if name == "stress_linearisation":
            return []
        return [*([str(SAND)] if name.startswith("fig10") else []), str(picture_of(script))]


def picture_of(script: dict[str, Any]) -> Path:
    """Where a script of the gallery writes its picture."""
    folder = HERE / "_generated" / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder / (Path(script["src_file"]).stem + ".png")


def written_picture(_: Any, script: dict[str, Any], conf: dict[str, Any]) -> str:
    """Show the picture that a script wrote; sphinx-gallery calls it after each block."""
    made = picture_of(script)
    if not made.is_file():
        return ""
    shown = Path(next(script["image_path_iterator"]))
    made.replace(shown)
    return figure_rst([str(shown)], conf["src_dir"])


sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "_generated/gallery",
    "filename_pattern": "fig6|fig7|stress_linearisation" + ("|fig10" if SAND.is_file() else ""),
    "ignore_pattern": "proving_ground",
    "reset_argv": Arguments(),
    "image_scrapers": (written_picture,),
    "show_memory": False,
    "write_computation_times": False,
    "download_all_examples": False,
}
"""The closed loop takes minutes: its page shows the script, docs/planning.md what it gives."""


def write_commands(app: Any) -> None:
    """Write the reference of the command line from the command line itself."""
    program = [sys.executable, "-P", "-m", "typer", "bevameter.framework.cli.main", "utils", "docs"]
    done = subprocess.run([*program, "--name", "bevameter"], capture_output=True, text=True, check=True)
    generated = Path(app.srcdir) / "_generated"
    generated.mkdir(exist_ok=True)
    (generated / "commands.md").write_text(done.stdout, encoding="utf-8")


def setup(app: Any) -> None:
    """Register what is made before the pages are read."""
    app.connect("builder-inited", write_commands, priority=0)
