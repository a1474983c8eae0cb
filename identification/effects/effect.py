"""An effect: something that the textbook wheel leaves out, with its formula, its parameters and where it acts."""

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

Kind = Literal["physics", "instrument"]

LOAD, TORQUE, SINKAGE, SLIP, PULL = range(5)
"""Columns of an array of channels, in the order of `textbook.CHANNELS`."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect and its prior, a normal distribution about `null` between the bounds.

    Parameters
    ----------
    name, unit
        Name, and SI unit (``""`` for a pure number).
    low, high
        Bounds.
    start
        Value at which a fit starts.
    scale
        Standard deviation of the prior: how far from `null` the parameter usually is.
    source
        Where the prior comes from: the range of published values with their reference, or an engineering judgement.
    null
        Value at which the effect vanishes, or the usual value where none does so.
    step
        Step of the difference quotient, where the default step is too small.
    """

    name: str
    unit: str
    low: float
    high: float
    start: float
    scale: float
    source: str
    null: float = 0.0
    step: float = 0.0


@dataclass(frozen=True)
class Drive:
    """Covariates of each sample, all (n,), NaN where not observed.

    Parameters
    ----------
    load_N, slip
        As measured.
    time_s, travel_speed_m_s, rim_speed_m_s, wheel_angle_rad, pitch_rad, pass_number, x_m, y_m
        Channels; `pass_number` is 1 on fresh ground, `rim_speed_m_s` is r omega.
    place_m
        Place along the track (`track.place_of`): `x_m` where it runs that way.
    slip_before
        Absolute slip of the wheel that ran before at the same place [-] (`passes.slip_before`); without meaning on
        fresh ground.
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
        """Whether rows are a time series: steady trials are not, each is a stretch of its own."""
        return bool(np.isfinite(self.time_s).all() and (np.diff(self.stretch) == 0).any())

    @cached_property
    def runs(self) -> tuple[np.ndarray, ...]:
        """Rows of each uninterrupted run of the clock: a sensor keeps its state where a new pass begins at once."""
        step = np.diff(self.time_s)
        usual = np.median(step[step > 0.0]) if (step > 0.0).any() else math.inf
        broken = (np.diff(self.stretch) != 0) & ~((step > 0.0) & (step < 2.0 * usual))
        return tuple(np.split(np.arange(len(self)), np.flatnonzero(broken) + 1))

    def has(self, name: str) -> bool:
        """Return whether a channel was observed in most samples and is not constant."""
        values = getattr(self, name)
        seen = np.isfinite(values)
        return bool(seen.mean() > 0.5) and float(np.ptp(values[seen])) > 1e-9 * max(
            float(np.abs(values[seen]).max()), 1e-9
        )


_LEAST_TAN_PHI = 0.1
"""Least tan phi from which a soil's strength is computed [-]: a fit may end at zero."""

_LEAST_DEPTH = 0.05
"""Least sinkage from which the contact's length is computed, and the one assumed where none was measured [radii]."""

COVARIATES = tuple(name for name in Drive.__dataclass_fields__ if name != "axis")
"""Covariates that a drive has of each sample."""


@dataclass(frozen=True)
class Situation:
    """What decides which forms of an effect a recording can show, and how strong they usually are (the priors).

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
        White residuals of the textbook wheel, gross errors clipped; NaN where not observed.
    c_Pa, tan_phi, stiffness_Pa
        Soil of the textbook wheel's fit.
    places
        Parameter vectors from which a fit of a soil patch starts, by the attribute of the drive along which it lies.
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
        """Median sinkage [m], a small one where none was measured."""
        least = _LEAST_DEPTH * self.wheel.radius_m
        return max(float(np.nanmedian(self.sinkage_m)), least) if np.isfinite(self.sinkage_m).any() else least

    @property
    def strength_Pa(self) -> float:
        """Shear strength of the soil at the mean pressure below the rim [Pa]."""
        radius, depth = self.wheel.radius_m, min(self.depth_m, self.wheel.radius_m)
        length = math.sqrt(depth * (2.0 * radius - depth))
        pressure = float(np.nanmedian(np.abs(self.drive.load_N))) / (self.wheel.width_m * length)
        return max(self.c_Pa, 0.0) + pressure * max(self.tan_phi, _LEAST_TAN_PHI)

    def measures(self, *channels: int) -> bool:
        """Return whether one of the channels (column numbers) was measured."""
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
    """An effect of the catalogue, in one of its forms.

    A module of an effect has one class with its name, description and check, registered with `registry.register`;
    further published forms are its sub-classes. A form enters the wheel through one or several of `impose`, `contact`,
    `act` and `report`, in each of which `values` (k,) are its parameters in the order of `parameters`.
    """

    slug: ClassVar[str]
    """Public name: in code, files, reports and on the command line."""
    title: ClassVar[str]
    """Name in text, lower case."""
    what_happens: ClassVar[str]
    """A clause that says what happens: no capital, no full stop."""
    check: str
    """Measurement that would show the effect: an imperative clause."""
    equation: str
    source: str
    """Publication that the equation comes from."""
    parameters: tuple[Parameter, ...]
    kind: Kind = "physics"
    form: str = ""
    """Which published form, or which channel, where an effect has several."""
    needs: tuple[str, ...] = ()
    """Attributes of `Drive` without which the formula has no value for a sample."""
    changes: tuple[int, ...] = (TORQUE, SINKAGE, PULL)
    """Channels that the effect changes: one of them has to be measured."""
    required: tuple[str, ...] = ()
    """Parameters that have to be stated where the effect is simulated by name; the others are `Parameter.null`."""
    constants: Mapping[str, float] = MappingProxyType({})
    """Constants of the formula that were taken from the drive that the effect was built for, by name [SI]."""
    prior_probability: float | None = None
    """Prior probability of the effect, where it is known from elsewhere (the vehicle has lugs, say); None for the usual
    one."""
    default_form: bool = True
    """Whether this form is meant where several forms have the parameters that are named."""
    nested: ClassVar[bool] = True
    """Whether the effect vanishes smoothly at its null values, so that a score test there ranks it."""
    choices: int = 1
    """Number of discrete alternatives (numbers of lugs, say) that were searched: each has an equal share of the prior.
    """
    of_ground: ClassVar[bool] = False
    """Whether it changes the soil itself, from place to place or pass to pass: applied before all others."""
    of_any_wheel: ClassVar[bool] = False
    """Whether the ground has the effect on whatever wheel comes next, so that a planner's prediction takes it over."""
    by_run: ClassVar[bool] = False
    """Whether its parameters describe the runs of one recording: not stored, for they mean nothing to another drive."""
    remembers: ClassVar[bool] = False
    """Whether a sample's report depends on earlier samples."""
    remark: str = ""
    """Note for the report if the effect is found."""

    @property
    def name(self) -> str:
        """Slug, and form in brackets where there is one."""
        return f"{self.slug}[{self.form}]" if self.form else self.slug

    @property
    def moves_wheel(self) -> np.ndarray:
        """(k,) True for parameters that may change the entry angle; the others change forces and reports only."""
        kind = type(self)
        return np.full(len(self.parameters), kind.contact is not Effect.contact or kind.impose is not Effect.impose)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Return the forms that a recording can show: one, where what it needs varies and what it changes was measured.

        A class whose constructor needs arguments, or that has several forms, overrides this.
        """
        shown = all(situation.drive.has(name) for name in cls.needs) and situation.measures(*cls.changes)
        return (cls(),) if shown else ()

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Return the forms that can be simulated by name: as `forms`, but where a column exists it need not vary."""
        return cls.forms(situation)

    def extensions(self) -> list[Effect]:
        """Return further forms, with other constants or more parameters, that are fitted once this form is probable."""
        return []

    def starts(self) -> list[np.ndarray]:
        """Parameter vectors (k,) from which fits start."""
        return [np.array([parameter.start for parameter in self.parameters])]

    def initial_soil(self, soil: np.ndarray) -> np.ndarray:
        """Return the soil (5,) [internal coordinates] from which a fit with the effect starts, from the one without."""
        return soil

    def extent(self, values: np.ndarray) -> tuple[str, float, float] | None:
        """Attribute of `Drive` along which the effect acts on an interval, and the interval; None where it has none."""
        return None

    def check_sd(self, noise: np.ndarray) -> float | None:
        """Standard deviation with which `check` measures the first parameter, from the channels' noise (5,) [SI].

        None where the check does not measure it.
        """
        return None

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        """Correct load [N] and slip (n, 2), in place, from the reported to the true ones."""

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Change geometry, pressure-sinkage or shear law, in place, at the entry angle of `contact`."""

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Add forces to `channels` (n, 5), in place, once the entry angle is found."""

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        """Change what the instruments report: `channels` (n, 5), in place."""
