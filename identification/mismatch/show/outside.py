"""Causes that no effect of the catalogue is, and that effects were named for (docs/other-generators.md)."""

from __future__ import annotations

from collections.abc import Iterable

from . import readable

LOOK_ALIKES = {
    "drift": "soil that dries or hardens with time, soil that builds up on the rim",
    "drivetrain_friction": "cross-talk between torque and pull",
    "hard_layer": "a crust that breaks, a rim that is not flat across",
    "load_gain": "a wrong gain of the pull's sensor",
    "rim_adhesion": "a soil whose own strength grows by less than its share with pressure",
    "rolling_radius": "soil that builds up on the rim, a wrong gain of the pull's sensor",
    "sinkage_offset": "a wheel that is tilted",
    "slip_sinkage": "a frame that bends under the pull, soil that flows out sideways",
    "stress_peak_shift": "weight that a tow frame shifts",
    "time_lag": "play or friction in a linkage or a guide",
    "torque_gain": "a wrong gain of the pull's sensor, cross-talk, or a torque's sensor that saturates",
    "tyre_deflection": "a crust that breaks, a frame that bends",
}
"""By the effect's slug."""


def outside(slugs: Iterable[str]) -> list[str]:
    """Say what the catalogue lacks and looks like effects that were found."""
    told = [f"like {readable.effect(slug)} {LOOK_ALIKES[slug]}" for slug in sorted(slugs) if slug in LOOK_ALIKES]
    return [f"causes that the catalogue lacks may look the same: {'; '.join(told)}"] if told else []
