"""The small streams of a recording: poses, labels, and the camera's images in their folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import inside
from ..track.jumps import without_jumps
from .media import read_image
from .tables import Table, read_table
from .types import Frame, Labels, Pose

_POSE = ("time_s", "x_m", "y_m", "yaw_rad")


def read_pose(path: Path) -> tuple[Pose, tuple[str, ...]]:
    """Read `pose.csv` or `pose.parquet`; rows without a pose, or with an impossible one, are left out.

    Returns
    -------
    Pose, problems

    Raises
    ------
    InputError
        A column is missing, a value infinite, time runs backwards, no row has a whole pose, or the places jump for
        good.
    """
    table = read_table(path, numbers=frozenset(_POSE))
    columns = _need(table, _POSE)
    check_time(table, "time_s", columns["time_s"])
    for name in _POSE[1:]:
        infinite = np.isinf(columns[name])
        if infinite.any():
            row = int(np.argmax(infinite))
            raise InputError(path, str(columns[name][row]), expected="a finite number", place=table.place(row, name))
    whole = np.isfinite(np.column_stack([columns[name] for name in _POSE])).all(axis=1)
    if not whole.any():
        raise InputError(path, "no row has a whole pose", expected="x_m, y_m and yaw_rad")
    lost = len(table) - int(whole.sum())
    problems = (f"{path.name}: {lost} of {len(table)} rows without a whole pose",) if lost else ()
    rows = np.flatnonzero(whole)
    pose, jumps = without_jumps(
        Pose(*(columns[name][whole] for name in _POSE)), path, lambda row: table.place(rows[row], "x_m")
    )
    return pose, table.problems + problems + jumps


def read_labels(path: Path) -> Labels:
    """Read `labels.csv`: start_s, end_s, class.

    Raises
    ------
    InputError
        A column is missing, a class is blank, a stretch ends before it starts or overlaps another.
    """
    table = read_table(path, numbers=frozenset({"start_s", "end_s"}), text=frozenset({"class"}))
    columns = _need(table, ("start_s", "end_s"))
    if "class" not in table.text:
        raise InputError(path, "no column class", expected="start_s, end_s, class")
    classes = table.text["class"]
    start, end = columns["start_s"], columns["end_s"]
    for row in range(len(classes)):
        if not classes[row]:
            raise InputError(path, "a blank class", expected="a name", place=table.place(row, "class"))
        if not (np.isfinite(start[row]) and np.isfinite(end[row]) and start[row] < end[row]):
            raise InputError(
                path, f"{start[row]:g} s to {end[row]:g} s", expected="start_s < end_s", place=table.place(row, "end_s")
            )
    order = np.argsort(start, kind="stable")
    overlap = start[order][1:] < end[order][:-1]
    if overlap.any():
        row = int(order[1:][overlap][0])
        raise InputError(
            path, "overlaps another stretch", expected="one class at a time", place=table.place(row, "start_s")
        )
    return Labels(start[order], end[order], tuple(str(name) for name in classes[order]))


class FolderCamera:
    """Images of a folder, decoded one at a time (a `CameraStream`)."""

    def __init__(self, time_s: np.ndarray, files: list[Path]):
        self.time_s = time_s
        self.files = files

    def __len__(self) -> int:
        return len(self.files)

    def frames(self) -> Iterator[Frame]:
        """Yield every image; one that cannot be read comes as None with its problem."""
        for time, file in zip(self.time_s.tolist(), self.files, strict=True):
            try:
                image = read_image(file)
            except InputError as error:
                yield Frame(time, None, str(error))
            else:
                yield Frame(time, image)


def read_camera(folder: Path) -> tuple[FolderCamera, tuple[str, ...]]:
    """Open a folder of images by its `camera.csv`: time_s, file.

    Returns
    -------
    FolderCamera, problems
        Images that are missing are named in the problems, and come as frames without an image.

    Raises
    ------
    InputError
        `camera.csv` or a column of it is missing, time runs backwards, a name leads out of the folder, or not one of
        the images is there.
    """
    if not folder.is_dir():
        raise InputError(folder, "a file", expected="a folder of images with camera.csv")
    index = folder / "camera.csv"
    table = read_table(index, numbers=frozenset({"time_s"}), text=frozenset({"file"}))
    time = _need(table, ("time_s",))["time_s"]
    if "file" not in table.text:
        raise InputError(index, "no column file", expected="time_s, file")
    check_time(table, "time_s", time)
    names = table.text["file"].tolist()
    files = [inside(folder, name, index, table.place(row, "file")) for row, name in enumerate(names)]
    missing = [name for name, file in zip(names, files, strict=True) if not file.is_file()]
    if len(missing) == len(files):
        raise InputError(folder / missing[0], "no such file, nor any other that camera.csv names", expected="images")
    problems = table.problems
    if missing:
        problems += (f"{index.parent.name}: {len(missing)} of {len(files)} images are missing, first {missing[0]}",)
    return FolderCamera(time, files), problems


def check_time(table: Table, name: str, time: np.ndarray) -> None:
    """Refuse time that is not there, is no finite number, or runs backwards."""
    bad = ~np.isfinite(time)
    if bad.any():
        row = int(np.argmax(bad))
        shown = "no value" if np.isnan(time[row]) else str(time[row])
        raise InputError(table.source, shown, expected="a finite number", place=table.place(row, name))
    back = np.diff(time) < 0
    if back.any():
        row = int(np.argmax(back)) + 1
        raise InputError(
            table.source,
            f"time runs backwards, {time[row - 1]:.9g} s and then {time[row]:.9g} s",
            expected="time that does not decrease",
            place=table.place(row, name),
        )


def _need(table: Table, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    missing = [name for name in names if name not in table.numbers]
    if missing:
        there = ", ".join((*table.numbers, *table.text))
        raise InputError(table.source, f"no column {missing[0]}; there are {there}", expected=", ".join(names))
    return {name: table.numbers[name] for name in names}
