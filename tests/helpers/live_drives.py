"""What two processings of one drive observed, compared."""

from __future__ import annotations

import numpy as np
import pytest


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
