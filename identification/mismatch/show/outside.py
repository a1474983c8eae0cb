"""Causes that no effect of the catalogue is, and that effects were named for (docs/other-generators.md)."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from ....framework.core.vehicle import Wheel
from ...effects.effect import PULL, TORQUE
from . import readable

LOOK_ALIKES: dict[str, tuple[str, ...]] = {
    "bulldozing": ("a carriage that rubs on its rails, a pull cell that is not level, or ground that slopes",),
    "drift": ("soil that dries or hardens with time", "soil that builds up on the rim"),
    "drivetrain_friction": ("cross-talk between torque and pull",),
    "hard_layer": ("a crust that breaks", "a rim that is not flat across"),
    "load_gain": ("a wrong gain of the pull's sensor",),
    "rim_adhesion": ("a soil whose own strength grows by less than its share with pressure",),
    "rolling_radius": ("soil that builds up on the rim", "a wrong gain of the pull's sensor"),
    "sinkage_offset": ("a wheel that is tilted",),
    "slip_sinkage": ("a frame that bends under the pull", "soil that flows out sideways"),
    "stress_peak_shift": ("weight that a tow frame shifts",),
    "time_lag": ("play or friction in a linkage or a guide",),
    "torque_gain": (
        "a wrong gain of the pull's sensor", "cross-talk between torque and pull", "a torque's sensor that saturates",
    ),
    "tyre_deflection": ("a crust that breaks", "a frame that bends"),
}  # fmt: skip
"""By the effect's slug."""

_OF_CHANNELS = {
    "a carriage that rubs on its rails, a pull cell that is not level, or ground that slopes": {PULL},
    "a wrong gain of the pull's sensor": {PULL},
    "cross-talk between torque and pull": {TORQUE, PULL},
    "a torque's sensor that saturates": {TORQUE},
}
"""Channels without which a cause is none of a recording."""


def outside(slugs: Iterable[str], answers: Collection[int]) -> list[str]:
    """Say what the catalogue lacks and looks like effects that were found, of a recording with these answers."""
    told = []
    for slug in sorted(set(slugs)):
        causes = [each for each in LOOK_ALIKES.get(slug, ()) if _OF_CHANNELS.get(each, set()) <= set(answers)]
        told += [f"like {readable.effect(slug)} {' or '.join(causes)}"] if causes else []
    return [f"causes that the catalogue lacks may look the same: {'; '.join(told)}"] if told else []


def unstated_lugs(slugs: Collection[str], wheel: Wheel) -> list[str]:
    """Say what lugs look like, where the vehicle's description tells of none: a torque gain, for soil that shears at
    their tips turns the wheel with more torque (unless it says that there are none), and what else comes round.
    """
    told = []
    if "torque_gain" in slugs and "grouser_height_m" not in wheel.model_fields_set:
        told.append(
            "lugs may look like torque gain, and the vehicle says nothing of them: if the wheel has any, state "
            "grouser_height_m and grouser_count, else grouser_height_m = 0"
        )
    if "grousers" in slugs and not wheel.grouser_count:
        told.append(
            "the vehicle states no lugs, and teeth of gears, a chain or a motor's cogging come round with the wheel as "
            "they do: if the wheel has lugs, state grouser_height_m and grouser_count, else these are none"
        )
    return told
