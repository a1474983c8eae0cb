"""Where the vehicle was, and which ground it was on where somebody wrote that down."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..track.jumps import without_jumps
from .tables import read_table
from .types import Labels, Pose

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
    columns = table.need(*_POSE)
    table.check_time("time_s")
    for name in _POSE[1:]:
        table.check_finite(name, missing=True)
    whole = np.isfinite(np.column_stack(columns)).all(axis=1)
    if not whole.any():
        raise InputError(path, "no row has a whole pose", expected="x_m, y_m and yaw_rad")
    lost = len(table) - int(whole.sum())
    problems = (f"{path.name}: {lost} of {len(table)} rows without a whole pose",) if lost else ()
    rows = np.flatnonzero(whole)
    pose, jumps = without_jumps(
        Pose(*(values[whole] for values in columns)), path, lambda row: table.place(rows[row], "x_m")
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
    start, end, classes = table.need("start_s", "end_s", "class")
    table.refuse(classes == "", "class", lambda row: "a blank class", "a name")
    whole = np.isfinite(start) & np.isfinite(end) & (start < end)
    table.refuse(~whole, "end_s", lambda row: f"{start[row]:g} s to {end[row]:g} s", "start_s < end_s")
    order = np.argsort(start, kind="stable")
    overlap = np.zeros(len(start), dtype=bool)
    overlap[order[1:]] = start[order][1:] < end[order][:-1]
    table.refuse(overlap, "start_s", lambda row: "overlaps another stretch", "one class at a time")
    return Labels(start[order], end[order], tuple(map(str, classes[order])))
