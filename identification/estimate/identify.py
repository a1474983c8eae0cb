"""`identify`: the soil of a recording from its wheel channels, stretch by stretch and overall."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.stats import t as t_distribution
from threadpoolctl import threadpool_limits

from ...framework.core.arguments import refused
from ...framework.core.concurrency import together
from ...framework.core.errors import InputError
from ...framework.core.findings import Finding, codes, note, warning
from ...framework.core.recording.readers import read_recording
from ...framework.core.recording.types import Recording, WheelTable
from ...framework.core.soil import WRONG_FORM, Quantity, SoilEstimate, SoilKnowledge, as_knowledge
from ...framework.core.vehicle import Vehicle, Wheel, as_vehicle
from ..mechanics import linearised
from ..mechanics.textbook import CHANNELS
from ..rows.gate import Stretch
from ..rows.geometry import by_geometry, by_soil
from ..rows.noise import measured_noise, sensor_noise
from ..rows.select import SelectedRows, as_trials, select_wheel_rows
from .change_points import split_soils
from .computed_channels import Computed, noise_of_shape
from .estimate import estimate_soil, solve, summarise, usable
from .identifiability import wald_strengths
from .noise_likelihood import autocorrelation_finding, solve_with_noise, with_autocorrelated_noise
from .solution import Measured

Method = Literal["ml", "linear"]
Report = Callable[[str], None]

METHODS: tuple[Method, ...] = ("ml", "linear")

REPRESENTATIVE_K_M = 0.01
"""Janosi shear modulus [m] that the linear method assumes where none is known: middle of Wong (2010), Table 2.3."""

COMPUTED = ("load_computed", "load_without_slope", "torque_computed", "pull_computed", "travel_speed_computed")
"""Findings that say which channels were not sensed, and what they were computed from."""

MIXED = 1.5
"""An overall misfit this many times that of the worst stretch means that one soil does not explain them all [-]."""

MOST_ROWS = 1500
"""A stretch with more rows is thinned evenly to this number: intervals are then those of the rows kept."""


@dataclass(frozen=True)
class Segment:
    """One stretch of the drive [s] (NaN for steady-state trials): used, with its estimate, or not, with the reason.

    `wheel` says which wheel it is, where the recording describes several and is no one vehicle's; `soil` which soil,
    where the rows name it.
    """

    start_s: float
    end_s: float
    used: bool
    reason: str
    n: int
    estimate: SoilEstimate | None = None
    wheel: str = ""
    soil: str = ""


@dataclass(frozen=True)
class Identification:
    """Soil by segment, and over all rows that were used: None where there were none, or rows of several wheels or
    soils, or no one soil explains all stretches.

    `by_soil` is that over the rows of each soil that the table names, where it names several.
    """

    overall: SoilEstimate | None
    segments: tuple[Segment, ...]
    method: str
    findings: tuple[Finding, ...] = ()
    by_soil: Mapping[str, SoilEstimate] = field(default_factory=dict)


def identify(
    recording: Recording | str | Path,
    *,
    vehicle: Vehicle | str | Path | None = None,
    soil: SoilKnowledge | str | Path | None = None,
    method: Method = "ml",
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify the soil from the wheel channels of a recording.

    Parameters
    ----------
    recording
        A recording, or the path of one, or of a single wheel file.
    vehicle
        The vehicle, or its TOML file; the recording's own where absent.
    soil
        What is known of the soil already, or its TOML file.
    method
        ``"ml"``: maximum likelihood with errors in all channels. ``"linear"``: the paper's Eq. 22.
    progress
        Called with what is being done, in words.

    Returns
    -------
    Identification
        With `overall` None, and the reasons in `segments`, where no row could be used.

    Raises
    ------
    InputError
        The recording has no wheel channels, no geometry, or lacks channels that the method needs.
    """
    if method not in METHODS:
        raise refused("method", method, " or ".join(METHODS))
    recording, known = open_recording(recording, vehicle), as_knowledge(soil)
    wheels = by_geometry(recording)
    parts = [part for wheel in wheels for part in by_soil(wheel)]
    report = progress or _silent
    if len(parts) > 1:
        result = _several(parts, len(wheels), known, method, report)
    else:
        result = _one_wheel(parts[0], known, method, report)
    read = (note("recording", text=problem) for problem in (*recording.notes, *recording.problems))
    return replace(result, findings=(*read, *result.findings))


def _silent(doing: str) -> None:
    """Report no progress."""


def _several(
    parts: list[Recording], wheels: int, known: SoilKnowledge, method: Method, report: Report
) -> Identification:
    """Identify each soil that the rows name, and the soil under each wheel, by itself: nothing says that it is one."""
    soils = list(dict.fromkeys(part.wheel.soil[0] for part in parts if part.wheel and part.wheel.soil is not None))
    segments, findings, found = list[Segment](), list[Finding](), dict[str, SoilEstimate]()
    findings += [note("several_wheels", wheels=wheels)] if wheels > 1 else []
    findings += [note("several_soils", soils=soils)] if len(soils) > 1 else []
    for part in parts:
        assert part.wheel is not None
        wheel = part.vehicle.name if wheels > 1 and part.vehicle is not None else ""
        soil = "" if part.wheel.soil is None else str(part.wheel.soil[0])
        try:
            result = _one_wheel(part, known, method, lambda doing, of=wheel or soil: report(f"{of}: {doing}"))
        except InputError as error:
            segments.append(Segment(math.nan, math.nan, False, str(error), len(part.wheel), wheel=wheel, soil=soil))
            continue
        segments.extend(replace(segment, wheel=wheel, soil=soil) for segment in result.segments)
        name = ", ".join(filter(None, (wheel, soil)))
        findings.extend(each.with_values(of_wheel=name) for each in result.findings)
        if soil and result.overall is not None:
            found[name] = result.overall
    return Identification(None, tuple(segments), method, tuple(findings), found)


def _one_wheel(recording: Recording, known: SoilKnowledge, method: Method, report: Report) -> Identification:
    rows = as_trials(select_wheel_rows(recording))
    stretches = rows.stretches()
    segments = _identify_stretches(rows, stretches, known, method, report)
    chosen = [stretch.rows for stretch in stretches if not stretch.reason]
    found = [segment.estimate for segment in segments if segment.used]
    overall, findings = None, [*rows.findings]
    if rows.wheel.grouser_count and rows.wheel.grouser_height_m:
        findings.append(note("grousers_left_out"))
    if found and any(len(each) > MOST_ROWS for each in chosen):
        findings.append(note("thinned", rows=MOST_ROWS))
    if len(found) == 1:
        overall = found[0]
    elif found:
        worst = max(each.misfit for each in found if each is not None)
        report("estimating one soil over all stretches")
        overall = _overall(rows, np.sort(np.concatenate(chosen)), known, method, MIXED * worst)
        if overall is None:
            findings.append(warning("mixed_soils"))
    return Identification(overall, segments, method, tuple(findings))


def identify_segments(
    recording: Recording,
    *,
    boundaries_s: Sequence[float] | np.ndarray = (),
) -> tuple[Segment, ...]:
    """Identify the soil of each quasi-static stretch, cut where the ground is known to change (`boundaries_s` [s])."""
    rows = select_wheel_rows(recording)
    boundaries = np.asarray(boundaries_s, dtype=float)
    segments = _identify_stretches(rows, rows.stretches(boundaries), SoilKnowledge(), "ml", _silent)
    computed = tuple(each for each in rows.findings if each.code in COMPUTED)
    return tuple(
        each if each.estimate is None
        else replace(each, estimate=replace(each.estimate, findings=(*each.estimate.findings, *computed)))
        for each in segments
    )  # fmt: skip


def _identify_stretches(
    rows: SelectedRows, stretches: Sequence[Stretch], known: SoilKnowledge, method: Method, report: Report
) -> tuple[Segment, ...]:
    """Identify the soil of each stretch, two of them at once; the segments in order."""
    used = [stretch for stretch in stretches if not stretch.reason]

    def identified(stretch: Stretch) -> list[Segment]:
        of = f"stretch {used.index(stretch) + 1} of {len(used)}: " if len(used) > 1 and not stretch.reason else ""
        return _segments(rows, stretch, known, method, lambda doing: report(of + doing))

    # The threads fill the cores by themselves: more of BLAS's own would only wait for each other.
    with threadpool_limits(1):
        found = iter(together(identified, used))
        return tuple(chain.from_iterable(identified(each) if each.reason else next(found) for each in stretches))


def _segments(
    rows: SelectedRows, stretch: Stretch, known: SoilKnowledge, method: Method, report: Report
) -> list[Segment]:
    """Identify one stretch; several segments where the soil changes within it."""
    n = len(stretch.rows)
    if stretch.reason:
        return [Segment(stretch.start_s, stretch.end_s, False, stretch.reason, n)]
    timed = "time_s" in rows.table
    try:
        if not timed or method == "linear":
            report("estimating the soil")
            estimate = _estimate(rows, stretch.rows, known, method)
            return [Segment(stretch.start_s, stretch.end_s, True, "", n, estimate)]
        return _soils(rows, stretch, known, report)
    except InputError as error:
        if not timed:
            raise
        return [Segment(stretch.start_s, stretch.end_s, False, error.problem, n)]


def _soils(rows: SelectedRows, stretch: Stretch, known: SoilKnowledge, report: Report) -> list[Segment]:
    report("fitting the soil and the sensors' noise")
    kept, whole, notes = solve_with_noise(usable(measured_rows(rows, stretch.rows)), rows.wheel, known)
    report("looking for changes of soil")
    parts = [(slice(0, len(kept.channels)), with_autocorrelated_noise(kept, whole, rows.wheel, known))]
    if rows.table.run is None:  # of runs that share a clock, rows are in no order of time
        parts = split_soils(kept, rows.wheel, known, whole)
    borders = [float(kept.order[part.start]) for part, _ in parts[1:]]
    starts, ends = [stretch.start_s, *borders], [*borders, stretch.end_s]
    segments = []
    for number, ((part, solution), start, end) in enumerate(zip(parts, starts, ends, strict=True), 1):
        report(f"computing intervals, part {number} of {len(parts)}")
        own = kept.select(part)
        estimate = summarise(solution, own, rows.wheel, notes=(*notes, *autocorrelation_finding(kept, solution)))
        estimate = _as_far_as_known(rows, estimate)
        segments.append(Segment(start, end, True, "", len(own.channels), estimate))
    return segments


def _estimate(rows: SelectedRows, chosen: np.ndarray, known: SoilKnowledge, method: Method) -> SoilEstimate:
    if method == "linear":
        return _linear(rows.table.select(chosen), rows.wheel, known)
    return estimate_soil(measured_rows(rows, chosen), rows.wheel, known)


def _overall(
    rows: SelectedRows, chosen: np.ndarray, known: SoilKnowledge, method: Method, most_misfit: float
) -> SoilEstimate | None:
    """Give one estimate over several stretches; None where it would mix soils, and misfit as no stretch does."""
    if method == "linear":
        return _estimate(rows, chosen, known, method)
    kept, wheel = usable(measured_rows(rows, chosen)), rows.wheel
    alone = solve(kept, wheel, known)
    # Less noise is only taken where the form then holds: what misfits by more than that is mixed with any.
    if alone.misfit > max(most_misfit, WRONG_FORM):
        correlated = with_autocorrelated_noise(kept, alone, wheel, known)
        if correlated.misfit > max(most_misfit, WRONG_FORM):
            return None
    kept, solution, notes = solve_with_noise(kept, wheel, known, alone)
    solution = with_autocorrelated_noise(kept, solution, wheel, known)
    if solution.misfit > most_misfit:
        return None
    notes = (*notes, *autocorrelation_finding(kept, solution))
    return _as_far_as_known(rows, summarise(solution, kept, wheel, notes=notes))


def _as_far_as_known(rows: SelectedRows, estimate: SoilEstimate) -> SoilEstimate:
    """Call cohesion and friction not determined where the load that they follow from is not known row by row."""
    if "load_without_slope" not in codes(rows.findings):
        return estimate
    return replace(estimate, separable={**estimate.separable, "c_Pa": False, "phi_rad": False})


def measured_rows(rows: SelectedRows, chosen: np.ndarray) -> Measured:
    """Lay out chosen rows (m,) for the estimator, with their noise; thinned evenly beyond `MOST_ROWS`."""
    noise, computed = _with_computed(rows, rows.table.select(chosen))
    if len(chosen) > MOST_ROWS:
        chosen = chosen[np.linspace(0, len(chosen) - 1, MOST_ROWS).astype(int)]
    table = rows.table.select(chosen)
    nothing = np.full(len(table), math.nan)
    channels = np.column_stack([table.columns.get(name, nothing) for name in CHANNELS])
    if "time_s" not in table:
        return Measured(channels, noise, table["slip"], timed=False, computed=computed)
    stated = np.array([name in rows.vehicle.noise for name in CHANNELS])
    # Clocks of runs may overlap: one run comes after the other.
    order = table["time_s"] if table.run is None else np.arange(len(table), dtype=float)
    return Measured(channels, noise, order, stated, computed=computed)


def _with_computed(rows: SelectedRows, table: WheelTable) -> tuple[np.ndarray, Computed | None]:
    """Give the noise (5,) of channels from row to row, and what rows share where load and pull come from the weight."""
    noise, found = sensor_noise(table, rows.vehicle), {each.code: each.values for each in rows.findings}
    if "load_computed" not in found or rows.vehicle.mass_kg is None:
        return noise, None
    mean, rows_used = float(np.nanmean(table["load_N"])), min(len(table), MOST_ROWS)
    share = {}
    for name in ("load_N", "drawbar_pull_N")[: 1 + ("pull_computed" in found)]:
        at = CHANNELS.index(name)
        share[name] = noise[at] / mean
        noise[at] = max(measured_noise(table, name), noise_of_shape(name, mean, rows_used))
    if "pull_computed" not in found:
        return noise, Computed(share["load_N"], 0.0, mean)
    of_pull = found["pull_computed"]
    by_N = of_pull["towed_over_driven_by_N"]
    towed = of_pull["towed_over_driven"] + by_N * (mean - of_pull["load_N"]), by_N * mean
    return noise, Computed(share["load_N"], of_pull["share"], mean, of_pull["resistance_sd"], towed)


def _linear(table: WheelTable, wheel: Wheel, known: SoilKnowledge) -> SoilEstimate:
    """The paper's estimate, as a `SoilEstimate`: a negative cohesion is not passed off as a finding."""
    needed = ("load_N", "torque_Nm", "sinkage_m", "slip")
    for name in needed:
        if name not in table or not np.isfinite(table[name]).any():
            raise InputError(
                table.source,
                f"no column {name}, or none that changes",
                expected="load, torque, sinkage and slip for Eq. 22",
            )
    load, torque, sinkage, slip = (table[name] for name in needed)
    k_m = known.values.get("k_m", REPRESENTATIVE_K_M)
    result = linearised.estimate(load, torque, sinkage, slip, k_m, wheel)
    if not math.isfinite(result.c_Pa):
        raise InputError(table.source, f"{result.n} usable rows", expected="two or more that differ", place="Eq. 22")
    quantile = float(t_distribution.ppf(0.975, max(result.n - 2, 1)))
    sd = np.sqrt(np.diag(result.covariance))
    slope = math.cos(result.phi_rad) ** 2
    ends = [math.atan(max(result.tan_phi + sign * quantile * sd[1], 0.0)) for sign in (-1.0, 1.0)]
    quantities = {
        "c_Pa": Quantity(
            max(result.c_Pa, 0.0), sd[0],
            max(result.c_Pa - quantile * sd[0], 0.0), max(result.c_Pa + quantile * sd[0], 0.0),
        ),
        "phi_rad": Quantity(max(result.phi_rad, 0.0), sd[1] * slope, ends[0], ends[1]),
    }  # fmt: skip
    findings = [note("least_squares_intervals")]
    if result.c_Pa < 0.0:
        findings.append(warning("negative_cohesion", c_Pa=result.c_Pa))
    sigma, _ = linearised.peak_stresses(load, torque, sinkage, wheel)
    stresses_Pa = np.nanpercentile(np.where(sigma > 0.0, sigma, np.nan), [10.0, 50.0, 90.0])
    mean = np.array([result.c_Pa, result.tan_phi])
    strength = wald_strengths(stresses_Pa, mean, result.covariance, quantile)
    correlation = float(result.covariance[0, 1] / (sd[0] * sd[1])) if sd.all() else 0.0
    tight = 2.0 * quantile * sd * [1.0, strength[1].normal_stress_Pa] <= 0.5 * abs(strength[1].value_Pa)
    return SoilEstimate(
        parameters=quantities,
        mean_c_tan_phi=mean,
        covariance_c_tan_phi=result.covariance,
        correlation={"c_Pa,phi_rad": correlation},
        shear_strength=strength,
        separable={"c_Pa": bool(tight[0]), "phi_rad": bool(tight[1])},
        advice="" if tight.all() else "vary load and slip more, or use the method ml",
        method="linear",
        channels=needed,
        n=result.n,
        misfit=math.nan,
        findings=tuple(findings),
    )


def open_recording(recording: Recording | str | Path, vehicle: Vehicle | str | Path | None) -> Recording:
    """Open a recording, if it is a path, and give it the vehicle, if there is one; raises `InputError`."""
    described = None if vehicle is None else as_vehicle(vehicle)
    if not isinstance(recording, Recording):
        return read_recording(recording, vehicle=described)
    return recording if described is None else replace(recording, vehicle=described)
