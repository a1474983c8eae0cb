"""Later wheels run on soil that earlier ones have compacted."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from ..effect import Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_STIFFENING = "engineering judgement: stiffness of a rut is up to twice that of fresh ground (after I. C. Holm, 1969)"
_STRENGTH = "engineering judgement: strength of a rut differs from that of fresh ground by a fifth"
_OTHER = "engineering judgement: as far as stiffness"
_PACE = "engineering judgement: most is done by the first one or two passes (after I. C. Holm, 1969)"


@register
class MultipassCompaction(Effect):
    """Earlier passes have worked the soil: it is stiffer, and stronger or weaker.

    Parameters
    ----------
    own
        Parameters of `worked`.
    apart
        Cohesion and shear modulus have changes of their own.
    """

    slug = "multipass_compaction"
    title = "multipass compaction"
    what_happens = "later passes run on soil that earlier wheels compacted"
    check = "drive twice more in the same rut and compare the sinkage of the passes"
    of_ground = True
    belongs_to = "ground"
    needs = ("pass_number",)
    source = "after I. C. Holm, J. Terramechanics 6 (1969), and C. Senatore, C. Sandu, J. Terramechanics 48 (2011)"
    by: str
    """The share s of the compaction that earlier passes have done, as the equation has it."""

    def __init__(self, own: tuple[Parameter, ...], apart: bool) -> None:
        further = (Parameter("C", "", -2.0, 3.0, 0.0, 0.5, _OTHER), Parameter("D", "", -3.0, 3.0, 0.0, 0.5, _OTHER))
        gains = (
            Parameter("A", "", 0.0, 4.0, 0.3, 0.6, _STIFFENING), Parameter("B", "", -1.0, 2.0, 0.0, 0.2, _STRENGTH),
        )  # fmt: skip
        self.parameters = (*gains, *own, *further[: 2 * apart])
        self._apart, self._own = apart, own
        strength = "ln tan phi += B s, ln c += (B + C) s, ln k += D s" if apart else "ln strength += B s"
        self.equation = f"ln stiffness += A s, {strength}, s = {self.by}"
        if apart:
            self.form = f"{self.form}, cohesion and shear modulus apart".removeprefix(", ")

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms where the number of the pass varies."""
        if not situation.drive.has("pass_number"):
            return ()
        numbers = situation.drive.pass_number
        alone = CompactionByPasses(len(np.unique(numbers[np.isfinite(numbers)])))
        return (alone, CompactionBySlip()) if situation.drive.has("slip") else (alone,)

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms with and without a pace: it may be stated whatever the number of passes."""
        if not situation.drive.has("pass_number"):
            return ()
        return CompactionByPasses(2), CompactionByPasses(3), CompactionBySlip()

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        last = 2 + len(self._own)
        worked = self.worked(drive, values[2:last])
        cohesion, modulus = values[last:] if self._apart else (0.0, 0.0)
        contact.stiffness_Pa = contact.stiffness_Pa * np.exp(values[0] * worked)
        contact.tan_phi = contact.tan_phi * np.exp(values[1] * worked)
        contact.c_Pa = contact.c_Pa * np.exp((values[1] + cohesion) * worked)
        contact.k_m = contact.k_m * np.exp(modulus * worked)

    @abstractmethod
    def worked(self, drive: Drive, own: np.ndarray) -> np.ndarray:
        """Share of the compaction that earlier passes have done (n,) [-]."""


class CompactionByPasses(MultipassCompaction):
    """The soil is compacted by the number of passes, up to a limit."""

    by = "1 - exp(-(N - 1) / N0)"

    def __init__(self, passes: int, *, apart: bool = False) -> None:
        pace = Parameter("N0", "", 0.2, 8.0, 1.0, 1.0, _PACE, null=1.0)
        super().__init__((pace,) if passes > 2 else (), apart)
        self._passes = passes

    def extensions(self) -> list[Effect]:
        return [] if self._apart else [CompactionByPasses(self._passes, apart=True)]

    def worked(self, drive: Drive, own: np.ndarray) -> np.ndarray:
        run = np.where(np.isfinite(drive.pass_number), drive.pass_number, 1.0)
        return -np.expm1(-(run - 1.0) / (own[0] if len(own) else 1.0))


class CompactionBySlip(MultipassCompaction):
    """The more a wheel slipped, the more it compacts for the next one."""

    form = "by slip"
    by = "1 - exp(-|i_before| / i0) + q (N - 1) for N > 1"
    source = "after C. Senatore, C. Sandu, J. Terramechanics 48 (2011): density by the slip of the pass before"

    def __init__(self, *, apart: bool = False) -> None:
        slip = Parameter(
            "i0", "", 0.02, 2.0, 0.2, 0.3, "engineering judgement: most is done at the slips that are usual", null=0.2
        )
        again = Parameter(
            "q", "", 0.0, 1.0, 0.2, 0.2, "engineering judgement: a pass adds a fifth of what slip does", null=0.2
        )
        super().__init__((slip, again), apart)

    def extensions(self) -> list[Effect]:
        return [] if self._apart else [CompactionBySlip(apart=True)]

    def worked(self, drive: Drive, own: np.ndarray) -> np.ndarray:
        later = np.nan_to_num(drive.pass_number, nan=1.0) - 1.0
        return np.where(later > 0.0, -np.expm1(-drive.slip_before / own[0]) + own[1] * later, 0.0)
