"""Files: written whole or not at all and never over what is read, named in tables, and TOML read."""

from __future__ import annotations

import csv
import os
import stat
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, TextIO

from .errors import InputError, reading

_RESULTS = (".json", ".html", ".skops", ".png", ".svg", ".pdf", ".rrd")
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


def write_new(text: str, path: Path) -> None:
    """Write a text file whole or not at all where there is none; raises `InputError` where one would be replaced."""
    if os.path.lexists(path):
        raise InputError(path, "is there already", expected="a file that does not exist yet")
    write_text(text, path)


def write_csv(rows: Iterable[dict[str, Any]], columns: Sequence[str], file: TextIO) -> None:
    """Write rows as CSV under a header, cells empty where a row has no value."""
    writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)


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


def toml_string(text: str) -> str:
    """Write text as a string of TOML, which is fit for a comment, too: nothing in it ends the line."""
    plain = text.encode("utf-8", "replace").decode()
    escaped = "".join(
        f"\\u{ord(each):04x}" if not each.isprintable() and ord(each) < 2**16 else each
        for each in (plain.replace("\\", "\\\\").replace('"', '\\"'))
    )
    return f'"{escaped}"'


_INTEGERS = "one of no more than 64 bits; write it with a decimal point"


def load_toml(path: str | Path) -> dict:
    """Read a TOML file; raises `InputError` where it is missing, no TOML, or holds a number of more than 64 bits."""
    from .arguments import path_of  # and with it numpy, which writing a file needs not

    path = path_of("file", path, "the path of a TOML file")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
        _check_integers(path, data)
    except FileNotFoundError:
        raise InputError(path, "no such file", expected="a TOML file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, str(error), expected="a readable TOML text file") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, str(error), expected="valid TOML") from error
    except RecursionError:
        raise InputError(path, "nested too deeply", expected="valid TOML, a few tables deep") from None
    except ValueError:  # Python converts no longer text to an integer
        limit = sys.get_int_max_str_digits()
        raise InputError(path, f"a whole number of more than {limit} digits", expected=_INTEGERS) from None
    return data


def _check_integers(path: Path, value: object, key: str = "") -> None:
    """Refuse whole numbers that TOML does not have, in tables and arrays however deep: no float may hold them."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, part in parts:
        _check_integers(path, part, f"{key}.{name}" if key else str(name))
    if isinstance(value, int) and value.bit_length() > 63:
        digits = f"a whole number of {len(str(abs(value)))} digits"
        raise InputError(path, digits, expected=_INTEGERS, place=f"key {key}")
