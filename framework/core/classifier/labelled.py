"""Labelled folders: what the senses are trained on (CONTRACTS.md, "`bevameter train`")."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..class_names import check_class_name, check_class_names
from ..errors import InputError, reading
from ..files import inside
from ..recording.tables import Table, read_table
from .labelled_copies import without_copies

MEDIA_SUFFIXES = (
    ".jpg", ".jpeg", ".png", ".wav", ".flac", ".ogg", ".aif", ".aiff", ".csv", ".csv.gz", ".parquet",
)  # fmt: skip
"""Files that count where sub-folders name the classes; others, such as a licence, are passed over."""

_FOLDER = "a folder with index.csv, or with sub-folders named by class"
_OWN = frozenset({"file", "class", "group", "start_s", "end_s"})


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
        that none may have or that only case or spaces tell from another's, a stretch ends before it starts, the same
        material is in two classes or groups, a sub-folder holds nothing that can be used, or there are fewer than two
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
    for name in ("file", "class", "group"):
        if name not in table.text:
            there = ", ".join((*table.text, *table.numbers))
            raise InputError(index, f"no column {name}; there are {there}", expected="file, class, group")
    extras = [name for name in table.text if name not in _OWN]
    labelled: list[LabelledFile] = []
    for row in range(len(table)):
        class_name = _filled(table, row, "class")
        check_class_name(class_name, index, table.place(row, "class"))
        start_s, end_s = _stretch(table, row)
        extra: dict[str, str | Path] = {name: table.text[name][row] for name in extras}
        if extra.get("wheel_file"):
            extra["wheel_file"] = _existing(folder, table, row, "wheel_file").absolute()
        labelled.append(
            LabelledFile(
                _existing(folder, table, row, "file"), class_name, _filled(table, row, "group"), start_s, end_s, extra
            )
        )
    return labelled, [table.place(row, "file") for row in range(len(table))]


def _filled(table: Table, row: int, name: str) -> str:
    cell = str(table.text[name][row])
    if not cell:
        raise InputError(table.source, "an empty cell", expected=f"a {name}", place=table.place(row, name))
    return cell


def _existing(folder: Path, table: Table, row: int, name: str) -> Path:
    place = table.place(row, name)
    path = inside(folder, _filled(table, row, name), table.source, place)
    if not path.is_file():
        raise InputError(table.source, f"no file {path}", expected="a file that exists", place=place)
    return path


def _stretch(table: Table, row: int) -> tuple[float | None, float | None]:
    ends: list[float | None] = []
    for name in ("start_s", "end_s"):
        value = table.numbers[name][row] if name in table.numbers else np.nan
        if np.isinf(value) or value < 0:
            raise InputError(table.source, f"{value:g}", expected="seconds from 0", place=table.place(row, name))
        ends.append(None if np.isnan(value) else float(value))
    start_s, end_s = ends
    if end_s is not None and end_s <= (start_s or 0.0):
        raise InputError(
            table.source, f"{start_s or 0.0:g} s to {end_s:g} s", expected="start_s < end_s",
            place=table.place(row, "end_s"),
        )  # fmt: skip
    return start_s, end_s


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
