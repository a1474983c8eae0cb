"""Drive the closed loop of docs/gallery, and write its tables and its picture for docs/planning.md (four minutes).

python tests/studies/closed_loop_tables.py
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs" / "gallery"))
from closed_loop import main  # noqa: E402
from measured import write  # noqa: E402

NAMES = ("closed-loop-routes", "closed-loop-bounds", "closed-loop-confidence")
ROUTES, SITES = 200, 8


def tables(markdown: str) -> list[list[list[str]]]:
    """Give the cells of each table of a Markdown text, headers first."""
    return [
        [[cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines() if "---" not in line]
        for part in markdown.split("\n\n")
    ]


if __name__ == "__main__":
    _, text = main(ROOT / "docs" / "images" / "closed-loop.png", routes=ROUTES, sites=SITES)
    for name, (columns, *rows) in zip(NAMES, tables(text), strict=True):
        data = f"Simulated; {ROUTES} routes on {SITES} sites"
        print(write(name, columns, rows, data=data, command="python tests/studies/closed_loop_tables.py"))
