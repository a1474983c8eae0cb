"""Forces of a contact by adaptive quadrature of the equations as they are printed, whatever effects change."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.mechanics.fields import COLUMN
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import contact_array
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
SOIL = Soil(c_Pa=500.0, phi_rad=math.radians(32.0), k_m=0.012, stiffness_Pa=2e5, n=0.9)
LAWS: dict[str, dict[str, float]] = {
    "textbook": {},
    "hump": {"residual": 0.6},
    "sech": {"hump": 1.4},
    "decay": {"decay": 0.2},
    "slips on the rim": {"adhesion_Pa": 300.0, "tan_delta": 0.3},
    "cut off at the rim": {"adhesion_Pa": 300.0, "tan_delta": 0.3, "rim_cuts_off": 1.0},
    "layer": {"layer_depth_m": 0.005, "layer_stiffness_Pa": 5e5},
    "flat": {"most_normal_Pa": 2e4},
    "flat on a layer": {"most_normal_Pa": 3e4, "layer_depth_m": 0.005, "layer_stiffness_Pa": 5e5},
}


def contacts(theta_1: np.ndarray, slip: np.ndarray, **fields: float | np.ndarray) -> np.ndarray:
    """Textbook contacts with some fields changed."""
    answer = contact_array(theta_1, slip, SOIL, WHEEL)
    for name, value in fields.items():
        answer[:, COLUMN[name]] = value
    return answer


def scaled(forces: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Forces relative to W, W r and W of others."""
    return forces / (by[:, [0]] * np.array([1.0, WHEEL.radius_m, 1.0]))


def _kacigin(along: float, hump: float) -> float:
    return (1.0 + hump / math.cosh(min(along, 300.0))) * math.tanh(along)


@cache
def _peak(law: Callable[[float, float], float], shape: float) -> float:
    within = {"bounds": (0.0, 8.0), "method": "bounded", "options": {"xatol": 1e-9}}
    return -minimize_scalar(lambda at: -law(at, shape), **within).fun


def _bekker(along: float, decay: float) -> float:
    return math.exp(-decay * along) - math.exp(-along)


def mobilised(along: float, f: dict[str, float]) -> float:
    """Mobilised share after Janosi, Wong & Preston-Thomas, Kacigin & Guskov, and Bekker, as they print them."""
    if math.isfinite(f["hump"]):
        return _kacigin(along, f["hump"]) / _peak(_kacigin, f["hump"])
    if math.isfinite(f["decay"]):
        return _bekker(along, f["decay"]) / _peak(_bekker, f["decay"])
    share = 1.0 - math.exp(-along)
    if math.isinf(f["residual"]):
        return share
    hump = (1.0 / (f["residual"] * (1.0 - math.exp(-1.0))) - 1.0) * math.exp(1.0 - along)
    return f["residual"] * (1.0 + hump) * share


def by_quad(contact: np.ndarray) -> np.ndarray:
    """W, T, DP (3,) of one contact (f,) by adaptive quadrature of the equations as they are printed."""
    f = {name: float(contact[index]) for name, index in COLUMN.items()}

    def sigma(theta: float) -> float:
        front = f["theta_1"] - f["theta_m"]
        ahead = theta if theta > f["theta_m"] else (
            f["theta_1"] - (theta - f["theta_2"]) / (f["theta_m"] - f["theta_2"]) * front
        )  # fmt: skip
        depth = max(f["radius_m"] * (math.cos(ahead) - math.cos(f["theta_1"])), 0.0)
        pressure = f["stiffness_Pa"] * (depth / WHEEL.width_m) ** f["n"]
        if depth > f["layer_depth_m"]:
            pressure += f["layer_stiffness_Pa"] * ((depth - f["layer_depth_m"]) / WHEEL.width_m) ** f["n"]
        return min(pressure, f["most_normal_Pa"])

    def tau(theta: float) -> float:
        slid = f["shear_radius_m"] * (f["theta_1"] - theta) - f["advance_m"] * (
            math.sin(f["theta_1"]) - math.sin(theta)
        )
        normal = sigma(theta)
        soil, share = f["c_Pa"] + normal * f["tan_phi"], mobilised(abs(slid) / f["k_m"], f)
        rim = f["adhesion_Pa"] + normal * f["tan_delta"] if math.isfinite(f["tan_delta"]) else math.inf
        return math.copysign(min(soil * share, rim) if f["rim_cuts_off"] else min(soil, rim) * share, slid)

    def integral(function) -> float:
        pieces = np.concatenate([
            np.linspace(f["theta_2"], f["theta_m"], 21), np.linspace(f["theta_m"], f["theta_1"], 21)[1:]
        ])  # fmt: skip
        return sum(quad(function, low, high, epsabs=0.0, epsrel=1e-11, limit=400)[0] for low, high in pairwise(pieces))

    return np.array([
        WHEEL.width_m * integral(
            lambda t: f["radius_m"] * sigma(t) * math.cos(t) + f["shear_radius_m"] * tau(t) * math.sin(t)
        ) + f["lift_N"],
        WHEEL.width_m * f["shear_radius_m"] * f["lever_m"] * integral(tau),
        WHEEL.width_m * integral(
            lambda t: f["shear_radius_m"] * tau(t) * math.cos(t) - f["radius_m"] * sigma(t) * math.sin(t)
        ),
    ])  # fmt: skip
