"""Physics of classes of ground: what the textbook wheel lacked there, found by somebody at some time.

The wheel's mechanics are imported where there is physics to be read: most databases hold none.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, Select, Text, case, cast, func, literal_column, select, true, type_coerce
from sqlalchemy.dialects import postgresql

from ..framework.core.arguments import refused
from ..framework.core.class_names import check_spelling
from ..framework.core.errors import InputError
from .storable import is_text
from .tables import DriveRow, PhysicsRow, SoilRow, insertion, table_of

if TYPE_CHECKING:
    from ..identification.effects.stored import AugmentedSimulator

_NAMESPACE = uuid.UUID("0d9a6d0c-6f4e-5d63-8a51-2c1b7f0f3a42")
_LONGEST_NAME, _LONGEST_SOURCE = 200, 4096
"""Letters of a name, and of a source: a path may be as long."""

LEAST_PROBABILITY = 0.5
"""Probability of each effect from which on what was found is kept with a class [-]: less likely than not is a guess."""


@dataclass(frozen=True)
class ClassPhysics:
    """An augmented simulator that was found on ground of one class.

    Parameters
    ----------
    class_name
        The class.
    physics
        Soil and effects.
    source
        Where it came from: a recording's name, a paper.
    observed_at
        When; a time without a zone is taken as UTC.
    site
        The site that it holds at; empty for ground of the class anywhere.

    Raises
    ------
    InputError
        A name that is empty, too long or no text, physics that is none, or a time that is none.
    """

    class_name: str
    physics: AugmentedSimulator
    source: str
    observed_at: datetime
    site: str = ""

    def __post_init__(self) -> None:
        from ..identification.effects.stored import AugmentedSimulator

        for name, least, most in (("class_name", 1, _LONGEST_NAME), ("source", 0, _LONGEST_SOURCE),
                                  ("site", 0, _LONGEST_NAME)):  # fmt: skip
            value = getattr(self, name)
            if (
                not isinstance(value, str)
                or not least <= len(value.strip()) <= len(value) <= most
                or not is_text(value)
            ):
                raise InputError(name, ascii(value)[:80], expected=f"text of {least} to {most} letters")
        if not isinstance(self.physics, AugmentedSimulator):
            raise refused("physics", self.physics, "an AugmentedSimulator, as `physics` of what explain answers")
        if not isinstance(self.observed_at, datetime):
            raise InputError("observed_at", f"{self.observed_at!r}"[:80], expected="a datetime")
        zone = self.observed_at.tzinfo or UTC
        try:
            object.__setattr__(self, "observed_at", self.observed_at.replace(tzinfo=zone).astimezone(UTC))
        except OverflowError as error:
            raise InputError("observed_at", str(self.observed_at), expected="a time of the years 1 to 9999") from error

    @cached_property
    def id(self) -> uuid.UUID:
        """Identity: UUID 5 of everything that it holds."""
        return identity_of(self, self.physics.to_json())


def identity_of(found: Any, document: Any) -> uuid.UUID:
    """Identity of physics, or of its row, whose numbers are those of a JSON document."""
    time = found.observed_at.astimezone(UTC).isoformat()
    key = [found.class_name, found.site, found.source, time, document]
    return uuid.uuid5(_NAMESPACE, json.dumps(key, ensure_ascii=True, sort_keys=True, separators=(",", ":")))


def check_likely(physics: AugmentedSimulator, source: str) -> None:
    """Refuse what was found without being likely; raises `InputError`."""
    for effect in physics.effects:
        if effect.probability < LEAST_PROBABILITY:
            raise InputError(source, f"{effect.slug} is there with probability {effect.probability:.6g}",
                             expected=f"{LEAST_PROBABILITY:g} or more, to plan on it"
                             )  # fmt: skip


def sound_physics(physics: AugmentedSimulator, source: str) -> AugmentedSimulator:
    """Give physics number by number as it is read back, and likely; raises `InputError` where it is not sound."""
    from ..identification.effects.stored import AugmentedSimulator

    try:
        document = physics.to_json()
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            source, f"{type(error).__name__} {error}"[:120], expected="soil and effects as numbers"
        ) from None
    sound = AugmentedSimulator.from_json(document, source)
    check_likely(sound, source)
    return sound


def physics_row(found: ClassPhysics) -> dict[str, Any]:
    """The `class_physics` row."""
    return {
        "id": found.id,
        "class_name": found.class_name,
        "site": found.site,
        "source": found.source,
        "observed_at": found.observed_at,
        "physics": found.physics.to_json(),
    }


def add_rows(connection: Connection, rows: Sequence[dict[str, Any]]) -> int:
    """Insert rows of physics, and count those that are new; those that are there already stay as they are."""
    statement = insertion(connection, PhysicsRow).returning(table_of(PhysicsRow).c.id)
    return sum(connection.execute(statement, row).first() is not None for row in rows)


def read_physics(connection: Connection, database: str, site: str | None = None) -> list[ClassPhysics]:
    """Physics of classes, oldest first; with a site only what holds there.

    Raises
    ------
    InputError
        Somebody wrote what is no physics.
    """
    table = table_of(PhysicsRow)
    query = select(table).order_by(table.c.observed_at, table.c.id)
    if site is not None:
        query = query.where(table.c.site.in_(("", site)))
    return [physics_of(row, database) for row in connection.execute(query)]


def physics_of(row: Any, database: str) -> ClassPhysics:
    """Read a `class_physics` row; raises `InputError` where it is no physics."""
    from ..identification.effects.stored import AugmentedSimulator

    physics = AugmentedSimulator.from_json(row.physics, f"{database}, physics of {row.class_name}")
    return ClassPhysics(row.class_name, physics, row.source, row.observed_at, row.site)


def newest_row(connection: Connection, class_name: str, site: str) -> Any | None:
    """Identity, source and time of the newest physics of a class at exactly this site; None where there is none."""
    table = table_of(PhysicsRow)
    query = (
        select(table.c.id, table.c.source, table.c.observed_at)
        .where(table.c.class_name == class_name, table.c.site == site)
        .order_by(table.c.observed_at.desc(), table.c.id.desc())
        .limit(1)
    )
    return connection.execute(query).one_or_none()


def lacking_physics(connection: Connection, found: Sequence[ClassPhysics]) -> list[ClassPhysics]:
    """Of physics that another database holds, give what is not here."""
    table = table_of(PhysicsRow)
    here = set(connection.execute(select(table.c.id).where(table.c.id.in_([each.id for each in found]))).scalars())
    return [each for each in found if each.id not in here]


def checked_rows(found: Sequence[ClassPhysics], database: str, driven: set[str], own: set[str]) -> list[dict[str, Any]]:
    """Rows of another database's physics, read as strictly as they are added to one whose classes, those that drives
    bring with a merge included, are `driven`, and those of whose physics are its `own`.
    """
    rows = []
    for each in found:
        source = f"{database}, physics of {each.class_name}"
        check_likely(each.physics, source)
        check_spelling(each.class_name, (driven, own), source)
        own = own | {each.class_name}
        rows.append(physics_row(each))
    return rows


def driven_classes(connection: Connection) -> set[str]:
    """Names of the classes that drives brought, as their senses and their stretches have them."""
    classes = cast(table_of(DriveRow).c.classes, Text)
    lists = connection.execute(select(classes).distinct()).scalars()
    named = {name for text in lists for name in _list(text) if isinstance(name, str)}
    return named | set(connection.execute(_keys(connection)).scalars())


def _list(text: str) -> list[Any]:
    """Read a list in JSON; one that is damaged, which a snapshot refuses, is empty."""
    try:
        found = json.loads(text)
    except (TypeError, ValueError):
        return []
    return found if isinstance(found, list) else []


def _keys(connection: Connection) -> Select[Any]:
    """Select the names of all stretches' classes; damaged ones are refused by a snapshot."""
    table = table_of(SoilRow)
    column = table.c.class_probabilities
    if connection.dialect.name == "sqlite":
        sound = case((func.json_valid(column), column), else_=literal_column("'{}'"))
        each = func.json_each(sound).table_valued("key")
        names = select(type_coerce(each.c.key, Text)).select_from(table).join(each, true())
        return names.where(func.typeof(each.c.key) == "text").distinct()
    sound = case((func.json_typeof(column) == "object", column), else_=cast(literal_column("'{}'"), postgresql.JSON))
    return select(func.json_object_keys(sound)).distinct()


def physics_classes(connection: Connection) -> set[str]:
    """Names of the classes whose physics is kept."""
    return set(connection.execute(select(table_of(PhysicsRow).c.class_name)).scalars())
