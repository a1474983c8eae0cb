"""How close identification comes to the Cramer-Rao bound, and how often its 95 % intervals hold the truth.

The paper's simulated wheel (Iagnemma & Dubowsky 2002, Sec. 4): r 0.5 m, b 0.3 m, k 5 mm, k1 20 kPa, k2 600 kN/m3,
n 0.9, c 1 kPa, phi 30 deg; 300 samples at 10 Hz, load 800 +- 300 N, slip 0.3 +- 0.25, white noise in every channel with
a standard deviation that is a share of the channel's maximum. Soil, load and slip of every sample are unknown to the
estimator.

    python tests/studies/identification_accuracy.py --seeds 200 --write
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.estimate.estimate import estimate_soil
from bevameter.identification.estimate.solution import Measured
from bevameter.identification.mechanics.linearised import estimate as linear_estimate
from bevameter.identification.mechanics.soil import Soil, slope_of_internal, soil_vector
from bevameter.identification.mechanics.textbook import TextbookWheel, equilibrium
from measured import write

WHEEL = Wheel(radius_m=0.5, width_m=0.3)
SOIL = Soil(c_Pa=1e3, phi_rad=np.radians(30.0), k_m=0.005, stiffness_Pa=20e3 + 600e3 * 0.3, n=0.9)
NAMES = ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n")
COLUMNS = (
    "noise", "channels", "gross errors", "rms error of c [Pa] (bound, ratio)", "of phi [deg] (bound, ratio)",
    "95 % interval holds c / phi / k / stiffness / n [%]",
    "strength at low, middle, high stress held / c or phi called separable [%]",
    "linear method, median c [Pa], phi [deg]", "s",
)  # fmt: skip
ASSUMED_K = 3.0 * SOIL.k_m  # given to the linear method


def truth(samples: int = 300, swing_N: float = 300.0) -> np.ndarray:
    """Noise-free channels (n, 5) of the paper's case."""
    time_s = np.arange(samples) / 10.0
    load = 800.0 + swing_N * np.sin(2.0 * np.pi * time_s / 10.0)
    slip = 0.3 + 0.25 * np.sin(2.0 * np.pi * time_s / 7.3)
    state = equilibrium(WHEEL, SOIL, load, slip)
    return np.column_stack([load, state.torque_Nm, state.sinkage_m, slip, state.drawbar_pull_N])


def noisy(
    rng: np.random.Generator, share: float, pull: bool, outliers: float = 0.0, swing_N: float = 300.0
) -> Measured:
    """One simulated recording; a share `outliers` of its samples is replaced by gross errors."""
    channels = truth(swing_N=swing_N)
    noise = share * np.abs(channels).max(axis=0)
    measured = channels + noise * rng.normal(size=channels.shape)
    rows = rng.choice(len(channels), int(outliers * len(channels)), replace=False)
    measured[rows] = rng.uniform(0.0, 2.0, (len(rows), 5)) * np.abs(channels).max(axis=0)
    measured[rows, 3] = rng.uniform(0.0, 0.95, len(rows))
    if not pull:
        measured[:, 4], noise = np.nan, np.where(np.arange(5) == 4, np.nan, noise)
    return Measured(measured, noise, np.arange(len(channels)) / 10.0)


def bound(share: float, pull: bool) -> np.ndarray:
    """Cramer-Rao bound on the standard deviation of each parameter, SI, load and slip of every sample unknown."""
    model, channels = TextbookWheel(WHEEL), truth()
    prediction = model.predict(channels[:, [0, 3]], soil_vector(SOIL), np.full(len(channels), 0.4))
    scale = 1.0 / (share * np.abs(channels).max(axis=0))
    scale[4] *= pull
    a, b = prediction.by_latent * scale[:, None], prediction.by_parameter * scale[:, None]
    inner = np.linalg.inv(np.einsum("nma,nmb->nab", a, a))
    cross = np.einsum("nma,nmp->nap", a, b)
    covariance = np.linalg.inv(np.einsum("nmp,nmq->pq", b, b) - np.einsum("nap,nab,nbq->pq", cross, inner, cross))
    slopes = np.array([slope_of_internal(name, getattr(SOIL, name)) for name in NAMES])
    return np.sqrt(np.diag(covariance)) * slopes


def one(task: tuple[int, float, bool, float, float]) -> tuple[list[float], list[bool], list[float], float, list[bool]]:
    """Estimates, whether the interval holds the truth, the linear method's c and phi, seconds; of the shear strengths,
    whether their intervals hold the truth, and whether c and phi are called separable.
    """
    seed, share, pull, outliers, swing_N = task
    measured = noisy(np.random.default_rng(seed), share, pull, outliers, swing_N)
    began = time.perf_counter()
    estimate = estimate_soil(measured, WHEEL)
    seconds = time.perf_counter() - began
    quantities = [estimate.parameters[name] for name in NAMES]
    held = [q.low <= getattr(SOIL, name) <= q.high for q, name in zip(quantities, NAMES, strict=True)]
    linear = linear_estimate(*measured.channels[:, :4].T, ASSUMED_K, WHEEL)
    strong = [
        each.low_Pa <= SOIL.c_Pa + each.normal_stress_Pa * np.tan(SOIL.phi_rad) <= each.high_Pa
        for each in estimate.shear_strength
    ]
    said = [*strong, estimate.separable["c_Pa"] or estimate.separable["phi_rad"]]
    return [q.value for q in quantities], held, [linear.c_Pa, linear.phi_rad], seconds, said


def study(
    seeds: int, share: float, pull: bool, outliers: float, swing_N: float, pool: ProcessPoolExecutor
) -> list[str]:
    """Give the cells of one row of the table."""
    rows = list(pool.map(one, [(seed, share, pull, outliers, swing_N) for seed in range(seeds)], chunksize=4))
    values, held = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    target = np.array([getattr(SOIL, name) for name in NAMES])
    rms = np.sqrt(np.mean((values - target) ** 2, axis=0))
    least = bound(share, pull) if swing_N else np.full(5, np.nan)
    said = 100 * np.mean([row[4] for row in rows], axis=0)
    linear = np.median([row[2] for row in rows], axis=0)
    return [
        f"{100 * share:.0f} %" + ("" if swing_N else ", constant load"),
        "W, T, z, i, DP" if pull else "W, T, z, i", f"{100 * outliers:.0f} %",
        f"{rms[0]:.0f} ({least[0]:.0f}, {rms[0] / least[0]:.2f})",
        f"{np.degrees(rms[1]):.2f} ({np.degrees(least[1]):.2f}, {rms[1] / least[1]:.2f})",
        " / ".join(f"{100 * each:.1f}" for each in held.mean(axis=0)),
        f"{said[0]:.0f}, {said[1]:.0f}, {said[2]:.0f} / {said[3]:.0f}",
        f"{linear[0]:.0f}, {np.degrees(linear[1]):.1f}",
        f"{np.median([row[3] for row in rows]):.2f}",
    ]  # fmt: skip


def main() -> None:
    """Print the table, and write it for the documentation where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--write", action="store_true", help="write docs/measured/identification-accuracy.json")
    arguments = parser.parse_args()
    rows = []
    print(*COLUMNS, sep=" | ")
    with ProcessPoolExecutor(max_workers=arguments.workers) as pool:
        for share, pull, outliers, swing_N in (
            (0.10, False, 0.0, 300.0), (0.10, True, 0.0, 300.0), (0.02, False, 0.0, 300.0), (0.02, True, 0.0, 300.0),
            (0.02, True, 0.05, 300.0), (0.10, False, 0.05, 300.0), (0.02, False, 0.0, 0.0),
        ):  # fmt: skip
            rows.append(study(arguments.seeds, share, pull, outliers, swing_N, pool))
            print(*rows[-1], sep=" | ", flush=True)
    if arguments.write:
        write(
            "identification-accuracy", COLUMNS, rows, data=f"Simulated; {arguments.seeds} drives a row",
            command=f"python tests/studies/identification_accuracy.py --seeds {arguments.seeds} --write",
        )  # fmt: skip


if __name__ == "__main__":
    main()
