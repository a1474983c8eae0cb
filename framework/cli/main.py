"""The command line: `bevameter COMMAND ...`, each command a thin skin over the same function that a Python user calls.

Nothing heavy is imported here or by a command's module: each command imports its work when it runs, so that
``bevameter --help`` answers at once.
"""

from __future__ import annotations

import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ... import __version__
from ..core.errors import BevameterError
from . import classify, draw_map, explain, identify, query, run, scenario, simulate, train

BAD_INPUT = 2
"""Exit status where the input or the way of asking is at fault."""

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells count it: 128 + SIGINT."""


class _OneLineErrors(TyperGroup):
    """Prints the errors that Bevameter knows as one line; those that it does not know keep their traceback."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except BevameterError as error:
            print(f"bevameter: {error}", file=sys.stderr)
            raise typer.Exit(BAD_INPUT) from error
        except KeyboardInterrupt:
            print("bevameter: interrupted; nothing was half-written", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None


app = typer.Typer(
    name="bevameter",
    help="Recognises terrain, measures its soil from the wheels, and remembers both for the planner.",
    cls=_OneLineErrors,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # rich's help alone would take a third of the 0.3 s
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"bevameter {__version__}")
        raise typer.Exit()


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and leave.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    pass


app.command("scenario", help="Write a synthetic traverse, a recording with its ground truth.")(scenario.command)
app.command("run", help="A recording in, a filled terrain database out.")(run.command)
app.add_typer(query.app, name="query", help="Ask the terrain database.")
app.command("map", help="Draw what the terrain database knows.")(draw_map.command)
app.command("identify", help="Soil parameters from the wheel channels of a recording.")(identify.command)
app.command("explain", help="Why simulation and recording differ: what was left out.")(explain.command)
app.command("simulate", help="Simulate the wheel on a soil.")(simulate.command)
app.command("train", help="Train a classifier from labelled files.")(train.command)
app.command("classify", help="Classify files with a trained model.")(classify.command)


def main() -> None:
    """Run the command line; the entry point of the installed script."""
    app()


if __name__ == "__main__":
    main()
