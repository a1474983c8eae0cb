"""How fast a planner's questions are answered, and what they cost by other means: raw SQL, an ORM, an array.

Run with ``pytest tests/benchmarks -m "" --benchmark-only``.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from bevameter import ClassEvidence, SoilEstimate, TerrainDatabase, Vehicle, Wheel
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.database.snapshot import Snapshot
from bevameter.database.tables import TerrainRow
from bevameter.framework.core.soil import Quantity
from sqlalchemy import Engine, create_engine, select
from sqlalchemy.orm import Session

pytest.importorskip("pytest_benchmark")

CLASSES = ("clay", "grass", "gravel", "loam", "sand")
CELL_SIZE_M, SIDE = 0.25, 400
PLACES = (1, 200, 10_000)
ROVER = Vehicle(wheels=(Wheel(radius_m=0.15, width_m=0.12),))


def drive(digest: str, rows: slice = slice(None)) -> Drive:
    """Some cells of 100 m x 100 m, five classes with soil."""
    rng = np.random.default_rng(5)
    cell_x, cell_y = (part.ravel()[rows] for part in np.meshgrid(np.arange(SIDE), np.arange(SIDE)))
    m = len(cell_x)
    evidence = ClassEvidence(CLASSES, rng.dirichlet(np.full(5, 0.3), m), rng.random(m), np.zeros(m, bool), ((),) * m)
    terrain = TerrainObservations(CELL_SIZE_M, cell_x, cell_y, np.zeros(m), np.full(m, "fused"), evidence)
    parameters = {
        "k_m": Quantity(0.02, 0.002, 0.016, 0.024), "stiffness_Pa": Quantity(8e5, 4e4, 7e5, 9e5),
        "n": Quantity(1.0, 0.03, 0.9, 1.1),
    }  # fmt: skip
    soils = []
    for index in range(50):
        mean = np.array([500.0 + 100.0 * (index % 5), 0.5 + 0.01 * (index // 5)])
        estimate = SoilEstimate(
            parameters, mean, np.diag([50.0**2, 0.02**2]), {}, (), {}, "", "ml", ("load_N",), 100, 1.0
        )
        soils.append(SoilObservation(index, index + 1, 0, 0, {CLASSES[index % 5]: 1.0}, estimate, (5e3, 3e4), 80.0))
    return Drive(digest, digest, "site", "v", None, {}, "m", terrain, tuple(soils))


@pytest.fixture(scope="module")
def view() -> Snapshot:
    return Snapshot.derive("site", [drive("d")])


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("speed") / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive("d"))
    with sqlite3.connect(path) as connection:
        connection.execute(
            "CREATE INDEX place ON terrain_observation (cell_x, cell_y)"
        )  # as who queries by place would
    return path


@pytest.fixture(scope="module")
def engine(file) -> Iterator[Engine]:
    engine = create_engine(f"sqlite:///{file}")
    yield engine
    engine.dispose()


def path_of(places: int) -> np.ndarray:
    return np.random.default_rng(6).uniform(0.0, CELL_SIZE_M * SIDE, (places, 2))


@pytest.mark.parametrize("places", PLACES)
def test_along(benchmark, view, places):
    """Class, strength and lower bound of places along a path."""
    path = path_of(places)

    def ask():
        ahead = view.along(path, normal_stress=20e3, confidence=0.95)
        return ahead.class_index, ahead.known, ahead.shear_strength, ahead.shear_strength_lower

    assert benchmark(ask)[1].all()


@pytest.mark.parametrize("places", PLACES[:2])
def test_raw_sql(benchmark, file, places):
    """Probabilities of places alone, by SQL, one statement a place."""
    connection, cells = sqlite3.connect(file), np.floor(path_of(places) / CELL_SIZE_M).astype(int).tolist()
    statement = "SELECT probabilities, quality FROM terrain_observation WHERE cell_x = ? AND cell_y = ?"
    assert len(benchmark(lambda: [connection.execute(statement, cell).fetchone() for cell in cells])) == places
    connection.close()


@pytest.mark.parametrize("places", PLACES[:2])
def test_orm(benchmark, engine, places):
    """Probabilities of places alone, by mapped objects."""
    cells = np.floor(path_of(places) / CELL_SIZE_M).astype(int).tolist()

    def ask():
        with Session(engine) as session:
            return [
                session.scalars(select(TerrainRow).where(TerrainRow.cell_x == x, TerrainRow.cell_y == y)).first()
                for x, y in cells
            ]

    assert all(benchmark(ask))


@pytest.mark.parametrize("places", PLACES)
def test_numpy_grid(benchmark, view, places):
    """Places in one array of known extent for each number, without reasons."""
    path = path_of(places)
    centres = (np.indices((SIDE, SIDE)).reshape(2, -1).T + 0.5) * CELL_SIZE_M
    whole = view.along(centres, normal_stress=20e3)
    columns = (whole.class_index, whole.known, whole.shear_strength, whole.shear_strength_lower)
    grids = [column.reshape(SIDE, SIDE) for column in columns]

    def ask():
        x, y = (path.T / CELL_SIZE_M).astype(int)
        return [grid[x, y] for grid in grids]

    assert benchmark(ask)[1].all()


def test_at(benchmark, view):
    """One place."""
    assert benchmark(lambda: view.at(50.1, 50.2).known)[0]


def test_box(benchmark, view):
    """A box of 1,600 cells."""
    assert len(benchmark(lambda: view.box(40.0, 40.0, 50.0, 50.0))) == 1600


def test_grid(benchmark, view):
    """One layer of the whole site as a raster."""
    side = CELL_SIZE_M * SIDE
    grid = benchmark(lambda: view.grid((0, 0, side, side), CELL_SIZE_M, ["shear_strength_lower"]))
    assert np.isfinite(grid.layers["shear_strength_lower"]).all()


@pytest.mark.parametrize(
    "ask",
    [lambda answer: answer.drawbar_pull(ROVER, 0.2), lambda answer: answer.mobility(ROVER)],
    ids=["drawbar_pull", "mobility"],
)
def test_wheels(benchmark, view, ask: Callable):
    """200 places, after the first call, whose mechanics is kept."""
    answer = view.along(path_of(200))
    assert ask(answer).known.all()
    benchmark(lambda: ask(answer))


def test_snapshot(benchmark, file):
    """Taking a snapshot of 160,000 cells."""
    with TerrainDatabase(file) as database:
        assert len(benchmark.pedantic(database.snapshot, rounds=3).cells.key) == SIDE**2


def test_reader(benchmark, tmp_path):
    """Bringing a snapshot of 40,000 cells up to date after a drive over 10,000 of them."""
    numbers = count()
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.add_drive(drive("d", slice(40_000)))
        reader = database.reader()
        reader.snapshot()

        def new() -> None:
            database.add_drive(drive(f"d{next(numbers)}", slice(10_000)))

        benchmark.pedantic(reader.snapshot, setup=new, rounds=5)
        assert reader.snapshot().drives == 1 + next(numbers)


def test_write(benchmark, tmp_path):
    """Storing 10,000 looks as one drive."""
    numbers = count()

    def new() -> tuple[tuple[Drive], dict]:
        return (drive(f"d{next(numbers)}", slice(10_000)),), {}

    with TerrainDatabase(tmp_path / "terrain.db") as database:
        added = benchmark.pedantic(database.add_drive, setup=new, rounds=5)
    assert added.new == 10_050
