"""Wheel tables to files, the counterpart of `wheel_file`."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from ..errors import InputError
from ..files import whole
from .types import WheelTable


def write_wheel_file(table: WheelTable, path: str | Path) -> None:
    """Write a wheel table whole or not at all: CSV (``.csv``, ``.csv.gz``) or Parquet (``.parquet``), by its ending.

    Raises
    ------
    InputError
        The ending is another, or the file cannot be written.
    """
    path = Path(path)
    columns: dict[str, object] = {}
    if table.run is not None:
        columns["run"] = table.run
    if table.wheel is not None:
        columns["wheel"] = table.wheel
    frame = pd.DataFrame({**columns, **table.columns})
    if not path.name.endswith((".csv", ".csv.gz", ".parquet")):
        raise InputError(path, f"ending {path.suffix!r}", expected=".csv, .csv.gz or .parquet")
    with whole(path) as part:
        if path.suffix == ".parquet":
            frame.to_parquet(part, index=False)
        else:
            frame.to_csv(part, index=False, lineterminator="\n")
