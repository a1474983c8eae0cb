"""The frame of every HTML report: one page that needs nothing from elsewhere, readable on a screen and in print."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape

STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}
h2{margin-top:2.2rem;border-bottom:1px solid #ccc}h3{margin-bottom:.3rem}
table{border-collapse:collapse;margin:1rem 0}td,th{padding:.3rem .6rem;border:1px solid #ccc;text-align:right}
th{background:#f4f4f4}th:first-child{text-align:left}.note{color:#555}.warn{color:#a33}
td.text,th.text{text-align:left}.wide{overflow-x:auto}
.verdict{font-size:1.3rem;font-weight:600;border-left:.4rem solid #0072b2;padding:.5rem 1rem;background:#f2f7fb}
code{font:.95em ui-monospace,monospace;background:#f4f4f4;padding:0 .25em}
figure{margin:1rem 0}.row{display:flex;flex-wrap:wrap;gap:1.2rem}.row figure{margin:.3rem 0;max-width:17rem}
figure img{max-width:100%;height:auto}figcaption{color:#555;font-size:.93em}
@media print{body{max-width:none;margin:0;font-size:11pt}.wide{overflow:visible}figure,tr,h2,h3{break-inside:avoid}
h2,h3{break-after:avoid}.wide table{font-size:8.5pt}.wide td,.wide th{padding:.1rem .3rem}}"""


_SYMBOLS = {"c", "i", "k", "n", "phi", "z"}
"""Symbols at the beginning of a sentence keep their letter, and so do names of files, channels and models."""


def page(title: str, body: str) -> str:
    """Give the whole page; `body` is HTML, `title` text."""
    return (
        "<!doctype html><html lang=en><head><meta charset=utf-8>"
        f"<meta name=viewport content='width=device-width'><title>{escape(title)}</title>"
        f"<style>{STYLE}</style></head><body>{body}</body></html>\n"
    )


def table(headers: Sequence[str], rows: Iterable[Sequence[str]], text_columns: Sequence[int] = (0,)) -> str:
    """Give a table that scrolls where it is wider than the page.

    Parameters
    ----------
    headers, rows
        Text; it is escaped here.
    text_columns
        Columns set to the left; numbers are set to the right.
    """

    def line(cells: Sequence[str], tag: str) -> str:
        marked = (
            f"<{tag}{' class=text' if index in text_columns else ''}>{unbroken(cell)}</{tag}>"
            for index, cell in enumerate(cells)
        )
        return f"<tr>{''.join(marked)}</tr>"

    return f"<div class=wide><table>{line(headers, 'th')}{''.join(line(row, 'td') for row in rows)}</table></div>"


def unbroken(text: str) -> str:
    """Escape text; a number stays on one line with its unit, its bound and its standard deviation."""
    return escape(text).replace(" %", "&nbsp;%").replace("&lt; ", "&lt;&nbsp;").replace(" ± ", "&nbsp;±&nbsp;")


def marked(text: str) -> str:
    """Escape a sentence and begin it with a capital; what stands between backticks is a command."""
    first = re.split(r"[\s:,;]", text, maxsplit=1)[0]
    begun = text[:1].upper() + text[1:] if first.isalpha() and first not in _SYMBOLS else text
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", unbroken(begun))


def picture(data: bytes, kind: str, description: str) -> str:
    """Give an image that is in the page itself; `kind` is ``"png"`` or ``"jpeg"``."""
    return f'<img alt="{escape(description)}" src="data:image/{kind};base64,{b64encode(data).decode()}">'


def figure(png: bytes, caption: str) -> str:
    """Give a picture with its caption, which describes it, too."""
    return f"<figure>{picture(png, 'png', caption)}<figcaption>{unbroken(caption)}</figcaption></figure>"


def bullets(texts: Iterable[str]) -> str:
    """Give a list of sentences; they are escaped here."""
    return f"<ul>{''.join(f'<li>{marked(text)}</li>' for text in texts)}</ul>"


def player(wav: bytes) -> str:
    """Give a control that plays a WAV that is in the page itself."""
    return f'<audio controls preload=none src="data:audio/wav;base64,{b64encode(wav).decode()}"></audio>'
