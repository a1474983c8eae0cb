"""Independent fits at once: the heavy parts of each let go of Python's lock."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from queue import Empty, SimpleQueue
from threading import Thread, local
from typing import Any, TypeVar

THREADS = 2
"""Fits at once."""

_POLL_S = 0.2

_thread = local()

_Given = TypeVar("_Given")
_Answer = TypeVar("_Answer")


def together(function: Callable[[_Given], _Answer], given: Iterable[_Given]) -> list[_Answer]:
    """Call a function with each of what is given; its answers in that order.

    Calls within one of several are made one after the other.

    The first error is raised when the calls that have begun have ended. Ctrl-C waits for none of them: the threads end
    with the process.
    """
    given = list(given)
    if len(given) < 2 or getattr(_thread, "of_others", False):
        return [function(each) for each in given]
    waiting: SimpleQueue[tuple[int, _Given]] = SimpleQueue()
    for item in enumerate(given):
        waiting.put(item)
    answers: dict[int, Any] = {}
    errors: dict[int, BaseException] = {}

    def work() -> None:
        _thread.of_others = True
        while not errors:
            try:
                number, each = waiting.get_nowait()
            except Empty:
                return
            try:
                answers[number] = function(each)
            except BaseException as error:
                errors[number] = error

    threads = [Thread(target=work, daemon=True) for _ in range(min(THREADS, waiting.qsize()))]
    for thread in threads:
        thread.start()
    for thread in threads:
        while thread.is_alive():
            thread.join(_POLL_S)  # another thread may have got the signal of Ctrl-C, which then wakes no one here
    if errors:
        raise errors[min(errors)]
    return [answers[number] for number in sorted(answers)]
