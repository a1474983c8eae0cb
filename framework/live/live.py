"""`LiveTraverse`: the main job while the vehicle drives."""

from __future__ import annotations

import secrets
import threading
import time
from contextlib import nullcontext
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from ...database.observations import Drive, TerrainObservations
from ...database.snapshot import Snapshot
from ...database.store import TerrainDatabase
from ..conditions import METHOD, Conditions, url_of
from ..core.arguments import number
from ..core.errors import InputError
from ..core.origin import Offset, Origin
from ..core.recording.bag_vibration import NAMES
from ..core.recording.types import Pose, Recording
from ..core.vehicle import Vehicle, as_vehicle
from ..default_models import Models, ModelsGiven, find_models
from ..engine import begin, conclude
from ..fusion import Belief
from ..placement import Claim, Frames
from ..segments import CELL_SIZE_M
from ..sense_map import SenseRecord, begin_observing, observe
from ..senses import sense_named
from ..summary import TraverseSummary
from ..traverse import store
from .ground import UnderWheels
from .intake import IMAGE, SOUND, Intake
from .log import IMU, POSE, WHEEL, Taken
from .now import Now, Trust
from .observing import Observing, faults
from .samples import finite, image_of, sound_of, wheel_row
from .soil import SoilByNow
from .streams import SOURCE
from .watch import Subscriber

HORIZON_S = 0.05
"""Samples may come so much later than others that were taken after them, unless stated [s]."""

_SOMEWHERE = Pose(*np.zeros((4, 1)))
"""Stands for places that will come."""


class LiveTraverse:
    """Turns a drive into observations of terrain and soil while it goes on; thread-safe.

    Samples of each sensor are handed over as they come, with times [s] on one clock. It is the engine of
    `run_traverse`: a recording that is handed over sample by sample gives the same observations, but for what later
    times say of the places (`docs/live.md`).

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
        self._began = time.monotonic()
        self._database, self._vehicle = database, as_vehicle(vehicle)
        self._conditions = Conditions.of(
            database, vehicle=self._vehicle, cell_size_m=cell_size_m, site=site or None, origin=origin, offset=offset
        )
        drive = Recording(name, SOURCE, self._vehicle, start_time, site, secrets.token_hex(32), pose=_SOMEWHERE)
        claim = Claim.of(self._conditions.stated(drive))
        assert claim is not None
        self._placement = Frames(self._conditions.frames).place(claim)
        if not isinstance(models, Models):
            models = find_models(models, url_of(database), synthetic=drive.synthetic)
        self._models = models
        self._intake = Intake(number("horizon_s", horizon_s, "a time [s]"), lossless, self._placement.offset)
        self._recording = replace(drive, camera=self._intake.camera, sound=self._intake.sound)
        self._sound_rate: int | None = None
        self._closing = threading.Lock()
        self._is_closed = False
        self._blas = threadpool_limits(1)  # the senses' threads fill the cores by themselves
        self._observing = self._begin_observing()
        self._now = self._begin_now()

    def _begin_observing(self) -> dict[str, Observing]:
        """Have the senses that observe streams begin; the others observe the whole drive when it is closed."""
        jobs = begin_observing(
            self._recording, self._intake.track, self._models.classifiers, self._conditions.cell_size_m
        )
        begun = {record.name: Observing(record, given) for record, given in jobs if given is not None}
        self._intake.camera.is_used, self._intake.sound.is_used = "vision" in begun, "audio" in begun
        for each in begun.values():
            each.begin()
        return begun

    def _begin_now(self) -> Now:
        own, placed = self._recording, self._placement
        drive = Drive(
            own.digest, own.name, placed.site, self._vehicle.name, own.start_time, {}, METHOD,
            TerrainObservations.nothing(self._conditions.cell_size_m), origin=placed.origin, offset=placed.offset,
        )  # fmt: skip
        used = (self._models.classifiers[name] for name in self._observing)
        classes = tuple(sorted({name for model in used for name in model.classes}))
        given = self._database
        with nullcontext(given) if isinstance(given, TerrainDatabase) else TerrainDatabase(given) as opened:
            return Now(self._intake, self._observing, self._vehicle, opened, drive, classes)

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
        row = tuple(finite("pose", each, value) for each, value in (("x", x), ("y", y), ("yaw", yaw)))
        self._put(POSE, finite("pose", "t", t), row)

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
        self._put(IMAGE, finite("image", "t", t), (None if frame is None else image_of(frame), problem))

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
        samples, rate = sound_of(block, sample_rate_Hz)
        with self._intake.changed:
            self._sound_rate = self._sound_rate or rate
        if self._sound_rate != rate:
            raise InputError("sound", f"{rate} Hz", expected=f"{self._sound_rate} Hz, as before")
        self._put(SOUND, finite("sound", "t", t), (samples, rate))

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
        self._put(IMU, finite("imu", "t", t), tuple(finite("imu", name, value) for name, value in values))

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
        self._put(WHEEL, finite("wheel", "t", t), wheel_row(self._vehicle, wheel, channels))

    def _put(self, stream: str, time_s: float, sample: object) -> None:
        if self._recording.start_time is None:
            self._recording = replace(self._recording, start_time=_start_time(time_s))
        self._intake.put(stream, time_s, sample)

    def ahead(self, length_m: float = 5.0, width_m: float = 2.0) -> Belief:
        """Give what is believed by now of the ground ahead: of the cells of a strip that begins at the last pose.

        Parameters
        ----------
        length_m, width_m
            Of the strip [m].
        """
        return self._now.ahead(length_m, width_m)

    def under_wheels(self) -> UnderWheels | None:
        """Give the ground under the wheels by now; None before a cell's length of the way was driven."""
        return self._now.under_wheels()

    def trust(self) -> dict[str, Trust]:
        """Say how far each sense that is at work is trusted by now and why not, by its name."""
        return self._now.trust()

    def soil(self) -> SoilByNow | None:
        """Give the soil of the stretch in progress by now, and what driving would determine it better.

        None before the first sample of a wheel. The estimate rests on the last `soil.WINDOW` samples; that of the whole
        stretch is made when the drive is closed.
        """
        return self._now.soil()

    def snapshot(self) -> Snapshot:
        """Give the planner's view of the site: what was stored when the drive began, and what it has seen by now.

        Soils are those that were stored. A cell is as it was believed to be when it was last seen.
        """
        return self._now.snapshot()

    def subscribe(self, subscriber: Subscriber) -> None:
        """Have a function called with each event from now on: `GroundChanged`, `SensesContradict`, `SoilDeparts` or
        `Trouble` of `bevameter.framework.live.events`. It is called in a thread of the drive, and should return soon.
        """
        self._now.subscribe(subscriber)

    @property
    def problems(self) -> tuple[str, ...]:
        """What of the samples was left out by now, and what failed."""
        return (*self._intake.problems, *faults(tuple(self._observing.values())), *self._now.problems)

    def _end(self) -> bool:
        """Give on all that waits, and wait until it was observed; False where that was done before."""
        with self._closing:
            if self._is_closed:
                return False
            self._is_closed = True
            self._intake.end()
            for each in self._observing.values():
                each.end()
            self._now.end()
            self._blas.restore_original_limits()
            return True

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
            The drive was closed before, or the database cannot be written.
        """
        if not self._end():
            raise InputError("LiveTraverse", "closed before", expected="a drive that goes on")
        begun = begin(
            self._made(digest), self._conditions, lambda senses, synthetic: self._models.of(senses),
            lambda claim: self._placement,
        )  # fmt: skip
        done = dict[str, SenseRecord]()
        if begun.track is not None:
            done = {
                name: each.concluded(begun.recording, begun.track, begun.cell_size_m)
                for name, each in self._observing.items()
            }
        rest = {name: each for name, each in begun.models.classifiers.items() if name not in done}
        records = observe(begun.recording, begun.track, rest, begun.cell_size_m)
        records = tuple(_said(done.get(record.name, record), begun.recording) for record in records)
        return store(conclude(begun, records, self._began, lambda stage, share: None), self._database)

    def _made(self, digest: str | None) -> Recording:
        """Give the recording that the samples made."""
        own, log = self._intake, self._intake.log
        log.cut()
        wheel = log.wheel(self._vehicle)
        vibration, problems = log.vibration(wheel)
        taken = Taken(own.camera.count, own.sound.duration_s, self._sound_rate or 1)
        return replace(
            self._recording, digest=digest or self._recording.digest, wheel=wheel, pose=log.pose(),
            vibration=vibration, camera=taken if taken.images else None, sound=taken if taken.sound_s else None,
            problems=(*problems, *self.problems),
        )  # fmt: skip


def _said(record: SenseRecord, recording: Recording) -> SenseRecord:
    """Give a record the reason why the sense was absent, if nothing came for it."""
    absent = sense_named(record.name).absence(recording)
    return replace(record, absent=absent) if absent else record


def _start_time(time_s: float) -> datetime | None:
    """When second 0 was, where it is `time_s` [s] now by this computer's clock; None where that is no time."""
    try:
        return datetime.now(UTC) - timedelta(seconds=time_s)
    except OverflowError:
        return None
