"""The wheel flattens under its load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import SINKAGE, Contact, Drive, Effect, Parameter, Situation
from ..registry import register


@register
class TyreDeflection(Effect):
    """A flattened wheel touches like a larger, rigid one.

    The larger circle enters the soil where the flattened wheel does: with chord^2 = 8 r (z + delta) = 8 r* z, the
    parabola for the arc, r* = r (1 + delta / z).
    """

    slug = "tyre_deflection"
    title = "tyre deflection"
    what_happens = "the wheel flattens under its load"
    check = "load the wheel on a hard floor and read how far its axle comes down"
    form = "circle"
    equation = "r* = r (1 + delta / z), delta = W / k_t"
    source = "after C. Harnisch et al., Vehicle System Dynamics 43 Suppl. (2005): a larger circle"

    def __init__(self, load_N: float, radius_m: float) -> None:
        self._made_of = load_N, radius_m
        usual = 0.05 * radius_m / load_N
        source = (
            "engineering judgement: a firm tyre flattens by 2 % of the radius under the mean load, a soft one by 20 %"
        )
        self.parameters = (Parameter("compliance", "m/N", 0.0, 8.0 * usual, usual, usual, source),)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms where load varies; those of a pressure where sinkage was measured, too."""
        if not situation.drive.has("load_N"):
            return ()
        load, wheel = float(np.nanmean(situation.drive.load_N)), situation.wheel
        answer: list[Effect] = [TyreDeflection(load, wheel.radius_m)]
        if situation.measures(SINKAGE):
            # The mean stress is the load over the contact; that at the peak, which flattens first, is a little more.
            depth = np.clip(np.nanmedian(situation.sinkage_m), 1e-3 * wheel.radius_m, wheel.radius_m)
            mean = load / (wheel.width_m * np.sqrt(2.0 * wheel.radius_m * depth))
            pressures = tuple(float(share * mean) for share in (1.0, 1.3, 1.7))
            answer += [FlatTyre(pressures, of_axle=of_axle) for of_axle in (False, True)]
        return answer

    def extensions(self) -> list[Effect]:
        return [SubstituteCircle(*self._made_of)]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        rigid = contact.wheel.radius_m
        deflection = values[0] * np.maximum(drive.load_N, 0.0)
        flat = rigid * (1.0 - np.cos(contact.theta_1))
        sinkage = self.sinkage_m(flat, deflection)
        larger = np.where(flat > 0.0, sinkage / np.maximum(flat, 1e-12), 1.0)
        contact.radius_m = contact.radius_m * larger
        contact.shear_radius_m = contact.shear_radius_m + rigid * (larger - 1.0)
        contact.advance_m = contact.advance_m * larger
        contact.sinkage_m = sinkage

    def sinkage_m(self, flat_m: np.ndarray, deflection_m: np.ndarray) -> np.ndarray:
        """Give the sinkage (n,) [m] of the larger circle that enters at the angle at which the wheel sinks `flat_m`."""
        # z = r* (1 - cos theta_1) with r* = r (1 + delta / z) is quadratic in z.
        return 0.5 * (flat_m + np.sqrt(flat_m**2 + 4.0 * flat_m * deflection_m))


class SubstituteCircle(TyreDeflection):
    """From its lowest point on the larger circle is as long as the whole contact, the flat behind the axle with it."""

    form = "substitute circle"
    default_form = False
    equation = "r* = r [sqrt(1 + delta / z) + sqrt(delta / z)]^2, delta = W / k_t"
    source = "I. C. Schmid, J. Terramechanics 32 (1995), 3-26: substitution circle"

    def extensions(self) -> list[Effect]:
        return []

    def sinkage_m(self, flat_m: np.ndarray, deflection_m: np.ndarray) -> np.ndarray:
        # With z = r* (1 - cos theta_1) the squares cancel.
        return flat_m + 2.0 * np.sqrt(flat_m * deflection_m)


class FlatTyre(TyreDeflection):
    """A tyre flattens where the ground would press harder than its own pressure: there it presses evenly.

    The ground is then as deep as that pressure takes it, the rest of the entry's depth is the tyre's deflection; or,
    where sinkage is measured by the axle's height, as deep as the rim's circle.
    """

    nested = False
    source = "M. G. Bekker, Introduction to Terrain-Vehicle Systems (1969), elastic mode of a pneumatic tyre"

    def __init__(self, pressures_Pa: tuple[float, ...], *, of_axle: bool = False) -> None:
        self._pressures, self._of_axle = pressures_Pa, of_axle
        self.form = "pressure, sinkage of the axle" if of_axle else "pressure"
        self.equation = "sigma <= p_g" + ("" if of_axle else "; z = b (p_g / S)^(1/n) where the wheel is flat")
        middle = pressures_Pa[len(pressures_Pa) // 2]
        self.parameters = (
            Parameter(
                "p_g", "Pa", 0.05 * middle, 20.0 * middle, middle, 2.0 * middle,
                "engineering judgement: a tyre that flattens has about the mean pressure of the contact",
                null=5.0 * middle,
            ),
        )  # fmt: skip

    def extensions(self) -> list[Effect]:
        return []

    def starts(self) -> list[np.ndarray]:
        return [np.array([pressure]) for pressure in self._pressures]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.most_normal_Pa = values[0]
        if self._of_axle:
            return
        flat = contact.wheel.width_m * (values[0] / contact.stiffness_Pa) ** (1.0 / contact.n)
        contact.sinkage_m = np.minimum(contact.sinkage_m, flat)
