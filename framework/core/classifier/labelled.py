"""Labelled folders: what the senses are trained on (CONTRACTS.md, "`bevameter train`")."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..class_names import check_class_name, check_class_names
from ..errors import InputError, reading
from ..files import inside
from ..recording.tables import Table, read_table
from .labelled_copies import without_copies

MEDIA_SUFFIXES = (
    ".jpg", ".jpeg", ".png", ".wav", ".flac", ".ogg", ".aif", ".aiff", ".csv", ".csv.gz", ".parquet",
    ".bag", ".mcap", ".db3",
)  # fmt: skip
"""Files that count where sub-folders name the classes; others, such as a licence, are passed over."""

_FOLDER = "a folder with index.csv, or with sub-folders named by class"
_OWN = frozenset({"file", "class", "group", "start_s", "end_s"})
_NAMED = 3
"""So many unreadable files are named one by one."""
_T = TypeVar("_T")


@dataclass(frozen=True)
class LabelledFile:
    """A file, or a stretch of one, whose class is known.

    Parameters
    ----------
    file
        The file; it exists.
    class_name
        Its class.
    group
        What must stay on one side of a split: source, site, photograph, run.
    start_s, end_s
        The stretch [s] from the file's beginning; None for the file's own ends.
    extra
        Further columns of the index by name, as text; `wheel_file`, where it is given, is an absolute `Path` to a file
        that exists.
    """

    file: Path
    class_name: str
    group: str
    start_s: float | None = None
    end_s: float | None = None
    extra: Mapping[str, str | Path] = field(default_factory=dict)


def read_labelled(folder: str | Path, notes: list[str] | None = None) -> list[LabelledFile]:
    """Read a labelled folder: by its `index.csv`, or by its sub-folders, each named by a class.

    `index.csv` has columns `file`, `class`, `group`, and may have `start_s`, `end_s` and others. Without it each file
    of a sub-folder is a group of its own.

    Parameters
    ----------
    folder
        The folder.
    notes
        What was passed over, and why, is added to these, for people to read.

    Returns
    -------
    list of LabelledFile
        In the order of the index, or sorted by class and name; what stands there twice in one class and group is
        given once.

    Raises
    ------
    InputError
        The folder or a file is missing, a name leads out of the folder, a class or group is blank, a class has a name
        that none may have or that differs in case or spaces only from another's, a stretch ends before it starts, the
        same material is in two classes or groups, a sub-folder holds nothing usable, or there are fewer than two
        classes.
    """
    folder = Path(folder)
    with reading(folder, _FOLDER):
        return _read(folder, [] if notes is None else notes)


def _read(folder: Path, notes: list[str]) -> list[LabelledFile]:
    if not folder.is_dir():
        raise InputError(folder, "a file" if folder.exists() else "no such folder", expected=_FOLDER)
    index = folder / "index.csv"
    by_index = index.is_file()
    labelled, places = _from_index(folder, index) if by_index else _from_folders(folder, notes)
    classes = sorted({item.class_name for item in labelled})
    source = index if by_index else folder
    check_class_names(classes, source)
    if len(classes) < 2:
        raise InputError(source, f"one class only, {classes[0]!r}", expected="two classes or more")
    kept = without_copies(labelled, places, source, groups_matter=by_index)
    if copies := len(labelled) - len(kept):
        notes.append(f"Left out, being copies of others of their class: {copies} of {len(labelled)} labelled files.")
    return kept


def _from_index(folder: Path, index: Path) -> tuple[list[LabelledFile], list[str]]:
    table = read_table(index, numbers=frozenset({"start_s", "end_s"}), text=None)
    names, classes, groups = map(np.ndarray.tolist, table.need("file", "class", "group"))
    for column in ("file", "class", "group"):
        table.refuse(table.text[column] == "", column, lambda row: "an empty cell", f"a {column}")
    for row, name in enumerate(classes):
        check_class_name(name, index, table.place(row, "class"))
    start, end = _stretches(table)
    extras = [name for name in table.text if name not in _OWN]
    labelled: list[LabelledFile] = []
    for row, name in enumerate(names):
        extra: dict[str, str | Path] = {each: table.text[each][row] for each in extras}
        if wheel_file := extra.get("wheel_file"):
            extra["wheel_file"] = _existing(folder, table, row, "wheel_file", str(wheel_file)).absolute()
        file = _existing(folder, table, row, "file", name)
        began, ended = (None if np.isnan(at_s) else float(at_s) for at_s in (start[row], end[row]))
        labelled.append(LabelledFile(file, classes[row], groups[row], began, ended, extra))
    return labelled, [table.place(row, "file") for row in range(len(table))]


def _existing(folder: Path, table: Table, row: int, column: str, name: str) -> Path:
    path = inside(folder, name, table.source, table.place(row, column))
    if not path.is_file():
        problem = f"no file {path}"
        raise InputError(table.source, problem, expected="a file that exists", place=table.place(row, column))
    return path


def _stretches(table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Give where the labelled stretches start and end, each (n,) [s], NaN where that is left to the file."""
    start, end = (table.numbers.get(name, np.full(len(table), np.nan)) for name in ("start_s", "end_s"))
    for name, values in (("start_s", start), ("end_s", end)):
        outside = np.isinf(values) | (values < 0)
        table.refuse(outside, name, lambda row, values=values: f"{values[row]:g}", "seconds from 0")
    began = np.nan_to_num(start)
    table.refuse(end <= began, "end_s", lambda row: f"{began[row]:g} s to {end[row]:g} s", "start_s < end_s")
    return start, end


def _from_folders(folder: Path, notes: list[str]) -> tuple[list[LabelledFile], list[str]]:
    labelled: list[LabelledFile] = []
    barren: list[tuple[Path, str]] = []
    for class_folder in sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")):
        check_class_name(class_folder.name, class_folder)
        there = sorted(path for path in class_folder.iterdir() if not path.name.startswith("."))
        files = [path for path in there if _is_media(path)]
        over = _passed_over([path for path in there if not _is_media(path)])
        if not files:
            barren.append((class_folder, f"no file that can be used; passed over: {over}" if over else "no file"))
        elif over:
            notes.append(f"Passed over in {class_folder.name}: {over}; used: {len(files)}.")
        for file in files:
            name = f"{class_folder.name}/{file.name}"
            labelled.append(LabelledFile(inside(folder, name, folder, "a sub-folder"), class_folder.name, name))
    if not labelled:
        raise InputError(
            folder, "neither index.csv nor images, sounds or tables in sub-folders", expected="a labelled folder"
        )
    if barren:
        raise InputError(*barren[0], expected="images, sounds or tables of this class, not in sub-folders")
    return labelled, [item.group for item in labelled]


def _is_media(path: Path) -> bool:
    return path.name.lower().endswith(MEDIA_SUFFIXES) and not path.is_dir()


def _passed_over(paths: Sequence[Path]) -> str:
    """Count what is no image, sound or table, by kind: ``".bmp (4), sub-folder (1)"``."""
    kinds = Counter("sub-folder" if path.is_dir() else path.suffix.lower() or "without a suffix" for path in paths)
    return ", ".join(f"{kind} ({count})" for kind, count in sorted(kinds.items()))


def readable(
    labelled: Sequence[LabelledFile], read: Callable[[LabelledFile], _T], notes: list[str]
) -> Iterator[tuple[LabelledFile, _T]]:
    """Read labelled files one after the other; those that cannot be read are left out, and `notes` say which.

    Raises
    ------
    InputError
        No file of a class can be read: what is wrong with the first.
    """
    failed: list[InputError] = []
    lost: dict[str, InputError] = {}
    kept = set()
    for item in labelled:
        try:
            content = read(item)
        except InputError as error:
            failed.append(error)
            lost.setdefault(item.class_name, error)
            continue
        kept.add(item.class_name)
        yield item, content
    for name, error in lost.items():
        if name not in kept:
            raise error
    if failed:
        more = f"; {len(failed) - _NAMED} more" if len(failed) > _NAMED else ""
        named = "; ".join(map(str, failed[:_NAMED]))
        notes.append(f"Left out, as they cannot be read: {len(failed)} of {len(labelled)} files: {named}{more}.")
