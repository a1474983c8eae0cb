"""`explain`: why simulation and recording differ."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path

from threadpoolctl import threadpool_limits

from ...framework.core.arguments import path_of, refused, whole
from ...framework.core.errors import InputError
from ...framework.core.recording.types import Recording
from ...framework.core.soil import SoilKnowledge, as_knowledge
from ...framework.core.track.grounds import Ground
from ...framework.core.track.way import Track, track_of
from ...framework.core.vehicle import Vehicle
from ..effects.catalogue import SLUGS
from ..estimate.identify import open_recording
from ..rows.on_track import with_grounds, with_places, without_hard_ground
from ..rows.select import select_wheel_rows
from ..rows.settling import only_steady
from ..rows.words import sentence
from .answer import assemble, choose
from .attach import attach
from .change_points import changed_grounds, seems_changed
from .explanation import Explanation
from .fit import fit_textbook
from .locate import locate
from .posterior import Posterior, posterior
from .samples import Samples, gather
from .search import Search, search
from .simulated import as_differences
from .words import summarise, trust


def explain(
    recording: Recording | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    soil: SoilKnowledge | str | Path | None = None,
    simulated: str | Path | None = None,
    seed: int = 0,
    catalogue: Iterable[str] | None = None,
    grounds: Sequence[Ground] = (),
    progress: Callable[[str], None] | None = None,
) -> Explanation:
    """Compare a recording with the simulation and identify the physics or faults that the simulation omits.

    Parameters
    ----------
    recording
        A recording, the path of one, or the path of a single wheel file.
    vehicle
        The vehicle, or its TOML file; the recording's own where absent.
    soil
        Prior knowledge of the soil, or its TOML file: it separates causes that fit equally well.
    simulated
        Another simulator's wheel file for the same drive; the built-in simulator, its soil refitted, where absent.
    seed
        Seed of the bootstrap for the intervals of held-out errors.
    catalogue
        Public names of the effects to consider; all where absent.
    grounds
        Grounds that the drive leads over, in order of time; one where absent.
    progress
        Called with a description of each step.

    Returns
    -------
    Explanation
        The result; see `Explanation.verdict`.

    Raises
    ------
    InputError
        The recording has no wheel channels or geometry, lacks channels or rows to compare, or a name is unknown.
    """
    began, report = time.perf_counter(), progress or (lambda _: None)
    seed, considered = whole("seed", seed), _considered(catalogue)
    opened, known = open_recording(recording, vehicle), as_knowledge(soil)
    if simulated is not None:
        simulated = path_of("simulated", simulated, "the path of a wheel file")
    rows = select_wheel_rows(opened, every_row=simulated is not None)
    table, notes = rows.table, (*opened.notes, *opened.problems, *map(sentence, rows.findings))
    if simulated is not None:
        table, made = attach(table, simulated, rows.wheel)
        table, unsteady = only_steady(table)
        notes = (*notes, *made, *map(sentence, unsteady))
    # Fits run in parallel: threads of BLAS would only compete with them.
    with threadpool_limits(1):
        track, untracked = _track(opened) if "time_s" in table else (None, ())
        table, notes = with_places(table, rows.vehicle, track), (*notes, *untracked)
        if grounds:
            table = with_grounds(table, rows.vehicle, track, grounds)
            table, hard = without_hard_ground(table, rows.wheel, grounds)
            notes = (*notes, *hard)
        samples, own = gather(table, rows.wheel, rows.vehicle, grounds or (Ground(),)), None
        if len(samples.grounds) > 1 and known.values:
            raise InputError(
                "soil", f"one soil for {len(samples.grounds)} grounds", expected="a recording, or a part, on one ground"
            )
        if simulated is not None:
            report("fitting the textbook wheel to the other simulator")
            samples, own = as_differences(samples, simulated)
        found, probabilities = _analyse(samples, known, considered, report)
        if not grounds and simulated is None and not known.values and seems_changed(found, probabilities):
            report("dividing the drive where the soil changes")
            if divided := changed_grounds(found, probabilities):
                parted = with_grounds(table, rows.vehicle, track, divided)
                samples = gather(parted, rows.wheel, rows.vehicle, divided)
                found, probabilities = _analyse(samples, known, considered, report)
                notes = (*notes, _division(divided))
        problem, chosen = found.problem, choose(found.problem, found, probabilities)
        report("locating the mismatch")
        regions = locate(problem, chosen.hypothesis.fitted)
        answer = assemble(
            problem, found, probabilities, chosen, regions, source=opened.described, seed=seed, began=began,
            notes=notes, simulated=own,
        )  # fmt: skip
    return replace(
        answer, summary=summarise(answer), trust=trust(answer), vehicle=rows.vehicle.identity,
        seconds=time.perf_counter() - began,
    )  # fmt: skip


def _analyse(
    samples: Samples, known: SoilKnowledge, considered: tuple[str, ...], report: Callable[[str], None]
) -> tuple[Search, Posterior]:
    """Fit soils, search hypotheses and compute their probabilities."""
    report("fitting the soil")
    problem, textbook = fit_textbook(samples, known)
    found = search(problem, textbook, considered, report)
    report("computing posterior probabilities")
    return found, posterior(found)


def _track(recording: Recording) -> tuple[Track | None, tuple[str, ...]]:
    """Return the track, or why there is none: grounds are then told apart by time."""
    try:
        return track_of(recording), ()
    except InputError as error:
        return None, (f"no track: {error}",)


def _division(grounds: Sequence[Ground]) -> str:
    times = ", ".join(f"{0.5 * (before.end_s + after.start_s):.0f}" for before, after in pairwise(grounds))
    return (
        f"nothing says what the ground was; by the wheels' behaviour the soil changes at {times} s: each part has a "
        "soil of its own. If the ground does not change there, something else does: state its classes in labels.csv "
        "(start_s, end_s, class)"
    )


def _considered(catalogue: Iterable[str] | None) -> tuple[str, ...]:
    """Public names of the effects to consider; raises `InputError` where they are no list or one is unknown."""
    if catalogue is None:
        return tuple(SLUGS)
    if isinstance(catalogue, str) or not isinstance(catalogue, Iterable):
        raise refused("catalogue", catalogue, "a list of names of effects")
    names = tuple(catalogue)
    for each in names:
        if not isinstance(each, str) or each not in SLUGS:
            similar = get_close_matches(str(each), SLUGS, cutoff=0.0)
            raise refused("catalogue", each, f"names of effects, such as {', '.join(similar)}")
    return names
