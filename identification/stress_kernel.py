"""Compiled quadrature of the stresses along the rim, with its derivatives.

The rim is cut at the angle of the stress peak theta_m. In the front zone theta = theta_1 - (theta_1 - theta_m) u and in
the rear zone theta = theta_2 + (theta_m - theta_2) u, u in [0, 1]: by Eq. 9 of Iagnemma & Dubowsky (2002) both zones
then have the same normal stress at the same u. Stress rises from the free ends like u^n, n not an integer, which spoils
Gauss-Legendre quadrature; with u = s^4 the integrand is smooth in s, and 20 nodes suffice for ten digits.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_CLUSTERING = 4


def quadrature(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes u and weights on [0, 1], (count,) each: Gauss-Legendre in s with u = s^4."""
    s, w = np.polynomial.legendre.leggauss(count)
    s, w = (s + 1.0) / 2.0, w / 2.0
    return s**_CLUSTERING, w * _CLUSTERING * s ** (_CLUSTERING - 1)


NODES, WEIGHTS = quadrature(20)
"""Ten digits on driven wheels (a braked wheel's shear stress has a kink inside the contact: about four digits)."""

FEW_NODES, FEW_WEIGHTS = quadrature(10)
"""Six digits, well below any sensor's noise: for estimation."""

THETA_1, THETA_2, THETA_M, SLIP, COHESION, TAN_PHI, SHEAR_MODULUS, STIFFNESS, EXPONENT = range(9)
FIELD_COUNT = 9
"""Columns of the contact array: theta_1, theta_2, theta_m [rad], slip [-], c [Pa], tan phi [-], Janosi shear modulus k
[m], stiffness k1 + k2 b [Pa], sinkage exponent n [-]."""

LOCKED = 1e-9


@njit(cache=True, nogil=True, error_model="numpy")
def speed_ratio(slip):
    """V / (r omega) and its derivative with respect to slip; 1 - i driving, 1 / (1 + i) braking."""
    if slip >= 0.0:
        return 1.0 - slip, -1.0
    turning = max(1.0 + slip, LOCKED)
    return 1.0 / turning, -1.0 / (turning * turning)


@njit(cache=True, nogil=True, error_model="numpy")
def rim_forces(contact, radius, width, nodes, weights, forces):
    """Integrate Eq. 2-4 for each row of `contact` (n, 9) into `forces` (n, 3): W [N], T [N m], DP [N]."""
    for row in range(contact.shape[0]):
        _one_rim(contact[row], radius, width, nodes, weights, forces[row])


@njit(cache=True, nogil=True, error_model="numpy")
def _one_rim(field, radius, width, nodes, weights, out):
    theta_1, theta_2, theta_m = field[0], field[1], field[2]
    cohesion, tan_phi, modulus, exponent = field[4], field[5], field[6], field[8]
    ratio = speed_ratio(field[3])[0]
    scale = field[7] * (radius / width) ** exponent
    sin_1, cos_1 = math.sin(theta_1), math.cos(theta_1)
    load, torque, pull = 0.0, 0.0, 0.0
    front, rear = theta_1 - theta_m, theta_m - theta_2
    for node in range(nodes.size):
        u = nodes[node]
        theta_a = theta_1 - front * u
        theta_b = theta_2 + rear * u
        sin_a, cos_a, sin_b, cos_b = math.sin(theta_a), math.cos(theta_a), math.sin(theta_b), math.cos(theta_b)
        normal = scale * max(cos_a - cos_1, 0.0) ** exponent
        strength = cohesion + normal * tan_phi
        shear_a = strength * _mobilised(radius * (front * u - ratio * (sin_1 - sin_a)), modulus)
        shear_b = strength * _mobilised(radius * (theta_1 - theta_b - ratio * (sin_1 - sin_b)), modulus)
        weight_a, weight_b = weights[node] * front, weights[node] * rear
        load += weight_a * (normal * cos_a + shear_a * sin_a) + weight_b * (normal * cos_b + shear_b * sin_b)
        torque += weight_a * shear_a + weight_b * shear_b
        pull += weight_a * (shear_a * cos_a - normal * sin_a) + weight_b * (shear_b * cos_b - normal * sin_b)
    out[0], out[1], out[2] = radius * width * load, radius * radius * width * torque, radius * width * pull


@njit(cache=True, nogil=True, error_model="numpy")
def _mobilised(displacement, modulus):
    """Mobilised share of the shear strength after Janosi & Hanamoto (1961), odd in the displacement [m]."""
    return math.copysign(-math.expm1(-abs(displacement) / modulus), displacement)


@njit(cache=True, nogil=True, error_model="numpy")
def rim_forces_and_derivatives(contact, radius, width, nodes, weights, forces, jacobian):
    """As `rim_forces`, and `jacobian` (n, 3, 9): derivatives of W, T, DP with respect to the nine fields."""
    scratch = np.zeros((3, FIELD_COUNT))
    for row in range(contact.shape[0]):
        _one_rim_and_derivatives(contact[row], radius, width, nodes, weights, forces[row], jacobian[row], scratch)


@njit(cache=True, nogil=True, error_model="numpy")
def carry(
    imposed, soil, peak_share, radius, width, nodes, weights, smallest, largest, tolerance, angle, forces, jacobian
):
    """Entry angle at which each row carries its load, with the forces and derivatives there, by Newton's method.

    imposed (n, 2): load [N], slip; soil (5,): c, tan phi, k, stiffness, n; `angle` (n,) [rad] holds the start and then
    the answer; jacobian (n, 3, 7): derivatives of W, T, DP by theta_1 (theta_m following), slip and the soil. A row
    stops when its load is met within `tolerance`, relative; one whose load is never carried becomes NaN.
    """
    field = np.empty(FIELD_COUNT)
    full = np.empty((3, FIELD_COUNT))
    scratch = np.zeros((3, FIELD_COUNT))
    field[THETA_2] = 0.0
    field[COHESION:] = soil
    for row in range(imposed.shape[0]):
        target = imposed[row, 0]
        field[SLIP] = imposed[row, 1]
        low, high = smallest, largest
        theta = angle[row]
        if not (low < theta < high):
            theta = 0.5
        met = False
        for _ in range(60):
            field[THETA_1], field[THETA_M] = theta, peak_share * theta
            _one_rim_and_derivatives(field, radius, width, nodes, weights, forces[row], full, scratch)
            missing = target - forces[row, 0]
            if abs(missing) <= tolerance * target:
                met = True
                break
            if missing > 0.0:
                low = theta
            else:
                high = theta
            if high - low < 1e-12 or not target > 0.0:
                break
            slope = full[0, THETA_1] + peak_share * full[0, THETA_M]
            # W grows like a power of theta_1: Newton in logarithms converges from afar.
            growth = slope * theta / forces[row, 0] if forces[row, 0] > 0.0 else 0.0
            trial = theta * (target / forces[row, 0]) ** (1.0 / growth) if growth > 0.2 else -1.0
            theta = trial if low < trial < high else 0.5 * (low + high)
        if met:
            angle[row] = theta
            for force in range(3):
                jacobian[row, force, 0] = full[force, THETA_1] + peak_share * full[force, THETA_M]
                jacobian[row, force, 1] = full[force, SLIP]
                for m in range(COHESION, FIELD_COUNT):
                    jacobian[row, force, m - 2] = full[force, m]
        else:
            angle[row] = math.nan
            forces[row, :] = math.nan
            jacobian[row, :, :] = math.nan


@njit(cache=True, nogil=True, error_model="numpy")
def _one_rim_and_derivatives(field, radius, width, nodes, weights, out, jac, scratch):
    d_normal, d_a, d_b = scratch[0], scratch[1], scratch[2]
    theta_1, theta_2, theta_m = field[0], field[1], field[2]
    cohesion, tan_phi, modulus, stiffness, exponent = field[4], field[5], field[6], field[7], field[8]
    ratio, d_ratio = speed_ratio(field[3])
    aspect = radius / width
    log_aspect = math.log(aspect)
    power = aspect**exponent
    sin_1, cos_1 = math.sin(theta_1), math.cos(theta_1)
    front, rear = theta_1 - theta_m, theta_m - theta_2
    out[:] = 0.0
    jac[:, :] = 0.0
    for node in range(nodes.size):
        u = nodes[node]
        theta_a = theta_1 - front * u
        theta_b = theta_2 + rear * u
        sin_a, cos_a, sin_b, cos_b = math.sin(theta_a), math.cos(theta_a), math.sin(theta_b), math.cos(theta_b)
        depth = max(cos_a - cos_1, 1e-300)
        log_depth = math.log(depth)
        shape = power * math.exp(exponent * log_depth)
        normal = stiffness * shape
        slope = exponent * normal / depth
        d_normal[THETA_1] = slope * (sin_1 - sin_a * (1.0 - u))
        d_normal[THETA_M] = -slope * sin_a * u
        d_normal[STIFFNESS] = shape
        d_normal[EXPONENT] = normal * (log_aspect + log_depth)
        strength = cohesion + normal * tan_phi

        displacement = radius * (front * u - ratio * (sin_1 - sin_a))
        decay = math.exp(-abs(displacement) / modulus)
        share = math.copysign(1.0 - decay, displacement)
        rate = strength * decay / modulus
        _shear_derivatives(share, rate * displacement / modulus, tan_phi, normal, d_normal, d_a)
        shear_a = strength * share
        rate *= radius
        d_a[THETA_1] += rate * (u - ratio * (cos_1 - cos_a * (1.0 - u)))
        d_a[THETA_M] += rate * u * (ratio * cos_a - 1.0)
        d_a[SLIP] = -rate * (sin_1 - sin_a) * d_ratio

        displacement = radius * (theta_1 - theta_b - ratio * (sin_1 - sin_b))
        decay = math.exp(-abs(displacement) / modulus)
        share = math.copysign(1.0 - decay, displacement)
        rate = strength * decay / modulus
        _shear_derivatives(share, rate * displacement / modulus, tan_phi, normal, d_normal, d_b)
        shear_b = strength * share
        rate *= radius
        d_b[THETA_1] += rate * (1.0 - ratio * cos_1)
        d_b[THETA_2] = rate * (1.0 - u) * (ratio * cos_b - 1.0)
        d_b[THETA_M] += rate * u * (ratio * cos_b - 1.0)
        d_b[SLIP] = -rate * (sin_1 - sin_b) * d_ratio

        w = weights[node]
        load_a, load_b = normal * cos_a + shear_a * sin_a, normal * cos_b + shear_b * sin_b
        pull_a, pull_b = shear_a * cos_a - normal * sin_a, shear_b * cos_b - normal * sin_b
        out[0] += w * (front * load_a + rear * load_b)
        out[1] += w * (front * shear_a + rear * shear_b)
        out[2] += w * (front * pull_a + rear * pull_b)
        wa, wb = w * front, w * rear
        for m in range(FIELD_COUNT):
            jac[0, m] += wa * (d_normal[m] * cos_a + d_a[m] * sin_a) + wb * (d_normal[m] * cos_b + d_b[m] * sin_b)
            jac[1, m] += wa * d_a[m] + wb * d_b[m]
            jac[2, m] += wa * (d_a[m] * cos_a - d_normal[m] * sin_a) + wb * (d_b[m] * cos_b - d_normal[m] * sin_b)
        # The nodes and the zones' lengths move with the three angles. By d(load)/d(theta) = pull and
        # d(pull)/d(theta) = -load, at fixed stresses.
        move_1, move_m = wa * (1.0 - u), wa * u
        jac[0, THETA_1] += w * load_a + move_1 * pull_a
        jac[1, THETA_1] += w * shear_a
        jac[2, THETA_1] += w * pull_a - move_1 * load_a
        jac[0, THETA_2] += -w * load_b + wb * (1.0 - u) * pull_b
        jac[1, THETA_2] += -w * shear_b
        jac[2, THETA_2] += -w * pull_b - wb * (1.0 - u) * load_b
        jac[0, THETA_M] += w * (load_b - load_a) + move_m * pull_a + wb * u * pull_b
        jac[1, THETA_M] += w * (shear_b - shear_a)
        jac[2, THETA_M] += w * (pull_b - pull_a) - move_m * load_a - wb * u * load_b
    area = radius * width
    out[0] *= area
    out[1] *= area * radius
    out[2] *= area
    for m in range(FIELD_COUNT):
        jac[0, m] *= area
        jac[1, m] *= area * radius
        jac[2, m] *= area


@njit(cache=True, nogil=True, error_model="numpy")
def _shear_derivatives(share, by_modulus, tan_phi, normal, d_normal, out):
    """Derivatives of the shear stress at fixed displacement with respect to the nine fields."""
    for m in range(FIELD_COUNT):
        out[m] = share * tan_phi * d_normal[m]
    out[COHESION] = share
    out[TAN_PHI] = share * normal
    out[SHEAR_MODULUS] = -by_modulus


@njit(cache=True, nogil=True, error_model="numpy")
def solve_entry_angle(contact, exit_share, peak_share, load, radius, width, nodes, weights, largest, forces):
    """Find theta_1 of each row so that W carries `load` (n,), by Newton's method kept inside a bracket.

    theta_2 = exit_share theta_1 and theta_m = peak_share theta_1 follow theta_1. Fills the angles of `contact` and
    `forces` (n, 3); rows whose load is not carried below `largest` [rad] become NaN.
    """
    trial_forces = np.empty(3)
    for row in range(contact.shape[0]):
        field = contact[row]
        target = load[row]
        low, high = 0.0, largest
        _set_angles(field, high, exit_share[row], peak_share[row])
        _one_rim(field, radius, width, nodes, weights, trial_forces)
        if not (target > 0.0) or not (trial_forces[0] >= target):
            field[0] = field[1] = field[2] = math.nan
            forces[row, :] = math.nan
            continue
        angle, step_angle, step_load = high, 0.0, trial_forces[0]
        # W grows about like theta_1^(2 n + 1): secant steps in logarithms are nearly exact from the start.
        growth = 2.0 * field[8] + 1.0
        for _ in range(100):
            trial = angle * (target / trial_forces[0]) ** (1.0 / growth) if trial_forces[0] > 0.0 else 0.0
            if not (low < trial < high):
                trial = 0.5 * (low + high)
            step_angle, step_load = angle, trial_forces[0]
            angle = trial
            _set_angles(field, angle, exit_share[row], peak_share[row])
            _one_rim(field, radius, width, nodes, weights, trial_forces)
            if trial_forces[0] < target:
                low = angle
            else:
                high = angle
            if abs(trial_forces[0] - target) <= 1e-13 * target or high - low <= 1e-15 * high:
                break
            if trial_forces[0] > 0.0 and step_load > 0.0 and step_angle != angle:
                measured = math.log(trial_forces[0] / step_load) / math.log(angle / step_angle)
                growth = min(max(measured, 0.2), 20.0)
        forces[row, :] = trial_forces


@njit(cache=True, nogil=True, error_model="numpy")
def _set_angles(field, theta_1, exit_share, peak_share):
    field[0] = theta_1
    field[1] = exit_share * theta_1
    field[2] = peak_share * theta_1
