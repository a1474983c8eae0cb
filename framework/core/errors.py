"""The errors that Bevameter knows: the command line prints each, a line a fault, and exits with 2."""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path


class BevameterError(Exception):
    """Something a user can put right. Its text is one line, or one for each of several faults, fit to be printed."""


class InputError(BevameterError):
    """Bad input, named so that a user can find and mend it.

    Parameters
    ----------
    source
        The file (or table, or option) that is at fault.
    problem
        What is wrong, the offending value included.
    expected
        What would have been right.
    place
        Where in the source: a row, a column, a channel, a key, a time.

    Examples
    --------
    >>> print(InputError("wheel.csv", "'abc'", expected="a number", place="row 12, column load_N"))
    wheel.csv, row 12, column load_N: 'abc' (expected a number)
    """

    def __init__(self, source: str | Path, problem: str, *, expected: str | None = None, place: str | None = None):
        self.source = str(source)
        self.place = place
        self.problem = " ".join(str(problem).split())
        self.expected = expected
        where = self.source if place is None else f"{self.source}, {place}"
        tail = "" if expected is None else f" (expected {expected})"
        super().__init__(" ".join(f"{where}: {self.problem}{tail}".splitlines()))  # names of files may hold a new line

    def __reduce__(self) -> tuple:
        """Let it come out of a worker process, which pickles what it raises."""
        return partial(type(self), expected=self.expected, place=self.place), (self.source, self.problem)


class InputErrors(InputError):
    """Several faults of one source, found in one reading: a line for each below one that counts them.

    Parameters
    ----------
    source
        The file.
    errors
        The faults.
    doubts
        What is no fault by itself and may be one where there are others, such as a column that nothing reads.
    """

    def __init__(self, source: str | Path, errors: Sequence[InputError], doubts: Sequence[InputError] = ()):
        count = f"{len(errors)} fault{'s' * (len(errors) > 1)}"
        super().__init__(source, f"{count}, and {len(doubts)} in doubt" if doubts else count)
        self.errors, self.doubts = tuple(errors), tuple(doubts)
        own = (f"{self.source}, ", f"{self.source}: ")
        lines = (str(error).removeprefix(own[0]).removeprefix(own[1]) for error in (*errors, *doubts))
        self.args = ("\n  ".join([f"{self.source}: {self.problem}", *lines]),)

    def __reduce__(self) -> tuple:
        """Let it come out of a worker process, faults and all."""
        return type(self), (self.source, self.errors, self.doubts)


@contextmanager
def collected(faults: list[InputError]) -> Iterator[None]:
    """Add an `InputError` to a list, so that the next fault is found, too."""
    try:
        yield
    except InputError as error:
        faults.append(error)


def raise_all(source: str | Path, faults: Sequence[InputError], doubts: Sequence[InputError] = ()) -> None:
    """Raise the one fault there is, or all of several together with what is in doubt (`InputErrors`); return where
    there is none.
    """
    if faults:
        several = [fault for fault in faults if isinstance(fault, InputErrors)]
        every = [each for fault in faults for each in (fault.errors if isinstance(fault, InputErrors) else (fault,))]
        places = {each.place for each in every}
        unsure = [*(each for fault in several for each in fault.doubts), *doubts]
        unsure = [each for each in unsure if each.place not in places]
        raise every[0] if len(every) + len(unsure) == 1 else InputErrors(source, every, unsure)


_SAID = {
    errno.ENOENT: "no such file",
    errno.ENOTDIR: "no such file",
    errno.ELOOP: "a link that leads to itself",
}


@contextmanager
def reading(path: str | Path, expected: str) -> Iterator[None]:
    """Raise `InputError` where the system refuses a file or folder: the one that it names, or `path`."""
    try:
        yield
    except OSError as error:
        problem = _SAID.get(error.errno or 0) or error.strerror or str(error)
        raise InputError(str(error.filename or path), problem, expected=expected) from error
