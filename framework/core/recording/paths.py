"""Names of files that stand in somebody else's table: none may lead out of the folder."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

from ..errors import InputError


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
    if not path.resolve().is_relative_to(folder.resolve()):
        raise InputError(source, f"{name!r} leads out of the folder", expected="a file inside of it", place=place)
    return path
