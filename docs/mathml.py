"""Equations as MathML, which browsers draw by themselves: pages need no script and nothing from elsewhere."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util.math import get_node_equation_number

_TAG = re.compile(r"\\tag\{([^}]*)\}")


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.math_block) -> None:
    text = node.astext()
    number = _TAG.search(text)
    label = number[1] if number else get_node_equation_number(writer, node) if node.get("number") else ""
    shown = f'<span class="eqno">({label})</span>' if label else ""
    writer.body.append(f'<div class="equation">{shown}{tex2mathml(_TAG.sub("", text), as_block=True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Register the renderer under the name `mathml`."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
