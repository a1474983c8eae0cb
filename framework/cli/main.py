"""The command line: `bevameter COMMAND ...`, each command a thin layer over a function of the Python interface.

Nothing heavy is imported here or by a command's module: each command imports its work when it runs, so that
``bevameter --help`` answers at once.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ... import __version__
from ..core.errors import BevameterError
from . import (
    classify,
    db,
    doctor,
    draw_map,
    explain,
    identify,
    inspect,
    live,
    models,
    photographs,
    query,
    run,
    scenario,
    simulate,
    train,
    vehicle,
    view,
)
from .printing import show_progress

BAD_INPUT = 2
"""Exit status for bad input or usage."""

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells count it: 128 + SIGINT."""


READER_GONE = 141
"""Exit status where the reader of the output closed it, as shells count it: 128 + SIGPIPE."""


_NO_MORE = (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Reason of an error in writing to an open stream, which has no file name."""


class _OneLineErrors(TyperGroup):
    """Prints the errors that Bevameter knows as one line; those that it does not know keep their traceback."""

    def make_context(self, *arguments: Any, **further: Any) -> Any:
        """Read the arguments; help and version are printed here."""
        with _in_one_line():
            return super().make_context(*arguments, **further)

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        with _in_one_line():
            return super().invoke(ctx)


@contextmanager
def _in_one_line() -> Iterator[None]:
    """Turn errors into one line and an exit status, those of writing what was printed, too."""
    try:
        try:
            yield
        finally:
            _flush()
    except BevameterError as error:
        print(f"bevameter: {error}", file=sys.stderr)
        raise typer.Exit(BAD_INPUT) from error
    except KeyboardInterrupt:
        print("bevameter: interrupted; what was stored is whole", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    except OSError as error:
        if error.filename is not None or error.errno not in _NO_MORE:
            raise
        _write_no_more()
        if isinstance(error, BrokenPipeError):
            raise typer.Exit(READER_GONE) from None
        print(f"bevameter: the output cannot be written: {error.strerror}", file=sys.stderr)
        raise typer.Exit(BAD_INPUT) from None


def _flush() -> None:
    """Write what was printed; there is no standard output where the shell closed it."""
    if sys.stdout is not None:
        sys.stdout.flush()


def _write_no_more() -> None:
    """Let go of what was printed: it would fail once more when Python ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


app = typer.Typer(
    name="bevameter",
    help="Recognises terrain, measures its soil from the wheels, and remembers both for the planner.",
    cls=_OneLineErrors,
    no_args_is_help=True,
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
        bool, typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True)
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Print each stage of the work and how long it took, on standard error.")
    ] = False,
) -> None:
    show_progress(quiet=quiet, verbose=verbose)


app.command("scenario", help="Write a synthetic traverse, a recording with its ground truth.")(scenario.command)
app.command("inspect", help="What is in a recording, and what it lacks.")(inspect.command)
app.command("vehicle", help="Vehicle files of common robots.")(vehicle.command)
app.command("run", help="Process a recording into a terrain database.")(run.command)
app.command("live", help="Follow a drive that is being recorded into a terrain database.")(live.command)
app.add_typer(query.app, name="query", help="Query the terrain database.")
app.add_typer(db.app, name="db", help="Look after the terrain database.")
app.command("map", help="Draw what the terrain database knows.")(draw_map.command)
app.command("view", help="Show the terrain database in a browser on this machine.")(view.command)
app.command("identify", help="Soil parameters from the wheel channels of a recording.")(identify.command)
app.command("explain", help="What the simulation of a recorded wheel lacks.")(explain.command)
app.command("simulate", help="Simulate the wheel on a soil.")(simulate.command)
app.command("photographs", help="Photographs of known ground from a drive, to train from.")(photographs.command)
app.command("train", help="Train a classifier from labelled files.")(train.command)
app.command("classify", help="Classify files with a trained model.")(classify.command)
app.command("models", help="The models that come with the package.")(models.command)
app.command("doctor", help="Whether the installation, the models and a database are in order.")(doctor.command)


def main() -> None:
    """Run the command line; the entry point of the installed script."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of files need not be text
    app()


if __name__ == "__main__":
    main()
