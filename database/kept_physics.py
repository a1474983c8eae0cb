"""Physics of classes in the database: read, added, and its classes spelt as drives have them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, select

from ..framework.core.class_names import check_spelling
from .tables import DriveRow, PhysicsRow, SoilRow, insertion, table_of

if TYPE_CHECKING:
    from .physics import ClassPhysics


def add_rows(connection: Connection, rows: Sequence[dict[str, Any]]) -> int:
    """Insert rows of physics, and count those that are new; those that are there already stay as they are."""
    statement = insertion(connection, PhysicsRow).returning(table_of(PhysicsRow).c.id)
    return sum(connection.execute(statement, row).first() is not None for row in rows)


def read_physics(connection: Connection, database: str, site: str | None = None) -> list[ClassPhysics]:
    """Physics of classes, oldest first; with a site only what holds there."""
    table = table_of(PhysicsRow)
    query = select(table).order_by(table.c.observed_at, table.c.id)
    if site is not None:
        query = query.where(table.c.site.in_(("", site)))
    rows = connection.execute(query).all()
    if not rows:
        return []  # most databases: spare them the mechanics' import
    from .physics import class_physics

    return [class_physics(row, database) for row in rows]


def found_by_others(connection: Connection, database: str, driven: set[str], own: set[str]) -> list[dict[str, Any]]:
    """Rows of another database's physics, read as strictly as they are added to one whose classes, those that drives
    bring with a merge included, are `driven`, and those of whose physics are its `own`.
    """
    found = read_physics(connection, database)
    if not found:
        return []
    from .physics import check_likely, physics_row

    for each in found:
        source = f"{database}, physics of {each.class_name}"
        check_likely(each.physics, source)
        check_spelling(each.class_name, (driven, own), source)
        own = own | {each.class_name}
    return [physics_row(each) for each in found]


def driven_classes(connection: Connection) -> set[str]:
    """Names of the classes that drives brought, as their senses and their stretches have them."""
    return set(_names(connection))


def _names(connection: Connection) -> Iterator[str]:
    for column in (table_of(DriveRow).c.classes, table_of(SoilRow).c.class_probabilities):
        for names in connection.execute(select(column)).scalars():
            # Damaged ones are none of a snapshot, which says so.
            yield from (name for name in names if isinstance(name, str)) if isinstance(names, list | dict) else ()


def physics_classes(connection: Connection) -> set[str]:
    """Names of the classes whose physics is kept."""
    return set(connection.execute(select(table_of(PhysicsRow).c.class_name)).scalars())
