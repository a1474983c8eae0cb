"""Entry angle at which the soil carries the load: the root finder of all wheel models.

Between two integrations of the stresses each field of a contact is assumed to be a power of the entry angle. This is
exact for constant fields (0) and for angles in a fixed proportion (1), and so for nearly all models. For the others the
contact is computed again at the angle found, and the iteration continues.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from .fields import EXPONENT, FIELDS, SLOPED, THETA_1, THETA_2, THETA_M
from .kinks import EDGES
from .stresses import COARSE, FINE, QUICK, integrate, one_rim

SMALLEST_ENTRY_ANGLE = 1e-4
"""Lower end of the search for entry angles [rad]."""

LARGEST_ENTRY_ANGLE = 1.9
"""Entry angles beyond this [rad] mean a wheel buried above its axle: the load is not carried."""

IN_PROPORTION = np.zeros(len(FIELDS))
IN_PROPORTION[[THETA_1, THETA_2, THETA_M]] = 1.0
"""Exponents (f,) of the fields as powers of the entry angle if the angles change in proportion."""

EXACT = 1e-10
"""Relative error of the load at which the iteration ends [-]."""

CORRECTABLE = 2e-4
"""The same with derivatives [-]: a linear correction by these leaves about the square of it."""

_SECANT, _LAST = 3e-6, 0.1
"""Relative error of the load that a final secant step corrects without a further integration, and the largest size of
this step relative to the previous one [-]."""

_ITERATIONS, _PATIENCE = 40, 8
"""Most iterations, and those after which brackets are bisected if they shrink too slowly."""

_NEAR = 1e-3
"""Relative error of the load that a search by the coarse rule leaves, of the load or of the present error [-]."""

_STRAIGHT = 0.1
"""Relative error of the load up to which Newton steps by the derivatives are used [-]."""

_GROWTHS = 0.2, 20.0
"""Bounds of the exponent of the load as a power of the entry angle [-]."""

_STEP = 1e-5
_ROUNDING = 1e-9
"""Relative difference up to which fields agree with the assumed powers [-]."""


@dataclass(frozen=True)
class Equilibrium:
    """Contacts (n, f) that carry their load, their forces W [N], T [N m], DP [N] (n, 3), derivatives of these by the
    fields (n, 3, 21) if requested, and the exponent of the load as a power of the entry angle (n,). Rows whose load is
    not carried are NaN.
    """

    contact: np.ndarray
    forces: np.ndarray
    slopes: np.ndarray
    growth: np.ndarray


def carry(
    contact: np.ndarray,
    load_N: np.ndarray,
    width_m: float,
    *,
    lay_out: Callable[[np.ndarray], np.ndarray] | None = None,
    growth: np.ndarray | None = None,
    near: bool = False,
    sloped: bool = False,
) -> Equilibrium:
    """Find the entry angles at which contacts carry their loads.

    Parameters
    ----------
    contact : (n, f)
        Initial contacts, columns as `fields.FIELDS`.
    load_N : (n,)
        Load [N].
    width_m
        Width of the wheel [m].
    lay_out
        Returns the contact (n, f) at entry angles (n,); where absent theta_2 and theta_m stay in proportion to theta_1,
        and nothing else changes.
    growth : (n,), optional
        Exponent of the load as a power of the entry angle, if known.
    near
        Whether the initial contact carries about its load: it is then integrated first.
    sloped
        Whether to compute derivatives of the forces. The load then has a relative error of `CORRECTABLE` by the quick
        rule, else of `EXACT` by the fine one.
    """
    rows = len(contact)
    load = np.ascontiguousarray(load_N, dtype=float)
    contact = contact.copy(order="F")
    growth = np.full(rows, np.nan) if growth is None else growth.copy()
    forces, slopes = np.full((rows, 3), np.nan), np.full((rows, 3, SLOPED if sloped else 0), np.nan)
    bracket = np.empty((rows, 2))
    bracket[:] = SMALLEST_ENTRY_ANGLE, LARGEST_ENTRY_ANGLE
    rule, before = QUICK if sloped else FINE, np.full((rows, 4), np.nan)
    off, powers, tolerance = load > 0.0, IN_PROPORTION[None], CORRECTABLE
    exact = lay_out is None
    for iteration in range(_ITERATIONS):
        if iteration or not near:
            if lay_out is not None and not exact:
                powers = _powers(contact, lay_out)
            _approach(
                contact, powers, load, width_m, *COARSE, *rule, bracket, forces, slopes, before, growth,
                iteration >= _PATIENCE and iteration % 2 == 0, off,
            )  # fmt: skip
            if lay_out is not None and not exact:
                moved, contact = contact, lay_out(contact[:, THETA_1])
                exact = not _differ(moved, contact, _ROUNDING)
        integrate(contact, width_m, *rule, off, forces, slopes)
        if not sloped:
            # A secant needs forces of two contacts with the assumed powers.
            tolerance = np.where(np.isfinite(before[:, 1]), _SECANT if exact or iteration else EXACT, EXACT)
        off &= ~(np.abs(forces[:, 0] - load) <= tolerance * load)
        if not off.any():
            break
    lost = ~(np.abs(forces[:, 0] - load) <= tolerance * load)
    if not sloped:
        # The final secant step needs no further integration.
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.column_stack([contact[:, THETA_1], forces]) - before
            share = (load - forces[:, 0]) / steps[:, 1]
            steps = np.where((np.abs(share) < _LAST)[:, None], share[:, None] * steps, 0.0)
        forces += steps[:, 1:]
        angle = contact[:, THETA_1] + steps[:, 0]
        contact = _moved(contact, angle) if lay_out is None else lay_out(angle)
    if lost.any():
        contact[lost, : THETA_M + 1] = forces[lost] = slopes[lost] = np.nan
    return Equilibrium(contact, forces, slopes, growth)


def _moved(contact: np.ndarray, theta_1: np.ndarray) -> np.ndarray:
    """Return the contacts with other entry angles (n,), the other angles in proportion."""
    contact[:, THETA_1 : THETA_M + 1] *= (theta_1 / contact[:, THETA_1])[:, None]
    return contact


def _powers(contact: np.ndarray, lay_out: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Exponents (n, f) of a contact's fields as local powers of the entry angle; zero where they are none."""
    there = lay_out(contact[:, THETA_1] * (1.0 + _STEP))
    answer = np.zeros_like(contact)
    for f in np.flatnonzero((there != contact).any(axis=0)):
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = there[:, f] / contact[:, f]
            power = np.where((ratio > 0.0) & np.isfinite(ratio), np.log(ratio) / math.log1p(_STEP), 0.0)
        # Exact powers, but for the rounding of the differences.
        whole = np.round(power)
        answer[:, f] = np.where(np.abs(power - whole) < _ROUNDING, whole, power)
    return answer


@njit(cache=True, nogil=True, error_model="numpy")
def _differ(these, those, tolerance):
    """Return whether contacts (n, f) differ by more than a relative tolerance."""
    for f in range(these.shape[1]):
        for row in range(these.shape[0]):
            one, other = these[row, f], those[row, f]
            if one != other and abs(one - other) > tolerance * abs(other):
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _approach(
    contact, powers, load, width, nodes, weights, fine_nodes, fine_weights, bracket, known, slopes, before, growth,
    halve, off,
):  # fmt: skip
    """Move the contacts (n, f) that are `off` (n,) close to the entry angle at which they carry their load.

    The load is matched by the coarse rule. Forces (n, 3) `known` at the present angle narrow its `bracket` (n, 2) and
    correct this rule by a factor; if none are known, one step by the fine rule follows. The angle and forces that the
    step started from are left in `before` (n, 4). With `halve`, brackets are bisected. Contacts that carry too little
    or too much at the ends of the range of entry angles are excluded.
    """
    field, moved, power = np.empty(contact.shape[1]), np.empty(contact.shape[1]), np.empty(contact.shape[1])
    scratch, forces, no_slopes = np.empty((4, EDGES)), np.empty(3), np.empty((3, 0))
    for row in range(contact.shape[0]):
        if not off[row]:
            continue
        for f in range(field.size):
            field[f] = moved[f] = contact[row, f]
            power[f] = powers[row % len(powers), f]
        angle = start = field[0]
        target, within, new = load[row], _NEAR, not known[row, 0] > -math.inf
        if not new:
            before[row, 0], before[row, 1:] = angle, known[row]
            short = known[row, 0] < target
            bracket[row, 0 if short else 1] = angle
            if (short and angle > 0.999 * LARGEST_ENTRY_ANGLE) or (not short and angle < 1.001 * SMALLEST_ENTRY_ANGLE):
                off[row] = False
                continue
            wrong = abs(known[row, 0] / target - 1.0)
            if slopes.shape[2] > 0 and wrong < _STRAIGHT and not halve:
                # By Newton's method in logarithms.
                rise = 0.0
                for f in range(slopes.shape[2]):
                    if power[f] != 0.0:
                        rise += slopes[row, 0, f] * power[f] * field[f]
                growth[row] = min(max(rise / known[row, 0], _GROWTHS[0]), _GROWTHS[1])
                trial = angle * (target / known[row, 0]) ** (1.0 / growth[row])
                if bracket[row, 0] < trial < bracket[row, 1]:
                    _turn(field, power, trial / start, contact[row])
                    continue
            within *= min(wrong, 1.0)
        one_rim(moved, width, nodes, weights, scratch, forces, no_slopes)
        if not math.isfinite(forces[0]):
            off[row] = False
            continue
        if known[row, 0] > 0.0 and forces[0] > 0.0:
            target *= forces[0] / known[row, 0]
        if not growth[row] > 0.0:
            # W of a plate grows like theta_1^(2 n), that of a wheel by one power more.
            growth[row] = 2.0 * field[EXPONENT] + 1.0
        growth[row] = min(max(growth[row], _GROWTHS[0]), _GROWTHS[1])
        low, high = bracket[row, 0], bracket[row, 1]
        if halve:
            _turn(field, power, 0.5 * (low + high) / start, contact[row])
            continue
        widths = high - low, high - low
        for iteration in range(_ITERATIONS):
            found = forces[0]
            if abs(found - target) <= within * target or high - low <= 0.1 * within * high:
                break
            if found < target:
                low = max(low, angle)
            else:
                high = min(high, angle)
            trial = angle * (target / found) ** (1.0 / growth[row]) if found > 0.0 else low
            # A kink may hold secant steps up.
            stuck = iteration >= _PATIENCE and high - low > 0.5 * widths[0]
            widths = widths[1], high - low
            if stuck or not (low < trial < high):
                trial = 0.5 * (low + high)
            _turn(field, power, trial / start, moved)
            one_rim(moved, width, nodes, weights, scratch, forces, no_slopes)
            if forces[0] > 0.0 and found > 0.0 and abs(trial - angle) > 1e-9 * angle:
                measured = math.log(forces[0] / found) / math.log(trial / angle)
                growth[row] = min(max(measured, _GROWTHS[0]), _GROWTHS[1])
            angle = trial
        if new:
            one_rim(moved, width, fine_nodes, fine_weights, scratch, forces, no_slopes)
            before[row, 0], before[row, 1:] = angle, forces
            trial = angle * (target / forces[0]) ** (1.0 / growth[row]) if forces[0] > 0.0 else angle
            if bracket[row, 0] < trial < bracket[row, 1]:
                _turn(field, power, trial / start, moved)
        for f in range(field.size):
            contact[row, f] = moved[f]


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(field, power, ratio, moved):
    """Move a contact (f,) to another entry angle, given its ratio to the present one."""
    for f in range(field.size):
        if power[f] == 1.0:
            moved[f] = field[f] * ratio
        elif power[f] != 0.0:
            moved[f] = field[f] * ratio ** power[f]
