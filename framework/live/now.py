"""What is known by now: the ground, the senses, the soil and the site, and what is told of them."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...database.observations import Drive
from ...database.physics import ClassPhysics
from ...database.snapshot import Snapshot
from ...database.store import TerrainDatabase
from ..core.recording.types import Recording
from ..core.vehicle import Vehicle
from ..fusion import Belief
from .events import SoilDeparts, Trouble
from .ground import GroundByNow, UnderWheels, WayByNow
from .intake import IMAGE, SOUND, Intake
from .log import IMU, WheelRow
from .observing import Observing
from .site import SiteByNow
from .soil import SoilByNow, SoilWatch
from .stretches import StretchSoils
from .watch import Subscriber, Watch

SILENT_S = 1.0
"""A sensor of which nothing came for so long is taken for lost [s]."""

_STREAMS = {"vision": IMAGE, "audio": SOUND, "vibration": IMU}


@dataclass(frozen=True)
class Trust:
    """How far a sense is trusted by now.

    Parameters
    ----------
    sense
        Its instrument.
    quality
        Mean quality of what it observed last [-]; 0 where it is not trusted.
    reasons
        Why it is not trusted, or only with a reservation.
    age_s
        How long ago that was [s]; infinite where it has observed nothing.
    """

    sense: str
    quality: float
    reasons: tuple[str, ...]
    age_s: float

    @property
    def is_trusted(self) -> bool:
        """Whether it has a say."""
        return self.quality > 0.0


class Now:
    """What is known by now; threads may share it.

    Parameters
    ----------
    intake
        Where samples come in.
    observing
        The senses at work, by name.
    vehicle
        The vehicle.
    database
        The terrain database, as far as it was known when the drive began.
    drive
        The drive, without observations.
    classes
        Names that the senses may give.
    recording
        That is being made, in the frame of its site.
    physics
        What is known of the physics of classes.
    """

    def __init__(
        self, intake: Intake, observing: Mapping[str, Observing], vehicle: Vehicle, database: TerrainDatabase,
        drive: Drive, classes: tuple[str, ...], recording: Recording, physics: Sequence[ClassPhysics],
    ):  # fmt: skip
        self._intake, self._observing = intake, observing
        size = drive.terrain.cell_size_m
        self._ground = GroundByNow([each.record.map for each in observing.values()], size)
        self._way = WayByNow(vehicle, size)
        self._site, self._taking_up = SiteByNow(database, drive, classes), threading.Lock()
        known = self._site.snapshot
        soils = {name: soil for name, soil in known.soils.items() if name not in known.physics}
        self._soil = SoilWatch(vehicle, soils, self._tell) if vehicle.wheels else None
        self._stretches = StretchSoils(recording, physics, self._ground, intake.track, size)
        self._watch = Watch(intake.track, self._ground, self._way, self._begin_stretch)
        if self._soil is not None:
            intake.follow_wheel = self._follow
            self._soil.begin()
            self._stretches.begin()
        self._watch.begin()

    def _tell(self, event: SoilDeparts) -> None:
        self._watch.tell(event)

    def _follow(self, time_s: float, row: WheelRow) -> None:
        assert self._soil is not None
        self._soil.put(time_s, row)
        self._stretches.put(time_s, row)

    def _begin_stretch(self, time_s: float, class_name: str) -> None:
        if self._soil is not None:
            self._soil.begin_stretch(time_s, class_name)
            self._stretches.complete(time_s)

    def trouble(self, text: str) -> None:
        """Tell that something fails, or works again."""
        self._watch.tell(Trouble(self._intake.clock_s, text))

    def subscribe(self, subscriber: Subscriber) -> None:
        """Have a subscriber told of events from now on."""
        self._watch.subscribe(subscriber)

    def place(self) -> tuple[float, float, float, float] | None:
        """Give time, x, y and heading of the last pose; None before the second one."""
        track = self._intake.track.now()
        if track is None:
            return None
        time_s, x_m, y_m, yaw_rad = (float(each[-1]) for each in (track.time_s, track.x_m, track.y_m, track.yaw_rad))
        return time_s, x_m, y_m, yaw_rad

    def ahead(self, length_m: float, width_m: float) -> Belief:
        """Give what is believed of the ground ahead of the last pose."""
        place = self.place()
        if place is None:
            return self._ground.belief(np.empty((0, 2), dtype=np.int64))
        return self._ground.ahead(*place[1:], length_m, width_m)

    def under_wheels(self) -> UnderWheels | None:
        """Give the ground under the wheels; None before the first piece of the way."""
        return self._way.now

    def soil(self) -> SoilByNow | None:
        """Give the soil of the stretch in progress; None before the first sample of a wheel."""
        return None if self._soil is None else self._soil.now

    def trust(self) -> dict[str, Trust]:
        """Say how far each sense is trusted, by its name."""
        return {
            name: self._trust(name, each)
            for name, each in self._observing.items()
            if each.last is not None or each.fault or not each.is_provisional
        }

    def _trust(self, name: str, each: Observing) -> Trust:
        sense, last = each.record.sense, each.last
        if each.fault:
            return Trust(sense, 0.0, (each.fault,), math.inf)
        silent_s = self._intake.silent_s(_STREAMS[name]) if name in _STREAMS else 0.0
        if silent_s > SILENT_S:
            said = "nothing came yet" if math.isinf(silent_s) else f"nothing came for {silent_s:.1f} s"
            return Trust(sense, 0.0, (said,), silent_s)
        if last is None or not len(last.evidence):
            return Trust(sense, 0.0, ("nothing was observed yet",), math.inf)
        evidence = last.evidence
        is_open = ~evidence.unknown & (evidence.quality > 0)
        reasons = tuple(dict.fromkeys(text for texts in evidence.reasons for text in texts))
        quality = float(evidence.quality[is_open].mean()) if is_open.any() else 0.0
        return Trust(sense, quality, reasons, self._intake.clock_s - float(last.time_s.max()))

    def snapshot(self) -> Snapshot:
        """Give the planner's view of the site: what was stored, and what the drive has seen by now."""
        with self._taking_up:
            touched = [each.take_touched() for each in self._observing.values()]
            cells = np.unique(np.concatenate(touched), axis=0) if touched else np.empty((0, 2), dtype=np.int64)
            return self._site.take_up(self._ground.belief(cells), self._stretches.take())

    def settle(self) -> None:
        """Sum up what was seen, and estimate again what rests on all of it."""
        for each in self._observing.values():
            each.record.map.settle()
        self._ground.estimate_correlation()

    @property
    def problems(self) -> tuple[str, ...]:
        """What failed by now."""
        found = (self._watch.fault, "" if self._soil is None else self._soil.fault, self._stretches.fault)
        return tuple(filter(None, found))

    def end(self) -> None:
        """Follow what waits, and end."""
        self._watch.end()
        if self._soil is not None:
            self._stretches.end()
            self._soil.end()
