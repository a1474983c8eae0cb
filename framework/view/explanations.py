"""The page of explanations: what the textbook wheel lacks on each class, in words and curves."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...database.observations import Drive
from ...database.physics import ClassPhysics
from ...database.posterior import measured_class
from ...identification.effects.catalogue import effect_class, forms_by_name
from ...identification.effects.effect import Effect
from ...identification.effects.parse import lugs_of, specimen
from ...identification.effects.stored import StoredEffect
from ...identification.explain.quantities import percent
from ...identification.simulate import simulate
from ..core.errors import InputError
from ..core.html import picture, table
from ..core.recording.types import WheelTable
from ..core.vehicle import Vehicle
from .pictures import curves
from .site import Site
from .words import capital, moment, number, with_sd

if TYPE_CHECKING:
    from .server import Shared

_CHANNELS = {"drawbar_pull_N": ("drawbar pull", 1.0, "N"), "torque_Nm": ("torque", 1.0, "N m"),
             "sinkage_m": ("sinkage", 1e3, "mm")}  # fmt: skip
"""Title, scale and unit of the channels that are drawn."""

_SOIL = {"c_Pa": ("cohesion c", 1e-3, "kPa"), "phi_rad": ("friction angle phi", math.degrees(1.0), "deg"),
         "k_m": ("shear modulus k", 1e3, "mm"), "stiffness_Pa": ("stiffness", 1e-3, "kPa"),
         "n": ("sinkage exponent n", 1.0, "")}  # fmt: skip

_SLIPS = np.linspace(0.02, 0.6, 30)
_MOST_ROWS = 3000


def explanations(site: Site, shared: Shared) -> str:
    """Say by class what `explain` found that the textbook wheel lacks, how sure, and what would show it."""
    stored = [each for each in site.database.physics() if each.site in ("", site.name)]
    if not stored:
        return (
            "<h1>Explanations</h1><p>The database holds no explanation for this site. To add what the simulation of a "
            f"recorded wheel lacks:</p><p><code>{_command(site, 'RECORDING')}</code></p>"
        )
    newest = {each.class_name: each for each in sorted(stored, key=lambda each: each.site != "")}
    older = f" Older ones, which are not shown: {len(stored) - len(newest)}." if len(stored) > len(newest) else ""
    body = ["<h1>Explanations</h1>", f"<p>What the textbook wheel lacks, by class of ground.{older}</p>"]
    for name in sorted(newest):
        body += _of_class(newest[name], site, shared)
    return "".join(body)


def _command(site: Site, recording: str) -> str:
    return escape(f"bevameter explain {recording} --db {shlex.quote(site.database.name)} --report why.html")


def _of_class(found: ClassPhysics, site: Site, shared: Shared) -> Iterator[str]:
    effects, physics = found.physics.effects, found.physics
    yield f"<h2>{escape(found.class_name)}</h2>"
    listed = ", ".join(f"{effect_class(each.slug).title} ({_probability(each)})" for each in effects)
    verdict = f"Missing: {listed}." if listed else "Nothing is missing: the textbook wheel holds."
    yield f"<p class=verdict>{escape(verdict)}</p>"
    where = "at this site" if found.site else "on such ground anywhere"
    yield f"<p class=note>Found {moment(found.observed_at)} in {escape(found.source)}; it holds {where}.</p>"
    for each in effects:
        yield from _effect(each)
    rows = []
    for key, (title, scale, unit) in _SOIL.items():
        entry = physics.soil[key]
        rows.append((title, with_sd(scale * entry.value, scale * entry.sd, unit)))
    yield "<h3>The soil that was fitted with it</h3>" + table(("", "value"), rows)
    yield _curves(found, site, shared)


def _probability(effect: StoredEffect) -> str:
    return "probability unknown" if math.isnan(effect.probability) else percent(effect.probability)


def _form_of(stored: StoredEffect) -> Effect | None:
    forms = forms_by_name(stored.slug, specimen(lugs_of(stored.form)))
    alike = [each for each in forms if each.form == stored.form]
    named = [each for each in alike if {one.name for one in each.parameters} >= set(stored.parameters)]
    return min(named, key=lambda each: len(each.parameters), default=None)


def _effect(stored: StoredEffect) -> Iterator[str]:
    about, form = effect_class(stored.slug), _form_of(stored)
    yield f"<h3>{escape(capital(about.title))}: {escape(_probability(stored))}</h3>"
    yield f"<p>{escape(capital(about.what_happens))}. To check: {escape(about.check)}.</p>"
    units = {each.name: each.unit for each in form.parameters} if form is not None else {}
    if form is not None:
        yield f"<p>Equation: <code>{escape(form.equation)}</code><br>Source: {escape(form.source)}</p>"
    rows = [(name, with_sd(entry.value, entry.sd, units.get(name, ""))) for name, entry in stored.parameters.items()]
    yield table(("parameter", "value"), rows)


def _curves(found: ClassPhysics, site: Site, shared: Shared) -> str:
    """Draw measured and simulated channels where the recording is there, simulated ones where a vehicle is chosen."""
    head = "<h3>Measured and simulated, before and after</h3>"
    # That in which it was found first, then the newest.
    for drive in sorted(reversed(site.drives), key=lambda drive: Path(found.source).name not in _names(drive, shared)):
        recording = shared.recordings.of(drive.recording_digest)
        if recording is None or recording.wheel is None or recording.vehicle is None:
            continue
        rows = _rows_on(recording.wheel, drive, found.class_name)
        drawn = _drawn(found, recording.vehicle, _thinned(rows), measured=True) if len(rows) else None
        if drawn is not None:
            what = f"{drive.name}, stretches on {found.class_name} that measured soil"
            return f"{head}<p>{escape(what)}: {len(rows)} rows of the wheels.</p>{drawn}"
    name = shared.vehicle
    command = f"<p>Measured curves are in the report of <code>{_command(site, 'RECORDING')}</code>"
    look = " or here, with <code>bevameter view --recordings FOLDER</code>.</p>"
    if name is None:
        return head + command + look
    vehicle = shared.vehicles[name]
    load = site.snapshot.soils[found.class_name].load_N if found.class_name in site.snapshot.soils else math.nan
    if not math.isfinite(load):
        return head + command + look
    drawn = _drawn(found, vehicle, _imagined(load, vehicle), measured=False)
    if drawn is None:
        return head + command + look
    text = f"Simulated for a wheel of {name} under {number(load, 'N')}, the mean load while soil was measured."
    return f"{head}<p>{escape(text)}</p>{drawn}{command}{look}"


def _names(drive: Drive, shared: Shared) -> set[str]:
    """What an explanation may call the recording that a drive is of."""
    recording = shared.recordings.of(drive.recording_digest)
    return {drive.name} if recording is None else {drive.name, recording.source.name}


def _rows_on(table_: WheelTable, drive: Drive, class_name: str) -> WheelTable:
    """Give the wheel rows of the stretches that measured a class."""
    time_s = table_.get("time_s")
    rows = np.zeros(len(table_), dtype=bool)
    for soil in drive.soils:
        if time_s is not None and measured_class(soil) == class_name:
            rows |= (time_s >= soil.start_s) & (time_s <= soil.end_s)
    return table_.select(rows)


def _thinned(rows: WheelTable) -> WheelTable:
    return rows.select(np.arange(len(rows))[:: max(1, math.ceil(len(rows) / _MOST_ROWS))])


def _imagined(load_N: float, vehicle: Vehicle) -> WheelTable:
    """Give rows of one wheel at slips of 2 to 60 % at 0.1 m/s."""
    wheel, n = vehicle.wheels[0], len(_SLIPS)
    speed = 0.1
    columns = {
        "time_s": 10.0 * np.arange(n),
        "load_N": np.full(n, load_N),
        "slip": _SLIPS,
        "travel_speed_m_s": np.full(n, speed),
        "wheel_speed_rad_s": speed / (1.0 - _SLIPS) / wheel.radius_m,
    }
    return WheelTable(columns, np.full(n, wheel.name, dtype=object), None, Path("simulated"))


def _drawn(found: ClassPhysics, vehicle: Vehicle, rows: WheelTable, *, measured: bool) -> str | None:
    """Draw channels over slip; None where an effect needs what the rows lack."""
    physics = found.physics
    try:
        before = simulate(vehicle, physics.soil_values, rows)
        after = simulate(vehicle, physics.soil_values, rows, [effect.named for effect in physics.effects])
    except InputError:
        return None
    parts: list[str] = []
    for channel, (title, scale, unit) in _CHANNELS.items():
        seen = rows.get(channel)
        if measured and seen is None:
            continue
        pictured = curves(
            title, unit, after["slip"], scale * before[channel], scale * after[channel],
            scale * seen if measured and seen is not None else None,
        )  # fmt: skip
        parts.append(f"<figure>{picture(pictured, 'png', f'{title} over slip')}</figure>")
    return f"<div class=row>{''.join(parts)}</div>"
