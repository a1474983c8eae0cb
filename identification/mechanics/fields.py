"""Fields that describe a contact of wheel and soil, and that effects change."""

from __future__ import annotations

import math

import numpy as np

FIELDS = (
    "theta_1", "theta_2", "theta_m", "advance_m", "c_Pa", "tan_phi", "k_m", "stiffness_Pa", "n", "radius_m",
    "shear_radius_m", "lever_m", "lift_N", "residual", "adhesion_Pa", "tan_delta", "layer_depth_m",
    "layer_stiffness_Pa", "most_normal_Pa", "hump", "decay", "rim_cuts_off",
)  # fmt: skip
"""Columns of a contact: entry, exit and peak angle [rad], V / omega [m], c [Pa], tan phi, Janosi k [m], stiffness
k1 + k2 b [Pa], n, radius of the contact, radius at which soil shears and lever arm of the shear stress [m], load not
carried by the stresses on the rim [N], residual share of the shear strength after its peak (infinite for Janosi's law,
which has no peak), adhesion [Pa] and friction of the rim (infinite if soil never slips on it), depth [m] and stiffness
[Pa] of a layer beneath, the largest normal stress that the wheel transmits [Pa] (infinite for a rigid one), h of
Kacigin & Guskov's law (infinite for other laws) [-], m of Bekker's (likewise) [-], and 1 if the rim limits the shear
stress instead of the shear strength."""

COLUMN = {name: index for index, name in enumerate(FIELDS)}

(
    THETA_1, THETA_2, THETA_M, ADVANCE, COHESION, TAN_PHI, MODULUS, STIFFNESS, EXPONENT, RADIUS, SHEAR_RADIUS, LEVER,
    LIFT, RESIDUAL, ADHESION, TAN_DELTA, LAYER_DEPTH, LAYER_STIFFNESS, MOST_NORMAL, HUMP, DECAY, CUTS_OFF,
) = range(len(FIELDS))  # fmt: skip

SLOPED = CUTS_OFF
"""Number of fields by which forces have derivatives: all but the last, which is a switch."""

TEXTBOOK = np.zeros(len(FIELDS))
TEXTBOOK[[RESIDUAL, TAN_DELTA, LAYER_DEPTH, MOST_NORMAL, HUMP, DECAY]] = math.inf
"""A row (f,) with the textbook wheel's values of all fields but geometry and soil."""

LOCKED = 1e-9
"""Least r omega / V of a braked wheel [-]: a locked one would have zero."""


def speed_ratio(slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """V / (r omega) and its derivative by slip, (n,) each: 1 - i driving, 1 / (1 + i) braking."""
    slip = np.asarray(slip, dtype=float)
    turning = np.maximum(1.0 + slip, LOCKED)
    return np.where(slip >= 0.0, 1.0 - slip, 1.0 / turning), np.where(slip >= 0.0, -1.0, -1.0 / turning**2)
