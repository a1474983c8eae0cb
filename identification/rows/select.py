"""Rows of a recording in which its wheels felt the soil: of one wheel geometry, each with why it is not used."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.recording.types import Recording, WheelTable
from ...framework.core.recording.wheel_file import derive
from ...framework.core.vehicle import Vehicle, Wheel
from .angle import angle_disagreement
from .duplicates import without_copies
from .gate import Stretch, find_stretches, quasi_static
from .geometry import by_geometry, half_stated_lugs, of_vehicle
from .kinematics import slip_disagreement, speeds_in_another_unit
from .plausible import check_load, check_signs, check_sizes, check_torque, slow_clock, without_stuck
from .sensors import check_stated_noise
from .settling import without_run_in
from .signs import check_pull
from .standstill import with_standstill
from .stops import without_stops
from .units import load_in_kilograms, pull_in_another_unit


@dataclass(frozen=True)
class FeltRows:
    """Rows of all wheels of one geometry, each with the reason why it is not used (``""`` where it is)."""

    table: WheelTable
    wheel: Wheel
    vehicle: Vehicle
    reasons: np.ndarray
    problems: tuple[str, ...]

    def stretches(self, boundaries_s: np.ndarray | None = None) -> list[Stretch]:
        """Cut into stretches by time; steady-state trials make one used stretch and one for each reason not to."""
        boundaries = np.empty(0) if boundaries_s is None else boundaries_s
        if "time_s" in self.table:
            return find_stretches(self.table["time_s"], self.reasons, boundaries)
        return [
            Stretch(math.nan, math.nan, np.flatnonzero(self.reasons == reason), reason)
            for reason in sorted(set(self.reasons), key=lambda text: (text != "", text))
        ]


def felt_rows(recording: Recording, *, every_row: bool = False) -> FeltRows:
    """Gather the wheel rows to identify from: of one wheel geometry, that with most rows to use, which it says.

    Left out are copies, rows in which runs settle, and rows of wheels that are not the vehicle's; of these only the
    last, which is an error then, where `every_row` is to be matched with those of another file.

    Raises
    ------
    InputError
        There are no wheel channels or no geometry, or rows of other wheels where `every_row` is needed.
    """
    if recording.wheel is None or len(recording.wheel) == 0:
        raise InputError(recording.source, "no wheel channels", expected="wheel.csv or wheel.parquet")
    of_wheel = [_of_vehicle(part, every_row) for part in by_geometry(recording)]
    best = max(of_wheel, key=lambda rows: int((rows.reasons == "").sum()))
    if len(of_wheel) == 1:
        return best
    note = (
        f"rows of {len(of_wheel)} wheels: only the {len(best.table)} of the {best.vehicle.name} were used, for their "
        "soils may differ; give the others in a file of their own"
    )
    return replace(best, problems=(*best.problems, note))


def only_steady(table: WheelTable) -> tuple[WheelTable, list[str]]:
    """Leave out where the wheels of a test at constant slips get going, settle and stop, and say so."""
    table, stops, got_going = without_stops(table)
    table, settling = without_run_in(table, got_going=got_going)
    return table, [*stops, *settling]


def _of_vehicle(recording: Recording, every_row: bool) -> FeltRows:
    """Gather the rows of a vehicle's wheels of one geometry, that with most rows to use."""
    if recording.vehicle is None:
        raise InputError(
            recording.source,
            "no wheel geometry",
            expected="vehicle.toml beside the recording, --vehicle, or columns radius_m and width_m",
        )
    vehicle = recording.vehicle
    assert recording.wheel is not None
    table, others = of_vehicle(recording.wheel, vehicle)
    if every_row and others:
        raise InputError(recording.source, others[0], expected="rows of the vehicle's wheel only, beside another file")
    table, unlike = with_standstill(table), list[str]()
    if not every_row:
        table, copies = without_copies(table)
        table, unsteady = only_steady(table)
        unlike = [*copies, *unsteady]
    groups: dict[tuple[float, float], list[str | None]] = {}
    names = [None] if table.wheel is None else [str(name) for name in np.unique(table.wheel)]
    for name in names:
        wheel = vehicle.wheel(name)
        groups.setdefault((wheel.radius_m, wheel.width_m), []).append(name)
    gathered = [_gather(table, vehicle, members) for members in groups.values()]
    for name, remedy in (
        ("load_N", "load_N: the wheel's share of the weight, if it is not sensed"),
        ("slip", "slip, or both wheel_speed_rad_s and travel_speed_m_s"),
    ):
        if not any(name in rows.table for rows in gathered):
            raise InputError(table.source, f"no column {name}", expected=remedy)
    gathered = [_checked(rows) for rows in gathered]
    best = max(gathered, key=lambda rows: int((rows.reasons == "").sum()))
    said = [*others, *unlike]
    if len(gathered) > 1:
        said.append(f"wheels of {len(gathered)} geometries: only those of radius {best.wheel.radius_m:g} m were used")
    return replace(best, problems=(*said, *best.problems))


def _checked(rows: FeltRows) -> FeltRows:
    """Refuse channels that cannot be what their names say, and add what may not be so to the problems."""
    table, wheel, reasons = rows.table, rows.wheel, rows.reasons
    check_signs(table, wheel)
    check_sizes(table, wheel)
    check_load(table, wheel)
    unit = pull_in_another_unit(table, wheel, reasons)
    doubts = (
        check_torque(table, wheel, reasons),
        check_pull(table, wheel, reasons),
        load_in_kilograms(table, wheel, reasons),
        unit,
    )
    # Beside a pull in another unit its noise in newtons is too large: it is the pull that is at fault.
    noise = check_stated_noise(table, rows.vehicle, besides={"drawbar_pull_N"} if unit else ())
    said = [*half_stated_lugs(wheel), *(doubt for doubt in doubts if doubt), *noise]
    return replace(rows, problems=(*rows.problems, *said))


def _gather(table: WheelTable, vehicle: Vehicle, names: list[str | None]) -> FeltRows:
    parts, reasons, problems = [], [], []
    for name in names:
        wheel = vehicle.wheel(name)
        part = table if name is None else table.select(np.asarray(table.wheel) == name)
        recorded, part = part, derive(part, wheel)
        checks = (
            slip_disagreement(recorded, wheel),
            speeds_in_another_unit(recorded, wheel),
            angle_disagreement(part, wheel),
            slow_clock(part),
        )
        doubts = [doubt for doubt in checks if doubt]
        # Before what is stuck is left out: on ground that does not yield a sinkage may well stay what it is.
        reasons.append(quasi_static(part, wheel))
        part, stuck = without_stuck(part)
        parts.append(part)
        said = [*doubts, *stuck]
        problems.extend(said if len(names) == 1 else [f"wheel {name}: {each}" for each in said])
    wheel = vehicle.wheel(names[0])
    if len(parts) == 1:
        return FeltRows(parts[0], wheel, vehicle, reasons[0], tuple(problems))
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0].columns}
    labels = np.concatenate([np.asarray(part.wheel) for part in parts])
    runs = None if parts[0].run is None else np.concatenate([np.asarray(part.run) for part in parts])
    return FeltRows(
        WheelTable(columns, labels, runs, table.source), wheel, vehicle, np.concatenate(reasons), tuple(problems)
    )
