"""A drive that goes on: what it is made of, how it begins, is cut off, resumed, and stored in the end."""

from __future__ import annotations

import math
import secrets
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ...database.observations import Drive, TerrainObservations
from ...database.store import TerrainDatabase
from ..conditions import METHOD, Conditions, url_of
from ..core.errors import InputError
from ..core.recording.types import Pose, Recording
from ..core.track.jumps import without_jumps
from ..core.track.way import track_of
from ..core.vehicle import Vehicle
from ..default_models import Models
from ..engine import Processed, begin, conclude
from ..observing import begin_sense, observe
from ..placement import Claim, Frames, Placement, moved
from ..sense_map import SenseRecord
from ..senses import sense_named, senses
from ..summary import TraverseSummary
from ..traverse import store
from .checkpoints import Checkpoints
from .intake import Intake
from .journal import Journal, place_of_journal, unfinished
from .log import IMU, POSE, WHEEL, Taken, pose_of, vibration_of_imu, wheel_of
from .now import Now
from .observing import Observing, faults
from .pieces import LivePieces, observed_in_pieces
from .streams import SOURCE, Waiting

_LOADING_S = 60.0
"""A sense is waited for no longer when a drive begins [s]."""

_NAMED = ("name", "digest", "frame", "shared_speed")
"""What a drive that is resumed has of the one that was cut off."""

_SOMEWHERE = Pose(*np.zeros((4, 1)))
"""Stands for places that will come."""


def new_drive(
    name: str, vehicle: Vehicle, start_time: datetime | None, site: str, *, shared_speed: bool = False
) -> Recording:
    """Give the recording that a drive will make, before anything came."""
    digest = secrets.token_hex(32)
    return Recording(name, SOURCE, vehicle, start_time, site, digest, pose=_SOMEWHERE, shared_speed=shared_speed)


def drive_like(recording: Recording) -> Recording:
    """Give the recording that a drive will make, of which another one says all but the samples."""
    nothing = dict.fromkeys(("wheel", "labels", "camera", "sound", "vibration"))
    return replace(recording, **nothing, digest=secrets.token_hex(32), pose=_SOMEWHERE)


class LiveDrive:
    """What `LiveTraverse` drives; see there.

    Parameters
    ----------
    database
        The terrain database, or its path or URL.
    conditions
        What was read of it, and what is stated.
    drive
        From `new_drive`; its name and start are those of the one that was cut off where there is one.
    models
        The classifiers.
    horizon_s, lossless
        As of `LiveTraverse`.
    left
        The journal of a drive that was cut off; None for a new one.
    """

    def __init__(
        self, database: TerrainDatabase | str | Path, conditions: Conditions, drive: Recording, models: Models,
        horizon_s: float, lossless: bool, left: Path | None,
    ):  # fmt: skip
        self._began = time.monotonic()
        self._database, self._conditions, self._models = database, conditions, models
        self.journal = Journal(place_of_journal(url_of(database), drive.digest) if left is None else left)
        state = {} if left is None else self._left(drive)
        if state:
            start = None if state["start_time"] is None else datetime.fromisoformat(state["start_time"])
            drive = replace(drive, **state["drive"]["named"], start_time=start)
        claim = Claim.of(conditions.stated(drive))
        assert claim is not None
        self._placement = Frames(conditions.frames).place(claim)
        self.intake = Intake(horizon_s, lossless, self._placement.offset)
        self._recording = replace(drive, camera=self.intake.camera, sound=self.intake.sound)
        self._unfinished = unfinished(url_of(database))
        self.needed_s = -math.inf
        self._closing = threading.RLock()
        self._is_ended = self.is_stored = False
        self._processed: Processed | None = None
        self._observing = self._senses_at_work()
        try:
            if state:
                self._restore(state)
            self.now = self._begin_now()
        except BaseException:  # another try may open the journal
            self.journal.close()
            raise
        self._blas = threadpool_limits(1)  # the senses' threads fill the cores by themselves
        self._checkpoints = Checkpoints(
            self.journal, self.intake, self._observing, self._state, self.now.settle, self.now.trouble
        )
        for each in self._observing.values():
            each.begin()
        for name, (camera, _) in self.intake.of_senses.items():
            # The first images would wait while the sense is loaded, and be dropped.
            self._observing[name].wait_for(camera.is_waited_for, _LOADING_S)
        self._checkpoints.begin()

    def started(self, time_s: float) -> None:
        """Take a time [s] for the present, if nothing says when the drive began."""
        if self._recording.start_time is None:
            self._recording = replace(self._recording, start_time=_start_time(time_s))

    def _key(self, drive: Recording) -> dict[str, str]:
        """Give what a drive that is resumed has in common with the one that was cut off."""
        own = self._conditions
        versions = {name: model.version for name, model in sorted(self._models.classifiers.items())}
        key = {
            "site": drive.site, "vehicle": _described(drive.vehicle), "models": versions,
            "cell_size_m": own.cell_size_m, "origin": own.origin, "offset": own.offset, "method": METHOD,
        }  # fmt: skip
        return {name: str(value) for name, value in key.items()}

    def _left(self, drive: Recording) -> dict[str, Any]:
        """Give the state that a journal holds of this drive; raises `InputError` where it is another's."""
        path, expected = self.journal.path, "the journal of a drive that was cut off"
        if not path.is_file():
            raise InputError(path, "no such file", expected=expected)
        state = self.journal.state()
        key, same = state.get("drive", {}).get("key", {}), self._key(drive)
        other = next((name for name, value in same.items() if key.get(name) != value), None)
        if other is None:
            return state
        self.journal.close()
        if not key:
            raise InputError(path, "no drive in it", expected=expected)
        raise InputError(path, f"a drive of another {other}", expected="the same as when it was cut off")

    def _state(self) -> dict[str, Any]:
        own = self._recording
        start = None if own.start_time is None else own.start_time.isoformat()
        named = {name: getattr(own, name) for name in _NAMED}
        return {"drive": {"named": named, "key": self._key(own)}, "start_time": start}

    def _restore(self, state: Mapping[str, Any]) -> None:
        """Take in what was written away of the drive before it was cut off."""
        parts = self.journal.parts
        self.needed_s = self.intake.restore(parts(POSE), parts(WHEEL), state)
        pose = pose_of(parts(POSE))
        whole = moved(replace(self._recording, pose=pose), self._placement)
        track = None if pose is None else track_of(whole)
        place = None if track is None else (whole, track, self._conditions.cell_size_m)
        for name, each in self._observing.items():
            each.restore(parts(f"seen {name}"), parts(f"heard {name}"), state.get(name, {}), place)

    def _senses_at_work(self) -> dict[str, Observing]:
        """Give the senses that observe while driving: streams as they come, tables piece by piece."""
        models, size, intake = self._models.classifiers, self._conditions.cell_size_m, self.intake
        at_work = {}
        for sense in senses():
            if sense.name not in models:
                continue
            camera, sound = intake.streams_for_sense()
            own = replace(self._recording, camera=camera, sound=sound)
            record, given = begin_sense(sense, own, intake.track, models, size)
            if given is not None:
                intake.of_senses[sense.name] = camera, sound
                at_work[sense.name] = Observing(record, given, partial(_unused, (camera, sound)))
                continue
            pieces = LivePieces(intake.changed, intake.track)
            pieces.is_used = True
            intake.pieces.append(pieces)
            parts = pieces.recordings(self._recording, lambda piece: moved(piece, self._placement))
            record = replace(record, absent="")
            observed = observed_in_pieces(sense, parts, intake.track, models[sense.name], size)
            at_work[sense.name] = Observing(record, observed, pieces.unused, is_provisional=True)
        return at_work

    def _begin_now(self) -> Now:
        own, placed = self._recording, self._placement
        assert own.vehicle is not None
        drive = Drive(
            own.digest, own.name, placed.site, own.vehicle.name, own.start_time, {}, METHOD,
            TerrainObservations.nothing(self._conditions.cell_size_m), origin=placed.origin, offset=placed.offset,
        )  # fmt: skip
        used = (self._models.classifiers[name] for name in self._observing)
        classes = tuple(sorted({name for model in used for name in model.classes}))
        given = self._database
        with nullcontext(given) if isinstance(given, TerrainDatabase) else TerrainDatabase(given) as opened:
            made, physics = replace(own, site=placed.site), self._conditions.physics
            return Now(self.intake, self._observing, own.vehicle, opened, drive, classes, made, physics)

    @property
    def problems(self) -> tuple[str, ...]:
        """What of the samples was left out by now, and what failed."""
        left = (
            f"an unfinished drive lies in {path}; resume={str(path)!r} goes on with it" for path in self._unfinished
        )
        fault = self._checkpoints.fault
        return (*self._of_samples(), *self.now.problems, *left, *((fault,) if fault else ()))

    def _of_samples(self) -> tuple[str, ...]:
        return (*self.intake.problems, *faults(tuple(self._observing.values())))

    def end(self, *, to_be_resumed: bool = False) -> None:
        """Give on all that waits, or forget it where the drive is to be resumed; write away what was observed."""
        with self._closing:
            if not self._is_ended:
                self._is_ended = True
                self._end(to_be_resumed)
            if to_be_resumed:
                self.journal.close()

    def _end(self, to_be_resumed: bool) -> None:
        if to_be_resumed:
            for each in self._observing.values():
                each.leave()
            self.intake.leave()
        else:
            self.intake.end()
        for each in self._observing.values():
            each.end()
        self.now.end()
        self._checkpoints.end()
        self._blas.restore_original_limits()

    def close(self, digest: str | None) -> TraverseSummary:
        """End the drive, and store it; see `LiveTraverse.close`."""
        with self._closing:
            return self._close(digest)

    def _close(self, digest: str | None) -> TraverseSummary:
        if self.is_stored:
            raise InputError("LiveTraverse", "closed before", expected="a drive that goes on")
        self.end()
        if not math.isfinite(self.intake.clock_s):
            self.journal.remove()
            raise InputError("LiveTraverse", "no sample came", expected="samples of a drive")
        if self._processed is None:
            self._processed = self._concluded(digest)
        try:
            summary = store(self._processed, self._database)
        except InputError as error:
            self.journal.close()  # it may be resumed at once, here or elsewhere
            raise InputError(
                error.source, f"{error.problem}; the drive is kept in {self.journal.path}", expected=error.expected
            ) from error
        self.is_stored = True
        self.journal.remove()
        return summary

    def _concluded(self, digest: str | None) -> Processed:
        begun = begin(
            self._made(digest), self._conditions, lambda senses, synthetic: self._models.of(senses),
            self._placed,
        )  # fmt: skip
        done, parts = dict[str, SenseRecord](), self._checkpoints.parts
        if begun.track is not None:
            done = {
                name: each.concluded(begun.recording, begun.track, begun.cell_size_m, parts(f"heard {name}"))
                for name, each in self._observing.items()
                if not each.is_provisional
            }
        rest = {name: each for name, each in begun.models.classifiers.items() if name not in done}
        records = observe(begun.recording, begun.track, rest, begun.cell_size_m)
        said = tuple(_said(done.get(record.name, record), begun.recording) for record in records)
        return conclude(begun, said, self._began, lambda stage, share: None)

    def _placed(self, claim: Claim) -> Placement:
        """Place the drive as when it began; at a site of its own by its digest, if there is another one by now."""
        return Frames(self._conditions.frames).place(claim) if self._placement.apart else self._placement

    def _made(self, digest: str | None) -> Recording:
        """Give the recording that the samples made."""
        own, parts, vehicle = self.intake, self._checkpoints.parts, self._recording.vehicle
        assert vehicle is not None
        wheel = wheel_of(parts(WHEEL), vehicle)
        vibration, problems = vibration_of_imu(parts(IMU), wheel)
        pose = pose_of(parts(POSE))
        if pose is not None:
            # The poses' jumps are counted among the samples' problems as they come.
            with suppress(InputError):
                pose, _ = without_jumps(pose, SOURCE, str)
        taken = Taken(own.camera.count, own.sound.duration_s, own.sound.rate or 1)
        return replace(
            self._recording, digest=digest or self._recording.digest, wheel=wheel, pose=pose, vibration=vibration,
            camera=taken if taken.images else None, sound=taken if taken.duration_s else None,
            problems=(*self._recording.problems, *problems, *self._of_samples()),
        )  # fmt: skip


def _unused(streams: Sequence[Waiting]) -> None:
    for each in streams:
        each.unused()


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


def _described(vehicle: Vehicle | None) -> str:
    return "" if vehicle is None else vehicle.model_dump_json()
