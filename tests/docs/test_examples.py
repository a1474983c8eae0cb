"""What the pages import is there."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs").glob("[!_]*/*.md"))]
IMPORT = re.compile(r"^ *((?:from bevameter[\w.]* import|import bevameter)\b.*)$", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_a_page_imports_is_there(page):
    for line in IMPORT.findall(page.read_text(encoding="utf-8")):
        (statement,) = ast.parse(line).body
        if isinstance(statement, ast.ImportFrom):
            module = importlib.import_module(statement.module)
            assert all(hasattr(module, alias.name) for alias in statement.names), line
        else:
            assert all(importlib.import_module(alias.name) for alias in statement.names)


def test_the_pages_for_programmers_import_something():
    for page in (ROOT / "README.md", ROOT / "docs" / "explain.md"):
        assert IMPORT.search(page.read_text(encoding="utf-8"))
