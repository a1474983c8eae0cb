"""How `bevameter explain` prints its answer."""

from __future__ import annotations

from ...identification.mismatch.explanation import Explanation, Missing
from ...identification.mismatch.show import readable
from ...identification.mismatch.show.headline import verdict
from ...identification.mismatch.show.sound_section import sound_lines
from ...identification.mismatch.show.tables import (
    fit_headers,
    fit_rows,
    located_headers,
    located_rows,
    predicted_worse,
    soil_table,
)
from .printing import print_rows

_CANDIDATES_PRINTED = 5


def print_explanation(answer: Explanation) -> None:
    """Print the verdict, where the channels differ, what was left out, what it gains, the sound, and what to trust."""
    print(verdict(answer))
    print(answer.summary)
    print()
    print_rows(located_headers(), located_rows(answer), title="Where simulation and recording differ")
    if answer.located:
        print()
    for each in answer.missing:
        _print_missing(each)
    print_rows(fit_headers(), fit_rows(answer), title=f"Error on held-out rows: {answer.split}")
    print()
    likeliest = sorted(answer.candidates, key=lambda each: -each.probability)[:_CANDIDATES_PRINTED]
    print_rows(
        ["candidate", "held-out nats", "probability", "why"],
        [
            [readable.effect(each.effect), f"{each.heldout_nats:+.1f}", readable.percent(each.probability), each.why]
            for each in likeliest
        ],
        title=f"Most probable of {len(answer.candidates)} candidates",
    )
    print()
    print_rows(*soil_table(answer), title="Soil")
    print()
    if answer.sound is not None:
        print("Sound")
        for line in sound_lines(answer.sound):
            print(line)
        print()
    print(answer.trust)
    for note in (*predicted_worse(answer), *answer.notes):
        print(f"note: {note}")


def _print_missing(missing: Missing) -> None:
    form = f", {missing.form}" if missing.form else ""
    kind = readable.KINDS.get(missing.kind, missing.kind)
    how_sure = readable.likelihood(missing.probability)
    print(f"{readable.effect(missing.effect)} ({missing.effect}{form}; {kind}): {how_sure}")
    for name, value in missing.parameters.items():
        print(f"  {readable.estimate(name, value)}")
    print(f"  {missing.equation}; {missing.source}")
    if missing.description:
        print(f"  shape: {missing.description}")
    if missing.indistinguishable_from:
        print(f"  not told from: {readable.effects(missing.indistinguishable_from)}")
    if missing.would_tell:
        print(f"  what would tell: {missing.would_tell}")
    print()
