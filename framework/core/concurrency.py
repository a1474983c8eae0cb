"""Independent fits at once: the heavy parts of each let go of Python's lock."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from multiprocessing.pool import ThreadPool
from threading import local
from typing import TypeVar

THREADS = 2
"""Fits at once."""

_thread = local()

_Given = TypeVar("_Given")
_Answer = TypeVar("_Answer")


def together(function: Callable[[_Given], _Answer], given: Iterable[_Given]) -> list[_Answer]:
    """Call a function with each of what is given; its answers in that order. Within such a call, one after the other.

    Ctrl-C does not wait for a call to end: threads of such a pool end with the process.
    """
    if getattr(_thread, "of_pool", False):
        return [function(each) for each in given]
    with ThreadPool(THREADS, initializer=setattr, initargs=(_thread, "of_pool", True)) as pool:
        return pool.map_async(function, given, chunksize=1).get()
