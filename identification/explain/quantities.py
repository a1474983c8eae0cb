"""Names, units and numbers for text: kilopascals, millimetres, degrees and per cent."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ...framework.core.explanation import UNKNOWN
from ...framework.core.sound_explanation import SOUND_NAMES
from ..effects.catalogue import REGISTRY
from .explanation import Estimate, ExplainedGround, Region
from .variables import CONSTANT

_DEGREES = 180.0 / math.pi


@dataclass(frozen=True)
class Shown:
    """Display of a quantity: its name, unit (``""`` for a pure number), factor from SI, and symbol."""

    words: str
    unit: str = ""
    scale: float = 1.0
    symbol: str = ""

    @property
    def name(self) -> str:
        """Words and symbol."""
        return f"{self.words} {self.symbol}" if self.symbol else self.words

    @property
    def label(self) -> str:
        """Name with the unit in brackets."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def with_unit(self, text: str) -> str:
        """Append the unit to a number, as text."""
        return f"{text} {self.unit}" if self.unit else text


_QUANTITIES = {
    "load_N": Shown("load", "N", symbol="W"),
    "torque_Nm": Shown("torque", "N m", symbol="T"),
    "sinkage_m": Shown("sinkage", "mm", 1e3, symbol="z"),
    "slip": Shown("slip", symbol="i"),
    "drawbar_pull_N": Shown("drawbar pull", "N", symbol="DP"),
    "rim_speed_m_s": Shown("rim speed", "m/s"),
    "travel_speed_m_s": Shown("travel speed", "m/s"),
    "wheel_speed_rad_s": Shown("angular speed of the wheel", "rad/s"),
    "wheel_angle_rad": Shown("wheel angle", "deg", _DEGREES),
    "pitch_rad": Shown("slope along the track", "deg", _DEGREES),
    "pass": Shown("number of the pass"),
    "pass_number": Shown("number of the pass"),
    "acceleration_m_s2": Shown("acceleration", "m/s^2"),
    "angular_acceleration_rad_s2": Shown("angular acceleration", "rad/s^2"),
    "x_m": Shown("position", "m", symbol="x"),
    "y_m": Shown("position", "m", symbol="y"),
    "distance_m": Shown("distance along the track", "m"),
    "time_s": Shown("time", "s"),
    "lag_s": Shown("delay", "s"),
    CONSTANT: Shown("nothing: constant"),
    "c_Pa": Shown("cohesion", "kPa", 1e-3, symbol="c"),
    "phi_rad": Shown("friction angle", "deg", _DEGREES, symbol="phi"),
    "k_m": Shown("shear modulus", "mm", 1e3, symbol="k"),
    "stiffness_Pa": Shown("stiffness", "kPa", 1e-3, symbol="k1 + k2 b"),
    "n": Shown("sinkage exponent", symbol="n"),
}

_UNITS = {
    "Pa": ("kPa", 1e-3),
    "Pa/m": ("kPa/m", 1e-3),
    "rad": ("deg", _DEGREES),
    "m": ("mm", 1e3),
    "m/N": ("mm/kN", 1e6),
}

_PLACES = ("from", "to")
"""Parameters in metres that are positions along a track, not small lengths."""

_COLUMN = re.compile(r"\b(" + "|".join(name for name in _QUANTITIES if "_" in name) + r")\b")

KINDS = {"physics": "physics", "instrument": "instrument or configuration", "unknown": "unknown"}


def shown(name: str, unit: str = "") -> Shown:
    """Return the display of a channel, variable or parameter; one without an entry has its name and SI unit."""
    if name in _QUANTITIES:
        return _QUANTITIES[name]
    if name.rpartition(".")[2] in _PLACES or unit not in _UNITS:
        return Shown(name, unit)
    return Shown(name, *_UNITS[unit])


def columns_in_words(text: str) -> str:
    """Replace names of columns in a text by names of quantities: ``torque_Nm`` by ``torque T``."""
    return _COLUMN.sub(lambda match: _QUANTITIES[match[1]].name, text)


def number(value: float, scale: float = 1.0) -> str:
    """Format a number with three significant digits; ``unknown`` if it is not finite."""
    if not math.isfinite(value):
        return "unknown"
    text = f"{value * scale:.3g}"
    return f"{float(text):.0f}" if "e" in text and 1.0 <= abs(value * scale) < 1e6 else text


def signed(value: float, places: int = 1) -> str:
    """Format a number with its sign; ``-`` if it is not finite."""
    return f"{value:+.{places}f}" if math.isfinite(value) else "-"


def with_sd(value: float, sd: float, scale: float = 1.0) -> str:
    """Format a value with its standard deviation, which determines the number of digits."""
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
    """Format an estimate: ``n1 = 0.213 ± 0.019``, with the unit if any."""
    how = shown(name, value.unit)
    return f"{how.name} = {how.with_unit(with_sd(value.value, value.sd, how.scale))}"


def percent(probability: float) -> str:
    """Format a probability in per cent, as a bound close to 0 and 100 %."""
    if not math.isfinite(probability):
        return "unknown"
    if probability <= 0.005:
        return "< 0.5 %"
    return "> 99.5 %" if probability >= 0.995 else f"{100.0 * probability:.0f} %"


def p_value(value: float) -> str:
    """Format a p-value, very small ones as a bound."""
    if not math.isfinite(value):
        return "unknown"
    return "< 1e-12" if value < 1e-12 else f"{value:.1g}" if value < 0.001 else f"{value:.3f}"


def effect(name: str) -> str:
    """Name one effect, or several joined by plus signs; forms stay in brackets."""
    return " + ".join(
        title(slug) + (f" ({form[:-1]})" if form else "")
        for slug, _, form in (part.partition("[") for part in name.split(" + "))
    )


def title(slug: str) -> str:
    """Name an effect; one that is not in the catalogue has its public name."""
    return REGISTRY[slug].title if slug in REGISTRY else SOUND_NAMES.get(slug, slug)


def what_happens(slug: str) -> str:
    """Describe an effect in a clause; empty for one that is not in the catalogue."""
    if slug == UNKNOWN:
        return "nothing in the catalogue explains it"
    return REGISTRY[slug].what_happens if slug in REGISTRY else ""


def listed(parts: Iterable[str], last: str = "and") -> str:
    """Join names: ``a, b and c``."""
    *first, final = parts
    return f"{', '.join(first)} {last} {final}" if first else final


def capital(text: str) -> str:
    """Capitalise the first letter of a text."""
    return text[:1].upper() + text[1:]


def interval(region: Region) -> str:
    """Format the interval of a region: of its variable, or of the channel's offset, in display units."""
    how = shown(region.channel if region.variable == CONSTANT else region.variable)
    if cycles := cycles_a_turn(region):
        return f"{cycles} cycle{'s' if cycles > 1 else ''} a turn of the wheel"
    farthest = max(abs(region.start), abs(region.end)) * how.scale
    places = 2 - math.floor(math.log10(farthest)) if 0.0 < farthest < math.inf else 0
    start, end = (number(round(each * how.scale, places) + 0.0) for each in (region.start, region.end))
    return how.with_unit(f"{start} to {end}")


def cycles_a_turn(region: Region) -> int:
    """Cycles a turn of the wheel of a periodic region; 0 for other regions."""
    ripples = region.variable == "wheel_angle_rad" and region.start == 0.0 and 0.0 < region.end <= 2.0 * math.pi
    return round(2.0 * math.pi / region.end) if ripples else 0


def with_interval(value: float, ends: Sequence[float], scale: float = 1.0) -> str:
    """Format a value with its 95 % interval: ``2.8 (2.4 to 3.3)``."""
    low, high = ends
    return f"{number(value, scale)} ({number(low, scale)} to {number(high, scale)})"


def ground_name(ground: ExplainedGround) -> str:
    """Name a ground by its class and when it was driven on."""
    name = ground.class_name or "ground"
    if math.isfinite(ground.start_s) and math.isfinite(ground.end_s):
        return f"{name}, {ground.start_s:.0f} to {ground.end_s:.0f} s"
    return name
