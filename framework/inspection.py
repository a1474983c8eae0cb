"""`inspect_recording`: what is in a recording, what is read from it, and what it lacks for map, soil and `explain`."""

from __future__ import annotations

import os
import shlex
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .core.errors import InputError, reading
from .core.files import write_new
from .core.recording.contents import Contents
from .core.recording.readers import read_contents
from .core.vehicle import Vehicle
from .needs import Answer, Mends, Missing, class_map, explain, soil


@dataclass(frozen=True)
class Inspection:
    """What is in a recording, and for what it serves.

    Parameters
    ----------
    source
        The recording.
    class_map, soil, explain
        Whether `run` can make a map of classes, `identify` estimate cohesion and friction angle, and `explain` compare
        with the simulation.
    contents
        Topics, columns or files, with what each feeds; problems and notes; files to edit.
    """

    source: Path
    class_map: Answer
    soil: Answer
    explain: Answer
    contents: Contents

    @property
    def notes(self) -> tuple[str, ...]:
        """What was chosen and assumed in reading and in selecting rows, each once."""
        answers = (*self.class_map.notes, *self.soil.notes, *self.explain.notes)
        return tuple(dict.fromkeys((*self.contents.notes, *answers)))

    def as_dict(self) -> dict[str, Any]:
        """Lay out for JSON (``"schema": 1``)."""
        contents = self.contents
        return {
            "schema": 1,
            "source": str(self.source),
            "class_map": asdict(self.class_map),
            "soil": asdict(self.soil),
            "explain": asdict(self.explain),
            "sources": [{**asdict(each), "rate_Hz": each.rate_Hz} for each in contents.sources],
            "fault": None if contents.fault is None else str(contents.fault),
            "problems": list(contents.problems),
            "notes": list(self.notes),
        }

    def write(self, folder: str | Path | None = None) -> tuple[Path, ...]:
        """Write the files to edit, and give their paths.

        Parameters
        ----------
        folder
            Where to; into a recording's folder, or beside a bag or table, where None.

        Raises
        ------
        InputError
            One of them is there already, and none is written then; or the folder cannot be written to.
        """
        where = self.contents.folder if folder is None else Path(folder)
        paths = {where / name: text for name, text in self.contents.files.items()}
        for path in paths:
            if os.path.lexists(path):
                raise InputError(path, "is there already", expected="another folder, with --into")
        with reading(where, "a folder, or a place for one"):
            where.mkdir(parents=True, exist_ok=True)
        for path, text in paths.items():
            write_new(text, path)
        return tuple(paths)


def inspect_recording(
    path: str | Path, *, vehicle: Vehicle | str | Path | None = None, topics: str | Path | None = None
) -> Inspection:
    """Say what is in a recording, what is read from it, and what it lacks; it need not be good enough to be read.

    It is recognised as reading recognises it. Of a bag of more than 128 MiB a part is read, and the rest is counted.

    Parameters
    ----------
    path
        A recording's folder, a wheel table, a ROS 1 or ROS 2 bag, or an MCAP file.
    vehicle
        The vehicle, or its file; ``vehicle.toml`` beside the recording where absent.
    topics
        The topic map of a bag, or the column map of a table.

    Raises
    ------
    InputError
        There is no such file, it is of no known format, or so damaged that nothing in it can be named; or the vehicle
        or the map is at fault.
    """
    contents = read_contents(path, vehicle=vehicle, topics=topics)
    write = f"bevameter inspect {shlex.quote(str(path))} --write"
    if contents.recording is None:
        fault = contents.fault
        what, remedy = str(fault), "a file that can be read"
        if contents.map_name in contents.files:
            remedy = f"{contents.map_name}, which `{write}` writes, can say it"
        elif fault is not None and fault.expected is not None:
            what = ": ".join(each for each in (fault.place, fault.problem) if each)
            remedy = f"expected: {fault.expected}"
        answer = Answer(False, "it cannot be read", (Missing(what, remedy),))
        return Inspection(Path(path), answer, answer, answer, contents)
    intrinsics = any("camera's intrinsics" in each.feeds for each in contents.sources)
    mends = Mends(contents.map_name, write if "vehicle.toml" in contents.files else "", intrinsics)
    of_soil = soil(contents.recording, mends)
    return Inspection(
        Path(path), class_map(contents.recording, mends), of_soil, explain(contents.recording, mends, of_soil), contents
    )
