"""`LiveTraverse`: the main job while the vehicle drives."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike

from ...database.snapshot import Snapshot
from ...database.store import TerrainDatabase
from ..conditions import Conditions, url_of
from ..core.arguments import number, path_of, refused
from ..core.errors import InputError
from ..core.origin import Offset, Origin
from ..core.recording.bag_vibration import NAMES
from ..core.recording.types import Recording
from ..core.vehicle import Vehicle, as_vehicle
from ..default_models import Models, ModelsGiven, find_models
from ..fusion import Belief
from ..segments import CELL_SIZE_M
from ..summary import TraverseSummary
from .drive import LiveDrive, drive_like, new_drive
from .ground import FARTHEST_M, UnderWheels
from .intake import IMAGE, SOUND
from .log import IMU, POSE, WHEEL
from .now import Trust
from .samples import finite, image_of, sound_of, wheel_row
from .soil import SoilByNow
from .watch import Subscriber

HORIZON_S = 0.02
"""Samples may come so much later than others that were taken after them, unless stated [s]."""


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
    resume
        The journal of a drive that was cut off (`unfinished`), to go on with it; the other arguments as then.
    shared_speed
        Whether the wheels' ``travel_speed_m_s`` is that of the vehicle's reference point, as odometry gives it.

    Raises
    ------
    InputError
        The vehicle, a model, the database or the journal cannot be used.
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
        resume: str | Path | None = None,
        shared_speed: bool = False,
    ):
        new = new_drive(name, as_vehicle(vehicle), start_time, site, shared_speed=shared_speed)
        self._begin(new, database, models, cell_size_m, site or None, origin, offset, horizon_s, lossless, resume)

    @classmethod
    def like(
        cls,
        recording: Recording,
        database: TerrainDatabase | str | Path,
        *,
        models: Models | ModelsGiven = None,
        cell_size_m: float = CELL_SIZE_M,
        site: str | None = None,
        origin: Origin | None = None,
        offset: Offset | None = None,
        horizon_s: float = HORIZON_S,
        lossless: bool = False,
        resume: str | Path | None = None,
    ) -> LiveTraverse:
        """Begin a drive of which a recording says the rest: name, vehicle, time, site, frame and remarks.

        Parameters
        ----------
        recording
            Of which no samples are taken.
        database, models, cell_size_m, site, origin, offset
            As in `run_traverse`.
        horizon_s, lossless, resume
            As above.

        Raises
        ------
        InputError
            As above, and where nobody described the vehicle.
        """
        if recording.vehicle is None:
            raise InputError(recording.source, "nobody describes the vehicle", expected="its vehicle.toml")
        live = cls.__new__(cls)
        live._begin(
            drive_like(recording), database, models, cell_size_m, site, origin, offset, horizon_s, lossless, resume
        )
        return live

    def _begin(
        self, new: Recording, database: TerrainDatabase | str | Path, models: Models | ModelsGiven, cell_size_m: float,
        site: str | None, origin: Origin | None, offset: Offset | None, horizon_s: float, lossless: bool,
        resume: str | Path | None,
    ) -> None:  # fmt: skip
        assert new.vehicle is not None
        self._vehicle = new.vehicle
        conditions = Conditions.of(
            database, vehicle=self._vehicle, cell_size_m=cell_size_m, site=site, origin=origin, offset=offset
        )
        left = None if resume is None else path_of("resume", resume, "the path of a journal")
        if not isinstance(models, Models):
            models = find_models(models, url_of(database), synthetic=new.synthetic)
        horizon_s = number("horizon_s", horizon_s, "a time, not negative [s]")
        if not 0.0 <= horizon_s < math.inf:
            raise refused("horizon_s", horizon_s, "a time, not negative [s]")
        self._drive = LiveDrive(database, conditions, new, models, horizon_s, lossless, left)

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle."""
        return self._vehicle

    @property
    def journal(self) -> Path:
        """The file that holds what a power cut leaves of the drive; it goes when the drive is stored."""
        return self._drive.journal.path

    @property
    def needed_s(self) -> float:
        """Of a drive that is resumed: samples from this time on, by the drive's clock, are taken once more, where the
        caller has them [s].
        """
        return self._drive.needed_s

    @property
    def clock_s(self) -> float:
        """Time of the newest sample [s]; minus infinity before the first."""
        return self._drive.intake.clock_s

    def __enter__(self) -> LiveTraverse:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._drive.end(to_be_resumed=True)
        elif not self._drive.is_stored:  # the block may have closed it, for its summary
            self.close()

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
        with self._drive.intake.changed:
            known = self._drive.intake.sound.rate or rate
        if known != rate:
            raise InputError("sound", f"{rate} Hz", expected=f"{known} Hz, as before")
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
        self._drive.started(time_s)
        self._drive.intake.put(stream, time_s, sample)

    def place(self) -> tuple[float, float, float, float] | None:
        """Give time [s], x, y [m] and heading [rad] of the last pose; None before the second one."""
        return self._drive.now.place()

    def ahead(self, length_m: float = 5.0, width_m: float = 2.0) -> Belief:
        """Give what is believed by now of the ground ahead: of the cells of a strip that begins at the last pose.

        Parameters
        ----------
        length_m, width_m
            Of the strip [m], up to `ground.FARTHEST_M`.

        Raises
        ------
        InputError
            One of them is no such length.
        """
        for name, value in (("length_m", length_m), ("width_m", width_m)):
            expected = f"a length above 0 and up to {FARTHEST_M:g} m"
            if not 0.0 < number(name, value, expected) <= FARTHEST_M:
                raise refused(name, value, expected)
        return self._drive.now.ahead(length_m, width_m)

    def under_wheels(self) -> UnderWheels | None:
        """Give the ground under the wheels by now; None before a cell's length of the way was driven."""
        return self._drive.now.under_wheels()

    def trust(self) -> dict[str, Trust]:
        """Say how far each sense that is at work is trusted by now and why not, by its name."""
        return self._drive.now.trust()

    def soil(self) -> SoilByNow | None:
        """Give the soil of the stretch in progress by now, and what driving would determine it better.

        None before the first sample of a wheel. The estimate rests on the last `soil.WINDOW` samples; that of the whole
        stretch is made when the drive is closed.
        """
        return self._drive.now.soil()

    def snapshot(self) -> Snapshot:
        """Give the planner's view of the site: what was stored when the drive began, and what it has seen by now.

        Soils are those that were stored, and those of the drive's stretches that are complete: where the ground has
        changed, or after 50 s. A cell is as it was believed to be when it was last seen.
        """
        return self._drive.now.snapshot()

    def subscribe(self, subscriber: Subscriber) -> None:
        """Have a function called with each event from now on: `GroundChanged`, `SensesContradict`, `SoilDeparts` or
        `Trouble` of `bevameter.framework.live.events`. It is called in a thread of the drive, and should return soon.
        """
        self._drive.now.subscribe(subscriber)

    @property
    def problems(self) -> tuple[str, ...]:
        """What of the samples was left out by now, what failed, and drives that were cut off and wait to be resumed."""
        return self._drive.problems

    def close(self, digest: str | None = None) -> TraverseSummary:
        """End the drive, identify its soil, and store it in one transaction.

        Where the database cannot be written the drive stays in its journal: `close` can be called again, now, or after
        the drive was resumed.

        Parameters
        ----------
        digest
            That of the recording of the same drive (`Recording.digest`), if there is one: then `run_traverse` on it
            finds this drive in the database.

        Raises
        ------
        InputError
            No sample came, the drive was stored before, or the database cannot be written.
        """
        return self._drive.close(digest)
