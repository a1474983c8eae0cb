"""Sentences that users meet in pages and help: not too long, and without private words."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from bevameter.framework.cli.main import app
from sentences import sentences, words

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs").glob("[!_]*/*.md"))]
MOST_WORDS = 30
MOST_WORDS_OF_HELP = 25
PRIVATE = {
    "asked", "beside", "felt", "heard", "lasting", "partners", "preferred", "promise", "promised", "promises",
    "restless", "room", "rooms", "standing", "tells", "told",
}  # fmt: skip
"""Words with a meaning of the project's own, where the field has another."""
STILL_LONG = {"live.md": 1}
"""Pages that are not mended yet, and how many of their sentences are too long."""


def helps(command, name="bevameter"):
    """Every help text of the command line: (what it is of, text)."""
    yield name, command.help or ""
    yield from ((f"{name} {each.name}", each.help) for each in command.params if getattr(each, "help", None))
    for each, inner in getattr(command, "commands", {}).items():
        yield from helps(inner, f"{name} {each}")


HELPS = list(helps(typer.main.get_command(app)))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_sentences_of_a_page_are_short(page):
    long = [each for each in sentences(page.read_text(encoding="utf-8")) if len(words(each)) > MOST_WORDS]
    assert len(long) <= STILL_LONG.get(page.name, 0), "\n".join(long)


def test_sentences_of_help_are_short():
    long = [(name, each) for name, text in HELPS for each in sentences(text) if len(words(each)) > MOST_WORDS_OF_HELP]
    assert len(HELPS) > 100
    assert long == []


def test_no_private_word_is_used():
    texts = [(page.name, page.read_text(encoding="utf-8")) for page in PAGES if page.name not in STILL_LONG]
    found = [
        (name, each)
        for name, text in (*texts, *HELPS)
        for each in sentences(text)
        if PRIVATE & {word.lower() for word in words(each)}
    ]
    assert found == []


def test_sentences_are_found_in_prose_tables_and_lists():
    text = "# Title\n\nOne `a b c` two (three). Four.\n\n- Five\n  six\n- seven\n\n| a b | c |\n|---|---|\n\n    code\n"
    assert [words(each) for each in sentences(text)] == [
        ["One", "code", "two"], ["Four"], ["Five", "six"], ["seven"], ["a", "b"], ["c"],
    ]  # fmt: skip
