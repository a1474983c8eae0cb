"""Base class of effects: physics or faults that the textbook wheel omits, with formula, parameters and priors."""

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
        Initial value of a fit.
    scale
        Standard deviation of the prior about `null`.
    source
        Source of the prior: the range of published values with their reference, or an engineering judgement.
    null
        Value at which the effect vanishes, or a typical value if there is none.
    step
        Step of the difference quotient if the default step is too small.
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
    ground, wheel
        Number of the ground, a place of one soil, and of the wheel.
    slip_before
        Absolute slip of the previous wheel at the same place [-] (`passes.slip_before`); meaningless on fresh ground.
    acceleration_m_s2, angular_acceleration_rad_s2
        dV/dt and d(omega)/dt, smoothed.
    stretch
        Number of the uninterrupted stretch of time of a sample: of one run, pass and wheel.
    run
        Number of the run of a sample: its stretch, or the run of a steady-state trial.
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
    run: np.ndarray
    slip_before: np.ndarray
    ground: np.ndarray
    wheel: np.ndarray
    axis: Axis | None = ALONG_X

    def __len__(self) -> int:
        return len(self.load_N)

    @property
    def timed(self) -> bool:
        """Whether rows are a time series; steady-state trials are not, each is a stretch of its own."""
        return bool(np.isfinite(self.time_s).all() and (np.diff(self.stretch) == 0).any())

    @cached_property
    def periods(self) -> tuple[np.ndarray, ...]:
        """Rows of each period without a gap in time, also across passes: over these a sensor's state is continuous."""
        step = np.diff(self.time_s)
        median_step = np.median(step[step > 0.0]) if (step > 0.0).any() else math.inf
        broken = (np.diff(self.stretch) != 0) & ~((step > 0.0) & (step < 2.0 * median_step))
        return tuple(np.split(np.arange(len(self)), np.flatnonzero(broken) + 1))

    def has(self, name: str) -> bool:
        """Return whether a channel was observed in most samples and is not constant."""
        values = getattr(self, name)
        seen = np.isfinite(values)
        return bool(seen.mean() > 0.5) and float(np.ptp(values[seen])) > 1e-9 * max(
            float(np.abs(values[seen]).max()), 1e-9
        )


_LEAST_TAN_PHI = 0.1
"""Lower bound of tan phi in a soil's strength [-]: a fit may end at zero."""

_LEAST_DEPTH = 0.05
"""Lower bound of sinkage in the length of the contact, and its value where it was not measured [radii]."""


@dataclass(frozen=True)
class Group:
    """Rows of a wheel, or of a class of ground: `numbers` of the drive's `attribute`."""

    name: str
    attribute: Literal["wheel", "ground"]
    numbers: tuple[int, ...]

    def rows(self, drive: Drive) -> np.ndarray:
        """(n,) True for its rows."""
        return np.isin(getattr(drive, self.attribute), self.numbers)


COVARIATES = tuple(name for name in Drive.__dataclass_fields__ if name != "axis")
"""Names of the covariates of a drive."""


@dataclass(frozen=True)
class Situation:
    """Properties of a recording that determine which forms of an effect it can show, and their priors.

    Parameters
    ----------
    wheel
        The wheel.
    drive
        Samples' covariates.
    typical : (5,)
        Root mean square of each channel of `textbook.CHANNELS`, NaN where it was not observed.
    sinkage_m : (n,)
        Measured sinkage, NaN where not observed.
    innovations : (n, 5)
        White residuals of the textbook wheel, gross errors clipped; NaN where not observed.
    c_Pa, tan_phi, stiffness_Pa
        Soil of the textbook wheel's fit.
    places
        Initial parameter vectors of soil patches, by the attribute of the drive along which these lie.
    wheels, classes
        Groups of rows of each wheel and of each class of ground.
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
    wheels: tuple[Group, ...] = ()
    classes: tuple[Group, ...] = ()

    @property
    def depth_m(self) -> float:
        """Median sinkage [m], or a small value where it was not measured."""
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
    """Contacts (n, f) that effects change: each field of `fields.FIELDS` is an attribute, (n,).

    `sinkage_m` (n,) follows from the entry angle, and `wheel` is the wheel.
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

    A module has one class with the effect's name, description and check, registered with `registry.register`; further
    published forms are its sub-classes. A form overrides one or several of `impose`, `contact`, `act` and `report`, in
    which `values` (k,) are its parameters in the order of `parameters`.
    """

    slug: ClassVar[str]
    """Public name: in code, files, reports and on the command line."""
    title: ClassVar[str]
    """Name in text, lower case."""
    what_happens: ClassVar[str]
    """Description in a clause, without capital and full stop."""
    check: str
    """Measurement that would show the effect: an imperative clause."""
    equation: str
    source: str
    """Publication that the equation comes from."""
    parameters: tuple[Parameter, ...]
    kind: Kind = "physics"
    form: str = ""
    """Published form, or channel, if an effect has several."""
    needs: tuple[str, ...] = ()
    """Attributes of `Drive` that the formula depends on."""
    changes: tuple[int, ...] = (TORQUE, SINKAGE, PULL)
    """Channels that the effect changes, of which one has to be measured."""
    required: tuple[str, ...] = ()
    """Parameters that have to be stated if the effect is simulated by name; others are at `Parameter.null`."""
    constants: Mapping[str, float] = MappingProxyType({})
    """Constants of the formula that depend on the drive that the effect was built for, by name [SI]."""
    prior_probability: float | None = None
    """Prior probability of the effect if known (for a vehicle with lugs, for example); None for the default."""
    default_form: bool = True
    """Whether this form is the default of several with the parameters that are named."""
    nested: ClassVar[bool] = True
    """Whether the effect vanishes smoothly at its null values, so that a score test ranks it."""
    choices: int = 1
    """Number of discrete alternatives that were searched (numbers of lugs, for example), with equal prior shares."""
    of_ground: ClassVar[bool] = False
    """Whether it changes the soil itself, by place or pass: such effects are applied first."""
    belongs_to: Literal["ground", "vehicle"] = "vehicle"
    """Whether it is physics of the ground, which differs from class to class, or of the vehicle and its instruments,
    which is the same everywhere but may differ from wheel to wheel."""
    of_one_drive: ClassVar[bool] = False
    """Whether it belongs to places, runs or the clock of one drive: it is not expected on a later one."""
    by_place: ClassVar[bool] = False
    """Whether it acts at a place or in a run only, which it estimates itself."""
    of_any_wheel: ClassVar[bool] = False
    """Whether it is a property of the ground that acts on any wheel: included in a planner's predictions."""
    by_run: ClassVar[bool] = False
    """Whether its parameters describe the runs of one recording: these are not stored."""
    where: str = ""
    """Where it acts, if not everywhere."""
    remark: str = ""
    """Note for the report if the effect is identified."""

    @property
    def name(self) -> str:
        """Slug, and form in brackets where there is one."""
        return f"{self.slug}[{self.form}]" if self.form else self.slug

    @property
    def shapes_contact(self) -> bool:
        """Whether it changes the contact."""
        return type(self).contact is not Effect.contact

    @property
    def moves_wheel(self) -> np.ndarray:
        """(k,) True for parameters that may change the entry angle; the others change forces and reports only."""
        return np.full(len(self.parameters), self.shapes_contact or type(self).impose is not Effect.impose)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Return the forms that a recording can show: one, if all `needs` vary and one of `changes` was measured.

        Overridden by a class with several forms or with arguments of its constructor.
        """
        shown = all(situation.drive.has(name) for name in cls.needs) and situation.measures(*cls.changes)
        return (cls(),) if shown else ()

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Return the forms that can be simulated by name: as `forms`, but columns need not vary."""
        return cls.forms(situation)

    def extensions(self) -> list[Effect]:
        """Return further forms, with other constants or more parameters, to be fitted if this form is probable."""
        return []

    def starts(self) -> list[np.ndarray]:
        """Initial parameter vectors (k,) of fits."""
        return [np.array([parameter.start for parameter in self.parameters])]

    def initial_soil(self, soil: np.ndarray) -> np.ndarray:
        """Return the initial soil (5,) of a fit with the effect, from that without [internal coordinates]."""
        return soil

    def extent(self, values: np.ndarray) -> tuple[str, float, float] | None:
        """Attribute of `Drive` and the interval of it on which the effect acts; None if it acts everywhere."""
        return None

    def check_sd(self, noise: np.ndarray) -> float | None:
        """Standard error of the first parameter by `check`, from the channels' noise (5,) [SI].

        None if the check does not measure it.
        """
        return None

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        """Convert reported load [N] and slip (n, 2) to the true ones, in place."""

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Change geometry, pressure-sinkage or shear law, in place, at the entry angle of `contact`."""

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Add forces to `channels` (n, 5), in place, at the entry angle found."""

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        """Change what the instruments report: `channels` (n, 5), in place."""
