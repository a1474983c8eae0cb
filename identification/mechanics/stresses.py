"""Quadrature of the stresses along the rim, with its derivatives: the one that every wheel model uses.

Stresses are those of K. Iagnemma, S. Dubowsky, "Terrain estimation for high-speed rough-terrain autonomous vehicle
navigation" (2002), Eq. 2-9. A contact is a row of numbers (`FIELDS`); effects that the textbook leaves out enter by
changing them.

The rim is cut at the angle of the stress peak theta_m. In the front zone theta = theta_1 - (theta_1 - theta_m) u and in
the rear zone theta = theta_2 + (theta_m - theta_2) u, u in [0, 1]: by Eq. 9 both zones then have the same normal stress
at the same u. Stress rises from the free ends like u^n, n not an integer, which spoils Gauss-Legendre quadrature; with
u = s^2 or s^3 the integrand is smoother in s. Both zones are cut further where the stresses have a kink.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

Rule = tuple[np.ndarray, np.ndarray]
"""Nodes u and weights on [0, 1] of a quadrature, (m,) each."""


def quadrature(count: int, clustering: int) -> Rule:
    """Gauss-Legendre quadrature in s with u = s^clustering."""
    s, w = np.polynomial.legendre.leggauss(count)
    s, w = (s + 1.0) / 2.0, w / 2.0
    return s**clustering, w * clustering * s ** (clustering - 1)


# Largest errors over the soils, slips and sinkages of Iagnemma & Dubowsky (2002), Sec. 3.1, relative to W, W r and W.
FINE = quadrature(14, 3)
"""Nine digits: 3e-10."""

QUICK = quadrature(8, 2)
"""Six digits, 9e-7: for estimation, far below any sensor's noise."""

COARSE = quadrature(4, 2)
"""Three digits, 4e-4: to search for the entry angle with."""

FIELDS = (
    "theta_1", "theta_2", "theta_m", "advance_m", "c_Pa", "tan_phi", "k_m", "stiffness_Pa", "n", "radius_m",
    "shear_radius_m", "lever_m", "lift_N", "residual", "adhesion_Pa", "tan_delta", "layer_depth_m",
    "layer_stiffness_Pa", "most_normal_Pa", "hump", "rim_cuts_off",
)  # fmt: skip
"""Columns of a contact: entry, exit and peak angle [rad], V / omega [m], c [Pa], tan phi, Janosi k [m], stiffness
k1 + k2 b [Pa], n, radius of the contact, radius at which soil shears and lever arm of the shear stress [m], what
carries load besides the stresses on the rim [N], share of the shear strength left after its peak (infinite for
Janosi's law, which has no peak), adhesion [Pa] and friction of the rim (infinite where soil never slips on it), depth
[m] and stiffness [Pa] of a layer beneath, the largest normal stress that the wheel transmits [Pa] (infinite for a rigid
one), h of Kacigin & Guskov's law (infinite where it is not theirs) [-], and one where the rim cuts the soil's shear
stress off instead of its strength."""

COLUMN = {name: index for index, name in enumerate(FIELDS)}

(
    THETA_1, THETA_2, THETA_M, ADVANCE, COHESION, TAN_PHI, MODULUS, STIFFNESS, EXPONENT, RADIUS, SHEAR_RADIUS, LEVER,
    LIFT, RESIDUAL, ADHESION, TAN_DELTA, LAYER_DEPTH, LAYER_STIFFNESS, MOST_NORMAL, HUMP, CUTS_OFF,
) = range(len(FIELDS))  # fmt: skip

SLOPED = CUTS_OFF
"""Forces have derivatives by all fields but the last, which is a switch."""

TEXTBOOK = np.zeros(len(FIELDS))
TEXTBOOK[[RESIDUAL, TAN_DELTA, LAYER_DEPTH, MOST_NORMAL, HUMP]] = math.inf
"""A row (f,) whose fields beyond geometry and soil are such that the textbook wheel has nothing of the kind."""

EDGES = 12
"""Ends of the pieces that the rim is cut into at its kinks, at most; further ones go without."""

_LOOKS, _CLOSE = 8, 1e-6
"""Where a rim may begin to cut the shear stress off: intervals of a zone that are looked at, and how close to it the
zone is cut, as shares of the zone [-]."""

LOCKED = 1e-9
"""Least r omega / V of a braked wheel: none is locked altogether."""

_LEVEL = 40.0
"""Displacement by which nothing is left of a hump, in moduli [-]."""


def speed_ratio(slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """V / (r omega) and its derivative by slip, (n,) each: 1 - i driving, 1 / (1 + i) braking."""
    slip = np.asarray(slip, dtype=float)
    turning = np.maximum(1.0 + slip, LOCKED)
    return np.where(slip >= 0.0, 1.0 - slip, 1.0 / turning), np.where(slip >= 0.0, -1.0, -1.0 / turning**2)


def rim_forces(contact: np.ndarray, width_m: float, rule: Rule = FINE) -> np.ndarray:
    """Load W [N], torque T [N m] and drawbar pull DP [N] of each contact (n, f), Eq. 2-4: (n, 3)."""
    return rim_forces_and_slopes(contact, width_m, rule, sloped=False)[0]


def rim_forces_and_slopes(
    contact: np.ndarray, width_m: float, rule: Rule = FINE, *, sloped: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """As `rim_forces`, with the derivatives (n, 3, 20) by all fields but the last; by none where not `sloped`."""
    rows = len(contact)
    forces, slopes = np.empty((rows, 3)), np.empty((rows, 3, SLOPED if sloped else 0))
    integrate(np.asfortranarray(contact), width_m, *rule, np.ones(rows, dtype=bool), forces, slopes)
    return forces, slopes


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(contact, width, nodes, weights, wanted, forces, slopes):
    """Integrate the stresses of each row of `contact` (n, f) into `forces` (n, 3) and `slopes` (n, 3, 20 or 0).

    Rows that are not `wanted` (n,) keep what they have.
    """
    field, scratch = np.empty(contact.shape[1]), np.empty((4, EDGES))
    for row in range(contact.shape[0]):
        if wanted[row]:
            for f in range(field.size):
                field[f] = contact[row, f]
            one_rim(field, width, nodes, weights, scratch, forces[row], slopes[row])


@njit(cache=True, nogil=True, error_model="numpy")
def forces_near(there, here, forces, slopes, near, beyond):
    """Carry the forces (n, 3) of contacts `here` (n, f) over to `near` (n, 3), those `there`, by their slopes.

    Marks rows in `beyond` (n,) where that cannot be done: they have to be integrated.
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
    """Integrate one contact (f,); `scratch` (4, `EDGES`) is room to work in, its contents of no account."""
    theta_1, theta_2, theta_m, advance = field[THETA_1], field[THETA_2], field[THETA_M], field[ADVANCE]
    cohesion, tan_phi, modulus, exponent = field[COHESION], field[TAN_PHI], field[MODULUS], field[EXPONENT]
    radius, shear_radius = field[RADIUS], field[SHEAR_RADIUS]
    layered, capped_by_rim = field[LAYER_DEPTH] < math.inf, field[TAN_DELTA] < math.inf
    cuts_off, has_peak = field[CUTS_OFF] > 0.5, min(field[RESIDUAL], field[HUMP]) < math.inf
    sin_1, cos_1 = math.sin(theta_1), math.cos(theta_1)
    scale = field[STIFFNESS] * (radius / width) ** exponent
    top, by_hump = _top(field[HUMP]) if field[HUMP] < math.inf else (1.0, 0.0)
    sloped = slopes.shape[1] > 0
    forces[:] = 0.0
    slopes[:, :] = 0.0
    # Derivatives of the three forces by the normal and the shear stress of a node, and by its displacement.
    edges, by_normal, by_shear, by_moved = scratch[0], scratch[1], scratch[2], scratch[3]
    pieces = _cut(field, width, sin_1, cos_1, top, edges)
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
                by_residual, by_h = 0.0, 0.0
                if has_peak:
                    mobilised, slope, by_residual, by_h = _with_peak(
                        displacement, modulus, field[RESIDUAL], field[HUMP], top, by_hump
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
                            by_residual, by_h = 0.0, 0.0
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
                    # The node moves with the angles, and the zone becomes longer.
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
                    if has_peak:
                        slopes[force, RESIDUAL] += by_shear[force] * strength * by_residual
                        slopes[force, HUMP] += by_shear[force] * strength * by_h
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


@njit(cache=True, nogil=True, error_model="numpy")
def _cut(field, width, sin_1, cos_1, top, edges):
    """Cut the zones' common [0, 1] where the stresses have a kink: fills `edges`, gives the number of pieces.

    The integrand is continuous at a kink, so that where a kink lies has no slope.
    """
    edges[0], pieces = 0.0, 1
    theta_1, theta_2, theta_m = field[THETA_1], field[THETA_2], field[THETA_M]
    if field[ADVANCE] > field[SHEAR_RADIUS]:
        turned = _turning_point(theta_1, field[SHEAR_RADIUS] / field[ADVANCE])
        if theta_m <= turned < theta_1:
            edges[pieces] = (theta_1 - turned) / (theta_1 - theta_m)
            pieces += 1
        elif theta_2 < turned < theta_m:
            edges[pieces] = (turned - theta_2) / (theta_m - theta_2)
            pieces += 1
    if field[LAYER_DEPTH] < math.inf:
        edges[pieces] = _share_of_front(field, field[LAYER_DEPTH], cos_1)
        pieces += 1
    if field[MOST_NORMAL] < math.inf:
        edges[pieces] = _share_of_front(field, _depth_of(field, field[MOST_NORMAL], width), cos_1)
        pieces += 1
    if field[TAN_DELTA] < math.inf and field[CUTS_OFF] > 0.5:
        pieces = _cut_at_the_rim(field, width, sin_1, cos_1, top, edges, pieces)
    elif field[TAN_DELTA] < math.inf and field[TAN_PHI] != field[TAN_DELTA]:
        crossing = (field[ADHESION] - field[COHESION]) / (field[TAN_PHI] - field[TAN_DELTA])
        if 0.0 < crossing < field[MOST_NORMAL]:
            edges[pieces] = _share_of_front(field, _depth_of(field, crossing, width), cos_1)
            pieces += 1
    edges[pieces] = 1.0
    for last in range(2, pieces):
        for at in range(last, 1, -1):
            if edges[at] < edges[at - 1]:
                edges[at], edges[at - 1] = edges[at - 1], edges[at]
    return pieces


@njit(cache=True, nogil=True, error_model="numpy")
def _cut_at_the_rim(field, width, sin_1, cos_1, top, edges, pieces):
    """Cut where soil begins, or ceases, to slip on a rim that cuts its shear stress off, in either zone."""
    for zone in range(2):
        before = _over_the_rim(field, width, sin_1, cos_1, top, zone, 0.0)
        for step in range(1, _LOOKS + 1):
            low, high = ((step - 1) / _LOOKS) ** 2, (step / _LOOKS) ** 2
            after = _over_the_rim(field, width, sin_1, cos_1, top, zone, high)
            if (before > 0.0) != (after > 0.0) and pieces < edges.size - 1:
                at_low, at_high, middle = before, after, high
                # Regula falsi, the end that stays halved (Illinois).
                for _ in range(30):
                    middle = (low * at_high - high * at_low) / (at_high - at_low)
                    found = _over_the_rim(field, width, sin_1, cos_1, top, zone, middle)
                    if (found > 0.0) == (at_high > 0.0):
                        if abs(high - middle) < _CLOSE:
                            break
                        high, at_high, at_low = middle, found, 0.5 * at_low
                    else:
                        if abs(middle - low) < _CLOSE:
                            break
                        low, at_low, at_high = middle, found, 0.5 * at_high
                edges[pieces] = middle
                pieces += 1
            before = after
    return pieces


@njit(cache=True, nogil=True, error_model="numpy")
def _over_the_rim(field, width, sin_1, cos_1, top, zone, along):
    """Give what the soil's shear stress has beyond the rim's [Pa], a share of a zone from its free end."""
    theta_1, theta_2, theta_m = field[THETA_1], field[THETA_2], field[THETA_M]
    ahead = theta_1 + (theta_m - theta_1) * along
    normal = min(_pressure(field, field[RADIUS] * (math.cos(ahead) - cos_1), width), field[MOST_NORMAL])
    theta = ahead if zone == 0 else theta_2 + (theta_m - theta_2) * along
    displacement = field[SHEAR_RADIUS] * (theta_1 - theta) - field[ADVANCE] * (sin_1 - math.sin(theta))
    mobilised = 1.0 - math.exp(-abs(displacement) / field[MODULUS])
    if min(field[RESIDUAL], field[HUMP]) < math.inf:
        mobilised = abs(_with_peak(displacement, field[MODULUS], field[RESIDUAL], field[HUMP], top, 0.0)[0])
    return (field[COHESION] + normal * field[TAN_PHI]) * mobilised - field[ADHESION] - normal * field[TAN_DELTA]


@njit(cache=True, nogil=True, error_model="numpy")
def _pressure(field, depth, width):
    """Normal stress [Pa] at a depth [m], whether or not the wheel transmits it."""
    normal = field[STIFFNESS] * (max(depth, 0.0) / width) ** field[EXPONENT]
    if depth > field[LAYER_DEPTH]:
        normal += field[LAYER_STIFFNESS] * ((depth - field[LAYER_DEPTH]) / width) ** field[EXPONENT]
    return normal


@njit(cache=True, nogil=True, error_model="numpy")
def _turning_point(theta_1, ratio):
    """Angle at which the shear displacement of a wheel that turns slower than it travels changes its sign.

    There sin(theta) - ratio theta, ratio = r omega / V, is what it is at the entry, and grows with theta. NaN where the
    displacement has one sign all along the rim.
    """
    peak = math.acos(ratio)
    target = math.sin(theta_1) - ratio * theta_1
    highest = math.sin(peak) - ratio * peak
    if theta_1 <= peak or target <= -highest:
        return math.nan
    low, high = -peak, peak
    theta = max(2.0 * peak - theta_1, 0.0)
    for _ in range(60):
        value = math.sin(theta) - ratio * theta - target
        if value > 0.0:
            high = theta
        else:
            low = theta
        step = value / (math.cos(theta) - ratio)
        if abs(step) < 1e-12:
            break
        theta -= step
        if not (low < theta < high):
            theta = 0.5 * (low + high)
    return theta


@njit(cache=True, nogil=True, error_model="numpy")
def _share_of_front(field, depth, cos_1):
    """Share of the front zone, from its edge, at which the rim is so deep [m]; 1 where it never is."""
    cosine = cos_1 + depth / field[RADIUS]
    if not cosine < 1.0:
        return 1.0
    return min(max((field[THETA_1] - math.acos(cosine)) / (field[THETA_1] - field[THETA_M]), 0.0), 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _depth_of(field, normal, width):
    """Depth [m] at which the soil presses so much [Pa]."""
    depth = width * (normal / field[STIFFNESS]) ** (1.0 / field[EXPONENT])
    if depth <= field[LAYER_DEPTH]:
        return depth
    low, high = field[LAYER_DEPTH], depth
    for _ in range(50):
        depth = 0.5 * (low + high)
        if _pressure(field, depth, width) < normal:
            low = depth
        else:
            high = depth
    return depth


@njit(cache=True, nogil=True, error_model="numpy")
def _with_peak(displacement, modulus, residual, hump, top, by_top):
    """Mobilised share of the shear strength where it passes a peak, odd in the displacement [m], and its derivatives.

    They are by the displacement [1/m], by `residual` and by `hump`. Where `residual` is finite the law is that of
    J. Y. Wong, J. Preston-Thomas, J. Terramechanics 19 (1983): a peak at the displacement `modulus`, then a fall to the
    residual share; where `hump` is finite that of V. V. Kacigin, V. V. Guskov, J. Terramechanics 5(3) (1968), over its
    largest value, the `top`. By the modulus [m] the derivative is that by the displacement, times
    -displacement / modulus.
    """
    along, sign = abs(displacement) / modulus, math.copysign(1.0, displacement)
    if hump < math.inf:
        along = min(along, _LEVEL)
        share, slope = _hump(along, hump)
        by_hump = (math.tanh(along) / math.cosh(along) - share / top * by_top) / top
        return sign * share / top, slope / top / modulus, 0.0, sign * by_hump
    decay = math.exp(-along)
    rising = 1.0 - decay
    excess = (1.0 / (1.0 - math.exp(-1.0)) - residual) * math.e * decay
    slope = decay * (residual + excess) - rising * excess
    by_residual = rising * (1.0 - math.e * decay)
    return sign * rising * (residual + excess), slope / modulus, sign * by_residual, 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _hump(along, hump):
    """Kacigin & Guskov's stress over what is left of it, and its derivative, at so many moduli."""
    rising = math.tanh(along)
    sech = 1.0 / math.cosh(along)
    return rising * (1.0 + hump * sech), sech * sech * (1.0 + hump * (2.0 * sech - 1.0 / sech))


@njit(cache=True, nogil=True, error_model="numpy")
def _top(hump):
    """Give the largest value of Kacigin & Guskov's stress over what is left of it, and its derivative by h."""
    where = math.acosh((1.0 + math.sqrt(1.0 + 8.0 * hump * hump)) / (2.0 * hump))
    return _hump(where, hump)[0], math.tanh(where) / math.cosh(where)
