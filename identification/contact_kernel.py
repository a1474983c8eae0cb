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
    "shear_radius_m", "lever_m", "lift_N", "residual", "adhesion_Pa", "tan_delta", "layer_depth_m",
    "layer_stiffness_Pa", "most_normal_Pa", "rim_cuts_off", "hump",
)  # fmt: skip
"""Columns of a contact: the three angles [rad], V / omega [m], c [Pa], tan phi, Janosi k [m], stiffness [Pa], n, radius
of the contact, radius at which soil shears and lever arm of the shear stress [m], what carries load besides the
stresses on the rim [N], share of the shear strength left after its peak (infinite for Janosi's law, which has no
peak), adhesion [Pa] and friction of the rim (infinite where soil never slips on it), depth [m] and stiffness [Pa] of a
layer beneath, the largest normal stress that the wheel transmits [Pa] (infinite for a rigid one), one where the rim
cuts the soil's shear stress off instead of its strength, and h of Kacigin & Guskov's law (infinite where it is not
theirs) [-]."""

COLUMN = {name: index for index, name in enumerate(FIELDS)}

_TEXTBOOK = {"residual": math.inf, "tan_delta": math.inf, "layer_depth_m": math.inf, "most_normal_Pa": math.inf,
             "hump": math.inf}  # fmt: skip
"""What is not zero where the textbook wheel has no such thing."""

_LEVEL = 40.0
"""Displacement by which nothing is left of a hump, in moduli [-]."""

SLOPED = 13
"""The fields from `theta_1` to `lift_N`, by which `rim_forces_and_slopes` gives derivatives."""


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
    no_slopes, scratch = np.empty((3, 0)), np.empty((5, SLOPED))
    for row in range(contact.shape[0]):
        if wanted[row]:
            _one_rim(contact[row], width, nodes, weights, scratch, forces[row], no_slopes)


@njit(cache=True, nogil=True, error_model="numpy")
def rim_forces_and_slopes(contact, width, nodes, weights, forces, slopes):
    """As `rim_forces`, and `slopes` (n, 3, 13): derivatives of W, T, DP by the first thirteen fields."""
    scratch = np.zeros((5, SLOPED))
    for row in range(contact.shape[0]):
        _one_rim(contact[row], width, nodes, weights, scratch, forces[row], slopes[row])


@njit(cache=True, nogil=True, error_model="numpy")
def forces_near(there, here, forces, slopes, near, beyond):
    """Carry the forces (n, 3) of contacts `here` (n, f) over to `near` (n, 3), those `there`, by their slopes.

    Marks in `beyond` (n,) rows that differ in what there are no slopes by, too: they have to be integrated.
    """
    for row in range(there.shape[0]):
        beyond[row] = False
        for f in range(SLOPED, there.shape[1]):
            beyond[row] |= there[row, f] != here[row, f]
        near[row] = forces[row]
        for f in range(SLOPED):
            change = there[row, f] - here[row, f]
            if change != 0.0:
                for force in range(3):
                    near[row, force] += slopes[row, force, f] * change


@njit(cache=True, nogil=True, error_model="numpy")
def _one_rim(field, width, nodes, weights, scratch, forces, slopes):
    theta_1, theta_2, theta_m, advance = field[0], field[1], field[2], field[3]
    radius, shear_radius = field[9], field[10]
    sin_1, cos_1 = math.sin(theta_1), math.cos(theta_1)
    top = _top(field[20]) if field[20] < math.inf else 1.0
    forces[:] = 0.0
    slopes[:, :] = 0.0
    sloped = slopes.shape[1] > 0
    # Derivatives, by the fields, of normal stress, angle on the rim, its weight, displacement and shear stress.
    by_normal, by_theta, by_weight, by_displacement, by_shear = scratch
    # Where the pressure has a kink the rule is applied on either side of it: it is the same on both, so that where the
    # kink lies has no slope.
    layer_at = _share_of_front(field[16], radius, cos_1, theta_1, theta_m)
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
            below = depth - field[16]
            layer = 0.0
            if below > 0.0:
                layer = field[17] * (below / width) ** field[8]
                normal += layer
            flat = normal > field[18]
            if flat:
                normal = field[18]
            if sloped:
                deeper = 0.0 if flat else field[8] * field[7] * share / depth
                by_normal[7] = 0.0 if flat else share
                by_normal[8] = 0.0 if flat else field[7] * share * relative
                if below > 0.0 and not flat:
                    deeper += field[8] * layer / below
                    by_normal[8] += layer * math.log(below / width)
                by_normal[0] = deeper * radius * (sin_1 - sin_ahead * (1.0 - along))
                by_normal[2] = -deeper * radius * sin_ahead * along
                by_normal[9] = deeper * (cos_ahead - cos_1)
            # By Eq. 9 both zones have the same normal stress at the same node: that of the front.
            for zone in range(2):
                theta, sine, cosine, end = ahead, sin_ahead, cos_ahead, theta_1
                if zone == 1:
                    theta, end = theta_2 + (theta_m - theta_2) * along, theta_2
                    sine, cosine = math.sin(theta), math.cos(theta)
                weight = share_of_rule * abs(theta_m - end)
                friction, strength = field[5], field[4] + normal * field[5]
                displacement = shear_radius * (theta_1 - theta) - advance * (sin_1 - sine)
                mobilised, slope = _mobilised(displacement, field[6], field[13], field[20], top)
                capped = False
                if field[15] < math.inf:
                    rim, cuts_off = field[14] + normal * field[15], field[19] > 0.5
                    capped = rim < (strength * abs(mobilised) if cuts_off else strength)
                    if capped:
                        friction, strength = field[15], rim
                        if cuts_off:
                            mobilised, slope = math.copysign(1.0, mobilised), 0.0
                shear = strength * mobilised
                up = radius * normal * cosine + shear_radius * shear * sine
                on = shear_radius * shear * cosine - radius * normal * sine
                forces[0] += weight * up
                forces[1] += weight * shear
                forces[2] += weight * on
                if not sloped:
                    continue
                by_theta[2] = along
                by_theta[0], by_theta[1] = (1.0 - along, 0.0) if zone == 0 else (0.0, 1.0 - along)
                widened = math.copysign(share_of_rule, theta_m - end)
                by_weight[2] = widened
                by_weight[0], by_weight[1] = (-widened, 0.0) if zone == 0 else (0.0, -widened)
                back = advance * cosine - shear_radius
                for f in range(3):
                    by_displacement[f] = back * by_theta[f]
                by_displacement[0] += shear_radius - advance * cos_1
                by_displacement[3] = sine - sin_1
                by_displacement[10] = theta_1 - theta
                for f in range(11):
                    by_shear[f] = mobilised * friction * by_normal[f] + strength * slope * by_displacement[f]
                if not capped:
                    by_shear[4] += mobilised
                    by_shear[5] += mobilised * normal
                by_shear[6] -= strength * slope * displacement / field[6]
                for f in range(11):
                    slopes[0, f] += by_weight[f] * up + weight * (
                        radius * by_normal[f] * cosine + shear_radius * by_shear[f] * sine + on * by_theta[f]
                    )
                    slopes[1, f] += by_weight[f] * shear + weight * by_shear[f]
                    slopes[2, f] += by_weight[f] * on + weight * (
                        shear_radius * by_shear[f] * cosine - radius * by_normal[f] * sine - up * by_theta[f]
                    )
                slopes[0, 9] += weight * normal * cosine
                slopes[2, 9] -= weight * normal * sine
                slopes[0, 10] += weight * shear * sine
                slopes[2, 10] += weight * shear * cosine
    lever = shear_radius * field[11]
    if sloped:
        slopes[1, 10] += forces[1] / shear_radius
        slopes[1, 11] = forces[1] / field[11]
        for f in range(12):
            slopes[0, f] *= width
            slopes[1, f] *= width * lever
            slopes[2, f] *= width
        slopes[0, 12] = 1.0
    forces[0] = forces[0] * width + field[12]
    forces[1] *= width * lever
    forces[2] *= width


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
    if not field[18] < math.inf:
        return math.inf
    return width * (field[18] / field[7]) ** (1.0 / field[8])


@njit(cache=True, nogil=True, error_model="numpy")
def _mobilised(displacement, modulus, residual, hump, top):
    """Mobilised share of the shear strength, odd in the displacement [m], and its derivative by it [1/m].

    Janosi & Hanamoto (1961); where `residual` is finite J. Y. Wong, J. Preston-Thomas, J. Terramechanics 19 (1983): a
    peak at the displacement `modulus`, then a fall to the residual share; where `hump` is finite V. V. Kacigin, V. V.
    Guskov, J. Terramechanics 5(3) (1968), over its largest value, the `top`. By the modulus [m] its derivative is that
    by the displacement, times -displacement / modulus.
    """
    along = abs(displacement) / modulus
    if hump < math.inf:
        share, slope = _hump(min(along, _LEVEL), hump)
        return math.copysign(share / top, displacement), slope / top / modulus
    decay = math.exp(-along)
    share, slope = 1.0 - decay, decay
    if residual < math.inf:
        excess = (1.0 / (1.0 - math.exp(-1.0)) - residual) * math.e * decay
        slope = decay * (residual + excess) - share * excess
        share *= residual + excess
    return math.copysign(share, displacement), slope / modulus


@njit(cache=True, nogil=True, error_model="numpy")
def _hump(along, hump):
    """Kacigin & Guskov's stress over what is left of it, and its derivative, at so many moduli."""
    rising = math.tanh(along)
    sech = 1.0 / math.cosh(along)
    return rising * (1.0 + hump * sech), sech * sech * (1.0 + hump * (2.0 * sech - 1.0 / sech))


@njit(cache=True, nogil=True, error_model="numpy")
def _top(hump):
    """Give the largest value of Kacigin & Guskov's stress over what is left of it."""
    return _hump(math.acosh((1.0 + math.sqrt(1.0 + 8.0 * hump * hump)) / (2.0 * hump)), hump)[0]
