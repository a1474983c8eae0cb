"""The same material twice among labelled files: on both sides of a split it would score what was learnt by heart."""

from __future__ import annotations

import hashlib
import os
from collections import Counter, defaultdict
from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    from .labelled import LabelledFile

_TIMELESS = (".jpg", ".jpeg", ".png")
_TOUCHING_S = 1e-6


def without_copies(
    labelled: Sequence[LabelledFile], places: Sequence[str], source: Path, *, groups_matter: bool
) -> list[LabelledFile]:
    """Leave out what is there already in the same class and group, and refuse what is there in another.

    Files are the same where their bytes are; stretches of one file are where they overlap, by more than an end that
    touches a beginning.

    Parameters
    ----------
    labelled, places
        n files or stretches, and where each stands in `source`.
    groups_matter
        False where each file is a group only because nobody said which are: a copy in the same class is left out then.

    Raises
    ------
    InputError
        The same material is in two groups or two classes; both places are named.
    """
    copies: set[int] = set()
    by_content: defaultdict[Hashable, list[int]] = defaultdict(list)
    for index, content in enumerate(_contents([item.file for item in labelled])):
        by_content[content].append(index)
    for indices in by_content.values():
        reached: dict[tuple[str, str], tuple[float, int]] = {}
        stretches: set[tuple] = set()
        for index in sorted(indices, key=lambda index: _stretch(labelled[index])):
            item, (begin, end) = labelled[index], _stretch(labelled[index])
            owner = (item.class_name, item.group if groups_matter else "")
            # Sorted by where they begin, stretches that ended before this one overlap none that follows.
            reached = {other: last for other, last in reached.items() if last[0] > begin + _TOUCHING_S}
            if rivals := sorted(last for other, last in reached.items() if other != owner):
                raise _shared(item, labelled[rivals[0][1]], places[index], places[rivals[0][1]], source)
            if (owner, begin, end) in stretches:
                copies.add(index)
            stretches.add((owner, begin, end))
            reached[owner] = max(reached.get(owner, (end, index)), (end, index))
    return [item for index, item in enumerate(labelled) if index not in copies]


def _contents(files: Sequence[Path]) -> list[Hashable]:
    """Give what is the same for files of the same bytes; only files of equal size are read."""
    paths = [Path(os.path.realpath(file)) for file in files]
    sizes = {path: _size(path) for path in paths}
    shared = Counter(sizes.values())
    contents = {path: _digest(path) if size and shared[size] > 1 else path for path, size in sizes.items()}
    return [contents[path] for path in paths]


def _size(path: Path) -> int | None:
    try:
        return path.stat().st_size
    except OSError:
        return None  # whoever reads the file says what is wrong with it


def _digest(path: Path) -> Hashable:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError:
        return path


def _stretch(item: LabelledFile) -> tuple[float, float]:
    """Beginning and end [s]; a photograph is always the whole of it."""
    if item.file.name.lower().endswith(_TIMELESS):
        return 0.0, float("inf")
    return item.start_s or 0.0, float("inf") if item.end_s is None else item.end_s


def _shared(item: LabelledFile, other: LabelledFile, place: str, other_place: str, source: Path) -> InputError:
    split = "class" if item.class_name != other.class_name else "group"
    here, there = (item.class_name, other.class_name) if split == "class" else (item.group, other.group)
    name, others = item.file.name, other.file.name
    what = name if item.file == other.file else "the same file" if name == others else f"{name}, the same as {others},"
    return InputError(
        source, f"{what} is of {split} {here!r} here and of {there!r} in {other_place}",
        expected=f"the same material in one {split} only", place=place,
    )  # fmt: skip
