"""Effects that act everywhere, on one class of ground only or on one wheel only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from ..effects import Effect
from ..mechanics import Body, Change, Channels, Contact, Drive, Ground


@dataclass(frozen=True)
class VehicleDrive(Drive):
    """What the wheels of a vehicle do, all rows of a wheel one after the other; `x_m` is their place along the track.

    `wheel` (m,) is the number of the wheel, `ground` (m,) that of the ground that it is on; `lane` its track.
    """

    wheel: np.ndarray
    ground: np.ndarray

    def rows(self, chosen: np.ndarray) -> Self:
        """Give some rows."""
        return replace(self, **{each.name: getattr(self, each.name)[chosen] for each in fields(self)})

    def joined(self, others: Sequence[Self]) -> Self:
        """Give all rows of this one and others."""
        return replace(
            self, **{f.name: np.concatenate([getattr(each, f.name) for each in (self, *others)]) for f in fields(self)}
        )


def rows_of(channels: Channels, chosen: np.ndarray) -> Channels:
    """Give some rows of the channels."""
    return Channels(*(getattr(channels, each.name)[chosen] for each in fields(channels)))


_GEOMETRY = ("theta_2", "theta_m", "radius", "shear_radius", "arm")


@dataclass(frozen=True)
class Confined(Change):
    """An effect that acts on some grounds or one wheel only.

    Parameters
    ----------
    effect
        The effect.
    where
        ``"everywhere"``, ``{"class": name}`` or ``{"wheel": name}``.
    grounds, wheel
        Numbers of the grounds, or of the wheel, that it is confined to; None where it is not.
    """

    effect: Effect
    where: str | dict[str, str] = "everywhere"
    grounds: tuple[int, ...] | None = None
    wheel: int | None = None

    def acting(self, drive: Drive) -> np.ndarray:
        """Say in which rows it acts, (m,)."""
        rows = np.ones(len(drive), dtype=bool)
        if self.grounds is None and self.wheel is None:
            return rows
        assert isinstance(drive, VehicleDrive)
        if self.grounds is not None:
            rows &= np.isin(drive.ground, self.grounds)
        return rows if self.wheel is None else rows & (drive.wheel == self.wheel)

    @property
    def acts_in_contact(self) -> bool:
        """Whether the contact is changed."""
        return self.effect.acts_in_contact

    @property
    def moves_wheel(self) -> bool:
        """Whether the wheel finds another equilibrium."""
        return self.acts_in_contact or self.effect.changes("ground")

    @property
    def remembers(self) -> bool:
        """Whether a row depends on the rows before: instruments may."""
        return self.effect.changes("reported")

    def ground(self, ground: Ground, drive: Drive, body: Body) -> Ground:
        if not self.effect.changes("ground"):
            return ground
        there, rows = self.effect.ground(ground, drive, body), self.acting(drive)[:, None]
        return Ground(*(np.where(rows, getattr(there, f.name), getattr(ground, f.name)) for f in fields(ground)))

    def geometry(self, contact: Contact) -> None:
        self._changed(contact, "geometry", _GEOMETRY)

    def pressing(self, contact: Contact) -> None:
        self._changed(contact, "pressing", ("pressure",))

    def shearing(self, contact: Contact) -> None:
        self._changed(contact, "shearing", ("shear",))

    def _changed(self, contact: Contact, method: str, names: tuple[str, ...]) -> None:
        if not self.effect.changes(method):
            return
        before = {name: getattr(contact, name) for name in names}
        getattr(self.effect, method)(contact)
        rows = self.acting(contact.drive)
        if not rows.all():
            for name, values in before.items():
                setattr(contact, name, np.where(rows[:, None], getattr(contact, name), values))

    def forces(self, channels: Channels, drive: Drive, ground: Ground, body: Body) -> Channels:
        there, rows = self.effect.forces(channels, drive, ground, body), self.acting(drive)
        return Channels(*(np.where(rows, getattr(there, f.name), getattr(channels, f.name)) for f in fields(channels)))

    def reported(self, channels: Channels, drive: Drive) -> Channels:
        """Change what the instruments of each wheel report."""
        if not self.remembers:
            return channels
        assert isinstance(drive, VehicleDrive)
        values = {each.name: getattr(channels, each.name).copy() for each in fields(channels)}
        for wheel in np.unique(drive.wheel) if self.wheel is None else [self.wheel]:
            rows = np.flatnonzero(drive.wheel == wheel)
            if len(rows):
                there = self.effect.reported(rows_of(channels, rows), drive.rows(rows))
                for name, column in values.items():
                    column[rows] = getattr(there, name)
        return Channels(**values)
