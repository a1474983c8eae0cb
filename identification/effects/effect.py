"""What an effect is: something that the textbook wheel leaves out, with its formula, parameters and place to enter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np

from ...framework.core.track.place import ALONG_X, Axis
from ...framework.core.vehicle import Wheel
from ..mechanics.fields import COLUMN

Kind = Literal["physics", "instrument", "unknown"]

LOAD, TORQUE, SINKAGE, SLIP, PULL = range(5)
"""Columns of an array of channels, in the order of `textbook.CHANNELS`."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect.

    Parameters
    ----------
    name, unit
        Its name, and its SI unit (``""`` for a pure number).
    low, high
        Bounds.
    start
        Where the search starts.
    scale
        Standard deviation of the prior about `null`: how strong the effect usually is.
    null
        The value at which the effect vanishes, or the usual one where none does so.
    step
        Step of the difference that derivatives are taken by, where a minute one would not do.
    published
        Range that published values fill, with room: an effect that needs one beyond it stands in for something else.
    """

    name: str
    unit: str
    low: float
    high: float
    start: float
    scale: float
    null: float = 0.0
    step: float = 0.0
    published: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True)
class Drive:
    """What is known of each sample besides the channels that answer, all (n,), NaN where not observed.

    Parameters
    ----------
    load_N, slip
        As measured.
    time_s, travel_speed_m_s, rim_speed_m_s, wheel_angle_rad, pitch_rad, pass_number, x_m, y_m
        Channels; `pass_number` is 1 on fresh ground, `rim_speed_m_s` is r omega.
    place_m
        Place along the track (`track.place_of`): `x_m` where it runs that way.
    slip_before
        Size of the slip of the wheel that ran before at the same place [-] (`passes.slip_before`); on fresh ground it
        says nothing.
    acceleration_m_s2, angular_acceleration_rad_s2
        dV/dt and d(omega)/dt, smoothed.
    stretch
        Number of the uninterrupted stretch of time that a sample belongs to: one run, pass and wheel.
    axis
        Direction in which the track runs in the plane; None where it turns.
    """

    load_N: np.ndarray
    slip: np.ndarray
    time_s: np.ndarray
    travel_speed_m_s: np.ndarray
    rim_speed_m_s: np.ndarray
    wheel_angle_rad: np.ndarray
    pitch_rad: np.ndarray
    pass_number: np.ndarray
    place_m: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    acceleration_m_s2: np.ndarray
    angular_acceleration_rad_s2: np.ndarray
    stretch: np.ndarray
    slip_before: np.ndarray
    axis: Axis | None = ALONG_X

    def __len__(self) -> int:
        return len(self.load_N)

    @property
    def timed(self) -> bool:
        """Whether rows follow from one another in time: steady trials do not, each a stretch of its own."""
        return bool(np.isfinite(self.time_s).all() and (np.diff(self.stretch) == 0).any())

    @cached_property
    def runs(self) -> tuple[np.ndarray, ...]:
        """Rows of each uninterrupted run of the clock: instruments do not forget where a new pass begins at once."""
        step = np.diff(self.time_s)
        usual = np.median(step[step > 0.0]) if (step > 0.0).any() else math.inf
        broken = (np.diff(self.stretch) != 0) & ~((step > 0.0) & (step < 2.0 * usual))
        return tuple(np.split(np.arange(len(self)), np.flatnonzero(broken) + 1))

    def has(self, name: str) -> bool:
        """Say whether a channel was observed in most samples and is not constant."""
        values = getattr(self, name)
        seen = np.isfinite(values)
        return bool(seen.mean() > 0.5) and float(np.ptp(values[seen])) > 1e-9 * max(
            float(np.abs(values[seen]).max()), 1e-9
        )


_LEAST_FRICTION = 0.1
"""Least tan phi that the strength of a soil is reckoned from [-]: a fit may end without any."""

_SHALLOW = 0.05
"""Least sinkage that the length of the contact is reckoned from, and that where none was seen [wheel radii]."""

COVARIATES = tuple(name for name in Drive.__dataclass_fields__ if name != "axis")
"""What a drive has of each sample."""


@dataclass(frozen=True)
class Situation:
    """What decides which forms of an effect a recording can show, and how strong they usually are.

    Parameters
    ----------
    wheel
        The wheel.
    drive
        Samples' covariates.
    typical : (5,)
        Root mean square of each channel of `textbook.CHANNELS`, NaN where it was not observed.
    sinkage_m : (n,)
        As measured, NaN where not observed.
    innovations : (n, 5)
        What the textbook wheel leaves of each channel, made white, gross errors cut short; NaN where not observed.
    c_Pa, tan_phi, stiffness_Pa
        The soil that the textbook wheel fits.
    places
        Parameter vectors at which to look for another soil, by the attribute of the drive along which it lies, where
        somebody laid them out.
    """

    wheel: Wheel
    drive: Drive
    typical: np.ndarray
    sinkage_m: np.ndarray
    innovations: np.ndarray
    c_Pa: float
    tan_phi: float
    stiffness_Pa: float
    places: Mapping[str, Sequence[np.ndarray]] = field(default_factory=dict)

    @property
    def depth_m(self) -> float:
        """Usual sinkage, where none was seen a small one."""
        least = _SHALLOW * self.wheel.radius_m
        return max(float(np.nanmedian(self.sinkage_m)), least) if np.isfinite(self.sinkage_m).any() else least

    @property
    def strength_Pa(self) -> float:
        """Shear strength of the soil at the mean pressure below the rim."""
        radius, depth = self.wheel.radius_m, min(self.depth_m, self.wheel.radius_m)
        length = math.sqrt(depth * (2.0 * radius - depth))
        pressure = float(np.nanmedian(np.abs(self.drive.load_N))) / (self.wheel.width_m * length)
        return max(self.c_Pa, 0.0) + pressure * max(self.tan_phi, _LEAST_FRICTION)

    def seen(self, *channels: int) -> bool:
        """Say whether one of the channels, by number, was observed."""
        return bool(np.isfinite(self.typical[list(channels)]).any())


class Contact:
    """Rows of a contact under construction (n, f): each field of `fields.FIELDS` is an attribute, (n,).

    `sinkage_m` (n,) is what the geometry gives, and `wheel` the wheel.
    """

    def __init__(self, array: np.ndarray, wheel: Wheel) -> None:
        object.__setattr__(self, "array", array)
        object.__setattr__(self, "wheel", wheel)
        object.__setattr__(self, "sinkage_m", wheel.radius_m * (1.0 - np.cos(self.theta_1)))

    array: np.ndarray
    wheel: Wheel
    sinkage_m: np.ndarray

    def __getattr__(self, name: str) -> np.ndarray:
        if name not in COLUMN:
            raise AttributeError(name)
        return self.array[:, COLUMN[name]]

    def __setattr__(self, name: str, values: np.ndarray | float) -> None:
        if name in COLUMN:
            self.array[:, COLUMN[name]] = values
        else:
            object.__setattr__(self, name, values)


class Effect:
    """An effect, at most one of whose four places to enter a sub-class overrides, or several.

    In each, `values` (k,) are the parameters in the order of `parameters`.
    """

    slug: ClassVar[str]
    kind: Kind = "physics"
    nested: ClassVar[bool] = True
    """Whether the effect vanishes smoothly at its null values: its first step from there tells what it is worth."""
    choices: int = 1
    """Discrete alternatives, as numbers of lugs, among which it was laid out: each has an equal share of its prior."""
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    form: str = ""
    """Which published form, or which channel, where an effect has several."""
    usual: bool = True
    """Whether it is meant where several forms have the parameters that are named."""
    needs: tuple[str, ...] = ()
    """Attributes of `Drive` without which the formula says nothing of a sample."""
    required: tuple[str, ...] = ()
    """Parameters that have to be stated where an effect is asked for by name; the others are `Parameter.null` then."""
    local: ClassVar[bool] = False
    """Whether it says what the ground's variation along the track could say too."""
    edges: ClassVar[slice] = slice(0)
    """Parameters that say where it begins and ends: no rows but those nearby tell them."""
    by_run: ClassVar[bool] = False
    """Whether its parameters say what each run of a recording was, which is nothing to another drive."""
    of_ground: ClassVar[bool] = False
    """Whether it says what the soil is, from place to place or pass to pass: others act on that."""
    remembers: ClassVar[bool] = False
    """Whether what is reported of a sample follows from samples before it."""
    any_course: tuple[str, str] | None = None
    """Channel, and variable with which it changes in whatever course: what else changes so is the same effect."""
    expected: bool = False
    """Whether the vehicle's description says that it is there, so that the textbook wheel is known to lack it."""
    ripples: slice | None = None
    """Parameters of what comes and goes with the wheel's turns, for which nothing else stands in."""
    freed: bool = False
    """Whether it is what another form's `freer` gives, and may hold a third form as well."""
    said_by: str = ""
    """Slug of another effect whose whole law says what this form says, which is only a part of its own."""
    remark: str = ""
    """What there is to say of it where it is found."""
    check: str = ""
    """What tells whether it is there, where something simpler than a drive does."""
    constants: Mapping[str, float] = MappingProxyType({})
    """What the formula holds besides its parameters, taken from the drive that it was found on, by name [SI]."""

    @property
    def name(self) -> str:
        """Slug, and form in brackets where there is one."""
        return f"{self.slug}[{self.form}]" if self.form else self.slug

    @property
    def moves_wheel(self) -> np.ndarray:
        """(k,) True for parameters that may change how the wheel stands in the ground, with its stresses: the others
        change forces and sinkage only.
        """
        kind = type(self)
        answer = np.full(len(self.parameters), kind.contact is not Effect.contact or kind.impose is not Effect.impose)
        if self.ripples is not None:
            answer[self.ripples] = False
        return answer

    def starts(self) -> list[np.ndarray]:
        """Parameter vectors (k,) at which a search may start."""
        return [np.array([parameter.start for parameter in self.parameters])]

    def beside(self, soil: np.ndarray) -> np.ndarray:
        """Give the soil (5,), in internal coordinates, to start from with the effect, from the one without it."""
        return soil

    def unheard_of(self, values: np.ndarray, sd: np.ndarray) -> list[str]:
        """Say, in words, which parameters (k,), known to their standard deviations, are beyond what was published."""
        return [
            f"{parameter.name} = {value:.3g}"
            for parameter, value in zip(self.parameters, values, strict=True)
            if not parameter.published[0] <= value <= parameter.published[1]
        ]

    def as_announced(self, values: np.ndarray, sd: np.ndarray) -> bool:
        """Say whether what is `expected` came out as the vehicle's description has it: the form is right, then."""
        return False

    def delay(self, values: np.ndarray) -> tuple[int, float] | None:
        """Give the channel, of `textbook.CHANNELS`, that arrives late and by how many samples; None where none does."""
        return None

    def extent(self, values: np.ndarray) -> tuple[str, float, float] | None:
        """Give the attribute of `Drive` along which the effect is a stretch, and its ends; None where it is none."""
        return None

    def variants(self) -> list[Effect]:
        """Give the same effect with other constants, which are tried once it is found, the likeliest first."""
        return []

    def freer(self) -> list[Effect]:
        """Give the same effect with further parameters behind its own, which are tried once it is found."""
        return []

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        """Correct the load [N] and slip that the wheel truly had, (n, 2), in place, from those reported."""

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Change geometry, pressure-sinkage or shear law, in place, at the entry angle that `contact` holds."""

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Add forces: `channels` (n, 5) as `textbook.CHANNELS`, in place, with the entry angle found."""

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        """Change what the instruments report: `channels` (n, 5), in place."""
