"""The main job: a recording in, a filled terrain database out."""

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
from ..database.store import Added, TerrainDatabase
from .conditions import METHOD, Conditions, url_of
from .core.errors import InputError
from .core.origin import Offset, Origin
from .core.recording.types import Recording
from .core.track.way import DEAD_RECKONING, Track, track_of
from .core.vehicle import Vehicle
from .default_models import Models, ModelsGiven, find_models, of_real_ground
from .fusion import Belief
from .known_physics import KnownPhysics
from .placement import Claim, Frames, Placement, moved, placement_of
from .segments import CELL_SIZE_M, ClassTrack, SoilAlong, believe, classes_along, learn_soil, recall_soil
from .sense_map import Progress, SenseRecord, observe
from .senses import sense_named, senses, senses_of
from .summary import SenseSummary, TraverseSummary, count_cells, count_contradictions, sense_summary


def run_traverse(
    recording: Recording | str | Path,
    database: TerrainDatabase | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    models: Models | ModelsGiven = None,
    cell_size_m: float = CELL_SIZE_M,
    site: str | None = None,
    origin: Origin | None = None,
    offset: Offset | None = None,
    progress: Progress | None = None,
) -> TraverseSummary:
    """Turn a recorded drive into observations of terrain and soil, and add them to a database.

    The camera says what the ground ahead is, the microphone what it is under the wheels; both are fused into one
    belief for each cell of ground. Where the drive was slow and steady enough, the soil is identified from the wheels,
    and belongs to the class that was seen and heard there. What the database knows of a class's physics is subtracted
    from the wheel channels before. Everything is written in one transaction at the end, so
    that an interrupted run leaves the database as it was. A drive that the database holds already, with the same
    vehicle, models and method, is not processed again: the summary then says what was stored.

    Parameters
    ----------
    recording
        A recording, or its path.
    database
        The terrain database, or its path or URL; made if missing.
    vehicle
        Instead of the recording's own: the vehicle, or its TOML file.
    models
        The classifiers, folders that hold them, or names of models that come with the package; looked for next to the
        database where None, and else those that come with the package (`default_models.find_models`).
    cell_size_m
        Edge of a ground cell [m].
    site, origin, offset
        Instead of the recording's own: its site; where on Earth the frame of its places lies; or where that frame lies
        in the site's (one of the two). What the recording's frame is tied to by none of them, by a site's name or by
        satellite is kept apart, at a site of its own (`placement`).
    progress
        Called with each stage's name and the share of it that is done; what it raises ends the run.

    Returns
    -------
    TraverseSummary
        What was seen, heard, measured and stored.

    Raises
    ------
    InputError
        The recording is no drive; it, a model or the database cannot be used.
    """
    report: Progress = progress or (lambda stage, share: None)
    conditions = Conditions.of(
        database, vehicle=vehicle, cell_size_m=cell_size_m, site=site, origin=origin, offset=offset
    )

    def found(senses: Sequence[str], synthetic: bool) -> Models:
        if isinstance(models, Models):
            return models.of(senses)
        return find_models(models, url_of(database), synthetic=synthetic, senses=senses)

    return store(process(recording, conditions, found, Frames(conditions.frames).place, report), database, report)


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


def process(
    recording: Recording | str | Path,
    conditions: Conditions,
    models: Callable[[Sequence[str], bool], Models],
    placed: Callable[[Claim], Placement],
    progress: Progress | None = None,
) -> Processed:
    """Turn a recording into a drive's observations; no database is read or written.

    Parameters
    ----------
    recording
        A recording, or its path.
    conditions
        What it is processed with.
    models
        Called with the names of the senses that the recording has something for, and whether it calls itself
        synthetic; gives their classifiers.
    placed
        Called with what the recording says of its frame; gives where its places are put.
    progress
        Called with each stage's name and the share of it that is done; what it raises ends the work.

    Raises
    ------
    InputError
        The recording or a model cannot be used, or the conditions are of another version of Bevameter.
    """
    began = time.monotonic()
    report: Progress = progress or (lambda stage, share: None)
    if conditions.method != METHOD:
        raise InputError(
            "worker", f"runs {METHOD}", expected=f"the version that the run was started with, {conditions.method}"
        )
    report("reading", 0.0)
    recording = conditions.read(recording)
    synthetic = recording.synthetic  # whatever site is stated for it
    recording = conditions.stated(recording)
    placement = placement_of(recording, placed)
    recording = moved(recording, placement)
    _check_is_a_drive(recording)
    report("reading", 1.0)
    found = models(senses_of(recording), synthetic)
    cell_size_m, track = conditions.cell_size_m, track_of(recording)
    physics = KnownPhysics.of(conditions.physics, recording)
    drive = _to_be_observed(recording, found, cell_size_m, track, physics)
    about = _about(recording, drive, found, track, conditions.database, placement)
    problems = _problems(recording, track)
    if drive.id in conditions.known:
        return Processed(drive, about, problems, None, time.monotonic() - began)
    records = observe(recording, track, found.classifiers, cell_size_m, progress=report)
    belief = believe(records, track, recording.vehicle, cell_size_m)
    along = classes_along(belief, track, recording.vehicle, cell_size_m) if track is not None else None
    soil = _learn_soil(recording, track, along, physics, report)
    drive = replace(drive, terrain=_terrain(belief, cell_size_m, track), soils=soil.observations)
    check_storable(drive)
    seconds = time.monotonic() - began
    summary = TraverseSummary(
        **_with_mismatch(about, soil, drive),
        known=False,
        cells=count_cells(belief),
        track_m=along.metres() if along else {},
        contradictions=count_contradictions(belief),
        senses=tuple(_sense_summary(record, belief, found) for record in records),
        soils=soil.learnt,
        closed_s=soil.closed_s,
        used_s=soil.used_s,
        observations_new=len(drive.terrain) + len(drive.soils),
        observations_known=0,
        problems=(*problems, *soil.problems),
        seconds=seconds,
    )
    return Processed(drive, about, problems, summary, seconds)


def store(
    processed: Processed, database: TerrainDatabase | str | Path, progress: Progress | None = None
) -> TraverseSummary:
    """Write what was made of a recording in one transaction, or recall what is there of it already.

    Raises
    ------
    InputError
        The database cannot be read or written; or it held the drive when the run began, and no longer does.
    """
    if not isinstance(database, TerrainDatabase):
        with TerrainDatabase(database) as opened:
            return store(processed, opened, progress)
    began = time.monotonic()
    report: Progress = progress or (lambda stage, share: None)
    report("storing", 0.0)
    stored = database.drive(processed.drive.id) if database.there else None
    if stored is None and processed.summary is None:
        raise InputError(
            database.name, f"the drive {processed.drive.name} was removed meanwhile", expected="a second run"
        )
    # Of a recording that was processed otherwise since, the drive becomes the processing in use again.
    added = database.add_drive(processed.drive if stored is None else stored)
    report("storing", 1.0)
    seconds = processed.seconds + time.monotonic() - began
    if stored is not None:
        return _recalled_summary(stored, added, processed, seconds)
    assert processed.summary is not None
    return replace(processed.summary, observations_new=added.new, observations_known=added.known, seconds=seconds)


def _check_is_a_drive(recording: Recording) -> None:
    """Refuse a laboratory's table of trials, of which nothing can be put on a map."""
    wheel = recording.wheel
    trials = wheel is not None and (wheel.run is not None or "time_s" not in wheel)
    if trials and recording.pose is None and not senses_of(recording):
        problem = "steady-state trials have no time and place"
        raise InputError(recording.source, problem, expected="a drive; bevameter identify takes trials")


def _learn_soil(
    recording: Recording, track: Track | None, along: ClassTrack | None, physics: KnownPhysics, report: Progress
) -> SoilAlong:
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


def _with_mismatch(about: Mapping[str, Any], soil: SoilAlong, drive: Drive) -> Mapping[str, Any]:
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
    text = (
        f"the simulation lacks something on {', '.join(sorted(classes))}: "
        f"`bevameter explain {shlex.quote(about['source'])}{by_class}` says what"
    )
    return {**about, "warnings": (*about["warnings"], text)}


def _recalled_summary(stored: Drive, added: Added, processed: Processed, seconds: float) -> TraverseSummary:
    """Sum up a drive from what the database holds of it; how the senses did on the way is not kept there."""
    soil = recall_soil(stored.soils)
    return TraverseSummary(
        **_with_mismatch(processed.about, soil, stored),
        known=True,
        cells=count_cells(stored.terrain.evidence),
        track_m={},
        contradictions=count_contradictions(stored.terrain.evidence),
        senses=(),
        soils=soil.learnt,
        closed_s=soil.closed_s,
        used_s=soil.used_s,
        observations_new=added.new,
        observations_known=added.known,
        problems=processed.problems,
        seconds=seconds,
    )


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
    recording: Recording, models: Models, cell_size_m: float, track: Track | None, physics: KnownPhysics
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
        },
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
