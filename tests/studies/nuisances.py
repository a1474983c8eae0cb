"""Simulated wheels that nothing is wrong with but their noise and their ground: `explain` has to name nothing.

    python tests/studies/nuisances.py --count 4 --processes 2

Each kind breaks one assumption of the noise model. Forces are those of the package's scenarios, whose mechanics share
no code with those of `explain`.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.vehicle import Vehicle
from bevameter.framework.scenario import mechanics
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

SOILS = (
    mechanics.Soil(900.0, 0.52, 0.015, 2.5e5, 1.05), mechanics.Soil(1700.0, 0.50, 0.020, 4.5e5, 0.70),
    mechanics.Soil(3500.0, 0.25, 0.010, 2.2e5, 0.75), mechanics.Soil(500.0, 0.60, 0.012, 6.0e5, 1.10),
)  # fmt: skip
WHEELS = ((0.12, 0.10), (0.16, 0.12), (0.25, 0.18))
"""Radius and width [m]."""

PRESSURE_PA = 1.4e4
"""Usual load over radius and width, over pi [Pa]."""

ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")


@dataclass(frozen=True)
class Scene:
    """What is driven, and how it is sensed.

    Parameters
    ----------
    load_N, slip : (n,)
        True ones.
    stiffness, strength : (n,)
        Of the ground, relative to its soil's [-].
    run : (n,)
        Names of the runs of steady trials; None for rows at 10 Hz.
    noise
        Standard deviation of a channel (n,), from its usual size and its true values; of load and slip, relative.
    color
        Noise (n,) of unit variance.
    stated
        What the vehicle states of the noise, relative to the true one [-]; None for nothing.
    after
        What happens to a channel's readings (n,).
    rate_Hz
        Of the rows.
    noise_share
        Usual noise, relative to the mean of a channel [-].
    speed
        Travel speed (n,) [m/s]; drawn where absent.
    others
        Further columns, each (n,).
    """

    load_N: np.ndarray
    slip: np.ndarray
    stiffness: np.ndarray
    strength: np.ndarray
    run: np.ndarray | None = None
    noise: Callable[[float, np.ndarray], np.ndarray] = lambda usual, true: np.full(len(true), usual)
    color: Callable[[np.random.Generator, int], np.ndarray] = lambda rng, n: rng.normal(size=n)
    stated: float | None = None
    after: Callable[[np.random.Generator, np.ndarray, float], np.ndarray] = lambda rng, values, sd: values
    rate_Hz: float = 10.0
    noise_share: float = 0.015
    speed: np.ndarray | None = None
    others: Mapping[str, np.ndarray] = field(default_factory=dict)


def smooth(rng: np.random.Generator, count: int, width: float) -> np.ndarray:
    """Smooth course (n,) of zero mean and unit variance."""
    course = gaussian_filter1d(rng.normal(size=count), width)
    return (course - course.mean()) / course.std()


def slow_drive(rng: np.random.Generator, load_N: float, count: int = 600) -> Scene:
    """Load and slip change slowly; the ground varies by some per cent."""
    ground = [np.exp(sd * smooth(rng, count, rng.uniform(5.0, 30.0))) for sd in rng.uniform(0.01, 0.04, 2)]
    slip = np.clip(0.3 + 0.18 * smooth(rng, count, 15.0), -0.1, 0.8)
    return Scene(np.clip(load_N * (1.0 + 0.2 * smooth(rng, count, 20.0)), 0.3 * load_N, None), slip, *ground)


def trials(rng: np.random.Generator, load_N: float) -> Scene:
    """Ten runs of nine slips, each run at a load of its own; the ground of every trial is another."""
    run = np.repeat(np.arange(10), 9)
    slip = np.tile(np.linspace(0.03, 0.6, 9), 10)
    ground = np.exp([[0.04], [0.03]] * rng.normal(size=(2, 90)))
    return Scene(load_N * rng.uniform(0.7, 1.3, 10)[run], slip, *ground, run=np.array([f"run {k}" for k in run]))


def rough(scene: Scene, rng: np.random.Generator) -> Scene:
    """Load and slip jump from row to row."""
    count = len(scene.slip)
    load_N = scene.load_N * (1.0 + 0.1 * smooth(rng, count, 1.5))
    return replace(scene, load_N=load_N, slip=np.clip(scene.slip + 0.06 * smooth(rng, count, 1.5), -0.1, 0.85))


def steps(scene: Scene, rng: np.random.Generator) -> Scene:
    """The ground changes in steps."""
    part = np.cumsum(rng.random(len(scene.slip)) < 0.01)
    stiffness, strength = np.exp([[0.03], [0.02]] * rng.normal(size=(2, part[-1] + 1)))[:, part]
    return replace(scene, stiffness=stiffness, strength=strength)


def prepared(scene: Scene, rng: np.random.Generator) -> Scene:
    """The ground is prepared anew for each run."""
    run = np.unique(scene.run, return_inverse=True)[1]
    stiffness, strength = np.exp([[0.06], [0.05]] * rng.normal(size=(2, run.max() + 1)))[:, run]
    return replace(scene, stiffness=stiffness, strength=strength)


def some(scene: Scene, rng: np.random.Generator) -> Scene:
    """Twenty of the trials."""
    rows = np.sort(rng.choice(len(scene.slip), 20, replace=False))
    load_N, slip, stiffness, strength, run = (
        each[rows] for each in (scene.load_N, scene.slip, scene.stiffness, scene.strength, np.asarray(scene.run))
    )
    return replace(scene, load_N=load_N, slip=slip, stiffness=stiffness, strength=strength, run=run)


def trend(scene: Scene, rng: np.random.Generator) -> Scene:
    """The ground stiffens along the drive."""
    along = np.linspace(-0.5, 0.5, len(scene.slip))
    return replace(scene, stiffness=np.exp(0.15 * along), strength=np.exp(0.1 * along))


def dwelling(scene: Scene, rng: np.random.Generator) -> Scene:
    """Load and slip are held for five seconds each, then changed at once."""
    part = np.arange(len(scene.slip)) // 50
    load_N = scene.load_N.mean() * rng.uniform(0.7, 1.3, part[-1] + 1)[part]
    return replace(scene, load_N=load_N, slip=rng.uniform(-0.1, 0.7, part[-1] + 1)[part])


def placed(scene: Scene, rng: np.random.Generator) -> Scene:
    """The ground varies with place, and the speed changes by a factor of ten."""
    speed = 0.25 * np.exp(0.8 * smooth(rng, len(scene.slip), 25.0))
    place = np.cumsum(speed) / scene.rate_Hz
    grid = np.arange(0.0, place[-1] + 0.05, 0.05)
    ground = [np.interp(place, grid, np.exp(0.04 * smooth(rng, len(grid), 10.0))) for _ in range(2)]
    return replace(scene, stiffness=ground[0], strength=ground[1], speed=speed, others={"x_m": place})


def passes(scene: Scene, rng: np.random.Generator, *, same: bool) -> Scene:
    """Three passes over one track, the ground the same in each or not."""
    count = len(scene.slip) // 3
    ground = [np.exp(0.04 * smooth(rng, 3 * count, 12.0)) for _ in range(2)]
    if same:
        ground = [np.tile(each[:count], 3) for each in ground]
    others = {"x_m": np.tile(0.025 * np.arange(count), 3), "pass": np.repeat([1.0, 2.0, 3.0], count)}
    cut = replace(scene, load_N=scene.load_N[: 3 * count], slip=scene.slip[: 3 * count], speed=np.full(3 * count, 0.25))
    return replace(cut, stiffness=ground[0], strength=ground[1], others=others)


def hurrying(scene: Scene, rng: np.random.Generator) -> Scene:
    """Speeds up to 2 m/s, with accelerations of 1 m/s^2, that do nothing."""
    return replace(scene, speed=np.clip(1.0 + 0.5 * smooth(rng, len(scene.slip), 6.0), 0.05, 2.5))


def braking(scene: Scene, rng: np.random.Generator) -> Scene:
    """Slip from -0.5 to 0.8."""
    return replace(scene, slip=np.clip(0.15 + 0.3 * smooth(rng, len(scene.slip), 20.0), -0.5, 0.8))


def varied(scene: Scene, rng: np.random.Generator) -> Scene:
    """The ground varies by a tenth."""
    ground = [np.exp(0.1 * smooth(rng, len(scene.slip), rng.uniform(5.0, 30.0))) for _ in range(2)]
    return replace(scene, stiffness=ground[0], strength=ground[1])


def gross(rng: np.random.Generator, values: np.ndarray, sd: float) -> np.ndarray:
    """Two readings in a hundred are wrong."""
    wrong = rng.random(len(values)) < 0.02
    return values + wrong * rng.choice([-1.0, 1.0], len(values)) * rng.uniform(8.0, 30.0, len(values)) * sd


def hanging(rng: np.random.Generator, values: np.ndarray, sd: float) -> np.ndarray:
    """A reading is repeated for two seconds."""
    first = int(rng.integers(len(values) - 20))
    return np.concatenate([values[:first], np.full(20, values[first]), values[first + 20 :]])


def autocorrelated(rng: np.random.Generator, count: int) -> np.ndarray:
    rho = rng.uniform(0.4, 0.9)
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], rng.normal(size=count))


Change = Callable[[Scene, np.random.Generator], Scene]

NOISES: dict[str, Change] = {
    "noise grows with the reading": lambda scene, rng: replace(
        scene, noise=lambda usual, true: 0.3 * usual + 0.03 * np.abs(true)
    ),
    "noise is stated half as large": lambda scene, rng: replace(scene, stated=0.5),
    "noise is stated twice as large": lambda scene, rng: replace(scene, stated=2.0),
    "readings are rounded": lambda scene, rng: replace(
        scene, after=lambda rng, values, sd: np.round(values / (2.0 * sd)) * 2.0 * sd
    ),
    "gross errors": lambda scene, rng: replace(scene, after=gross),
    "hardly any noise": lambda scene, rng: replace(scene, noise_share=0.002),
}
DRIVES: dict[str, Change] = {
    "as assumed": lambda scene, rng: scene,
    **NOISES,
    "noise is autocorrelated": lambda scene, rng: replace(scene, color=autocorrelated),
    "a sensor hangs": lambda scene, rng: replace(scene, after=hanging),
    "load and slip are rough": rough,
    "ground changes in steps": steps,
    "ground has a trend": trend,
    "held, then changed at once": dwelling,
    "ground by place, speed varies": placed,
    "passes over the same ground": partial(passes, same=True),
    "passes over other ground": partial(passes, same=False),
    "fast and accelerating": hurrying,
    "braked and driven": braking,
    "ground varies by a tenth": varied,
    "slope": lambda scene, rng: replace(scene, others={"pitch_rad": 0.1 * smooth(rng, len(scene.slip), 40.0)}),
    "fifty hertz": lambda scene, rng: replace(slow_drive(rng, float(scene.load_N.mean()), 1500), rate_Hz=50.0),
    "sixty rows": lambda scene, rng: slow_drive(rng, float(scene.load_N.mean()), 60),
}
TRIALS: dict[str, Change] = {
    "trials": lambda scene, rng: scene,
    **{f"trials, {name}": change for name, change in NOISES.items()},
    "trials, ground by run": prepared,
    "twenty trials": some,
    "twenty trials, noise is stated half as large": lambda scene, rng: replace(some(scene, rng), stated=0.5),
    "twenty trials, noise is stated twice as large": lambda scene, rng: replace(some(scene, rng), stated=2.0),
}


def recording(kind: str, seed: int) -> Recording:
    """Make a recording of a kind."""
    rng = np.random.default_rng([[*DRIVES, *TRIALS].index(kind), seed])
    soil, (radius_m, width_m) = SOILS[rng.integers(len(SOILS))], WHEELS[rng.integers(len(WHEELS))]
    load_N = np.pi * radius_m * width_m * PRESSURE_PA * rng.uniform(0.6, 1.2)
    scene = DRIVES[kind](slow_drive(rng, load_N), rng) if kind in DRIVES else TRIALS[kind](trials(rng, load_N), rng)
    state = mechanics.equilibrium(
        radius_m, width_m, soil, scene.load_N, scene.slip, cohesion=scene.strength, stiffness=scene.stiffness
    )
    true = {"load_N": scene.load_N, "slip": scene.slip, **{name: getattr(state, name) for name in ANSWERS}}
    usual = {name: scene.noise_share * float(np.mean(np.abs(values))) for name, values in true.items()}
    columns = {}
    for name, values in true.items():
        sd = np.full(len(values), usual[name]) if name in ("load_N", "slip") else scene.noise(usual[name], values)
        columns[name] = scene.after(rng, values + sd * scene.color(rng, len(values)), usual[name])
    if scene.run is None:
        speed = (
            np.clip(0.25 + 0.08 * smooth(rng, len(scene.slip), 25.0), 0.05, None)
            if scene.speed is None
            else scene.speed
        )
        omega = speed / (radius_m * (1.0 - np.clip(scene.slip, -0.1, 0.9)))
        columns = {"time_s": np.arange(len(speed)) / scene.rate_Hz, **columns, **scene.others}
        columns |= {"travel_speed_m_s": speed, "wheel_speed_rad_s": omega}
    noise = {} if scene.stated is None else {name: scene.stated * sd for name, sd in usual.items()}
    vehicle = Vehicle.model_validate({"wheel": {"radius_m": radius_m, "width_m": width_m}, "noise": noise})
    table = WheelTable(columns, None, scene.run, Path(f"{kind} {seed}"))
    return Recording(kind, Path(kind), vehicle, None, "", "0" * 64, table)


def named(kind: str, seed: int) -> str:
    """Give the verdict on a recording, with what is most probable where it is not that there is nothing."""
    import bevameter

    answer = bevameter.explain(recording(kind, seed))
    best = answer.candidates[0] if answer.candidates else None
    return "" if answer.verdict == "none" else f"{answer.verdict}: {best and f'{best.effect} {best.probability:.2f}'}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4, help="recordings of each kind")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", default="", help="kinds whose name holds this")
    given = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with ProcessPoolExecutor(given.processes) as pool:
        for kind in (each for each in (*DRIVES, *TRIALS) if given.only in each):
            wrong = [text for text in pool.map(partial(named, kind), range(given.count)) if text]
            print(f"{kind:46} {len(wrong)} of {given.count}  {'; '.join(wrong)}", flush=True)


if __name__ == "__main__":
    main()
