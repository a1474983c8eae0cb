"""How fast a map of a million cells is drawn, layer by layer, and how soon the pages' code is there.

Run with ``pytest tests/benchmarks/test_view_speed.py -m "" --benchmark-only``.
"""

from __future__ import annotations

import subprocess
import sys
from types import MappingProxyType

import numpy as np
import pytest

pytest.importorskip("pytest_benchmark")
try:
    import bokeh  # noqa: F401
    import datashader  # noqa: F401
except ModuleNotFoundError:
    pytest.skip("the extra view is not installed", allow_module_level=True)

from bevameter import SoilEstimate
from bevameter.database.belief import Cells
from bevameter.database.observations import SoilObservation
from bevameter.database.posterior import class_soils
from bevameter.database.snapshot import Snapshot
from bevameter.framework.core.pooling import cell_keys
from bevameter.framework.core.soil import Quantity
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.framework.view.layers import LAYERS, Question, layer
from bevameter.framework.view.raster import image_of

CLASSES = ("clay", "grass", "gravel", "loam", "sand")
SIDE = 1000
SIZE = 900, 600
ROVER = Vehicle(name="rover", wheels=(Wheel(radius_m=0.15, width_m=0.12),))
WHOLE, PART = (0.0, 0.0, SIDE, SIDE), (400.0, 400.0, 550.0, 500.0)
ALLOWED_S = 0.2
"""What a user takes for at once."""


@pytest.fixture(scope="module")
def view() -> Snapshot:
    """A thousand by a thousand cells of five classes, four of them with soil."""
    rng = np.random.default_rng(7)
    x, y = (each.ravel() for each in np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij"))
    key = cell_keys(np.column_stack([x, y]))
    m = len(key)
    probability = rng.dirichlet(np.full(len(CLASSES), 0.1), m)
    unknown = rng.random(m) < 0.05
    probability[unknown] = np.nan
    cells = Cells(
        key, probability, rng.uniform(1.6e9, 1.7e9, m), np.ones(m, dtype=np.int32), unknown.astype(np.int32),
        ("", "too dark"),
    )  # fmt: skip
    measured = class_soils([stretch(name, index) for index, name in enumerate((CLASSES[:3] + CLASSES[4:]) * 5)])
    return Snapshot("site", 0.5, CLASSES, cells, MappingProxyType(measured), 1)


def stretch(name: str, index: int) -> SoilObservation:
    """Ten seconds on ground of a class."""
    rest = {
        "k_m": Quantity(0.02, 0.002, 0.016, 0.024), "stiffness_Pa": Quantity(8e5, 4e4, 7e5, 9e5),
        "n": Quantity(1.0, 0.03, 0.9, 1.1),
    }  # fmt: skip
    mean = np.array([500.0 + 20.0 * index, 0.5 + 0.005 * index])
    estimate = SoilEstimate(rest, mean, np.diag([50.0**2, 0.02**2]), {}, (), {}, "", "ml", ("load_N",), 100, 1.0)
    return SoilObservation(20.0 * index, 20.0 * index + 10.0, 0, 0, {name: 1.0}, estimate, (5e3, 3e4), 80.0)


@pytest.mark.parametrize("part", [WHOLE, PART], ids=["whole site", "near"])
@pytest.mark.parametrize("name", LAYERS)
def test_draw(benchmark, view, name, part):
    """Drawing a map of a million cells, as after a zoom."""
    shown = layer(view, name, Question(vehicle=ROVER))
    columns, rows = np.divmod(np.arange(SIDE * SIDE), SIDE)

    def draw():
        return image_of(shown, view.class_names, columns, rows, part, SIZE)

    assert draw().cells == (2 if part is WHOLE else 1)
    benchmark(draw)
    if benchmark.enabled:
        assert benchmark.stats.stats.median < ALLOWED_S


@pytest.mark.parametrize("name", LAYERS)
def test_layer(benchmark, view, name):
    """The numbers of a million cells, as after another layer is chosen."""
    found = benchmark.pedantic(lambda: layer(view, name, Question(vehicle=ROVER)), rounds=1)
    assert len(found.values) == SIDE**2


def test_start(benchmark):
    """Importing the server of pages."""
    command = [sys.executable, "-c", "import bevameter.framework.view.start"]
    benchmark.pedantic(lambda: subprocess.run(command, check=True), rounds=3, warmup_rounds=1)
