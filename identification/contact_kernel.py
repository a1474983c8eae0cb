"""Compiled quadrature along the rim for a contact whose every row may have its own geometry, soil and shear law.

The textbook wheel has its own kernel with analytic derivatives (`stress_kernel`); this one carries the fields through
which the effects of `effects` enter. The quadrature is the same.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .stress_kernel import quadrature

NODES, WEIGHTS = quadrature(8)
"""Eight nodes in each zone: about five digits, far below any sensor's noise."""

FIELDS = (
    "theta_1", "theta_2", "theta_m", "advance_m", "c_Pa", "tan_phi", "k_m", "stiffness_Pa", "n", "radius_m",
    "shear_radius_m", "lever_m", "residual", "adhesion_Pa", "tan_delta", "layer_depth_m", "layer_stiffness_Pa",
    "most_normal_Pa", "rim_cuts_off", "lift_N",
)  # fmt: skip
"""Columns of a contact: the three angles [rad], V / omega [m], c [Pa], tan phi, Janosi k [m], stiffness [Pa], n, radius
of the contact, radius at which soil shears and lever arm of the shear stress [m], share of the shear strength left
after its peak (infinite for Janosi's law, which has no peak), adhesion [Pa] and friction of the rim (infinite where
soil never slips on it), depth [m] and stiffness [Pa] of a layer beneath, the largest normal stress that the wheel
transmits [Pa] (infinite for a rigid one), one where the rim cuts the soil's shear stress off instead of its
strength, and what carries load besides the stresses on the rim [N]."""

COLUMN = {name: index for index, name in enumerate(FIELDS)}

_TEXTBOOK = {"residual": math.inf, "tan_delta": math.inf, "layer_depth_m": math.inf, "most_normal_Pa": math.inf}
"""What is not zero where the textbook wheel has no such thing."""

SOIL_FIELDS = 5
"""The fields from `c_Pa` to `n`, by which `rim_forces_and_slopes` gives derivatives."""


def fields(**values: float) -> np.ndarray:
    """Row (f,) of a contact with fields by name, the others as the textbook wheel has them."""
    row = np.zeros(len(FIELDS))
    for name, value in (_TEXTBOOK | values).items():
        row[COLUMN[name]] = value
    return row


@njit(cache=True, nogil=True, error_model="numpy")
def rim_forces(contact, width, nodes, weights, wanted, forces):
    """Integrate the stresses of each row of `contact` (n, f) into `forces` (n, 3): W [N], T [N m], DP [N].

    Rows that are not `wanted` (n,) keep the forces that they have.
    """
    no_slopes, scratch = np.empty((3, 0)), np.empty((2, SOIL_FIELDS))
    for row in range(contact.shape[0]):
        if wanted[row]:
            _one_rim(contact[row], width, nodes, weights, scratch, forces[row], no_slopes)


@njit(cache=True, nogil=True, error_model="numpy")
def rim_forces_and_slopes(contact, width, nodes, weights, forces, slopes):
    """As `rim_forces`, and `slopes` (n, 3, 5): derivatives of W, T, DP by c, tan phi, k, stiffness and n."""
    scratch = np.empty((2, SOIL_FIELDS))
    for row in range(contact.shape[0]):
        _one_rim(contact[row], width, nodes, weights, scratch, forces[row], slopes[row])


@njit(cache=True, nogil=True, error_model="numpy")
def _one_rim(field, width, nodes, weights, scratch, forces, slopes):
    theta_1, theta_2, theta_m, advance = field[0], field[1], field[2], field[3]
    radius, shear_radius = field[9], field[10]
    sin_1, cos_1 = math.sin(theta_1), math.cos(theta_1)
    forces[:] = 0.0
    slopes[:, :] = 0.0
    normal_slopes, shear_slopes = scratch
    # Where the pressure has a kink the rule is applied on either side of it.
    layer_at = _share_of_front(field[15], radius, cos_1, theta_1, theta_m)
    flat_at = _share_of_front(_flat_from(field, width), radius, cos_1, theta_1, theta_m)
    ends = (0.0, min(layer_at, flat_at), max(layer_at, flat_at), 1.0)
    for piece in range(3):
        reach = ends[piece + 1] - ends[piece]
        for node in range(nodes.size if reach > 0.0 else 0):
            along, share_of_rule = ends[piece] + reach * nodes[node], reach * weights[node]
            ahead = theta_1 + (theta_m - theta_1) * along
            sin_ahead, cos_ahead = math.sin(ahead), math.cos(ahead)
            depth = max(radius * (cos_ahead - cos_1), 1e-300)
            relative = math.log(depth / width)
            share = math.exp(field[8] * relative)
            normal = field[7] * share
            below = depth - field[15]
            layer = 0.0
            if below > 0.0:
                layer = field[16] * (below / width) ** field[8]
                normal += layer
            flat = normal > field[17]
            if flat:
                normal = field[17]
            normal_slopes[:] = 0.0
            if slopes.shape[1] > 0 and not flat:
                normal_slopes[3] = share
                normal_slopes[4] = field[7] * share * relative
                if below > 0.0:
                    normal_slopes[4] += layer * math.log(below / width)
            # By Eq. 9 both zones have the same normal stress at the same node: that of the front.
            for zone in range(2):
                theta, sine, cosine = ahead, sin_ahead, cos_ahead
                weight = share_of_rule * abs(theta_m - theta_1)
                if zone == 1:
                    theta = theta_2 + (theta_m - theta_2) * along
                    sine, cosine = math.sin(theta), math.cos(theta)
                    weight = share_of_rule * abs(theta_m - theta_2)
                friction, strength = field[5], field[4] + normal * field[5]
                displacement = shear_radius * (theta_1 - theta) - advance * (sin_1 - sine)
                mobilised, slope = _mobilised(displacement, field[6], field[12])
                capped = False
                if field[14] < math.inf:
                    rim, cuts_off = field[13] + normal * field[14], field[18] > 0.5
                    capped = rim < (strength * abs(mobilised) if cuts_off else strength)
                    if capped:
                        friction, strength = field[14], rim
                        if cuts_off:
                            mobilised, slope = math.copysign(1.0, mobilised), 0.0
                shear = strength * mobilised
                forces[0] += weight * (radius * normal * cosine + shear_radius * shear * sine)
                forces[1] += weight * shear
                forces[2] += weight * (shear_radius * shear * cosine - radius * normal * sine)
                if slopes.shape[1] == 0:
                    continue
                for m in range(SOIL_FIELDS):
                    shear_slopes[m] = mobilised * friction * normal_slopes[m]
                if not capped:
                    shear_slopes[0] += mobilised
                    shear_slopes[1] += mobilised * normal
                shear_slopes[2] += strength * slope
                for m in range(SOIL_FIELDS):
                    slopes[0, m] += weight * (
                        radius * normal_slopes[m] * cosine + shear_radius * shear_slopes[m] * sine
                    )
                    slopes[1, m] += weight * shear_slopes[m]
                    slopes[2, m] += weight * (
                        shear_radius * shear_slopes[m] * cosine - radius * normal_slopes[m] * sine
                    )
    lever = shear_radius * field[11]
    forces[0] = forces[0] * width + field[19]
    forces[1] *= width * lever
    forces[2] *= width
    for m in range(slopes.shape[1]):
        slopes[0, m] *= width
        slopes[1, m] *= width * lever
        slopes[2, m] *= width


@njit(cache=True, nogil=True, error_model="numpy")
def _share_of_front(depth, radius, cos_1, theta_1, theta_m):
    """Share of the front zone, from its edge, at which the rim is so deep; 1 where it never is."""
    cosine = cos_1 + depth / radius
    if not cosine < 1.0:
        return 1.0
    return min(max((theta_1 - math.acos(cosine)) / (theta_1 - theta_m), 0.0), 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _flat_from(field, width):
    """Depth [m] from which on the wheel transmits no more pressure, infinite where it always does; layers apart."""
    if not field[17] < math.inf:
        return math.inf
    return width * (field[17] / field[7]) ** (1.0 / field[8])


@njit(cache=True, nogil=True, error_model="numpy")
def _mobilised(displacement, modulus, residual):
    """Mobilised share of the shear strength, odd in the displacement [m], and its derivative by the modulus [1/m].

    Janosi & Hanamoto (1961) where `residual` is infinite, else J. Y. Wong, J. Preston-Thomas, J. Terramechanics 19
    (1983): a peak at the displacement `modulus`, then a fall to the residual share.
    """
    along = abs(displacement) / modulus
    decay = math.exp(-along)
    share, slope = 1.0 - decay, decay
    if residual < math.inf:
        excess = (1.0 / (1.0 - math.exp(-1.0)) - residual) * math.e * decay
        slope = decay * (residual + excess) - share * excess
        share *= residual + excess
    sense = math.copysign(1.0, displacement)
    return sense * share, -sense * slope * along / modulus
