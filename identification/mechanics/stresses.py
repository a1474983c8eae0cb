"""Quadrature of the stresses along the rim, with its derivatives, for all wheel models.

Stresses are those of K. Iagnemma, S. Dubowsky, "Terrain estimation for high-speed rough-terrain autonomous vehicle
navigation" (2002), Eq. 2-9. A contact is a row of numbers (`fields.FIELDS`), which effects change.

The rim is divided at the angle of the stress peak theta_m. In the front zone theta = theta_1 - (theta_1 - theta_m) u;
in the rear zone theta = theta_2 + (theta_m - theta_2) u, u in [0, 1]: by Eq. 9 both zones then have the same normal
stress at the same u. Stress rises from the free ends like u^n, n not an integer, which slows the convergence of
Gauss-Legendre quadrature; with u = s^2 or s^3 the integrand is smoother in s. Both zones are also divided at kinks of
the stresses.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .fields import (
    ADHESION,
    ADVANCE,
    COHESION,
    CUTS_OFF,
    DECAY,
    EXPONENT,
    HUMP,
    LAYER_DEPTH,
    LAYER_STIFFNESS,
    LEVER,
    LIFT,
    MODULUS,
    MOST_NORMAL,
    RADIUS,
    RESIDUAL,
    SHEAR_RADIUS,
    SLOPED,
    STIFFNESS,
    TAN_DELTA,
    TAN_PHI,
    THETA_1,
    THETA_2,
    THETA_M,
)  # fmt: skip
from .kinks import EDGES, cut, has_peak, top_of, with_peak

Rule = tuple[np.ndarray, np.ndarray]
"""Nodes u and weights on [0, 1] of a quadrature, (m,) each."""


def quadrature(count: int, clustering: int) -> Rule:
    """Gauss-Legendre quadrature in s with u = s^clustering."""
    s, w = np.polynomial.legendre.leggauss(count)
    s, w = (s + 1.0) / 2.0, w / 2.0
    return s**clustering, w * clustering * s ** (clustering - 1)


# Largest errors over the soils, slips and sinkages of Iagnemma & Dubowsky (2002), Sec. 3.1, relative to W, W r and W.
FINE = quadrature(14, 3)
"""Relative error 3e-10."""

QUICK = quadrature(8, 2)
"""Relative error 9e-7: for estimation, far below any sensor's noise."""

COARSE = quadrature(4, 2)
"""Relative error 4e-4: for the search for the entry angle."""


def rim_forces(contact: np.ndarray, width_m: float, rule: Rule = FINE) -> np.ndarray:
    """Load W [N], torque T [N m] and drawbar pull DP [N] of each contact (n, f), Eq. 2-4: (n, 3)."""
    return rim_forces_and_slopes(contact, width_m, rule, sloped=False)[0]


def rim_forces_and_slopes(
    contact: np.ndarray, width_m: float, rule: Rule = FINE, *, sloped: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """As `rim_forces`, with the derivatives (n, 3, 21) by all fields but the last; by none if not `sloped`."""
    rows = len(contact)
    forces, slopes = np.empty((rows, 3)), np.empty((rows, 3, SLOPED if sloped else 0))
    integrate(np.asfortranarray(contact), width_m, *rule, np.ones(rows, dtype=bool), forces, slopes)
    return forces, slopes


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(contact, width, nodes, weights, wanted, forces, slopes):
    """Integrate the stresses of each row of `contact` (n, f) into `forces` (n, 3) and `slopes` (n, 3, 21 or 0).

    Rows that are not `wanted` (n,) are left unchanged.
    """
    field, scratch = np.empty(contact.shape[1]), np.empty((4, EDGES))
    for row in range(contact.shape[0]):
        if wanted[row]:
            for f in range(field.size):
                field[f] = contact[row, f]
            one_rim(field, width, nodes, weights, scratch, forces[row], slopes[row])


@njit(cache=True, nogil=True, error_model="numpy")
def forces_near(there, here, forces, slopes, near, beyond):
    """Linearise the forces (n, 3) of contacts `there` (n, f) about those `here`, by the slopes, into `near` (n, 3).

    Marks rows in `beyond` (n,) that have to be integrated instead.
    """
    near[:] = forces
    for row in range(there.shape[0]):
        beyond[row] = there[row, CUTS_OFF] != here[row, CUTS_OFF]
    for f in range(SLOPED):
        for row in range(there.shape[0]):
            if there[row, f] != here[row, f]:
                change = there[row, f] - here[row, f]
                beyond[row] |= math.isinf(change)
                for force in range(3):
                    near[row, force] += slopes[row, force, f] * change


@njit(cache=True, nogil=True, error_model="numpy")
def one_rim(field, width, nodes, weights, scratch, forces, slopes):
    """Integrate one contact (f,); `scratch` (4, `EDGES`) is work space."""
    theta_1, theta_2, theta_m, advance = field[THETA_1], field[THETA_2], field[THETA_M], field[ADVANCE]
    cohesion, tan_phi, modulus, exponent = field[COHESION], field[TAN_PHI], field[MODULUS], field[EXPONENT]
    radius, shear_radius = field[RADIUS], field[SHEAR_RADIUS]
    layered, capped_by_rim = field[LAYER_DEPTH] < math.inf, field[TAN_DELTA] < math.inf
    cuts_off, peaked = field[CUTS_OFF] > 0.5, has_peak(field)
    sin_1, cos_1 = math.sin(theta_1), math.cos(theta_1)
    scale = field[STIFFNESS] * (radius / width) ** exponent
    top, by_top = top_of(field[HUMP], field[DECAY])
    sloped = slopes.shape[1] > 0
    forces[:] = 0.0
    slopes[:, :] = 0.0
    # Derivatives of the three forces by the normal and the shear stress of a node, and by its displacement.
    edges, by_normal, by_shear, by_moved = scratch[0], scratch[1], scratch[2], scratch[3]
    pieces = cut(field, width, sin_1, cos_1, top, edges)
    for piece in range(pieces):
        begin, reach = edges[piece], edges[piece + 1] - edges[piece]
        for node in range(nodes.size if reach > 0.0 else 0):
            along, share_of_rule = begin + reach * nodes[node], reach * weights[node]
            ahead = theta_1 + (theta_m - theta_1) * along
            sin_ahead, cos_ahead = math.sin(ahead), math.cos(ahead)
            rise = max(cos_ahead - cos_1, 1e-300)
            log_rise = math.log(rise)
            normal = scale * math.exp(exponent * log_rise)
            upper, layer, below = normal, 0.0, 0.0
            if layered:
                below = radius * rise - field[LAYER_DEPTH]
                if below > 0.0:
                    layer = field[LAYER_STIFFNESS] * (below / width) ** exponent
                    normal += layer
            flat = normal > field[MOST_NORMAL]
            if flat:
                normal = field[MOST_NORMAL]
            if sloped:
                by_normal[:] = 0.0
            # By Eq. 9 both zones have the same normal stress at the same node: that of the front.
            for zone in range(2):
                theta, sine, cosine, end = ahead, sin_ahead, cos_ahead, theta_1
                if zone == 1:
                    theta, end = theta_2 + (theta_m - theta_2) * along, theta_2
                    sine, cosine = math.sin(theta), math.cos(theta)
                weight = share_of_rule * abs(theta_m - end)
                friction, strength = tan_phi, cohesion + normal * tan_phi
                displacement = shear_radius * (theta_1 - theta) - advance * (sin_1 - sine)
                by_residual, by_h, by_m = 0.0, 0.0, 0.0
                if peaked:
                    mobilised, slope, by_residual, by_h, by_m = with_peak(
                        displacement, modulus, field[RESIDUAL], field[HUMP], field[DECAY], top, by_top
                    )
                else:
                    decay = math.exp(-abs(displacement) / modulus)
                    mobilised, slope = math.copysign(1.0 - decay, displacement), decay / modulus
                capped = False
                if capped_by_rim:
                    rim = field[ADHESION] + normal * field[TAN_DELTA]
                    capped = rim < (strength * abs(mobilised) if cuts_off else strength)
                    if capped:
                        friction, strength = field[TAN_DELTA], rim
                        if cuts_off:
                            mobilised, slope = math.copysign(1.0, mobilised), 0.0
                            by_residual, by_h, by_m = 0.0, 0.0, 0.0
                shear = strength * mobilised
                up = radius * normal * cosine + shear_radius * shear * sine
                on = shear_radius * shear * cosine - radius * normal * sine
                forces[0] += weight * up
                forces[1] += weight * shear
                forces[2] += weight * on
                if not sloped:
                    continue
                by_shear[0], by_shear[1] = weight * shear_radius * sine, weight
                by_shear[2] = weight * shear_radius * cosine
                by_normal[0] += weight * radius * cosine
                by_normal[2] -= weight * radius * sine
                widened = math.copysign(share_of_rule, theta_m - end)
                back, strengthened = advance * cosine - shear_radius, strength * slope
                for force in range(3):
                    by_normal[force] += by_shear[force] * mobilised * friction
                    by_moved[force] = by_shear[force] * strengthened
                    # The node moves with the angles, and the length of the zone changes.
                    here = up if force == 0 else (shear if force == 1 else on)
                    turned = weight * on if force == 0 else (0.0 if force == 1 else -weight * up)
                    turned += by_moved[force] * back
                    slopes[force, THETA_M] += widened * here + along * turned
                    slopes[force, THETA_1 if zone == 0 else THETA_2] += (1.0 - along) * turned - widened * here
                    slopes[force, THETA_1] += by_moved[force] * (shear_radius - advance * cos_1)
                    slopes[force, ADVANCE] += by_moved[force] * (sine - sin_1)
                    slopes[force, SHEAR_RADIUS] += by_moved[force] * (theta_1 - theta)
                    slopes[force, MODULUS] -= by_moved[force] * displacement / modulus
                    by_strength = by_shear[force] * mobilised
                    if capped:
                        slopes[force, ADHESION] += by_strength
                        slopes[force, TAN_DELTA] += by_strength * normal
                    else:
                        slopes[force, COHESION] += by_strength
                        slopes[force, TAN_PHI] += by_strength * normal
                    if peaked:
                        slopes[force, RESIDUAL] += by_shear[force] * strength * by_residual
                        slopes[force, HUMP] += by_shear[force] * strength * by_h
                        slopes[force, DECAY] += by_shear[force] * strength * by_m
                slopes[0, RADIUS] += weight * normal * cosine
                slopes[2, RADIUS] -= weight * normal * sine
                slopes[0, SHEAR_RADIUS] += weight * shear * sine
                slopes[2, SHEAR_RADIUS] += weight * shear * cosine
            if not sloped:
                continue
            if flat:
                for force in range(3):
                    slopes[force, MOST_NORMAL] += by_normal[force]
                continue
            depth = radius * rise
            deeper = exponent * upper / depth
            powered = upper * (math.log(radius / width) + log_rise)
            if layer > 0.0:
                deeper += exponent * layer / below
                powered += layer * math.log(below / width)
            for force in range(3):
                change = by_normal[force]
                slopes[force, STIFFNESS] += change * upper / field[STIFFNESS]
                slopes[force, EXPONENT] += change * powered
                change *= deeper
                slopes[force, THETA_1] += change * radius * (sin_1 - sin_ahead * (1.0 - along))
                slopes[force, THETA_M] -= change * radius * sin_ahead * along
                slopes[force, RADIUS] += change * rise
                if layer > 0.0:
                    slopes[force, LAYER_DEPTH] -= by_normal[force] * exponent * layer / below
                    slopes[force, LAYER_STIFFNESS] += by_normal[force] * layer / field[LAYER_STIFFNESS]
    lever = shear_radius * field[LEVER]
    if sloped:
        slopes[1, SHEAR_RADIUS] += forces[1] / shear_radius
        slopes[1, LEVER] = forces[1] / field[LEVER]
        for f in range(SLOPED):
            slopes[0, f] *= width
            slopes[1, f] *= width * lever
            slopes[2, f] *= width
        slopes[0, LIFT] = 1.0
    forces[0] = forces[0] * width + field[LIFT]
    forces[1] *= width * lever
    forces[2] *= width
