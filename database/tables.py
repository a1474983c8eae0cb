"""The tables of the terrain database: append-only observations and the drives that they came from.

Nothing derived is stored, with one exception: on PostgreSQL servers with PostGIS the server keeps with each row its
point (`spatial`), as only what is stored can be indexed. It follows from the row and its drive, is no column of these
tables, and goes into no answer: it says which rows to read.

Every row has an identity that follows from what it was made of (`Drive.id`, `ClassPhysics.id`), so that two databases
merge by set union.
"""

from __future__ import annotations

import uuid
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    ColumnElement,
    Connection,
    DateTime,
    Dialect,
    Double,
    ForeignKey,
    Index,
    Insert,
    Integer,
    LargeBinary,
    String,
    Table,
    Text,
    Uuid,
    null,
)
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeDecorator


class UtcDateTime(TypeDecorator[datetime]):
    """A moment in UTC, on databases with and without time zones."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Store UTC, without a zone where the database knows none."""
        if value is None:
            return None
        value = value.astimezone(UTC)
        return value.replace(tzinfo=None) if dialect.name == "sqlite" else value

    def process_result_value(self, value: Any | None, dialect: Dialect) -> datetime | None:
        """Give UTC back."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class Base(DeclarativeBase):
    """The tables' common base."""


class DriveRow(Base):
    """One recording, processed once.

    `classes` are the columns of the terrain observations' probabilities. `frame`: ``origin``, latitude, longitude and
    heading of the site's frame [deg], and ``offset``, x [m], y [m] and yaw [rad] of the recording's frame in it, as far
    as they are known.
    """

    __tablename__ = "drive"
    id: Mapped[uuid.UUID] = mapped_column(Uuid, primary_key=True)
    recording_digest: Mapped[str] = mapped_column(String(128), index=True)
    name: Mapped[str] = mapped_column(Text)
    site: Mapped[str] = mapped_column(Text, index=True)
    vehicle_name: Mapped[str] = mapped_column(Text)
    start_time: Mapped[datetime | None] = mapped_column(UtcDateTime)
    models: Mapped[dict[str, str]] = mapped_column(JSON)
    method: Mapped[str] = mapped_column(Text)
    cell_size_m: Mapped[float] = mapped_column(Double)
    classes: Mapped[list[str]] = mapped_column(JSON)
    frame: Mapped[dict[str, list[float]] | None] = mapped_column(JSON(none_as_null=True))


class ImportRow(Base):
    """When a drive was added to some database; of several (after a merge, or a return to it) the last counts."""

    __tablename__ = "drive_import"
    id: Mapped[uuid.UUID] = mapped_column(Uuid, primary_key=True)
    drive_id: Mapped[uuid.UUID] = mapped_column(ForeignKey("drive.id"), index=True)
    imported_at: Mapped[datetime] = mapped_column(UtcDateTime)


class TerrainRow(Base):
    """One look of one sense at one ground cell. `probabilities`: little-endian float32, one a class of the drive."""

    __tablename__ = "terrain_observation"
    __table_args__ = (Index("ix_terrain_observation_drive_sense", "drive_id", "sense"),)
    id: Mapped[uuid.UUID] = mapped_column(Uuid, primary_key=True)
    drive_id: Mapped[uuid.UUID] = mapped_column(ForeignKey("drive.id"))
    time_s: Mapped[float] = mapped_column(Double)
    cell_x: Mapped[int] = mapped_column(Integer)
    cell_y: Mapped[int] = mapped_column(Integer)
    sense: Mapped[str] = mapped_column(String(16))
    quality: Mapped[float] = mapped_column(Double)
    unknown: Mapped[bool]
    probabilities: Mapped[bytes] = mapped_column(LargeBinary)
    reasons: Mapped[str] = mapped_column(Text)


class SoilRow(Base):
    """The soil measured on one stretch. `estimate` holds all of it; the other columns are for queries in SQL."""

    __tablename__ = "soil_observation"
    id: Mapped[uuid.UUID] = mapped_column(Uuid, primary_key=True)
    drive_id: Mapped[uuid.UUID] = mapped_column(ForeignKey("drive.id"), index=True)
    start_s: Mapped[float] = mapped_column(Double)
    end_s: Mapped[float] = mapped_column(Double)
    x_m: Mapped[float | None] = mapped_column(Double)
    y_m: Mapped[float | None] = mapped_column(Double)
    class_probabilities: Mapped[dict[str, float]] = mapped_column(JSON)
    c_Pa: Mapped[float | None] = mapped_column(Double)
    tan_phi: Mapped[float | None] = mapped_column(Double)
    variance_c: Mapped[float | None] = mapped_column(Double)
    covariance_c_tan_phi: Mapped[float | None] = mapped_column(Double)
    variance_tan_phi: Mapped[float | None] = mapped_column(Double)
    normal_stress_low_Pa: Mapped[float | None] = mapped_column(Double)
    normal_stress_high_Pa: Mapped[float | None] = mapped_column(Double)
    load_N: Mapped[float | None] = mapped_column(Double)
    effects: Mapped[list[dict[str, Any]]] = mapped_column(JSON)
    gate_reason: Mapped[str] = mapped_column(Text)
    estimate: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


class PhysicsRow(Base):
    """An augmented simulator found on ground of a class. `site`: where it holds, empty for everywhere."""

    __tablename__ = "class_physics"
    id: Mapped[uuid.UUID] = mapped_column(Uuid, primary_key=True)
    class_name: Mapped[str] = mapped_column(Text, index=True)
    site: Mapped[str] = mapped_column(Text)
    source: Mapped[str] = mapped_column(Text)
    observed_at: Mapped[datetime] = mapped_column(UtcDateTime)
    physics: Mapped[dict[str, Any]] = mapped_column(JSON)


def table_of(row_type: type[Base]) -> Table:
    """Give the table of a row type."""
    return Base.metadata.tables[row_type.__tablename__]


def columns_of(row_type: type[Base], revision: str | None) -> list[ColumnElement]:
    """Give the columns of a table as a revision of the schema has it, the newest where None; nothing for others."""
    return [
        null().label(column.name)
        if revision is not None and revision < _ADDED_COLUMNS.get((row_type, column.name), "")
        else column
        for column in table_of(row_type).columns
    ]


_ADDED_COLUMNS: dict[tuple[type[Base], str], str] = {(DriveRow, "frame"): "0003"}
"""Columns that came with a revision: tables of an earlier one have not got them."""


def insertion(connection: Connection, row_type: type[Base]) -> Insert:
    """Give the statement that inserts rows whose identity is not there yet."""
    dialect = postgresql if connection.dialect.name == "postgresql" else sqlite
    return dialect.insert(table_of(row_type)).on_conflict_do_nothing()
