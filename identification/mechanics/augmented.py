"""The textbook wheel with any set of effects: the simulator that `explain` fits, and that planners use.

The effects modify the textbook contact of each sample. The entry angle is solved for at which the load is carried, and
the effects modify the resulting channels. Derivatives are differences of the contact at a fixed entry angle, times the
derivatives of the forces by the contact's fields, which one quadrature yields. Those of the entry angle follow from the
implicit function theorem.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...framework.core.vehicle import Wheel
from ..effects.effect import Contact, Drive, Effect
from . import fields, stresses
from .equilibrium import CORRECTABLE, carry
from .textbook import USUAL_ENTRY_ANGLE, contact_array, initial_angles

SOIL_COUNT = 5
"""Parameters of a soil: c [Pa], tan phi, ln k [m], ln stiffness [Pa], ln n. Those of each ground come first in a
parameter vector; the effects' follow."""

_STEP = 1e-7
"""Relative step of differences of contacts [-]; forces are linear in these, without cancellation."""

_SAME = 1e-5
"""Relative tolerance for equal channels of two wheels [-]."""


@dataclass(frozen=True)
class Response:
    """Channels (n, 5) as `textbook.CHANNELS`, and entry angles (n,) [rad]; NaN where the load is not carried.

    If requested with derivatives by the parameters q of the row's own soil and the effects (n, 5, q), by the true load
    [N] and slip (n, 5, 2), and by the logarithms of the ground's stiffness and strength (n, 5, 2); with derivatives of
    the entry angle by the parameters (n, q), the number of each row's ground (n,), and `growth` (n,), the exponent of
    the load as a power of the entry angle.
    """

    channels: np.ndarray
    theta_1: np.ndarray
    by_parameter: np.ndarray = field(default_factory=lambda: np.empty(0))
    by_latent: np.ndarray = field(default_factory=lambda: np.empty(0))
    by_ground: np.ndarray = field(default_factory=lambda: np.empty(0))
    theta_1_by_parameter: np.ndarray = field(default_factory=lambda: np.empty(0))
    ground: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    growth: np.ndarray = field(default_factory=lambda: np.empty(0))
    rim: Rim | None = None

    def entry(self, step: np.ndarray | None = None) -> Entry:
        """Initial entry angles after a step (p,) of the parameters, or at the same ones."""
        if step is None or not self.theta_1_by_parameter.size or not step.any():
            return Entry(self.theta_1, self.growth if self.growth.size else None, self.rim)
        own = self.of_each_row(step)
        return Entry(self.theta_1 + np.sum(self.theta_1_by_parameter * own, axis=1), self.growth)

    def changed_by(self, step: np.ndarray) -> np.ndarray:
        """Change of the channels (n, 5) by a step (p,) of the parameters, to first order; 0 where not known."""
        return np.einsum("ncq,nq->nc", np.nan_to_num(self.by_parameter), self.of_each_row(step))

    def of_each_row(self, step: np.ndarray) -> np.ndarray:
        """Step (n, q) of the soil of each row's ground and of the effects."""
        effects = step[len(step) - (self.by_parameter.shape[-1] - SOIL_COUNT) :]
        soils = step[: len(step) - len(effects)].reshape(-1, SOIL_COUNT)
        return np.concatenate([soils[self.ground], np.tile(effects, (len(self.ground), 1))], axis=1)


@dataclass(frozen=True)
class Rim:
    """Integrals along the rim: true load [N] and slip (n, 2), the contact (n, f) that carries the load, its forces
    (n, 3) and their derivatives (n, 3, g).
    """

    true: np.ndarray
    contact: np.ndarray
    forces: np.ndarray
    slopes: np.ndarray

    def matches(self, true: np.ndarray, contact: np.ndarray) -> bool:
        """Return whether true load and slip (n, 2) and contact (n, f) are the same."""
        return np.array_equal(self.true, true) and np.array_equal(self.contact, contact, equal_nan=True)


@dataclass(frozen=True)
class Entry:
    """Initial entry angles (n,) [rad], the exponent of the load as a power of these, and the integrals there."""

    theta_1: np.ndarray
    growth: np.ndarray | None = None
    rim: Rim | None = None


@dataclass(frozen=True)
class AugmentedWheel:
    """A wheel on one or several grounds, each with a soil of its own, with effects that act on all."""

    wheel: Wheel
    effects: tuple[Effect, ...] = ()
    grounds: int = 1

    @property
    def soils(self) -> slice:
        """Soils of all grounds in the parameter vector."""
        return slice(0, SOIL_COUNT * self.grounds)

    def with_effects(self, effects: tuple[Effect, ...]) -> AugmentedWheel:
        """Return the wheel on the same grounds with other effects."""
        return replace(self, effects=effects)

    def slices(self) -> list[tuple[Effect, slice]]:
        """Return each effect and the slice of its parameters in the vector."""
        answer, start = [], self.soils.stop
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
            Covariates of each sample.
        imposed : (n, 2)
            Load [N] and slip as reported, without noise.
        vector : (p,)
            Soils of the grounds, by `drive.ground`, and effects; (p, n) where they differ from sample to sample.
        theta_1 : (n,), optional
            Initial entry angles [rad].
        """
        start = np.full(len(imposed), USUAL_ENTRY_ANGLE) if theta_1 is None else theta_1
        contact, rim = self._in_equilibrium(
            drive, self._true(drive, imposed, vector), vector, Entry(start), sloped=False
        )
        return Response(self._channels(drive, imposed, contact, vector, rim.forces), contact.theta_1.copy())

    # Derivatives overflow in rows whose load hardly grows with the entry angle.
    @np.errstate(over="ignore", invalid="ignore")
    def linearise(
        self, drive: Drive, imposed: np.ndarray, vector: np.ndarray, entry: Entry | None, *, latent: bool = True,
        known: Response | None = None,
    ) -> Response:  # fmt: skip
        """As `predict`, with derivatives; those by the true load and slip only if `latent`.

        Derivatives `known` of the wheel without its last effect, by the leading parameters, are reused if the channels
        are equal, because that effect is at its null values.
        """
        true = self._true(drive, imposed, vector)
        entry = entry or Entry(np.full(len(imposed), USUAL_ENTRY_ANGLE))
        contact, rim = self._in_equilibrium(drive, true, vector, entry, sloped=True)
        angle, forces, slopes = contact.theta_1.copy(), rim.forces, rim.slopes
        soil = self._soil(drive, vector)
        bare = contact_array(angle, true[:, 1], [*soil.T], self.wheel)
        base = self._channels(drive, imposed, contact, vector, forces)
        carried = forces[:, 0]
        further = angle * (1.0 + _STEP)
        further_contact = self._contact(drive, true, vector, further)
        moved = self._forces_near(further_contact, contact, forces, slopes)
        growth = np.maximum((moved[:, 0] - carried) / (further - angle), 1e-300)
        along = (self._channels(drive, imposed, further_contact, vector, moved) - base) / (further - angle)[:, None]
        # The small error of the load that the root finder leaves.
        correction = np.clip((true[:, 0] - carried) / growth, -CORRECTABLE * angle, CORRECTABLE * angle)
        corrected = base + along * correction[:, None]

        def derivative(
            imposed_there: np.ndarray, vector_there: np.ndarray, step: float | np.ndarray, *, integrated: bool = False,
            same_contact: bool = False,
        ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
            """Derivatives of the channels (n, 5), and of the entry angle (n,), zero if the contact is the same."""
            if same_contact:
                channels = self._channels(drive, imposed_there, contact, vector_there, forces)
                return (channels - base) / np.reshape(step, (-1, 1)), np.zeros(len(base))
            true_there = self._true(drive, imposed_there, vector_there)
            array = bare.copy(order="K")
            array[:, fields.COHESION : fields.EXPONENT + 1] = self._soil(drive, vector_there)
            if not np.array_equal(true_there[:, 1], true[:, 1]):
                array[:, fields.ADVANCE] = self.wheel.radius_m * fields.speed_ratio(true_there[:, 1])[0]
            there = self._changed(Contact(array, self.wheel), drive, vector_there)
            forces_there = self._forces_near(there, contact, forces, None if integrated else slopes)
            by_step = ((true_there[:, 0] - true[:, 0]) - (forces_there[:, 0] - carried)) / growth
            channels = self._channels(drive, imposed_there, there, vector_there, forces_there)
            return (channels - base + along * by_step[:, None]) / np.reshape(step, (-1, 1)), by_step / step

        integrated = [False] * SOIL_COUNT + [each.step > 0.0 for effect in self.effects for each in effect.parameters]
        same_contact = np.concatenate(
            [np.zeros(SOIL_COUNT, dtype=bool), *[~effect.moves_wheel for effect in self.effects]]
        )
        steps, width = self._steps(drive, vector), len(integrated)
        by_parameter, theta_1_by_parameter = np.empty((*base.shape, width)), np.empty((len(base), width))
        reused = 0
        if known is not None and np.allclose(corrected, known.channels, rtol=_SAME, atol=0.0, equal_nan=True):
            reused = known.theta_1_by_parameter.shape[-1]
            by_parameter[..., :reused], theta_1_by_parameter[:, :reused] = (
                known.by_parameter,
                known.theta_1_by_parameter,
            )
        for index, (stepped, step) in list(enumerate(steps))[reused:]:
            by_parameter[:, :, index], theta_1_by_parameter[:, index] = derivative(
                imposed, stepped, step, integrated=integrated[index], same_contact=same_contact[index]
            )  # fmt: skip
        strength = by_parameter[..., 0] * soil[:, 0, None] + by_parameter[..., 1] * soil[:, 1, None]
        answer = Response(
            corrected, angle + correction, by_parameter, by_ground=np.stack([by_parameter[..., 3], strength], axis=-1),
            theta_1_by_parameter=theta_1_by_parameter, ground=drive.ground, growth=angle * growth / carried, rim=rim,
        )  # fmt: skip
        if not latent:
            return answer
        by_latent = np.empty((*base.shape, 2))
        zero = np.zeros(len(imposed))
        step_N = _STEP * np.abs(imposed[:, 0])
        by_latent[:, :, 0], _ = derivative(imposed + np.column_stack([step_N, zero]), vector, step_N)
        # A step towards zero slip never reaches a locked wheel or one that spins on the spot.
        step_slip = np.where(imposed[:, 1] > 0.0, -_STEP, _STEP)
        by_latent[:, :, 1], _ = derivative(imposed + np.column_stack([zero, step_slip]), vector, step_slip)
        return replace(answer, by_latent=by_latent)

    def _in_equilibrium(
        self, drive: Drive, true: np.ndarray, vector: np.ndarray, entry: Entry, *, sloped: bool
    ) -> tuple[Contact, Rim]:
        """Return the contact that carries the load, and the integrals along its rim."""
        if entry.rim is not None:
            contact = self._contact(drive, true, vector, entry.rim.contact[:, fields.THETA_1])
            if entry.rim.matches(true, contact.array):
                return contact, entry.rim

        def lay_out(theta_1: np.ndarray) -> np.ndarray:
            return self._contact(drive, true, vector, theta_1).array

        fixed = not any(effect.shapes_contact for effect in self.effects)
        found = carry(
            lay_out(initial_angles(entry.theta_1)), true[:, 0], self.wheel.width_m, lay_out=None if fixed else lay_out,
            growth=entry.growth, near=entry.growth is not None, sloped=sloped,
        )  # fmt: skip
        contact = self._contact(drive, true, vector, found.contact[:, fields.THETA_1])
        return contact, Rim(true, contact.array, found.forces, found.slopes)

    def _steps(self, drive: Drive, vector: np.ndarray) -> list[tuple[np.ndarray, float | np.ndarray]]:
        """Vectors with a small step of each parameter, relative to its scale, and the step in each row.

        A step of a soil's parameter is one in all grounds.
        """
        answer: list[tuple[np.ndarray, float | np.ndarray]] = []
        cohesion = 10.0 * _STEP * np.maximum(np.abs(vector[self.soils][::SOIL_COUNT]), 500.0)
        for index, step in enumerate([cohesion, *[np.full(self.grounds, _STEP)] * 4]):
            stepped = vector.copy()
            stepped[self.soils][index::SOIL_COUNT] += step
            answer.append((stepped, step[drive.ground]))
        for effect, where in self.slices():
            for index, parameter in enumerate(effect.parameters, where.start):
                stepped, value = vector.copy(), vector[index]
                step = parameter.step or _STEP * max(parameter.scale, abs(value - parameter.null))
                step = -step if value + step > parameter.high else step
                stepped[index] += step
                answer.append((stepped, step))
        return answer

    def _true(self, drive: Drive, imposed: np.ndarray, vector: np.ndarray) -> np.ndarray:
        true = imposed.copy()
        for effect, where in self.slices():
            effect.impose(true, drive, vector[where])
        return true

    def _contact(self, drive: Drive, true: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Contact:
        bare = contact_array(theta_1, true[:, 1], [*self._soil(drive, vector).T], self.wheel)
        return self._changed(Contact(bare, self.wheel), drive, vector)

    def _changed(self, contact: Contact, drive: Drive, vector: np.ndarray) -> Contact:
        """Let the effects change the textbook contact, in place."""
        # Effects of the soil itself come first.
        for effect, where in sorted(self.slices(), key=lambda pair: not pair[0].of_ground):
            effect.contact(contact, drive, vector[where])
        return contact

    def _forces_near(self, there: Contact, here: Contact, forces: np.ndarray, slopes: np.ndarray | None) -> np.ndarray:
        """Forces (n, 3) of a contact, linearised about the contact `here` if `slopes` are given.

        Rows that differ and cannot be linearised are integrated; the others have the forces of `here`.
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

    def _soil(self, drive: Drive, vector: np.ndarray) -> np.ndarray:
        """Return c [Pa], tan phi, k [m], stiffness [Pa] and n of each row, (n, 5), of a vector (p,), or (p, n)."""
        soils = vector[self.soils]
        soils = soils.reshape(-1, SOIL_COUNT) if vector.ndim == 1 else soils.T
        soils = np.column_stack([soils[:, :2], np.exp(soils[:, 2:])])
        return soils[drive.ground] if vector.ndim == 1 else soils
