"""`explain` on a whole recording: the wheel against the simulator, and the sound against contact sound."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..audio.mismatch.explain import explain_sound
from ..identification.felt_rows import felt_rows
from ..identification.identify import open_recording
from ..identification.mismatch.explain import explain as explain_wheel
from ..identification.mismatch.explanation import Explanation
from .core.arguments import whole
from .core.errors import InputError
from .core.recording.types import Recording
from .core.soil import SoilKnowledge
from .core.vehicle import Vehicle


def explain(
    recording: Recording | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    soil: SoilKnowledge | str | Path | None = None,
    simulated: str | Path | None = None,
    seed: int = 0,
    catalogue: Iterable[str] | None = None,
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
    progress
        Told in words what is being done.

    Returns
    -------
    Explanation
        Of whatever verdict; its `sound` is None where there is no sound to explain.

    Raises
    ------
    InputError
        The recording has no wheel channels or geometry, lacks channels or rows to compare, or a name is unknown.
    """
    seed, opened = whole("seed", seed), open_recording(recording, vehicle)
    answer = explain_wheel(opened, soil=soil, simulated=simulated, seed=seed, catalogue=catalogue, progress=progress)
    if opened.sound is None:
        return answer
    if progress is not None:
        progress("listening for what is not the ground")
    try:
        sound = _explain_sound(opened, seed)
    except InputError as error:
        return replace(answer, notes=(*answer.notes, f"the sound was not explained: {error}"))
    return replace(answer, sound=sound)


def _explain_sound(recording: Recording, seed: int) -> dict | None:
    """Explain the sound along the clock of one wheel."""
    rows = felt_rows(recording)
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
    time_s, wheel_speed, travel_speed = (column[good] for column in columns)
    found = explain_sound(
        recording.sound, time_s, wheel_speed, travel_speed, lug_count=rows.wheel.grouser_count or None,
        rng=np.random.default_rng(seed),
    )  # fmt: skip
    return found.to_json()
