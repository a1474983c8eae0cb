"""The textbook wheel with any set of effects: the simulator that the mismatch tool fits, and that planners use.

The contact of each sample is laid out as the textbook has it, each effect changes what it changes, the entry angle is
found at which the load is carried, and what follows is reported as the effects say. Derivatives are differences of the
contact at a fixed entry angle, times the forces' slopes, which one quadrature gives by all of its fields; the angle's
answer follows from the implicit function theorem.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...framework.core.vehicle import Wheel
from ..effects.effect import Contact, Drive, Effect
from . import fields, stresses
from .equilibrium import CORRECTABLE, carry
from .textbook import USUAL_ENTRY_ANGLE, contact_array, started

SOIL_COUNT = 5
"""Leading entries of a parameter vector: c [Pa], tan phi, ln k [m], ln stiffness [Pa], ln n; the effects' follow."""

_STEP = 1e-7
"""Step of the differences of contacts, relative: forces follow by their slopes, without cancellation."""

_SAME = 1e-5
"""Share by which channels of two wheels differ that are one [-]."""


@dataclass(frozen=True)
class Response:
    """What the simulator answers: channels (n, 5) as `textbook.CHANNELS`, and the entry angle (n,) [rad].

    With derivatives by the parameter vector (n, 5, p), by the true load [N] and slip (n, 5, 2), and by the logarithms
    of the ground's stiffness and strength (n, 5, 2), where requested. Rows whose load is not carried are NaN.
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
        """Return whether another wheel stands in the ground alike."""
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
        """Return each effect and where its parameters stand in the vector."""
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
            Soil and effects; (p, n) where they differ from sample to sample.
        theta_1 : (n,), optional
            Where the search for the entry angle starts [rad].
        """
        start = np.full(len(imposed), USUAL_ENTRY_ANGLE) if theta_1 is None else theta_1
        contact, rim = self._stand(drive, self._true(drive, imposed, vector), vector, Entry(start), sloped=False)
        return Response(self._channels(drive, imposed, contact, vector, rim.forces), contact.theta_1.copy())

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
        entry = entry or Entry(np.full(len(imposed), USUAL_ENTRY_ANGLE))
        contact, rim = self._stand(drive, true, vector, entry, sloped=True)
        angle, forces, slopes = contact.theta_1.copy(), rim.forces, rim.slopes
        bare = contact_array(angle, true[:, 1], _soil(vector), self.wheel)
        base = self._channels(drive, imposed, contact, vector, forces)
        carried = forces[:, 0]
        further = angle * (1.0 + _STEP)
        further_contact = self._contact(drive, true, vector, further)
        moved = self._forces_near(further_contact, contact, forces, slopes)
        growth = np.maximum((moved[:, 0] - carried) / (further - angle), 1e-300)
        along = (self._channels(drive, imposed, further_contact, vector, moved) - base) / (further - angle)[:, None]
        # What the search has left of the load, which is little.
        correction = np.clip((true[:, 0] - carried) / growth, -CORRECTABLE * angle, CORRECTABLE * angle)
        corrected = base + along * correction[:, None]

        def derivative(
            imposed_there: np.ndarray, vector_there: np.ndarray, step: float | np.ndarray, *, far: bool = False,
            stands: bool = False,
        ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
            """Derivatives of the channels (n, 5), and of the entry angle (n,): none where the wheel stands alike."""
            if stands:
                channels = self._channels(drive, imposed_there, contact, vector_there, forces)
                return (channels - base) / np.reshape(step, (-1, 1)), np.zeros(len(base))
            true_there = self._true(drive, imposed_there, vector_there)
            array = bare.copy(order="K")
            array[:, fields.COHESION : fields.EXPONENT + 1] = _soil(vector_there)
            if not np.array_equal(true_there[:, 1], true[:, 1]):
                array[:, fields.ADVANCE] = self.wheel.radius_m * fields.speed_ratio(true_there[:, 1])[0]
            there = self._changed(Contact(array, self.wheel), drive, vector_there)
            forces_there = self._forces_near(there, contact, forces, None if far else slopes)
            turn = ((true_there[:, 0] - true[:, 0]) - (forces_there[:, 0] - carried)) / growth
            channels = self._channels(drive, imposed_there, there, vector_there, forces_there)
            return (channels - base + along * turn[:, None]) / np.reshape(step, (-1, 1)), turn / step

        far = [False] * SOIL_COUNT + [each.step > 0.0 for effect in self.effects for each in effect.parameters]
        stands = np.concatenate([np.zeros(SOIL_COUNT, dtype=bool), *[~effect.moves_wheel for effect in self.effects]])
        by_parameter, turned = np.empty((*base.shape, self.size)), np.empty((len(base), self.size))
        taken_over = 0
        if known is not None and np.allclose(corrected, known.channels, rtol=_SAME, atol=0.0, equal_nan=True):
            taken_over = known.turned.shape[-1]
            by_parameter[..., :taken_over], turned[:, :taken_over] = known.by_parameter, known.turned
        for index, step in list(enumerate(self.steps(vector)))[taken_over:]:
            stepped = vector.copy()
            stepped[index] += step
            by_parameter[:, :, index], turned[:, index] = derivative(
                imposed, stepped, step, far=far[index], stands=stands[index]
            )  # fmt: skip
        by_ground = np.stack([by_parameter[..., 3], by_parameter[..., :2] @ vector[:2]], axis=-1)
        answer = Response(
            corrected, angle + correction, by_parameter, by_ground=by_ground, turned=turned,
            growth=angle * growth / carried, rim=rim,
        )  # fmt: skip
        if not latent:
            return answer
        by_latent = np.empty((*base.shape, 2))
        nothing = np.zeros(len(imposed))
        step_N = _STEP * np.abs(imposed[:, 0])
        by_latent[:, :, 0], _ = derivative(imposed + np.column_stack([step_N, nothing]), vector, step_N)
        # Stepping towards zero slip never reaches the locked or the spinning wheel.
        step_slip = np.where(imposed[:, 1] > 0.0, -_STEP, _STEP)
        by_latent[:, :, 1], _ = derivative(imposed + np.column_stack([nothing, step_slip]), vector, step_slip)
        return replace(answer, by_latent=by_latent)

    def _stand(
        self, drive: Drive, true: np.ndarray, vector: np.ndarray, entry: Entry, *, sloped: bool
    ) -> tuple[Contact, Rim]:
        """Return the contact that carries the load, and what is integrated around its rim, or was."""
        if entry.rim is not None:
            contact = self._contact(drive, true, vector, entry.rim.contact[:, fields.THETA_1])
            if entry.rim.is_of(true, contact.array):
                return contact, entry.rim

        def lay_out(theta_1: np.ndarray) -> np.ndarray:
            return self._contact(drive, true, vector, theta_1).array

        fixed = all(type(effect).contact is Effect.contact for effect in self.effects)
        found = carry(
            lay_out(started(entry.theta_1)), true[:, 0], self.wheel.width_m, lay_out=None if fixed else lay_out,
            growth=entry.growth, near=entry.growth is not None, sloped=sloped,
        )  # fmt: skip
        contact = self._contact(drive, true, vector, found.contact[:, fields.THETA_1])
        return contact, Rim(true, contact.array, found.forces, found.slopes)

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
        bare = contact_array(theta_1, true[:, 1], _soil(vector), self.wheel)
        return self._changed(Contact(bare, self.wheel), drive, vector)

    def _changed(self, contact: Contact, drive: Drive, vector: np.ndarray) -> Contact:
        """Let the effects change the textbook's contact, in place."""
        # What the soil is comes before what is done to it.
        for effect, where in sorted(self.slices(), key=lambda pair: not pair[0].of_ground):
            effect.contact(contact, drive, vector[where])
        return contact

    def _forces_near(self, there: Contact, here: Contact, forces: np.ndarray, slopes: np.ndarray | None) -> np.ndarray:
        """Forces of a contact (n, 3) from those `here` and their slopes, where there are any, by what has changed.

        Rows that differ in what forces have no slopes by are integrated: an effect that is somewhere moves nothing
        elsewhere.
        """
        near, beyond = forces.copy(), (there.array != here.array).any(axis=1)
        if slopes is not None:
            stresses.forces_near(there.array, here.array, forces, slopes, near, beyond)
        if beyond.any():
            near[beyond] = stresses.rim_forces(there.array[beyond], self.wheel.width_m, stresses.QUICK)
        return near

    def _channels(
        self, drive: Drive, imposed: np.ndarray, contact: Contact, vector: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        channels = np.column_stack([imposed[:, 0], forces[:, 1], contact.sinkage_m, imposed[:, 1], forces[:, 2]])
        for effect, where in self.slices():
            effect.act(channels, contact, drive, vector[where])
        for effect, where in self.slices():
            effect.report(channels, drive, vector[where])
        return channels


def _soil(vector: np.ndarray) -> list[float | np.ndarray]:
    """Return c [Pa], tan phi, k [m], stiffness [Pa] and n of a parameter vector (p,), or (p, n)."""
    return [*vector[:2], *np.exp(vector[2:SOIL_COUNT])]
