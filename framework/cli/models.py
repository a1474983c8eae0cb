"""`bevameter models`: the models that come with the package, their cards, and whether they are in order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from .doctor import NEEDS_ATTENTION

if TYPE_CHECKING:
    from ..core.classifier.shipped import ShippedModel


def command(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Print the card of this model.")] = None,
    verify: Annotated[
        bool,
        typer.Option(
            "--verify", help="Check the digests of the files, and what the model answers to its example; exit status 1."
        ),
    ] = False,
) -> None:
    """List the models that come with the package, print the card of one, or check them."""
    from ..core.classifier.shipped import shipped_model, shipped_models

    chosen = list(shipped_models().values()) if name is None else [shipped_model(name)]
    if verify:
        _verify(chosen)
    elif name is not None:
        print(chosen[0].card, end="")
    else:
        _list(chosen)


def _list(models: Sequence[ShippedModel]) -> None:
    from .printing import print_table

    rows = [
        (one.name, one.sense, one.ground, ", ".join(one.classes), "yes" if one.default else "no", one.measured)
        for one in models
    ]
    print_table(("name", "sense", "ground", "classes", "by default", "measured"), rows)
    print("bevameter models NAME prints a model's card; --models NAME has a run use it")


def _verify(models: Sequence[ShippedModel]) -> None:
    from ..doctor import check_of_shipped

    checks = [check_of_shipped(one) for one in models]
    for check in checks:
        print(
            f"{check.name}: " + (f"{check.problem}\n  {check.remedy}" if check.problem else f"in order; {check.found}")
        )
    if any(check.problem for check in checks):
        raise typer.Exit(NEEDS_ATTENTION)
