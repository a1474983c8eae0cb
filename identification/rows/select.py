"""The wheel rows of a recording to identify from: of one wheel geometry, each with the reason why it is not used."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ...framework.core.errors import InputError, raise_all
from ...framework.core.findings import Finding, note
from ...framework.core.recording.mends import missing
from ...framework.core.recording.types import Recording, WheelTable
from ...framework.core.recording.wheel_file import derive
from ...framework.core.vehicle import Vehicle, Wheel
from .bends import with_bends
from .duplicates import without_duplicates
from .gate import Stretch, balanced, find_stretches, quasi_static
from .geometry import by_geometry, half_stated_grousers, of_driven, of_vehicle
from .kinematics import angle_disagreement, slip_disagreement
from .motor import with_torque
from .sensors import check_stated_noise, without_stuck
from .settling import only_steady
from .signs import check_pull, check_signs, check_torque, check_torque_carries
from .slip_definition import check_by_forces, check_by_speeds
from .standstill import with_standstill
from .travel import with_travel_speed
from .trials import AS_TRIALS, is_of_trials, slow_clock, without_time
from .units import check_load, check_sizes, load_in_kilograms, pull_in_another_unit, speeds_in_another_unit
from .weight import with_loads, with_pull
from .words import sentence


@dataclass(frozen=True)
class SelectedRows:
    """Rows of all wheels of one geometry, each with the reason why it is not used (``""`` where it is).

    `findings` say what was left out, and what of the channels is in doubt.
    """

    table: WheelTable
    wheel: Wheel
    vehicle: Vehicle
    reasons: np.ndarray
    findings: tuple[Finding, ...]

    @property
    def used(self) -> int:
        """Number of rows that are used."""
        return int((self.reasons == "").sum())

    def stretches(self, boundaries_s: np.ndarray | None = None) -> list[Stretch]:
        """Cut into stretches by time; steady-state trials make one used stretch and one for each reason not to."""
        boundaries = np.empty(0) if boundaries_s is None else boundaries_s
        timed = find_stretches(self.table["time_s"], self.reasons, boundaries) if "time_s" in self.table else []
        # Trials are short by themselves, and one soil's together.
        if timed and (self.table.run is None or any(not each.reason for each in timed)):
            return timed
        return [
            Stretch(math.nan, math.nan, np.flatnonzero(self.reasons == reason), reason)
            for reason in sorted(set(self.reasons), key=lambda text: (text != "", text))
        ]


def as_trials(rows: SelectedRows) -> SelectedRows:
    """Give rows that are steady trials without their times, and the finding ``steady_trials``; others as they are."""
    if not is_of_trials(rows.table):
        return rows
    table = without_time(rows.table)
    return replace(rows, table=table, reasons=quasi_static(table, rows.wheel), findings=(*rows.findings, AS_TRIALS))


def select_wheel_rows(recording: Recording, *, every_row: bool = False) -> SelectedRows:
    """Gather the wheel rows to identify from: of one wheel geometry, that with most rows to use.

    Left out are duplicates, rows in which runs settle, and rows of wheels that are not the vehicle's; of these only the
    last, which is an error then, where `every_row` is to be matched with those of another file.

    Raises
    ------
    InputError
        There are no wheel channels or no geometry, or rows of other wheels where `every_row` is needed.
    """
    if recording.wheel is None or len(recording.wheel) == 0:
        said = "; ".join(("no wheel channels", *recording.problems))
        raise InputError(recording.source, said, expected="wheel.csv or wheel.parquet, or a bag with topics of wheels")
    of_wheel = [_of_vehicle(part, every_row) for part in by_geometry(recording)]
    best = max(of_wheel, key=lambda rows: rows.used)
    if len(of_wheel) == 1:
        return best
    found = note("other_geometries", wheels=len(of_wheel), used=len(best.table), wheel=best.vehicle.name)
    return replace(best, findings=(*best.findings, found))


def _of_vehicle(recording: Recording, every_row: bool) -> SelectedRows:
    """Gather the rows of a vehicle's wheels of one geometry, that with most rows to use."""
    if recording.vehicle is None or not recording.vehicle.wheels:
        raise InputError(
            recording.source,
            "no wheel geometry",
            expected="vehicle.toml in the recording, --vehicle, or columns radius_m and width_m",
        )
    vehicle = recording.vehicle
    assert recording.wheel is not None
    if recording.wheel.wheel is None and len(vehicle.wheels) > 1:
        raise InputError(
            recording.source, "; ".join(("no row names its wheel", *recording.problems)),
            expected="rows of " + ", ".join(wheel.name for wheel in vehicle.wheels),
        )  # fmt: skip
    table, towed = of_driven(recording.wheel, vehicle)
    table, others = of_vehicle(table, vehicle)
    if every_row and (lost := others or towed):
        raise InputError(
            recording.source, f"{lost.values['used']} of {lost.values['n']} rows are of the vehicle's driven wheels",
            expected="rows of these only, to compare with another file",
        )  # fmt: skip
    table, driven = with_torque(table, vehicle)
    table, vehicle, placed = with_travel_speed(table, vehicle, recording.pose)
    bent = None
    if recording.shared_speed or (placed is not None and placed.code == "travel_speed_computed"):
        table, bent = with_bends(table, vehicle, recording.pose)
    table, vehicle, weighed = with_loads(table, vehicle, recording.pose)
    pulled = None
    if weighed is not None and not every_row:
        table, vehicle, pulled = with_pull(table, vehicle, recording.pose)
        if pulled is not None:
            check_torque_carries(table, next(each for each in vehicle.wheels if each.driven is not False))
    table, duplicates, unsteady = with_standstill(table), None, list[Finding]()
    if not every_row:
        table, duplicates = without_duplicates(table)
        table, unsteady = only_steady(table)
    groups: dict[tuple[float, float], list[str | None]] = {}
    names = [None] if table.wheel is None else [str(name) for name in np.unique(table.wheel)]
    for name in names:
        wheel = vehicle.wheel(name)
        groups.setdefault((wheel.radius_m, wheel.width_m), []).append(name)
    made = {"load_N": weighed, "drawbar_pull_N": pulled}
    computed = frozenset(name for name, finding in made.items() if finding is not None and name in table)
    gathered = [_gather(table, vehicle, members, computed) for members in groups.values()]
    faults = list[InputError]()
    for name, remedy in (
        ("load_N", "load_N; or mass_kg, or load_N of each wheel, in vehicle.toml, where it is not sensed"),
        ("slip", "slip, or both wheel_speed_rad_s and travel_speed_m_s"),
    ):
        if not any(name in rows.table for rows in gathered):
            why = f"; {sentence(placed)}" if name == "slip" and placed is not None else ""
            named = missing(table, name)
            remedy = f"{remedy}; or {named}" if named else remedy
            faults.append(InputError(table.source, f"no column {name}{why}", expected=remedy))
    raise_all(table.source, faults)
    best = max((_checked(rows, "drawbar_pull_N" not in computed) for rows in gathered), key=lambda rows: rows.used)
    radii = note("one_radius", geometries=len(gathered), radius_m=best.wheel.radius_m) if len(gathered) > 1 else None
    return replace(
        best,
        findings=(
            *_found(towed, others, driven, placed, bent, weighed, pulled, duplicates, *unsteady, radii),
            *best.findings,
        ),
    )


def _found(*findings: Finding | None) -> Iterable[Finding]:
    return (each for each in findings if each is not None)


def _checked(rows: SelectedRows, sensed: bool) -> SelectedRows:
    """Refuse channels that cannot be what their names say, and doubt those that may not be, a pull if it was sensed."""
    table, wheel, reasons = rows.table, rows.wheel, rows.reasons
    check_signs(table, wheel)
    check_sizes(table, wheel)
    check_load(table, wheel)
    unit = pull_in_another_unit(table, wheel, reasons) if sensed else None
    doubts = (
        half_stated_grousers(wheel),
        check_torque(table, wheel, reasons),
        check_by_forces(table, balanced(reasons)) if sensed else None,
        check_pull(table, wheel, reasons) if sensed else None,
        load_in_kilograms(table, wheel, reasons),
        unit,
        # Of a pull in another unit its noise in newtons is too large: it is the pull that is at fault.
        *check_stated_noise(table, rows.vehicle, ignore={"drawbar_pull_N"} if unit or not sensed else ()),
    )
    return replace(rows, findings=(*rows.findings, *_found(*doubts)))


def _gather(table: WheelTable, vehicle: Vehicle, names: list[str | None], computed: frozenset[str]) -> SelectedRows:
    """Put the rows of wheels of one geometry together; `computed` are channels that no sensor gave."""
    parts, reasons, findings = [], [], []
    for name in names:
        wheel = vehicle.wheel(name)
        recorded = table if name is None else table.select(np.asarray(table.wheel) == name)
        check_by_speeds(recorded, wheel)
        part = derive(recorded, wheel)
        doubts = _found(
            slip_disagreement(recorded, wheel),
            speeds_in_another_unit(recorded, wheel),
            angle_disagreement(part, wheel),
            slow_clock(part),
        )
        # Before what is stuck is left out: on ground that does not yield a sinkage may well stay what it is.
        reasons.append(quasi_static(part, wheel))
        part, stuck = without_stuck(part, computed)
        parts.append(part)
        findings += [
            each if len(names) == 1 else each.with_values(of_wheel=f"wheel {name}") for each in (*doubts, *stuck)
        ]
    wheel = vehicle.wheel(names[0])
    if len(parts) == 1:
        return SelectedRows(parts[0], wheel, vehicle, reasons[0], tuple(findings))
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0].columns}
    labels, runs, soils = (
        None if any(each is None for each in of_parts) else np.concatenate([np.asarray(each) for each in of_parts])
        for of_parts in zip(*((part.wheel, part.run, part.soil) for part in parts), strict=True)
    )
    together = WheelTable(columns, labels, runs, table.source, soils)
    return SelectedRows(together, wheel, vehicle, np.concatenate(reasons), tuple(findings))
