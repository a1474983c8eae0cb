"""Constant faults of sensors that the catalogue lacks, so that nothing in it stands in for them.

Where one of them explains a recording better than the catalogue does, what was left out is ``unknown``, and what it is
like is said.
"""

from __future__ import annotations

import numpy as np

from .effect import LOAD, PULL, SINKAGE, Drive, Effect, Parameter, Situation

SLUG = "unknown"


class Uncatalogued(Effect):
    """A fault, and in words what it is."""

    like: str
    slug = SLUG
    kind = "unknown"
    source = "definition"


class PullOffset(Uncatalogued):
    """The pull cell's zero is wrong."""

    form = "zero of drawbar_pull_N"
    equation = "DP reported = DP + DP_0"
    like = "a wrong zero of the drawbar pull's sensor"

    def __init__(self, usual_N: float) -> None:
        self.parameters = (Parameter("DP_0", "N", -2.0 * usual_N, 2.0 * usual_N, 0.0, 0.1 * usual_N),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] += values[0]


class PullGain(Uncatalogued):
    """The pull cell's constant is wrong."""

    form = "gain of drawbar_pull_N"
    equation = "DP reported = (1 + g) DP"
    like = "a wrong gain of the drawbar pull's sensor"
    parameters = (Parameter("g", "", -0.8, 2.0, 0.0, 0.15),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] *= 1.0 + values[0]


class SinkageGain(Uncatalogued):
    """The sinkage sensor's constant is wrong."""

    form = "gain of sinkage_m"
    equation = "z reported = (1 + g) z"
    like = "a wrong gain of the sinkage's sensor"
    parameters = (Parameter("g", "", -0.8, 2.0, 0.0, 0.15),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, SINKAGE] *= 1.0 + values[0]


class LoadOffset(Uncatalogued):
    """The load cell's zero is wrong."""

    form = "zero of load_N"
    equation = "W reported = W + W_0"
    like = "a wrong zero of the load cell"

    def __init__(self, usual_N: float) -> None:
        self.parameters = (Parameter("W_0", "N", -0.5 * usual_N, 0.5 * usual_N, 0.0, 0.1 * usual_N),)

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        imposed[:, LOAD] = np.maximum(imposed[:, LOAD] - values[0], 1e-3 * imposed[:, LOAD])


def forms(situation: Situation) -> tuple[Uncatalogued, ...]:
    """Give the faults that these data can show."""
    faults: list[Uncatalogued] = []
    if situation.seen(PULL):
        faults += [PullOffset(float(situation.typical[PULL])), PullGain()]
    if situation.seen(SINKAGE):
        faults.append(SinkageGain())
    if situation.seen(LOAD) and situation.drive.has("load_N"):
        faults.append(LoadOffset(float(situation.typical[LOAD])))
    return tuple(faults)
