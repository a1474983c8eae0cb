"""How `bevameter explain` prints its answer."""

from __future__ import annotations

from ...identification.explain.explanation import Explanation, Missing
from ...identification.explain.quantities import KINDS, capital, effect, estimate, listed, percent
from ...identification.explain.report.sound import sound_lines
from ...identification.explain.report.tables import candidate_table, fit_table, located_table, soil_table
from ...identification.explain.words import details, headline, name_of, predicted_worse
from .printing import print_rows

_CANDIDATES_PRINTED = 5


def print_explanation(answer: Explanation) -> None:
    """Print the answer, where the channels differ, what is missing, what it gains, the sound, and what to rely on."""
    print(headline(answer))
    for text in (details(answer), answer.trust):
        if text:
            print(text)
    print()
    print_rows(*located_table(answer), title="Where simulation and recording differ")
    if answer.located:
        print()
    for each in answer.missing:
        _print_missing(each)
    print_rows(*fit_table(answer), title=f"Error on held-out rows: {answer.split}")
    print()
    headers, rows = candidate_table(answer.candidates[:_CANDIDATES_PRINTED])
    title = f"Most probable of {len(answer.candidates)} candidates"
    print_rows(headers[:-1], [row[:-1] for row in rows], title=title)
    print()
    print_rows(*soil_table(answer), title="Soil")
    print()
    if answer.sound is not None:
        print("Sound", *sound_lines(answer.sound), "", sep="\n")
    if worse := predicted_worse(answer):
        print(f"note: predicted worse than before: {listed(worse)}")
    for note in answer.notes:
        print(f"note: {note}")


def _print_missing(missing: Missing) -> None:
    form = f", {missing.form}" if missing.form else ""
    kind = KINDS.get(missing.kind, missing.kind)
    print(f"{capital(name_of(missing))} ({missing.effect}{form}; {kind}): {percent(missing.probability)}")
    for name, value in missing.parameters.items():
        print(f"  {estimate(name, value)}")
    print(f"  {missing.equation}; {missing.source}")
    for title, text in (
        ("where", missing.description),
        ("indistinguishable from", ", ".join(effect(slug) for slug in missing.indistinguishable_from)),
        ("to decide", missing.would_tell),
    ):
        if text:
            print(f"  {title}: {text}")
    print()
