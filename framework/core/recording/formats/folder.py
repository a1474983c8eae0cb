"""A recording that is a folder (CONTRACTS.md, "A recording").

`recording.toml` is optional, and so is each of its keys (``docs/recording.md`` shows them); a stream that it does not
mention is read if its file is there, one that it lists must be there. Keys of somebody else's are left out, which
`problems` says.
"""

from __future__ import annotations

import difflib
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, AliasChoices, BeforeValidator, Field

from ...errors import InputError
from ...files import inside, load_toml
from ...models import FileModel, Finite, StatedOffset, StatedOrigin, checked
from ...track.way import pose_from_wheel
from ...vehicle import Vehicle, load_vehicle
from ..camera import BitDepth, read_camera
from ..contents import Contents, Source, contents_of, streams_of
from ..digest import StreamDigest
from ..poses_and_labels import read_labels, read_pose
from ..readers import Reader, register
from ..sheet import ENDINGS
from ..sound import SoundFileStream
from ..table_contents import inspect_table
from ..types import Recording
from ..vehicle_text import vehicle_text
from ..vibration import of_wheels, read_vibration_run
from ..wheel_file import derive_all, read_wheel
from .bag import BagReader

_SLIP = 0.82
"""How like one of ours, by difflib's ratio, a key is that was meant to be it [-]: `start_tiem` is, `state` is not."""

_TABLE_KINDS = (".csv", ".csv.gz", ".parquet")
_STREAMS = {
    "wheel": tuple("wheel" + kind for kind in ENDINGS),
    "camera": ("camera",),
    "sound": ("sound.wav", "sound.flac", "sound.ogg", "sound.mp3"),
    "pose": tuple("pose" + kind for kind in _TABLE_KINDS),
    "labels": ("labels.csv",),
    "vibration": tuple("vibration" + kind for kind in _TABLE_KINDS),
}


class _File(FileModel):
    file: str | None = None


class _Camera(FileModel):
    folder: str | None = None
    bit_depth: BitDepth | None = None


class _Sound(_File):
    start_s: Finite = 0.0


class _Vibration(_File):
    wheel_file: str | None = None


def _no_number(time: object) -> object:
    """Refuse a number for a date, which would be taken for seconds since 1970."""
    if isinstance(time, int | float):
        raise ValueError("a number, expected a date and a time")
    return time


def _with_zone(time: datetime) -> datetime:
    """Take a time that names no offset for UTC; refuse one that UTC has no year for, in which databases keep it."""
    time = time if time.tzinfo is not None else time.replace(tzinfo=UTC)
    try:
        time.astimezone(UTC)
    except OverflowError:
        raise ValueError(f"{time}, expected a time within the years 1 to 9999 of UTC") from None
    return time


class About(FileModel):
    """What `recording.toml` says."""

    name: str | None = None
    start_time: Annotated[
        Annotated[datetime, AfterValidator(_with_zone)] | None,
        BeforeValidator(_no_number),
        Field(validation_alias=AliasChoices("start_time", "start")),
    ] = None
    site: str = ""
    frame: str = ""
    origin: StatedOrigin | None = None
    offset: StatedOffset | None = None
    notes: str = ""
    streams: tuple[Literal["wheel", "camera", "sound", "pose", "labels", "vibration"], ...] = ()
    wheel: _File | None = None
    camera: _Camera | None = None
    sound: _Sound | None = None
    pose: _File | None = None
    labels: _File | None = None
    vibration: _Vibration | None = None


@register
class FolderReader(Reader):
    """Reads a recording's folder: tables into memory, camera and sound as streams."""

    kinds = "a recording's folder"
    takes_topics = True

    def sniff(self, path: Path) -> bool:
        """Recognise a folder; those that are bags have their own reader."""
        return path.is_dir() and not BagReader().sniff(path)

    def read(self, path: Path, *, vehicle: Vehicle | None, topics: Path | None) -> Recording:
        """Read the folder; `digest` covers its streams, in whichever of the formats they are stored.

        Raises
        ------
        InputError
            No stream is there, a listed one is missing, or one is at fault.
        """
        about, problems = _about(path)
        found = _locate(path, about)
        if topics is not None and "wheel" not in found:
            raise InputError(path, "a column map is given, and there is no wheel table", expected="wheel.csv")
        if not found:
            expected = "wheel.csv, camera/, sound.wav, pose.csv or vibration.csv"
            raise InputError(path, "no stream of a recording in it", expected=expected)
        if vehicle is None and (path / "vehicle.toml").is_file():
            vehicle = load_vehicle(path / "vehicle.toml")
        digest = StreamDigest()
        wheel = pose = camera = sound = vibration = None
        notes: tuple[str, ...] = ()
        made: tuple[str, ...] = ()
        if "wheel" in found:
            wheel, notes, made = read_wheel(found["wheel"], topics)
            problems += notes
            digest.add_wheel(wheel)
            wheel = wheel if vehicle is None else derive_all(wheel, vehicle)
        if "pose" in found:
            pose, notes = read_pose(found["pose"])
            problems += notes
            digest.add_columns("pose", vars(pose))
        elif wheel is not None:
            pose, notes = pose_from_wheel(wheel, vehicle)
            problems += notes
        if "camera" in found:
            seen_by = None if vehicle is None else vehicle.camera
            camera, notes = read_camera(found["camera"], seen_by, about.camera.bit_depth if about.camera else None)
            problems += notes
            digest.add_columns("camera", {"time_s": camera.time_s})
            for file in camera.files:
                digest.add_file("camera", file)
        if "sound" in found:
            try:
                sound = SoundFileStream(found["sound"], about.sound.start_s if about.sound else 0.0)
            except InputError as error:
                if set(found) <= {"sound", "labels"}:
                    raise
                problems.append(f"sound is left out: {error}")
            else:
                problems += sound.problems
                digest.add_numbers("sound", [sound.start_s])
                digest.add_file("sound", sound.path)
        if "vibration" in found:
            named = about.vibration.wheel_file if about.vibration else None
            drives = named and inside(path, named, path / "recording.toml", "key vibration.wheel_file")
            vibration = read_vibration_run(found["vibration"], drives)
            if not drives:
                names, values = of_wheels(wheel, vibration.time_s)
                vibration = replace(vibration, wheel_names=names, wheel=values)
            problems += vibration.problems
            digest.add_vibration(vibration)
        labels = read_labels(found["labels"]) if "labels" in found else None
        return Recording(
            about.name or path.resolve().name, path, vehicle, about.start_time, about.site, digest.hexdigest(),
            wheel, pose, labels, camera, sound, tuple(problems), vibration, made, about.origin, about.offset,
            about.frame,
        )  # fmt: skip

    def inspect(self, path: Path, *, vehicle: Vehicle | None, topics: Path | None) -> Contents:
        """Say which streams are there, and what the columns of the wheel table are."""
        about, _ = _about(path)
        found = _locate(path, about)
        if not found:
            return super().inspect(path, vehicle=vehicle, topics=topics)
        if vehicle is None and (path / "vehicle.toml").is_file():
            vehicle = load_vehicle(path / "vehicle.toml")

        def read() -> Recording:
            return self.read(path, vehicle=vehicle, topics=topics)

        columns: tuple[Source, ...] = ()
        if "wheel" in found:
            contents = inspect_table(found["wheel"], read, vehicle, topics, camera="camera" in found)
            columns = tuple(replace(each, name=f"{found['wheel'].name}: {each.name}") for each in contents.sources)
        else:
            contents = contents_of(read)
            files = {"vehicle.toml": vehicle_text(contents.recording, camera=True)} if "camera" in found else {}
            contents = replace(contents, files={} if vehicle else files)
        streams = {} if contents.recording is None else {each.name: each for each in streams_of(contents.recording)}
        others = [
            replace(streams.get(name, Source(name, name)), name=file.name)
            for name, file in found.items()
            if name != "wheel"
        ]
        return replace(contents, sources=(*columns, *others), folder=path)


def _about(folder: Path) -> tuple[About, list[str]]:
    """Read `recording.toml`, and say which of its keys are left out; one that looks like ours is a slip of the pen."""
    path = folder / "recording.toml"
    if not path.is_file():
        return About(), []
    data, known = load_toml(path), [*About.model_fields, "start"]
    others = [key for key in data if key not in known]
    for key in others:
        if close := difflib.get_close_matches(key.lower(), known, n=1, cutoff=_SLIP):
            raise InputError(path, "no such key", place=f"key {key}", expected=close[0])
        del data[key]
    if "start" in data and "start_time" in data:
        raise InputError(path, "start_time is given as well", place="key start", expected="one of them")
    problems = [f"{path.name}: {', '.join(others)} left out, nothing here reads that"] if others else []
    about = checked(About, data, path)
    if about.origin is not None and about.offset is not None:
        raise InputError(path, "origin is stated as well", place="key offset", expected="one of them")
    return about, problems


def _locate(folder: Path, about: About) -> dict[str, Path]:
    """Find the streams' files: those that `recording.toml` names, or lists, or that lie there."""
    source = folder / "recording.toml"
    found: dict[str, Path] = {}
    for stream, names in _STREAMS.items():
        part = getattr(about, stream)
        named = None if part is None else part.folder if isinstance(part, _Camera) else part.file
        if named is not None:
            path = inside(folder, named, source, f"key {stream}")
            if not path.exists():
                raise InputError(path, "no such file", expected=f"the {stream} that recording.toml names")
            found[stream] = path
            continue
        there = [folder / name for name in names if (folder / name).exists()]
        if len(there) > 1:
            raise InputError(folder, f"both {there[0].name} and {there[1].name}", expected=f"one file of {stream}")
        if there:
            found[stream] = there[0]
        elif part is not None or stream in about.streams:
            raise InputError(folder / names[0], "no such file", expected=f"the {stream} that recording.toml lists")
    return found
