"""Units of wheel tables as people write them, and their factors to SI.

A table, and not pint, which takes 0.4 s to import and reads ``T`` as tesla, ``g`` as a mass and ``Hz`` as rad/s.
"""

from __future__ import annotations

import math
import re
import unicodedata
from functools import cache

G = 9.80665
"""Standard gravity: what a kilogram-force is [m/s^2]."""

_POUND, _FOOT, _INCH = 4.4482216152605, 0.3048, 0.0254
_TURN = 2.0 * math.pi

_FACTORS: dict[str, dict[float, str]] = {
    "N": {
        1.0: "N newton newtons", 1e3: "kN kilonewton", 1e6: "MN", 1e-3: "mN", 1e-2: "cN", 10.0: "daN",
        G: "kgf kp kg kilogram kilograms", 1e-3 * G: "gf g gram grams", 1e3 * G: "tf t",
        _POUND: "lbf lb lbs pound pounds", 1e3 * _POUND: "kip klbf",
    },
    "Nm": {
        1.0: "Nm mN.m newtonmetre newtonmeter newtonmetres newtonmeters J", 1e3: "kNm", 1e6: "MNm",
        1e-3: "mNm Nmm", 1e-2: "Ncm cNm", 10.0: "daNm", G: "kgfm kpm kgm", 1e-2 * G: "kgfcm kgcm",
        _POUND * _FOOT: "lbfft ftlbf lbft ftlb", _POUND * _INCH: "lbfin inlbf lbin inlb",
    },
    "m": {
        1.0: "m metre metres meter meters", 1e-2: "cm centimetre centimeter", 1e-3: "mm millimetre millimeter",
        1e-6: "um micron microns", 1e3: "km", _INCH: 'in inch inches "', _FOOT: "ft foot feet",
    },
    "1": {
        1.0: "- -- 1 -/- m/m ratio dimensionless unitless none ul fraction",
        1e-2: "% pct percent percentage prozent pourcent", 1e-3: "permille ‰",
    },
    "s": {
        1.0: "s sec secs second seconds sek sekunden", 1e-3: "ms msec millisecond milliseconds",
        1e-6: "us usec microseconds", 1e-9: "ns nsec nanoseconds", 60.0: "min minute minutes",
        3600.0: "h hr hour hours",
    },
    "rad": {
        1.0: "rad radian radians", 1e-3: "mrad", math.pi / 180.0: "deg degree degrees grad° °",
        _TURN: "rev revs revolution revolutions turn turns U",
    },
    "rad/s": {
        1.0: "rad/s rads-1 rad/sec radps rads", 1e-3: "mrad/s", math.pi / 180.0: "deg/s degs-1 deg/sec degps dps",
        _TURN / 60.0: "rpm r/min rev/min U/min 1/min min-1 revs/min turns/min tr/min", _TURN: "rps rev/s U/s r/s",
    },
    "m/s": {
        1.0: "m/s ms-1 m/sec mps", 1e-2: "cm/s cms-1 cm/sec", 1e-3: "mm/s mms-1 mm/sec",
        1.0 / 3.6: "km/h kmh-1 kmh kph",
        1.0 / 60.0: "m/min", 1e-3 / 60.0: "mm/min", 1e-2 / 60.0: "cm/min", _FOOT: "ft/s fps", 0.44704: "mph mi/h",
        _INCH: "in/s",
    },
    "A": {1.0: "A amp amps ampere amperes", 1e-3: "mA"},
    "count": {1.0: "- -- 1 # no none"},
}  # fmt: skip
"""Factor to SI and spellings, by the SI unit. A mass is taken for the weight that it has on Earth."""


@cache
def _spellings(dimension: str) -> tuple[dict[str, float], dict[str, float]]:
    """Factors by exact spelling, and by spelling without case where that leaves no doubt: mn may be mN or MN."""
    exact = {_plain(word): factor for factor, words in _FACTORS[dimension].items() for word in words.split()}
    folded: dict[str, set[float]] = {}
    for word, factor in exact.items():
        folded.setdefault(word.casefold(), set()).add(factor)
    return exact, {word: next(iter(factors)) for word, factors in folded.items() if len(factors) == 1}


@cache
def _plain(unit: str) -> str:
    text = unicodedata.normalize("NFKC", unit).replace("−", "-").replace("μ", "u").replace("⁄", "/")
    text = re.sub(r"[\s·⋅∙×*.^_²]", "", text)
    text = text.replace("°", "deg").replace("degdeg", "deg").replace("graddeg", "deg")
    text = re.sub(r"(?i)(?<=[a-z])-(?=[a-z])", "", text)  # ft-lb
    return re.sub(r"(?i)(?<=[a-z])per(?=[a-z])(?!cent)", "/", text) if "/" not in text else text


def factor(unit: str, dimension: str) -> float | None:
    """Give what a number in a unit is multiplied by to be SI, or None where it is no such unit.

    Parameters
    ----------
    unit
        As written: ``kN``, ``N·m``, ``rad s^-1``, ``U/min``, ``%``.
    dimension
        The SI unit: ``N``, ``Nm``, ``m``, ``1``, ``s``, ``rad``, ``rad/s``, ``m/s``, ``A`` or ``count``.
    """
    exact, folded = _spellings(dimension)
    text = _plain(unit)
    if dimension == "1" and not text:
        return 1.0  # "s []"
    return exact.get(text, folded.get(text.casefold()))


@cache
def is_unit(text: str) -> bool:
    """Say whether a text, without brackets, is a unit of any kind but the ampere, which is a letter of remarks, too."""
    return bool(text.strip()) and any(factor(text, each) is not None for each in _FACTORS if each != "A")


def spelt(dimension: str) -> str:
    """Name units of a kind, for errors."""
    return ", ".join(words.split()[0] for words in _FACTORS[dimension].values())
