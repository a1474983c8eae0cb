"""The directive `measured`: a table of measurements, with date, commit and machine, from docs/measured."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "studies"))
from measured import FOLDER, read


class MeasuredTable(SphinxDirective):
    """``measured`` with the name of a file."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        (name,) = self.arguments
        self.env.note_dependency(str(FOLDER / f"{name}.json"))
        return self.parse_text_to_nodes(read(name).markdown())


def setup(app: Any) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("measured", MeasuredTable)
    return {"parallel_read_safe": True}
