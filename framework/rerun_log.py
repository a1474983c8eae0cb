"""A drive and what a run found of it as a file of the Rerun viewer (the extra `rerun`).

Entities of the file: ``world`` holds what has a place (``cells`` by class, ``track``, ``vehicle`` with its camera,
``soil``, ``site_map``), ``senses`` the quality of each window of sound, ``wheels`` the recorded channels, ``soil`` the
estimates over time, ``log``, ``summary`` and ``legend`` what is read. Where a value is not known there is none: series
have an empty row there, which breaks their line.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..database.observations import Drive
from ..database.snapshot import Snapshot
from ..database.store import TerrainDatabase
from ..identification.estimate.tables import learnt
from .colours import cell_colours, class_colours
from .core.errors import InputError
from .core.evidence import UNKNOWN
from .core.files import whole
from .core.recording.types import Recording, WheelTable
from .core.track.way import RECORDED, Track, track_of
from .default_models import Models, ModelsGiven, find_models
from .map import cells_picture
from .placement import place_as_stored
from .rerun_layout import drive_world, layout, unmapped_world
from .rerun_parts import (
    FRAME_PERIOD_S,
    SOIL,
    SenseLog,
    camera_entity,
    ends_of,
    write_frame,
    write_legend,
    write_lens,
    write_vehicle,
)  # fmt: skip
from .rerun_stream import Log, broken, check_rerun, opened
from .senses import sense_named, senses_of
from .summary import LearntSoil, TraverseSummary
from .summary_text import ground_table, heading, sense_lines, soil_lines

LISTENING = ("audio", "vibration")
"""Senses whose windows are classified again for their quality. That takes a millisecond a window; images take as long
again as the run did."""

CHANNELS = {
    "load_N": "load [N]", "torque_Nm": "torque [N m]", "slip": "slip [-]", "sinkage_m": "sinkage [m]",
    "drawbar_pull_N": "drawbar pull [N]",
}  # fmt: skip
"""Wheel channels that are written, and their titles."""


def write_rerun(
    summary: TraverseSummary, recording: Recording, path: str | Path, *, models: Models | ModelsGiven = None
) -> None:
    """Write a drive and what was found of it, whole or not at all.

    Parameters
    ----------
    summary
        What `run_traverse` answered; its database is read.
    recording
        What it was run over.
    path
        The file, which ends with ``.rrd``.
    models
        As for `run_traverse`, of the same run: the quality of sound is that of its windows classified again. Of a sense
        whose model is another one now, none is written.

    Raises
    ------
    InputError
        Rerun is not installed; the file cannot be written; the database does not hold the drive.
    """
    path = Path(path)
    check_rerun(path)
    with TerrainDatabase(summary.database, must_exist=True) as database:
        stored = database.recorded(recording.digest)
        drive = None if stored is None else database.drive(stored.id)
        if drive is None:
            raise InputError(summary.database, f"does not hold {summary.recording}", expected="the run's database")
        placed = place_as_stored(recording, database)
        snapshot = database.snapshot(drive.site)
    with whole(path) as part, opened(part, drive.started) as log:
        _write_all(log, summary, placed, drive, snapshot, models)


def _write_all(
    log: Log, summary: TraverseSummary, recording: Recording, drive: Drive, snapshot: Snapshot,
    models: Models | ModelsGiven,
) -> None:  # fmt: skip
    track = track_of(recording)
    mapped = track is not None and track.origin == RECORDED
    names = list(dict.fromkeys([*snapshot.class_names, *drive.terrain.evidence.classes]))
    colours = class_colours(names)
    log.stream.send_recording_name(summary.recording)
    log.static("world", log.rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    texts = [*summary.warnings, *summary.problems]
    if track is not None:
        _write_track(log, track)
    if mapped:
        _write_cells(log, drive, colours)
        texts += _write_site_map(log, snapshot, colours)
    camera = _write_camera(log, recording, mapped)
    heard, untold = _write_senses(log, recording, track, drive, summary.database, models)
    channels = [] if recording.wheel is None else _write_wheels(log, recording.wheel)
    estimated = _write_soils(log, drive)
    _write_texts(log, summary, drive, track, [*texts, *untold])
    present = {*drive.terrain.evidence.labels(), *(each.class_name for each in summary.soils)}
    write_legend(log, {name: colours[name] for name in names if name in present})
    shown = {name: CHANNELS[name] for name in channels}
    world = drive_world() if mapped else unmapped_world()
    log.stream.send_blueprint(layout(world, camera, heard, shown, estimated))


def _write_track(log: Log, track: Track) -> None:
    """Write the way, broken at holes, and where the vehicle was."""
    rr, places = log.rr, np.column_stack([track.x_m, track.y_m, np.zeros(len(track.time_s))])
    cuts = np.searchsorted(track.time_s, track.holes_s[:, 0], side="right")
    strips = [strip for strip in np.split(places, cuts) if len(strip) > 1]
    log.static("world/track", rr.LineStrips3D(strips, colors=[0x202020FF], radii=[rr.Radius.ui_points(1.5)]))
    half = 0.5 * track.yaw_rad
    zero = np.zeros_like(half)
    quaternions = np.column_stack([zero, zero, np.sin(half), np.cos(half)])
    columns = rr.Transform3D.columns(translation=places, quaternion=quaternions)
    log.columns("world/vehicle", track.time_s, columns)
    write_vehicle(log)


def _write_cells(log: Log, drive: Drive, colours: Mapping[str, str]) -> None:
    """Write each cell as a flat box from when it was last seen on."""
    terrain, evidence = drive.terrain, drive.terrain.evidence
    size, labels = terrain.cell_size_m, np.array(evidence.labels(), dtype=object)
    rgba = cell_colours(evidence.classes, evidence.probabilities, ~evidence.unknown, colours)
    centres = np.column_stack([(terrain.cell_x + 0.5) * size, (terrain.cell_y + 0.5) * size, np.zeros(len(labels))])
    for name in dict.fromkeys(labels.tolist()):
        rows = np.flatnonzero(labels == name)
        rows = rows[np.argsort(terrain.time_s[rows], kind="stable")]
        times, counts = np.unique(terrain.time_s[rows], return_counts=True)
        boxes = log.rr.Boxes3D.columns(
            centers=centres[rows],
            half_sizes=np.tile([0.48 * size, 0.48 * size, 0.01], (len(rows), 1)),
            colors=np.round(255.0 * rgba[rows]).astype(np.uint8),
        )
        path = log.path("world", "cells", name)
        log.static(path, log.rr.Boxes3D.from_fields(fill_mode=log.rr.components.FillMode.Solid))
        log.columns(path, times, boxes.partition(counts))


def _write_site_map(log: Log, snapshot: Snapshot, colours: Mapping[str, str]) -> list[str]:
    """Write all that the database knows of the site as a raster; say so where a pixel is of several cells."""
    if not len(snapshot.cells.key):
        return []
    rr, (picture, corner, step) = log.rr, cells_picture(snapshot, colours)
    height, width = picture.shape[:2]
    pixels = np.round(255.0 * picture[::-1]).astype(np.uint8)  # the first row of an image is the upper one
    form = rr.components.ImageFormat(
        width=width, height=height, color_model=rr.ColorModel.RGBA, channel_datatype=rr.ChannelDatatype.U8
    )
    place = [*corner, -0.02]
    log.static("world/site_map", rr.GridMap(data=pixels.tobytes(), format=form, cell_size=step, translation=place))
    return [f"the map of the site has pixels of {step:g} m: it is wide"] if step > snapshot.cell_size_m else []


def _write_camera(log: Log, recording: Recording, mapped: bool) -> str:
    """Write frames, thinned and made smaller; return the entity above them, or nothing where there are none."""
    if recording.camera is None:
        return ""
    camera = recording.vehicle.camera if recording.vehicle is not None and mapped else None
    last, origin = -np.inf, ""

    def wanted(time_s: float) -> bool:
        return time_s >= last + FRAME_PERIOD_S

    for frame in recording.camera.frames(wanted):
        if frame.image is None:
            continue
        last = frame.time_s
        known = origin or camera_entity(camera, frame.image)
        shrunk = write_frame(log, f"{known}/image", frame.time_s, frame.image)
        if not origin and camera is not None and known != "camera":
            write_lens(log, camera, *shrunk)
        origin = known
    return origin


def _write_senses(
    log: Log, recording: Recording, track: Track | None, drive: Drive, database: str, models: Models | ModelsGiven
) -> tuple[list[str], list[str]]:
    """Write the quality of each window, and why it is not trusted; return instruments, and why one is not there."""
    names = [name for name in senses_of(recording) if name in LISTENING]
    if track is None or not names:
        return [], []
    if not isinstance(models, Models):
        models = find_models(models, database, synthetic=recording.synthetic, senses=names)
    written, untold = [], []
    for name in names:
        sense, model = sense_named(name), models.classifiers.get(name)
        used = drive.models.get(sense.instrument, "").removeprefix("synthetic ")
        if model is None or model.version != used:
            if used:
                untold.append(f"{sense.instrument}: the model of the run is not there, so its quality is not written")
            continue
        times, qualities, told = [], [], SenseLog(log, sense.instrument)
        for seen in sense.observe(recording, track, model, drive.terrain.cell_size_m):
            quality = np.where(seen.evidence.unknown, 0.0, seen.evidence.quality)
            times.append(seen.time_s)
            qualities.append(quality)
            windows = zip(seen.time_s.tolist(), quality.tolist(), seen.evidence.reasons, strict=True)
            for time_s, value, reasons in windows:
                told.write(time_s, value, reasons)
        if times:
            log.series(log.path("senses", sense.instrument, "quality"), *map(np.concatenate, (times, qualities)))
            written.append(sense.instrument)
    return written, untold


def _write_wheels(log: Log, wheel: WheelTable) -> list[str]:
    """Write the recorded channels by wheel; return their names."""
    time_s = wheel.get("time_s")
    if time_s is None or wheel.run is not None:
        return []
    of = np.full(len(wheel), "wheel", dtype=object) if wheel.wheel is None else wheel.wheel
    written = [name for name in CHANNELS if len(wheel.observed(name))]
    for name in written:
        for each in dict.fromkeys(of.tolist()):
            rows = of == each
            log.series(log.path("wheels", name, str(each)), *broken(time_s[rows], wheel[name][rows]))
    return written


def _write_soils(log: Log, drive: Drive) -> list[str]:
    """Write c and phi over the stretches, and at their places; return the names of what was written."""
    soils = [(one, LearntSoil.of(one.estimate, one)) for one in drive.soils if one.estimate is not None]
    written = []
    for name, (entity, scale) in SOIL.items():
        known = [ends_of(soil.parameters, soil.separable, name) for _, soil in soils]
        for end in known[0] if known else ():
            numbers = [scale * each[end] for each in known]
            if not np.isfinite(numbers).any():
                continue
            # Constant from the stretch's start to its end, and nothing until the next.
            times = np.array([time for one, _ in soils for time in (one.start_s, one.end_s, one.end_s)])
            levels = np.array([number for each in numbers for number in (each, each, np.nan)])
            log.series(f"soil/{entity}/{end}", times, levels)
            written.append(entity)
    for observed, soil in soils:
        if np.isfinite(observed.x_m + observed.y_m):
            label = f"{soil.class_name or UNKNOWN}: {_in_words(soil)}"
            place = [observed.x_m, observed.y_m, 0.1]
            point = log.rr.Points3D([place], radii=[0.15], colors=[0x111111FF], labels=[label], show_labels=True)
            log.at(soil.end_s, "world/soil", point)
    return list(dict.fromkeys(written))


def _in_words(soil: LearntSoil) -> str:
    c, phi = learnt(soil.parameters, soil.separable, with_unit=True)
    return f"c {c}, phi {phi}"


def _say(log: Log, time_s: float, text: str, level: str) -> None:
    log.at(time_s, "log", log.rr.TextLog(text, level=level))


def _write_texts(log: Log, summary: TraverseSummary, drive: Drive, track: Track | None, warnings: list[str]) -> None:
    """Write what was found, each where it belongs in time, and all of it as a page."""
    begin = [one.start_s for one in drive.soils] + ([] if track is None else [float(track.time_s[0])])
    start_s = min(begin, default=0.0)
    _say(log, start_s, heading(summary), "INFO")
    for text in dict.fromkeys(warnings):
        _say(log, start_s, text, "WARN")
    for text in summary.notes:
        _say(log, start_s, text, "INFO")
    for one in drive.soils:
        span = f"{one.start_s:.1f} to {one.end_s:.1f} s"
        if one.estimate is None:
            _say(log, one.start_s, f"wheels, {span}: not used for soil: {one.gate_reason}", "INFO")
            continue
        soil = LearntSoil.of(one.estimate, one)
        _say(log, one.start_s, f"soil of {soil.class_name or 'ground of no class'}, {span}: {_in_words(soil)}", "INFO")
        for finding, text in zip(soil.findings, soil.problems, strict=True):
            _say(log, one.start_s, f"soil, {span}: {text}", "WARN" if finding.severity == "warning" else "INFO")
    for start, end in () if track is None else track.holes_s.tolist():
        _say(log, start, f"no places until {end:.1f} s: the vehicle is shown where it was last", "WARN")
    page = log.rr.TextDocument(_page(summary, warnings), media_type="text/markdown")
    log.static("summary", page)


def _page(summary: TraverseSummary, warnings: list[str]) -> str:
    headers, rows = ground_table(summary)
    table = [headers, ["---"] * len(headers), *rows]
    lines = [*warnings, *soil_lines(summary.soils), *sense_lines(summary)]
    return "\n".join(
        [
            f"# {_plain(heading(summary))}", "",
            *(f"| {' | '.join(map(_plain, row))} |" for row in table), "",
            *(f"- {_plain(line)}" for line in dict.fromkeys(lines)),
        ]
    )  # fmt: skip


def _plain(text: str) -> str:
    """Keep Markdown from reading marks in text of a file."""
    return "".join(f"\\{each}" if each in "\\`*_{}[]<>#|~!" else each for each in text)
