"""Slip-sinkage: a slipping wheel carries soil from under itself and sinks further."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..effect import SINKAGE, Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_MOST_SLIP = 0.9
"""Slip up to which the dig-out formula holds: a wheel that spins on the spot digs on as long as it spins [-]."""

_LEAST_EXPONENT = 0.05
"""Bound of the sinkage exponent: pressure grows with depth [-]."""

_BRAKED = 0.02
"""Share of samples with negative slip above which the laws of braked wheels differ [-]."""

_DIG_OUT = Parameter(
    "h", "", 0.0, 5.0, 0.2, 0.5,
    "engineering judgement: a turn at half slip digs out a layer of up to half the static sinkage",
)  # fmt: skip
_RATIO = Parameter("p", "", 0.0, 6.0, 0.5, 1.0, "M. Lyasko (2010): a power of 1 of the coefficient K")


@register
class SlipSinkage(Effect):
    """What the forms share."""

    slug = "slip_sinkage"
    title = "slip-sinkage"
    what_happens = "a slipping wheel carries soil out from under itself and sinks further"
    check = "drive at constant load with slips from 0 to 0.6 on fresh soil and read the sinkage"
    of_any_wheel = True
    belongs_to = "ground"

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms where slip varies."""
        with np.errstate(invalid="ignore"):
            braked = float(np.mean(situation.drive.slip < 0.0)) > _BRAKED
        return _forms(situation, braked=braked)

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give all forms, whatever the slip."""
        return _forms(situation, braked=True)


class SinkageExponent(SlipSinkage):
    """The sinkage exponent grows with slip."""

    form = "exponent"
    equation = "n = n0 + n1 |i|"
    source = "L. Ding et al., J. Cent. South Univ. Technol. 17 (2010), 129-135: n0 + n1 i"
    parameters = (
        Parameter(
            "n1", "", 0.0, 3.0, 0.15, 0.4,
            "engineering judgement: half the spread of published sinkage exponents, 0.3 to 1.2 (J.-Y. Wong, 2010)",
        ),
    )  # fmt: skip

    def extensions(self) -> list[Effect]:
        return [SinkageExponentSquared()]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.n = contact.n + values[0] * np.abs(drive.slip)


class SinkageExponentSquared(SlipSinkage):
    """The sinkage exponent grows with slip, faster or slower the more the wheel slips."""

    form = "exponent, squared"
    equation = "n = n0 + n1 |i| + n2 i^2"
    source = "after L. Ding et al., J. Cent. South Univ. Technol. 17 (2010), 129-135: n0 + n1 i, with one term more"
    parameters = (
        *SinkageExponent.parameters,
        Parameter("n2", "", -0.3, 5.0, 0.0, 0.5, "engineering judgement: as large as the linear term"),
    )

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        away = np.abs(drive.slip)
        contact.n = np.maximum(contact.n + values[0] * away + values[1] * away**2, _LEAST_EXPONENT)


class _SinkageFactor(SlipSinkage):
    """The static sinkage grows by a factor of slip.

    Parameters
    ----------
    driven
        Of driven wheels only, for which the formulas were made; else of braked wheels in the same way.
    braked
        There are braked rows: the form of driven wheels only is an extension.
    """

    def __init__(self, *, driven: bool = False, braked: bool = False) -> None:
        self._driven, self._braked, self.default_form = driven, braked, not driven
        if driven:
            self.form, self.equation = f"{self.form}, driven", f"{self.equation}; braked wheels as without slip"

    def extensions(self) -> list[Effect]:
        return [type(self)(driven=True)] if self._braked else []

    def carrying(self, slip: np.ndarray) -> np.ndarray:
        """Slip (n,) that carries soil away, none of it negative [-]."""
        return np.maximum(slip, 0.0) if self._driven else np.abs(slip)


class SinkageRatio(_SinkageFactor):
    """The sinkage is the static one times a power of a ratio that grows with slip; only the static one bears."""

    form = "ratio"
    equation = "z = z0 K^p, K = (1 + |i|) / (1 - |i| / 2)"
    source = "after M. Lyasko, J. Terramechanics 47 (2010), 21-31, slip-sinkage coefficient"
    parameters = (_RATIO,)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.stiffness_Pa = contact.stiffness_Pa * _ratio(self.carrying(drive.slip)) ** (-values[0] * contact.n)


class DigOut(_SinkageFactor):
    """Each turn carries a layer of soil back, here as a share of the static sinkage, which alone bears."""

    form = "dig-out"
    equation = "z = z0 [1 + h |i| / (1 - |i|)], |i| at most 0.9"
    source = "after A. R. Reece, Proc. Inst. Mech. Eng. 180 (1965), 45-66: the layer dug out, over i / (1 - i)"
    parameters = (_DIG_OUT,)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        away = np.minimum(self.carrying(drive.slip), _MOST_SLIP)
        contact.stiffness_Pa = contact.stiffness_Pa * (1.0 + values[0] * away / (1.0 - away)) ** -contact.n


class SoilTransport(_SinkageFactor):
    """The wheel's rut is deepened by the soil carried out behind it; the contact ahead is the static one's."""

    form = "transport"
    equation = "z = z0 K^p, K = (1 + |i|) / (1 - |i| / 2), stresses those of z0"
    source = "after M. Lyasko, J. Terramechanics 47 (2010), 21-31, slip-sinkage coefficient"
    parameters = (_RATIO,)
    changes = (SINKAGE,)

    def extensions(self) -> list[Effect]:
        return [*super().extensions(), TransportAndDigOut(driven=self._driven)]

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, SINKAGE] *= _ratio(self.carrying(drive.slip)) ** values[0]


class TransportAndDigOut(SoilTransport):
    """The rut is deepened both by a power of the ratio and by the layer that each turn digs out."""

    equation = "z = z0 {K^p + h i9 / (1 - i9)}, i9 = min(|i|, 0.9), K = (1 + |i|) / (1 - |i| / 2), stresses those of z0"
    source = "after M. Lyasko (2010) and A. R. Reece (1965)"
    parameters = (_RATIO, replace(_DIG_OUT, start=0.0))

    def __init__(self, *, driven: bool = False) -> None:
        super().__init__(driven=driven)
        self.form = f"{self.form}, and dig-out"

    def extensions(self) -> list[Effect]:
        return []

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        away = self.carrying(drive.slip)
        within = np.minimum(away, _MOST_SLIP)
        channels[:, SINKAGE] *= _ratio(away) ** values[0] + values[1] * within / (1.0 - within)


def _ratio(away: np.ndarray) -> np.ndarray:
    """Lyasko's slip-sinkage coefficient K (n,) [-]."""
    return (1.0 + away) / (1.0 - 0.5 * away)


def _forms(situation: Situation, *, braked: bool) -> Sequence[Effect]:
    if not situation.drive.has("slip"):
        return ()
    return [SinkageExponent(), *(factor(braked=braked) for factor in (SinkageRatio, DigOut, SoilTransport))]
