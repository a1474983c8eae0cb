"""Drives that go on in tests, and what two processings of one drive observed, compared."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np
import pytest
from bevameter import LiveTraverse, Vehicle, Wheel
from bevameter.database.snapshot import Snapshot


def assert_same(one, other):
    """All that two drives observed, but for the rounding of sums."""
    assert len(one.terrain) == len(other.terrain)
    rows = [np.lexsort((each.terrain.cell_y, each.terrain.cell_x)) for each in (one, other)]
    for name in ("cell_x", "cell_y", "time_s"):
        a, b = (getattr(each.terrain, name)[row] for each, row in zip((one, other), rows, strict=True))
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9)
    for name in ("probabilities", "quality", "unknown"):
        a, b = (getattr(each.terrain.evidence, name)[row] for each, row in zip((one, other), rows, strict=True))
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9)
    assert len(one.soils) == len(other.soils)
    for a, b in zip(one.soils, other.soils, strict=True):
        assert (a.start_s, a.end_s, a.gate_reason) == (b.start_s, b.end_s, b.gate_reason)
        assert a.class_probabilities == pytest.approx(b.class_probabilities, abs=1e-9)
        assert (a.estimate is None) == (b.estimate is None)
        if a.estimate is not None:
            np.testing.assert_allclose(a.estimate.mean_c_tan_phi, b.estimate.mean_c_tan_phi, rtol=1e-9)
            np.testing.assert_allclose(a.estimate.covariance_c_tan_phi, b.estimate.covariance_c_tan_phi, rtol=1e-9)


def begun(recording, models, path, **options) -> LiveTraverse:
    return LiveTraverse(
        path, recording.vehicle, models=models, site=recording.site, name=recording.name,
        start_time=recording.start_time, lossless=True, horizon_s=0.05, **options,
    )  # fmt: skip


@dataclass
class Seen:
    """What a drive said of itself while it went on."""

    events: list = field(default_factory=list)
    ahead: list = field(default_factory=list)
    trust: list = field(default_factory=list)
    soils: list = field(default_factory=list)
    soils_on_the_way: dict = field(default_factory=dict)
    snapshot: Snapshot | None = None


def wait_for_soil(live, most_s=2.0):
    """Leave the threads the time that they have where a drive is not replayed as fast as possible."""
    until = time.monotonic() + most_s
    while time.monotonic() < until:
        soil, ground = live.soil(), live.under_wheels()
        if (
            soil is not None
            and ground is not None
            and soil.waiting == 0
            and min(soil.time_s, ground.time_s) > live._drive.intake.clock_s - 4.0
        ):
            return
        time.sleep(0.02)


def rover(**parts) -> Vehicle:
    return Vehicle(wheels=(Wheel(radius_m=0.2, width_m=0.1),), **parts)
