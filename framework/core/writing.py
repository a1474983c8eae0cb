"""Files written whole or not at all, and never over what is read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import InputError

_RESULTS = (".json", ".html", ".skops", ".png", ".svg", ".pdf")
"""Endings of results, which may be written again where they lie within a recording."""


def check_outputs(written: Iterable[Path | None], read: Iterable[Path | None]) -> None:
    """Find out before long work whether its results can be written; raises `InputError` where they cannot.

    Parameters
    ----------
    written
        Where results will be written: each to a file of its own, and none over what is read.
    read
        Files and folders that are read.
    """
    outputs = [path for path in written if path is not None]
    for number, path in enumerate(outputs):
        _check_writable(path)
        for source in read:
            if source is not None and os.path.exists(source) and _would_replace(path, source):
                raise InputError(path, f"would be written over {source}, which is read", expected="another file")
        for other in outputs[:number]:
            if os.path.realpath(path) == os.path.realpath(other) and not _is_device(path):
                raise InputError(path, "is to hold two results", expected="a file for each")


def _check_writable(path: Path) -> None:
    if os.path.isdir(path):
        raise InputError(path, "is a folder", expected="the name of a file to write")
    folder = path.parent
    if not os.path.isdir(folder):
        raise InputError(path, f"there is no folder {folder}", expected="a file in a folder that exists")
    if not os.access(folder, os.W_OK) and not _is_device(path):
        raise InputError(path, f"the folder {folder} may not be written to", expected="a folder that may be written to")


def _would_replace(path: Path, source: Path) -> bool:
    """Say whether writing a file would replace a source, or what is no result in its folder."""
    if not path.exists():
        return False
    if source.is_file():
        return path.samefile(source)
    return source.is_dir() and path.parent.samefile(source) and path.suffix.lower() not in _RESULTS


def _is_device(path: Path) -> bool:
    """Say whether it is no file that could be replaced, but a device or a pipe to write to."""
    return path.exists() and not path.is_file()


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a place to write at, whose file takes the place of the one at `path` once it is whole.

    A link is followed, and what is no file but a device or a pipe is written to as it is. Raises `InputError` where
    writing fails; nothing is left behind then.
    """
    _check_writable(path)
    target = Path(os.path.realpath(path))
    # The ending stays last: it decides on formats.
    part = target if _is_device(target) else target.with_name(f".{os.getpid()}.{target.name}")
    try:
        yield part
        if part != target:
            os.replace(part, target)
    except OSError as error:
        problem = f"cannot be written: {error.strerror or error}"
        raise InputError(path, problem, expected="a file that may be written") from error
    finally:
        if part != target:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_text(text: str, path: Path) -> None:
    """Write a text file whole or not at all."""
    with whole(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
