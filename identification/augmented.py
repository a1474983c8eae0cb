"""The textbook wheel with any set of effects: the simulator that the mismatch tool fits, and that planners use.

The contact of each sample is laid out as the textbook has it, each effect changes what it changes, the entry angle is
found at which the load is carried, and what follows is reported as the effects say. Derivatives are differences of the
contact at a fixed entry angle, times the forces' slopes, which one quadrature gives by most of its fields; the angle's
answer follows from the implicit function theorem.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..framework.core.vehicle import Wheel
from . import contact_kernel as kernel
from .effects.effect import Contact, Drive, Effect
from .stress_kernel import LOCKED
from .wheel_soil import LARGEST_ENTRY_ANGLE, PEAK_SHARE

SOIL_COUNT = 5
"""Leading entries of a parameter vector: c [Pa], tan phi, ln k [m], ln stiffness [Pa], ln n; the effects' follow."""

_LOAD_TOLERANCE = 1e-6
_ITERATIONS, _PATIENCE = 40, 8
"""Steps towards an entry angle at most, and those after which a bracket has to shrink."""

_GROWTHS = 0.2, 20.0
"""Powers of the entry angle between which the load is taken to grow."""

_SMALLEST_ANGLE = 1e-4
_STEP = 1e-5

_SAME = 1e-5
"""Share by which channels of two wheels differ that are one [-]."""


@dataclass(frozen=True)
class Response:
    """What the simulator answers: channels (n, 5) as `forward.CHANNELS`, and the entry angle (n,) [rad].

    With derivatives by the parameter vector (n, 5, p), by the true load [N] and slip (n, 5, 2), and by the logarithms
    of the ground's stiffness and strength (n, 5, 2), where they were asked for. Rows whose load is not carried are NaN.
    Of the entry angle then, too: its derivatives by the parameters (n, p), and the power of it with which the load that
    is carried grows (n,).
    """

    channels: np.ndarray
    theta_1: np.ndarray
    by_parameter: np.ndarray = field(default_factory=lambda: np.empty(0))
    by_latent: np.ndarray = field(default_factory=lambda: np.empty(0))
    by_ground: np.ndarray = field(default_factory=lambda: np.empty(0))
    turned: np.ndarray = field(default_factory=lambda: np.empty(0))
    growth: np.ndarray = field(default_factory=lambda: np.empty(0))
    rim: Rim | None = None

    def entry(self, step: np.ndarray) -> Entry:
        """Where the search for the entry angle starts a step (p,) of the parameters away."""
        if not self.turned.size or not step.any():
            return Entry(self.theta_1, self.growth if self.growth.size else None, self.rim)
        return Entry(self.theta_1 + self.turned @ step, self.growth)


@dataclass(frozen=True)
class Rim:
    """What was integrated around the rim: the load [N] and slip that truly were (n, 2), the contact (n, f) that carries
    the load, its forces (n, 3) and their slopes (n, 3, g).
    """

    true: np.ndarray
    contact: np.ndarray
    forces: np.ndarray
    slopes: np.ndarray

    def is_of(self, true: np.ndarray, contact: np.ndarray) -> bool:
        """Say whether another wheel stands in the ground alike."""
        return np.array_equal(self.true, true) and np.array_equal(self.contact, contact, equal_nan=True)


@dataclass(frozen=True)
class Entry:
    """Where the search for the entry angle starts: the angle (n,) [rad], the power of it with which load grows, and
    what was integrated at that angle.
    """

    theta_1: np.ndarray
    growth: np.ndarray | None = None
    rim: Rim | None = None


@dataclass(frozen=True)
class AugmentedWheel:
    """A wheel on soil, with effects."""

    wheel: Wheel
    effects: tuple[Effect, ...] = ()

    @property
    def size(self) -> int:
        """Length of the parameter vector."""
        return SOIL_COUNT + sum(len(effect.parameters) for effect in self.effects)

    def slices(self) -> list[tuple[Effect, slice]]:
        """Give each effect and where its parameters stand in the vector."""
        answer, start = [], SOIL_COUNT
        for effect in self.effects:
            answer.append((effect, slice(start, start + len(effect.parameters))))
            start += len(effect.parameters)
        return answer

    def predict(
        self, drive: Drive, imposed: np.ndarray, vector: np.ndarray, theta_1: np.ndarray | None = None
    ) -> Response:
        """Predict the channels.

        Parameters
        ----------
        drive
            What is known of each sample.
        imposed : (n, 2)
            Load [N] and slip as they would be reported by faultless instruments.
        vector : (p,)
            Soil and effects.
        theta_1 : (n,), optional
            Where the search for the entry angle starts [rad].
        """
        true = self._true(drive, imposed, vector)
        start = np.full(len(imposed), 0.4) if theta_1 is None else theta_1
        angle, forces = self._solve(drive, true, vector, Entry(start))
        contact = self._contact(drive, true, vector, angle)
        return Response(self._channels(drive, imposed, contact, vector, forces), angle)

    # The load may hardly grow with the entry angle, or fall with it: such rows' derivatives overflow.
    @np.errstate(over="ignore", invalid="ignore")
    def linearise(
        self, drive: Drive, imposed: np.ndarray, vector: np.ndarray, entry: Entry | None, *, latent: bool = True,
        known: Response | None = None,
    ) -> Response:  # fmt: skip
        """As `predict`, with derivatives; those by the true load and slip only where `latent`.

        Derivatives that are `known` of the wheel without its last effect, by the same leading parameters, are taken
        over where that effect is nothing here, and the channels are the same.
        """
        true = self._true(drive, imposed, vector)
        contact, rim = self._stand(drive, true, vector, entry or Entry(np.full(len(imposed), 0.4)))
        angle, forces, slopes = contact.theta_1.copy(), rim.forces, rim.slopes
        base = self._channels(drive, imposed, contact, vector, forces)
        carried = forces[:, 0]
        further = angle * (1.0 + _STEP)
        further_contact = self._contact(drive, true, vector, further)
        moved = self._forces_near(further_contact, contact, forces, slopes)
        growth = np.maximum((moved[:, 0] - carried) / (further - angle), 1e-300)
        along = (self._channels(drive, imposed, further_contact, vector, moved) - base) / (further - angle)[:, None]

        def derivative(
            imposed_there: np.ndarray, vector_there: np.ndarray, step: float | np.ndarray, *, far: bool = False,
            stands: bool = False,
        ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
            """Derivatives of the channels (n, 5), and of the entry angle (n,): none where the wheel stands alike."""
            if stands:
                channels = self._channels(drive, imposed_there, contact, vector_there, forces)
                return (channels - base) / np.reshape(step, (-1, 1)), np.zeros(len(base))
            true_there = self._true(drive, imposed_there, vector_there)
            there = self._contact(drive, true_there, vector_there, angle)
            forces_there = self._forces_near(there, contact, forces, None if far else slopes)
            turn = ((true_there[:, 0] - true[:, 0]) - (forces_there[:, 0] - carried)) / growth
            channels = self._channels(drive, imposed_there, there, vector_there, forces_there)
            return (channels - base + along * turn[:, None]) / np.reshape(step, (-1, 1)), turn / step

        far = [False] * SOIL_COUNT + [each.step > 0.0 for effect in self.effects for each in effect.parameters]
        stands = np.concatenate([np.zeros(SOIL_COUNT, dtype=bool), *[~effect.moves_wheel for effect in self.effects]])
        by_parameter, turned = np.empty((*base.shape, self.size)), np.empty((len(base), self.size))
        taken_over = 0
        if known is not None and np.allclose(base, known.channels, rtol=_SAME, atol=0.0, equal_nan=True):
            taken_over = known.turned.shape[-1]
            by_parameter[..., :taken_over], turned[:, :taken_over] = known.by_parameter, known.turned
        for index, step in list(enumerate(self.steps(vector)))[taken_over:]:
            stepped = vector.copy()
            stepped[index] += step
            by_parameter[:, :, index], turned[:, index] = derivative(
                imposed, stepped, step, far=far[index], stands=stands[index]
            )  # fmt: skip
        by_ground = np.stack([by_parameter[..., 3], by_parameter[..., :2] @ vector[:2]], axis=-1)
        power = angle * growth / carried
        if not latent:
            return Response(base, angle, by_parameter, by_ground=by_ground, turned=turned, growth=power, rim=rim)
        by_latent = np.empty((*base.shape, 2))
        nothing = np.zeros(len(imposed))
        step_N = 1e-5 * np.abs(imposed[:, 0])
        by_latent[:, :, 0], _ = derivative(imposed + np.column_stack([step_N, nothing]), vector, step_N)
        # Stepping towards zero slip never reaches the locked or the spinning wheel.
        step_slip = np.where(imposed[:, 1] > 0.0, -1e-5, 1e-5)
        by_latent[:, :, 1], _ = derivative(imposed + np.column_stack([nothing, step_slip]), vector, step_slip)
        return Response(base, angle, by_parameter, by_latent, by_ground, turned, power, rim)

    def _stand(self, drive: Drive, true: np.ndarray, vector: np.ndarray, entry: Entry) -> tuple[Contact, Rim]:
        """Give the contact that carries the load, and what is integrated around its rim, or was."""
        if entry.rim is not None:
            contact = self._contact(drive, true, vector, entry.theta_1)
            if entry.rim.is_of(true, contact.array):
                return contact, entry.rim
        angle, forces = self._solve(drive, true, vector, entry)
        contact = self._contact(drive, true, vector, angle)
        slopes = np.empty((len(true), 3, kernel.SLOPED))
        kernel.rim_forces_and_slopes(contact.array, self.wheel.width_m, kernel.NODES, kernel.WEIGHTS, forces, slopes)
        return contact, Rim(true, contact.array, forces, slopes)

    def steps(self, vector: np.ndarray) -> np.ndarray:
        """Steps (p,) of the differences, small against what each parameter usually is."""
        steps = [10.0 * _STEP * max(abs(vector[0]), 500.0), *[_STEP] * 4]
        for effect, where in self.slices():
            for parameter, value in zip(effect.parameters, vector[where], strict=True):
                step = parameter.step or _STEP * max(parameter.scale, abs(value - parameter.null))
                steps.append(-step if value + step > parameter.high else step)
        return np.array(steps)

    def _true(self, drive: Drive, imposed: np.ndarray, vector: np.ndarray) -> np.ndarray:
        true = imposed.copy()
        for effect, where in self.slices():
            effect.impose(true, drive, vector[where])
        return true

    def _contact(self, drive: Drive, true: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Contact:
        contact = Contact(len(true), self.wheel)
        radius, slip = self.wheel.radius_m, true[:, 1]
        ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / np.maximum(1.0 + slip, LOCKED))
        k_m, stiffness_Pa, n = np.exp(vector[2:5])
        contact.array[:] = kernel.fields(
            c_Pa=vector[0], tan_phi=vector[1], k_m=k_m, stiffness_Pa=stiffness_Pa, n=n, radius_m=radius,
            shear_radius_m=radius, lever_m=radius,
        )  # fmt: skip
        contact.theta_1, contact.theta_m = theta_1, PEAK_SHARE * theta_1
        contact.advance_m = radius * ratio
        contact.sinkage_m = radius * (1.0 - np.cos(theta_1))
        # What the soil is comes before what is done to it.
        for effect, where in sorted(self.slices(), key=lambda pair: not pair[0].of_ground):
            effect.contact(contact, drive, vector[where])
        return contact

    def _forces(
        self, contact: Contact, wanted: np.ndarray | None = None, known: np.ndarray | None = None
    ) -> np.ndarray:
        """W [N], T [N m] and DP [N] of a contact (n, 3); rows that are not `wanted` (n,) have those that are known."""
        rows = len(contact.array)
        forces = np.empty((rows, 3)) if known is None else known.copy()
        wanted = np.ones(rows, dtype=bool) if wanted is None else wanted
        kernel.rim_forces(contact.array, self.wheel.width_m, kernel.NODES, kernel.WEIGHTS, wanted, forces)
        return forces

    def _forces_near(self, there: Contact, here: Contact, forces: np.ndarray, slopes: np.ndarray | None) -> np.ndarray:
        """Forces of a contact (n, 3) from those `here` and their slopes, where there are any, by what has changed.

        Rows that differ in what forces have no slopes by are integrated: an effect that is somewhere moves nothing
        elsewhere.
        """
        if slopes is None:
            return self._forces(there, (there.array != here.array).any(axis=1), forces)
        near, beyond = np.empty_like(forces), np.empty(len(forces), dtype=bool)
        kernel.forces_near(there.array, here.array, forces, slopes, near, beyond)
        return self._forces(there, beyond, near) if beyond.any() else near

    def _channels(
        self, drive: Drive, imposed: np.ndarray, contact: Contact, vector: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        channels = np.column_stack([imposed[:, 0], forces[:, 1], contact.sinkage_m, imposed[:, 1], forces[:, 2]])
        for effect, where in self.slices():
            effect.act(channels, contact, drive, vector[where])
        for effect, where in self.slices():
            effect.report(channels, drive, vector[where])
        return channels

    def _solve(self, drive: Drive, true: np.ndarray, vector: np.ndarray, entry: Entry) -> tuple[np.ndarray, np.ndarray]:
        """Entry angle (n,) and forces (n, 3) there, all rows at once.

        W grows like a power of theta_1, whose exponent is measured as the search goes: secant steps in logarithms,
        kept within a bracket, which is halved where they come to a kink and hardly move it.
        """
        load = true[:, 0]
        rows = len(load)
        low, high = np.full(rows, _SMALLEST_ANGLE), np.full(rows, LARGEST_ENTRY_ANGLE)
        start = np.where(np.isfinite(entry.theta_1), entry.theta_1, 0.4)
        angle = np.clip(start, 2.0 * _SMALLEST_ANGLE, 0.99 * LARGEST_ENTRY_ANGLE)
        growth = np.full(rows, 2.0 * float(np.exp(vector[4])) + 1.0)
        if entry.growth is not None:
            growth = np.where(np.isfinite(entry.growth), np.clip(entry.growth, *_GROWTHS), growth)
        before_angle, before_load = angle, np.full(rows, np.nan)
        forces = self._forces(self._contact(drive, true, vector, angle))
        with np.errstate(invalid="ignore", divide="ignore"):
            widths = [high - low] * 2
            for iteration in range(_ITERATIONS):
                carried = forces[:, 0]
                off = np.abs(carried - load) > _LOAD_TOLERANCE * load
                if not (off & (high - low > 1e-9)).any():
                    break
                short = carried < load
                low, high = np.where(short, angle, low), np.where(short, high, angle)
                measured = np.log(carried / before_load) / np.log(angle / before_angle)
                growth = np.where(np.isfinite(measured), np.clip(measured, *_GROWTHS), growth)
                trial = np.where(carried > 0.0, angle * (load / carried) ** (1.0 / growth), np.nan)
                stuck = (high - low > 0.5 * widths[-2]) & (iteration >= _PATIENCE)
                trial = np.where((trial > low) & (trial < high) & ~stuck, trial, 0.5 * (low + high))
                widths.append(high - low)
                before_angle, before_load = angle, carried
                angle = np.where(off, trial, angle)
                forces = self._forces(self._contact(drive, true, vector, angle), off, forces)
            lost = ~(np.abs(forces[:, 0] - load) <= 10.0 * _LOAD_TOLERANCE * load)
        angle = np.where(lost, np.nan, angle)
        forces = np.where(lost[:, None], np.nan, forces)
        return angle, forces
