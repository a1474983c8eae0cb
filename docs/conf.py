"""Configuration of the documentation site: `make docs` builds it, and warnings are errors."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import bevameter

project = "Bevameter"
author = "The Bevameter developers"
release = bevameter.__version__
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc"]
exclude_patterns = ["_build", "_templates", "gallery"]
html_theme = "pydata_sphinx_theme"
html_title = f"Bevameter {release}"
html_show_sourcelink = False
html_theme_options = {"show_toc_level": 2}

myst_enable_extensions = ["dollarmath"]
templates_path = ["_templates"]
myst_heading_anchors = 4

autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False


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
