"""A concealed drive as a folder that `read_recording` opens, the truth in another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..write import vehicle_toml, write_truth
from .journey import Journey, Vehicle

if TYPE_CHECKING:
    from .conceal import ConcealedDrive


def write_drive(concealed: ConcealedDrive, folder: Path, truth_folder: Path | None) -> Path:
    """Write recording.toml, vehicle.toml, wheel.csv, pose.csv and labels.csv; the truth elsewhere.

    Raises
    ------
    ValueError
        The truth would lie where the tool looks.
    OSError
        A file cannot be written.
    """
    scene = concealed.scene
    write_truth(concealed.truth, folder, truth_folder)
    folder.mkdir(parents=True, exist_ok=True)
    tables = {"wheel": _wheel_table(concealed), "pose": _pose_table(scene.journey)}
    tables["labels"] = pd.DataFrame({
        "start_s": scene.journey.borders_s[:-1].round(2), "end_s": scene.journey.borders_s[1:].round(2),
        "class": scene.stretches.classes,
    })  # fmt: skip
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False, lineterminator="\n")
    streams = ", ".join(f'"{name}"' for name in tables)
    (folder / "recording.toml").write_text(f'name = "{folder.name}"\nstreams = [{streams}]\n', encoding="utf-8")
    noise = pd.DataFrame([each.stated_noise(scene.sensors) for each in concealed.recorded]).mean().to_dict()
    text = vehicle_toml(f"vehicle {concealed.truth['seed']}", _wheels(scene.vehicle), noise)
    (folder / "vehicle.toml").write_text(text, encoding="utf-8")
    return folder


def _wheel_table(concealed: ConcealedDrive) -> pd.DataFrame:
    """Give the rows of all wheels in order of time, the front one first."""
    names, several = concealed.scene.vehicle.names, len(concealed.recorded) > 1
    tables = []
    for name, recorded in zip(names, concealed.recorded, strict=True):
        table = pd.DataFrame(recorded.columns)
        if several:
            table.insert(1, "wheel", name)
        if "pass" in table:
            table["pass"] = table["pass"].astype(int)
        tables.append(table)
    return pd.concat(tables).sort_values("time_s", kind="stable")


def _pose_table(journey: Journey) -> pd.DataFrame:
    pose = journey.pose
    return pd.DataFrame({
        "time_s": pose.time_s, "x_m": np.round(pose.x_m, 4), "y_m": np.round(pose.y_m, 4),
        "yaw_rad": np.round(pose.yaw_rad, 5),
    })  # fmt: skip


def _wheels(vehicle: Vehicle) -> list[dict]:
    body = vehicle.body
    shape = {
        "radius_m": body.radius_m, "width_m": body.width_m, "grouser_height_m": body.lug_height_m,
        "grouser_count": body.lugs,
    }  # fmt: skip
    return [
        {"name": name, "position": list(place), **shape}
        for name, place in zip(vehicle.names, vehicle.places, strict=True)
    ]
