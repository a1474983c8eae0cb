"""Slip-sinkage: a slipping wheel carries soil from under itself and sinks further."""

from __future__ import annotations

import numpy as np

from .effect import SINKAGE, Contact, Drive, Effect, Parameter, Situation

_MOST_SLIP = 0.9
"""A wheel that spins where it is digs on for as long as it does: the formula ends there [-]."""

_LEAST_EXPONENT = 0.05
"""Pressure grows with depth, however little [-]."""

_BRAKED = 0.02
"""Share of samples with negative slip from which on it matters what braked wheels do [-]."""


class SinkageExponent(Effect):
    """The sinkage exponent grows with slip."""

    slug = "slip_sinkage"
    form = "exponent"
    equation = "n = n0 + n1 |i|"
    source = "L. Ding et al., J. Cent. South Univ. Technol. 17 (2010), 129-135: n0 + n1 i"
    parameters = (Parameter("n1", "", 0.0, 3.0, 0.15, 0.4),)

    def freer(self) -> list[Effect]:
        return [SinkageExponentSquared()]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.n = contact.n + values[0] * np.abs(drive.slip)


class SinkageExponentSquared(Effect):
    """The sinkage exponent grows with slip, and the faster or the slower the more the wheel slips."""

    slug = "slip_sinkage"
    form = "exponent, squared"
    freed = True
    equation = "n = n0 + n1 |i| + n2 i^2"
    source = "after L. Ding et al., J. Cent. South Univ. Technol. 17 (2010), 129-135: n0 + n1 i, with one term more"
    parameters = (*SinkageExponent.parameters, Parameter("n2", "", -0.3, 5.0, 0.0, 0.5))

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        away = np.abs(drive.slip)
        contact.n = np.maximum(contact.n + values[0] * away + values[1] * away**2, _LEAST_EXPONENT)


class _SinkageFactor(Effect):
    """The static sinkage grows by a factor of slip: of a braked wheel as of a driven one, or, as the formulas were made
    for, of driven wheels only.

    Parameters
    ----------
    driven
        Driven wheels only.
    told
        There is braking enough to tell: that of driven wheels only is a variant.
    """

    slug = "slip_sinkage"

    def __init__(self, *, driven: bool = False, told: bool = False) -> None:
        self._driven, self._told, self.usual = driven, told, not driven
        if driven:
            self.form, self.equation = f"{self.form}, driven", f"{self.equation}; braked wheels as without slip"

    def variants(self) -> list[Effect]:
        return [type(self)(driven=True)] if self._told else []

    def carrying(self, slip: np.ndarray) -> np.ndarray:
        """Give the slip (n,) that carries soil away, none of it negative."""
        return np.maximum(slip, 0.0) if self._driven else np.abs(slip)


class SinkageRatio(_SinkageFactor):
    """The sinkage is the static one times a power of a ratio that grows with slip; only the static one bears."""

    form = "ratio"
    equation = "z = z0 K^p, K = (1 + |i|) / (1 - |i| / 2)"
    source = "after M. Lyasko, J. Terramechanics 47 (2010), 21-31, slip-sinkage coefficient"
    parameters = (Parameter("p", "", 0.0, 6.0, 0.5, 1.0),)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.stiffness_Pa = contact.stiffness_Pa * _ratio(self.carrying(drive.slip)) ** (-values[0] * contact.n)


class DigOut(_SinkageFactor):
    """Each turn carries a layer of soil back, here as a share of the static sinkage, which alone bears."""

    form = "dig-out"
    equation = "z = z0 [1 + h |i| / (1 - |i|)], |i| at most 0.9"
    source = "after A. R. Reece, Proc. Inst. Mech. Eng. 180 (1965), 45-66: the layer dug out, over i / (1 - i)"
    parameters = (Parameter("h", "", 0.0, 5.0, 0.2, 0.5),)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        away = np.minimum(self.carrying(drive.slip), _MOST_SLIP)
        contact.stiffness_Pa = contact.stiffness_Pa * (1.0 + values[0] * away / (1.0 - away)) ** -contact.n


class SoilTransport(_SinkageFactor):
    """The wheel's rut is deepened by the soil carried out behind it; the contact ahead is the static one's."""

    form = "transport"
    equation = "z = z0 K^p, K = (1 + |i|) / (1 - |i| / 2), stresses those of z0"
    source = "after M. Lyasko, J. Terramechanics 47 (2010), 21-31, slip-sinkage coefficient"
    parameters = (Parameter("p", "", 0.0, 6.0, 0.5, 1.0),)

    def freer(self) -> list[Effect]:
        return [TransportAndDigOut(driven=self._driven)]

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, SINKAGE] *= _ratio(self.carrying(drive.slip)) ** values[0]


class TransportAndDigOut(SoilTransport):
    """The rut is deepened both by a power of the ratio and by the layer that each turn digs out."""

    freed = True
    equation = "z = z0 {K^p + h i9 / (1 - i9)}, i9 = min(|i|, 0.9), K = (1 + |i|) / (1 - |i| / 2), stresses those of z0"
    source = "after M. Lyasko (2010) and A. R. Reece (1965)"
    parameters = (*SoilTransport.parameters, Parameter("h", "", 0.0, 5.0, 0.0, 0.5))

    def __init__(self, *, driven: bool = False, told: bool = False) -> None:
        super().__init__(driven=driven, told=told)
        self.form = f"{self.form}, and dig-out"

    def freer(self) -> list[Effect]:
        return []

    def variants(self) -> list[Effect]:
        return []

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        away = self.carrying(drive.slip)
        within = np.minimum(away, _MOST_SLIP)
        channels[:, SINKAGE] *= _ratio(away) ** values[0] + values[1] * within / (1.0 - within)


def _ratio(away: np.ndarray) -> np.ndarray:
    return (1.0 + away) / (1.0 - 0.5 * away)


_FACTORS = SinkageRatio, DigOut, SoilTransport


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: slip has to vary."""
    if not situation.drive.has("slip"):
        return ()
    with np.errstate(invalid="ignore"):
        told = float(np.mean(situation.drive.slip < 0.0)) > _BRAKED
    return (SinkageExponent(), *(factor(told=told) for factor in _FACTORS))


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for, whatever its slips."""
    if not situation.drive.has("slip"):
        return ()
    return (SinkageExponent(), *(factor(driven=driven) for factor in _FACTORS for driven in (False, True)))
