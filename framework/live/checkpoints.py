"""Checkpoints of a drive that goes on: every few seconds what came since the last is written away."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from ..core.errors import InputError
from .intake import Intake
from .journal import Journal
from .log import Part
from .observing import Observing, described

PERIOD_S = 5.0
"""A power cut loses no more than this, and the newest image and window of sound [s]."""


class Checkpoints:
    """Writes checkpoints in a thread of its own; where that fails, keeps what came in memory and tries again.

    Parameters
    ----------
    journal
        Where to.
    intake, observing
        What is written.
    describe
        Gives the state of the drive itself.
    settle
        Called with each checkpoint.
    trouble
        Called where writing fails, and where it works again, with the text.

    Attributes
    ----------
    fault
        Why the last checkpoint could not be written; empty where it was.
    """

    def __init__(
        self, journal: Journal, intake: Intake, observing: Mapping[str, Observing],
        describe: Callable[[], dict[str, Any]], settle: Callable[[], None], trouble: Callable[[str], None],
    ):  # fmt: skip
        self._journal, self._intake, self._observing = journal, intake, observing
        self._describe, self._settle, self._trouble = describe, settle, trouble
        self.fault = ""
        self._pending: list[Part] = []
        self._ends, self._taking = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._work, name="bevameter checkpoints", daemon=True)

    def begin(self) -> None:
        """Write the first one, and begin."""
        self.take()
        self._thread.start()

    def end(self) -> None:
        """Write what is left, and end."""
        self._ends.set()
        self._thread.join()
        self.take()

    def _work(self) -> None:
        following = time.monotonic() + PERIOD_S
        while not self._ends.wait(max(following - time.monotonic(), 0.0)) and threading.main_thread().is_alive():
            following = time.monotonic() + PERIOD_S
            try:
                self.take()
            except Exception as error:  # the next one may be possible; without a word none would be written any more
                self._say(f"a checkpoint failed: {described(error)}")

    def take(self) -> None:
        """Write a checkpoint now."""
        with self._taking:
            parts, state = self._intake.take_unsaved()
            state |= self._describe()
            for name, each in self._observing.items():
                more, state[name] = each.take_unsaved()
                parts += more
            self._pending += parts
            try:
                self._journal.write(self._pending, state)
                self._pending = []
                self._say("")
            except (InputError, OSError) as error:
                self._say(f"no checkpoint is written, all is kept in memory: {error}")
            self._settle()

    def _say(self, fault: str) -> None:
        if bool(fault) != bool(self.fault):
            self._trouble(fault or "checkpoints are written again")
        self.fault = fault

    def parts(self, stream: str) -> Iterator[dict[str, np.ndarray]]:
        """Give all parts of a stream, those that could not be written too."""
        if self._journal.path.exists():
            yield from self._journal.parts(stream)
        yield from (columns for name, columns in self._pending if name == stream)
