"""Slip-sinkage: a slipping wheel carries soil from under itself and sinks further."""

from __future__ import annotations

import numpy as np

from .effect import SINKAGE, Contact, Drive, Effect, Parameter, Situation

_MOST_SLIP = 0.9
"""A wheel that spins where it is digs on for as long as it does: the formula ends there [-]."""

_LEAST_EXPONENT = 0.05
"""Pressure grows with depth, however little [-]."""


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


class SinkageRatio(Effect):
    """The sinkage is the static one times a power of a ratio that grows with slip; only the static one bears."""

    slug = "slip_sinkage"
    form = "ratio"
    equation = "z = z0 K^p, K = (1 + |i|) / (1 - |i| / 2)"
    source = "after M. Lyasko, J. Terramechanics 47 (2010), 21-31, slip-sinkage coefficient"
    parameters = (Parameter("p", "", 0.0, 6.0, 0.5, 1.0),)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.stiffness_Pa = contact.stiffness_Pa * _ratio(drive.slip) ** (-values[0] * contact.n)


class DigOut(Effect):
    """Each turn carries a layer of soil back, here as a share of the static sinkage, which alone bears."""

    slug = "slip_sinkage"
    form = "dig-out"
    equation = "z = z0 [1 + h |i| / (1 - |i|)], |i| at most 0.9"
    source = "after A. R. Reece, Proc. Inst. Mech. Eng. 180 (1965), 45-66: the layer dug out, over i / (1 - i)"
    parameters = (Parameter("h", "", 0.0, 5.0, 0.2, 0.5),)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        away = np.minimum(np.abs(drive.slip), _MOST_SLIP)
        contact.stiffness_Pa = contact.stiffness_Pa * (1.0 + values[0] * away / (1.0 - away)) ** -contact.n


class SoilTransport(Effect):
    """The wheel's rut is deepened by the soil carried out behind it; the contact ahead is the static one's."""

    slug = "slip_sinkage"
    form = "transport"
    equation = "z = z0 K^p, K = (1 + |i|) / (1 - |i| / 2), stresses those of z0"
    source = "after M. Lyasko, J. Terramechanics 47 (2010), 21-31, slip-sinkage coefficient"
    parameters = (Parameter("p", "", 0.0, 6.0, 0.5, 1.0),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, SINKAGE] *= _ratio(drive.slip) ** values[0]


def _ratio(slip: np.ndarray) -> np.ndarray:
    away = np.abs(slip)
    return (1.0 + away) / (1.0 - 0.5 * away)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: slip has to vary."""
    if not situation.drive.has("slip"):
        return ()
    return SinkageExponent(), SinkageRatio(), DigOut(), SoilTransport()
