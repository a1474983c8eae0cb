"""Names, units and numbers as people read them: kilopascals, millimetres and degrees, and probabilities in words."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from ....framework.core.soil import PARAMETERS
from ...effects.descriptions import DESCRIPTIONS
from ...effects.uncatalogued import LIKE
from ...effects.uncatalogued import SLUG as UNCATALOGUED
from ..explanation import Estimate, Explanation, Missing, Region
from ..locate.variables import CONSTANT

_DEGREES = 180.0 / math.pi


@dataclass(frozen=True)
class Shown:
    """How a quantity is shown: its name, its unit (``""`` for a pure number), and the factor from SI."""

    name: str
    unit: str = ""
    scale: float = 1.0

    @property
    def label(self) -> str:
        """Name with the unit in brackets."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


_QUANTITIES = {
    "load_N": Shown("load W", "N"),
    "torque_Nm": Shown("torque T", "N m"),
    "sinkage_m": Shown("sinkage z", "mm", 1e3),
    "slip": Shown("slip i"),
    "drawbar_pull_N": Shown("drawbar pull DP", "N"),
    "rim_speed_m_s": Shown("speed of the rim", "m/s"),
    "travel_speed_m_s": Shown("travel speed", "m/s"),
    "wheel_speed_rad_s": Shown("angular speed of the wheel", "rad/s"),
    "wheel_angle_rad": Shown("wheel angle", "deg", _DEGREES),
    "pitch_rad": Shown("slope along the track", "deg", _DEGREES),
    "pass": Shown("number of the pass"),
    "acceleration_m_s2": Shown("acceleration", "m/s^2"),
    "angular_acceleration_rad_s2": Shown("angular acceleration", "rad/s^2"),
    "x_m": Shown("place x", "m"),
    "y_m": Shown("place y", "m"),
    "distance_m": Shown("way along the track", "m"),
    "time_s": Shown("time", "s"),
    "lag_s": Shown("delay", "s"),
    "constant": Shown("nothing: the same everywhere"),
    "c_Pa": Shown("cohesion c", "kPa", 1e-3),
    "phi_rad": Shown("friction angle phi", "deg", _DEGREES),
    "k_m": Shown("shear modulus k", "mm", 1e3),
    "stiffness_Pa": Shown("stiffness k1 + k2 b", "kPa", 1e-3),
    "n": Shown("sinkage exponent n"),
}

_UNITS = {
    "Pa": ("kPa", 1e-3),
    "Pa/m": ("kPa/m", 1e-3),
    "rad": ("deg", _DEGREES),
    "m": ("mm", 1e3),
    "m/N": ("mm/kN", 1e6),
}

AT_NOISE = 1.3
"""A channel whose held-out error is within this factor of its noise is predicted as well as can be [-]."""

FEW = 4 * len(PARAMETERS)
"""Rows below which finding nothing tells little: four for each number of a soil."""

_PLACES = ("from", "to")
"""Parameters in metres that are places along a track, not lengths of the wheel's size."""

EFFECTS = DESCRIPTIONS
"""By public name: the effect in words, and what happens."""

KINDS = {"physics": "physics", "instrument": "instrument or configuration", "unknown": "unknown"}

_WORDS = (
    (0.99, "virtually certain"),
    (0.90, "very likely"),
    (0.66, "likely"),
    (0.33, "about as likely as not"),
    (0.10, "unlikely"),
    (0.01, "very unlikely"),
    (0.0, "exceptionally unlikely"),
)
"""Least probability for each wording: M. D. Mastrandrea et al., IPCC guidance note on uncertainties (2010), Table 1."""


def shown(name: str, unit: str = "") -> Shown:
    """Say how a channel, a variable or a parameter is shown; what has no entry is shown as it is, in SI."""
    if name in _QUANTITIES:
        return _QUANTITIES[name]
    if name.rpartition(".")[2] in _PLACES or unit not in _UNITS:
        return Shown(name, unit)
    return Shown(name, *_UNITS[unit])


def number(value: float, scale: float = 1.0) -> str:
    """Three significant digits; ``unknown`` where there is no number."""
    if not math.isfinite(value):
        return "unknown"
    text = f"{value * scale:.3g}"
    return f"{float(text):.0f}" if "e" in text and abs(value * scale) < 1e6 and abs(value * scale) >= 1.0 else text


def spread(value: float, sd: float, scale: float = 1.0) -> str:
    """Give value and standard deviation to the digits that the latter allows."""
    if not math.isfinite(value):
        return "unknown"
    if not math.isfinite(sd):
        return f"{number(value, scale)} (sd unknown)"
    if sd <= 0.0:
        return f"{number(value, scale)} (given)"
    value, sd = value * scale, sd * scale
    places = 1 - math.floor(math.log10(sd))
    if not -4 <= places <= 5:
        return f"{value:.3g} ± {sd:.2g}"
    return f"{round(value, places):.{max(places, 0)}f} ± {round(sd, places):.{max(places, 0)}f}"


def estimate(name: str, value: Estimate) -> str:
    """``n1 = 0.21 ± 0.02``, with the unit where there is one."""
    how = shown(name, value.unit)
    return f"{how.name} = {spread(value.value, value.sd, how.scale)}{' ' + how.unit if how.unit else ''}"


def percent(probability: float) -> str:
    """Give a probability as people say it: never 0 or 100 %."""
    if probability < 0.005:
        return "< 0.5 %"
    return "> 99.5 %" if probability > 0.995 else f"{100.0 * probability:.0f} %"


def likelihood(probability: float) -> str:
    """Give a probability in words and as a number."""
    words = next(text for least, text in _WORDS if round(probability, 2) >= least)
    return f"{words}, {percent(probability)}"


def effect(name: str) -> str:
    """Put one effect, or several joined by plus signs, in words: forms stay in brackets."""
    return " + ".join(_in_words(slug, form[1:-1] if form else "") for slug, form in _parts(name))


def _in_words(slug: str, form: str) -> str:
    if slug == UNCATALOGUED and form in LIKE:
        return LIKE[form]
    return EFFECTS.get(slug, (slug, ""))[0] + (f" ({form})" if form else "")


def slugs(name: str) -> list[str]:
    """Give the public names of the effects that a name joins by plus signs, without their forms."""
    return [slug for slug, _ in _parts(name)]


def _parts(name: str) -> list[tuple[str, str | None]]:
    """Slug and form, in brackets, of each effect that a name joins."""
    return [
        re.fullmatch(r"([^\[]*)(\[.*\])?", part, re.DOTALL).groups()  # type: ignore[union-attr]
        for part in name.split(" + ")
    ]


def effects(names: tuple[str, ...]) -> str:
    """List effects in words."""
    return ", ".join(effect(name) for name in names)


def interval(region: Region) -> str:
    """Say where along its variable a region lies, or by how much the channel is off, in the unit that is shown."""
    how = shown(region.channel if region.variable == CONSTANT else region.variable)
    ends = f"{number(region.start, how.scale)} to {number(region.end, how.scale)}{' ' + how.unit if how.unit else ''}"
    if region.variable == "wheel_angle_rad" and region.start == 0.0 and region.end > 0.0:
        count = round(2.0 * math.pi / region.end)
        return f"{count} cycle{'s' if count > 1 else ''} a turn of the wheel"
    return ends


def p_value(value: float) -> str:
    """Give a p-value, very small ones by their bound."""
    return "< 1e-12" if value < 1e-12 else f"{value:.1g}" if value < 0.001 else f"{value:.3f}"


def one_of(each: Missing, missing: Sequence[Missing], share: str) -> str:
    """Name an effect with its share, and those that it cannot be told from and that are not listed themselves."""
    named = {other.effect for other in missing}
    alike = [effect(slug) for slug in each.indistinguishable_from if slug not in named]
    first = f"{in_words(each)} ({share})"
    return f"one of {listed([first, *alike])}" if len(alike) > 1 else " or ".join([first, *alike])


def in_words(each: Missing) -> str:
    """Name what is missing in words; what the catalogue lacks by what it is like, where that is known."""
    return each.description if is_like(each) else effect(each.effect)


def is_like(each: Missing) -> bool:
    """Say whether something is none of the catalogue's effects, and known by what it is like."""
    return each.kind == "unknown" and bool(each.parameters)


def bare(channel: str) -> str:
    """Name of a channel in words, without its symbol."""
    return shown(channel).name.rpartition(" ")[0] or shown(channel).name


def above_noise(explanation: Explanation) -> list[str]:
    """Channels, in words, whose held-out error stays above the noise."""
    return [bare(channel) for channel, fit in explanation.fits.items() if fit.rmse_after > AT_NOISE * fit.noise]


def apart(explanation: Explanation) -> list[str]:
    """Channels, in words, that another simulator misses by more than the textbook wheel does on the soil it finds."""
    if explanation.verdict != "none":
        return []
    fits = explanation.fits.items()
    return [bare(channel) for channel, fit in fits if fit.rmse_before > AT_NOISE * fit.rmse_after]


def few(explanation: Explanation) -> bool:
    """Say whether the rows are so few that nothing is told by nothing being found."""
    return explanation.n < FEW


def listed(parts: Sequence[str]) -> str:
    """Join names as people do: ``a, b and c``."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}" if parts else ""
