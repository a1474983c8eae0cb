"""Many soils at once through the wheel with effects: what a planner's draws from a class of ground need.

The class's ground is asked about, not a drive: level, steady, fresh, at the speed that the effects were found at. So
only effects of the ground act; those that wait for a slope, a pass number or a speed have nothing to say, and those of
the vehicle that drove there, or of its instruments, stay with that vehicle.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtri

from ...framework.core.soil import PARAMETERS
from ...framework.core.vehicle import Wheel
from ..augmented import AugmentedWheel
from ..simulate import soil_vector
from ..wheel_soil import Soil
from .catalogue import forms_by_name
from .drive import PresentDrive
from .effect import COVARIATES, PULL, Contact, Drive, Effect
from .named import pinned, situation_of, smallest_holding
from .stored import AugmentedSimulator, StoredEffect
from .track import ALONG_X

GROUND = (
    "slip_sinkage", "stress_peak_shift", "exit_angle", "shear_hump", "hard_layer", "rim_adhesion", "bulldozing",
    "side_wall_friction", "grousers",
)  # fmt: skip
"""Effects that ground has on whatever wheel comes next; lugs shear at a share of that wheel's own height."""


class _SoilOfRow(Effect):
    """Every row has its own soil, columns as `PARAMETERS`."""

    slug = "soil"
    parameters = ()

    def __init__(self, soils: np.ndarray) -> None:
        self._soils = soils

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Lay the soils out."""
        contact.c_Pa, contact.tan_phi = self._soils[:, 0], np.tan(self._soils[:, 1])
        contact.k_m, contact.stiffness_Pa, contact.n = self._soils[:, 2:].T


class _ValuesOfRow(Effect):
    """An effect whose parameters, (k, n), differ from row to row."""

    parameters = ()

    def __init__(self, effect: Effect, values: np.ndarray) -> None:
        self.slug = effect.slug  # type: ignore[misc]
        self._effect, self._values = effect, values

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Pass on."""
        self._effect.contact(contact, drive, self._values)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        """Pass on."""
        self._effect.act(channels, contact, drive, self._values)


def parameter_count(physics: AugmentedSimulator) -> int:
    """Count the parameters of the effects that act on planners' predictions."""
    return sum(len(effect.parameters) for effect in _of_the_ground(physics))


def drawbar_pull(
    physics: AugmentedSimulator, wheel: Wheel, soils: np.ndarray, uniform: np.ndarray, load_N: float, slips: np.ndarray
) -> np.ndarray:
    """Drawbar pull of one wheel on many soils at many slips.

    Parameters
    ----------
    physics
        Effects, with the uncertainty of their parameters.
    wheel
        Any wheel.
    soils : (s, 5)
        Columns as `PARAMETERS`, SI.
    uniform : (s, `parameter_count`)
        Numbers in (0, 1), of which each soil's parameters of the effects are drawn, each from a normal distribution
        cut off at its bounds, apart from each other.
    load_N
        On the wheel [N].
    slips : (k,)
        [-].

    Returns
    -------
    (s, k)
        [N]; NaN where the load is not carried.
    """
    rows = len(soils) * len(slips)
    drive = _level_drive(np.full(rows, load_N), np.tile(slips, len(soils)))
    middle = Soil(**dict(zip(PARAMETERS, np.median(soils, axis=0).tolist(), strict=True)))
    situation = situation_of(wheel, middle, drive)
    effects: list[Effect] = [_SoilOfRow(np.repeat(soils, len(slips), axis=0))]
    column = 0
    for stored in _of_the_ground(physics):
        count = len(stored.parameters)
        drawn = uniform[:, column : column + count]
        column += count
        alike = [effect for effect in forms_by_name(stored.slug, situation) if effect.form == stored.form]
        effect = smallest_holding(set(stored.parameters), alike)
        if effect is not None:
            values = _drawn(effect, stored, drawn)
            effects.append(_ValuesOfRow(pinned(effect, stored.named), np.repeat(values, len(slips), axis=1)))
    model = AugmentedWheel(wheel, tuple(effects))
    channels = model.predict(drive, np.column_stack([drive.load_N, drive.slip]), soil_vector(middle)).channels
    return channels[:, PULL].reshape(len(soils), len(slips))


def _of_the_ground(physics: AugmentedSimulator) -> list[StoredEffect]:
    return [effect for effect in physics.effects if effect.slug in GROUND]


def _drawn(effect: Effect, stored: StoredEffect, uniform: np.ndarray) -> np.ndarray:
    """Parameters (k, s) in the effect's order."""
    order = list(stored.parameters)
    values = []
    for parameter in effect.parameters:
        entry = stored.parameters.get(parameter.name)
        if entry is None:
            values.append(np.full(len(uniform), parameter.null))
            continue
        sd = entry.sd if math.isfinite(entry.sd) else 0.0
        normal = ndtri(np.clip(uniform[:, order.index(parameter.name)], 1e-9, 1.0 - 1e-9))
        # Bounds that follow from the drive that it was found on are not this wheel's; the value itself was in them.
        low, high = min(parameter.low, entry.value), max(parameter.high, entry.value)
        values.append(np.clip(entry.value + sd * normal, low, high))
    return np.array(values)


def _level_drive(load_N: np.ndarray, slip: np.ndarray) -> PresentDrive:
    nothing = np.full(len(load_N), math.nan)
    unseen = {name: nothing for name in COVARIATES if name not in ("load_N", "slip", "stretch")}
    return PresentDrive(load_N=load_N, slip=slip, stretch=np.arange(len(load_N)), axis=ALONG_X, **unseen)
