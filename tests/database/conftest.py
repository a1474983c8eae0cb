"""Builders of drives for the tests of the database."""

from __future__ import annotations

import functools
import math
import os
import shutil
import subprocess
import tempfile
import uuid
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from bevameter import ClassEvidence, SoilEstimate
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.framework.core.soil import Quantity, ShearStrength
from sqlalchemy import create_engine, make_url, text

START = datetime(2026, 11, 1, 12, 0, tzinfo=UTC)


def quantity(value: float, sd: float) -> Quantity:
    return Quantity(value, sd, value - 1.96 * sd, value + 1.96 * sd)


def estimate(c_Pa: float = 1000.0, tan_phi: float = 0.6, *, sd: tuple[float, float] = (50.0, 0.02)) -> SoilEstimate:
    covariance = np.array([[sd[0] ** 2, -0.5 * sd[0] * sd[1]], [-0.5 * sd[0] * sd[1], sd[1] ** 2]])
    return SoilEstimate(
        parameters={
            "c_Pa": quantity(c_Pa, sd[0]),
            "phi_rad": quantity(math.atan(tan_phi), sd[1] / (1 + tan_phi**2)),
            "k_m": quantity(0.025, 0.002),
            "stiffness_Pa": quantity(8e5, 4e4),
            "n": quantity(1.0, 0.03),
        },
        mean_c_tan_phi=np.array([c_Pa, tan_phi]),
        covariance_c_tan_phi=covariance,
        correlation={"c_Pa,phi_rad": -0.5},
        shear_strength=(ShearStrength(2e4, c_Pa + 2e4 * tan_phi, 1.0, 2.0),),
        separable={"c_Pa": True, "phi_rad": True, "k_m": True, "stiffness_Pa": True, "n": True},
        advice="",
        method="ml",
        channels=("load_N", "torque_Nm"),
        n=100,
        misfit=1.0,
    )


def soil(
    class_probabilities: dict[str, float], c_Pa: float = 1000.0, tan_phi: float = 0.6, at_s: float = 0.0, **options
) -> SoilObservation:
    return SoilObservation(
        at_s, at_s + 5.0, 1.0, 2.0, class_probabilities, estimate(c_Pa, tan_phi), (5e3, 3e4), 80.0, **options
    )


def seen(
    cells: list[tuple[int, int]],
    probabilities: list[list[float]],
    *,
    classes: tuple[str, ...] = ("clay", "sand"),
    quality: list[float] | None = None,
    unknown: list[bool] | None = None,
    reasons: list[tuple[str, ...]] | None = None,
    sense: str = "fused",
    cell_size_m: float = 0.5,
) -> TerrainObservations:
    m = len(cells)
    evidence = ClassEvidence(
        classes,
        np.array(probabilities, dtype=float).reshape(m, len(classes)),
        np.ones(m) if quality is None else np.array(quality),
        np.zeros(m, dtype=bool) if unknown is None else np.array(unknown),
        tuple(reasons) if reasons is not None else ((),) * m,
    )
    place = np.array(cells, dtype=np.int64).reshape(m, 2)
    return TerrainObservations(
        cell_size_m, place[:, 0], place[:, 1], np.arange(m, dtype=float), np.full(m, sense), evidence
    )


def drive(
    digest: str = "d1",
    terrain: TerrainObservations | None = None,
    soils: tuple[SoilObservation, ...] = (),
    *,
    site: str = "quarry",
    model: str = "m1",
    start_time: datetime | None = START,
) -> Drive:
    terrain = seen([(0, 0), (1, 0)], [[0.1, 0.9], [0.98, 0.02]]) if terrain is None else terrain
    return Drive(digest, f"drive {digest}", site, "rover", start_time, {"camera": model}, "method 1", terrain, soils)


class Make:
    """The builders above, for tests that cannot import from here."""

    START = START
    estimate = staticmethod(estimate)
    soil = staticmethod(soil)
    seen = staticmethod(seen)
    drive = staticmethod(drive)
    quantity = staticmethod(quantity)


@pytest.fixture(scope="session")
def make() -> type[Make]:
    return Make


@pytest.fixture
def drive_with_soil(make) -> Drive:
    """Two classes with soil, one cell of each, one unknown cell, and one cell of a class without soil."""
    terrain = make.seen(
        [(0, 0), (1, 0), (2, 0), (-3, -2)],
        [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1 / 3, 1 / 3, 1 / 3], [0.9, 0.05, 0.05]],
        classes=("asphalt", "clay", "sand"),
        unknown=[False, False, True, False],
        reasons=[(), (), ("too dark", "blurred"), ()],
    )
    soils = tuple(
        make.soil({name: 1.0}, c + 20.0 * index, t + 0.005 * index, at_s=10.0 * index)
        for name, c, t in (("clay", 3000.0, 0.4), ("sand", 500.0, 0.6))
        for index in range(4)
    )
    return make.drive(terrain=terrain, soils=soils)


@pytest.fixture(scope="session")
def postgres():
    """URL of a PostgreSQL server's database `postgres`: the one that BEVAMETER_TEST_POSTGRES names, or a throw-away one
    where it is installed.
    """
    pytest.importorskip("psycopg")
    given = os.environ.get("BEVAMETER_TEST_POSTGRES")
    if given:
        yield given
        return
    if shutil.which("initdb") is None or shutil.which("pg_ctl") is None or os.name == "nt":
        pytest.skip("no PostgreSQL server here")
    with tempfile.TemporaryDirectory() as folder:
        run = functools.partial(subprocess.run, cwd=folder, capture_output=True)
        if os.geteuid() == 0:  # which PostgreSQL refuses to run as
            try:
                shutil.chown(folder, "postgres")
            except LookupError:
                pytest.skip("PostgreSQL does not run as root, and there is no user postgres")
            run = functools.partial(run, user="postgres")
        data = Path(folder) / "data"
        made = run(["initdb", "-D", data, "-A", "trust", "-U", "me", "-E", "UTF8"])
        assert made.returncode == 0, made.stderr.decode(errors="replace")
        options = f"-k {folder} -c listen_addresses='' -c fsync=off"
        started = run(["pg_ctl", "-D", data, "-w", "-l", Path(folder) / "log", "-o", options, "start"])
        assert started.returncode == 0, started.stderr.decode(errors="replace")
        try:
            yield f"postgresql://me@/postgres?host={folder}"
        finally:
            run(["pg_ctl", "-D", data, "-m", "immediate", "stop"])


@pytest.fixture
def server(postgres):
    """URL of a new, empty database on a PostgreSQL server."""
    url = make_url(postgres).set(drivername="postgresql+psycopg")
    name = f"test_{uuid.uuid4().hex}"
    engine = create_engine(url, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    yield url.set(drivername="postgresql", database=name).render_as_string(hide_password=False)
    with engine.connect() as connection:
        connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))
    engine.dispose()
