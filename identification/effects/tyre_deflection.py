"""The wheel flattens under its load."""

from __future__ import annotations

import numpy as np

from .effect import SINKAGE, Contact, Drive, Effect, Parameter, Situation


class TyreDeflection(Effect):
    """A flattened wheel touches like a larger, rigid one.

    The larger circle enters the soil where the flattened wheel does: with chord^2 = 8 r (z + delta) = 8 r* z, the
    parabola for the arc, r* = r (1 + delta / z).
    """

    slug = "tyre_deflection"
    form = "circle"
    equation = "r* = r (1 + delta / z), delta = W / k_t"
    source = "after C. Harnisch et al., Vehicle System Dynamics 43 Suppl. (2005): a larger circle"

    def __init__(self, load_N: float, radius_m: float) -> None:
        self._of = load_N, radius_m
        # Two per cent of the radius under the mean load is a firm tyre, twenty a soft one.
        usual = 0.05 * radius_m / load_N
        self.parameters = (Parameter("compliance", "m/N", 0.0, 8.0 * usual, usual, usual),)

    def variants(self) -> list[Effect]:
        return [SubstituteCircle(*self._of)]

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
    usual = False
    equation = "r* = r [sqrt(1 + delta / z) + sqrt(delta / z)]^2, delta = W / k_t"
    source = "I. C. Schmid, J. Terramechanics 32 (1995), 3-26: substitution circle"

    def variants(self) -> list[Effect]:
        return []

    def sinkage_m(self, flat_m: np.ndarray, deflection_m: np.ndarray) -> np.ndarray:
        # With z = r* (1 - cos theta_1) the squares cancel.
        return flat_m + 2.0 * np.sqrt(flat_m * deflection_m)


class FlatTyre(Effect):
    """A tyre flattens where the ground would press harder than its own pressure: there it presses evenly.

    The ground is then as deep as that pressure takes it, the rest of the entry's depth is the tyre's deflection; or,
    where the axle's height is what sinkage is measured by, as deep as the rim's circle.
    """

    slug = "tyre_deflection"
    nested = False
    source = "M. G. Bekker, Introduction to Terrain-Vehicle Systems (1969), elastic mode of a pneumatic tyre"

    def __init__(self, pressures_Pa: tuple[float, ...], *, of_axle: bool = False) -> None:
        self._pressures, self._of_axle = pressures_Pa, of_axle
        self.form = "pressure, sinkage of the axle" if of_axle else "pressure"
        self.equation = "sigma <= p_g" + ("" if of_axle else "; z = b (p_g / S)^(1/n) where the wheel is flat")
        middle = pressures_Pa[len(pressures_Pa) // 2]
        self.parameters = (Parameter("p_g", "Pa", 0.05 * middle, 20.0 * middle, middle, 2.0 * middle, 5.0 * middle),)

    def starts(self) -> list[np.ndarray]:
        return [np.array([pressure]) for pressure in self._pressures]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.most_normal_Pa = values[0]
        if self._of_axle:
            return
        flat = contact.wheel.width_m * (values[0] / contact.stiffness_Pa) ** (1.0 / contact.n)
        contact.sinkage_m = np.minimum(contact.sinkage_m, flat)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: the load has to vary."""
    if not situation.drive.has("load_N"):
        return ()
    load, wheel = float(np.nanmean(situation.drive.load_N)), situation.wheel
    answer: tuple[Effect, ...] = (TyreDeflection(load, wheel.radius_m),)
    if situation.seen(SINKAGE):
        # The mean stress is the load over the contact; the peak's, which a tyre flattens first, a little more.
        depth = np.clip(np.nanmedian(situation.sinkage_m), 1e-3 * wheel.radius_m, wheel.radius_m)
        mean = load / (wheel.width_m * np.sqrt(2.0 * wheel.radius_m * depth))
        pressures = tuple(float(share * mean) for share in (1.0, 1.3, 1.7))
        answer += tuple(FlatTyre(pressures, of_axle=of_axle) for of_axle in (False, True))
    return answer


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for."""
    every = forms(situation)
    return every + tuple(variant for effect in every for variant in effect.variants())
