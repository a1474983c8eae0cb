"""Vehicle files of common robots, with the source of each number: where to begin from, and not a substitute for scales
and a ruler.

A template is a TOML file of the folder `vehicles`. A number that no source states is left out, as a comment says there;
reading such a file names it.
"""

from __future__ import annotations

import tomllib
from difflib import get_close_matches
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
        near = _nearest(name, list(known))
        expected = f"{near}: bevameter vehicle {near}; or" if near else "one of"
        raise InputError("vehicle", f"no template {name!r}", expected=f"{expected} {', '.join(known)}")
    return known[name]


def _nearest(name: str, known: list[str]) -> str:
    """Give the name that begins with what was given or has it, or else the most alike; empty where none is."""
    given = name.casefold()
    by_part = [each for each in known if each.startswith(given)] or [each for each in known if given and given in each]
    parts = {part: each for each in known for part in (each, *each.split("-"))}
    alike = get_close_matches(given, parts, n=1)
    return by_part[0] if by_part else parts[alike[0]] if alike else ""


def _template(name: str, text: str) -> Template:
    first, *lines = text.splitlines()
    left_out = dict.fromkeys(line[2:].split(" =")[0] for line in lines if line.startswith("# ") and " = ?" in line)
    return Template(name, first.removeprefix("# "), tuple(left_out), text)


def _folder() -> Traversable:
    return resources.files(__package__ or "") / "vehicles"
