"""Files by their names, also such as stand in somebody else's table: none of those may lead out of the folder."""

from __future__ import annotations

import os
import stat
from pathlib import Path, PurePosixPath, PureWindowsPath

from ..errors import InputError, reading


def inside(folder: Path, name: str, source: Path, place: str) -> Path:
    """Give the path of a file that a table names, relative to its folder.

    Raises
    ------
    InputError
        The name is empty or absolute, climbs out of the folder, or leads out of it by a link.
    """
    if not name or "\0" in name:
        raise InputError(source, f"{name!r}", expected="the name of a file", place=place)
    windows, posix = PureWindowsPath(name), PurePosixPath(name)
    if windows.drive or windows.root or posix.is_absolute() or ".." in windows.parts or ".." in posix.parts:
        raise InputError(source, f"{name!r} leads out of the folder", expected="a file inside of it", place=place)
    path = folder / name
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise InputError(source, f"{name!r} leads out of the folder", expected="a file inside of it", place=place)
    return path


def file_size(path: Path, expected: str) -> int:
    """Give the size of a file [bytes]; raises `InputError`, which says what it is, where it is no file to be read."""
    with reading(path, expected):
        status = path.stat()
    if stat.S_ISDIR(status.st_mode):
        raise InputError(path, "a folder", expected=expected)
    if not stat.S_ISREG(status.st_mode):
        raise InputError(path, "a pipe or a device", expected=expected)
    return status.st_size
