"""Entry angle at which the soil carries the load: the one root finder that every wheel model uses.

Between two integrations of all stresses each field of a contact is taken to follow a power of the entry angle. That is
exact for what does not change (0) and for angles in a fixed proportion (1), so that nearly all models are solved by it;
the others are laid out again at the angle found, and the search continues.
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
"""Entry angles are sought from here on [rad]."""

LARGEST_ENTRY_ANGLE = 1.9
"""Entry angles beyond this [rad] mean a wheel buried above its axle: the load is not carried."""

IN_PROPORTION = np.zeros(len(FIELDS))
IN_PROPORTION[[THETA_1, THETA_2, THETA_M]] = 1.0
"""Powers (f,) of the entry angle that the fields follow where only the angles change, in proportion."""

EXACT = 1e-10
"""Relative error of the load at which the search ends."""

CORRECTABLE = 2e-4
"""The same where derivatives are wanted: a linear correction by these leaves about the square of it."""

_SECANT, _LAST = 3e-6, 0.1
"""Relative error of the load that a secant step makes up for without an integration after it, which leaves the product
of the errors that it is drawn through, and the share of the step before that it has at most [-]."""

_ITERATIONS, _PATIENCE = 40, 8
"""Steps at most, and those after which a bracket has to shrink by half."""

_NEAR = 1e-3
"""Relative error of the load that the coarse rule leaves, and share of an error that a search from near leaves [-]."""

_STRAIGHT = 0.1
"""Relative error of the load from which on a step by the slopes is not trusted [-]."""

_GROWTHS = 0.2, 20.0
"""Powers of the entry angle between which the load is taken to grow."""

_STEP = 1e-5
_ROUNDING = 1e-9
"""Relative difference up to which fields do follow the powers that they were taken to follow [-]."""


@dataclass(frozen=True)
class Equilibrium:
    """Contacts (n, f) that carry their load, their forces W [N], T [N m], DP [N] (n, 3) and derivatives of these by
    the fields (n, 3, 21) where they were wanted; and the power of the entry angle with which the load grows (n,). Rows
    whose load is not carried are NaN.
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
        Where the search starts, columns as `fields.FIELDS`.
    load_N : (n,)
        [N].
    width_m
        Of the wheel [m].
    lay_out
        Gives the contact (n, f) at entry angles (n,); where absent theta_2 and theta_m stay in proportion to theta_1,
        and nothing else changes.
    growth : (n,), optional
        Power of the entry angle with which the load grows, where it is known.
    near
        The contact is taken to carry about its load: it is integrated before anything is sought.
    sloped
        Whether derivatives of the forces are wanted. The contact then carries its load but for `CORRECTABLE`, by the
        quick rule, else for `EXACT`, by the fine one.
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
            # Where fields have not followed their powers the first two forces are not those of one contact.
            tolerance = np.where(np.isfinite(before[:, 1]), _SECANT if exact or iteration else EXACT, EXACT)
        off &= ~(np.abs(forces[:, 0] - load) <= tolerance * load)
        if not off.any():
            break
    lost = ~(np.abs(forces[:, 0] - load) <= tolerance * load)
    if not sloped:
        # The last secant step needs no further integration.
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
    """Powers (n, f) of the entry angle that the fields of a contact follow near it; zero where they do not."""
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
    """Return whether contacts (n, f) differ by more than a share of what they are."""
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
    """Move the contacts (n, f) that are `off` (n,) to where they carry their load, but for little.

    They carry it by a coarse rule first. Forces (n, 3) that are `known` of a contact where it is narrow its `bracket`
    (n, 2), and correct that rule by a factor; where none are known one step by the fine rule follows. The angle and the
    forces that the move was computed from are left in `before` (n, 4). Where brackets are to `halve`,
    contacts go to the middle of theirs. Contacts that carry too little, or too much, at either end of what entry angles
    may be are given up.
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
    """Move a contact (f,) to another entry angle, whose ratio to the present one is given."""
    for f in range(field.size):
        if power[f] == 1.0:
            moved[f] = field[f] * ratio
        elif power[f] != 0.0:
            moved[f] = field[f] * ratio ** power[f]
