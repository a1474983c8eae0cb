"""Drives, and the observations that they brought: terrain per cell, soil per stretch."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the tables."""
    op.create_table(
        "drive",
        sa.Column("id", sa.Uuid(), primary_key=True),
        sa.Column("recording_digest", sa.String(128), nullable=False, index=True),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("site", sa.Text(), nullable=False, index=True),
        sa.Column("vehicle_name", sa.Text(), nullable=False),
        sa.Column("start_time", sa.DateTime(timezone=True)),
        sa.Column("models", sa.JSON(), nullable=False),
        sa.Column("method", sa.Text(), nullable=False),
        sa.Column("cell_size_m", sa.Double(), nullable=False),
        sa.Column("classes", sa.JSON(), nullable=False),
    )
    op.create_table(
        "drive_import",
        sa.Column("id", sa.Uuid(), primary_key=True),
        sa.Column("drive_id", sa.Uuid(), sa.ForeignKey("drive.id"), nullable=False, index=True),
        sa.Column("imported_at", sa.DateTime(timezone=True), nullable=False),
    )
    op.create_table(
        "terrain_observation",
        sa.Column("id", sa.Uuid(), primary_key=True),
        sa.Column("drive_id", sa.Uuid(), sa.ForeignKey("drive.id"), nullable=False),
        sa.Column("time_s", sa.Double(), nullable=False),
        sa.Column("cell_x", sa.Integer(), nullable=False),
        sa.Column("cell_y", sa.Integer(), nullable=False),
        sa.Column("sense", sa.String(16), nullable=False),
        sa.Column("quality", sa.Double(), nullable=False),
        sa.Column("unknown", sa.Boolean(), nullable=False),
        sa.Column("probabilities", sa.LargeBinary(), nullable=False),
        sa.Column("reasons", sa.Text(), nullable=False),
        sa.Index("ix_terrain_observation_drive_sense", "drive_id", "sense"),
    )
    op.create_table(
        "soil_observation",
        sa.Column("id", sa.Uuid(), primary_key=True),
        sa.Column("drive_id", sa.Uuid(), sa.ForeignKey("drive.id"), nullable=False, index=True),
        sa.Column("start_s", sa.Double(), nullable=False),
        sa.Column("end_s", sa.Double(), nullable=False),
        sa.Column("x_m", sa.Double()),
        sa.Column("y_m", sa.Double()),
        sa.Column("class_probabilities", sa.JSON(), nullable=False),
        sa.Column("c_Pa", sa.Double()),
        sa.Column("tan_phi", sa.Double()),
        sa.Column("variance_c", sa.Double()),
        sa.Column("covariance_c_tan_phi", sa.Double()),
        sa.Column("variance_tan_phi", sa.Double()),
        sa.Column("normal_stress_low_Pa", sa.Double()),
        sa.Column("normal_stress_high_Pa", sa.Double()),
        sa.Column("load_N", sa.Double()),
        sa.Column("effects", sa.JSON(), nullable=False),
        sa.Column("gate_reason", sa.Text(), nullable=False),
        sa.Column("estimate", sa.JSON()),
    )


def downgrade() -> None:
    """Drop the tables."""
    for table in ("soil_observation", "terrain_observation", "drive_import", "drive"):
        op.drop_table(table)
