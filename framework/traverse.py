"""The main job: a recording in, a filled terrain database out."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from ..database.observations import Drive
from ..database.store import Added, TerrainDatabase
from .conditions import METHOD, Conditions, url_of
from .core.errors import InputError
from .core.origin import Offset, Origin
from .core.recording.types import Recording
from .core.vehicle import Vehicle
from .default_models import Models, ModelsGiven, find_models
from .engine import Processed, begin, conclude, with_mismatch
from .observing import observe
from .placement import Claim, Frames, Placement
from .segments import CELL_SIZE_M, recall_soil
from .sense_map import Progress
from .senses import senses_of
from .stated_ground import observe_stated
from .summary import TraverseSummary, count_cells, count_contradictions


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
    ground: str | None = None,
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
    ground
        Class of the ground of the whole recording, where whoever drove knows it: evidence in addition to the senses'.
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
        database, vehicle=vehicle, cell_size_m=cell_size_m, site=site, origin=origin, offset=offset,
        ground=ground,
    )  # fmt: skip

    def found(senses: Sequence[str], synthetic: bool) -> Models:
        if isinstance(models, Models):
            return models.of(senses)
        return find_models(models, url_of(database), synthetic=synthetic, senses=senses)

    return store(process(recording, conditions, found, Frames(conditions.frames).place, report), database, report)


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
    _check_is_a_drive(recording)
    begun = begin(recording, conditions, models, placed)
    report("reading", 1.0)
    if begun.drive.id in conditions.known:
        return Processed(begun.drive, begun.about, begun.problems, None, time.monotonic() - began)
    records = observe(begun.recording, begun.track, begun.models.classifiers, begun.cell_size_m, progress=report)
    stated = observe_stated(begun.ground, begun.recording, begun.track, begun.models, begun.cell_size_m)
    return conclude(begun, (*records, *stated), began, report)


def _check_is_a_drive(recording: Recording) -> None:
    """Refuse a laboratory's table of trials, of which nothing can be put on a map."""
    wheel = recording.wheel
    trials = wheel is not None and (wheel.run is not None or "time_s" not in wheel)
    if trials and recording.pose is None and not senses_of(recording):
        problem = "steady-state trials have no time and place"
        raise InputError(recording.source, problem, expected="a drive; bevameter identify takes trials")


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


def _recalled_summary(stored: Drive, added: Added, processed: Processed, seconds: float) -> TraverseSummary:
    """Sum up a drive from what the database holds of it; how the senses did on the way is not kept there."""
    soil = recall_soil(stored.soils)
    return TraverseSummary(
        **with_mismatch(processed.about, soil, stored),
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
