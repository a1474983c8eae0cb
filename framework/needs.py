"""What a class map, an estimate of the soil and an explanation need of a recording, what of it is there, and what mends
the rest.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..identification.estimate.estimate import usable
from ..identification.estimate.identify import measured_rows
from ..identification.explain.samples import LEAST_ROWS
from ..identification.rows.gate import GRAVITY_M_S2, LIMITS
from ..identification.rows.geometry import by_geometry
from ..identification.rows.motor import with_torque
from ..identification.rows.select import SelectedRows, as_trials, select_wheel_rows
from ..identification.rows.travel import with_travel_speed
from ..identification.rows.weight import with_loads, with_pull
from ..identification.rows.words import sentence
from .core.classifier.shipped import shipped_models
from .core.errors import InputError
from .core.recording.types import Pose, Recording, WheelTable
from .core.recording.vehicle_text import has_wheels
from .core.recording.wheel_file import derive_all
from .core.track.way import RECORDED, track_of
from .core.vehicle import Vehicle
from .senses import senses

_ANSWERS = ("torque_Nm", "drawbar_pull_N", "sinkage_m")
_SAID_REASONS = 3


@dataclass(frozen=True)
class Missing:
    """Something that a recording or its vehicle lacks, and what mends that: a command, a line of TOML, or a sensor."""

    what: str
    mend: str


@dataclass(frozen=True)
class Answer:
    """Whether a recording serves a purpose, why, what is missing, and what to mind."""

    possible: bool
    because: str
    missing: tuple[Missing, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Mends:
    """What mends what is missing, in words that fit the kind of recording.

    Parameters
    ----------
    map_name
        ``topics.toml`` of a bag, ``columns.toml`` of a table, or empty.
    write
        The command that writes a vehicle file to complete; empty where there is one.
    intrinsics
        Whether the recording states the camera's matrix.
    """

    map_name: str
    write: str
    intrinsics: bool = False

    def stream(self, name: str, otherwise: str) -> str:
        """Say how a stream is named."""
        return f'in topics.toml: [{name}] topic = "..."' if self.map_name == "topics.toml" else otherwise

    def channel(self, name: str, sensor: str) -> str:
        """Say how a channel of the wheel is named, or which sensor has it."""
        if self.map_name == "topics.toml":
            return f'in topics.toml: [[wheel]] topic = "..." fields = {{ {name} = "..." }}; else {sensor}'
        wheels = ", or [wheels.NAME] where each wheel has columns of its own"
        return f'in columns.toml: [columns] {name} = {{ column = "...", unit = "..." }}{wheels}; else {sensor}'

    def vehicle(self, line: str) -> str:
        """Say what is to be stated in the vehicle file."""
        return f"{line} in vehicle.toml" + (f", which `{self.write}` writes" if self.write else "")


def class_map(recording: Recording, mends: Mends) -> Answer:
    """Say whether `run` can put classes of ground on a map, by the models that come with the package."""
    missing, able, own = list[Missing](), list[str](), list[Missing]()
    ground, shipped = "synthetic" if recording.synthetic else "real", shipped_models()
    for sense in senses():
        model, reason = shipped.get(f"{sense.name}-{ground}"), sense.absence(recording)
        if not reason and model is not None and model.default:
            able.append(sense.instrument)
        elif not reason:
            train = f"bevameter train {sense.name} LABELLED --out MODELS/{sense.name}.skops, then run --models MODELS"
            own.append(Missing(f"a model of your own for the {sense.instrument}", train))
        elif sense.recorded(recording):
            geometry = "height_m and pitch_rad under [camera_mount]"
            if not mends.intrinsics:
                geometry = "matrix, width_px and height_px (calibrate: OpenCV), height_m and pitch_rad under [camera]"
            missing.append(Missing(f"{sense.instrument}: {reason}", mends.vehicle(geometry)))
    if not (able or missing):
        folder = "record images in camera/ with camera.csv"
        missing += [Missing("images of the ground ahead", mends.stream("camera", folder)), *own]
    if lost := _places_missing(recording, mends):
        missing.append(lost)
    if not able or lost:
        return Answer(False, _lacking(missing), tuple(missing))
    more = tuple(f"{each.what} would be used, too: {each.mend}" for each in own)
    return Answer(
        True, f"{_names([*able, 'places'])} are there", tuple(missing),
        ("`bevameter models` says what the models of the package know, and how well. For your own ground: "
         "bevameter train vision PHOTOS --out MODELS/vision.skops, then run --models MODELS", *more),
    )  # fmt: skip


def _places_missing(recording: Recording, mends: Mends) -> Missing | None:
    try:
        track = track_of(recording)
    except InputError as error:
        return Missing(f"places of the vehicle that do not jump: {error}", "another topic or file of poses")
    if track is not None and track.origin == RECORDED:
        return None
    return Missing("places of the vehicle", mends.stream("pose", "pose.csv, or columns x_m and y_m of the wheel"))


def soil(recording: Recording, mends: Mends) -> Answer:
    """Say whether `identify` can estimate cohesion and friction angle."""
    missing = tuple(_missing_of_wheels(recording, mends))
    if missing:
        return Answer(False, _lacking(missing), missing)
    try:
        parts = by_geometry(recording)
        rows = max((as_trials(select_wheel_rows(part)) for part in parts), key=lambda each: each.used)
    except InputError as error:
        return _refused(error)
    notes = tuple(map(sentence, rows.findings))
    stretches = rows.stretches()
    chosen = [stretch.rows for stretch in stretches if not stretch.reason]
    if not chosen:
        counts = Counter(str(reason) for reason in rows.reasons if reason)
        for stretch in stretches:
            if stretch.reason not in counts:
                counts[stretch.reason] += len(stretch.rows)
        mends_of_rows = tuple(dict.fromkeys(_mend_of(reason, rows) for reason, _ in counts.most_common(_SAID_REASONS)))
        return Answer(False, f"no row can be used: {_most(counts)}", mends_of_rows, notes)
    try:
        usable(measured_rows(rows, max(chosen, key=len)))
    except InputError as error:
        return _refused(error, notes)
    used = sum(map(len, chosen))
    if any(each.code == "load_without_slope" for each in rows.findings):
        slope = mends.stream("attitude", "a column pitch_rad")
        return Answer(
            False, "it lacks the slope: the load is computed, and c and phi are not determined without it",
            (Missing("the slope", f"{slope}, of an inertial sensor with an orientation"),), notes,
        )  # fmt: skip
    better = _missing_torque(recording.wheel, recording.vehicle)
    if not (better or rows.table.observed("torque_Nm").size):
        sensor = "current_A so, with [motor] in vehicle.toml; else record an effort or a current"
        better = (Missing("torque, which says most of cohesion and friction", mends.channel("torque_Nm", sensor)),)
    counts = Counter(str(reason) for reason in rows.reasons if reason)
    there = [name for name in ("load_N", *_ANSWERS, "slip") if rows.table.observed(name).size]
    text = f"{used} of {len(rows.reasons)} wheel rows can be used, with {_names(there)}"
    return Answer(True, text + (f"; not used: {_most(counts)}" if counts else ""), better, notes)


def _refused(error: InputError, notes: tuple[str, ...] = ()) -> Answer:
    return Answer(False, str(error), (Missing(error.problem, f"expected: {error.expected}"),), notes)


def explain(recording: Recording, mends: Mends, soil: Answer) -> Answer:
    """Say whether `explain` has rows to compare with the simulation; `soil` is the answer about these rows."""
    missing = tuple(_missing_of_wheels(recording, mends))
    if missing:
        return Answer(False, soil.because, missing)
    try:
        table = select_wheel_rows(recording).table
    except InputError as error:
        return _refused(error)
    there = [name for name in _ANSWERS if table.observed(name).size]
    answered = np.isfinite(np.column_stack([table[name] for name in there])).any(axis=1)
    n = int((answered & np.isfinite(table["load_N"]) & np.isfinite(table["slip"])).sum())
    if n < LEAST_ROWS:
        return Answer(False, f"{n} rows with load, slip and an answer, expected at least {LEAST_ROWS}")
    return Answer(True, f"{_names(there)} of {n} rows can be compared with the simulation")


def _missing_of_wheels(recording: Recording, mends: Mends) -> Iterator[Missing]:
    """Name all at once that a wheel's rows lack to be compared with a soil, so far as channels say it."""
    table, vehicle = recording.wheel, recording.vehicle
    if table is None or not has_wheels(table):
        yield Missing("wheel channels", mends.channel("wheel_speed_rad_s", "record the wheels' speed, torque, load"))
        return
    described = vehicle is not None and bool(vehicle.wheels)
    if not described and not {"radius_m", "width_m"} <= set(table.columns):
        yield Missing("the wheel's geometry", mends.vehicle("radius_m and width_m under [wheel] or [[wheels]]"))
    if described and vehicle is not None and table.wheel is None and len(vehicle.wheels) > 1:
        names = ", ".join(wheel.name for wheel in vehicle.wheels)
        yield Missing("the name of each row's wheel", mends.channel("wheel", f"one of {names} in a column wheel"))
        return
    made = _with_computed(table, vehicle, recording.pose) if vehicle is not None and described else table
    if not made.observed("load_N").size:
        line = "mass_kg and centre_of_mass_m, with position_m of the wheels,"
        if table.wheel is None or (vehicle is not None and len(vehicle.wheels) == 1):
            line = "load_N of the wheel"
        yield Missing("load", mends.vehicle(line))
    if not made.observed("slip").size:
        yield from _missing_for_slip(made, mends, described=described, placed=recording.pose is not None)
    if not any(made.observed(name).size for name in _ANSWERS):
        sensor = "current_A so, with [motor] in vehicle.toml; else record an effort, a current, a pull or a sinkage"
        other = Missing("torque, drawbar pull or sinkage", mends.channel("torque_Nm", sensor))
        yield from _missing_torque(table, vehicle) or (other,)


def _missing_torque(table: WheelTable | None, vehicle: Vehicle | None) -> tuple[Missing, ...]:
    """Say how the motors' current makes a torque, where it is there, and no torque."""
    if table is None or table.observed("torque_Nm").size or not table.observed("current_A").size:
        return ()
    if vehicle is not None and vehicle.motor is not None:
        return ()
    return (
        Missing("torque, though the motors' current is there", "[motor] torque_constant_Nm_A = ... in vehicle.toml"),
    )


def _missing_for_slip(table: WheelTable, mends: Mends, *, described: bool, placed: bool) -> Iterator[Missing]:
    """Name the speeds that lack; where there are poses, and no radius yet, they may show the travel speed."""
    if not table.observed("wheel_speed_rad_s").size:
        yield Missing("the wheels' speed", mends.channel("wheel_speed_rad_s", "wheel_angle_rad so, of an encoder"))
    if not table.observed("travel_speed_m_s").size:
        if placed and not described:
            return
        sensor = "record visual or lidar odometry, or a receiver's speed: one made from the wheels gives no slip"
        yield Missing("a travel speed of its own, for slip", mends.channel("travel_speed_m_s", sensor))
    elif table.observed("wheel_speed_rad_s").size and described:
        against = float(np.nanmedian(table["wheel_speed_rad_s"] * table["travel_speed_m_s"])) < 0.0
        why = "the wheels turn against the travel speed: one of the two has the other sign"
        still = "the wheels or the vehicle stand still throughout"
        yield Missing("slip", f"speeds at which the wheels turn and the vehicle moves: {why if against else still}")


def _with_computed(table: WheelTable, vehicle: Vehicle, pose: Pose | None) -> WheelTable:
    """Add torque, speed, slip, load and pull as far as they are computed where they are not sensed."""
    try:
        table, _ = with_torque(table, vehicle)
        table, vehicle, placed = with_travel_speed(table, vehicle, pose)
        table = table if placed is None else derive_all(table, vehicle)
        table, vehicle, weighed = with_loads(table, vehicle, pose)
        return table if weighed is None else with_pull(table, vehicle)[0]
    except InputError:
        return table  # rows of a wheel that the vehicle does not have: what selects the rows says it


_MENDS = {
    "at standstill": Missing("a wheel that moves", "rows in which the wheel turns, and the vehicle moves"),
    "slip was": Missing("slip in the rows", "slip, or both speeds, where load, torque or sinkage are recorded"),
    "neither load nor": Missing("load in the rows", "load_N where slip is recorded"),
    "fewer than three": Missing(
        "a third channel", "torque_Nm, sinkage_m or drawbar_pull_N in addition to load_N and slip"
    ),
    "not straight": Missing("straight driving", "rows with a slip angle within 2 deg"),
    "in the rut": Missing("fresh ground", "wheels that run in no earlier rut (pass 1)"),
    "rolling backwards": Missing("driving forwards", "rows in which it drives forwards, or the other sign"),
    "braked": Missing("a driven wheel", "rows with slip above 0; if these are driven, the sign of slip is turned"),
    "digging in": Missing("less slip", "rows with slip below 0.95"),
    "ground too hard": Missing("ground that yields", "softer ground or more load; or another unit of sinkage_m"),
    "wheel buried": Missing("a wheel that is not buried", "less load or slip; or another unit of sinkage_m"),
}
"""What mends rows that are not used, by the beginning of the reason."""


def _mend_of(reason: str, rows: SelectedRows) -> Missing:
    slow = Missing("slow, steady driving", _slow(rows))
    return next((mend for beginning, mend in _MENDS.items() if reason.startswith(beginning)), slow)


def _slow(rows: SelectedRows) -> str:
    fastest = LIMITS.froude * math.sqrt(GRAVITY_M_S2 * rows.wheel.radius_m)
    return f"drive 5 s or more at a time below {fastest:.2f} m/s, steadily and straight ahead, on ground that yields"


def _most(counts: Counter[str]) -> str:
    """Say why most rows are not used, by their numbers."""
    said = [f"{count} {reason}" for reason, count in counts.most_common(_SAID_REASONS)]
    return ", ".join(said) + (" and others" if len(counts) > _SAID_REASONS else "")


def _lacking(missing: Iterable[Missing]) -> str:
    return f"it lacks {_names(each.what for each in missing)}"


def _names(parts: Iterable[str]) -> str:
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last
