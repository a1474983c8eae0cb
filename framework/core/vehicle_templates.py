"""Vehicle files of common robots, with the source of each number: where to begin from, and not a substitute for scales
and a ruler.

A template is a TOML file of the folder `vehicles`. A number that no source states is left out, as a comment says there;
reading such a file names it.
"""

from __future__ import annotations

import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from typing import NamedTuple

from .errors import InputError


class Template(NamedTuple):
    """A template: its name, the robot, what is left out, and the file's text."""

    name: str
    robot: str
    left_out: tuple[str, ...]
    text: str

    @property
    def data(self) -> dict:
        """What the file states."""
        return tomllib.loads(self.text)


def vehicle_templates() -> dict[str, Template]:
    """Give the templates by name, in alphabetical order."""
    files = sorted((file for file in _folder().iterdir() if file.name.endswith(".toml")), key=lambda file: file.name)
    return {name: _template(name, file.read_text(encoding="utf-8")) for file in files if (name := file.name[:-5])}


def vehicle_template(name: str) -> Template:
    """Give one template; raises `InputError` where there is none of that name."""
    known = vehicle_templates()
    if name not in known:
        raise InputError("vehicle", f"no template {name!r}", expected="one of " + ", ".join(known))
    return known[name]


def _template(name: str, text: str) -> Template:
    first, *lines = text.splitlines()
    left_out = dict.fromkeys(line[2:].split(" =")[0] for line in lines if line.startswith("# ") and " = ?" in line)
    return Template(name, first.removeprefix("# "), tuple(left_out), text)


def _folder() -> Traversable:
    return resources.files(__package__ or "") / "vehicles"
