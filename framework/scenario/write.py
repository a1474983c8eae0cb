"""Write a synthetic traverse as a recording's folder (CONTRACTS.md), and its ground truth."""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

from ..core.errors import InputError
from ..core.vehicle import Vehicle
from .hearing import heard
from .plan import Plan, make_plan
from .presets import preset
from .seeing import frame_times, seen
from .soils import SOILS
from .vibration import CHANNELS, RATE_HZ, felt
from .wheels import RUT_STIFFENING, VARIATION, VARIATION_LENGTH_M, WheelRows, physics_of, wheel_rows

Progress = Callable[[str, float], None]

START_TIME = datetime(2025, 6, 1, 9, 0, 0, tzinfo=UTC)
"""Time 0 of every synthetic recording; no clock is read, so that a seed makes the same bytes on any day."""

_POSE_RATE_HZ = 20.0
_DIGITS = {
    "time_s": 4, "load_N": 2, "torque_Nm": 4, "sinkage_m": 6, "slip": 6, "drawbar_pull_N": 3, "wheel_speed_rad_s": 5,
    "travel_speed_m_s": 5, "wheel_angle_rad": 5, "pitch_rad": 6, "pass": 0, "x_m": 4, "y_m": 4, "yaw_rad": 6,
    **dict.fromkeys(CHANNELS, 5),
}  # fmt: skip


def write_scenario(
    name: str,
    out: str | Path,
    *,
    seed: int = 0,
    duration_s: float | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a synthetic traverse.

    Besides the files of a recording there are `labels.csv`, the class of ground under the vehicle's reference point,
    and `truth.json`, the soil of each stretch, its slow phase, all faults and what the drive conceals; no reader of
    recordings looks at the latter. Everything is written into a folder next to `out`, which is renamed when whole.

    Parameters
    ----------
    name
        One of `presets.PRESETS`.
    out
        Folder to make; it may exist if it is empty.
    seed
        Of everything random: the same seed makes the same bytes.
    duration_s
        Cut after this time, or go on over further places until then [s]; as laid out in the preset where absent.
    progress
        Called with the stage and the share of it that is done, in [0, 1].

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        No preset of that name, a seed or duration out of range, or a folder that is not empty or cannot be made.
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise InputError("scenario", f"seed {seed!r}", expected="a whole number, 0 or more")
    plan = make_plan(preset(name), seed, duration_s)
    target = Path(out)
    _check_free(target)
    made = [folder for folder in target.parents if not folder.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent))
    except OSError as error:
        raise InputError(target, str(error), expected="a folder that can be written") from error
    try:
        _write_all(plan, name, part, progress or (lambda stage, share: None))
        part.chmod(0o777 & ~_umask())
        if target.is_dir():
            target.rmdir()
        os.replace(part, target)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        for folder in made:  # the innermost first; one that somebody else has put something into stays
            with suppress(OSError):
                folder.rmdir()
        raise
    return target


def _check_free(target: Path) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(target, "a file of that name is there", expected="a new or empty folder")
    if any(target.iterdir()):
        raise InputError(target, "the folder is not empty", expected="a new or empty folder")


def _umask() -> int:
    """Give the process's mask; `mkdtemp` makes folders for the owner alone, which a recording is not."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _write_all(plan: Plan, name: str, folder: Path, report: Progress) -> None:
    report("wheels", 0.0)
    rows = wheel_rows(plan)
    _write_wheels(plan, rows, folder / "wheel.csv")
    _write_pose(plan, folder / "pose.csv")
    _write_csv(
        folder / "labels.csv",
        ("start_s", "end_s", "class"),
        ((f"{s.start_s:.3f}", f"{s.end_s:.3f}", s.terrain) for s in plan.stretches),
    )
    (folder / "vehicle.toml").write_text(vehicle_toml(plan.preset.vehicle), encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(truth(plan, name), indent=1) + "\n", encoding="utf-8")
    report("wheels", 1.0)
    streams = ["wheel", "pose", "labels"]
    if plan.preset.inertial:
        _write_vibration(plan, folder / "vibration.csv")
        streams.append("vibration")
    if plan.preset.sound_rate_Hz is not None:
        _write_sound(plan, folder / "sound.flac", report)
        streams.append("sound")
    if len(frame_times(plan)):
        _write_camera(plan, folder / "camera", report)
        streams.append("camera")
    (folder / "recording.toml").write_text(_recording_toml(plan, name, streams), encoding="utf-8")


def _write_csv(path: Path, names: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows)


def _text(name: str, values: np.ndarray) -> list[str]:
    digits = _DIGITS[name]
    return ["" if math.isnan(value) else f"{value:.{digits}f}" for value in values.tolist()]


def _write_wheels(plan: Plan, rows: WheelRows, path: Path) -> None:
    columns = {name: _text(name, values) for name, values in rows.recorded.items()}
    if len(plan.preset.vehicle.wheels) > 1:
        columns = {"time_s": columns.pop("time_s"), "wheel": rows.wheel.tolist(), **columns}
    _write_csv(path, tuple(columns), zip(*columns.values(), strict=True))


def _write_pose(plan: Plan, path: Path) -> None:
    time = np.arange(0.0, plan.duration_s, 1.0 / _POSE_RATE_HZ)
    columns = {"time_s": time, "x_m": plan.at(plan.x_m, time), "y_m": plan.at(plan.y_m, time)}
    columns["yaw_rad"] = plan.at(plan.yaw_rad, time)
    _write_csv(path, tuple(columns), zip(*(_text(name, values) for name, values in columns.items()), strict=True))


def _write_vibration(plan: Plan, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("time_s", *CHANNELS))
        number = 0
        for block in felt(plan):
            time = (number + np.arange(len(block))) / RATE_HZ
            columns = (
                _text(name, values) for name, values in zip(("time_s", *CHANNELS), (time, *block.T), strict=True)
            )
            writer.writerows(zip(*columns, strict=True))
            number += len(block)


def _write_sound(plan: Plan, path: Path, report: Progress) -> None:
    rate = plan.preset.sound_rate_Hz
    report("sound", 0.0)
    written = 0
    with soundfile.SoundFile(path, "w", samplerate=rate, channels=1, format="FLAC", subtype="PCM_16") as file:
        for block in heard(plan):
            file.write(block)
            written += len(block)
            report("sound", written / (plan.duration_s * (rate or 1)))
    report("sound", 1.0)


def _write_camera(plan: Plan, folder: Path, report: Progress) -> None:
    folder.mkdir()
    report("camera", 0.0)
    rows = []
    count = len(frame_times(plan))
    for number, picture in enumerate(seen(plan)):
        file = f"{number:06d}.jpg"
        (folder / file).write_bytes(picture.data)
        rows.append((f"{picture.time_s:.4f}", file))
        report("camera", (number + 1) / count)
    _write_csv(folder / "camera.csv", ("time_s", "file"), rows)


def _recording_toml(plan: Plan, name: str, streams: Sequence[str]) -> str:
    about = "" if plan.preset.recorded_as else f": {plan.preset.about}"
    name = plan.preset.recorded_as or name
    notes = (
        f"Synthetic traverse '{name}', seed {plan.seed}, {plan.duration_s:g} s{about}. "
        "The ground truth is in labels.csv and truth.json."
    )
    table: dict[str, Any] = {
        "name": f"{name}-{plan.seed}",
        "start_time": START_TIME,
        "site": f"synthetic {name} {plan.seed}",
        "notes": notes,
        "streams": list(streams),
    }
    if "sound" in streams:
        table["sound"] = {"file": "sound.flac", "start_s": plan.preset.sound_start_s}
    return to_toml(table)


def vehicle_toml(vehicle: Vehicle) -> str:
    """Write a vehicle as `vehicle.toml` (CONTRACTS.md) is written."""
    table = vehicle.model_dump(exclude_none=True, exclude_defaults=True)
    wheels = table.pop("wheels")
    ordered: dict[str, Any] = {"name": vehicle.name}
    if len(wheels) == 1:
        ordered["wheel"] = wheels[0]
    else:
        ordered["wheels"] = list(wheels)
    return to_toml({**ordered, **table})


def to_toml(table: dict[str, Any]) -> str:
    """Write a table of plain values, tables and lists of tables as TOML."""
    plain = [f"{key} = {_toml_value(value)}" for key, value in table.items() if not _is_table(value)]
    parts = ["\n".join(plain)]
    for key, value in table.items():
        if isinstance(value, dict):
            parts.append("\n".join([f"[{key}]", *(f"{name} = {_toml_value(entry)}" for name, entry in value.items())]))
        elif _is_table(value):
            parts += [
                "\n".join([f"[[{key}]]", *(f"{name} = {_toml_value(entry)}" for name, entry in one.items())])
                for one in value
            ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _is_table(value: object) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))


def _toml_value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, datetime):
        return value.isoformat().replace("+00:00", "Z")
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=True)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml_value(entry) for entry in value) + "]"
    return repr(value)


def truth(plan: Plan, name: str) -> dict[str, Any]:
    """Give what is true of a drive, fit for JSON: the soil of each stretch, slow phases, faults, what is concealed."""
    return {
        "schema": 1,
        "scenario": name,
        "seed": plan.seed,
        "duration_s": plan.duration_s,
        "length_m": float(plan.way_m[-1]),
        "stretches": [
            {
                "class": stretch.terrain,
                "start_s": stretch.start_s,
                "end_s": stretch.end_s,
                "slow_until_s": stretch.slow_until_s,
                "start_m": stretch.start_m,
                "end_m": stretch.end_m,
                "soil": None if stretch.soil is None else asdict(stretch.soil),
            }
            for stretch in plan.stretches
        ],
        "classes": {
            terrain: {
                "c_Pa": SOILS[terrain].c_Pa,
                "phi_rad": SOILS[terrain].phi_rad,
                "relative_sd": dict(zip(("c", "tan_phi", "k", "stiffness", "n"), SOILS[terrain].spread, strict=True)),
                "source": SOILS[terrain].source,
            }
            for terrain in sorted({stretch.terrain for stretch in plan.stretches} & set(SOILS))
        },
        "variation": {"relative_sd": VARIATION, "length_m": VARIATION_LENGTH_M, "of": ["c_Pa", "stiffness_Pa"]},
        "rut_stiffening": RUT_STIFFENING if len(plan.preset.vehicle.wheels) > 1 else None,
        "concealed": [cause.truth() for cause in (*plan.preset.concealed, *physics_of(plan.preset.vehicle))],
        "faults": [asdict(fault) for fault in plan.faults],
    }
