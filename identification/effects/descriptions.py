"""What each effect of the catalogue is called, and what happens, in one line."""

from __future__ import annotations

from typing import NamedTuple


class Description(NamedTuple):
    """Name of an effect, and a clause that says what happens: no capital, no full stop."""

    name: str
    what: str


DESCRIPTIONS = {
    slug: Description(*text)
    for slug, text in {
        "slip_sinkage": ("slip-sinkage", "a slipping wheel carries soil out from under itself and sinks further"),
        "stress_peak_shift": ("shift of the peak stress", "the peak of normal stress moves along the rim with slip"),
        "exit_angle": ("exit angle", "soil rebounds behind the wheel's lowest point and stays in contact with the rim"),
        "shear_hump": ("shear hump", "shear stress peaks, then falls to a residual value"),
        "rate_dependence": ("rate dependence", "soil is stiffer or stronger the faster it is loaded"),
        "multipass_compaction": ("multipass compaction", "later passes run on soil that earlier wheels compacted"),
        "hard_layer": ("hard layer", "a stiffer layer lies beneath the soil"),
        "soil_patch": ("soil patch", "the soil differs over a stretch of the track"),
        "rim_adhesion": ("slip on the rim", "soil slips on the rim before it shears within"),
        "bulldozing": ("bulldozing", "soil is pushed up in front of the wheel, which costs pull"),
        "side_wall_friction": ("side-wall friction", "the buried flanks of the wheel rub on soil"),
        "grousers": ("grousers", "lugs move the shear surface outwards and make forces ripple"),
        "tyre_deflection": ("tyre deflection", "the wheel flattens under its load"),
        "slope_gravity": ("gravity on the slope", "on a slope, weight has a component along the track"),
        "inertia": ("inertia", "wheel and vehicle accelerate: torque and pull are not those of a steady state"),
        "drivetrain_friction": (
            "friction of the drive train", "torque measured at the motor includes gear and bearing losses",
        ),
        "torque_offset": ("torque offset", "the zero of the torque sensor is wrong"),
        "torque_gain": ("torque gain", "the constant of the torque sensor or motor is wrong"),
        "load_gain": ("load gain", "the load cell's constant, or the wheel's share of the weight, is wrong"),
        "sinkage_offset": ("sinkage offset", "the zero of the sinkage sensor is wrong"),
        "rolling_radius": ("rolling radius", "slip was computed with a wrong effective radius"),
        "time_lag": ("time lag", "a channel arrives late"),
        "drift": ("drift", "a channel wanders with time"),
        "unknown": ("unknown", "nothing in the catalogue explains it"),
    }.items()
}  # fmt: skip
"""By public name; ``unknown`` is what the catalogue lacks."""
