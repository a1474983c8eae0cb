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
