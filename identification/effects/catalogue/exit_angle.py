"""Soil rebounds: the contact continues behind bottom-dead-centre."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_MOST = 0.95
"""Bound of the exit angle as a share of the entry angle [-]."""

_SHARE = "engineering judgement: a tenth of the sinkage rebounds, a share of 0.3 of the entry angle; of stiff clay more"
_BY_SLIP = Parameter(
    "b1", "", -1.5, 1.5, 0.0, 0.3,
    "engineering judgement: as much as the a1 = 0.32 by which J.-Y. Wong, A. R. Reece (1967) shift the stress peak",
)  # fmt: skip


@register
class ExitAngle(Effect):
    """Exit angle in proportion to the entry angle.

    Ishigami's sinkage ratio, cos theta_2 = 1 - lambda (1 - cos theta_1), is the same to second order: lambda = c2^2.
    """

    slug = "exit_angle"
    title = "exit angle"
    what_happens = "soil rebounds behind the wheel's lowest point and stays in contact with the rim"
    check = "measure the depth of the rut behind the wheel: it is less than the sinkage"
    of_any_wheel = True
    belongs_to = "ground"
    form = "peak kept"
    equation = "theta_2 = -c2 theta_1, theta_m = theta_1 / 2"
    source = (
        "after O. Onafeko, A. R. Reece, J. Terramechanics 4(1) (1967); G. Ishigami et al., J. Field Robotics 24 (2007)"
    )
    parameters = (Parameter("c2", "", 0.0, _MOST, 0.2, 0.3, _SHARE),)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        return ExitAngle(), ExitAngleMidway()

    def extensions(self) -> list[Effect]:
        return [ExitAngleBySlip()]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        share = values[0] + (values[1] * drive.slip if len(values) > 1 else 0.0)
        contact.theta_2 = -np.clip(share, 0.0, _MOST) * contact.theta_1


class ExitAngleMidway(ExitAngle):
    """Exit angle in proportion to the entry angle, the peak stress at the middle of the whole contact."""

    form = "peak midway"
    equation = "theta_2 = -s theta_1, theta_m = (theta_1 + theta_2) / 2"
    parameters = (Parameter("s", "", 0.0, _MOST, 0.2, 0.3, _SHARE),)

    def extensions(self) -> list[Effect]:
        return [ExitAngleMidwayBySlip()]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        super().contact(contact, drive, values)
        contact.theta_m = contact.theta_m + 0.5 * contact.theta_2


class ExitAngleBySlip(ExitAngle):
    """The share of the entry angle grows or falls with slip."""

    form = "peak kept, by slip"
    equation = "theta_2 = -(c2 + b1 i) theta_1, its share from 0 to 0.95, theta_m = theta_1 / 2"
    source = (
        "after O. Onafeko, A. R. Reece (1967), linear in slip as the peak's angle of J.-Y. Wong, A. R. Reece (1967)"
    )
    parameters = (*ExitAngle.parameters, _BY_SLIP)

    def extensions(self) -> list[Effect]:
        return []


class ExitAngleMidwayBySlip(ExitAngleMidway):
    """The share of the entry angle grows or falls with slip, the peak stress at the middle of the whole contact."""

    form = "peak midway, by slip"
    equation = "theta_2 = -(s + b1 i) theta_1, its share from 0 to 0.95, theta_m = (theta_1 + theta_2) / 2"
    source = ExitAngleBySlip.source
    parameters = (*ExitAngleMidway.parameters, _BY_SLIP)

    def extensions(self) -> list[Effect]:
        return []
