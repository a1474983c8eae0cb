"""Gross errors that show in what a fit leaves: values that stand alone beside their neighbours, or beside all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from sklearn.neighbors import NearestNeighbors

from ...noise import NORMAL_MAD, from_running_median
from .fitting import Fitted
from .samples import ANSWERS, Samples

_FEWEST = 20
"""Trials by which the scatter among trials of the same conditions is told."""

_NEAR, _ENOUGH, _ALIKE = 4, 2, 0.2
"""Nearest trials looked at, how many of them have to be near, and how near that is, in standard deviations of the
conditions [-]. Of two alone nobody knows which is wrong."""

_ALONE, _FEW = 12.0, 0.05
"""Standard deviations of that scatter from which on a value stands alone, and the largest share of a channel's values
that do where they are errors [-], the load's beside those of each answer: of 146 of the study's tables two have more
than 0.03 of such trials, and are right with 0.05."""

_ISOLATED = 15.0
"""As much of the scatter about the median of neighbours in time: of the study's recordings looked at gross errors stood
out by 42 to 119 from what the textbook wheel leaves, nothing else by 10."""

_BESIDE = {True: "their neighbours in time, beside what a fit leaves", False: "trials of nearly the same conditions"}

_OUTLYING = 10.0
"""Standard deviations of what is left of the other trials from which on one stands alone, whatever its conditions [-]:
of the study's recordings looked at those with gross errors stood out by 13 to 67, no other by 5."""

_NEXT, _SLIGHT = 3, 3.0
"""Trials whose conditions are next to another's, and standard deviations from which on one lies off, too [-]."""

_BESIDE_JUMP = 5
"""Rows to either side of a jump."""


def without_gross_errors(samples: Samples, fitted: Fitted) -> Samples:
    """Blank values that lie far from a fit where their neighbours do not: in time or, of trials, in their conditions.

    A value that is grossly wrong is no ground that varies; beside a channel that is quick it shows only in what a fit
    leaves. Of trials two of nearly the same conditions have to agree against it.
    """
    if len(samples) < _FEWEST:
        return samples
    timed, most = samples.drive.timed, _FEW * len(samples)
    alike = None if timed else _alike(samples)
    if not timed and alike is None:
        return samples
    wrong = np.zeros(samples.measured.shape, dtype=bool)
    for position, channel in enumerate(samples.answers):
        residual = np.where(samples.seen[:, position], fitted.residuals[:, position], np.nan)
        away = from_running_median(residual, samples.drive.stretch) if alike is None else _from_alike(residual, *alike)
        with np.errstate(invalid="ignore"):
            if not (away > 0.0).any():
                continue
            far = away > (_ISOLATED if timed else _ALONE) * NORMAL_MAD * np.median(away[away > 0.0])
        if timed:
            far &= ~_beside_jumps(samples.measured[:, channel] - fitted.residuals[:, position])
        wrong[:, channel] = far & (far.sum() <= most)
    # Of a row in which nothing else is seen nobody knows whether the answers are wrong or its load is (`outlying`).
    wrong &= np.isfinite(np.where(wrong, np.nan, samples.measured)[:, ANSWERS]).any(axis=1, keepdims=True)
    count, measured = int(wrong.sum()), np.where(wrong, np.nan, samples.measured)
    if not count:
        return samples
    which = "1 value stands" if count == 1 else f"{count} values stand"
    note = f"{which} alone far from {_BESIDE[timed]}: taken for gross errors"
    return replace(samples, measured=measured, notes=(*samples.notes, note))


def _alike(samples: Samples) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Nearest trials of each (n, k), which of them have nearly the same conditions, and which trials (n,) have enough
    of these; nothing where too few have.
    """
    distance, near = NearestNeighbors(n_neighbors=_NEAR).fit(_conditions(samples)).kneighbors()
    alike = distance < _ALIKE
    judged = alike.sum(axis=1) >= _ENOUGH
    return (near, alike, judged) if judged.sum() >= _FEWEST else None


def _from_alike(residual: np.ndarray, near: np.ndarray, alike: np.ndarray, judged: np.ndarray) -> np.ndarray:
    """How far residuals (n,) lie from the median of them and of those of trials alike, NaN where that does not tell."""
    # With itself, or of two others a wrong one would pull the middle half way.
    group = np.column_stack([residual, np.where(alike, residual[near], np.nan)])
    middle = np.ma.filled(np.ma.median(np.ma.masked_invalid(group), axis=1), np.nan)
    return np.where(judged, np.abs(residual - middle), np.nan)


def _beside_jumps(predicted: np.ndarray) -> np.ndarray:
    """(n,) True for rows next to where a channel is predicted to jump: one that comes late is far off there. Rows in
    which it is not predicted are passed over, as of one that is read less often than others.
    """
    there = np.flatnonzero(np.isfinite(predicted))
    near = np.zeros(len(predicted), dtype=bool)
    if not len(there):
        return near
    steps = np.abs(np.diff(predicted[there], prepend=predicted[there[:1]]))
    jumps = np.flatnonzero(steps > _ISOLATED * NORMAL_MAD * np.median(steps))
    for away in range(-_BESIDE_JUMP, _BESIDE_JUMP + 1):
        near[there[np.clip(jumps + away, 0, len(there) - 1)]] = True
    return near


def outlying(samples: Samples, fitted: Fitted, already: int = 0) -> np.ndarray:
    """(n,) True for trials, few of each answer's and of the load's, that lie far from a fit where those of conditions
    next to theirs do not.

    A load that is grossly wrong makes all answers of its row so, and has no repeats to compare it with. Spared is what
    may be a real effect's: a slip beyond all others, and a trial towards which its neighbours lie off the same way.

    Parameters
    ----------
    samples, fitted
        Steady trials, and the fit that they are far from.
    already
        Trials left out before: with them a channel's are few.
    """
    none = np.zeros(len(samples), dtype=bool)
    if samples.drive.timed or len(samples) < _FEWEST:
        return none
    size = _sizes(np.where(samples.seen, fitted.innovations, np.nan))
    out = np.abs(size) > _OUTLYING
    far = np.any(out, axis=1)
    # Where several answers are off at once the load is wrong, or the slip: that is one value. An answer that is wrong
    # alone shows in the innovations of the others, too.
    several = np.sum(np.abs(_sizes(fitted.residuals)) > _OUTLYING, axis=1) > 1
    alone = np.bincount(np.argmax(np.abs(size), axis=1)[far & ~several], minlength=1)
    most = max(np.count_nonzero(far & several), np.max(alone))
    if not 0 < most <= max(_FEW * (len(samples) + already), 1.0) - already:
        return none
    distance, near = NearestNeighbors(n_neighbors=_NEXT).fit(_conditions(samples)).kneighbors()
    same = out[:, None] & (size[near] * np.sign(size)[:, None] > _SLIGHT)
    spared = np.any(same.any(axis=2) & (~far[near] | (distance < _ALIKE)), axis=1)
    slip = samples.drive.slip
    ends = [slip == end(slip) for end in (np.min, np.max)]
    spared |= np.any([at & (at.sum() == 1) for at in ends], axis=0)
    return far & ~spared


def _sizes(left: np.ndarray) -> np.ndarray:
    """What is left of answers (n, m), in standard deviations of most of it from its middle; 0 where none was seen."""
    away = left - np.nanmedian(left, axis=0)
    scale = NORMAL_MAD * np.nanmedian(np.abs(away), axis=0)
    return np.nan_to_num(away / np.where(scale > 0.0, scale, np.inf))


def _conditions(samples: Samples) -> np.ndarray:
    """Conditions of each trial (n, k), in standard deviations of each."""
    drive = samples.drive
    columns = [drive.load_N, drive.slip, drive.rim_speed_m_s, drive.pitch_rad, drive.pass_number]
    known = np.column_stack([each for each in columns if np.isfinite(each).all()])
    return (known - known.mean(axis=0)) / np.maximum(known.std(axis=0), 1e-12 * np.abs(known).max(axis=0) + 1e-300)
