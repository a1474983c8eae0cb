"""The one door for recordings of every kind."""

from __future__ import annotations

from pathlib import Path

from ..arguments import path_of
from ..errors import InputError, reading
from ..track.way import pose_from_wheel
from ..vehicle import Vehicle, as_vehicle, load_vehicle
from .digest import StreamDigest
from .folder import read_folder, vibration_stream
from .tables import is_table, read_table
from .types import Recording
from .wheel_file import derive_all, is_wheel_channel, read_wheel

_KINDS = "a recording's folder, a wheel file (.csv, .csv.gz, .parquet), a ROS bag (.bag or a ROS 2 folder) or .mcap"


def read_recording(
    path: str | Path, *, vehicle: Vehicle | str | Path | None = None, topics: str | Path | None = None
) -> Recording:
    """Read a recording, whatever it is: a folder, a wheel or vibration file, a ROS 1 or ROS 2 bag, an MCAP file.

    Parameters
    ----------
    path
        The folder or file.
    vehicle
        The vehicle, or its file; `vehicle.toml` in the folder, or beside the file, where it is None.
    topics
        For bags: the topic map (see `bags`), where the topics' names and types do not say enough.

    Returns
    -------
    Recording
        Tables in memory, camera and sound as streams; `problems` says what could not be read.

    Raises
    ------
    InputError
        Nothing of a recording is there, or what is there is at fault: file, place, value and expectation are named.
    """
    path = path_of("recording", path, "a Recording, or the path of one or of a wheel file")
    with reading(path, _KINDS):
        return _read(path, vehicle, topics)


def _read(path: Path, vehicle: Vehicle | str | Path | None, topics: str | Path | None) -> Recording:
    if not path.exists() and not path.is_symlink():
        raise InputError(path, "no such file or folder", expected=_KINDS)
    path.stat()  # a link that leads nowhere, or to itself
    vehicle = None if vehicle is None else as_vehicle(vehicle)
    topic_map = None if topics is None else path_of("topics", topics, "the path of a topic map")
    is_bag = path.suffix.lower() in (".bag", ".mcap", ".db3") or (path.is_dir() and _is_bag_folder(path))
    if topics is not None and not is_bag:
        raise InputError(path, "a topic map is given, and this is no bag", expected="a .bag, .mcap or ROS 2 bag folder")
    if is_bag:
        from .bags import read_bag

        return read_bag(path, vehicle=vehicle or _beside(path), topics=topic_map)
    if path.is_dir():
        return read_folder(path, vehicle)
    if is_table(path):
        return _single_table(path, vehicle)
    raise InputError(path, f"a file of kind {path.suffix!r}", expected=_KINDS)


def _is_bag_folder(folder: Path) -> bool:
    return (folder / "metadata.yaml").is_file() or any(folder.glob("*.db3")) or any(folder.glob("*.mcap"))


def _beside(path: Path) -> Vehicle | None:
    """Give the vehicle whose file lies in the bag's folder, or beside the file."""
    for folder in (path, path.parent) if path.is_dir() else (path.parent,):
        if (folder / "vehicle.toml").is_file():
            return load_vehicle(folder / "vehicle.toml")
    return None


def _single_table(path: Path, vehicle: Vehicle | None) -> Recording:
    """Read a wheel file, or a vibration file, which has time and no wheel channel."""
    digest, problems = StreamDigest(), []
    name = path.name.split(".")[0]
    if _is_vibration(path):
        drives = path.with_name(path.name.replace("imu", "pro", 1)) if path.name.startswith("imu") else path
        wheel_file = drives if drives != path and drives.is_file() else None
        run = vibration_stream(path, wheel_file, digest, problems)
        return Recording(name, path, vehicle, None, "", digest.hexdigest(), problems=tuple(problems), vibration=run)
    if vehicle is None:
        vehicle = _beside(path)
    table, found = read_wheel(path)
    problems += found
    digest.add_columns("wheel", {**table.columns, "wheel": table.wheel, "run": table.run})
    if vehicle is not None:
        table = derive_all(table, vehicle)
    pose, found = pose_from_wheel(table, vehicle)
    problems += found
    return Recording(
        name, path, vehicle, None, "", digest.hexdigest(), wheel=table, pose=pose, problems=tuple(problems)
    )


def _is_vibration(path: Path) -> bool:
    """Tell a vibration file by its time without a wheel channel, a misspelt one included."""
    table = read_table(path)
    names = {*table.numbers, *table.text}
    channels = names - {"time", "time_s"}
    return channels != names and len(table.numbers) > 1 and not any(map(is_wheel_channel, channels))
