"""Which stretches of a class are places of their own, and which say several times over what one place is like.

A class's mean and scatter are estimated from places that differ (`posterior`). Where a stretch of a drive was cut, its
pieces are neighbours on one ground, and cutting finer must not add places. Nor does an estimate whose misfit says that
the textbook's form does not hold: its error is shared by others like it. Such are left out where others fit, and are
one place together where none does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..framework.core.soil import WRONG_FORM
from .observations import SoilObservation

Weighted = tuple[SoilObservation, float]
"""A stretch with an estimate, and the probability that it was of the class [-]."""


def as_places(stretches: Sequence[Weighted]) -> list[Weighted]:
    """Put together what the stretches of one class say of one place, in the order of a drive as they are given."""
    pieces: list[list[Weighted]] = []
    for each in stretches:
        if pieces and _goes_on(pieces[-1][-1][0], each[0]):
            pieces[-1].append(each)
        else:
            pieces.append([each])
    places = [_together(_fitting(each) or each) for each in pieces]
    return _fitting(places) or [_together(places)]


def _fitting(stretches: list[Weighted]) -> list[Weighted]:
    """Those on which the textbook's form holds, or was not tested."""
    return [each for each in stretches if each[0].estimate is not None and not each[0].estimate.misfit > WRONG_FORM]


def _goes_on(before: SoilObservation, after: SoilObservation) -> bool:
    """Say whether a stretch begins where the one before ends: nothing but a cut is between them."""
    return before.end_s == after.start_s


def _together(pieces: Sequence[Weighted]) -> Weighted:
    """One estimate of what pieces say of one place: any of them may be right, the sooner the better it knows.

    Mean and covariance are those of a mixture, so that pieces that differ widen it and no number of them narrows it.
    """
    if len(pieces) == 1:
        return pieces[0]
    estimates = [soil.estimate for soil, _ in pieces if soil.estimate is not None]
    means = np.array([estimate.mean_c_tan_phi for estimate in estimates])
    noise = np.array([estimate.covariance_c_tan_phi for estimate in estimates])
    size = np.sqrt(np.maximum(np.linalg.det(noise), 1e-300))
    share = size.min() / size
    share /= share.sum()
    mean = share @ means
    away = means - mean
    covariance = np.einsum("j,jab->ab", share, noise + away[:, :, None] * away[:, None, :])
    best, probability = pieces[int(np.argmax(share))]
    assert best.estimate is not None
    stresses = np.array([soil.normal_stress_Pa for soil, _ in pieces])
    low, high = np.fmin.reduce(stresses[:, 0]), np.fmax.reduce(stresses[:, 1])
    estimate = replace(best.estimate, mean_c_tan_phi=mean, covariance_c_tan_phi=covariance)
    return replace(best, estimate=estimate, normal_stress_Pa=(float(low), float(high))), probability
