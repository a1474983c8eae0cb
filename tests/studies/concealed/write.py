"""A concealed recording as a folder that `read_recording` opens, the truth in another."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

if TYPE_CHECKING:
    from .conceal import ConcealedRecording


def write_recording(concealed: ConcealedRecording, folder: Path, truth_folder: Path | None) -> Path:
    """Write recording.toml, vehicle.toml, wheel.csv, soil.toml where the soil is known; the truth elsewhere.

    Raises
    ------
    ValueError
        The truth would lie where the tool looks.
    OSError
        A file cannot be written.
    """
    write_truth(concealed.truth, folder, truth_folder)
    folder.mkdir(parents=True, exist_ok=True)
    run = {} if concealed.recorded.run is None else {"run": concealed.recorded.run}
    table = pd.DataFrame({**run, **concealed.recorded.columns})
    table.to_csv(folder / "wheel.csv", index=False, lineterminator="\n")
    (folder / "recording.toml").write_text(f'name = "{folder.name}"\nstreams = ["wheel"]\n', encoding="utf-8")
    vehicle = concealed.vehicle
    wheel = {key: vehicle[key] for key in ("radius_m", "width_m", "grouser_height_m", "grouser_count")}
    text = vehicle_toml(vehicle["name"], [wheel], vehicle["noise"])
    (folder / "vehicle.toml").write_text(text, encoding="utf-8")
    if concealed.known_soil:
        lines = [f"{name} = {{ value = {v:.6g}, sd = {sd:.6g} }}" for name, (v, sd) in concealed.known_soil.items()]
        (folder / "soil.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def write_truth(truth: dict, folder: Path, truth_folder: Path | None) -> None:
    """Write the truth of a recording in a folder to another one, where that is given."""
    if truth_folder is None:
        return
    if folder.resolve() in (truth_folder.resolve(), *truth_folder.resolve().parents):
        raise ValueError(f"truth folder {truth_folder} lies in the recording's folder")
    truth_folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(truth, indent=1) + "\n"
    (truth_folder / f"{folder.name}.json").write_text(text, encoding="utf-8")


def vehicle_toml(name: str, wheels: Sequence[Mapping[str, Any]], noise: Mapping[str, float]) -> str:
    """Give vehicle.toml; a wheel without a name is the only one."""
    lines = [f'name = "{name}"']
    for wheel in wheels:
        lines += ["", "[[wheels]]" if "name" in wheel else "[wheel]"]
        lines += [f"{key} = {json.dumps(value)}" for key, value in wheel.items()]
    if noise:
        lines += ["", "[noise]", *(f"{name} = {sd:.6g}" for name, sd in noise.items())]
    return "\n".join(lines) + "\n"
