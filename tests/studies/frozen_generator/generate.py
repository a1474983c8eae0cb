"""Recordings from seeds: ``make`` one, ``write`` one with its truth apart."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .contact import Array, Soil
from .drives import Drive
from .effect import FIELD_OF, PULL, SINKAGE, TORQUE, Effect
from .evidence import KnownSoil
from .plan import Plan, make_plan
from .scene import Hidden, Scene, Unsuitable, draw_scene, predict
from .sensors import (
    ANGLE,
    LOAD,
    PASS,
    PITCH,
    PLACE,
    SLIP,
    TIME,
    TRAVEL_SPEED,
    WHEEL_SPEED,
    Sensors,
    draw_ground,
    draw_sensors,
    read_off,
    spoil,
)
from .soil_effects import RimAdhesion
from .strength import Found, Search, staged
from .vehicle_effects import Grousers

TRIES = 10
PROTOCOL_NAMES = {
    "bench": "test bench, steps or ramps of slip at several loads",
    "field": "vehicle wheel in the field",
    "passes": "passes in one rut",
    "speed": "changing speed",
    "table": "table of steady trials",
}


@dataclass(frozen=True)
class Recording:
    """One recording as its judge knows it; `truth` must never reach the judged."""

    columns: dict[str, Array]
    run: Array | None
    vehicle: dict
    known_soil: KnownSoil
    truth: dict


@dataclass(frozen=True)
class _Draw:
    """A scene with its instruments and the effects found for it."""

    scene: Scene
    sensors: Sensors
    known: KnownSoil
    found: Found
    attempt: int


def _known_soil(rng: np.random.Generator, soil: Soil, plan: Plan) -> KnownSoil:
    """Cohesion and friction angle as known from elsewhere, within 5 to 15 %, in a quarter of the recordings."""
    always = RimAdhesion in plan.effects
    if rng.random() >= 0.25 and not always:
        return {}
    known = {}
    for name, value in (("c_Pa", soil.cohesion), ("phi_deg", float(np.rad2deg(soil.friction_angle)))):
        sd = value * (rng.uniform(0.05, 0.06) if always else rng.uniform(0.05, 0.15))
        known[name] = (float(value + sd * np.clip(rng.standard_normal(), -2.0, 2.0)), float(sd))
    return known


def _draw(seed: int, attempt: int) -> _Draw | None:
    """One attempt at what the seed plans."""
    rng = np.random.default_rng([seed, 3, attempt])
    plan = make_plan(seed, attempt)
    protocol = str(rng.choice(plan.protocols()))
    kinds = plan.effects
    has_pull = any(PULL in kind.needs for kind in kinds) or rng.random() < 0.75
    try:
        scene = draw_scene(
            rng, protocol, lugs=Grousers in kinds, laps=any(kind.laps for kind in kinds), has_pull=has_pull
        )
    except Unsuitable:
        return None
    sensors = draw_sensors(rng, scene)
    known = _known_soil(rng, scene.soil, plan)
    effects = [kind(rng, scene) for kind in kinds]
    if not effects:
        return _Draw(scene, sensors, known, Found([], "null", [], reached=True), attempt)
    ground = draw_ground(np.random.default_rng([seed, 4, attempt]), scene.drive)
    search = Search(scene, sensors, ground, known)
    if len(effects) == 1:
        found = search.single(effects[0], plan.level)
    else:
        found = search.pair(effects[0], effects[1], plan.level)
    return None if found is None else _Draw(scene, sensors, known, found, attempt)


def _best_draw(seed: int) -> _Draw:
    """The first attempt that reaches a level, or else the strongest; attempts without a scene do not count."""
    best: _Draw | None = None
    tries = 0
    for attempt in range(40):
        draw = _draw(seed, attempt)
        if draw is None:
            continue
        if draw.found.reached:
            return draw
        tries += 1
        if best is None or sum(draw.found.nats) > sum(best.found.nats):
            best = draw
        if tries == TRIES:
            break
    if best is None:
        raise RuntimeError(f"seed {seed}: no suitable scene")
    return best


def _choose_columns(rng: np.random.Generator, draw: _Draw) -> list[str]:
    """Columns that are recorded: what the effects need, and by chance others."""
    drive, needed = draw.scene.drive, set()
    for effect, _ in draw.found.hidden:
        needed |= effect.needs
    chance = {WHEEL_SPEED: 0.55, PITCH: 0.2, ANGLE: 0.0 if drive.steady else 0.35, PLACE: 0.0 if drive.steady else 0.5}
    chance[PASS] = 0.75 if drive.protocol == "passes" else 0.0
    chosen = {name for name, probability in chance.items() if rng.random() < probability} | needed
    if WHEEL_SPEED in chosen and rng.random() < 0.7:
        chosen.add(TRAVEL_SPEED)
    if TRAVEL_SPEED not in chosen or WHEEL_SPEED not in chosen or rng.random() < 0.75:
        chosen.add(SLIP)  # else it follows from the two speeds
    chosen |= {LOAD, TORQUE, SINKAGE, *draw.scene.answered}
    if not drive.steady:
        chosen.add(TIME)
    order = (TIME, LOAD, TORQUE, SINKAGE, SLIP, PULL, WHEEL_SPEED, TRAVEL_SPEED, ANGLE, PITCH, PASS, PLACE)
    return [name for name in order if name in chosen]


def _oracle(scene: Scene, hidden: Hidden, drive: Drive, measured: dict[str, Array], sound: dict[str, Array]) -> dict:
    """Root-mean-square error of the true model, fed with the measured load and slip, gross errors left out."""
    load, slip = np.clip(measured[LOAD], 0.05 * drive.load, None), np.clip(measured[SLIP], -0.02, 0.97)
    reaction = predict(scene.wheel, scene.soil, replace(drive, load=load, slip=slip), hidden)
    errors = {column: values - getattr(reaction, FIELD_OF[column]) for column, values in sound.items()}
    return {column: float(np.sqrt(np.nanmean(error**2))) for column, error in errors.items()}


def make(seed: int) -> Recording:
    """The recording of a seed."""
    draw = _best_draw(seed)
    scene, sensors, hidden = draw.scene, draw.sensors, draw.found.hidden
    rng = np.random.default_rng([seed, 6])
    drive = staged(scene.drive, hidden)
    ground = draw_ground(np.random.default_rng([seed, 4, draw.attempt]), scene.drive)
    actual = predict(scene.wheel, scene.soil, drive, hidden, ground)
    clean = read_off(rng, scene, drive, actual, sensors)
    names = _choose_columns(rng, draw)
    columns = {name: clean[name] for name in names}
    spoilt = spoil(rng, columns, sensors)

    sound = {name: np.where(spoilt[name], np.nan, columns[name]) for name in scene.answered}
    nats, correlated = Search(scene, sensors, ground, draw.known).nats(hidden) if hidden else (0.0, 0.0)
    noise = {name: sensors.sd[name] for name in names if name in sensors.sd}
    truth = {
        "schema": 1,
        "seed": seed,
        "level": draw.found.level,
        "nats": nats,
        "nats_correlated": correlated,
        "nats_each": draw.found.nats,
        "reached": draw.found.reached,
        "protocol": PROTOCOL_NAMES[scene.drive.protocol],
        "soil": _soil_truth(scene.soil),
        "effects": [_effect_truth(effect, strength) for effect, strength in hidden],
        "noise": noise,
        "noise_memory": sensors.memory,
        "ground_sd": {"stiffness": ground.stiffness_sd, "strength": ground.strength_sd, "length_m": ground.length},
        "oracle_rmse": _oracle(scene, hidden, drive, clean, sound),
    }
    run = np.array([f"trial_{row + 1:03d}" for row in range(drive.rows)]) if scene.drive.steady else None
    return Recording(columns, run, _vehicle(rng, scene, noise), draw.known, truth)


def _soil_truth(soil: Soil) -> dict[str, float]:
    return {
        "c_Pa": soil.cohesion,
        "phi_rad": soil.friction_angle,
        "k_m": soil.shear_modulus,
        "stiffness_Pa": soil.stiffness,
        "n": soil.exponent,
    }


def _effect_truth(effect: Effect, strength: float) -> dict:
    return {
        "effect": effect.slug,
        "kind": effect.kind,
        "form": effect.form,
        "parameters": {name: float(value) for name, value in effect.parameters(strength).items()},
        "strength": strength,
        "channels": list(effect.channels),
        "variables": list(effect.variables),
    }


def _vehicle(rng: np.random.Generator, scene: Scene, noise: dict[str, float]) -> dict:
    """What vehicle.toml says; the noise in half of the recordings."""
    wheel: dict[str, float | int] = {"radius_m": scene.wheel.radius, "width_m": scene.wheel.width}
    if scene.wheel.grouser_count:
        wheel |= {"grouser_height_m": scene.wheel.grouser_height, "grouser_count": scene.wheel.grouser_count}
    vehicle: dict = {
        "name": str(rng.choice(["testbed wheel", "rover", "field vehicle", "single wheel"])),
        "wheel": wheel,
    }
    if rng.random() < 0.5:
        vehicle["noise"] = {name: float(f"{value:.3g}") for name, value in noise.items()}
    return vehicle


def _text(name: str, value: float, spoilt: bool) -> str:
    """A value as it stands in the file; a missing one is left empty."""
    if spoilt:
        return ""
    if name == PASS:
        return str(int(value))
    return f"{value:.4f}" if name == TIME else f"{value:.7g}"


def write(seed: int, folder: Path, truth_folder: Path) -> None:
    """Write the recording of a seed to a folder, and its truth to another."""
    recording = make(seed)
    folder, truth_folder = Path(folder), Path(truth_folder)
    folder.mkdir(parents=True, exist_ok=True)
    truth_folder.mkdir(parents=True, exist_ok=True)
    names = list(recording.columns)
    lines = [",".join([*(["run"] if recording.run is not None else []), *names])]
    for row in range(len(recording.columns[LOAD])):
        cells = [
            _text(name, recording.columns[name][row], bool(np.isnan(recording.columns[name][row]))) for name in names
        ]
        lines.append(",".join([*([str(recording.run[row])] if recording.run is not None else []), *cells]))
    (folder / "wheel.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

    vehicle = recording.vehicle
    toml = [f'name = "{vehicle["name"]}"']
    for table in ("wheel", "noise"):
        if table in vehicle:
            toml += ["", f"[{table}]", *(f"{key} = {value!r}" for key, value in vehicle[table].items())]
    (folder / "vehicle.toml").write_text("\n".join(toml) + "\n", encoding="utf-8")
    (folder / "recording.toml").write_text(f'name = "{folder.name}"\nstreams = ["wheel"]\n', encoding="utf-8")
    if recording.known_soil:
        soil = [f"{name} = {{ value = {v:.5g}, sd = {sd:.3g} }}" for name, (v, sd) in recording.known_soil.items()]
        (folder / "soil.toml").write_text("\n".join(soil) + "\n", encoding="utf-8")
    truth = json.dumps(recording.truth, indent=1)
    (truth_folder / f"{folder.name}.json").write_text(truth + "\n", encoding="utf-8")
