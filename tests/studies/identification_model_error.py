"""How often 95 % intervals hold the soil where the wheel does what the textbook leaves out.

Wheels on random soils are simulated with one kind of physics beyond the paper's Eq. 1-9, at a random strength within
what is published, by an integrator of its own (midpoint rule, bisection; nothing of `bevameter` inside), and identified
as if nothing of it were known. Two kinds of recording: steady trials (4 loads x 7 slips) and a drive of 200 samples;
with and without drawbar pull.

    python tests/studies/identification_model_error.py --seeds 20
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.estimate.estimate import WRONG_FORM, solve, summarise, usable
from bevameter.identification.estimate.form_error import rejected
from bevameter.identification.estimate.solution import Measured
from measured import write

KINDS = {
    "none": {},
    "slip_sinkage": {"n1": (0.1, 0.6)},  # Ding et al. 2010
    "stress_peak_shift": {"a0": (0.2, 0.45), "a1": (0.2, 0.4)},  # Wong & Reece 1967
    "exit_angle": {"exit_share": (0.1, 0.5)},  # Onafeko & Reece 1967; Ishigami 2007
    "bulldozing": {"bulldozing": (20e3, 150e3)},  # Hegedus 1960; passive pressure gamma K_p / 2 [Pa/m]
    "shear_hump": {"residual": (0.6, 0.9)},  # Wong & Preston-Thomas 1983
    "modulus_with_slip": {"k1": (0.5, 3.0)},  # k grows with slip: soil carried along
    "hard_layer": {"layer": (0.3, 0.7)},  # Bekker 1969; depth of the layer as a share of the deepest sinkage
    "rim_friction": {"rim": (0.75, 0.95)},  # Bekker 1956; the rim's friction as a share of the soil's
    "slip_sinkage+stress_peak_shift": {"n1": (0.1, 0.6), "a0": (0.2, 0.45), "a1": (0.2, 0.4)},
    "slip_sinkage+bulldozing+shear_hump": {"n1": (0.1, 0.6), "bulldozing": (20e3, 150e3), "residual": (0.6, 0.9)},
}
"""Kinds of missing physics: ranges of their parameters."""

_TEXTBOOK = {"n1": 0.0, "a0": 0.5, "a1": 0.0, "exit_share": 0.0, "bulldozing": 0.0, "residual": 1.0, "k1": 0.0,
             "layer": np.inf, "rim": 1.0}  # fmt: skip
_CELLS = (np.arange(240) + 0.5) / 240.0


@dataclass(frozen=True)
class Ground:
    """A soil (c [Pa], phi [rad], k [m], stiffness [Pa], n) under a wheel, with physics that the textbook leaves out."""

    wheel: Wheel
    c_Pa: float
    phi_rad: float
    k_m: float
    stiffness_Pa: float
    n: float
    extra: dict[str, float]

    def forces(self, theta_1: np.ndarray, slip: np.ndarray, layer_m: float) -> np.ndarray:
        """Load, torque and drawbar pull (m, 3) at entry angles (m,) [rad]."""
        extra, r, b = {**_TEXTBOOK, **self.extra}, self.wheel.radius_m, self.wheel.width_m
        peak = np.clip(extra["a0"] + extra["a1"] * slip, 0.05, 0.95) * theta_1
        exit_angle = -extra["exit_share"] * theta_1
        theta = exit_angle[:, None] + (theta_1 - exit_angle)[:, None] * _CELLS
        step = (theta_1 - exit_angle) / len(_CELLS)
        share = (theta - exit_angle[:, None]) / (peak - exit_angle)[:, None]
        mirrored = theta_1[:, None] - share * (theta_1 - peak)[:, None]
        ahead = np.where(theta >= peak[:, None], theta, mirrored)
        depth = r * np.maximum(np.cos(ahead) - np.cos(theta_1)[:, None], 0.0)
        exponent = (self.n + extra["n1"] * slip)[:, None]
        sigma = self.stiffness_Pa * (depth / b) ** exponent
        sigma = sigma + 5.0 * self.stiffness_Pa * np.maximum(depth - layer_m, 0.0) / b
        moved = r * (theta_1[:, None] - theta - (1.0 - slip)[:, None] * (np.sin(theta_1)[:, None] - np.sin(theta)))
        modulus = self.k_m * (1.0 + extra["k1"] * slip)[:, None]
        residual = extra["residual"]
        rise = -np.expm1(-moved / modulus)
        if residual < 1.0:
            rise = (
                residual * (1.0 + (1.0 / (residual * (1.0 - 1.0 / np.e)) - 1.0) * np.exp(1.0 - moved / modulus)) * rise
            )
        tau = extra["rim"] * (self.c_Pa + sigma * np.tan(self.phi_rad)) * rise
        area = (r * b * step)[:, None]
        load = np.sum(area * (sigma * np.cos(theta) + tau * np.sin(theta)), axis=1)
        torque = np.sum(area * r * tau, axis=1)
        pull = np.sum(area * (tau * np.cos(theta) - sigma * np.sin(theta)), axis=1)
        pull -= extra["bulldozing"] * b * (r * (1.0 - np.cos(theta_1))) ** 2
        return np.column_stack([load, torque, pull])

    def channels(self, load: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Noise-free channels (m, 5) in the order of `textbook.CHANNELS`."""
        layer_m = np.inf
        if "layer" in self.extra:
            theta_1 = self._carry(load, slip, np.inf)
            layer_m = self.extra["layer"] * float(np.max(self.wheel.radius_m * (1.0 - np.cos(theta_1))))
        theta_1 = self._carry(load, slip, layer_m)
        forces = self.forces(theta_1, slip, layer_m)
        sinkage = self.wheel.radius_m * (1.0 - np.cos(theta_1))
        return np.column_stack([load, forces[:, 1], sinkage, slip, forces[:, 2]])

    def _carry(self, load: np.ndarray, slip: np.ndarray, layer_m: float) -> np.ndarray:
        low, high = np.full(len(load), 1e-4), np.full(len(load), 1.7)
        for _ in range(50):
            middle = 0.5 * (low + high)
            enough = self.forces(middle, slip, layer_m)[:, 0] >= load
            low, high = np.where(enough, low, middle), np.where(enough, middle, high)
        return 0.5 * (low + high)


def ground(rng: np.random.Generator, kind: str) -> tuple[Ground, float]:
    """Draw a wheel, a soil and the strength of what is left out; also a typical load [N]: about 15 % sinkage."""
    while True:
        radius = rng.uniform(0.08, 0.3)
        wheel = Wheel(radius_m=radius, width_m=radius * rng.uniform(0.5, 1.2))
        extra = {name: float(rng.uniform(*ends)) for name, ends in KINDS[kind].items()}
        soil = Ground(
            wheel, float(rng.choice([0.0, 1.0]) * rng.uniform(100.0, 2500.0)), np.radians(rng.uniform(22.0, 40.0)),
            radius * rng.uniform(0.02, 0.12), 10.0 ** rng.uniform(4.7, 6.0), rng.uniform(0.6, 1.2), extra,
        )  # fmt: skip
        depth = radius * rng.uniform(0.06, 0.16)
        load = float(soil.forces(np.arccos(1.0 - np.array([depth]) / radius), np.array([0.3]), np.inf)[0, 0])
        heaviest = soil.channels(np.full(2, 1.6 * load), np.array([0.05, 0.6]))
        if np.all(heaviest[:, 2] < 0.45 * radius):
            return soil, load


def recording(
    rng: np.random.Generator, soil: Ground, load_N: float, *, steady: bool, pull: bool, share: float = 0.02
) -> Measured:
    """Steady trials or a drive, every channel with white noise of `share` of its largest value."""
    if steady:
        loads, slips = np.meshgrid(load_N * np.array([0.5, 0.8, 1.2, 1.6]), [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
        loads, slips = loads.ravel(), slips.ravel()
        order = slips
    else:
        order = np.arange(200) / 10.0
        loads = load_N * (1.0 + 0.5 * np.sin(0.6 * order))
        slips = 0.3 + 0.25 * np.sin(0.86 * order + 1.0)
    channels = soil.channels(loads, slips)
    noise = share * np.abs(channels).max(axis=0)
    measured = channels + noise * rng.normal(size=channels.shape)
    if not pull:
        measured[:, 4], noise = np.nan, np.where(np.arange(5) == 4, np.nan, noise)
    return Measured(measured, noise, order, timed=not steady)


@dataclass(frozen=True)
class Outcome:
    """One recording: was the form rejected; do the intervals hold (c, phi), and how wide are they, before and after."""

    rejected: bool
    misfit: float
    held_before: tuple[bool, bool]
    held_after: tuple[bool, bool]
    width_before: tuple[float, float]
    width_after: tuple[float, float]
    seconds: float


def one(seed: int, kind: str, *, steady: bool, pull: bool) -> Outcome:
    """Identify one recording as the textbook's form has it, and with its form in doubt."""
    rng = np.random.default_rng(seed)
    soil, load_N = ground(rng, kind)
    measured = usable(recording(rng, soil, load_N, steady=steady, pull=pull))
    began = time.perf_counter()
    solution = solve(measured, soil.wheel, SoilKnowledge())
    found = rejected(solution, WRONG_FORM)
    estimate = summarise(solution, measured, soil.wheel)
    seconds = time.perf_counter() - began
    truth = np.array([soil.c_Pa, np.degrees(soil.phi_rad)])
    c, phi = estimate.parameters["c_Pa"], estimate.parameters["phi_rad"]
    after = np.array([[c.low, c.high], np.degrees([phi.low, phi.high])])
    # Before: the scatter carried, the form taken as right.
    half = solution.quantile * np.sqrt(np.diag(solution.covariance())[:2])
    ends = np.maximum(solution.fit.vector[:2, None] + half[:, None] * [-1.0, 1.0], 0.0)
    before = np.array([ends[0], np.degrees(np.arctan(ends[1]))]) if found else after
    slack = np.array([1.0, 0.01])
    held = [(each[:, 0] - slack <= truth) & (truth <= each[:, 1] + slack) for each in (before, after)]
    width = [tuple(np.diff(each)[:, 0].tolist()) for each in (before, after)]
    held_before, held_after = (tuple(each.tolist()) for each in held)
    return Outcome(found, solution.misfit, held_before, held_after, width[0], width[1], seconds)


def row(kind: str, seeds: int, *, steady: bool, pull: bool) -> list[str]:
    """Give the cells of one row of the table."""
    outcomes = [one(seed, kind, steady=steady, pull=pull) for seed in range(seeds)]
    cells = [
        "trials" if steady else "drive", "W, T, z, i, DP" if pull else "W, T, z, i", kind.replace("+", " + "),
        f"{np.median([each.misfit for each in outcomes]):.1f}",
        f"{100 * np.mean([each.rejected for each in outcomes]):.0f}",
    ]  # fmt: skip
    for held, width in (("held_before", "width_before"), ("held_after", "width_after")):
        c, phi = 100 * np.mean([getattr(each, held) for each in outcomes], axis=0)
        wide = np.median([getattr(each, width) for each in outcomes], axis=0)
        cells.append(f"{c:.0f} / {phi:.0f}")
        cells.append(f"{wide[0] / 1e3:.2f} / {wide[1]:.1f}")
    cells.append(f"{np.median([each.seconds for each in outcomes]):.1f}")
    return cells


COLUMNS = (
    "recording", "channels", "left out", "misfit", "form rejected [%]", "before: holds c / phi [%]",
    "width c [kPa] / phi [deg]", "after: holds c / phi [%]", "width c [kPa] / phi [deg]", "s",
)  # fmt: skip


def main() -> None:
    """Print the table, and write it for the documentation where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--write", action="store_true", help="write docs/measured/identification-model-error.json")
    arguments = parser.parse_args()
    rows = []
    print(*COLUMNS, sep=" | ")
    for steady, pull in ((True, True), (False, True), (True, False)):
        for kind in KINDS:
            rows.append(row(kind, arguments.seeds, steady=steady, pull=pull))
            print(*rows[-1], sep=" | ", flush=True)
    if arguments.write:
        write(
            "identification-model-error", COLUMNS, rows, data=f"Simulated; {arguments.seeds} recordings a row",
            command=f"python tests/studies/identification_model_error.py --seeds {arguments.seeds} --write",
        )  # fmt: skip


if __name__ == "__main__":
    main()
