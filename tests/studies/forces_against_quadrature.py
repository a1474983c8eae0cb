"""`rim_forces` and `equilibrium` against other quadratures over the 60,000 simulations of the paper's Sec. 3.1.

1. All points: against tanh-sinh quadrature (H. Takahasi, M. Mori, Publ. RIMS 9 (1974), Eq. 2.3) of Eq. 2-5, 8 and 9,
   written here. Torque and pull are relative to W r and W, for pull passes through zero.
   The entry angle is found from the load that the reference gives, and compared with the one that gave it.
2. A stratified subset: the reference itself against `scipy.integrate.quad`, and the entry angle against
   `scipy.optimize.brentq` on that; as many points as the seconds allow.

    python tests/studies/forces_against_quadrature.py --seconds 120
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.mechanics.equilibrium import carry
from bevameter.identification.mechanics.fields import THETA_1
from bevameter.identification.mechanics.stresses import rim_forces
from bevameter.identification.mechanics.textbook import USUAL_ENTRY_ANGLE, contact_array
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import qmc

WHEEL = Wheel(radius_m=0.25, width_m=0.2)
SIMULATIONS = 60_000
_STEP, _NODES_EACH_WAY = 0.09, 36


def space(count: int, seed: int = 0) -> np.ndarray:
    """Simulations (count, 7) drawn from the paper's ranges, stratified (Latin hypercube).

    Columns: theta_1 [rad], slip, c [Pa], tan phi, k [m], stiffness [Pa], n.
    """
    unit = qmc.LatinHypercube(d=8, rng=np.random.default_rng(seed)).random(count)
    low = [np.radians(20.0), 0.6, np.radians(20.0), 0.0, 0.0, 520e3, 0.005, 0.0]
    high = [np.radians(60.0), 1.2, np.radians(40.0), 3e3, 140e3, 680e3, 0.04, 1.0]
    theta_1, n, phi, c, k1, k2, k, slip = qmc.scale(unit, low, high).T
    stiffness = k1 + k2 * WHEEL.width_m
    return np.column_stack([theta_1, slip, c, np.tan(phi), k, stiffness, n])


def forces_of(simulations: np.ndarray) -> np.ndarray:
    """W, T, DP (m, 3) as the product has them."""
    return rim_forces(contact_array(simulations[:, 0], simulations[:, 1], simulations[:, 2:].T, WHEEL), WHEEL.width_m)


def reference(simulations: np.ndarray) -> np.ndarray:
    """W, T, DP (m, 3) by tanh-sinh quadrature on both zones; exact at the ends, where stress rises like a power."""
    t = _STEP * np.arange(-_NODES_EACH_WAY, _NODES_EACH_WAY + 1)
    # Distances of the nodes from both ends of [0, 1], neither by subtraction from 1.
    near = 1.0 / (1.0 + np.exp(np.pi * np.sinh(t)))
    weight = _STEP * np.pi * np.cosh(t) * near * near[::-1]
    theta_1, slip, c, tan_phi, k, stiffness, n = (column[:, None] for column in simulations.T)
    theta_m = theta_1 / 2.0
    radius, width = WHEEL.radius_m, WHEEL.width_m
    load, torque, pull = np.zeros((3, len(simulations)))
    for front in (True, False):
        length = theta_1 - theta_m if front else theta_m
        # `away` is the distance from theta_1 in the front zone, to which Eq. 9 maps the rear zone.
        theta = theta_m + length * near[::-1] if front else length * near
        away = (theta_1 - theta_m) * near
        depth = 2.0 * np.sin(0.5 * away) * np.sin(theta_1 - 0.5 * away)
        sigma = stiffness * (radius / width * depth) ** n
        moved = theta_1 - theta - (1.0 - slip) * 2.0 * np.cos(0.5 * (theta_1 + theta)) * np.sin(0.5 * (theta_1 - theta))
        tau = (c + sigma * tan_phi) * -np.expm1(-radius / k * moved)
        load += (length * (sigma * np.cos(theta) + tau * np.sin(theta))) @ weight
        torque += (length * tau) @ weight
        pull += (length * (tau * np.cos(theta) - sigma * np.sin(theta))) @ weight
    area = radius * width
    return np.column_stack([area * load, area * radius * torque, area * pull])


def by_quad(simulation: np.ndarray) -> np.ndarray:
    """W, T, DP (3,) of one simulation (7,) by adaptive quadrature of the equations as they stand in the paper."""
    theta_1, slip, c, tan_phi, k, stiffness, n = simulation
    theta_m, radius, width = theta_1 / 2.0, WHEEL.radius_m, WHEEL.width_m

    def stresses(theta: float) -> tuple[float, float]:
        ahead = theta if theta > theta_m else theta_1 - theta / theta_m * (theta_1 - theta_m)
        sigma = stiffness * (radius / width * max(np.cos(ahead) - np.cos(theta_1), 0.0)) ** n
        moved = theta_1 - theta - (1.0 - slip) * (np.sin(theta_1) - np.sin(theta))
        return sigma, (c + sigma * tan_phi) * (1.0 - np.exp(-radius / k * moved))

    def integrals(weigh) -> float:
        zones = ((0.0, theta_m), (theta_m, theta_1))
        parts = [
            quad(lambda at: weigh(at, *stresses(at)), *zone, epsabs=0.0, epsrel=1e-11, limit=400) for zone in zones
        ]
        return radius * width * sum(part[0] for part in parts)

    return np.array(
        [
            integrals(lambda at, sigma, tau: sigma * np.cos(at) + tau * np.sin(at)),
            radius * integrals(lambda at, sigma, tau: tau),
            integrals(lambda at, sigma, tau: tau * np.cos(at) - sigma * np.sin(at)),
        ]
    )


def relative(forces: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference of W, T, DP (m, 3), relative to W, W r and W."""
    scale = expected[:, :1] * [1.0, WHEEL.radius_m, 1.0]
    return float(np.max(np.abs(forces - expected) / scale))


def found_again(simulations: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Entry angles (m,) that the equilibrium gives for loads (m,)."""
    start = contact_array(USUAL_ENTRY_ANGLE, simulations[:, 1], simulations[:, 2:].T, WHEEL)
    return carry(start, load, WHEEL.width_m).contact[:, THETA_1]


def over_all(count: int = SIMULATIONS, chunk: int = 4000) -> dict[str, float]:
    """Largest relative difference of forces and of entry angle over the whole space, and seconds of each."""
    simulations = space(count)
    began = time.perf_counter()
    expected = np.concatenate([reference(simulations[at : at + chunk]) for at in range(0, count, chunk)])
    between = time.perf_counter()
    forces = forces_of(simulations)
    angle = found_again(simulations, expected[:, 0])
    return {
        "forces": relative(forces, expected),
        "entry angle": float(np.max(np.abs(angle / simulations[:, 0] - 1.0))),
        "reference [s]": between - began,
        "bevameter [s]": time.perf_counter() - between,
    }


def on_subset(seconds: float, *, most: int = SIMULATIONS, seed: int = 1) -> dict[str, float]:
    """Compare with quad and brentq on as many stratified points as the seconds allow."""
    simulations = space(most, seed)
    began, count = time.perf_counter(), 0
    against_quad, ours, angles = 0.0, 0.0, 0.0
    for row in simulations:
        expected = by_quad(row)[None]
        against_quad = max(against_quad, relative(reference(row[None]), expected))
        ours = max(ours, relative(forces_of(row[None]), expected))
        load = 0.7 * float(expected[0, 0])

        def missing(theta_1: float, at: np.ndarray = row, target: float = load) -> float:
            moved = at.copy()
            moved[0] = theta_1
            return float(by_quad(moved)[0]) - target

        root = brentq(missing, 0.05, row[0], xtol=1e-13, rtol=1e-13)
        angles = max(angles, abs(float(found_again(row[None], np.array([load]))[0]) / root - 1.0))
        count += 1
        if time.perf_counter() - began > seconds:
            break
    return {
        "points": count,
        "reference against quad": against_quad,
        "forces against quad": ours,
        "entry angle against brentq": angles,
        "s a point": (time.perf_counter() - began) / count,
    }


def main() -> None:
    """Print both comparisons."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=120.0)
    arguments = parser.parse_args()
    for title, figures in (("all points", over_all()), ("subset", on_subset(arguments.seconds))):
        print(title, {name: float(f"{value:.3g}") for name, value in figures.items()})


if __name__ == "__main__":
    main()
