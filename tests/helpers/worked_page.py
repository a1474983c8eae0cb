"""A page of the documentation as a reader works through it: its commands are run in order, and print what it shows."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest
from bevameter.framework.cli.main import app
from typer.testing import CliRunner

_BLOCK = re.compile(r"(?:`([\w./-]+)`:\n\n)?^```(console|python|text|toml)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"# ([\w./-]+)(, at the end)?\n")
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_RELATIVE = 0.05
"""How far a printed number may be from that of the page: machines differ in the last digits."""


def work_through(page: Path, folder: Path) -> None:
    """Do what a page says, in the folder where the reader's files are.

    A block `console` has commands after ``$ `` and what they print, in which ``...`` stands for anything; a command
    that fails prints a line ``bevameter: ``. A block `toml` whose first line is a remark with a name is written to
    that file, or at its end; so is a block `text` below a line that ends in a name and a colon. Blocks `python` share
    their names; a block `text` after one is what it prints.
    """
    names: dict[str, object] = {}
    printed = None
    with contextlib.chdir(folder):
        for above, kind, text in _BLOCK.findall(page.read_text(encoding="utf-8")):
            if kind == "console":
                for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
                    command, _, shown = part.partition("\n")
                    _run(command, shown)
            elif kind == "python":
                with contextlib.redirect_stdout(io.StringIO()) as out:
                    exec(compile(text, str(page), "exec"), names)
                printed = out.getvalue()
            elif kind == "text" and above:
                Path(above).write_text(text, encoding="utf-8")
            elif name := _FILE.match(text):
                with Path(name[1]).open("a" if name[2] else "w", encoding="utf-8") as file:
                    file.write(text[name.end() :])
            elif kind == "text" and printed is not None:
                compare(text, printed, "what the Python above prints")
                printed = None


def _run(command: str, shown: str) -> None:
    program, *arguments = shlex.split(command, comments=True)
    assert program == "bevameter", command
    result = CliRunner().invoke(app, ["--quiet", *arguments], catch_exceptions=False)
    fails = re.search(r"^bevameter: ", shown, re.MULTILINE) is not None
    assert result.exit_code == (2 if fails else 0), f"{command}\n{result.output}"
    compare(shown, result.output, command)


def compare(shown: str, printed: str, what: str) -> None:
    """Fail where what was printed is not what is shown, spaces apart and numbers within `_RELATIVE`."""
    parts = [" ".join(part.split()) for part in shown.split("...")]
    pattern, values = [], []
    for part in parts:
        values += [float(number) for number in _NUMBER.findall(part)]
        texts = [re.escape(text).replace(r"\ ", r"\s+") for text in _NUMBER.split(part)]
        pattern.append(r"([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)".join(texts))
    found = re.fullmatch(r"\s*" + r".*?".join(pattern) + r"\s*", " ".join(printed.split()), re.DOTALL)
    assert found, f"{what} prints\n{printed}\nand not\n{shown}"
    assert [float(each) for each in found.groups()] == pytest.approx(values, rel=_RELATIVE, abs=0.02), what
