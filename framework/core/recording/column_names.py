"""What the columns of a wheel table are called, in laboratories and by the programs that write them."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from . import units


@dataclass(frozen=True)
class Quantity:
    """A channel of the wheel, and what it is called.

    Parameters
    ----------
    channel
        Its column in a wheel file.
    dimension
        Its unit (`units.factor`).
    names
        Words that leave no doubt about it.
    symbols
        Letters that stand for it, by which a table is not recognised; upper and lower case differ.
    share
        What the named quantity is multiplied by to be the channel: a radius is half of a diameter [-].
    """

    channel: str
    dimension: str
    names: str
    symbols: str = ""
    share: float = 1.0


QUANTITIES = (
    Quantity(
        "time_s", "s",
        "time, timestamp, time stamp, elapsed time, elapsed, relative time, rel time, sim time, simulation time, "
        "x value, seconds, zeit, zeitstempel, temps, tiempo",
        "t",
    ),
    Quantity(
        "load_N", "N",
        "load, normal load, vertical load, wheel load, vertical force, normal force, normal reaction, force z, "
        "z force, "
        "vertical wheel load, weight on wheel, vertical reaction, vertical contact force, normal contact force, "
        "Radlast, Last, Normallast, Aufstandskraft, Normalkraft, Vertikalkraft, Vertikallast, Auflast, "
        "charge verticale, charge, "
        "charge normale, force verticale, force normale, effort vertical, carga vertical, carga normal, fz, f z, fn",
        "W w Wz Fv",
    ),
    Quantity(
        "torque_Nm", "Nm",
        "torque, wheel torque, drive torque, driving torque, input torque, axle torque, moment, torque y, "
        "wheel moment, "
        "driving moment, resistance moment, Drehmoment, Radmoment, Raddrehmoment, Antriebsmoment, couple, "
        "couple moteur, par, par motor, my, ty, mz torque",
        "T M Tw Mw Td Md MR",
    ),
    Quantity(
        "sinkage_m", "m",
        "sinkage, wheel sinkage, sinkage depth, sink depth, wheel sink depth, sinkage of wheel, Einsinkung, "
        "Einsinktiefe, Radeinsinkung, enfoncement, hundimiento",
        "z h z0 h0 zw",
    ),
    Quantity(
        "slip", "1",
        "slip, slip ratio, wheel slip, wheel slip ratio, slippage, slip rate, longitudinal slip, Schlupf, Radschlupf, "
        "Schlupfrate, glissement, taux de glissement, deslizamiento",
        "s i S λ",
    ),
    Quantity(
        "drawbar_pull_N", "N",
        "drawbar pull, drawbar, drawbar force, drawbar load, drawbar pull force, net traction, net tractive force, "
        "net traction force, net thrust, pull, pull force, pulling force, force x, x force, fx, f x, fdp, f dp, dp, "
        "dbp, "
        "Zugkraft, Nettozugkraft, Zughakenkraft, effort de traction, force de traction, tiro",
        "Fd",
    ),
    Quantity(
        "wheel_speed_rad_s", "rad/s",
        "wheel speed, angular velocity, angular speed, wheel angular velocity, wheel angular speed, wheel velocity, "
        "wheel rotational speed, rotational speed, rotational velocity, rotation speed, rotary speed, omega, rpm, "
        "wheel rpm, Drehzahl, Raddrehzahl, Winkelgeschwindigkeit, vitesse angulaire, vitesse de rotation, "
        "velocidad angular",
        "ω w n",
    ),
    Quantity(
        "travel_speed_m_s", "m/s",
        "travel speed, travel velocity, travelling speed, traveling speed, forward speed, forward velocity, "
        "carriage speed, "
        "carriage velocity, translational velocity, translational speed, translation speed, linear velocity, "
        "linear speed, ground speed, vehicle speed, vehicle velocity, velocity, vel, speed, "
        "longitudinal velocity, linear x, "
        "longitudinal speed, Fahrgeschwindigkeit, Geschwindigkeit, Vorschubgeschwindigkeit, vitesse, "
        "vitesse d'avancement, vitesse longitudinale, velocidad",
        "V v vx Vx",
    ),
    Quantity("wheel_angle_rad", "rad", "wheel angle, rotation angle, angle of rotation, Drehwinkel, Raddrehwinkel"),
    Quantity("pitch_rad", "rad", "pitch, pitch angle, slope, slope angle, inclination, Steigung, Neigung, pente"),
    Quantity("slip_angle_rad", "rad", "slip angle, side slip angle, Schräglaufwinkel, angle de dérive", "β"),
    Quantity(
        "pass", "count", "pass, pass number, pass no, pass nr, passes, number of passes, pass count, Überfahrt, passage"
    ),
    Quantity("x_m", "m", "x position, pos x, position x", "x X"),
    Quantity("y_m", "m", "y position, pos y, position y", "y Y"),
    Quantity("radius_m", "m", "wheel radius, radius, Radradius"),
    Quantity("radius_m", "m", "wheel diameter, diameter, Raddurchmesser, diamètre de la roue, diamètre", share=0.5),
    Quantity("width_m", "m", "wheel width, width, Radbreite"),
    Quantity("grouser_height_m", "m", "grouser height, lug height, Steghöhe"),
    Quantity("grouser_count", "count", "grouser count, number of grousers, number of lugs"),
    Quantity(
        "run", "text",
        "run, run id, run no, run number, run nr, run name, trial, trial no, trial number, trial id, test, test no, "
        "test number, test id, test name, test nr, experiment, experiment no, Versuch, Versuch Nr, Versuchsnummer, "
        "essai, n° essai, no essai, numéro d'essai, Lauf, Lauf Nr",
    ),
    Quantity("wheel", "text", "wheel, wheel name, wheel id, Rad, roue"),
    Quantity(
        "soil", "text",
        "soil, soil type, soil name, soil id, soil class, test soil, sand, sand type, sand name, terrain, "
        "terrain type, terrain class, ground, ground type, ground class, material, soil material, simulant, substrate, "
        "medium, surface, surface type, Boden, Bodenart, Bodentyp, Sandart, Untergrund, Substrat, Gelände, sol, "
        "type de sol, matériau, terreno, suelo",
    ),
)  # fmt: skip

PER_LOAD = {"drawbar_pull_N": "W", "torque_Nm": "W r"}
"""What the coefficients of pull and of torque, DP/W and T/(W r), are to be multiplied by; a unit of the column map."""

_COEFFICIENTS = {
    "drawbar_pull_N": "drawbar coefficient, drawbar pull coefficient, pull coefficient, pull ratio, "
    "drawbar pull ratio, "
    "coefficient of drawbar pull, coefficient of net traction, net traction coefficient, net traction ratio, "
    "dynamic traction ratio, Triebkraftbeiwert, Zugkraftbeiwert",
    "torque_Nm": "torque coefficient, coefficient of torque, gross traction ratio, gross traction coefficient, "
    "coefficient of gross traction, Drehmomentbeiwert, Umfangskraftbeiwert",
}

ONLY_WITH_UNIT = frozenset({"radius_m", "width_m", "grouser_height_m"})
"""Columns of other quantities than the wheel's channels, such as a plot's width: taken where they say their unit."""

_TRACTION = (
    "two forces are called so. The net pull at the hook: "
    'drawbar_pull_N = { column = "...", unit = "N" } under [columns] in a column map. The gross thrust, torque '
    'over radius: torque_Nm = { column = "...", unit = "Nm", scale = RADIUS }, the radius in m'
)

HINTS = {
    "grouserspacing": "grouser_count = circumference / spacing, in vehicle.toml",
    "lugspacing": "grouser_count = circumference / spacing, in vehicle.toml",
    "force": "load_N or drawbar_pull_N: which force it is",
    "tractiveforce": _TRACTION,
    "tractiveeffort": _TRACTION,
    "tractionforce": _TRACTION,
    "motortorque": "torque_Nm, the torque at the wheel's axle: after the gear",
    "motorspeed": "wheel_speed_rad_s, the wheel's own: after the gear",
    "rimspeed": "wheel_speed_rad_s = rim speed / radius",
    "circumferentialspeed": "wheel_speed_rad_s = circumferential speed / radius",
    "skid": "slip, negative where the wheel is braked",
    "kappa": "slip; i = 1 - V/(r omega) when driving",
    "rutdepth": "sinkage_m, of the wheel's lowest point",
}
"""What comes near to a channel and is none, and what it would have to be made into."""

_BRACKETS = re.compile(r"\[([^\[\]]*)\]|\(([^()]*)\)|\{([^{}]*)\}|<([^<>]*)>")
_ADDED = {"measured", "mean", "average", "avg", "averaged", "filtered", "actual", "raw", "the", "sensor", "meas",
          "gemessen", "mittelwert", "mittlere", "mittlerer", "mittleres",
          "steady", "state", "value", "signal"}  # fmt: skip
_UNIT_BY_NAME = {"rpm": "rpm", "wheelrpm": "rpm", "seconds": "s"}
_NEED_UNIT = {"drehzahl", "raddrehzahl", "vitessederotation", "rotationalspeed", "rotationspeed", "rotaryspeed", "n"}
"""Of these nobody can say whether they are turns or radians."""

_OVER_LOAD = re.compile(r"\s*/\s*\(?\s*(?:W|Fz|F_z|Fn|Fv)\s*[*·.]?\s*(?:(?P<radius>r|R|rw|r_w)\s*)?\)?(?![\w/])")
_SHARE = re.compile(r"(?i)\b(coefficient|coeff|coef|ratio|beiwert)\b\.?")

_WHEEL_FIELDS = {"load", "torque", "sinkage", "slip"}
"""Fields of topics that need no more than their name."""

_SCATTER = {"sd", "std", "stdev", "stddev", "sigma"}
_HUMP = re.compile(r"(?<=[a-zäöü])(?=[A-ZÄÖÜ])")


@dataclass(frozen=True)
class Written:
    """A name, parted: its words, other names of the same thing, and its unit, None where it says none."""

    words: tuple[str, ...]
    others: tuple[str, ...]
    unit: str | None


@dataclass(frozen=True)
class Meaning:
    """What a column holds.

    Parameters
    ----------
    channel
        Column of a wheel file.
    factor
        To SI; None where the unit is unknown or of another kind.
    unit
        As it stands in the table, None where none does.
    dimension
        The channel's own unit (`units.factor`).
    certain
        Whether it is called by a name that leaves no doubt, and no mere letter.
    """

    channel: str
    factor: float | None
    unit: str | None
    dimension: str
    certain: bool


def key(text: str) -> str:
    """Fold a name to letters and digits without case: Drawbar-Pull and drawbar_pull are the same."""
    return re.sub(r"[\W_]+", "", unicodedata.normalize("NFKC", text).casefold())


@cache
def _names() -> dict[str, list[Quantity]]:
    found: dict[str, list[Quantity]] = {}
    for quantity in QUANTITIES:
        for name in quantity.names.split(", "):
            found.setdefault(key(name), []).append(quantity)
    return found


@cache
def _symbols() -> dict[str, list[Quantity]]:
    found: dict[str, list[Quantity]] = {}
    for quantity in QUANTITIES:
        for symbol in quantity.symbols.split():
            found.setdefault(symbol, []).append(quantity)
    return found


def names_of_channels() -> dict[str, tuple[str, str]]:
    """Give each name that leaves no doubt, and its channel, by the name folded by `key`."""
    return {key(name): (name, each.channel) for each in QUANTITIES for name in each.names.split(", ")}


@cache
def written(name: str) -> Written:
    """Part a name into words and unit: ``Drawbar pull (DP) [N]``, ``Sinkage/cm``, ``Slip in %``."""
    text = unicodedata.normalize("NFKC", name).replace("Ω", "ω").strip().strip("\"'")
    unit, others = None, []
    for match in _BRACKETS.finditer(text):
        inside = next(group for group in match.groups() if group is not None).strip()
        if unit is None and (not inside or units.is_unit(inside)):
            unit = inside
        elif inside:
            others.append(inside)
    bare = _BRACKETS.sub(" ", text).strip(" :,;")
    if unit is None and others and not _is_alias(others[-1], bare):
        unit = others.pop()  # "Load [V]": what is no name of it was meant for a unit
    if unit is None:
        for mark in (r"\s+in\s+", r"\s+(?=\S*[/%°·]\S*$)", r"\s*/\s*", r"\s*,\s*"):
            parts = re.split(mark, bare, maxsplit=1)
            if len(parts) == 2 and parts[0] and units.is_unit(parts[1]):
                bare, unit = parts
                break
    others += [part for part in re.split(r"\s*[,=;]\s*|\s+[-–]\s+", bare) if part and part != bare]
    if bare.startswith("/"):  # a topic and its field, as PlotJuggler names them
        path = [part for part in bare.split("/") if part]
        # Its last part alone, such as x or velocity, may be of anything.
        others += [" ".join(path[-2:])] + [path[-1]] * ("_" in path[-1] or path[-1] in _WHEEL_FIELDS) if path else []
    words = tuple(word for word in re.split(r"[\s_\-.:,;=/#]+", _HUMP.sub(" ", bare)) if word)
    return Written(words, tuple(others), unit)


def _is_alias(text: str, name: str) -> bool:
    """Say whether what stands in brackets behind a name is another name: drawbar pull (DP), velocity (V)."""
    own = _names().get(key(name), ())
    return key(text) in _names() or any(text in quantity.symbols.split() for quantity in own)


@cache
def meaning(name: str, unit: str | None = None) -> Meaning | None:
    """Give what a column of a laboratory's table holds, or None where its name says nothing that is known.

    Parameters
    ----------
    name
        As it stands in the header.
    unit
        As it stands in a row of units, which is believed where the name has none.
    """
    if (share := _share_of_load(name, unit)) is not None:
        return share
    parted = written(name)
    found = [*_readings(parted.words, parted.unit if parted.unit is not None else unit)]
    for other in parted.others:
        more = written(other)
        found += _readings(more.words, parted.unit if parted.unit is not None else more.unit or unit)
    known = [each for each in found if each.factor is not None]
    exact = [each for each in known if each.unit is not None or each.certain]
    candidates = exact or known or [each for each in found if each.certain]
    if not candidates:
        return None
    first = candidates[0]
    if first.channel in ONLY_WITH_UNIT and first.unit is None:
        return None
    # One letter for two quantities, without a unit that tells which
    others = {each.channel for each in candidates if each.certain == first.certain}
    return first if len(others) == 1 or first.certain else None


def _share_of_load(name: str, unit: str | None) -> Meaning | None:
    """Read a coefficient of pull or torque: by a word for it, or a quotient such as DP/W and T/(W r)."""
    text = unicodedata.normalize("NFKC", name)
    over = _OVER_LOAD.search(text)
    rest = text if over is None else f"{text[: over.start()]} {text[over.end() :]}"
    parted = written(rest)
    channels = {channel for channel, words in _COEFFICIENTS.items() if key("".join(parted.words)) in _folded(words)}
    if over is not None:
        meant, force = ("torque_Nm", "Nm") if over["radius"] else ("drawbar_pull_N", "N")
        words = written(_SHARE.sub(" ", rest)).words
        readings = [*_readings(words, force), *_readings(words[:-1], force)]
        channels |= {each.channel for each in readings} & {meant}
        channels |= {"drawbar_pull_N"} if words == ("P",) and not over["radius"] else set()
    share = units.factor(next((each for each in (parted.unit, unit) if each is not None), "-"), "1")
    if len(channels) != 1 or share is None:
        return None
    (channel,) = channels
    return Meaning(channel, share, PER_LOAD[channel], "1", certain=True)


@cache
def _folded(names: str) -> frozenset[str]:
    return frozenset(key(name) for name in names.split(", "))


def _readings(words: tuple[str, ...], unit: str | None) -> Iterator[Meaning]:
    """Yield what words can mean: as they are, without what was added to them, with a unit or a symbol at their end."""
    scatter = any(word.casefold() in _SCATTER for word in words)
    words = tuple(word for word in words if word.casefold() not in _SCATTER)
    plain = tuple(word for word in words if word.casefold() not in _ADDED)
    without_wheel = tuple(word for word in plain if word.casefold() != "wheel")
    if any(key("".join(plain[:length])) in _names() for length in range(2, len(plain) + 1)):
        without_wheel = plain  # the wheel's speed is not the speed
    for each in dict.fromkeys((words, plain, without_wheel)):
        for length in range(len(each), max(len(each) - 4, 0), -1):
            stem, end = each[:length], each[length:]
            for quantity, certain in _quantities(stem):
                if end and quantity in {each for each, _ in _quantities(end)}:
                    yield from _with_unit(quantity, stem, certain, unit, (), scatter)
                elif end and unit is not None:
                    continue
                else:
                    yield from _with_unit(quantity, stem, certain, unit, end, scatter)


def _quantities(words: tuple[str, ...]) -> Iterator[tuple[Quantity, bool]]:
    yield from ((quantity, True) for quantity in _names().get(key("".join(words)), ()))
    yield from ((quantity, False) for quantity in _symbols().get("".join(words), ()))


def _with_unit(
    quantity: Quantity, stem: tuple[str, ...], certain: bool, unit: str | None, end: tuple[str, ...], scatter: bool
) -> Iterator[Meaning]:
    channel, dimension, folded = quantity.channel, quantity.dimension, key("".join(stem))
    if scatter:
        begin, suffix = stem_of(channel)
        channel = f"{begin}_sd_{suffix}" if suffix else f"{begin}_sd"
    if dimension == "text":
        if not end and not scatter and (unit is None or units.factor(unit, "count") is not None):
            yield Meaning(channel, 1.0, None, dimension, certain)
    elif end:
        for joined in ("/".join(end), "".join(end)):
            if not joined.isdigit() and (factor := units.factor(joined, dimension)) is not None:
                yield Meaning(channel, factor * quantity.share, joined, dimension, certain)
                return
    else:
        unit = _UNIT_BY_NAME.get(folded) if unit is None else unit
        factor = 1.0 if unit is None else units.factor(unit, dimension)
        if factor is None or (unit is None and folded in _NEED_UNIT):
            yield Meaning(channel, None, unit, dimension, certain)
        else:
            yield Meaning(channel, factor * quantity.share, unit, dimension, certain)


def stem_of(column: str) -> tuple[str, str]:
    """Part a column of the contract into quantity and unit: drawbar_pull, N."""
    for unit in ("rad_s", "m_s", "rad", "Nm", "N", "m", "s", "A"):
        if column.endswith("_" + unit):
            return column.removesuffix("_" + unit), unit
    return column, ""
