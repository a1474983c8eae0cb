"""What is made of a drive, whether it was recorded or is being driven: how it begins, and what is concluded in the end.

`traverse.run_traverse` has the senses observe a recording in between, `live.LiveTraverse` a drive as it goes on.
"""

from __future__ import annotations

import hashlib
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..database.observations import Drive, TerrainObservations
from ..database.storable import check_storable
from .agreement import agreement_with
from .conditions import METHOD, Conditions
from .core.recording.types import Recording
from .core.track.way import DEAD_RECKONING, Track, track_of
from .default_models import Models, of_real_ground
from .fusion import Belief
from .known_physics import KnownPhysics
from .placement import Claim, Placement, moved, placement_of
from .segments import ClassTrack, SoilAlong, believe, classes_along, learn_soil
from .sense_map import Progress, SenseRecord
from .senses import sense_named, senses, senses_of
from .stated_ground import OPERATOR, check_stated
from .summary import SenseSummary, TraverseSummary, count_cells, count_contradictions, sense_summary


@dataclass(frozen=True)
class Processed:
    """What was made of a recording, before it is stored.

    Parameters
    ----------
    drive
        What the database is to hold; without its observations where it was known already.
    about, problems
        What a summary says of the drive whether it is new or known.
    summary
        What was found; None where the drive was known already, and so was not processed.
    seconds
        How long it took [s].
    """

    drive: Drive
    about: Mapping[str, Any]
    problems: tuple[str, ...]
    summary: TraverseSummary | None
    seconds: float


@dataclass(frozen=True)
class Begun:
    """A drive before its ground was observed.

    Parameters
    ----------
    recording
        In the frame of its site.
    models
        The classifiers of the senses that it has something for.
    track
        Where the vehicle was; None where nobody knows.
    physics
        What is known of the physics of classes there.
    drive
        What the database is to hold, without observations.
    about, problems
        What a summary says of it in any case.
    ground
        Class that is stated of its ground, if any.
    cell_size_m
        Edge of a ground cell [m].
    """

    recording: Recording
    models: Models
    track: Track | None
    physics: KnownPhysics
    drive: Drive
    about: Mapping[str, Any]
    problems: tuple[str, ...]
    ground: str | None
    cell_size_m: float


def begin(
    recording: Recording,
    conditions: Conditions,
    models: Callable[[Sequence[str], bool], Models],
    placed: Callable[[Claim], Placement],
) -> Begun:
    """Find what a drive is observed with, and where; the parameters are those of `traverse.process`.

    Raises
    ------
    InputError
        A model cannot be used, or what is stated of the frame cannot be that of the recording.
    """
    synthetic = recording.synthetic  # whatever site is stated for it
    recording = conditions.stated(recording)
    placement = placement_of(recording, placed)
    recording = moved(recording, placement)
    found = models(senses_of(recording), synthetic)
    if conditions.ground is not None:
        check_stated(conditions.ground, found)
    cell_size_m, track = conditions.cell_size_m, track_of(recording)
    physics = KnownPhysics.of(conditions.physics, recording)
    drive = _to_be_observed(recording, found, conditions.ground, cell_size_m, track, physics)
    about = _about(recording, drive, found, track, conditions.database, placement)
    problems = _problems(recording, track)
    return Begun(recording, found, track, physics, drive, about, problems, conditions.ground, cell_size_m)


def conclude(begun: Begun, records: tuple[SenseRecord, ...], began: float, report: Progress) -> Processed:
    """Make a drive's observations of what its senses observed and its wheels measured.

    Parameters
    ----------
    begun
        The drive.
    records
        What each sense observed.
    began
        When the work began, by `time.monotonic` [s].
    report
        Called with each stage's name and the share of it that is done.
    """
    recording, track, cell_size_m = begun.recording, begun.track, begun.cell_size_m
    belief = believe(records, track, recording.vehicle, cell_size_m)
    along = classes_along(belief, track, recording.vehicle, cell_size_m) if track is not None else None
    soil = learn_known_soil(recording, track, along, begun.physics, report)
    drive = replace(begun.drive, terrain=_terrain(belief, cell_size_m, track), soils=soil.observations)
    check_storable(drive)
    seconds = time.monotonic() - began
    summary = TraverseSummary(
        **with_mismatch(begun.about, soil, drive),
        known=False,
        cells=count_cells(belief),
        track_m=along.metres() if along else {},
        contradictions=count_contradictions(belief),
        senses=tuple(_sense_summary(record, belief, begun.models) for record in records),
        soils=soil.learnt,
        closed_s=soil.closed_s,
        used_s=soil.used_s,
        observations_new=len(drive.terrain) + len(drive.soils),
        observations_known=0,
        problems=(*begun.problems, *soil.problems),
        seconds=seconds,
        agreement=agreement_with(recording.labels, along, records, track, recording.vehicle, cell_size_m),
    )
    return Processed(drive, begun.about, begun.problems, summary, seconds)


def learn_known_soil(
    recording: Recording, track: Track | None, along: ClassTrack | None, physics: KnownPhysics,
    report: Progress | None = None,
) -> SoilAlong:  # fmt: skip
    """Identify the soil, what is known of the physics of the classes on the track subtracted before."""
    effects, problems = {}, ()
    driven = recording.wheel is not None and "time_s" in recording.wheel and recording.vehicle is not None
    if driven and track is not None and along is not None and physics.by_class:
        recording, used, problems = physics.taken_out(recording, track, along)
        effects = {name: used.effects(name) for name in used.by_class}
    soil = learn_soil(recording, track, along, effects=effects, progress=report)
    return replace(soil, problems=(*soil.problems, *problems))


def _about(
    recording: Recording, drive: Drive, models: Models, track: Track | None, database: str, placement: Placement
) -> dict[str, Any]:
    """Give what a summary says of a drive whether it was processed now or before."""
    return {
        "recording": drive.name,
        "source": str(recording.source),
        "digest": drive.recording_digest,
        "site": drive.site,
        "origin": drive.origin,
        "offset": drive.offset,
        "vehicle": drive.vehicle_name,
        "database": database,
        "synthetic": drive.synthetic,
        "duration_s": _duration_s(recording, track),
        "distance_m": track.distance_m if track else 0.0,
        "places": track.origin if track else "",
        "cell_size_m": drive.terrain.cell_size_m,
        "warnings": (*_warnings(recording, models, track), *([placement.note] if placement.apart else [])),
        "notes": (
            *recording.notes,
            *models.notes.values(),
            *([placement.note] if placement.note and not placement.apart else []),
        ),
    }


def with_mismatch(about: Mapping[str, Any], soil: SoilAlong, drive: Drive) -> Mapping[str, Any]:
    """Add a warning where the simulation does not agree with the wheels, with the command that says why.

    It stores what it finds by class, unless the classes are too doubtful for that (`grounds.grounds_of`).
    """
    classes = {
        each.class_name or "ground of no class"
        for each in soil.learnt
        if any(finding.code == "wrong_form" for finding in each.findings)
    }
    if not classes:
        return about
    by_class = "" if of_real_ground(drive.models.values()) else f" --db {shlex.quote(about['database'])}"
    described = (Path(about["source"]) / "vehicle.toml").is_file()
    options = "" if described else ", with the --vehicle and --topics of this run,"
    text = (
        f"the simulation lacks something on {', '.join(sorted(classes))}: "
        f"`bevameter explain {shlex.quote(about['source'])}{by_class}`{options} says what"
    )
    return {**about, "warnings": (*about["warnings"], text)}


def _terrain(belief: Belief, cell_size_m: float, track: Track | None) -> TerrainObservations:
    """Give the cells that some sense looked at, as the database stores them; none where nobody knows where they lie."""
    if track is None or track.origin == DEAD_RECKONING:
        return TerrainObservations.nothing(cell_size_m)
    looked = np.flatnonzero(np.isfinite(belief.last_seen_s))
    return TerrainObservations(
        cell_size_m,
        belief.cells[looked, 0],
        belief.cells[looked, 1],
        belief.last_seen_s[looked],
        np.full(len(looked), "fused"),
        belief.select(looked),
    )


def _to_be_observed(
    recording: Recording,
    models: Models,
    ground: str | None,
    cell_size_m: float,
    track: Track | None,
    physics: KnownPhysics,
) -> Drive:
    """Give the drive without its observations: all that its identity depends on."""
    vehicle = recording.vehicle
    described = hashlib.sha256((vehicle.model_dump_json() if vehicle else "").encode()).hexdigest()[:16]
    return Drive(
        recording_digest=recording.digest,
        name=recording.name,
        site=recording.site,
        vehicle_name=vehicle.name if vehicle else "",
        start_time=recording.start_time,
        models={
            one.instrument: "synthetic " * (one.name in models.synthetic) + models.classifiers[one.name].version
            for one in senses()
            if one.name in models.classifiers
        }
        | ({OPERATOR: f"states {ground}"} if ground is not None else {}),
        method=f"{METHOD}, vehicle {described}, places {track.origin if track else 'none'}"
        + (f", physics {physics.digest}" if physics.by_class else ""),
        terrain=TerrainObservations.nothing(cell_size_m),
        origin=recording.origin,
        offset=recording.offset,
    )


def _problems(recording: Recording, track: Track | None) -> tuple[str, ...]:
    """Say what of the recording could not be read, and where nobody knows the place."""
    return recording.problems + (track.problems if track is not None else ())


def _duration_s(recording: Recording, track: Track | None) -> float:
    if track is not None:
        return float(np.ptp(track.time_s))
    wheel = recording.wheel
    if wheel is not None and wheel.run is None and "time_s" in wheel and len(wheel):
        return float(np.nanmax(wheel["time_s"]) - np.nanmin(wheel["time_s"]))
    return recording.sound.duration_s if recording.sound is not None else 0.0


def _sense_summary(record: SenseRecord, belief: Belief, models: Models) -> SenseSummary:
    name = record.name
    classifier = models.classifiers.get(name)
    return sense_summary(
        record,
        belief,
        model=models.origins.get(name, ""),
        model_version=classifier.version if classifier else "",
        synthetic_model=name in models.synthetic,
    )


def _warnings(recording: Recording, models: Models, track: Track | None) -> tuple[str, ...]:
    used = track is not None and bool(senses_of(recording))
    warnings = list(models.cautions.values()) if used else []
    for name in senses_of(recording) if used else ():
        if name in models.classifiers:
            warnings += sense_named(name).remarks(models.classifiers[name])
    if track is None:
        warnings.append("the recording holds no places and no travel speed: nothing can be put on a map")
    elif track.origin == DEAD_RECKONING:
        warnings.append(
            "the recording holds no places: the way is travel speed added up, heading unknown; what the wheels learnt "
            "is kept, the cells are not put on the site's map"
        )
    return tuple(warnings)
