"""Recordings of every format: one door, and the registry of the readers behind it.

A format is one module with one reader. Those in `formats` are found there; one of another distribution is found by its
entry point in the group ``bevameter.readers``, or registers itself when its module is imported::

    @register
    class LogReader(Reader):
        kinds = "a logger's file (.log)"

        def sniff(self, path):
            return path.suffix == ".log"

        def read(self, path, *, vehicle, topics):
            return Recording(...)
"""

from __future__ import annotations

import pkgutil
from abc import ABC, abstractmethod
from importlib import import_module
from pathlib import Path
from typing import ClassVar

from ..arguments import path_of
from ..errors import InputError, reading
from ..plugins import load_plugins, once
from ..vehicle import Vehicle, as_vehicle, load_vehicle
from .contents import Contents, contents_of
from .types import Recording


class Reader(ABC):
    """Reads recordings of one format.

    Attributes
    ----------
    kinds
        What it reads, in words, for errors.
    takes_topics
        Whether a topic map, or a column map, means anything to it.
    """

    kinds: ClassVar[str]
    takes_topics: ClassVar[bool] = False

    @abstractmethod
    def sniff(self, path: Path) -> bool:
        """Say, quickly, whether a file or folder that exists is of this format."""

    @abstractmethod
    def read(self, path: Path, *, vehicle: Vehicle | None, topics: Path | None) -> Recording:
        """Read it.

        Parameters
        ----------
        path
            The file or folder.
        vehicle
            The vehicle, where the caller gives one; else the reader may look for its file (`vehicle_near`).
        topics
            The topic map of a bag, or the column map of a table, where the caller gives one.

        Raises
        ------
        InputError
            What is there is at fault: file, place, value and expectation are named.
        """

    def inspect(self, path: Path, *, vehicle: Vehicle | None, topics: Path | None) -> Contents:
        """Say what is in it, also where it cannot be read; the parameters are those of `read`.

        By itself it says which streams are read.

        Raises
        ------
        InputError
            It is not of this format, or so damaged that nothing in it can be named.
        """
        recording = self.read(path, vehicle=vehicle, topics=topics)
        return contents_of(lambda: recording)


READERS: list[Reader] = []


def register(reader: type[Reader]) -> type[Reader]:
    """Add a reader, as a decorator of its class; one that was added later is tried earlier."""
    READERS.insert(0, reader())
    return reader


@once
def load_readers() -> None:
    """Import the modules of this package's formats, and of others that entry points name."""
    from . import formats

    others = list(READERS)
    for module in pkgutil.iter_modules(formats.__path__):
        import_module(f"{formats.__name__}.{module.name}")
    load_plugins("bevameter.readers")
    READERS.sort(key=others.__contains__, reverse=True)  # what was registered before comes before


def read_recording(
    path: str | Path, *, vehicle: Vehicle | str | Path | None = None, topics: str | Path | None = None
) -> Recording:
    """Read a recording, whatever it is: a folder, a wheel or vibration file, a ROS 1 or ROS 2 bag, an MCAP file.

    Parameters
    ----------
    path
        The folder or file.
    vehicle
        The vehicle, or its file; `vehicle.toml` in the folder, or in that of the file, where it is None.
    topics
        For bags: the topic map (see `topic_map`), where the topics' names and types do not say enough. For a wheel file
        or a folder with one: the column map (see `column_map`), where the columns' names do not.

    Returns
    -------
    Recording
        Tables in memory, camera and sound as streams; `problems` says what could not be read.

    Raises
    ------
    InputError
        Nothing of a recording is there, or what is there is at fault: file, place, value and expectation are named.
    """
    reader, path, driven, topic_map = _reader_of(path, vehicle, topics)
    with reading(path, reader.kinds):
        return reader.read(path, vehicle=driven, topics=topic_map)


def read_contents(
    path: str | Path, *, vehicle: Vehicle | str | Path | None = None, topics: str | Path | None = None
) -> Contents:
    """Say what is in a recording, also where it is not good enough to be read; the parameters are those of
    `read_recording`.

    Raises
    ------
    InputError
        There is no such file, it is of no known format, or so damaged that nothing in it can be named; or the vehicle,
        the topic map or the column map is at fault.
    """
    reader, path, driven, topic_map = _reader_of(path, vehicle, topics)
    with reading(path, reader.kinds):
        return reader.inspect(path, vehicle=driven, topics=topic_map)


def _reader_of(
    path: str | Path, vehicle: Vehicle | str | Path | None, topics: str | Path | None
) -> tuple[Reader, Path, Vehicle | None, Path | None]:
    """Find the reader of a recording; give path, vehicle and map as it takes them."""
    path = path_of("recording", path, "a Recording, or the path of one or of a wheel file")
    load_readers()
    kinds = ", ".join(reader.kinds for reader in READERS)
    with reading(path, kinds):
        if not path.exists() and not path.is_symlink():
            raise InputError(path, "no such file or folder", expected=kinds)
        path.stat()  # a link that leads nowhere, or to itself
        driven = None if vehicle is None else as_vehicle(vehicle)
        topic_map = None if topics is None else path_of("topics", topics, "the path of a topic map")
        reader = next((reader for reader in READERS if reader.sniff(path)), None)
        if topic_map is not None and not (reader and reader.takes_topics):
            bags = " or ".join(reader.kinds for reader in READERS if reader.takes_topics)
            raise InputError(path, "a topic or column map is given, and this is neither bag nor table", expected=bags)
        if reader is None:
            raise InputError(path, f"a file of kind {path.suffix!r}", expected=kinds)
        return reader, path, driven, topic_map


def vehicle_near(path: Path) -> Vehicle | None:
    """Give the vehicle whose `vehicle.toml` lies in a folder, or in that of a file or folder."""
    for folder in (path, path.parent) if path.is_dir() else (path.parent,):
        if (folder / "vehicle.toml").is_file():
            return load_vehicle(folder / "vehicle.toml")
    return None
