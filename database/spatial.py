"""Places for PostGIS, on PostgreSQL servers that have it: a spatial index, and views that a GIS opens as they are.

A point is stored with each look, the centre of its cell, and one with each stretch, in metres of the site's frame (SRID
0: no place on the Earth). It follows from the row and its drive, and the server itself computes it, whoever inserts.
Squares would take twice as much room, and three times as long to insert as rows without a place; points take two times.
"""

from __future__ import annotations

from sqlalchemy import ColumnElement, Connection, func, literal_column, select, text
from sqlalchemy.exc import DBAPIError

from .tables import TerrainRow

INDEX = f"ix_{TerrainRow.__tablename__}_geom"
"""Name of the spatial index of looks."""

_REFUSED = ("42501", "0A000", "58P01", "42704")
"""States of SQL that say that PostGIS may not or cannot be used: privilege, support, file or type is lacking."""

_STATEMENTS = (
    "ALTER TABLE terrain_observation ADD COLUMN geom geometry(Point)",
    """
    CREATE OR REPLACE FUNCTION bevameter_place_look() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        SELECT ST_MakePoint((NEW.cell_x + 0.5) * cell_size_m, (NEW.cell_y + 0.5) * cell_size_m) INTO NEW.geom
        FROM drive WHERE id = NEW.drive_id;
        RETURN NEW;
    END $$
    """,
    """
    CREATE TRIGGER bevameter_place_look BEFORE INSERT ON terrain_observation
    FOR EACH ROW EXECUTE FUNCTION bevameter_place_look()
    """,
    """
    UPDATE terrain_observation
    SET geom = ST_MakePoint((cell_x + 0.5) * cell_size_m, (cell_y + 0.5) * cell_size_m)
    FROM drive WHERE drive.id = drive_id
    """,
    "CREATE INDEX ix_terrain_observation_geom ON terrain_observation USING gist (geom)",
    """
    ALTER TABLE soil_observation
    ADD COLUMN geom geometry(Point) GENERATED ALWAYS AS (ST_MakePoint(x_m, y_m)) STORED
    """,
    "CREATE INDEX ix_soil_observation_geom ON soil_observation USING gist (geom)",
    # Of each recording the processing that was imported last, as `drive_rows.drive_rows` has it.
    """
    CREATE VIEW gis_drive AS
    SELECT DISTINCT ON (drive.recording_digest) drive.*
    FROM drive JOIN drive_import ON drive_import.drive_id = drive.id
    ORDER BY drive.recording_digest, drive_import.imported_at DESC, drive.id DESC
    """,
    # Probabilities are little-endian float32, and of two that are not negative the greater has the greater bits.
    """
    CREATE VIEW gis_terrain AS
    SELECT look.id, drive.site, drive.name AS drive, look.sense, best.class, best.probability, look.quality,
        drive.start_time + look.time_s * interval '1 second' AS seen_at, drive.cell_size_m, look.geom
    FROM terrain_observation AS look
    JOIN gis_drive AS drive ON drive.id = look.drive_id
    LEFT JOIN LATERAL (
        SELECT drive.classes ->> number AS class, CASE WHEN bits < 8388608 THEN 0
            ELSE (1 + (bits & 8388607) / 8388608.0) * power(2.0, (bits >> 23) - 127) END::real AS probability
        FROM generate_series(0, least(json_array_length(drive.classes), length(look.probabilities) / 4) - 1) AS number,
            LATERAL (
                SELECT ((get_byte(look.probabilities, 4 * number + 3) & 127) << 24)
                    | (get_byte(look.probabilities, 4 * number + 2) << 16)
                    | (get_byte(look.probabilities, 4 * number + 1) << 8)
                    | get_byte(look.probabilities, 4 * number) AS bits
            ) AS read
        ORDER BY bits DESC, number LIMIT 1
    ) AS best ON NOT look.unknown
    """,
    """
    CREATE VIEW gis_soil AS
    SELECT stretch.id, drive.site, drive.name AS drive, best.class, best.probability, stretch."c_Pa", stretch.tan_phi,
        stretch.gate_reason, drive.start_time + stretch.start_s * interval '1 second' AS began_at,
        drive.start_time + stretch.end_s * interval '1 second' AS ended_at, stretch.geom
    FROM soil_observation AS stretch
    JOIN gis_drive AS drive ON drive.id = stretch.drive_id
    LEFT JOIN LATERAL (
        SELECT key AS class, value::float8 AS probability FROM json_each_text(stretch.class_probabilities)
        ORDER BY value::float8 DESC, key LIMIT 1
    ) AS best ON true
    """,
)


def has_spatial_index(connection: Connection) -> bool:
    """Whether the database has a spatial index that queries can use."""
    if connection.dialect.name != "postgresql":
        return False
    query = select(func.to_regclass(INDEX).is_not(None) & func.to_regtype("geometry").is_not(None))
    return connection.execute(query).scalar_one()


def add_spatial_index(connection: Connection) -> None:
    """Add points, their indices and the views where PostGIS is or may be installed; elsewhere nothing changes.

    The caller sees to it that no second process does the same meanwhile.
    """
    if connection.dialect.name != "postgresql" or has_spatial_index(connection):
        return
    try:
        with connection.begin_nested():
            if connection.execute(text("SELECT to_regtype('geometry') IS NULL")).scalar_one():
                connection.execute(text("CREATE EXTENSION postgis"))
            for statement in _STATEMENTS:
                connection.execute(text(statement))
    except DBAPIError as error:
        if getattr(error.orig, "sqlstate", None) not in _REFUSED:
            raise


def lies_within(box: tuple[float, float, float, float]) -> ColumnElement[bool]:
    """Say in SQL that a look's cell has its centre between corners x0, y0, x1, y1 [m]; by the spatial index."""
    return literal_column(f"{TerrainRow.__tablename__}.geom").op("&&", is_comparison=True)(func.ST_MakeEnvelope(*box))
