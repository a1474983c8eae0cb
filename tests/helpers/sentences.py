"""Sentences of pages and help texts, and the words in them."""

from __future__ import annotations

import re
from collections.abc import Iterator

_FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"^(?: {4,}|\t).*$", re.MULTILINE)
_MATH = re.compile(r"\$\$.*?\$\$", re.DOTALL)
_MARKUP = (
    (re.compile(r"!\[[^\]]*\]\([^)]*\)"), ""),
    (re.compile(r"\[([^\]]*)\]\([^)]*\)"), r"\1"),
    (re.compile(r"`+[^`]+`+"), "code"),
    (re.compile(r"\$[^$\n]+\$"), "symbol"),
    (re.compile(r"\([^()]*\)"), ""),
)
_ABBREVIATION = re.compile(
    r"\b(?:Eq|Fig|Sec|Ch|ed|al|vs|No|Phil|Proc|Soc|Stat|Am|Geotech|Bus|Econ|Camb)\.(?= )|\b[A-Z]\.(?= )"
)
_END = re.compile(r"(?<=[.!?])\**(?=\s)")
_ITEM = re.compile(r"^\s*(?:[-*]|\d+\.)\s+", re.MULTILINE)
_WORD = re.compile(r"[^\W\d_][\w'’-]*")


def sentences(text: str) -> Iterator[str]:
    """Give the sentences of a Markdown text, without code, equations and remarks in brackets; a cell is a paragraph."""
    text = _MATH.sub("", _INDENTED.sub("", _FENCED.sub("\n", text)))
    for block in _blocks(text):
        for pattern, put in _MARKUP:
            block = pattern.sub(put, block)
        block = _ABBREVIATION.sub(lambda found: found[0][:-1], " ".join(block.split()))
        yield from (sentence.strip() for sentence in _END.split(block) if words(sentence))


def _blocks(text: str) -> Iterator[str]:
    for paragraph in re.split(r"\n\s*\n", text):
        lines, rows = [], []
        for line in paragraph.splitlines():
            (rows if line.lstrip().startswith("|") else lines).append(line)
        for row in rows:
            yield from row.split("|")
        heading = re.sub(r"^#+ .*$", "\n", "\n".join(lines), flags=re.MULTILINE)
        yield from _ITEM.split(heading)


def words(sentence: str) -> list[str]:
    """Give the words of a sentence; numbers and signs are none."""
    return _WORD.findall(sentence)
