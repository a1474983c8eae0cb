"""PostGIS: the spatial index, the views, and servers that have not got it."""

from __future__ import annotations

import uuid
from collections.abc import Iterator

import numpy as np
import pytest
from bevameter import TerrainDatabase
from bevameter.database.check import check
from bevameter.database.info import info
from bevameter.database.maintenance import Migrated, migrate
from bevameter.database.schema import REVISIONS
from bevameter.framework.cli.main import app
from sqlalchemy import Engine, create_engine, event, make_url, text
from typer.testing import CliRunner


@pytest.fixture
def administrator(server) -> Iterator[Engine]:
    """Connections to a new database as its administrator; PostGIS can be installed there."""
    engine = create_engine(make_url(server).set(drivername="postgresql+psycopg"))
    with engine.connect() as connection:
        if not connection.execute(text("SELECT 1 FROM pg_available_extensions WHERE name = 'postgis'")).scalar():
            pytest.skip("no PostGIS here")
    yield engine
    engine.dispose()


def rows(engine: Engine, statement: str) -> list[tuple]:
    with engine.connect() as connection:
        return [tuple(row) for row in connection.execute(text(statement))]


def test_a_gis_sees_what_is_in_use(server, administrator, drive_with_soil, make):
    replaced = make.drive("d1", make.seen([(9, 9)], [[1.0, 0.0]]), model="older")
    with TerrainDatabase(server) as database:
        database.add_drive(replaced)
        database.add_drive(drive_with_soil)
        tiny = make.seen([(3, -4)], [[1e-39, 1.0]], cell_size_m=0.25, quality=[0.5])
        database.add_drive(make.drive("d2", tiny, start_time=None))
    assert info(server).spatial_index is True
    seen = rows(
        administrator,
        "SELECT site, drive, class, probability, quality, seen_at, ST_AsText(geom), cell_size_m FROM gis_terrain "
        "WHERE sense = 'fused' ORDER BY drive, seen_at",
    )
    assert [row[2] for row in seen] == ["sand", "clay", None, "asphalt", "sand"]
    assert seen[3][:2] == ("quarry", "drive d1")
    np.testing.assert_allclose([row[3] for row in seen if row[3] is not None], [1.0, 1.0, 0.9, 1.0], rtol=1e-6)
    assert (seen[1][5] - make.START).total_seconds() == 1.0
    assert [row[6] for row in seen] == [
        "POINT(0.25 0.25)", "POINT(0.75 0.25)", "POINT(1.25 0.25)", "POINT(-1.25 -0.75)", "POINT(0.875 -0.875)",
    ]  # fmt: skip
    assert (seen[4][4], seen[4][5], seen[4][7]) == (0.5, None, 0.25)
    soils = rows(administrator, 'SELECT class, probability, "c_Pa", ST_AsText(geom) FROM gis_soil ORDER BY "c_Pa"')
    assert len(soils) == len(drive_with_soil.soils)
    assert soils[0] == ("sand", 1.0, 500.0, "POINT(1 2)")


def test_a_part_of_a_large_site_is_read_by_the_index(server, administrator, make):
    side = 150
    cells = [(x, y) for x in range(side) for y in range(side)]
    with TerrainDatabase(server) as database:
        database.add_drive(make.drive("d1", make.seen(cells, [[0.25, 0.75]] * len(cells))))
        with administrator.begin() as connection:
            connection.execute(text("ANALYZE"))
        asked = []
        event.listen(database._engine, "before_cursor_execute", lambda *given: asked.append(given[2:4]))
        assert len(database.snapshot(bounds=(10.1, 10.1, 12.4, 12.4)).cells.key) == 25
    ((statement, parameters),) = [each for each in asked if "geom" in each[0] and "probabilities" in each[0]]
    with administrator.connect() as connection:
        plan = "\n".join(connection.exec_driver_sql(f"EXPLAIN {statement}", parameters).scalars())
    assert "ix_terrain_observation_geom" in plan
    assert "Seq Scan on terrain_observation" not in plan


@pytest.fixture
def ordinary(server, administrator) -> Iterator[str]:
    """URL of the same database for a user who may make tables, and no extension."""
    name = f"rover_{uuid.uuid4().hex}"
    with administrator.begin() as connection:
        connection.execute(text(f"CREATE ROLE {name} LOGIN"))
        connection.execute(text(f"GRANT CREATE, USAGE ON SCHEMA public TO {name}"))
    yield make_url(server).set(username=name).render_as_string(hide_password=False)
    administrator.dispose()
    with administrator.begin() as connection:
        connection.execute(text(f"DROP OWNED BY {name} CASCADE"))
        connection.execute(text(f"DROP ROLE {name}"))


def test_without_postgis_all_else_works_and_migrate_adds_it_later(ordinary, administrator, drive_with_soil, make):
    with TerrainDatabase(ordinary) as database:
        database.add_drive(drive_with_soil)
        before = database.snapshot(bounds=(0, 0, 1, 1)).along([[0.1, 0.1], [0.6, 0.1]]).shear_strength_lower.tolist()
    assert info(ordinary).spatial_index is False
    assert "MB, no spatial index" in CliRunner().invoke(app, ["db", "info", ordinary]).stdout
    assert migrate(ordinary) == Migrated(REVISIONS[-1], REVISIONS[-1], None, spatial_index_added=False)
    with administrator.begin() as connection:
        connection.execute(text("CREATE EXTENSION postgis"))
    assert info(ordinary).spatial_index is False
    assert CliRunner().invoke(app, ["db", "migrate", ordinary]).stdout == "spatial index added\n"
    assert "nothing to do" in CliRunner().invoke(app, ["db", "migrate", ordinary]).stdout
    assert info(ordinary).as_dict()["spatial_index"] is True
    with TerrainDatabase(ordinary) as database:
        database.add_drive(make.drive("d2", make.seen([(8, 8)], [[0.1, 0.9]])))
        assert rows(administrator, "SELECT count(*) FROM terrain_observation WHERE geom IS NULL") == [(0,)]
        view = database.snapshot(bounds=(0, 0, 1, 1))
        assert view.along([[0.1, 0.1], [0.6, 0.1]]).shear_strength_lower.tolist() == before
    assert check(ordinary).sound
