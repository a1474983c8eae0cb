"""Errors of a load and a pull that are computed from the vehicle's weight: they are common to all rows.

A wrong mass makes every load wrong by one share, a sensor of attitude that is mounted askew every pull by one share of
the load, and wheels that pull by other shares than their loads do so wherever they are. Such errors do not average out
over rows: as parameters with priors they are estimated with the soil and carried into its intervals (systematic errors
as nuisance parameters: R. J. Barlow, *Statistics* (1989), Sec. 4.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...framework.core.soil import PARAMETERS
from ..mechanics.flexible import FlexibleWheel
from ..mechanics.textbook import CHANNELS, Prediction, TextbookWheel

NUISANCES = 5
"""Share of the load; of the pull over the load: a constant, by the load, by load and slip; resistance of what is towed.
"""

BY_LOAD, BY_SLIP = 0.1, 0.3
"""Prior standard deviations of how a wheel's pull over its load depends on its load, relative to the mean, and on that
times the slip [-]: 0.03 to 0.06 and up to 0.2 in simulated drives on slopes up to 9 deg (three soils)."""

SHAPE = {"load_N": 0.001, "drawbar_pull_N": 0.004}
"""Standard deviation of what is left of the error of a computed channel, relative to the load [-]: 0.001 and 0.001 to
0.003 there, rounded up. It is a smooth function of what is driven."""

STATES = 15
"""Different states of driving of a stretch at most: in rows of one state that error is one, however many there are."""

FARTHEST = 5.0
"""Standard deviations of their priors within which the nuisance parameters lie."""

_LOAD, _PULL = CHANNELS.index("load_N"), CHANNELS.index("drawbar_pull_N")


@dataclass(frozen=True)
class Computed:
    """What is known of computed channels: standard deviations of the shares of the load, 0 where sensed.

    `load` is that of the load, `pull` that of the pull, both relative to the load [-]; `mean_load_N` the load [N] that
    others are compared with; `resistance` that of the rolling resistance of the wheels that are towed, over their load
    [-], and `towed` what they carry over what the driven wheels carry [-]: at the mean load, and by the load over it.
    """

    load: float
    pull: float
    mean_load_N: float
    resistance: float = 0.0
    towed: tuple[float, float] = (0.0, 0.0)

    @property
    def prior_sd(self) -> np.ndarray:
        """(`NUISANCES`,) standard deviations of the priors; 0 of what is not estimated."""
        pulled = 1.0 if self.pull else 0.0
        return np.array([self.load, self.pull, BY_LOAD * pulled, BY_SLIP * pulled, self.resistance])


def noise_of_shape(name: str, mean_load_N: float, rows: int) -> float:
    """Noise [N] of independent rows that says as little of a computed channel as its error of shape lets them say."""
    return SHAPE[name] * mean_load_N * math.sqrt(max(rows / STATES, 1.0))


@dataclass(frozen=True)
class ComputedChannels:
    """A wheel whose load and pull are computed: the nuisance parameters follow the soil's in the vector."""

    model: TextbookWheel | FlexibleWheel
    mean_load_N: float
    towed: tuple[float, float] = (0.0, 0.0)

    def freed(self, load_N: float) -> ComputedChannels:
        """Return the same with the freedoms of the form."""
        return replace(self, model=FlexibleWheel(self.model.wheel, load_N))

    def predict(self, imposed: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Prediction:
        """Predict what is computed for a wheel of a load, as it is computed, and slip; see `textbook.Prediction`.

        The load without its error is the wheel's: so what is measured of the one says nothing of the other's error.
        """
        soil = len(PARAMETERS)
        own, (share, constant, by_load, by_slip, resistance) = (
            np.delete(vector, range(soil, soil + NUISANCES)),
            vector[soil : soil + NUISANCES],
        )
        computed, slip = imposed.T
        load = computed / (1.0 + share)
        found = self.model.predict(np.column_stack([load, slip]), own, theta_1)
        heavier = computed / self.mean_load_N - 1.0
        towed = self.towed[0] + heavier * self.towed[1]
        of_load = constant + heavier * (by_load + by_slip * slip) - resistance * towed
        channels, by_latent = found.channels.copy(), found.by_latent.copy()
        channels[:, _LOAD] = computed
        channels[:, _PULL] += load * of_load
        by_latent[:, _PULL, 0] += of_load
        by_share = -by_latent[:, :, 0] * (load / (1.0 + share))[:, None]
        by_share[:, _LOAD] = 0.0
        by_latent[:, :, 0] /= 1.0 + share
        by_latent[:, _LOAD, 0] = 1.0
        by_latent[:, _PULL, 0] += (load / self.mean_load_N) * (by_load + by_slip * slip - resistance * self.towed[1])
        by_latent[:, _PULL, 1] += load * heavier * by_slip
        nuisance = np.zeros((len(load), len(CHANNELS), NUISANCES))
        nuisance[:, :, 0] = by_share
        nuisance[:, _PULL, 1:] = load[:, None] * np.column_stack([np.ones(len(load)), heavier, heavier * slip, -towed])
        by_parameter = np.concatenate(
            [found.by_parameter[:, :, :soil], nuisance, found.by_parameter[:, :, soil:]], axis=2
        )
        return Prediction(channels, by_latent, by_parameter, found.theta_1)
