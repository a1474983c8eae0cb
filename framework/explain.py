"""`explain` on a whole recording: the wheel against the simulator, and the sound against contact sound."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..audio.explain.explain import explain_sound
from ..database.store import TerrainDatabase
from ..identification.estimate.identify import open_recording
from ..identification.explain.explain import explain as explain_wheel
from ..identification.explain.explanation import Explanation
from ..identification.rows.select import select_wheel_rows
from .core.arguments import whole
from .core.class_names import check_class_name
from .core.errors import InputError
from .core.recording.sheet import ENDINGS
from .core.recording.types import Recording
from .core.soil import SoilKnowledge
from .core.sound_explanation import SoundFindings
from .core.vehicle import Vehicle
from .grounds import grounds_of
from .part import part_of


def explain(
    recording: Recording | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    soil: SoilKnowledge | str | Path | None = None,
    simulated: str | Path | None = None,
    seed: int = 0,
    catalogue: Iterable[str] | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
    on: str | None = None,
    wheels: str | Sequence[str] = (),
    database: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Explanation:
    """Say why simulation and recording differ; where the recording has sound, what it holds besides the ground.

    Parameters
    ----------
    recording
        A recording, or the path of one, or of a single wheel file.
    vehicle
        The vehicle, or its TOML file; the recording's own where absent.
    soil
        What is known of the soil from elsewhere, or its TOML file: it breaks ties.
    simulated
        Another simulator's wheel file for the same drive; the built-in simulator, its soil refitted, where absent.
    seed
        Of all randomness.
    catalogue
        Public names of the effects to consider; all where absent.
    from_s, to_s, on, wheels
        The part that is explained: a span of time [s], a class of ground, wheels; see `part_of`. The sound is explained
        from the first row of the part to its last.
    database
        Path or URL of a terrain database whose map says which classes of ground the drive led over, where the
        recording's own labels do not; what the senses saw and heard says it where neither does (`grounds_of`).
    progress
        Called with what is being done, in words.

    Returns
    -------
    Explanation
        Of whatever verdict; its `sound` is None where there is no sound to explain.

    Raises
    ------
    InputError
        The recording has no wheel channels, geometry or such part, lacks channels or rows to compare, or a name is
        unknown.
    """
    seed, report = whole("seed", seed), progress or (lambda _: None)
    report("reading the recording")
    recorded = open_recording(recording, vehicle)
    grounds, known_by = grounds_of(recorded, database, progress, doubtful=on is not None)
    opened = part_of(recorded, from_s=from_s, to_s=to_s, on=on, wheels=wheels, grounds=grounds)
    answer = explain_wheel(
        opened, soil=soil, simulated=simulated, seed=seed, catalogue=catalogue, grounds=grounds, progress=progress
    )
    if known_by and not grounds:
        answer = replace(answer, notes=(known_by, *answer.notes))
    elif known_by:
        names = list(dict.fromkeys(each.class_name or "not sure" for each in answer.grounds))
        answer = replace(answer, notes=(f"classes of ground: {', '.join(names)}, by {known_by}", *answer.notes))
    if opened.sound is None:
        return answer
    report("explaining the sound")
    try:
        sound = _explain_sound(recorded, seed, opened)
    except InputError as error:
        return replace(answer, notes=(*answer.notes, f"the sound was not explained: {error}"))
    return replace(answer, sound=sound)


def check_store(database: str | Path | None, class_name: str | None, recording: str | Path) -> None:
    """Find out before long work whether its answer can be stored; raises `InputError` where it cannot.

    Parameters
    ----------
    database
        Path or SQLAlchemy URL of the terrain database, which need not exist yet.
    class_name
        The class of terrain; None where the recording says it.
    recording
        The recording's path.
    """
    if class_name is not None:
        check_class_name(class_name, "--class")
        if database is None:
            raise InputError("--db", "is missing, and --class is given", expected="both, to store what is found")
    elif database is not None and str(recording).lower().endswith(ENDINGS) and not Path(recording).is_dir():
        raise InputError("--class", "is missing", expected="the class of the ground: a wheel file does not say it")
    if database is not None:
        TerrainDatabase(database).close()


def store(answer: Explanation, database: str | Path, class_name: str | None = None) -> tuple[str, ...]:
    """Store soil and effects that were found with the classes of terrain, for predictions on these.

    What a class has already as its newest, as where a recording is explained again, is stored once. Of several grounds
    of a class, that with most rows gives its soil.

    Parameters
    ----------
    answer
        What `explain` found.
    database
        Path or SQLAlchemy URL of the terrain database; made where there is none.
    class_name
        The class of terrain that the recording was driven on, spelt as drives have it; those of its grounds where
        absent.

    Returns
    -------
    tuple of str
        Names of the classes with which something was stored: faults of one wheel, and what single runs had, are not.

    Raises
    ------
    InputError
        No effect is asserted; one of the effects is less likely than not; the class is not known, or is one for several
        grounds; or the database or the class is refused.
    """
    if answer.verdict not in ("physics", "instrument"):
        raise InputError(
            answer.source, f"nothing was found to store: the verdict is {answer.verdict}",
            expected="missing physics or a fault of an instrument that is asserted",
        )  # fmt: skip
    physics = {name: answer.physics_of(ground) for name, ground in _ground_by_class(answer, class_name).items()}
    stored = {name: each for name, each in physics.items() if each.effects}
    if class_name is not None and not stored:
        raise InputError(
            answer.source, "what was found acts on one wheel or in single runs",
            expected="an effect of the whole vehicle or of the class",
        )  # fmt: skip
    if stored:
        with TerrainDatabase(database) as opened:
            for name, each in stored.items():
                opened.add_physics(name, each, source=answer.source)
    return tuple(stored)


def _ground_by_class(answer: Explanation, class_name: str | None) -> dict[str, int]:
    """Number of the ground whose soil is stored with each class; raises `InputError` where there is none."""
    if class_name is not None:
        if len(answer.grounds) > 1:
            raise InputError("--class", class_name, expected="none: the drive led over several grounds")
        return {class_name: 0}
    chosen: dict[str, int] = {}
    for number, ground in enumerate(answer.grounds):
        before = chosen.get(ground.class_name)
        if ground.class_name and (before is None or ground.n > answer.grounds[before].n):
            chosen[ground.class_name] = number
    if not chosen:
        raise InputError("--class", "is missing", expected="the class of the ground, which the recording does not say")
    return chosen


def _explain_sound(recording: Recording, seed: int, part: Recording) -> SoundFindings:
    """Explain the sound along the clock of one wheel, from the first row of a part of the recording to its last."""
    rows = select_wheel_rows(recording)
    table = rows.table
    names = ("time_s", "wheel_speed_rad_s", "travel_speed_m_s")
    missing = [name for name in names if name not in table]
    if recording.sound is None or missing:
        raise InputError(
            recording.source, f"no column {', '.join(missing)}", expected="the wheel's and the travel speed"
        )
    if table.wheel is not None:
        table = table.select(table.wheel == table.wheel[0])
    columns = [table[name] for name in names]
    good = np.isfinite(np.column_stack(columns)).all(axis=1)
    if part is not recording and part.wheel is not None:
        good &= (columns[0] >= np.nanmin(part.wheel["time_s"])) & (columns[0] <= np.nanmax(part.wheel["time_s"]))
    time_s, wheel_speed, travel_speed = (column[good] for column in columns)
    return explain_sound(
        recording.sound, time_s, wheel_speed, travel_speed, lug_count=rows.wheel.grouser_count or None,
        rng=np.random.default_rng(seed),
    ).findings  # fmt: skip
