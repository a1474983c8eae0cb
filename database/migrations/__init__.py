"""Alembic migrations of the terrain database."""
