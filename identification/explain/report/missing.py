"""One thing that is missing, of the wheel's physics or of the sound, as the report shows it."""

from __future__ import annotations

from html import escape

from ....framework.core.explanation import Missing
from ....framework.core.html import table, unbroken
from ..quantities import KINDS, capital, columns_in_words, effect, listed, percent, what_happens
from ..words import aim, measurement, name_of
from .tables import parameter_table


def missing_section(missing: Missing) -> str:
    """Give what is missing as HTML, with its parameters and what else it may be."""
    what = columns_in_words(missing.description) or what_happens(missing.effect)
    form = f" Form: {missing.form}." if missing.form else ""
    kind = KINDS.get(missing.kind, missing.kind)
    body = (
        f"<h3>{escape(capital(name_of(missing)))}: {unbroken(percent(missing.probability))}</h3>"
        f"<p>{escape(capital(what))}{'.' if what else ''}{escape(form)} Kind: {escape(kind)}. "
        f"Name in files: <code>{escape(missing.effect)}</code>.</p>"
        f"<p>Equation: <code>{escape(missing.equation)}</code><br>Source: {escape(missing.source)}</p>"
    )
    if missing.parameters:
        body += table(*parameter_table(missing.parameters))
    if missing.indistinguishable_from:
        alike = listed((effect(slug) for slug in missing.indistinguishable_from), "or")
        body += f"<p>These data do not separate it from {escape(alike)}.</p>"
    if missing.would_tell:
        body += f"<p>To {aim(missing)}: {escape(measurement(missing))}.</p>"
    return body
