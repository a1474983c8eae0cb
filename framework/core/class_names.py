"""Names of terrain classes: what may be one, and which two are the same name written in two ways."""

from __future__ import annotations

import unicodedata
from collections.abc import Collection, Iterable
from pathlib import Path

from .errors import InputError
from .evidence import UNKNOWN

_UNPRINTABLE = frozenset({"Cc", "Cs", "Zl", "Zp"})


def check_class_name(name: str, source: str | Path, place: str | None = None) -> None:
    """Refuse a name that is blank, breaks a line or steers a terminal, or means that a gate closed.

    Raises
    ------
    InputError
        It names `source` and `place`.
    """
    if not _key(name) or any(unicodedata.category(character) in _UNPRINTABLE for character in name):
        raise InputError(source, f"a class named {name!r}", expected="a name on one line", place=place)
    if _key(name) == UNKNOWN:
        raise InputError(source, repr(name), expected="a class; this is the answer of a closed gate", place=place)


def check_class_names(names: Iterable[str], source: str | Path, place: str | None = None) -> None:
    """Refuse names as `check_class_name` does, and two that differ in case, spaces or the encoding of accents only.

    Raises
    ------
    InputError
        It names `source` and `place`, and both names.
    """
    seen: dict[str, str] = {}
    for name in names:
        check_class_name(name, source, place)
        if (other := seen.setdefault(_key(name), name)) != name:
            raise InputError(
                source, f"classes {other!r} and {name!r}", expected="one spelling for each class", place=place
            )


def check_spelling(name: str, known: Iterable[Collection[str]], source: str | Path) -> None:
    """Refuse a name as `check_class_name` does, and one that differs in case, spaces or the encoding of accents
    only from a class that is known: nothing would match it.

    Parameters
    ----------
    name
        The name, written by hand.
    known
        Names that classes have already; of several collections the first that has a name like it counts. A name like
        none of them is one of a class that is still to come, and has no spaces at its ends.
    source
        Where the name stands.

    Raises
    ------
    InputError
        It names `source` and the spelling that is known.
    """
    check_class_name(name, source)
    for names in known:
        alike = sorted(each for each in names if _key(each) == _key(name))
        if name in alike:
            return
        if alike:
            spelt = " or ".join(map(repr, alike))
            raise InputError(source, f"a class named {name!r}", expected=f"{spelt}, as it is spelt here")
    if name != name.strip():
        raise InputError(source, f"a class named {name!r}", expected="no spaces at its ends")


def spelt_alike(names: Iterable[str]) -> list[list[str]]:
    """Names that differ in case, spaces or the encoding of accents only, sorted, in groups of two and more."""
    groups: dict[str, list[str]] = {}
    for name in sorted(set(names)):
        groups.setdefault(_key(name), []).append(name)
    return [group for group in groups.values() if len(group) > 1]


def _key(name: str) -> str:
    return "".join(unicodedata.normalize("NFKC", name).split()).casefold()
