"""Later wheels run on soil that the earlier ones have compacted."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from .effect import Contact, Drive, Effect, Parameter, Situation


class _Compaction(Effect, ABC):
    """The passes before have worked the soil: it is stiffer, and stronger or weaker.

    Parameters
    ----------
    own
        Parameters of `worked`.
    apart
        Cohesion and shear modulus change each for themselves.
    """

    slug = "multipass_compaction"
    of_ground = True
    needs = ("pass_number",)
    by: str
    """The work of the passes before, as the equation has it."""

    def __init__(self, own: tuple[Parameter, ...], apart: bool) -> None:
        further = (Parameter("C", "", -2.0, 3.0, 0.0, 0.5), Parameter("D", "", -3.0, 3.0, 0.0, 0.5))
        gains = (Parameter("A", "", 0.0, 4.0, 0.3, 0.6), Parameter("B", "", -1.0, 2.0, 0.0, 0.2))
        self.parameters = (*gains, *own, *further[: 2 * apart])
        self.freed = apart
        strength = "ln tan phi += B s, ln c += (B + C) s, ln k += D s" if apart else "ln strength += B s"
        self.equation = f"ln stiffness += A s, {strength}, s = {self.by}"
        self._own = own
        if apart:
            self.form = f"{self.form}, cohesion and shear modulus apart".removeprefix(", ")

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        last = 2 + len(self._own)
        worked = self.worked(drive, values[2:last])
        cohesion, modulus = values[last:] if self.freed else (0.0, 0.0)
        contact.stiffness_Pa = contact.stiffness_Pa * np.exp(values[0] * worked)
        contact.tan_phi = contact.tan_phi * np.exp(values[1] * worked)
        contact.c_Pa = contact.c_Pa * np.exp((values[1] + cohesion) * worked)
        contact.k_m = contact.k_m * np.exp(modulus * worked)

    @abstractmethod
    def worked(self, drive: Drive, own: np.ndarray) -> np.ndarray:
        """Give how far the passes before have worked the soil (n,) [-]."""


class MultipassCompaction(_Compaction):
    """The soil is worked by the number of passes, until it is worked through."""

    by = "1 - exp(-(N - 1) / N0)"
    source = "after I. C. Holm, J. Terramechanics 6 (1969), and C. Senatore, C. Sandu, J. Terramechanics 48 (2011)"

    def __init__(self, passes: int, *, apart: bool = False) -> None:
        super().__init__((Parameter("N0", "", 0.2, 8.0, 1.0, 1.0, 1.0),) if passes > 2 else (), apart)
        self._passes = passes

    def freer(self) -> list[Effect]:
        return [] if self.freed else [MultipassCompaction(self._passes, apart=True)]

    def worked(self, drive: Drive, own: np.ndarray) -> np.ndarray:
        run = np.where(np.isfinite(drive.pass_number), drive.pass_number, 1.0)
        return -np.expm1(-(run - 1.0) / (own[0] if len(own) else 1.0))


class CompactionBySlip(_Compaction):
    """The more a wheel slipped, the more it compacts for the next one."""

    form = "by slip"
    by = "1 - exp(-|i_before| / i0) + q (N - 1) for N > 1"
    source = "after C. Senatore, C. Sandu, J. Terramechanics 48 (2011): density by the slip of the pass before"

    def __init__(self, *, apart: bool = False) -> None:
        own = Parameter("i0", "", 0.02, 2.0, 0.2, 0.3, 0.2), Parameter("q", "", 0.0, 1.0, 0.2, 0.2, 0.2)
        super().__init__(own, apart)

    def freer(self) -> list[Effect]:
        return [] if self.freed else [CompactionBySlip(apart=True)]

    def worked(self, drive: Drive, own: np.ndarray) -> np.ndarray:
        later = np.nan_to_num(drive.pass_number, nan=1.0) - 1.0
        return np.where(later > 0.0, -np.expm1(-drive.slip_before / own[0]) + own[1] * later, 0.0)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: the number of passes has to vary."""
    if not situation.drive.has("pass_number"):
        return ()
    numbers = situation.drive.pass_number
    alone = MultipassCompaction(len(np.unique(numbers[np.isfinite(numbers)])))
    if not situation.drive.has("slip"):
        return (alone,)
    return alone, CompactionBySlip()


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for: the pace may be stated whatever the number of passes."""
    if not situation.drive.has("pass_number"):
        return ()
    return MultipassCompaction(2), MultipassCompaction(3), CompactionBySlip()
