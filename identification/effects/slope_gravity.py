"""On a slope, weight has a component along the track."""

from __future__ import annotations

import numpy as np

from .effect import PULL, Contact, Drive, Effect, Parameter, Situation


class SlopeGravity(Effect):
    """Drawbar pull has to hold a share of the weight on the slope."""

    slug = "slope_gravity"
    equation = "DP -= s W sin(pitch)"
    source = "statics"
    needs = ("pitch_rad",)
    parameters = (Parameter("s", "", 0.0, 3.0, 0.5, 1.0),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        pitch = np.where(np.isfinite(drive.pitch_rad), drive.pitch_rad, 0.0)
        channels[:, PULL] -= values[0] * drive.load_N * np.sin(pitch)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the form that these data can show: pitch has to vary and drawbar pull to be measured."""
    return (SlopeGravity(),) if situation.seen(PULL) and situation.drive.has("pitch_rad") else ()
