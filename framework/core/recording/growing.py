"""MCAP files that grow while they are read, or come through standard input."""

from __future__ import annotations

import dataclasses
import math
import os
import queue
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Container, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, cast

from ..errors import InputError, reading
from .bag_files import MCAP_REPAIR, BagFile, Message, Span, Topic, mcap_messages, mcap_records, plain_message

STDIN = Path("standard input")
"""Stands for the file that comes through standard input."""

_POLL_S = 0.05
_PIECE = 2**16
_MOST_PIECES = 64


class Stopped(Exception):
    """The user wants no more of it."""


class Growing(ABC):
    """Bytes that are still being written: `read` waits for those that are not there yet.

    Parameters
    ----------
    path
        The file, for what is said of it.
    idle_s
        After so long without a byte nothing more is expected [s].
    """

    def __init__(self, path: Path, idle_s: float = math.inf):
        self.path, self._idle_s = path, idle_s
        self._stops = threading.Event()

    @staticmethod
    def of(path: Path | None, idle_s: float = math.inf) -> Growing:
        """Open a file or pipe, standard input where `path` is None; raises `InputError` where it cannot be read."""
        if path is None:
            return GrowingPipe(0, STDIN, idle_s)
        if path.is_fifo():
            with reading(path, "an MCAP file"):
                return GrowingPipe(os.open(path, os.O_RDONLY), path, idle_s)
        return GrowingFile(path, idle_s)

    can_be_read_again = False
    """Whether what was read is still there."""

    def stop(self) -> None:
        """Have `read` raise `Stopped` from now on; from any thread, or a signal handler."""
        self._stops.set()

    @property
    def was_stopped(self) -> bool:
        """Whether somebody wanted no more of it."""
        return self._stops.is_set()

    def read(self, length: int) -> bytes:
        """Give the next bytes; fewer than `length` where there are no more.

        Raises
        ------
        Stopped
            After `stop`.
        InputError
            The file became shorter.
        """
        pieces, missing, last_s = list[bytes](), length, time.monotonic()
        while missing:
            if self.was_stopped:
                raise Stopped
            piece = self._next(missing)
            if piece:
                pieces.append(piece)
                missing, last_s = missing - len(piece), time.monotonic()
            elif piece is None or time.monotonic() - last_s > self._idle_s:
                break
        return b"".join(pieces)

    @abstractmethod
    def _next(self, most: int) -> bytes | None:
        """Give some bytes; none after waiting for a moment, None where there will be no more."""

    @property
    def unread_bytes(self) -> int:
        """How much was written and not read yet, as far as that is known."""
        return 0


class GrowingFile(Growing):
    """A file that is written by another program; see `Growing`."""

    can_be_read_again = True

    def __init__(self, path: Path, idle_s: float = math.inf):
        super().__init__(path, idle_s)
        with reading(path, "an MCAP file"):
            if path.is_dir():
                raise InputError(path, "a folder", expected="an MCAP file, or `-` for standard input")
            self._raw = path.open("rb", buffering=0)

    def _next(self, most: int) -> bytes | None:
        piece = self._raw.read(most)
        if not piece:
            if self.unread_bytes < 0:
                raise InputError(self.path, "became shorter while it was read", expected="a file that grows")
            self._stops.wait(_POLL_S)
        return piece

    @property
    def unread_bytes(self) -> int:
        """How much was written and not read yet."""
        return os.fstat(self._raw.fileno()).st_size - self._raw.tell()


class GrowingPipe(Growing):
    """What another program writes into a pipe; see `Growing`. It has to wait while nothing is read.

    Parameters
    ----------
    descriptor
        The pipe's.
    path, idle_s
        As of `Growing`.
    """

    def __init__(self, descriptor: int, path: Path, idle_s: float = math.inf):
        super().__init__(path, idle_s)
        self._held: bytes | None = b""
        self._pieces: queue.Queue[bytes] = queue.Queue(_MOST_PIECES)
        # A thread, since Windows cannot wait for a pipe and a moment together.
        threading.Thread(target=self._work, args=(descriptor,), name="bevameter pipe", daemon=True).start()

    def _work(self, descriptor: int) -> None:
        piece = b"more"
        while piece:
            try:
                piece = os.read(descriptor, _PIECE)
            except OSError:  # it was closed
                piece = b""
            self._pieces.put(piece)

    def _next(self, most: int) -> bytes | None:
        if self._held == b"":
            try:
                self._held = self._pieces.get(timeout=_POLL_S) or None
            except queue.Empty:
                return b""
        if self._held is None:
            return None
        piece, self._held = self._held[:most], self._held[most:]
        return piece


class GrowingBag(BagFile):
    """An MCAP file that grows; its messages come once, as they are written.

    Parameters
    ----------
    source
        Its bytes.

    Attributes
    ----------
    is_whole
        Whether all messages have come, up to the end of the file's data.
    """

    def __init__(self, source: Growing):
        self.source, self.path, self.files = source, source.path, [source.path]
        self.problems: list[str] = []
        self.is_whole = False

    def messages(self, wanted: Container[str] | None = None, span: Span | None = None) -> Iterator[Message]:
        """Yield the messages of the topics wanted (all where None), up to where the file is damaged if it is."""
        for message in self._as_far_as_it_goes(self._records(), self.path, MCAP_REPAIR):
            name, time_ns = message.topic.name, message.time_ns
            if (wanted is None or name in wanted) and (span is None or span[0] <= time_ns < span[1]):
                yield message

    def _records(self) -> Iterator[Message]:
        records, topics = mcap_records(cast(IO[bytes], self.source)), dict[int, Topic]()
        try:
            for message in mcap_messages(records, topics):
                yield dataclasses.replace(message, data=plain_message(message.data))
        except Stopped:
            return
        self.is_whole = True
        if isinstance(self.source, GrowingPipe):
            with suppress(Exception):  # the index, which nobody needs; but its writer does not fail for it
                for _ in records:
                    pass


class HeldBag(BagFile):
    """Messages of a bag that are held in memory.

    Parameters
    ----------
    path
        The bag.
    held
        The messages.
    problems
        What is wrong with it.
    """

    def __init__(self, path: Path, held: list[Message], problems: list[str]):
        self.path, self.files, self.held, self.problems = path, [path], held, problems

    def messages(self, wanted: Container[str] | None = None, span: Span | None = None) -> Iterator[Message]:
        """Yield the messages of the topics wanted and of the span (all where None)."""
        for message in self.held:
            name, time_ns = message.topic.name, message.time_ns
            if (wanted is None or name in wanted) and (span is None or span[0] <= time_ns < span[1]):
                yield message
