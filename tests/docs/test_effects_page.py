"""The page of effects says what the catalogue holds."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from bevameter.identification.effects.catalogue import SLUGS

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_of_effects_is_that_of_the_catalogue():
    spec = importlib.util.spec_from_file_location("effects_page", DOCS / "effects_page.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    written = (DOCS / "effects.md").read_text(encoding="utf-8")
    assert written == module.page(), "run python docs/effects_page.py"
    assert all(f"### `{slug}`" in written for slug in SLUGS)


def test_the_effect_that_contributing_shows_is_the_one_that_is_tested():
    file = DOCS.parent / "tests" / "helpers" / "cable_drag.py"
    code = file.read_text(encoding="utf-8").split('"""', 2)[2].strip()
    shown = "\n".join(f"    {line}".rstrip() for line in code.splitlines())
    assert shown in (DOCS / "contributing.md").read_text(encoding="utf-8")
