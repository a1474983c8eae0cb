"""A stream to a file of the Rerun viewer, on the timelines of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from .core.errors import InputError
from .core.track.way import too_far_apart

_ANSWERS_S = 5.0
"""A viewer answers within this time [s]."""


def rerun_module() -> Any:
    """Import Rerun; raises `InputError` where it is not installed."""
    try:
        import_module("rerun.blueprint")  # and not `rerun` alone: any folder of that name can be imported
    except ImportError as error:
        raise InputError("rerun-sdk", "is not installed", expected='pip install "bevameter[rerun]"') from error
    return import_module("rerun")


def is_address(to: str | Path) -> bool:
    """Say whether it is a viewer's address, and no file."""
    return isinstance(to, str) and "://" in to


def check_rerun(to: str | Path) -> None:
    """Find out before long work whether a file can be written; raises `InputError` where it cannot."""
    if not is_address(to) and Path(to).suffix.lower() != ".rrd":
        raise InputError(to, f"ends with {Path(to).suffix!r}", expected="a name that ends with .rrd")
    rerun_module()


@dataclass(frozen=True)
class Log:
    """A stream to a file, with the timelines of a recording.

    Parameters
    ----------
    rr
        The module.
    stream
        Where to write.
    start
        When second 0 of the recording was, UTC; None where nobody knows.
    """

    rr: Any
    stream: Any
    start: np.datetime64 | None

    def static(self, path: str, what: Any) -> None:
        """Write what holds at all times."""
        self.stream.log(path, what, static=True)

    def at(self, time_s: float, path: str, what: Any) -> None:
        """Write what holds from a time on [s]."""
        self.stream.set_time("recording", duration=float(time_s))
        if self.start is not None:
            self.stream.set_time("utc", timestamp=self.start + _nanoseconds(np.array(time_s))[()])
        self.stream.log(path, what)

    def columns(self, path: str, time_s: np.ndarray, columns: Any) -> None:
        """Write n rows at times (n,) [s]."""
        times = [self.rr.TimeColumn("recording", duration=_nanoseconds(time_s))]
        if self.start is not None:
            times.append(self.rr.TimeColumn("utc", timestamp=self.start + _nanoseconds(time_s)))
        self.stream.send_columns(path, times, columns)

    def series(self, path: str, time_s: np.ndarray, values: np.ndarray) -> None:
        """Write values (n,) at times (n,) [s]; the first of several NaN is an empty row, which ends the line."""
        known = np.isfinite(values)
        kept = known | np.append(False, known[:-1])
        if known.any():
            scalars = self.rr.Scalars.columns(scalars=values[known])
            self.columns(path, time_s[kept], scalars.partition(known[kept].astype(int)))

    def path(self, *parts: str) -> str:
        """Join names, whatever they hold, to the path of an entity."""
        return self.rr.new_entity_path(list(parts))


@contextmanager
def opened(to: str | Path, started: datetime | None) -> Iterator[Log]:
    """Open a file, or a connection with a viewer, to write a recording to that started then.

    Within, what Rerun would only warn of is an error.

    Raises
    ------
    InputError
        Rerun is switched off, or no viewer answers.
    OSError
        What Rerun itself reports: the disk is full, say.
    """
    rr = rerun_module()
    strict = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        stream = rr.RecordingStream("bevameter")
        if not stream.is_enabled():
            raise InputError("RERUN", "this variable of the environment switches Rerun off", expected="none, or on")
        stream.set_log_time_enabled(False)  # when the file was written says nothing
        if is_address(to):
            _connect(stream, str(to))
        else:
            stream.save(to)
        yield Log(rr, stream, None if started is None else np.datetime64(started.replace(tzinfo=None), "ns"))
        stream.flush()
        stream.disconnect()
    except RuntimeError as error:
        raise OSError(f"Rerun: {error}") from error
    finally:
        rr.set_strict_mode(strict)


def _connect(stream: Any, address: str) -> None:
    try:
        stream.connect_grpc(address)
        stream.flush(timeout_sec=_ANSWERS_S)
    except (RuntimeError, ValueError) as error:
        expected = "a viewer that waits there (`rerun --port 9876`): rerun+http://HOST:PORT/proxy"
        raise InputError(address, f"no viewer answers: {error}", expected=expected) from error


def broken(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add a NaN to a recorded series, times [s] and values (n,), after each row that none followed for long."""
    there = np.isfinite(time_s)
    time_s, values = time_s[there], values[there]
    if len(time_s) < 2:
        return time_s, values
    last = np.flatnonzero(too_far_apart(time_s))
    return np.insert(time_s, last + 1, time_s[last]), np.insert(values, last + 1, np.nan)


def _nanoseconds(time_s: np.ndarray) -> np.ndarray:
    return np.round(1e9 * np.asarray(time_s, dtype=float)).astype("timedelta64[ns]")
