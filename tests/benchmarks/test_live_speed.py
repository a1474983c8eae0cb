"""How long a drive's snapshot, its belief and its soil take while it goes on.

python -m pytest tests/benchmarks/test_live_speed.py --benchmark-only
"""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import ClassEvidence, TerrainDatabase
from bevameter.database.observations import Drive, TerrainObservations
from bevameter.framework.core.pooling import cells_of
from bevameter.framework.live.ground import GroundByNow
from bevameter.framework.live.site import SiteByNow
from bevameter.framework.sense_map import SenseMap

CELLS = 100_000
CLASSES = ("gravel", "loam", "sand")
SNAPSHOT_ALLOWED_S = 0.020
"""A new snapshot over so many cells, of which a drive has seen some hundreds since the last."""


def evidence(rng: np.random.Generator, n: int) -> ClassEvidence:
    return ClassEvidence(
        CLASSES, rng.dirichlet((1.0, 1.0, 1.0), n), rng.uniform(0.3, 1.0, n), np.zeros(n, bool), ((),) * n
    )


@pytest.fixture(scope="module")
def seen() -> SenseMap:
    """What a camera saw of 100,000 cells."""
    rng, seen = np.random.default_rng(0), SenseMap("camera")
    x, y = np.meshgrid(np.arange(500), np.arange(CELLS // 500))
    cells = np.column_stack([x.ravel(), y.ravel()])
    seen.add(cells, evidence(rng, CELLS), np.zeros(CELLS))
    seen.settle()
    return seen


def test_a_new_snapshot_over_100000_cells_takes_20_ms_at_most(benchmark, seen, tmp_path):
    drive = Drive("ab" * 32, "live", "field", "rover", None, {}, "m", TerrainObservations.nothing(0.5))
    site = SiteByNow(TerrainDatabase(tmp_path / "t.db"), drive, CLASSES)
    ground = GroundByNow([seen], 0.5)
    whole = np.column_stack([np.arange(CELLS) % 500, np.arange(CELLS) // 500])
    assert len(site.take_up(ground.belief(whole)).cells.key) == CELLS
    rng = np.random.default_rng(1)

    def half_a_second():
        """Five frames at 2 m/s, a hundred looks each."""
        cells = cells_of(rng.uniform(100.0, 104.0, 500), rng.uniform(50.0, 54.0, 500), 0.5)
        seen.add(cells, evidence(rng, 500), np.full(500, 1.0))
        return (np.unique(cells, axis=0),), {}

    snapshot = benchmark.pedantic(lambda cells: site.take_up(ground.belief(cells)), setup=half_a_second, rounds=40)
    assert len(snapshot.cells.key) == CELLS
    assert snapshot.at(102.0, 52.0).class_names == CLASSES
    if benchmark.enabled:
        assert benchmark.stats.stats.median < SNAPSHOT_ALLOWED_S
