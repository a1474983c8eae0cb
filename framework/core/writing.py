"""Files written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import InputError


def check_writable(path: Path) -> None:
    """Find out before long work whether its result can be written; raises `InputError` where it cannot."""
    if path.is_dir():
        raise InputError(path, "is a folder", expected="the name of a file to write")
    folder = path.parent
    if not folder.is_dir():
        raise InputError(path, f"there is no folder {folder}", expected="a file in a folder that exists")
    if not os.access(folder, os.W_OK):
        raise InputError(path, f"the folder {folder} may not be written to", expected="a folder that may be written to")


def write_text(text: str, path: Path) -> None:
    """Write a text file whole or not at all."""
    check_writable(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8", newline="\n")
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
