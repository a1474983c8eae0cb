"""An effect in one file outside the package: a cable that the wheel drags along."""

from __future__ import annotations

import numpy as np
from bevameter.identification.effects import PULL, Contact, Drive, Effect, Parameter, register


@register
class CableDrag(Effect):
    """The further the wheel has come, the more cable it drags."""

    slug = "cable_drag"
    title = "cable drag"
    what_happens = "the wheel drags a cable along, the longer the further it has come"
    check = "pull the cable by hand with a spring balance"
    equation = "DP -= w x"
    source = "Coulomb friction of a cable on the ground"
    needs = ("place_m",)
    changes = (PULL,)
    parameters = (Parameter("w", "N/m", 0.0, 20.0, 0.5, 2.0, "engineering judgement: 0.2 kg a metre"),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] -= values[0] * np.nan_to_num(drive.place_m)
