"""Effects by name: ``slip_sinkage:n1=0.2`` becomes an effect of the catalogue and its parameters."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.quantities import magnitude
from ...framework.core.vehicle import Wheel
from ..mechanics.soil import Soil
from ..mechanics.textbook import CHANNELS, equilibrium
from .catalogue import effect_class, forms_by_name
from .drive import COLUMNS, PresentDrive
from .effect import PULL, SINKAGE, TORQUE, Drive, Effect, Situation

_USUAL_LUGS = 18
_LEAST_SHARE = {TORQUE: 0.1, SINKAGE: 0.01, PULL: 0.1}
"""Least root mean square of a channel, relative to W r [N m], r [m] and W [N]: for the scale of sensor faults."""


@dataclass(frozen=True)
class NamedEffect:
    """An effect to be simulated.

    Parameters
    ----------
    slug
        Public name.
    settings
        Parameters, and constants of the formula, by name: SI numbers, or text with a unit ("2 kPa").
    form
        Form, or the beginning of its name, if several have the parameters.
    bounded
        Whether values out of bounds are errors; not for a fit to another drive, whose bounds differ.
    """

    slug: str
    settings: Mapping[str, float | str] = field(default_factory=dict)
    form: str = ""
    bounded: bool = True


def parse_effect(text: str) -> NamedEffect:
    """Read ``slug:name=value,name=value``, with ``form=...`` for an effect of several forms.

    Raises
    ------
    InputError
        The text is not of that form, or names a parameter twice.
    """
    slug, _, rest = text.partition(":")
    effect_class(slug.strip())
    settings: dict[str, float | str] = {}
    # The name of a form may contain a comma: only one before another NAME= separates.
    for part in re.split(r",(?=\s*\w+\s*=)", rest) if rest.strip() else []:
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise InputError("effect", f"{text!r}", expected="SLUG:NAME=VALUE,NAME=VALUE")
        if name in settings:
            raise InputError("effect", f"{text!r}", expected="each parameter once", place=name)
        settings[name] = value
    form = str(settings.pop("form", ""))
    return NamedEffect(slug.strip(), settings, form)


def situation_of(wheel: Wheel, soil: Soil, drive: Drive) -> Situation:
    """Return the situation of a simulated drive, with the channels of the textbook wheel.

    Parameters
    ----------
    wheel, soil
        The wheel, and the soil that it is simulated on.
    drive
        At least one row with finite load and slip.
    """
    state = equilibrium(wheel, soil, drive.load_N, drive.slip)
    channels = np.column_stack([state.load_N, state.torque_Nm, state.sinkage_m, state.slip, state.drawbar_pull_N])
    carried = np.isfinite(state.sinkage_m)
    load = float(np.mean(np.abs(drive.load_N)))
    typical = np.sqrt(np.mean(channels[carried] ** 2, axis=0)) if carried.any() else np.zeros(len(CHANNELS))
    for channel, unit in ((TORQUE, load * wheel.radius_m), (SINKAGE, wheel.radius_m), (PULL, load)):
        typical[channel] = max(typical[channel], _LEAST_SHARE[channel] * unit)
    typical[0] = load
    # Where the soil does not carry the load the radius replaces the sinkage.
    sinkage = np.where(carried, state.sinkage_m, wheel.radius_m)
    return Situation(
        wheel, drive, typical, sinkage, np.zeros_like(channels), soil.c_Pa, math.tan(soil.phi_rad),
        soil.stiffness_Pa,
    )  # fmt: skip


def specimen(lugs: int = _USUAL_LUGS, *, scale: float = 1.0) -> Situation:
    """Return a situation in which every form of every effect is observable: a lugged wheel, all columns observed.

    Parameters
    ----------
    lugs
        Number of the wheel's lugs.
    scale
        Scale of wheel, loads, track and time, by which `follows_drive` finds bounds that depend on the drive.
    """
    wheel = Wheel(
        radius_m=0.15 * scale, width_m=0.12 * scale, grouser_height_m=0.01 * scale, grouser_count=lugs
    )  # fmt: skip
    soil = Soil(c_Pa=500.0 * scale, phi_rad=math.radians(32.0), k_m=0.012, stiffness_Pa=2e5, n=0.9)
    rows = 40
    along = np.linspace(0.0, 1.0, rows)
    drive = PresentDrive(
        load_N=(80.0 + 60.0 * along) * scale**2, slip=0.05 + 0.6 * along, time_s=10.0 * along * scale,
        travel_speed_m_s=0.1 + 0.1 * along, rim_speed_m_s=0.2 + 0.1 * along, wheel_angle_rad=20.0 * along,
        pitch_rad=0.1 * along, pass_number=1.0 + np.floor(2.999 * along), place_m=along * scale,
        x_m=along * scale, y_m=along * scale,
        acceleration_m_s2=np.full(rows, 0.01), angular_acceleration_rad_s2=np.full(rows, 0.07),
        slip_before=np.full(rows, 0.35),
        **dict.fromkeys(("stretch", "run", "ground", "wheel"), np.zeros(rows, dtype=int)),
    )  # fmt: skip
    return situation_of(wheel, soil, drive)


def follows_drive(effect: Effect) -> set[str]:
    """Return the names of the parameters whose bounds depend on the drive."""
    here, there = (
        next(
            each
            for each in forms_by_name(effect.slug, specimen(lugs_of(effect.form), scale=scale))
            if same(each, effect)
        )
        for scale in (1.0, 3.0)
    )
    return {
        one.name
        for one, two in zip(here.parameters, there.parameters, strict=True)
        if not (math.isclose(one.low, two.low) and math.isclose(one.high, two.high))
    }


def same(one: Effect, other: Effect) -> bool:
    """Return whether two effects are the same form with the same parameters."""
    return (one.form, _names(one)) == (other.form, _names(other))


def lugs_of(form: str, otherwise: int = _USUAL_LUGS) -> int:
    """Return the number of lugs in the name of a form, `otherwise` if there is none."""
    found = re.search(r"ripple, (\d{1,4}) lugs", form)
    return int(found.group(1)) if found else otherwise


def choose(named: NamedEffect, effects: Sequence[Effect]) -> Effect:
    """Choose the form with the parameters named and the fewest others.

    Raises
    ------
    InputError
        No form has these parameters, or several have; the message lists the forms.
    """
    source, given = f"effect {named.slug}", set(named.settings)
    begun = [effect for effect in effects if _bare(effect.form).startswith(_bare(named.form))]
    among = [effect for effect in begun if _bare(effect.form) == _bare(named.form)] if named.form else begun
    # The beginning of a form's name suffices if only this form has the parameters that are named.
    if not any(given <= {*_names(effect), *effect.constants} for effect in among):
        among = begun
    if not among:
        forms = " or ".join(dict.fromkeys(f"{effect.form!r}" for effect in effects if effect.form))
        raise InputError(source, f"form {named.form!r}", expected=forms or "no form")
    known = "; ".join(dict.fromkeys(_described(effect) for effect in among))
    strange = sorted(given - {name for effect in among for name in (*_names(effect), *effect.constants)})
    if strange:
        raise InputError(source, f"no parameter {strange[0]!r}", expected=known)
    fitting = [
        effect
        for effect in among
        if given <= {*_names(effect), *effect.constants}
        and given & set(_names(effect))
        and given >= set(effect.required)
    ]
    if not fitting:
        stated = ", ".join(sorted(given)) or "no parameter"
        raise InputError(source, f"{stated} given", expected=known)
    fewest = min(len(effect.parameters) for effect in fitting)
    best = [effect for effect in fitting if len(effect.parameters) == fewest]
    # Among forms with the same parameters one without a name is the default.
    best = [effect for effect in best if effect.default_form] or best
    best = [effect for effect in best if not effect.form] or best
    if len(best) > 1:
        choices = " or ".join(f"form={effect.form}" for effect in best)
        raise InputError(source, f"{', '.join(sorted(given))} given, which leaves its form open", expected=choices)
    return best[0]


def _bare(form: str) -> str:
    """Name of a form without spaces after its commas."""
    return form.replace(", ", ",")


def smallest_form(form: str, names: set[str], effects: Sequence[Effect]) -> Effect | None:
    """Return the effect of this form with all of these parameters and the fewest others; None if there is none."""
    holding = [effect for effect in effects if effect.form == form and names and names <= set(_names(effect))]
    return min(holding, key=lambda effect: len(effect.parameters), default=None)


def pinned(effect: Effect, named: NamedEffect) -> Effect:
    """Return the effect with the constants that are named; the same effect if there are none."""
    given = {name: _number(named, name, "") for name in effect.constants if name in named.settings}
    if not given:
        return effect
    answer = copy(effect)
    answer.constants = {**effect.constants, **given}
    return answer


def values_of(effect: Effect, named: NamedEffect) -> np.ndarray:
    """Return the parameters (k,) in the effect's order; those not named are at their null values.

    Raises
    ------
    InputError
        A value is not a finite number of the parameter's unit, or lies outside its bounds.
    """
    values = []
    for parameter in effect.parameters:
        if parameter.name not in named.settings:
            values.append(parameter.null)
            continue
        value = _number(named, parameter.name, parameter.unit)
        if named.bounded and not parameter.low <= value <= parameter.high:
            raise InputError(
                f"effect {named.slug}",
                f"{value:g}",
                expected=f"{parameter.low:.4g} to {parameter.high:.4g} {parameter.unit}".strip(),
                place=parameter.name,
            )
        values.append(value)
    return np.array(values)


def build(named: NamedEffect, situation: Situation, source: str) -> tuple[Effect, np.ndarray]:
    """Build an effect for a drive to be simulated, and its parameters (k,).

    Parameters
    ----------
    named
        Its name and settings.
    situation
        The wheel and the drive (`situation_of`), the latter a `PresentDrive`.
    source
        Source of the drive, for messages.

    Raises
    ------
    InputError
        Unknown effect or parameter, a value out of bounds, or a column that the drive lacks.
    """
    # A ripple may have another number of lugs than the vehicle's description states.
    lugs = lugs_of(named.form, situation.wheel.grouser_count)
    situation = replace(situation, wheel=situation.wheel.model_copy(update={"grouser_count": lugs}))
    wanted = choose(named, forms_by_name(named.slug, specimen(lugs or _USUAL_LUGS)))
    for need in wanted.needs:
        if not situation.drive.has(need):
            column = COLUMNS[need]
            expected = f"{column}, which the effect {named.slug} needs"
            if need.endswith(("acceleration_m_s2", "acceleration_rad_s2")):
                expected += ", and time_s, in stretches of nine samples at least"
            raise InputError(source, f"no column {column}", expected=expected)
    if named.bounded and "t_first" in wanted.constants and not _clock_runs(situation.drive.time_s):
        raise InputError(
            source, "the same in all rows", place="column time_s",
            expected=f"a clock that runs, which the effect {named.slug} needs",
        )  # fmt: skip
    for effect in forms_by_name(named.slug, situation):
        if same(effect, wanted):
            return pinned(effect, named), values_of(effect, named)
    raise InputError(
        f"effect {named.slug}", "the vehicle's wheel has no lugs", expected="grouser_height_m and grouser_count"
    )


def _clock_runs(time_s: np.ndarray) -> bool:
    """Return whether times (n,) are not all the same."""
    known = time_s[np.isfinite(time_s)]
    return bool(known.size) and float(np.ptp(known)) > 0.0


def _names(effect: Effect) -> tuple[str, ...]:
    return tuple(parameter.name for parameter in effect.parameters)


def _described(effect: Effect) -> str:
    """Name an effect's parameters with their bounds, for messages."""
    parameters = ", ".join(
        f"{parameter.name} [{parameter.unit}]" if parameter.unit else parameter.name for parameter in effect.parameters
    )
    return f"{effect.name}: {parameters}"


def _number(named: NamedEffect, name: str, unit: str) -> float:
    """Read a setting: an SI number, or a quantity of the unit."""
    given = named.settings[name]
    try:
        value = float(given)
    except (TypeError, ValueError):
        value = _magnitude(str(given), unit)
    if not math.isfinite(value):
        expected = f"a finite number [{unit}]" if unit else "a finite number"
        raise InputError(f"effect {named.slug}", f"{given!r}", expected=expected, place=name)
    return value


def _magnitude(text: str, unit: str) -> float:
    """Read a quantity; NaN if it is none, or not of the unit (logarithms have none)."""
    unit = re.sub(r"(?<=[a-z])(\d)", r"**\1", "" if unit.startswith("ln ") else unit)
    try:
        return magnitude(text, unit or "dimensionless")
    except ValueError:
        return math.nan
