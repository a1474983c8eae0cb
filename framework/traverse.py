"""The main job: a recording in, a filled terrain database out."""

from __future__ import annotations

import hashlib
import math
import shlex
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..database.observations import Drive, TerrainObservations
from ..database.schema import holds_database, parse_url, shown
from ..database.store import Added, TerrainDatabase
from .core.arguments import number, refused
from .core.recording.readers import read_recording
from .core.recording.types import Recording
from .core.track.way import DEAD_RECKONING, Track, track_of
from .core.vehicle import Vehicle, as_vehicle
from .default_models import Models, find_models
from .fusion import Belief
from .known_physics import KnownPhysics
from .segments import CELL_SIZE_M, ClassTrack, SoilAlong, believe, classes_along, learn_soil, recall_soil
from .sense_map import Progress, SenseRecord, observe
from .senses import senses, senses_of
from .summary import SenseSummary, TraverseSummary, count_cells, count_contradictions, sense_summary

METHOD = f"bevameter {version('bevameter')}, traverse 2"
"""Version of what a run makes of a recording; a change of it is another processing of the same drive."""


def run_traverse(
    recording: Recording | str | Path,
    database: TerrainDatabase | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    models: Models | str | Path | None = None,
    cell_size_m: float = CELL_SIZE_M,
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
        The classifiers, or the folder that holds them; looked for next to the database where None, and else the
        defaults, which know synthetic ground only (`default_models.find_models`).
    cell_size_m
        Edge of a ground cell [m].
    progress
        Called with each stage's name and the share of it that is done; what it raises ends the run.

    Returns
    -------
    TraverseSummary
        What was seen, heard, measured and stored.

    Raises
    ------
    InputError
        The recording, a model or the database cannot be used.
    """
    began = time.monotonic()
    report: Progress = progress or (lambda stage, share: None)
    report("reading", 0.0)
    cell_size_m = _cell_size(cell_size_m)
    driven = None if vehicle is None else as_vehicle(vehicle)
    if not isinstance(recording, Recording):
        recording = read_recording(recording, vehicle=driven)
    elif driven is not None:
        recording = replace(recording, vehicle=driven)
    report("reading", 1.0)
    url = database.name if isinstance(database, TerrainDatabase) else database
    if not isinstance(database, TerrainDatabase):
        holds_database(database)  # a database of another program is found out before the long work
    if not isinstance(models, Models):
        models = find_models(models, url, senses=senses_of(recording), progress=report)
    track = track_of(recording)
    physics = _known_physics(database, recording)
    drive = _to_be_observed(recording, models, cell_size_m, track, physics)
    about = _about(recording, drive, models, track, url)
    known = _recall(database, drive)
    if known is not None:
        return _recalled_summary(*known, about, _problems(recording, track), began)
    records = observe(recording, track, models.classifiers, cell_size_m, progress=report)
    belief = believe(records, track, recording.vehicle, cell_size_m)
    along = classes_along(belief, track, recording.vehicle, cell_size_m) if track is not None else None
    soil = _learn_soil(recording, track, along, physics, report)
    drive = replace(drive, terrain=_terrain(belief, cell_size_m, track), soils=soil.observations)
    report("storing", 0.0)
    if isinstance(database, TerrainDatabase):
        added = database.add_drive(drive)
    else:
        with TerrainDatabase(database) as store:
            added = store.add_drive(drive)
    report("storing", 1.0)
    return TraverseSummary(
        **_with_mismatch(about, soil),
        known=False,
        cells=count_cells(belief),
        track_m=along.metres() if along else {},
        contradictions=count_contradictions(belief),
        senses=tuple(_sense_summary(record, belief, models) for record in records),
        soils=soil.learnt,
        closed_s=soil.closed_s,
        used_s=soil.used_s,
        observations_new=added.new,
        observations_known=added.known,
        problems=(*_problems(recording, track), *soil.problems),
        seconds=time.monotonic() - began,
    )


def _known_physics(database: TerrainDatabase | str | Path, recording: Recording) -> KnownPhysics:
    """Read what the database knows of the physics of classes; nothing where there is no database yet."""
    if isinstance(database, TerrainDatabase):
        return KnownPhysics.of(database, recording)
    store = TerrainDatabase.open_if_there(database)
    if store is None:
        return KnownPhysics({})
    with store:
        return KnownPhysics.of(store, recording)


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


def _cell_size(cell_size_m: float) -> float:
    """Give the edge of a cell [m]; raises `InputError` where it is none."""
    wanted = "a finite length, greater than 0 [m]"
    edge = number("cell_size_m", cell_size_m, wanted)
    if not 0.0 < edge < math.inf:
        raise refused("cell_size_m", cell_size_m, wanted)
    return edge


def _about(recording: Recording, drive: Drive, models: Models, track: Track | None, url: str | Path) -> dict[str, Any]:
    """Give what a summary says of a drive whether it was processed now or before."""
    return {
        "recording": drive.name,
        "source": str(recording.source),
        "digest": drive.recording_digest,
        "site": drive.site,
        "vehicle": drive.vehicle_name,
        "database": shown(parse_url(url)),
        "synthetic": drive.synthetic,
        "duration_s": _duration_s(recording, track),
        "distance_m": track.distance_m if track else 0.0,
        "places": track.origin if track else "",
        "cell_size_m": drive.terrain.cell_size_m,
        "warnings": _warnings(recording, models, track),
        "notes": recording.notes,
    }


def _with_mismatch(about: dict[str, Any], soil: SoilAlong) -> dict[str, Any]:
    """Add a warning where the simulation does not agree with the wheels, with the command that says why."""
    classes = {
        each.class_name or "ground of no class"
        for each in soil.learnt
        if any(finding.code == "wrong_form" for finding in each.findings)
    }
    if not classes:
        return about
    text = (
        f"the simulation lacks something on {', '.join(sorted(classes))}: "
        f"`bevameter explain {shlex.quote(about['source'])} --db {shlex.quote(about['database'])}` says what"
    )
    return {**about, "warnings": (*about["warnings"], text)}


def _recall(database: TerrainDatabase | str | Path, drive: Drive) -> tuple[Drive, Added] | None:
    """Find the drive in the database, if it is there, and see to it that it is the processing in use."""
    if not isinstance(database, TerrainDatabase):
        store = TerrainDatabase.open_if_there(database)
        if store is None:
            return None
        with store:
            return _recall(store, drive)
    stored = database.drive(drive.id)
    return None if stored is None else (stored, database.add_drive(stored))


def _recalled_summary(
    stored: Drive, added: Added, about: dict[str, Any], problems: tuple[str, ...], began: float
) -> TraverseSummary:
    """Sum up a drive from what the database holds of it; how the senses did on the way is not kept there."""
    soil = recall_soil(stored.soils)
    return TraverseSummary(
        **_with_mismatch(about, soil),
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
        problems=problems,
        seconds=time.monotonic() - began,
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
    warnings = list(models.warnings) if used else []
    if track is None:
        warnings.append("the recording holds no places and no travel speed: nothing can be put on a map")
    elif track.origin == DEAD_RECKONING:
        warnings.append(
            "the recording holds no places: the way is travel speed added up, heading unknown; what the wheels learnt "
            "is kept, the cells are not put on the site's map"
        )
    return tuple(warnings)
