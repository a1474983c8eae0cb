"""Recordings that are bags: ROS 1, ROS 2 (SQLite, MCAP) and plain MCAP, without ROS (see `topic_map`, `bag_files`)."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..origin import Origin
from ..track.jumps import without_jumps
from ..track.way import heading_of, pose_from_wheel
from ..vehicle import Vehicle
from .bag_camera import with_camera
from .bag_files import BagFile
from .bag_gathering import Decided, Gathered, gather, sound_reader
from .bag_images import no_picture
from .bag_places import FAR_M, FIXES, MISFIT_M, UNNAMED, attitude_of, in_order, stays
from .bag_streams import BagCamera, BagSound, SoundLayout
from .bag_vibration import vibration_of
from .bag_wheel import clocks_of, follows_the_wheels, merge, with_pitch_and_roll, with_speed_of_angle
from .mirrored import about_axes, mirrored_of, with_axes_forward
from .opened_bag import OpenedBag, open_bag, take_samples
from .recognition import Recognised
from .sound_messages import SoundReader
from .types import Pose, Recording, WheelTable
from .video import BagVideo, codec_of
from .wheel_file import derive_all

_EARLIEST_NS = 946_684_800 * 10**9  # the year 2000: a clock below it counts from the computer's start
_LONGEST_SOUND_S = 7 * 86400.0  # a damaged time would make for silence without end
_MAX_SURPLUS = 0.05  # share of the time; no clock is so fast: the sample rate or number of channels is wrong


def read_bag(path: Path, *, vehicle: Vehicle | None = None, topics: Path | None = None) -> Recording:
    """Read a bag; wheel channels, poses and the times of images and sounds into memory, images and sound as streams.

    Parameters
    ----------
    path
        A ``.bag``, ``.mcap`` or ``.db3`` file, or a ROS 2 bag's folder.
    vehicle
        The vehicle.
    topics
        The topic map; None to go by the topics' names and types.

    Returns
    -------
    Recording
        Its clock starts at the first message that is used. `problems` says what was cut off, damaged or taken for
        granted.

    Raises
    ------
    InputError
        The file is no bag, nothing of it can be read, no topic is recognised, or the map does not fit it.
    """
    bag = BagFile(path)
    return read_streams(open_bag(bag, take_samples(bag), vehicle, topics), vehicle)[0]


def read_streams(opened: OpenedBag, vehicle: Vehicle | None) -> tuple[Recording, Decided]:
    """Read the streams that were recognised, and say what was decided by their messages. Raises as `read_bag` does."""
    bag, samples, known = opened.bag, opened.samples, opened.known
    path = bag.path
    unheard: list[str] = []
    heard = sound_reader(opened, unheard)
    gathered = gather(bag, known, heard)
    problems, notes = [*bag.problems, *known.assumed, *unheard, *gathered.said()], [*known.chosen]
    origin = min((time for times in gathered.times.values() for time in times), default=None)
    if origin is None:
        raise InputError(path, "no message of the streams can be read", expected="a bag with messages")
    turned = [
        channels.source.topic
        for channels in gathered.wheel
        if channels.source.topic in known.guessed_wrenches and channels.turn_load_up()
    ]
    problems += [f"{topic}: force z is negative, taken as a load with its sign turned" for topic in turned]
    pose, place = _pose(gathered, origin, known, path, problems, notes)
    wheel = _wheel(gathered, origin, known, vehicle, pose, path, problems)
    mirrored = mirrored_of(wheel, gathered.against)
    if gathered.against:
        (notes if mirrored else problems).append(about_axes(gathered.against, every=not mirrored))
    if wheel is not None and vehicle is not None and (wheel.wheel is not None or len(vehicle.wheels) == 1):
        wheel = derive_all(wheel, vehicle)
    if wheel is not None and pose is None:
        pose, found = pose_from_wheel(wheel, vehicle)
        problems += found
    camera = _camera(bag, known, samples.content, gathered, origin, problems)
    if camera is not None and known.topics.camera is not None:
        vehicle, geometry = with_camera(
            vehicle, known.topics.camera.topic, samples.topics, samples.content, gathered.frames
        )
        notes += geometry
    vibration, found = vibration_of(gathered.shaken, origin, wheel, known.topics.vibration, path)
    problems += found
    recording = Recording(
        name=known.topics.name or path.resolve().name.split(".")[0],
        source=path,
        vehicle=vehicle,
        start_time=datetime.fromtimestamp(origin / 1e9, UTC) if origin > _EARLIEST_NS else None,
        site=known.topics.site,
        digest=gathered.digest.hexdigest(),
        wheel=wheel,
        pose=pose,
        camera=camera,
        sound=_sound(bag, heard, gathered, origin, problems),
        problems=tuple(problems),
        vibration=vibration,
        origin=place,
        frame=gathered.pose_frame,
        shared_speed=any(each.source.shares_speed for each in (*gathered.wheel, *gathered.speeds)),
        notes=tuple(notes),
    )
    clocks = clocks_of([*gathered.wheel, *(each for each in gathered.speeds if each.source.topic == gathered.speed)])
    leans = _attitude(gathered, origin) is not None
    return recording, Decided(
        gathered.speed, frozenset(turned), mirrored, origin, clocks, leans, gathered.mount if leans else None
    )


def _wheel(
    gathered: Gathered, origin: int, known: Recognised, vehicle: Vehicle | None, pose: Pose | None, path: Path,
    problems: list[str],
) -> WheelTable | None:  # fmt: skip
    """Merge the wheels' channels, axes forwards, with the first travel speed that is independent of them, and with the
    attitude.
    """
    wheel, against = None, ()
    for speed in (*gathered.speeds, None):
        wheel, found = merge(
            [*gathered.wheel, *([speed] if speed else [])], origin, known.topics.max_gap_s, path
        )  # fmt: skip
        if wheel is not None:
            wheel, against = with_axes_forward(with_speed_of_angle(wheel), pose)
        follows = "" if speed is None or wheel is None else follows_the_wheels(wheel, vehicle)
        if not follows:
            problems += found
            gathered.speed = speed.source.topic if speed else ""
            break
        problems.append(
            f"{speed.source.topic if speed else ''}: not used as travel speed, for it is made from the wheels' own "
            f"({follows}): slip would be zero on any ground; record visual odometry or a satellite receiver's speed"
        )
    gathered.against = against
    if wheel is None or not gathered.attitude:
        return wheel
    return _with_attitude(wheel, gathered, origin, known)


def _with_attitude(wheel: WheelTable, gathered: Gathered, origin: int, known: Recognised) -> WheelTable:
    """Add pitch and roll of the vehicle to each row, where no wheel topic gives them."""
    found = _attitude(gathered, origin)
    return wheel if found is None else with_pitch_and_roll(wheel, *found, known.topics.max_gap_s)


def _attitude(gathered: Gathered, origin: int) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Give time [s], pitch and roll [rad], (n,); None where nothing says them, as an odometry in the plane."""
    time_s, pitch, roll = attitude_of(gathered.attitude, gathered.mount, origin)
    return (time_s, pitch, roll) if len(time_s) and (np.ptp(pitch) or np.ptp(roll)) else None


def _pose(
    gathered: Gathered, origin: int, known: Recognised, path: Path, problems: list[str], notes: list[str]
) -> tuple[Pose | None, Origin | None]:
    """Give the poses, and where on Earth their x = y = 0 lies as far as that is known."""
    fixes, stated = gathered.fixes, known.topics.pose
    pose, place = None, None
    frame = (stated.frame if stated is not None else None) or gathered.pose_frame or UNNAMED
    gathered.pose_frame = frame
    if gathered.poses:
        time = (np.array([pose[0] for pose in gathered.poses], dtype=np.int64) - origin) * 1e-9
        pose = in_order(time, np.array([pose[1:] for pose in gathered.poses]))
        if stated is not None and stated.origin is not None:
            if not stays(frame):
                raise InputError(
                    path, f"[pose] origin is stated, and the frame {frame} starts with the recording",
                    expected='`--origin` with each recording, or `frame = "map"` under [pose]',
                )  # fmt: skip
            place = stated.origin
        elif pose is not None and len(fixes) >= 2:
            place = fixes.origin_of(pose, origin)
            if place is None:
                notes.append(
                    "the satellite fixes do not say how the frame of the poses lies: the way is shorter than "
                    f"{2 * FAR_M:g} m, or does not agree with them within {MISFIT_M:g} m"
                )
    elif len(fixes) and stated is not None and stated.pose == "":
        latitude, longitude = fixes.places()
        place = stated.origin or Origin(float(latitude[0]), float(longitude[0]))
        x, y = place.from_local(*place.east_north(latitude, longitude))
        rows = np.column_stack([x, y, heading_of(x, y)])
        gathered.pose_frame = FIXES
        pose = in_order(fixes.time_s(origin), rows)
    if pose is None:
        return None, None
    if place is not None:
        notes.append(f"x = y = 0 of the places lies at {place}")
    times = pose.time_s
    pose, found = without_jumps(pose, path, lambda row: f"pose at {times[row]:.3f} s")
    problems += found
    return pose, place


def _camera(
    bag: BagFile, known: Recognised, samples: dict[str, Any], gathered: Gathered, origin: int, problems: list[str]
) -> BagCamera | BagVideo | None:
    camera = known.topics.camera
    if camera is None or not gathered.times.get(camera.topic):
        return None
    time = np.maximum.accumulate(np.array(gathered.times[camera.topic], dtype=np.int64))
    sample = samples.get(camera.topic)
    reason = no_picture(camera.topic, sample)
    try:
        codec = codec_of(sample)
    except InputError as error:
        codec, reason = None, str(error)
    if reason:
        problems.append(f"{camera.topic}: images are left out: {reason}")
        return None
    if codec is not None:
        return BagVideo(bag, camera.topic, codec, time, origin)
    return BagCamera(bag, camera.topic, time, origin, camera.bit_depth)


def _sound(
    bag: BagFile, heard: SoundReader | None, gathered: Gathered, origin: int, problems: list[str]
) -> BagSound | None:
    if heard is None or not heard.frames:
        return None
    topic, fault = heard.source.topic, heard.finish()
    if fault or not sum(heard.frames):
        if fault or not gathered.undecoded[topic]:  # else it was said why
            problems.append(f"{topic}: sound is left out: {fault or 'no sample in it'}")
        return None
    if heard.sample_rate is None:
        problems.append(f"{topic}: sound of an unknown sample rate, left out; a topic map's [sound] can give it")
        return None
    start_s = (np.array(gathered.times[topic], dtype=np.int64) - origin) * 1e-9
    layout = SoundLayout(start_s, np.array(heard.frames, dtype=np.int64), heard.sample_rate)
    stream = BagSound(bag, heard, layout)
    if stream.duration_s > _LONGEST_SOUND_S:
        problems.append(f"{topic}: its messages' times span {stream.duration_s:.0f} s, sound is left out")
        return None
    if layout.surplus_s > _MAX_SURPLUS * stream.duration_s + 1.0:
        problems.append(
            f"{topic}: sound is left out: at {heard.sample_rate} Hz and {heard.channels} channels it lasts "
            f"{layout.surplus_s:.1f} s longer than its messages' times; a topic map's [sound] can correct them"
        )
        return None
    if stream.gap_s > 0:
        problems.append(f"{topic}: {stream.gap_s:.2f} s of {stream.duration_s:.2f} s of sound are missing")
    return stream
