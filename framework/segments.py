"""Segments of the track: the fused class along it, and the soil that was identified on the slow ones of one class."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from ..database.observations import SoilEffect, SoilObservation
from ..identification.estimate.identify import Segment, identify_segments
from ..identification.rows.weight import with_loads
from .core.errors import InputError
from .core.evidence import UNKNOWN
from .core.recording.types import Recording, WheelTable
from .core.track.grounds import CHANGE_MARGIN_M, Ground
from .core.track.way import DEAD_RECKONING, Track, cells_under_wheels
from .core.vehicle import Vehicle
from .fusion import Belief, fuse
from .sense_map import Progress, SenseRecord, kind_of_reason
from .summary import LearntSoil

CELL_SIZE_M = 0.5
"""Edge of a ground cell unless stated [m]: about the width of a rut and of what a camera patch
covers a few metres ahead."""

PATCH_LENGTH_M = 10.0
"""Typical length of ground of one class [m]: what a change of class from cell to cell is weighed against."""

LEAST_KNOWN_SHARE = 0.5
"""A stretch of whose cells fewer than this share are known has no class [-]."""

LEAST_CLASS_PROBABILITY = 2.0 / 3.0
"""A stretch whose class is less probable than this has none [-]: a soil filed under a wrong class misleads every
query of that class."""

AT_A_CHANGE = "at a change of ground"


@dataclass(frozen=True)
class ClassTrack:
    """The fused class of m pieces of the track, each about a cell long.

    Parameters
    ----------
    start_s, end_s : (m,)
        When the wheels were on the piece [s].
    length_m : (m,)
        Its length [m].
    probabilities : (m, k)
        Belief over the classes under the wheels, mean of their known cells; uniform where none is known.
    known : (m,)
        Is any cell under the wheels known?
    label : (m,) int
        The class of the piece in the most probable sequence of classes; -1 where the senses know no class at all.
    classes
        The k names.
    """

    start_s: np.ndarray
    end_s: np.ndarray
    length_m: np.ndarray
    probabilities: np.ndarray
    known: np.ndarray
    label: np.ndarray
    classes: tuple[str, ...]

    def changes_s(self) -> np.ndarray:
        """Times at which the class changes [s]."""
        return self.start_s[1:][self.label[1:] != self.label[:-1]]

    def metres(self) -> dict[str, float]:
        """Length of track by class, and of what stays unknown, where there is any [m]."""
        names = [*self.classes, UNKNOWN]
        label = np.where(self.known, self.label, len(self.classes))
        sums = np.bincount(label, self.length_m, len(names))
        return {name: float(length) for name, length in zip(names, sums, strict=True) if length > 0}

    def belief_between(self, start_s: float, end_s: float) -> dict[str, float]:
        """Give the mean belief over a stretch of time, by class; empty where it is too little known, or too unsure."""
        overlap = np.clip(np.minimum(self.end_s, end_s) - np.maximum(self.start_s, start_s), 0.0, None)
        total, known = float(overlap.sum()), overlap * self.known
        if total <= 0 or not self.classes or known.sum() < LEAST_KNOWN_SHARE * total:
            return {}
        mean = known @ self.probabilities / known.sum()
        if mean.max() < LEAST_CLASS_PROBABILITY:
            return {}
        return {name: float(value) for name, value in zip(self.classes, mean, strict=True)}


def believe(
    records: tuple[SenseRecord, ...], track: Track | None, vehicle: Vehicle | None, cell_size_m: float
) -> Belief:
    """Fuse the senses over all cells that they looked at and all that the wheels ran over."""
    under_wheels = None
    if track is not None:
        times = track.every(cell_size_m)
        under_wheels = cells_under_wheels(track, vehicle, times[:-1], times[1:], cell_size_m)[1]
    return fuse([record.map for record in records], cells=under_wheels)


def classes_along(belief: Belief, track: Track, vehicle: Vehicle | None, cell_size_m: float) -> ClassTrack:
    """Follow the belief along the track.

    Single cells that are wrong would cut a stretch to pieces, so the class is the most probable *sequence* under a
    Markov chain that changes once in `PATCH_LENGTH_M` on average (Viterbi 1967, doi:10.1109/TIT.1967.1054010).
    """
    times = track.every(cell_size_m)
    start_s, end_s = times[:-1], times[1:]
    window, cells = cells_under_wheels(track, vehicle, start_s, end_s, cell_size_m)
    row = belief.rows(cells)
    seen = row >= 0
    seen[seen] = ~belief.unknown[row[seen]]
    m, k = len(start_s), len(belief.classes)
    weight = np.bincount(window[seen], belief.quality[row[seen]], m)
    sums = np.zeros((m, k))
    np.add.at(sums, window[seen], belief.quality[row[seen]][:, None] * belief.probabilities[row[seen]])
    known = weight > 0
    return class_track(track, times, sums / np.where(known, weight, 1.0)[:, None], known, belief.classes)


def class_track(
    track: Track, times_s: np.ndarray, probabilities: np.ndarray, known: np.ndarray, classes: tuple[str, ...]
) -> ClassTrack:
    """Find the most probable sequence of classes along a track.

    Parameters
    ----------
    track
        The way.
    times_s : (m + 1,)
        Times between which the pieces of the track lie [s].
    probabilities : (m, k)
        Belief over the classes on each piece, of any value where it is not `known` (m,).
    known, classes
        As in `ClassTrack`.
    """
    start_s, end_s, k = times_s[:-1], times_s[1:], len(classes)
    believed = np.where(known[:, None], probabilities, 1.0 / max(k, 1))
    length_m = np.interp(end_s, track.time_s, track.way_m) - np.interp(start_s, track.time_s, track.way_m)
    label = _most_probable_sequence(believed, length_m) if k else np.full(len(start_s), -1)
    return ClassTrack(start_s, end_s, length_m, believed, known, label, classes)


def change_probability(length_m: np.ndarray) -> np.ndarray:
    """Probability that the class changes over a length of track, (m,) [m]."""
    return 1.0 - np.exp(-np.maximum(length_m, 1e-6) / PATCH_LENGTH_M)


def _most_probable_sequence(probabilities: np.ndarray, length_m: np.ndarray) -> np.ndarray:
    m, k = probabilities.shape
    if k == 1 or m == 0:
        return np.zeros(m, dtype=np.int64)
    change = change_probability(length_m)
    stay, leave = np.log1p(-change), np.log(change / (k - 1))
    logs = np.log(np.maximum(probabilities, 1e-9))
    score, back = logs[0], np.zeros((m, k), dtype=np.int64)
    for piece in range(1, m):  # one step a cell of track, k numbers each
        keep = score + stay[piece]
        best = int(np.argmax(score))
        switch = score[best] + leave[piece]
        moved = keep < switch
        back[piece] = np.where(moved, best, np.arange(k))
        score = np.where(moved, switch, keep) + logs[piece]
    label = np.empty(m, dtype=np.int64)
    label[-1] = int(np.argmax(score))
    for piece in range(m - 1, 0, -1):
        label[piece - 1] = back[piece, label[piece]]
    return label


def stretches(along: ClassTrack) -> tuple[Ground, ...]:
    """Return the grounds between changes of class; one without a class where it is not sure."""
    if not along.classes or not along.known.any():
        return ()
    edges = np.concatenate([[0], np.flatnonzero(np.diff(along.label)) + 1, [len(along.label)]])
    grounds = []
    for first, last in pairwise(edges.tolist()):
        start_s, end_s = float(along.start_s[first]), float(along.end_s[last - 1])
        belief = along.belief_between(start_s, end_s)
        name = max(belief, key=belief.__getitem__) if belief else UNKNOWN
        grounds.append(Ground("" if name == UNKNOWN else name, start_s, end_s))
    return tuple(grounds)


@dataclass(frozen=True)
class SoilAlong:
    """What the wheels measured.

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
    recording: Recording,
    track: Track | None,
    along: ClassTrack | None,
    *,
    effects: Mapping[str, tuple[SoilEffect, ...]] = MappingProxyType({}),
    progress: Progress | None = None,
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
    effects
        What was subtracted from the wheel channels before, by class.
    progress
        Called with the share done.

    Returns
    -------
    SoilAlong
        With the reason in `problems` where the recording does not allow it.
    """
    if recording.wheel is None:
        return SoilAlong(problems=("no wheel channels in the recording: no soil was identified",))
    if recording.vehicle is None or not recording.vehicle.wheels:
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
    wheel = with_loads(recording.wheel, recording.vehicle, recording.pose)[0]
    known = stretches(along) if along is not None else ()
    observations = []
    for segment in segments:
        middle = 0.5 * (segment.start_s + segment.end_s)
        if segment.used and np.any((early <= middle) & (middle <= late)):
            segment = replace(segment, used=False, reason=AT_A_CHANGE, estimate=None)
        belief = along.belief_between(segment.start_s, segment.end_s) if along is not None else {}
        under = next((each.class_name for each in known if each.start_s <= middle <= each.end_s), "")
        observations.append(replace(_observation(segment, belief, wheel, track), effects=effects.get(under, ())))
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
            learnt.append(LearntSoil.of(one.estimate, one))
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
