"""What a snapshot answers: n places, each known or unknown with a reason."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from ..framework.core.arguments import number, refused
from ..framework.core.pooling import pooled
from ..framework.core.vehicle import Vehicle
from .belief import OUTSIDE, Cells
from .bounds import outside
from .cell_index import UNSEEN
from .ground_table import GroundTable

if TYPE_CHECKING:
    from .mobility import DrawbarPull, Mobility
    from .snapshot import Snapshot
    from .speed import SpeedLimit
    from .traction import Traction

_Value = TypeVar("_Value")


class _Lazy(Generic[_Value]):
    """A property that is computed once; `functools.cached_property` takes a lock before Python 3.12."""

    def __init__(self, compute: Callable[[Any], _Value]) -> None:
        self._compute, self._name, self.__doc__ = compute, compute.__name__, compute.__doc__

    @overload
    def __get__(self, instance: None, owner: type) -> _Lazy[_Value]: ...
    @overload
    def __get__(self, instance: object, owner: type) -> _Value: ...
    def __get__(self, instance: object | None, owner: type) -> _Lazy[_Value] | _Value:
        if instance is None:
            return self
        value = self._compute(instance)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        instance.__dict__[self._name] = value
        return value


class GroundAnswer:
    """What is known of n places, read-only. Numbers are NaN where nothing is known, with the reason.

    Each column is computed when it is first read.

    Parameters
    ----------
    snapshot, table
        What was asked, and its cells at the normal stress and confidence requested.
    rows : (n,)
        Rows of the table.
    places : (n, 2)
        x, y [m].
    moment
        That ages refer to, POSIX seconds.
    fresh
        The same answer had nothing aged: no bound is above its one; None where nothing is.
    """

    def __init__(
        self, snapshot: Snapshot, table: GroundTable, rows: np.ndarray, places: np.ndarray, moment: float,
        fresh: GroundAnswer | None = None,
    ) -> None:  # fmt: skip
        self.snapshot, self.fresh = snapshot, fresh
        self._table, self._rows, self._places, self._moment = table, rows, places, moment

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def normal_stress(self) -> float:
        """As requested [Pa]."""
        return self._table.normal_stress

    @property
    def confidence(self) -> float:
        """As requested [-]."""
        return self._table.confidence

    @property
    def moment(self) -> float:
        """That ages refer to, POSIX seconds."""
        return self._moment

    @property
    def class_names(self) -> tuple[str, ...]:
        """The k classes."""
        return self._table.class_names

    @_Lazy
    def x(self) -> np.ndarray:
        """(n,): the places' x [m]; centres of cells where a region was requested."""
        return np.ascontiguousarray(self._places[:, 0])

    @_Lazy
    def y(self) -> np.ndarray:
        """(n,): their y [m]."""
        return np.ascontiguousarray(self._places[:, 1])

    @_Lazy
    def known(self) -> np.ndarray:
        """(n,) bool: is the soil known? Classes whose soil was not measured must weigh less than 1 - confidence."""
        return self._table.known[self._rows]

    @_Lazy
    def reason(self) -> np.ndarray:
        """(n,) str: why the soil is not known; empty where it is."""
        reason, bounds = self._table.reason[self._rows], self.snapshot.bounds
        if bounds is not None:  # what lies beyond was not looked up
            beyond = outside(self._places, bounds, self.snapshot.cell_size_m)
            reason[beyond & (self._rows == UNSEEN)] = OUTSIDE
        return reason

    @_Lazy
    def class_index(self) -> np.ndarray:
        """(n,) int: number in `class_names` of the most probable class, -1 where not seen or not recognised."""
        return self._table.class_index[self._rows]

    @_Lazy
    def class_probability(self) -> np.ndarray:
        """(n, k): belief over classes [-]; NaN where the ground was not seen or not recognised."""
        return self._of_cells(self._table.cells.probability, np.nan)

    @_Lazy
    def cohesion(self) -> np.ndarray:
        """(n,): expected c [Pa]."""
        return self._table.cohesion[self._rows]

    @_Lazy
    def friction_angle(self) -> np.ndarray:
        """(n,): phi of the expected tan phi [rad]."""
        return self._table.friction_angle[self._rows]

    @_Lazy
    def covariance(self) -> np.ndarray:
        """(n, 2, 2): covariance of (c, tan phi) of this place: which class it is, what place of its class, how well
        that is known.
        """
        return self._table.covariance[self._rows]

    @_Lazy
    def shear_strength(self) -> np.ndarray:
        """(n,): expected c + sigma tan phi [Pa]."""
        return self._table.shear_strength[self._rows]

    @_Lazy
    def shear_strength_lower(self) -> np.ndarray:
        """(n,): lower bound of the shear strength at the confidence [Pa].

        That of the mixture of classes, each a Student t (few stretches bound little); classes without soil count as no
        strength.
        """
        lower = self._table.shear_strength_lower[self._rows]
        return lower if self.fresh is None else np.minimum(lower, self.fresh.shear_strength_lower)

    @_Lazy
    def age(self) -> np.ndarray:
        """(n,): time since the newest look [s]; NaN where unknown."""
        return self._moment - self._of_cells(self._table.cells.seen_s, np.nan)

    @_Lazy
    def observation_count(self) -> np.ndarray:
        """(n,) int: number of drives that recognised the place."""
        return self._of_cells(self._table.cells.looks, 0)

    @_Lazy
    def extrapolated(self) -> np.ndarray:
        """(n,) bool: is the normal stress far from those driven on a class that may well be here?"""
        return self._table.extrapolated[self._rows]

    @_Lazy
    def note(self) -> np.ndarray:
        """(n,) str: where known, that the strength is extrapolated, and what holds a low bound down and which drive
        would raise it; empty where there is nothing to say.
        """
        return self._table.note[self._rows]

    def labels(self) -> list[str]:
        """Give the most probable class of each place, or ``"unknown"``."""
        return self._table.label[self._rows].tolist()

    def aged(self, half_life: float) -> GroundAnswer:
        """Return the answer with evidence of each cell that halves in so many seconds; see `Snapshot.along`.

        Ground whose soil is not known stays so: ageing must not thin out the class whose soil is lacking.
        """
        if not number("half_life", half_life, "a positive number [s]") > 0.0:  # nor is NaN
            raise refused("half_life", half_life, "a positive number [s]")
        cells, table = self._table.cells, self._table
        there = self._rows >= 0
        own = self._rows[there]
        age = np.maximum(self._moment - cells.seen_s[own], 0.0)
        count = np.where(np.isnan(age), 0.0, 0.5 ** (age / half_life))
        count[~table.known[own]] = 1.0
        logs = np.log(np.maximum(cells.probability[own], np.finfo(float).tiny))
        aged = Cells(
            cells.key[own], pooled(count[:, None] * logs), cells.seen_s[own], cells.looks[own], cells.reason[own],
            cells.reasons,
        )  # fmt: skip
        rows = self._rows.copy()
        rows[there] = np.arange(len(own))
        weaker = GroundTable(aged, table.class_names, table.soils, table.normal_stress, table.confidence)
        return GroundAnswer(self.snapshot, weaker, rows, self._places, self._moment, self)

    def drawbar_pull(
        self, vehicle: Vehicle | str | Path, slip: float, *, load_N: float | Sequence[float] | None = None
    ) -> DrawbarPull:
        """Predict the vehicle's drawbar pull at each place and slip; see `mobility.drawbar_pull`."""
        from .mobility import drawbar_pull

        return drawbar_pull(self, vehicle, slip, load_N)

    def mobility(self, vehicle: Vehicle | str | Path, *, load_N: float | Sequence[float] | None = None) -> Mobility:
        """Predict whether and how well the vehicle moves at each place; see `mobility.mobility`."""
        from .mobility import mobility

        return mobility(self, vehicle, load_N)

    def traction(
        self,
        vehicle: Vehicle | str | Path,
        *,
        pitch: ArrayLike = 0.0,
        roll: ArrayLike = 0.0,
        load_N: float | Sequence[float] | None = None,
    ) -> Traction:
        """Predict what the ground can bear of acceleration, braking and side force; see `traction.traction`."""
        from .traction import traction

        return traction(self, vehicle, pitch=pitch, roll=roll, load_N=load_N)

    def speed_limit(
        self,
        vehicle: Vehicle | str | Path,
        *,
        sight_m: float,
        most_m_s: float,
        unknown_m_s: float = 0.0,
        reaction_s: float = 0.0,
        curvature: ArrayLike | None = None,
        pitch: ArrayLike = 0.0,
        roll: ArrayLike = 0.0,
        load_N: float | Sequence[float] | None = None,
    ) -> SpeedLimit:
        """Find the greatest speed at each place of a path; see `speed.speed_limit`."""
        from .speed import speed_limit

        return speed_limit(
            self, vehicle, sight_m=sight_m, most_m_s=most_m_s, unknown_m_s=unknown_m_s, reaction_s=reaction_s,
            curvature=curvature, pitch=pitch, roll=roll, load_N=load_N,
        )  # fmt: skip

    def _of_cells(self, column: np.ndarray, missing: float) -> np.ndarray:
        """Gather a column of the cells (m, ...): (n, ...), `missing` where there is no cell."""
        answer = np.full((len(self._rows), *column.shape[1:]), missing, dtype=column.dtype)
        there = self._rows >= 0
        answer[there] = column[self._rows[there]]
        return answer
