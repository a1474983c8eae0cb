"""Recordings with hidden effects: the wheel table, the vehicle, and the truth apart from both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from .drives import LACKED, PROTOCOL_SHARES, PROTOCOLS, Plan, draw_plan, needs_of
from .effects import Effect, Setting, catalogue, draw_effect
from .mechanics import Body, Channels, Ground, simulate
from .sensors import Sensors, Variation, draw_sensors, draw_variation
from .soils import draw_body, draw_ground
from .strength import LEAST_R2, LEVELS, Found, find_strength, nats_of
from .table import Recorded, record
from .truth import oracle_rmse, truth_of
from .weighing import Case, refit_textbook, refit_with, still, vector, weights
from .write import write_recording

DRAWS, ATTEMPTS = 60, 8
"""Most drives drawn, and most of them tried with the effect until one lets it reach its level."""


@dataclass(frozen=True)
class ConcealedRecording:
    """One recording and its truth.

    Parameters
    ----------
    recorded
        Columns as they are recorded, (m,) each, and names of the runs.
    vehicle
        What `vehicle.toml` says.
    known_soil
        What `soil.toml` says, or empty: ``{"c_Pa": (value, sd), "phi_deg": (value, sd)}``.
    truth
        Slugs, kinds, forms, parameters, soil, nats, what counts as located right, the oracle's errors; for JSON.
    effects
        The effects themselves.
    clean, oracle
        What ideal sensors report, and what the true model with the soil's mean says of the recorded load and slip.
    """

    recorded: Recorded
    vehicle: dict
    known_soil: dict[str, tuple[float, float]]
    truth: dict
    effects: tuple[Effect, ...]
    clean: Channels
    oracle: Channels
    case: Case = field(repr=False)

    def write(self, folder: str | Path, truth_folder: str | Path | None = None) -> Path:
        """Write the recording as a folder, and the truth as ``<name>.json`` into another one where that is given."""
        return write_recording(self, Path(folder), None if truth_folder is None else Path(truth_folder))


@dataclass(frozen=True)
class _Scene:
    """What is drawn before the effects: wheel, soil, drive, sensors, variation, what the textbook answers."""

    kind: str
    body: Body
    ground: Ground
    plan: Plan
    sensors: Sensors
    variation: Variation
    known: dict[str, tuple[float, float]]
    textbook: Channels
    theta_1: np.ndarray

    @property
    def case(self) -> Case:
        return Case(
            self.body, self.ground, self.plan.drive, self.sensors, self.variation,
            "drawbar_pull_N" in self.plan.columns, self.known,
        )  # fmt: skip


def conceal(
    seed: int, effects: Sequence[str] = ("slip_sinkage",), level: str = "hidden", protocol: str | None = None,
    forms: Sequence[str | None] | None = None, samples: int = 1200,
) -> ConcealedRecording:  # fmt: skip
    """Make a recording in which effects are hidden.

    Parameters
    ----------
    seed
        Of everything random: the same arguments make the same recording.
    effects
        Slugs of PHYSICS.md: none (a null), one or two.
    level
        ``plain``, ``hidden`` or ``buried``: how many nats the true model gains over the refitted textbook one.
    protocol
        ``bench``, ``field``, ``steady``, ``ramps`` or ``turns``; one of the first three drawn where absent.
    forms
        Published form of each effect; drawn where absent or None.
    samples
        Rows of a recording in time.

    Returns
    -------
    ConcealedRecording
        `truth["reached"]` is False where no drive drawn let the effect reach the level at a plausible strength; then
        it is as near as could be.

    Raises
    ------
    ValueError
    An unknown slug, level or protocol, or an effect that cannot be seen in the protocol.
    """
    chosen = tuple(None for _ in effects) if forms is None else tuple(forms)
    _check(effects, chosen, level, protocol)
    needs = needs_of(effects)
    # without the level: one seed drives the same wheel at every strength where it can
    rng = np.random.default_rng([seed, len(effects), *(sum(map(ord, slug)) for slug in effects)])
    best: tuple[float, _Scene, list[Found], list[float]] | None = None
    tried = 0
    for draw in range(DRAWS):
        scene = _scene(rng, needs, protocol, samples, effects, max(0.8**draw, 0.3))
        if scene is None:
            continue
        tried += 1
        found = _strengths(rng, scene, effects, chosen, LEVELS[level])
        shares = _shares(scene, found)
        reached = all(f.reached for f in found) and all(share > 0.3 for share in shares)
        off = sum(abs(float(np.log(max(f.nats, 1e-3) / LEVELS[level]))) for f in found)
        off += 0.0 if reached else 100.0 if all(np.all(f.r2 >= LEAST_R2) for f in found) else 1000.0
        if best is None or off < best[0]:
            best = off, scene, found, shares
        if reached or tried == ATTEMPTS:
            break
    if best is None:
        raise ValueError(f"seed {seed}: no drive with an equilibrium in {DRAWS} draws")
    return _assemble(rng, seed, level, *best[1:])


def _check(effects: Sequence[str], forms: Sequence[str | None], level: str, protocol: str | None) -> None:
    known = catalogue()
    for slug in effects:
        if slug not in known:
            raise ValueError(f"no effect {slug!r}, only {', '.join(known)}")
    if len(effects) > 2 or len(set(effects)) < len(effects):
        raise ValueError(f"effects {', '.join(effects)}: none, one or two different ones are hidden")
    if len(forms) != len(effects):
        raise ValueError(f"{len(forms)} forms for {len(effects)} effects")
    if level not in LEVELS:
        raise ValueError(f"no level {level!r}, only {', '.join(LEVELS)}")
    if protocol is not None and protocol not in PROTOCOLS:
        raise ValueError(f"no protocol {protocol!r}, only {', '.join(PROTOCOLS)}")
    if protocol is not None and needs_of(effects) & LACKED.get(protocol, frozenset()):
        raise ValueError(f"{', '.join(effects)} cannot be seen in {protocol} trials")


def _scene(
    rng: np.random.Generator, needs: frozenset[str], protocol: str | None, samples: int, effects: Sequence[str],
    noise_factor: float,
) -> _Scene | None:  # fmt: skip
    """Draw all that precedes the effects; None where the wheel would sink in, or noise hides the textbook itself.

    The sensors' noise is multiplied by `noise_factor`.
    """
    # a wheel with lugs does not reveal that lugs are hidden
    lugs = "lugs" in needs or rng.random() < 0.08
    body = draw_body(rng, lugs)
    kind, ground = draw_ground(rng, body)
    likely = PROTOCOL_SHARES if "time" not in needs else (0.6, 0.4, 0.0, 0.0, 0.0)
    chosen = protocol if protocol is not None else str(rng.choice(PROTOCOLS, p=likely))
    plan = draw_plan(rng, chosen, body, ground, needs, samples)
    textbook, theta_1 = simulate(ground, body, plan.drive)
    if not still(textbook, theta_1) or theta_1.max() > 1.1 or theta_1.min() < 0.08:
        return None
    sensors = draw_sensors(rng, textbook, chosen == "steady", noise_factor)
    known = {}
    if "rim_adhesion" in effects:
        tan_phi = float(np.tan(ground.phi_rad))
        known = {"c_Pa": (float(ground.c_Pa), 0.1 * float(ground.c_Pa)), "tan_phi": (tan_phi, 0.02 * tan_phi)}
    scene = _Scene(kind, body, ground, plan, sensors, draw_variation(rng, plan), known, textbook, theta_1)
    weight = weights(scene.case, (), textbook, theta_1)
    null = refit_textbook(scene.case, textbook, weight, vector(ground))
    return scene if np.all(null.r2 >= LEAST_R2 + 0.015) else None


def _strengths(
    rng: np.random.Generator, scene: _Scene, effects: Sequence[str], forms: Sequence[str | None], target: float
) -> list[Found]:
    setting = Setting(scene.body, scene.ground, scene.plan.drive, scene.textbook, scene.case.pulls)
    found = []
    for slug, form in zip(effects, forms, strict=True):
        drawn = draw_effect(slug, rng, setting, form)
        found.append(find_strength(drawn, target, partial(nats_of, scene.case), vector(scene.ground)))
    return found


def _shares(scene: _Scene, found: Sequence[Found]) -> list[float]:
    """Of a pair: what each effect still explains once the other one's magnitude is refitted with the soil, by its own.

    Empty for fewer than two effects; zero for effects that stand for each other.
    """
    if len(found) < 2 or not all(f.reached for f in found):
        return [0.0] * (len(found) if len(found) > 1 else 0)
    effects = [f.effect for f in found]
    observed, theta_1 = simulate(scene.ground, scene.body, scene.plan.drive, effects)
    if not still(observed, theta_1):
        return [0.0, 0.0]
    weight = weights(scene.case, effects, observed, theta_1)
    start = vector(scene.ground)
    without = [refit_with(scene.case, observed, weight, effects[1 - own], start)[0].nats for own in (0, 1)]
    both = refit_textbook(scene.case, observed, weight, start)
    if np.any(both.r2 < LEAST_R2):
        return [0.0, 0.0]
    return [lost / f.nats for lost, f in zip(without, found, strict=True)]


def _assemble(
    rng: np.random.Generator, seed: int, level: str, scene: _Scene, found: Sequence[Found], shares: Sequence[float]
) -> ConcealedRecording:
    effects = tuple(f.effect for f in found)
    case, drive = scene.case, scene.plan.drive
    factors = scene.variation.draw(rng)
    clean, theta_1 = simulate(scene.ground, scene.body, drive, effects)
    varied, _ = simulate(scene.variation.of(scene.ground, factors), scene.body, drive, effects, guess=theta_1)
    recorded = record(rng, scene.plan, scene.body, scene.sensors, varied)
    oracle, _ = simulate(
        scene.ground, scene.body, drive, effects, guess=theta_1,
        load_N=drive.load_N * np.nan_to_num(recorded.load_error, nan=1.0), slip=recorded.true_slip(drive),
    )  # fmt: skip
    observed = weights(case, effects, clean, theta_1)
    textbook = refit_textbook(case, clean, observed, vector(scene.ground))
    truth = truth_of(seed, level, scene.plan, scene.kind, case, found, shares, textbook)
    truth["oracle_rmse"] = oracle_rmse(case, recorded, oracle)
    vehicle = {
        "name": f"concealed {seed}", "radius_m": scene.body.radius_m, "width_m": scene.body.width_m,
        "grouser_height_m": scene.body.lug_height_m, "grouser_count": scene.body.lugs,
        "noise": recorded.stated_noise(scene.sensors),
    }  # fmt: skip
    known = {}
    if scene.known:
        phi = float(np.degrees(scene.ground.phi_rad))
        slope = float(np.degrees(scene.known["tan_phi"][1] * np.cos(scene.ground.phi_rad) ** 2))
        known = {"c_Pa": scene.known["c_Pa"], "phi_deg": (phi, slope)}
    return ConcealedRecording(recorded, vehicle, known, truth, effects, clean, oracle, case)
