"""Lugs move the shear surface outwards, bite, and make the forces ripple."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.special import exprel
from scipy.stats import gamma

from ....framework.core.vehicle import Wheel
from ..effect import PULL, SINKAGE, TORQUE, Contact, Drive, Effect, Parameter, Situation
from ..registry import register
from ..sensors import SYMBOLS

_FEWEST_LUGS, _MOST_LUGS = 3, 60

_UNSTATED = 0.1
"""Height of lugs that the vehicle's description does not state, as a share of the radius [-]."""

_STATED = 0.5
"""Prior probability of lugs that the vehicle's description states [-]: they are there, but the radius stated may be
that of the surface at which soil shears already."""

_BY_CHANCE = 0.01
"""Probability with which noise has a line of the order spectrum that is considered [-]."""

_FEW_ORDERS, _OVERTONES = 2, {1: "", 2: ", overtone", 3: ", 2 overtones", 4: ", 3 overtones"}
"""Harmonics of a ripple at first (extensions have more), and the end of the form's name by their number."""

_RADIUS_PRIOR = "L. Ding et al. (2011): the equivalent shear radius lies between the rim, s = 0, and the tips, s = 1"
_THRUST_PRIOR = "engineering judgement: 1 by definition, less for lugs that shade each other"
_RIPPLE_PRIOR = "engineering judgement: forces ripple by a tenth, sinkage by a tenth of the lugs' height"


@register
class Grousers(Effect):
    """What the forms share."""

    slug = "grousers"
    title = "grousers"
    what_happens = "lugs move the shear surface outwards and make forces ripple"
    check = "count the lugs and measure their height; drive the same with the lugs covered"
    of_any_wheel = True

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give lugs that the vehicle's description states, and ripples at their number or at lines that stand out."""
        wheel, drive = situation.wheel, situation.drive
        answer: list[Effect] = []
        if wheel.grouser_height_m > 0.0 and situation.measures(TORQUE, PULL):
            answer += [*_steady(wheel.grouser_height_m, wheel.grouser_count), LugTips(wheel.grouser_height_m)]
        if drive.has("wheel_angle_rad") and np.nanmax(drive.wheel_angle_rad) - np.nanmin(drive.wheel_angle_rad) > np.pi:
            for count in lug_counts(wheel, drive, situation.innovations):
                answer += _ripples(wheel, count, situation, _most_orders(drive.wheel_angle_rad, count))
        return answer

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms of the vehicle's lugs, however far the wheel turns."""
        wheel = situation.wheel
        answer: list[Effect] = []
        if wheel.grouser_height_m > 0.0:
            answer += [*_steady(wheel.grouser_height_m, wheel.grouser_count), LugTips(wheel.grouser_height_m)]
        if wheel.grouser_count and situation.drive.has("wheel_angle_rad"):
            answer += _ripples(wheel, wheel.grouser_count, situation, max(_OVERTONES))
        return answer


class LugRadius(Grousers):
    """Soil shears beyond the rim, at a share of the lugs' height."""

    source = "L. Ding et al., J. Terramechanics 48 (2011), 27-45, equivalent shear radius"
    parameters = (Parameter("s", "", 0.0, 2.0, 0.4, 0.6, _RADIUS_PRIOR),)
    prior_probability = _STATED

    def __init__(self, height_m: float, *, its_slip: bool = False) -> None:
        self._height, self._its_slip = height_m, its_slip
        self.form = "radius with its slip" if its_slip else "radius"
        self.default_form = not its_slip
        self.equation = "r_s = r + s h: shear displacement, thrust and torque at r_s" + (
            ", slip i = 1 - V / (r_s omega)" if its_slip else ""
        )

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        beyond = values[0] * self._height
        if self._its_slip:
            contact.advance_m = contact.advance_m * (1.0 + beyond / contact.wheel.radius_m)
        contact.shear_radius_m = contact.shear_radius_m + beyond
        contact.lever_m = contact.lever_m + beyond


class LugTips(LugRadius):
    """Soil is dragged along, and shears, at the lugs' tips; its stress turns the wheel by the rim's radius.

    A slip that is computed with the radius of the tips, and taken for the rim's, looks much the same.
    """

    nested = False
    required = ("s",)
    source = "after L. Ding et al., J. Terramechanics 48 (2011), 27-45: shear displacement of the lugs' tips"
    parameters = (
        Parameter("s", "", 0.0, 2.0, 1.0, 0.1, "definition: at the tips, within a tenth of the lugs' height", null=1.0),
    )

    def __init__(self, height_m: float) -> None:
        super().__init__(height_m)
        self.form, self.default_form = "displacement of the tips", False
        self.equation = "r_s = r + s h: shear displacement and thrust at r_s, torque with the lever r"

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.shear_radius_m = contact.shear_radius_m + values[0] * self._height


class LugThrust(Grousers):
    """Lugs in the ground push soil that yields together with the shear beneath the wheel."""

    default_form = False
    changes = (TORQUE, PULL)
    prior_probability = _STATED
    _lever: float
    """Where the thrust acts, a share of the lugs' height beyond the rim [-]."""

    def __init__(self, height_m: float, force: str) -> None:
        self._height = height_m
        at = "r + h" if self._lever == 1.0 else f"r + {self._lever:g} h"
        self.equation = (
            f"F = s {force}, j = r theta_1 - V/omega sin theta_1; T += F ({at}), DP += F sin(theta_1) / theta_1"
        )
        self.parameters = (Parameter("s", "", 0.0, 3.0, 0.3, 0.5, _THRUST_PRIOR),)

    @abstractmethod
    def most(self, contact: Contact, drive: Drive) -> np.ndarray:
        """Thrust (n,) [N] of fully sheared soil."""

    @abstractmethod
    def mobilised(self, sheared: np.ndarray) -> np.ndarray:
        """Share of it (n,) by the displacement of the soil at the wheel's lowest point, in shear moduli (n,)."""

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        theta_1 = contact.theta_1
        slipped = contact.radius_m * theta_1 - contact.advance_m * np.sin(theta_1)
        mobilised = np.sign(slipped) * self.mobilised(np.abs(slipped) / contact.k_m)
        thrust = values[0] * self.most(contact, drive) * mobilised
        channels[:, TORQUE] += thrust * (contact.radius_m + self._lever * self._height)
        channels[:, PULL] += thrust * np.sin(theta_1) / theta_1


class LugFaces(LugThrust):
    """The faces of the lugs in the ground push soil that resists passively.

    The surcharge is the mean stress on the contact; each lug in the ground resists by a share that is mobilised as
    soil shears. That lugs dig themselves in as they slip is slip-sinkage.
    """

    source = "M. G. Bekker, Off-the-Road Locomotion (1960), passive resistance to a spud under surcharge"
    form = "thrust of the lugs"
    _lever = 0.5

    def __init__(self, height_m: float, count: int) -> None:
        super().__init__(height_m, "N theta_1 / (2 pi) b h (q K_p + 2 c sqrt(K_p)) [1 - exp(-j/K)]")
        self._count = count
        self.equation += "; K_p = tan^2(pi/4 + phi/2), q = W / (b r sin theta_1)"

    def most(self, contact: Contact, drive: Drive) -> np.ndarray:
        theta_1, width = contact.theta_1, contact.wheel.width_m
        passive = np.tan(0.25 * np.pi + 0.5 * np.arctan(contact.tan_phi))
        surcharge = drive.load_N / (width * contact.radius_m * np.sin(theta_1))
        lugs = self._count * theta_1 / (2.0 * np.pi)
        return lugs * width * self._height * (surcharge * passive**2 + 2.0 * contact.c_Pa * passive)

    def mobilised(self, sheared: np.ndarray) -> np.ndarray:
        return -np.expm1(-sheared)


class LugSides(LugThrust):
    """The soil between the lugs shears along its sides, too, at the lugs' tips."""

    source = (
        "M. G. Bekker, Theory of Land Locomotion (1956), thrust of spuds by the sides of the sheared block; Z. Janosi "
        "and B. Hanamoto, 1st Int. Conf. Terrain-Vehicle Systems (1961), shear along a track"
    )
    form = "sides of the lugs"
    _lever = 1.0

    def __init__(self, height_m: float) -> None:
        force = "[2 h r theta_1 c + 0.64 (h/b) arccot(h/b) W tan(phi)] [1 - K/j (1 - exp(-j/K))]"
        super().__init__(height_m, force)

    def most(self, contact: Contact, drive: Drive) -> np.ndarray:
        width, height = contact.wheel.width_m, self._height
        cohesive = 2.0 * height * contact.radius_m * contact.theta_1 * contact.c_Pa
        return cohesive + 0.64 * height / width * np.arctan2(width, height) * drive.load_N * contact.tan_phi

    def mobilised(self, sheared: np.ndarray) -> np.ndarray:
        # Displacement grows from zero along the block.
        return 1.0 - exprel(-sheared)


class LugRipple(Grousers):
    """Forces and sinkage ripple as lugs enter and leave, once a lug; sharper lugs with overtones."""

    source = "after R. A. Irani et al., J. Terramechanics 48 (2011), periodic term at the lugs' passing"
    needs = ("wheel_angle_rad",)

    def __init__(self, count: int, typical: np.ndarray, wheel: Wheel, *, orders: int = 1) -> None:
        self.form = f"ripple, {count} lugs{_OVERTONES[orders]}"
        self.count, stated = count, wheel.grouser_count
        self._orders = tuple(range(1, orders + 1))
        own = [("" if order == 1 else str(order), order * count) for order in self._orders]
        self.equation = "T, DP, z += " + " + ".join(f"a{n} cos({k} theta_w) + b{n} sin({k} theta_w)" for n, k in own)
        self._latest: tuple[Drive, np.ndarray] | None = None
        # The vehicle's own number was not searched for; multiples of it are overtones of its lugs.
        self.choices = _MOST_LUGS + 1 - _FEWEST_LUGS if count != stated else 1
        if stated and count % stated:
            self.kind = "instrument"
            self.remark = f"the channels ripple {count} times a turn, and the vehicle is said to have {stated} lugs"
        if stated and count % stated == 0:
            self.prior_probability = _STATED
        else:
            self.check = f"count the wheel's lugs, and what recurs {count} times a turn in its gears or chain"
        self._channels = [channel for channel in (TORQUE, PULL, SINKAGE) if np.isfinite(typical[channel])]
        self.changes = tuple(self._channels)
        self.parameters = tuple(
            Parameter(f"{part}{number}_{symbol}", unit, -usual, usual, 0.0, 0.1 * usual, _RIPPLE_PRIOR)
            for number, _ in own
            for part in "ab"
            for channel in self._channels
            for (symbol, unit), usual in [(SYMBOLS[channel], float(typical[channel]))]
        )

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, self._channels] += self.waves(drive, values)

    def waves(self, drive: Drive, values: np.ndarray) -> np.ndarray:
        """Ripple of each channel, (n, channels), in the unit of the parameters."""
        return self._turns(drive) @ values.reshape(2 * len(self._orders), len(self._channels))

    def _turns(self, drive: Drive) -> np.ndarray:
        """Cosine and sine of each order, (n, 2 k), kept for the next call: a fit needs those of one drive often."""
        latest = self._latest
        if latest is None or latest[0] is not drive:
            phase = np.outer(np.nan_to_num(drive.wheel_angle_rad), np.multiply(self._orders, self.count))
            turns = np.stack([np.cos(phase), np.sin(phase)], axis=-1).reshape(len(drive), -1)
            self._latest = latest = drive, turns
        return latest[1]


class Lugs(LugRipple):
    """Soil shears beyond the rim; forces ripple with the torque and sinkage with the lugs' height, or all evenly."""

    def __init__(
        self, count: int, typical: np.ndarray, wheel: Wheel, *, orders: int = 1, most_orders: int = 1,
        steady: Effect | None = None, even: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(count, typical, wheel, orders=orders)
        self._made_of, self._most_orders = (count, typical, wheel), most_orders
        self._height = wheel.grouser_height_m or _UNSTATED * wheel.radius_m
        self._radius_m = wheel.radius_m
        self._steady = steady or LugRadius(self._height)
        self._even = even
        self._varied = steady is not None or even
        self.form = f"{self._steady.form} and {'even ' if even else ''}{self.form}"
        self.default_form, self.changes = self._steady.default_form, Effect.changes
        self.source = f"{self._steady.source}; {LugRipple.source}"
        channels, waves = self.equation.split(" += ")
        rippling = f"{channels} += {waves}" if even else f"T += |T| w, DP += |T| / r w, z += h w, each w = {waves}"
        self.equation = f"{self._steady.equation}; {rippling}"
        if not wheel.grouser_height_m:
            self.equation += f"; h = {_UNSTATED:g} r, the vehicle's lugs not being stated"
        shares = tuple(Parameter(each.name, "", -1.0, 1.0, 0.0, 0.1, _RIPPLE_PRIOR) for each in self.parameters)
        self.parameters = (*self._steady.parameters, *(self.parameters if even else shares))

    @property
    def moves_wheel(self) -> np.ndarray:
        """(k,) True for the parameter of the shear surface: ripples change forces and sinkage only."""
        return np.arange(len(self.parameters)) == 0

    def extensions(self) -> list[Effect]:
        """Give the ripple with other steady effects of the lugs, evenly, and with more overtones."""
        answer: list[Effect] = []
        if not self._varied:
            vary = partial(Lugs, *self._made_of, orders=len(self._orders), most_orders=self._most_orders)
            others = [steady for steady in _steady(self._height, self.count) if steady.form != self._steady.form]
            # Last: its ripples are sizes, where those of the others are shares.
            answer += [*(vary(steady=steady) for steady in others), vary(even=True)]
        if len(self._orders) == _FEW_ORDERS:
            same = partial(Lugs, *self._made_of, steady=self._steady, even=self._even)
            answer += [same(orders=orders) for orders in range(_FEW_ORDERS + 1, self._most_orders + 1)]
        return answer

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        self._steady.contact(contact, drive, values[:1])

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        self._steady.act(channels, contact, drive, values[:1])
        waves = self.waves(drive, values[1:])
        if not self._even:
            torque = np.abs(channels[:, TORQUE])
            size = {TORQUE: torque, PULL: torque / self._radius_m, SINKAGE: np.full_like(torque, self._height)}
            waves *= np.column_stack([size[channel] for channel in self._channels])
        channels[:, self._channels] += waves


def _steady(height_m: float, count: int) -> list[Effect]:
    """What lugs do at any angle of the wheel, the usual form first."""
    answer: list[Effect] = [LugRadius(height_m, its_slip=its_slip) for its_slip in (False, True)]
    return [*answer, LugFaces(height_m, count), LugSides(height_m)] if count else answer


def _ripples(wheel: Wheel, count: int, situation: Situation, most_orders: int) -> list[Effect]:
    """Ripples of so many lugs, by themselves and with the shear radius."""
    typical, few = situation.typical, range(1, _FEW_ORDERS + 1)
    answer: list[Effect] = [LugRipple(count, typical, wheel, orders=orders) for orders in few]
    if situation.measures(TORQUE, PULL):
        answer += [Lugs(count, typical, wheel, orders=orders, most_orders=most_orders) for orders in few]
    return answer


def _most_orders(angle: np.ndarray, count: int) -> int:
    """Harmonics of the lugs' number that rows at these wheel angles (n,) [rad] resolve."""
    steps = np.abs(np.diff(angle))
    step = float(np.nanmedian(steps)) if np.isfinite(steps).any() else 0.0
    return int(min(math.pi / max(count * step, 1e-300), max(_OVERTONES)))


def lug_counts(wheel: Wheel, drive: Drive, innovations: np.ndarray) -> list[int]:
    """Numbers of lugs to consider: the vehicle's, and lines of white residuals against wheel angle that stand out.

    Lugs that are not stated may show less than a misfit that recurs with the wheel's turns: two lines, then. One that
    is the overtone of the other is not a number of its own. Of noise a line's power is Gamma distributed, its shape the
    number of channels.
    """
    power, channels = np.zeros(_MOST_LUGS + 1), 0
    for channel in (TORQUE, PULL, SINKAGE):
        good = np.isfinite(innovations[:, channel]) & np.isfinite(drive.wheel_angle_rad)
        if good.any():
            turns = np.exp(1j * np.outer(np.arange(_MOST_LUGS + 1), drive.wheel_angle_rad[good]))
            power += np.abs(turns @ innovations[good, channel]) ** 2 / good.sum()
            channels += 1
    stated = [wheel.grouser_count] if wheel.grouser_count else []
    if not power.any():
        return stated
    noise = gamma(channels, scale=np.median(power[_FEWEST_LUGS:]) / gamma.median(channels))
    least = noise.isf(_BY_CHANCE / len(power[_FEWEST_LUGS:]))
    strongest = (_FEWEST_LUGS + np.argsort(-power[_FEWEST_LUGS:])[: 1 if stated else 2]).tolist()
    lines = [line for line in strongest if power[line] > least and line not in stated]
    return stated + [line for line in lines if not any(line == 2 * other for other in lines)]
