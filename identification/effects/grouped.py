"""Effects of one wheel, or on one class of ground, and effects with parameters of their own on each class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .effect import Contact, Drive, Effect, Group, Situation


class GroupedEffect(Effect):
    """An effect that acts in some groups of rows only, in each with parameters of its own.

    Parameters
    ----------
    base
        The effect.
    groups
        The groups.
    """

    def __init__(self, base: Effect, groups: Sequence[Group]) -> None:
        self.base, self.groups = base, tuple(groups)
        # What a form states of itself may be an attribute of its class or of the instance.
        for name in (
            "slug", "title", "what_happens", "check", "equation", "source", "kind", "needs", "changes", "constants",
            "prior_probability", "nested", "choices", "of_ground", "of_any_wheel", "of_one_drive", "by_run", "remark",
            "belongs_to",
        ):  # fmt: skip
            setattr(self, name, getattr(base, name))
        where = f"on {self.groups[0].name} only" if len(groups) == 1 else f"by {_KINDS[self.groups[0].attribute]}"
        self.where = where
        self.form = f"{base.form}, {where}" if base.form else where
        self.parameters = tuple(
            replace(each, name=f"{each.name}_{group.name}") if len(groups) > 1 else each
            for group in self.groups
            for each in base.parameters
        )

    @property
    def moves_wheel(self) -> np.ndarray:
        return np.tile(self.base.moves_wheel, len(self.groups))

    @property
    def shapes_contact(self) -> bool:
        return self.base.shapes_contact

    def starts(self) -> list[np.ndarray]:
        return [np.tile(start, len(self.groups)) for start in self.base.starts()]

    def extensions(self) -> list[Effect]:
        return [GroupedEffect(each, self.groups) for each in self.base.extensions()]

    def initial_soil(self, soil: np.ndarray) -> np.ndarray:
        return soil

    def extent(self, values: np.ndarray) -> tuple[str, float, float] | None:
        return self.base.extent(self._split(values)[0][1]) if len(self.groups) == 1 else None

    def check_sd(self, noise: np.ndarray) -> float | None:
        return self.base.check_sd(noise)

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        for group, own in self._split(values):
            there, rows = imposed.copy(), group.rows(drive)
            self.base.impose(there, drive, own)
            imposed[rows] = there[rows]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        for group, own in self._split(values):
            there, rows = Contact(contact.array.copy(order="K"), contact.wheel), group.rows(drive)
            there.sinkage_m = contact.sinkage_m.copy()
            self.base.contact(there, drive, own)
            contact.array[rows] = there.array[rows]
            contact.sinkage_m = np.where(rows, there.sinkage_m, contact.sinkage_m)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        for group, own in self._split(values):
            there, rows = channels.copy(), group.rows(drive)
            self.base.act(there, contact, drive, own)
            channels[rows] = there[rows]

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        for group, own in self._split(values):
            there, rows = channels.copy(), group.rows(drive)
            self.base.report(there, drive, own)
            channels[rows] = there[rows]

    def _split(self, values: np.ndarray) -> list[tuple[Group, np.ndarray]]:
        return list(zip(self.groups, np.split(values, len(self.groups)), strict=True))


_KINDS = {"wheel": "wheel", "ground": "class"}


def in_one_group(form: Effect, situation: Situation) -> list[Effect]:
    """Return the forms that act in one group only: physics of the ground on a class, all else on a wheel."""
    return [GroupedEffect(form, (each,)) for each in _groups(form, situation)]


def in_every_group(form: Effect, situation: Situation) -> list[Effect]:
    """Return the form of physics of the ground that has parameters of its own on each class, if there are several."""
    groups = _groups(form, situation) if form.belongs_to == "ground" else ()
    return [GroupedEffect(form, groups)] if groups else []


def _groups(form: Effect, situation: Situation) -> tuple[Group, ...]:
    """Return the groups that an effect may differ between; none where there is one."""
    if form.by_place or isinstance(form, GroupedEffect):
        return ()
    groups = situation.classes if form.belongs_to == "ground" else situation.wheels
    return groups if len(groups) > 1 else ()
