"""Gross errors among steady trials: values that stand alone beside trials of nearly the same conditions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from sklearn.neighbors import NearestNeighbors

from .fitting import Fitted
from .samples import ANSWERS, Samples

_FEWEST = 20
"""Trials by which the scatter among trials of the same conditions is told."""

_NEAR, _ENOUGH, _ALIKE = 4, 2, 0.2
"""Nearest trials looked at, how many of them have to be near, and how near that is, in standard deviations of the
conditions [-]. Of two alone nobody knows which is wrong."""

_ALONE, _FEW = 12.0, 0.03
"""Standard deviations of that scatter from which on a value stands alone, and the largest share of a channel's values
that do where they are errors [-]."""

_NORMAL = 1.4826
"""Standard deviations of normal scatter in its median size [-]."""


def without_gross_errors(samples: Samples, fitted: Fitted) -> Samples:
    """Blank values of trials that lie far from a fit where two trials of nearly the same conditions do not.

    A repeat that is grossly wrong is no ground that varies. Recordings with time have neighbours in time for that.
    """
    if samples.drive.timed or len(samples) < _FEWEST:
        return samples
    distance, near = NearestNeighbors(n_neighbors=_NEAR).fit(_conditions(samples)).kneighbors()
    alike = distance < _ALIKE
    judged = alike.sum(axis=1) >= _ENOUGH
    if judged.sum() < _FEWEST:
        return samples
    measured, count = samples.measured.copy(), 0
    for position, channel in enumerate(samples.answers):
        residual = fitted.residuals[:, position]
        # With itself, or of two others a wrong one would pull the middle half way.
        group = np.column_stack([residual, np.where(alike, residual[near], np.nan)])[judged]
        middle = np.ma.filled(np.ma.median(np.ma.masked_invalid(group), axis=1), np.nan)
        away = np.abs(residual[judged] - middle)
        if not (away > 0.0).any():
            continue
        scale = _NORMAL * np.median(away[away > 0.0])
        alone = np.flatnonzero(judged)[away > _ALONE * scale]
        if len(alone) <= _FEW * len(samples):
            measured[alone, channel] = np.nan
            count += len(alone)
    left = np.isfinite(measured[:, ANSWERS]).any(axis=1)
    if not count or not left.all():
        return samples
    note = f"{count} values stand alone far from trials of nearly the same conditions: taken for gross errors"
    return replace(samples, measured=measured, notes=(*samples.notes, note))


def _conditions(samples: Samples) -> np.ndarray:
    """Conditions of each trial (n, k), in standard deviations of each."""
    drive = samples.drive
    columns = [drive.load_N, drive.slip, drive.rim_speed_m_s, drive.pitch_rad, drive.pass_number]
    known = np.column_stack([each for each in columns if np.isfinite(each).all()])
    return (known - known.mean(axis=0)) / np.maximum(known.std(axis=0), 1e-12 * np.abs(known).max(axis=0) + 1e-300)
