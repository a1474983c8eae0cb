"""Drives of a vehicle with hidden causes: what is recorded, and the truth apart from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path as FilePath

import numpy as np

from ..drives import Plan
from ..effects import Effect, Setting
from ..effects_ground import SoilPatch
from ..mechanics import Channels, Ground, simulate
from ..sensors import Sensors, Variation, draw_sensors, variation_along
from ..strength import LEAST_R2, LEVELS, TOLERANCE, Found, find_strength
from ..table import Recorded, record
from ..weighing import Refit, still
from .confined import Confined, rows_of
from .counting import FEW_ROWS, Counted, count
from .faults import belongs_to, catalogue, draw_effect, needs
from .grounds import Stretches, draw_classes, draw_stretches
from .journey import Journey, Vehicle, draw_journey, draw_vehicle
from .truth import truth_of
from .write import write_drive

DRAWS, ATTEMPTS = 60, 4
"""Most drives drawn, and most of them tried with the effects until one lets them reach their level."""

PLACES = ("everywhere", "class", "wheel")
"""Where an effect may act."""


@dataclass(frozen=True)
class Scene:
    """What is drawn before the effects."""

    vehicle: Vehicle
    journey: Journey
    stretches: Stretches
    sensors: Sensors
    variations: tuple[Variation, ...]
    counted: Counted
    few: Counted
    """The same on few rows."""

    def varied(self, rng: np.random.Generator) -> Ground:
        """Draw the soil by row, varying along each ground."""
        number = self.journey.drive.ground
        soil = {each.name: np.empty((len(number), 1)) for each in fields(Ground)}
        for index, (mean, variation) in enumerate(zip(self.stretches.soils, self.variations, strict=True)):
            own = variation.of(mean, variation.draw(rng))
            for name, values in soil.items():
                values[number == index] = getattr(own, name)
        return Ground(**soil)


@dataclass(frozen=True)
class ConcealedDrive:
    """A drive and its truth.

    Parameters
    ----------
    scene
        Vehicle, journey, grounds, sensors.
    recorded
        Recorded rows of each wheel.
    truth
        For JSON.
    effects
        The effects, with where they act.
    clean
        What ideal sensors would report without the soil's variation.
    """

    scene: Scene
    recorded: tuple[Recorded, ...]
    truth: dict
    effects: tuple[Confined, ...]
    clean: Channels = field(repr=False)

    def write(self, folder: str | FilePath, truth_folder: str | FilePath | None = None) -> FilePath:
        """Write the drive as a folder, and the truth as ``<name>.json`` into another one where that is given."""
        return write_drive(self, FilePath(folder), None if truth_folder is None else FilePath(truth_folder))


def conceal_drive(
    seed: int, effects: Sequence[str] = (), places: Sequence[str] | None = None, level: str = "hidden",
    wheels: int | None = None,
) -> ConcealedDrive:  # fmt: skip
    """Make a drive in which effects are hidden.

    Parameters
    ----------
    seed
        Of everything random: the same arguments make the same drive.
    effects
        Slugs of `faults.catalogue`: none (a null), one or two.
    places
        ``"everywhere"``, on one ``"class"`` or on one ``"wheel"``, for each effect; everywhere where absent.
    level
        ``plain``, ``hidden`` or ``buried``: how many nats the true model gains over the textbook one, its soil refitted
        on each ground.
    wheels
        1, 2 or 4; drawn where absent.

    Returns
    -------
    ConcealedDrive
        `truth["reached"]` is False where no drive drawn let the effects reach the level at a plausible strength; then
        it is as near as could be.

    Raises
    ------
    ValueError
        An unknown slug, place or level, or a place where an effect cannot be.
    """
    where = tuple("everywhere" for _ in effects) if places is None else tuple(places)
    needed = needs(tuple(effects))
    _check(effects, where, level, wheels, needed)
    rng = np.random.default_rng([seed, len(effects), *(sum(map(ord, slug)) for slug in effects)])
    best: tuple[float, Scene, list[Confined], list[Found], list[float]] | None = None
    tried = 0
    for draw in range(DRAWS):
        several = "wheel" in where or "passes" in needed
        drawn = wheels or int(rng.choice([2, 4] if several else [1, 2, 4]))
        scene = draw_scene(rng, needed, drawn, max(0.8**draw, 0.3))
        if scene is None:
            continue
        tried += 1
        confined = [_confine(rng, scene, slug, place) for slug, place in zip(effects, where, strict=True)]
        found = [_strength(scene, each, LEVELS[level]) for each in confined]
        confined = [replace(each, effect=f.effect) for each, f in zip(confined, found, strict=True)]
        shares = []
        if len(found) == 2:
            if scene.counted.reported(confined) is None:
                continue
            shares = scene.few.shares(confined) if all(f.reached for f in found) else [0.0, 0.0]
        reached = all(f.reached for f in found) and all(share > 0.3 for share in shares)
        off = sum(abs(float(np.log(max(f.nats, 1e-3) / LEVELS[level]))) for f in found) + (not reached) * 100.0
        if best is None or off < best[0]:
            best = off, scene, confined, found, shares
        if reached or tried == ATTEMPTS:
            break
    if best is None:
        raise ValueError(f"seed {seed}: no drive that can be driven in {DRAWS} draws")
    return _assemble(rng, seed, level, *best[1:])


def _check(
    effects: Sequence[str], places: Sequence[str], level: str, wheels: int | None, needed: frozenset[str]
) -> None:
    known = catalogue()
    for slug in effects:
        if slug not in known:
            raise ValueError(f"no effect {slug!r}, only {', '.join(known)}")
    if len(effects) > 2 or len(set(effects)) < len(effects):
        raise ValueError(f"effects {', '.join(effects)}: none, one or two different ones are hidden")
    if len(places) != len(effects):
        raise ValueError(f"{len(places)} places for {len(effects)} effects")
    for slug, place in zip(effects, places, strict=True):
        if place not in PLACES:
            raise ValueError(f"no place {place!r}, only {', '.join(PLACES)}")
        if place not in places_of(slug):
            raise ValueError(f"{slug} is not confined to one {place}")
    if level not in LEVELS:
        raise ValueError(f"no level {level!r}, only {', '.join(LEVELS)}")
    if wheels not in (None, 1, 2, 4):
        raise ValueError(f"{wheels} wheels, expected 1, 2 or 4")
    if wheels == 1 and ("wheel" in places or "passes" in needed):
        raise ValueError("one wheel: no wheel runs behind another, and none differs from others")


def places_of(slug: str) -> tuple[str, ...]:
    """Give where an effect may be hidden: physics of the ground on one class, a fault of one wheel's instrument."""
    kind = catalogue()[slug]
    if kind.kind == "instrument":
        return ("everywhere", "wheel")
    return ("everywhere", "class") if belongs_to(slug) == "ground" and kind is not SoilPatch else ("everywhere",)


def draw_scene(rng: np.random.Generator, needed: frozenset[str], wheels: int, noise_factor: float) -> Scene | None:
    """Draw all that precedes the effects; None where a wheel would sink in, or noise hides the textbook itself."""
    vehicle = draw_vehicle(rng, needed, wheels)
    stretches = draw_stretches(rng, vehicle.body, draw_classes(rng))
    if stretches is None:
        return None
    journey = draw_journey(rng, vehicle, len(stretches.classes), stretches.usual_load_N, needed)
    drive = journey.drive
    textbook, theta_1 = simulate(stretches.by_row(drive.ground), vehicle.body, drive)
    if not still(textbook, theta_1) or theta_1.max() > 0.95 or theta_1.min() < 0.12:
        return None
    correlation = float(rng.uniform(0.3, 0.8)) if rng.random() < 0.15 else 0.0
    sensors = replace(draw_sensors(rng, textbook, False, noise_factor), stated=True, correlation=correlation)
    variations = []
    for number in range(len(stretches.soils)):
        stiffness_sd, strength_sd = rng.uniform([0.01, 0.01], [0.04, 0.03]).tolist()
        length = float(np.exp(rng.uniform(np.log(0.3), np.log(2.0))))
        own = drive.rows(np.flatnonzero(drive.ground == number))
        variations.append(variation_along(own, length, stiffness_sd, strength_sd))
    drawn = vehicle.body, journey, stretches, sensors, variations, textbook, theta_1
    counted, few = count(*drawn), count(*drawn, FEW_ROWS)
    null = few.refit((), few.start)
    if null is None or np.any(null.r2 < LEAST_R2 + 0.015):
        return None
    return Scene(vehicle, journey, stretches, sensors, tuple(variations), counted, few)


def _confine(rng: np.random.Generator, scene: Scene, slug: str, place: str) -> Confined:
    """Draw an effect and where it acts."""
    drive, stretches = scene.journey.drive, scene.stretches
    rows = np.ones(len(drive), dtype=bool)
    where: str | dict[str, str] = "everywhere"
    grounds, wheel = None, None
    if place == "class":
        name = str(rng.choice(sorted(set(stretches.classes))))
        where, grounds = {"class": name}, stretches.of_class(name)
        rows = np.isin(drive.ground, grounds)
    elif place == "wheel":
        wheel = int(rng.integers(len(scene.vehicle.names)))
        where = {"wheel": scene.vehicle.names[wheel]}
        rows = drive.wheel == wheel
    elif slug == SoilPatch.slug:
        rows = drive.ground == int(rng.integers(len(stretches.soils)))  # a patch lies within one ground
    chosen = np.flatnonzero(rows)
    ground = Ground(*(np.asarray(value)[chosen, 0] for value in vars(scene.counted.ground).values()))
    pulls = "drawbar_pull_N" in scene.journey.columns
    textbook = rows_of(scene.counted.textbook, chosen)
    setting = Setting(scene.vehicle.body, ground, drive.rows(chosen), textbook, pulls)
    return Confined(draw_effect(slug, rng, setting), where, grounds, wheel)


def _strength(scene: Scene, confined: Confined, target: float) -> Found:
    """Look for the strength on few rows, and correct what is looked for by what all rows count."""

    def weigh(effect: Effect, start: np.ndarray) -> Refit | None:
        return scene.few.refit([replace(confined, effect=effect)], start)

    def counted(found: Found) -> Found:
        fit = scene.counted.refit([replace(confined, effect=found.effect)], scene.counted.start)
        if fit is None:
            return replace(found, reached=False, reason="no equilibrium")
        near = abs(fit.nats / target - 1.0) <= TOLERANCE and bool(np.all(fit.r2 >= LEAST_R2))
        reason = found.reason or ("" if near else "nats or R2 are others on all rows")
        return Found(found.effect, fit.nats, fit.r2, found.reached and near, reason)

    sketch = find_strength(confined.effect, target, weigh, scene.few.start)
    found, aim = counted(sketch), target
    for _ in range(2):
        if found.reached or not sketch.reached:
            break
        aim *= target / max(found.nats, 1e-3)
        sketch = find_strength(confined.effect, aim, weigh, scene.few.start)
        found = counted(sketch)
    return found


def _assemble(
    rng: np.random.Generator, seed: int, level: str, scene: Scene, confined: Sequence[Confined],
    found: Sequence[Found], shares: Sequence[float],
) -> ConcealedDrive:  # fmt: skip
    drive, counted, body = scene.journey.drive, scene.counted, scene.vehicle.body
    whole = counted.reported(confined)
    if whole is None:
        raise ValueError(f"seed {seed}: the wheel sinks in where both effects act")
    clean, theta_1 = whole
    varied, _ = simulate(scene.varied(rng), body, drive, confined, guess=theta_1)
    recorded, loads, slips = [], drive.load_N.copy(), drive.slip.copy()
    for wheel in range(len(scene.vehicle.names)):
        rows = np.flatnonzero(drive.wheel == wheel)
        own = drive.rows(rows)
        plan = Plan(own, "drive", 10.0, scene.journey.columns)
        recorded.append(record(rng, plan, body, scene.sensors, rows_of(varied, rows)))
        loads[rows] *= np.nan_to_num(recorded[-1].load_error, nan=1.0)
        slips[rows] = recorded[-1].true_slip(own)
    oracle, _ = simulate(counted.ground, body, drive, confined, guess=theta_1, load_N=loads, slip=slips)
    textbook = counted.refit(confined, counted.start)
    assert textbook is not None
    truth = truth_of(seed, level, scene.journey, scene.stretches, counted, confined, found, shares, textbook)
    truth["wheels"] = list(scene.vehicle.names)
    truth["noise"] = {name: scene.sensors.deviation(name) for name in ("load_N", *counted.cases[0].names)}
    truth["noise_correlation"] = scene.sensors.correlation
    truth["oracle_rmse"] = _oracle_rmse(counted, recorded, oracle)
    return ConcealedDrive(scene, tuple(recorded), truth, tuple(confined), clean)


def _oracle_rmse(counted: Counted, recorded: Sequence[Recorded], oracle: Channels) -> dict[str, float]:
    """Give the root-mean-square error of the true model with the soil's mean, by answer, on sound rows."""
    sound = np.concatenate([each.sound for each in recorded])
    errors = {}
    for name in counted.cases[0].names:
        off = (np.concatenate([each.columns[name] for each in recorded]) - getattr(oracle, name))[sound]
        errors[name] = float(np.sqrt(np.nanmean(off**2)))
    return errors
