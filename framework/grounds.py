"""Which grounds a drive led over: from labels, from a terrain database, or from what the senses saw and heard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..database.drive_rows import drive_rows
from ..database.store import TerrainDatabase
from .core.class_names import check_class_names
from .core.errors import InputError
from .core.evidence import UNKNOWN
from .core.recording.types import Labels, Recording
from .core.track.grounds import Ground
from .core.track.way import RECORDED, Track, track_of
from .default_models import find_models, of_real_ground
from .observing import observe
from .placement import place_as_stored
from .segments import CELL_SIZE_M, LEAST_KNOWN_SHARE, ClassTrack, believe, class_track, classes_along, stretches
from .senses import senses_of


def grounds_of(
    recording: Recording,
    database: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
    *,
    doubtful: bool = False,
) -> tuple[tuple[Ground, ...], str]:
    """Find the grounds of a drive, and say what showed them.

    Names of soils in the wheel table come first, then labels of the recording, then the map of a database that knows
    the track, then the senses, by a user's own models, and at synthetic sites by those of synthetic ground. A stretch
    whose class is not sure has none.

    Parameters
    ----------
    recording
        The drive.
    database
        Path or SQLAlchemy URL of a terrain database, which need not exist.
    progress
        Called with a description of each step.
    doubtful
        Whether classes count, too, that the package's own models of real ground gave: they are often wrong, and two
        grounds that they take for one would look like missing physics.

    Returns
    -------
    grounds, source
        In order of time, and what showed them; no grounds, and why or nothing, where nothing says what the ground was.
    """
    wheel = recording.wheel
    if wheel is not None and wheel.soil is not None:
        return tuple(map(Ground, dict.fromkeys(wheel.soil.tolist()))), "the names of soils in the table"
    if wheel is None or wheel.run is not None or "time_s" not in wheel:
        return (), ""
    if recording.labels is not None and recording.labels.classes:
        return _labelled(recording.labels, recording.source), "labels of the recording"
    try:
        track = track_of(recording)
    except InputError:
        return (), ""  # `explain` notes what is wrong with the places
    if track is None or track.origin != RECORDED:
        return (), ""
    along, doubts = _on_map(recording, track, database)
    if along is not None and (doubtful or not doubts):
        return stretches(along), f"the map of {database}"
    if along is not None:
        return (), f"the map of {database} has classes by {doubts}, too often wrong to tell grounds apart: not used"
    names = senses_of(recording)
    if not names:
        return (), ""
    report = progress or (lambda _: None)
    report("recognising the ground")
    models = find_models(None, database, synthetic=recording.synthetic, senses=names)
    classifiers = {name: each for name, each in models.classifiers.items() if doubtful or name not in models.cautions}
    if not classifiers:
        return (), f"{' and '.join(names)}: no model of your own, so they do not distinguish grounds"
    records = observe(recording, track, classifiers, CELL_SIZE_M)
    belief = believe(records, track, recording.vehicle, CELL_SIZE_M)
    grounds = stretches(classes_along(belief, track, recording.vehicle, CELL_SIZE_M))
    return grounds, " and ".join(models.origins[name] for name in classifiers) if grounds else ""


def _labelled(labels: Labels, source: Path) -> tuple[Ground, ...]:
    """Grounds of labelled stretches, none of a class ``unknown``; neighbours of one class are one."""
    check_class_names((name for name in labels.classes if name != UNKNOWN), source, "labels")
    grounds: list[Ground] = []
    for start_s, end_s, label in sorted(zip(labels.start_s, labels.end_s, labels.classes, strict=True)):
        name, before = "" if label == UNKNOWN else label, grounds[-1] if grounds else None
        if before is not None and before.end_s > start_s and before.class_name != name:
            raise InputError(
                source, f"{before.class_name} until {before.end_s:g} s, {name} from {start_s:g} s", place="labels",
                expected="stretches that do not overlap",
            )  # fmt: skip
        if before is not None and before.class_name == name and before.end_s >= start_s:
            grounds[-1] = Ground(name, before.start_s, max(float(end_s), before.end_s))
        else:
            grounds.append(Ground(name, float(start_s), float(end_s)))
    return tuple(grounds)


def _on_map(recording: Recording, track: Track, database: str | Path | None) -> tuple[ClassTrack | None, str]:
    """Follow the map of a database along the track; None where it does not know most of it.

    The text names the package's own models of real ground that had a part in the map.
    """
    if database is None:
        return None, ""
    with TerrainDatabase(database) as store:
        if not store.there:
            return None, ""
        recording = place_as_stored(recording, store)
        if recording.site not in store.sites():
            return None, ""
        snapshot = store.snapshot(recording.site)
        with store.reading() as connection:
            rows = drive_rows(connection, recording.site, newest=True)
    doubts = of_real_ground(version for row in rows for version in row.models.values())
    track = track_of(recording) or track
    times = track.every(CELL_SIZE_M)
    x_m, y_m, _ = track.place_at(0.5 * (times[1:] + times[:-1]))
    answer = snapshot.along(np.column_stack([x_m, y_m]))
    probability = np.nan_to_num(answer.class_probability)
    known = np.isfinite(answer.class_probability).all(axis=1) & (probability.sum(axis=1) > 0.0)
    if not known.size or known.mean() < LEAST_KNOWN_SHARE:
        return None, ""
    return class_track(track, times, probability, known, answer.class_names), " and ".join(doubts)
