"""Kinks of the stresses along the rim, and the shear laws with a peak.

A quadrature across a kink loses accuracy: the rim is divided at each of them.
"""

from __future__ import annotations

import math

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
    MODULUS,
    MOST_NORMAL,
    RADIUS,
    RESIDUAL,
    SHEAR_RADIUS,
    STIFFNESS,
    TAN_DELTA,
    TAN_PHI,
    THETA_1,
    THETA_2,
    THETA_M,
)  # fmt: skip

EDGES = 12
"""Most ends of the pieces that the rim is divided into; further kinks are ignored."""

_SHEARED = 16.0
"""Displacement at which the shear stress of a hard-braked wheel is fully mobilised, in moduli [-]."""

_LOOKS, _CLOSE = 8, 1e-6
"""Intervals of a zone in which the search for a limit of the shear stress by the rim starts, and tolerance of the
result relative to the zone [-]."""

_LEVEL = 40.0
"""Displacement from which on a hump has vanished, in moduli [-]."""


@njit(cache=True, nogil=True, error_model="numpy")
def cut(field, width, sin_1, cos_1, top, edges):
    """Divide the zones' common [0, 1] at kinks of the stresses: fills `edges`, returns the number of pieces.

    The integrand is continuous at a kink, so that the integral has no derivative by the kink's position.
    """
    edges[0], pieces = 0.0, 1
    theta_1, theta_2, theta_m = field[THETA_1], field[THETA_2], field[THETA_M]
    entering = field[ADVANCE] * cos_1 - field[SHEAR_RADIUS]
    if entering > 0.0:
        # No kink, but nearly a step: soil under an almost locked wheel mobilises its full strength at once.
        steep = _SHEARED * field[MODULUS] / entering / (theta_1 - theta_m)
        if steep < 0.9:
            edges[pieces] = steep
            pieces += 1
    if field[ADVANCE] > field[SHEAR_RADIUS]:
        turned = turning_point(theta_1, field[SHEAR_RADIUS] / field[ADVANCE])
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
    """Divide either zone where soil begins, or ceases, to slip on a rim that limits the shear stress."""
    for zone in range(2):
        before = _over_the_rim(field, width, sin_1, cos_1, top, zone, 0.0)
        for step in range(1, _LOOKS + 1):
            low, high = ((step - 1) / _LOOKS) ** 2, (step / _LOOKS) ** 2
            after = _over_the_rim(field, width, sin_1, cos_1, top, zone, high)
            if (before > 0.0) != (after > 0.0) and pieces < edges.size - 1:
                at_low, at_high, middle = before, after, high
                # Regula falsi (Illinois algorithm).
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
    """Excess of the soil's shear stress over the rim's [Pa] at a share of a zone from its free end."""
    theta_1, theta_2, theta_m = field[THETA_1], field[THETA_2], field[THETA_M]
    ahead = theta_1 + (theta_m - theta_1) * along
    normal = min(_pressure(field, field[RADIUS] * (math.cos(ahead) - cos_1), width), field[MOST_NORMAL])
    theta = ahead if zone == 0 else theta_2 + (theta_m - theta_2) * along
    displacement = field[SHEAR_RADIUS] * (theta_1 - theta) - field[ADVANCE] * (sin_1 - math.sin(theta))
    mobilised = 1.0 - math.exp(-abs(displacement) / field[MODULUS])
    if has_peak(field):
        mobilised = abs(
            with_peak(displacement, field[MODULUS], field[RESIDUAL], field[HUMP], field[DECAY], top, 0.0)[0]
        )
    return (field[COHESION] + normal * field[TAN_PHI]) * mobilised - field[ADHESION] - normal * field[TAN_DELTA]


@njit(cache=True, nogil=True, error_model="numpy")
def _pressure(field, depth, width):
    """Normal stress [Pa] at a depth [m] below a rigid wheel."""
    normal = field[STIFFNESS] * (max(depth, 0.0) / width) ** field[EXPONENT]
    if depth > field[LAYER_DEPTH]:
        normal += field[LAYER_STIFFNESS] * ((depth - field[LAYER_DEPTH]) / width) ** field[EXPONENT]
    return normal


@njit(cache=True, nogil=True, error_model="numpy")
def turning_point(theta_1, ratio):
    """Angle [rad] at which the shear displacement of a wheel that turns slower than it travels changes its sign.

    There sin(theta) - ratio theta, ratio = r omega / V, equals its value at the entry, and grows with theta. NaN if the
    displacement has the same sign along the whole rim.
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
    """Share of the front zone, from its free end, at which the rim has a depth [m]; 1 if it is never that deep."""
    cosine = cos_1 + depth / field[RADIUS]
    if not cosine < 1.0:
        return 1.0
    return min(max((field[THETA_1] - math.acos(cosine)) / (field[THETA_1] - field[THETA_M]), 0.0), 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _depth_of(field, normal, width):
    """Depth [m] at which the soil has a normal stress [Pa]."""
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
def has_peak(field):
    """Return whether the shear stress of a contact (f,) has a peak."""
    return min(field[RESIDUAL], field[HUMP], field[DECAY]) < math.inf


@njit(cache=True, nogil=True, error_model="numpy")
def with_peak(displacement, modulus, residual, hump, decay, top, by_top):
    """Mobilised share of the shear strength, with a peak and odd in the displacement [m], and its derivatives.

    They are by the displacement [1/m], by `residual`, `hump` and `decay`. If `residual` is finite the law is that of
    J. Y. Wong, J. Preston-Thomas, J. Terramechanics 19 (1983): a peak at the displacement `modulus`, then a fall to the
    residual share; if `hump` is finite that of V. V. Kacigin, V. V. Guskov, J. Terramechanics 5(3) (1968), relative to
    its largest value, the `top`; if `decay` is finite that of M. G. Bekker, "Theory of Land Locomotion" (1956), the
    difference of two exponentials relative to its largest value. The derivative by the modulus [m] is that by the
    displacement times -displacement / modulus.
    """
    along, sign = abs(displacement) / modulus, math.copysign(1.0, displacement)
    if hump < math.inf:
        along = min(along, _LEVEL)
        share, slope = _hump(along, hump)
        by_hump = (math.tanh(along) / math.cosh(along) - share / top * by_top) / top
        return sign * share / top, slope / top / modulus, 0.0, sign * by_hump, 0.0
    fast = math.exp(-along)
    if decay < math.inf:
        slow = math.exp(-decay * along)
        share = (slow - fast) / top
        by_decay = -(along * slow + share * by_top) / top
        return sign * share, (fast - decay * slow) / top / modulus, 0.0, 0.0, sign * by_decay
    rising = 1.0 - fast
    excess = (1.0 / (1.0 - math.exp(-1.0)) - residual) * math.e * fast
    slope = fast * (residual + excess) - rising * excess
    by_residual = rising * (1.0 - math.e * fast)
    return sign * rising * (residual + excess), slope / modulus, sign * by_residual, 0.0, 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _hump(along, hump):
    """Kacigin & Guskov's stress relative to its residual value, and its derivative, at a displacement in moduli."""
    rising = math.tanh(along)
    sech = 1.0 / math.cosh(along)
    return rising * (1.0 + hump * sech), sech * sech * (1.0 + hump * (2.0 * sech - 1.0 / sech))


@njit(cache=True, nogil=True, error_model="numpy")
def top_of(hump, decay):
    """Largest value of Kacigin & Guskov's or Bekker's law before scaling, and its derivative by h or m."""
    if hump < math.inf:
        where = math.acosh((1.0 + math.sqrt(1.0 + 8.0 * hump * hump)) / (2.0 * hump))
        return _hump(where, hump)[0], math.tanh(where) / math.cosh(where)
    if 0.0 < decay < math.inf:
        where = -math.log(decay) / (1.0 - decay)
        slow = math.exp(-decay * where)
        return slow - math.exp(-where), -where * slow
    return 1.0, 0.0
