"""How fast a planner's questions are answered: run with ``pytest tests/benchmarks --benchmark-only``."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import ClassEvidence, SoilEstimate
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.database.snapshot import Snapshot

pytest.importorskip("pytest_benchmark")

CLASSES = ("clay", "grass", "gravel", "loam", "sand")


@pytest.fixture(scope="module")
def view() -> Snapshot:
    """100 m x 100 m at 0.25 m, five classes with soil."""
    rng = np.random.default_rng(5)
    cell_x, cell_y = (part.ravel() for part in np.meshgrid(np.arange(400), np.arange(400)))
    m = len(cell_x)
    evidence = ClassEvidence(CLASSES, rng.dirichlet(np.full(5, 0.3), m), rng.random(m), np.zeros(m, bool), ((),) * m)
    terrain = TerrainObservations(0.25, cell_x, cell_y, np.zeros(m), np.full(m, "fused"), evidence)
    soils = []
    for index in range(50):
        mean = np.array([500.0 + 100.0 * (index % 5), 0.5 + 0.01 * (index // 5)])
        estimate = SoilEstimate({}, mean, np.diag([50.0**2, 0.02**2]), {}, (), {}, "", "ml", ("load_N",), 100, 1.0)
        soils.append(SoilObservation(index, index + 1, 0, 0, {CLASSES[index % 5]: 1.0}, estimate, (5e3, 3e4), 80.0))
    return Snapshot.derive("site", [Drive("d", "d", "site", "v", None, {}, "m", terrain, tuple(soils))])


@pytest.mark.parametrize("places", [1, 100, 10_000])
def test_along(benchmark, view, places):
    path = np.random.default_rng(6).uniform(0.0, 100.0, (places, 2))
    answer = benchmark(lambda: view.along(path, normal_stress=20e3, confidence=0.95))
    assert answer.known.all()


def test_box(benchmark, view):
    assert len(benchmark(lambda: view.box(40.0, 40.0, 50.0, 50.0))) == 1600
