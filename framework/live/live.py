"""`LiveTraverse`: the main job while the vehicle drives."""

from __future__ import annotations

import math
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from ...database.store import TerrainDatabase
from ..conditions import Conditions, url_of
from ..core.arguments import number, refused, shown
from ..core.errors import InputError
from ..core.origin import Offset, Origin
from ..core.recording.bag_vibration import NAMES
from ..core.recording.sound import MAX_CHANNELS, SAMPLE_RATES
from ..core.recording.types import WHEEL_COLUMNS, Frame, Pose, Recording
from ..core.vehicle import Vehicle, as_vehicle
from ..default_models import Models, ModelsGiven, find_models
from ..engine import begin, conclude
from ..placement import Claim, Frames, Placement
from ..segments import CELL_SIZE_M
from ..sense_map import SenseRecord, begin_observing, observe
from ..senses import senses
from ..summary import TraverseSummary
from ..traverse import store
from .log import IMU, POSE, WHEEL, Log, Taken, WheelRow
from .observing import Observing, faults
from .order import InOrder
from .streams import SOURCE, LiveCamera, LiveSound
from .track import LiveTrack

HORIZON_S = 0.05
"""Samples may come so much later than others that were taken after them, unless stated [s]."""

_IMAGE, _SOUND = "image", "sound"
_CHANNELS = frozenset((*WHEEL_COLUMNS, "yaw_rad", "roll_rad", "current_A")) - {"time_s"}


class LiveTraverse:
    """Turns a drive into observations of terrain and soil while it goes on; thread-safe.

    Samples of each sensor are handed over as they come, with times [s] on one clock. It is the engine of
    `run_traverse`: a recording that is handed over sample by sample gives the same observations, but for what the
    places of later times change. That is: where poses lie more than a second apart and the vehicle stood, or they come
    more slowly than once in 0.3 s, images in between are laid on the ground by `run_traverse` and are left out here;
    and the quality of images before the first travel speed is that of the speed by the poses.

    Parameters
    ----------
    database
        The terrain database, or its path or URL; made if missing, when the drive is closed.
    vehicle
        The vehicle, or its TOML file.
    models, cell_size_m, origin, offset
        As in `run_traverse`.
    site
        The site; a drive without one is kept apart, at a site of its own.
    name
        Of the drive, for people.
    start_time
        When second 0 of the samples' clock was; by default, as this computer's clock has it when the first sample
        comes.
    horizon_s
        A sample may come so much later than one of any sensor that was taken after it [s]; a later one is left out,
        and counted. All samples wait for so long.
    lossless
        Whether a caller who is faster than the senses has to wait, as in a replay; else the oldest of what waits for
        them is dropped, and counted.

    Raises
    ------
    InputError
        The vehicle, a model or the database cannot be used.
    """

    def __init__(
        self,
        database: TerrainDatabase | str | Path,
        vehicle: Vehicle | str | Path,
        *,
        models: Models | ModelsGiven = None,
        site: str = "",
        name: str = "live",
        start_time: datetime | None = None,
        cell_size_m: float = CELL_SIZE_M,
        origin: Origin | None = None,
        offset: Offset | None = None,
        horizon_s: float = HORIZON_S,
        lossless: bool = False,
    ):
        self._database = database
        self._vehicle = as_vehicle(vehicle)
        self._conditions = Conditions.of(
            database, vehicle=self._vehicle, cell_size_m=cell_size_m, site=site or None, origin=origin, offset=offset
        )
        self._horizon_s = number("horizon_s", horizon_s, "a time, not negative [s]")
        self._lossless = lossless
        self._began = time.monotonic()
        self._changed = threading.Condition(threading.RLock())
        self._track, self._log = LiveTrack(), Log()
        self._waiting: dict[str, InOrder[Any]] = {each: InOrder() for each in (POSE, WHEEL, IMU, _IMAGE, _SOUND)}
        self._clock_s = -math.inf
        self._sound_rate: int | None = None
        self._speed_of: str | None = None
        self._is_closed = False
        self._camera, self._sound = LiveCamera(self._changed, self._track), LiveSound(self._changed, self._track)
        self._recording = Recording(
            name, SOURCE, self._vehicle, start_time, site, secrets.token_hex(32), pose=_SOMEWHERE,
            camera=self._camera, sound=self._sound,
        )  # fmt: skip
        self._placement = self._placed()
        self._models = self._found(models)
        self._observing = self._begin_observing()

    def _placed(self) -> Placement:
        """Decide where the drive's places are put, before the first of them."""
        stated = self._conditions.stated(self._recording)
        claim = Claim.of(stated)
        assert claim is not None
        return Frames(self._conditions.frames).place(claim)

    def _found(self, models: Models | ModelsGiven) -> Models:
        if isinstance(models, Models):
            return models
        return find_models(models, url_of(self._database), synthetic=self._recording.synthetic)

    def _begin_observing(self) -> dict[str, Observing]:
        """Have the senses that observe streams begin; the others observe the whole drive when it is closed."""
        jobs = begin_observing(self._recording, self._track, self._models.classifiers, self._conditions.cell_size_m)
        begun = {record.name: Observing(record, given) for record, given in jobs if given is not None}
        self._blas = threadpool_limits(1)  # the senses' threads fill the cores by themselves
        self._camera.is_used, self._sound.is_used = "vision" in begun, "audio" in begun
        for each in begun.values():
            each.begin()
        return begun

    def __enter__(self) -> LiveTraverse:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._end()

    def pose(self, t: float, x: float, y: float, yaw: float) -> None:
        """Hand over where the vehicle's reference point is.

        Parameters
        ----------
        t
            Time [s].
        x, y, yaw
            Place [m] and heading, from the x axis leftwards [rad], in the frame that `site`, `origin` or `offset` say.

        Raises
        ------
        InputError
            One of them is no finite number, or the drive was closed.
        """
        row = tuple(_finite("pose", each, value) for each, value in (("x", x), ("y", y), ("yaw", yaw)))
        self._put(POSE, t, row)

    def image(self, t: float, frame: np.ndarray | None, *, problem: str | None = None) -> None:
        """Hand over an image.

        Parameters
        ----------
        t
            When it was taken [s].
        frame : (h, w, 3) or (h, w) uint8
            In the order blue, green, red, or grey; None where it could not be read.
        problem
            Why it could not be read.

        Raises
        ------
        InputError
            It is no image, or the drive was closed.
        """
        if frame is not None:
            image = np.asarray(frame)
            if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)):
                said = f"{image.dtype} of shape {image.shape}"
                raise InputError("image", said, expected="uint8 of shape (height, width, 3) or (height, width)")
            frame = np.array(image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2))
        self._put(_IMAGE, t, (frame, problem), self._camera.is_full)

    def sound(self, t: float, block: ArrayLike, sample_rate_Hz: float) -> None:
        """Hand over sound.

        Parameters
        ----------
        t
            Time of its first sample [s].
        block : (m,) or (m, c)
            Samples in [-1, 1], of one or several channels.
        sample_rate_Hz
            The same throughout a drive [Hz].

        Raises
        ------
        InputError
            It is no sound, or of another rate than before; or the drive was closed.
        """
        rate = number("sound", sample_rate_Hz, "a sample rate [Hz]")
        low, high = SAMPLE_RATES
        if not low <= rate <= high or rate != round(rate):
            raise InputError("sound", f"{rate:g} Hz", expected=f"a whole number from {low} to {high} Hz")
        samples = np.array(block, dtype=np.float32)
        samples = samples[:, None] if samples.ndim == 1 else samples
        if samples.ndim != 2 or samples.shape[1] > MAX_CHANNELS:
            raise InputError("sound", f"shape {np.shape(block)}", expected="samples (m,), or (m, channels)")
        with self._changed:
            self._sound_rate = self._sound_rate or round(rate)
        if self._sound_rate != rate:
            raise InputError("sound", f"{rate:g} Hz", expected=f"{self._sound_rate} Hz, as before")
        self._put(_SOUND, t, (samples, round(rate)), self._sound.is_full)

    def imu(self, t: float, *, wx: float, wy: float, wz: float, ax: float, ay: float, az: float) -> None:
        """Hand over a sample of the inertial sensor that hears the ground.

        Parameters
        ----------
        t
            Time [s].
        wx, wy, wz
            Rates of turning about its axes [rad/s].
        ax, ay, az
            Accelerations along them [m/s^2].

        Raises
        ------
        InputError
            One of them is no finite number, or the drive was closed.
        """
        values = zip(NAMES, (wx, wy, wz, ax, ay, az), strict=True)
        self._put(IMU, t, tuple(_finite("imu", name, value) for name, value in values))

    def wheel(self, t: float, *, wheel: str = "", **channels: float) -> None:
        """Hand over a sample of a wheel.

        Parameters
        ----------
        t
            Time [s].
        wheel
            Its name, where there are several.
        **channels
            By the names of a wheel table's columns: ``load_N``, ``torque_Nm``, ``sinkage_m``, ``slip`` ...; NaN or left
            out where a channel was not observed.

        Raises
        ------
        InputError
            There is no such wheel or channel, a value is no number, or the drive was closed.
        """
        names = [each.name for each in self._vehicle.wheels]
        if (wheel or len(names) > 1) and wheel not in names:
            raise InputError("wheel", shown(wheel), expected=f"one of {', '.join(names)}")
        for name, value in channels.items():
            if name not in _CHANNELS:
                raise InputError("wheel", f"channel {name}", expected=f"some of {', '.join(sorted(_CHANNELS))}")
            value = channels[name] = number(f"wheel, {name}", value, "a number")
            if math.isinf(value):
                raise InputError("wheel", f"{name} {value}", expected="a finite number, or NaN")
        self._put(WHEEL, t, WheelRow(wheel, channels))

    def _put(self, stream: str, t: float, sample: Any, is_full: Callable[[], bool] = lambda: False) -> None:
        """Take in a sample, and give on what no earlier sample is waited for any more."""
        time_s = _finite(stream, "t", t)
        with self._changed:
            while self._lossless and is_full() and not self._is_closed:
                self._changed.wait()
            if self._is_closed:
                raise InputError("LiveTraverse", "a sample after the drive was closed", expected="a new one")
            if self._recording.start_time is None:
                self._recording = replace(self._recording, start_time=_start_time(time_s))
            if self._waiting[stream].put(time_s, sample):
                self._clock_s = max(self._clock_s, time_s)
                self._give_on(self._clock_s - self._horizon_s)

    def _give_on(self, until_s: float) -> None:
        """Give on all samples up to a time [s]: what says where the vehicle was before what was observed there."""
        self._track.go_on(until_s)
        offset = self._placement.offset
        for time_s, row in self._waiting[POSE].until(until_s):
            self._log.add(POSE, time_s, row)
            x_m, y_m, yaw_rad = row
            if offset is not None:
                x_m, y_m = offset.moved(np.array(x_m), np.array(y_m))
                yaw_rad += offset.yaw_rad
            self._track.add_pose(time_s, float(x_m), float(y_m), yaw_rad)
        for time_s, row in self._waiting[WHEEL].until(until_s):
            self._log.add(WHEEL, time_s, row)
            speed = row.channels.get("travel_speed_m_s", math.nan)
            if self._speed_of is None:
                self._speed_of = row.wheel  # the first one's, as of a recorded table
            if math.isfinite(speed) and row.wheel == self._speed_of:
                self._track.add_speed(time_s, speed)
        for time_s, row in self._waiting[IMU].until(until_s):
            self._log.add(IMU, time_s, row)
        for time_s, (image, problem) in self._waiting[_IMAGE].until(until_s):
            self._camera.put(Frame(time_s, image, problem, urgent=True))
        for time_s, (samples, rate) in self._waiting[_SOUND].until(until_s):
            self._sound.put(time_s, samples, rate)
        self._changed.notify_all()

    @property
    def problems(self) -> tuple[str, ...]:
        """What of the samples was left out by now, and which senses failed."""
        late = (
            f"{each.late} samples of {stream} came more than {self._horizon_s:g} s late and were left out"
            for stream, each in self._waiting.items()
            if each.late
        )
        dropped = (
            f"{stream}: {each.dropped} of {each.count} were dropped, as they came faster than they could be processed"
            for stream, each in (("images", self._camera), ("sound blocks", self._sound))
            if each.dropped
        )
        return (*late, *dropped, *faults(tuple(self._observing.values())))

    def _end(self) -> None:
        """Give on all that waits, and wait until it was observed."""
        with self._changed:
            if self._is_closed:
                return
            self._is_closed = True
            self._track.end()
            self._give_on(math.inf)
            self._camera.end()
            self._sound.end()
            self._changed.notify_all()
        for each in self._observing.values():
            each.end()
        self._blas.restore_original_limits()

    def close(self, digest: str | None = None) -> TraverseSummary:
        """End the drive, identify its soil, and store it in one transaction.

        Parameters
        ----------
        digest
            That of the recording of the same drive (`Recording.digest`), if there is one: then `run_traverse` on it
            finds this drive in the database.

        Raises
        ------
        InputError
            Nothing came, or the database cannot be written.
        """
        self._end()
        recording = self._made(digest)
        begun = begin(recording, self._conditions, self._models_of, lambda claim: self._placement)
        records = list[SenseRecord]()
        if begun.track is not None:
            records += [
                each.concluded(begun.recording, begun.track, begun.cell_size_m) for each in self._observing.values()
            ]
        done = {record.name: record for record in records}
        rest = observe(
            begun.recording, begun.track,
            {name: each for name, each in begun.models.classifiers.items() if name not in done}, begun.cell_size_m,
        )  # fmt: skip
        records = tuple(_said(done.get(record.name, record), begun.recording) for record in rest)
        return store(conclude(begun, records, self._began, lambda stage, share: None), self._database)

    def _models_of(self, senses: Any, synthetic: bool) -> Models:
        return self._models.of(senses)

    def _made(self, digest: str | None) -> Recording:
        """Give the recording that the samples made."""
        self._log.cut()
        wheel = self._log.wheel(self._vehicle)
        vibration, problems = self._log.vibration(wheel)
        taken = Taken(self._camera.count, self._sound.duration_s, self._sound_rate or 1)
        return replace(
            self._recording, digest=digest or self._recording.digest, wheel=wheel, pose=self._log.pose(),
            vibration=vibration, camera=taken if taken.images else None, sound=taken if taken.sound_s else None,
            problems=(*problems, *self.problems),
        )  # fmt: skip


_SOMEWHERE = Pose(*np.zeros((4, 1)))
"""Stands for places that will come."""


def _finite(what: str, name: str, value: object) -> float:
    """Give a number of a sample; raises `InputError` where it is none, or not finite."""
    found = number(f"{what}, {name}", value, "a finite number")
    if not math.isfinite(found):
        raise refused(f"{what}, {name}", value, "a finite number")
    return found


def _said(record: SenseRecord, recording: Recording) -> SenseRecord:
    """Give a record the reason why the sense was absent, if nothing came for it."""
    sense = next(each for each in senses() if each.name == record.name)
    absent = sense.absence(recording)
    return replace(record, absent=absent) if absent else record


def _start_time(time_s: float) -> datetime | None:
    """When second 0 was, where it is `time_s` [s] now by this computer's clock; None where that is no time."""
    try:
        return datetime.now(UTC) - timedelta(seconds=time_s)
    except OverflowError:
        return None
