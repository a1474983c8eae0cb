"""The soil that the wheels felt along the track, attached to the class that was seen and heard there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..database.observations import SoilObservation
from ..identification.estimate.identify import Segment, identify_segments
from .core.errors import InputError
from .core.recording.types import Recording, WheelTable
from .core.track.way import DEAD_RECKONING, Track
from .perception import Progress
from .sense_map import kind_of_reason
from .stretches import ClassTrack
from .traverse_summary import LearntSoil

CHANGE_MARGIN_M = 0.5
"""Ground this near to a change of the fused class is not used for soil [m]: the change is known to about a cell, and a
stretch that holds two soils is of neither."""

AT_A_CHANGE = "at a change of ground"


@dataclass(frozen=True)
class SoilAlong:
    """What the wheels felt.

    Parameters
    ----------
    observations
        Every stretch, those that could not be used included, for the database.
    learnt
        Those that could, for the summary.
    closed_s
        For how long the wheels could not be used, by reason [s].
    used_s
        For how long they were [s].
    problems
        Why there is nothing, where there is nothing.
    """

    observations: tuple[SoilObservation, ...] = ()
    learnt: tuple[LearntSoil, ...] = ()
    closed_s: Mapping[str, float] = field(default_factory=dict)
    used_s: float = 0.0
    problems: tuple[str, ...] = ()


def learn_soil(
    recording: Recording, track: Track | None, along: ClassTrack | None, *, progress: Progress | None = None
) -> SoilAlong:
    """Identify the soil on the slow stretches of a recording, cut where the fused class changes.

    Parameters
    ----------
    recording
        Its wheel channels and its vehicle.
    track
        Where it was; None where nobody knows.
    along
        The fused class along the track; None where nobody knows.
    progress
        Told how far it has come.

    Returns
    -------
    SoilAlong
        With the reason in `problems` where the recording does not allow it.
    """
    if recording.wheel is None:
        return SoilAlong(problems=("no wheel channels in the recording: no soil was identified",))
    if recording.vehicle is None:
        return SoilAlong(problems=("no wheel geometry (vehicle.toml): no soil was identified",))
    if "time_s" not in recording.wheel or recording.wheel.run is not None:
        return SoilAlong(problems=("steady-state trials have no time and place: `bevameter identify` is for them",))
    early, late = _around_changes(track, along)
    if progress is not None:
        progress("soil", 0.0)
    try:
        segments = identify_segments(recording, boundaries_s=np.sort(np.concatenate([early, late])))
    except InputError as error:
        return SoilAlong(problems=(f"no soil was identified: {error}",))
    observations = []
    for segment in segments:
        middle = 0.5 * (segment.start_s + segment.end_s)
        if segment.used and np.any((early <= middle) & (middle <= late)):
            segment = replace(segment, used=False, reason=AT_A_CHANGE, estimate=None)
        belief = along.belief_between(segment.start_s, segment.end_s) if along is not None else {}
        observations.append(_observation(segment, belief, recording.wheel, track))
    if progress is not None:
        progress("soil", 1.0)
    return recall_soil(tuple(observations))


def recall_soil(observations: tuple[SoilObservation, ...]) -> SoilAlong:
    """Sum up what was observed of the soil, now or when the drive was stored."""
    learnt = []
    closed: dict[str, float] = {}
    used_s = 0.0
    for one in observations:
        if one.estimate is not None:
            used_s += one.end_s - one.start_s
            learnt.append(LearntSoil.of(one.estimate, one.class_probabilities, one.start_s, one.end_s))
        else:
            kind = kind_of_reason(one.gate_reason)
            closed[kind] = closed.get(kind, 0.0) + one.end_s - one.start_s
    longest_first = dict(sorted(closed.items(), key=lambda item: -item[1]))
    return SoilAlong(observations, tuple(learnt), longest_first, used_s)


def _around_changes(track: Track | None, along: ClassTrack | None) -> tuple[np.ndarray, np.ndarray]:
    """Times `CHANGE_MARGIN_M` of way before and after each change of the fused class, (m,) each [s]."""
    if track is None or along is None:
        return np.empty(0), np.empty(0)
    way, times = track.way_m, along.changes_s()
    at = np.interp(times, track.time_s, way)
    # Searched in the way itself: a vehicle that stands makes time pass without it.
    early = track.time_s[np.maximum(np.searchsorted(way, at - CHANGE_MARGIN_M, side="right") - 1, 0)]
    late = track.time_s[np.minimum(np.searchsorted(way, at + CHANGE_MARGIN_M, side="left"), len(way) - 1)]
    return np.minimum(early, times), np.maximum(late, times)


def _observation(segment: Segment, belief: dict[str, float], wheel: WheelTable, track: Track | None) -> SoilObservation:
    x_m = y_m = np.nan
    if track is not None and track.origin != DEAD_RECKONING:
        times = np.linspace(segment.start_s, segment.end_s, 33)
        x, y, _ = track.place_at(times)
        if np.isfinite(x).any():
            x_m, y_m = float(np.nanmean(x)), float(np.nanmean(y))
    estimate = segment.estimate if segment.used else None
    stresses = [one.normal_stress_Pa for one in estimate.shear_strength] if estimate is not None else []
    return SoilObservation(
        start_s=segment.start_s,
        end_s=segment.end_s,
        x_m=x_m,
        y_m=y_m,
        class_probabilities=belief,
        estimate=estimate,
        normal_stress_Pa=(min(stresses, default=np.nan), max(stresses, default=np.nan)),
        load_N=_mean_load(wheel, segment.start_s, segment.end_s),
        gate_reason="" if estimate is not None else segment.reason or "no estimate",
    )


def _mean_load(wheel: WheelTable, start_s: float, end_s: float) -> float:
    load, time_s = wheel.get("load_N"), wheel.get("time_s")
    if load is None or time_s is None:
        return float("nan")
    inside = load[(time_s >= start_s) & (time_s <= end_s) & np.isfinite(load)]
    return float(inside.mean()) if len(inside) else float("nan")
