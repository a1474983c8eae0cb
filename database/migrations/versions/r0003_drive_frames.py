"""Where on Earth the frame of a drive's site lies, and how the recording's own frame lies in it."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column; of drives that are there nothing is known."""
    op.add_column("drive", sa.Column("frame", sa.JSON()))


def downgrade() -> None:
    """Drop it."""
    op.drop_column("drive", "frame")
