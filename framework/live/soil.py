"""The soil of the stretch in progress, from the wheels' samples as they come."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ...database.posterior import ClassSoil
from ...identification.estimate.departure import ANY_SOIL_SD, DepartureTest
from ...identification.estimate.online import LEAST_SAMPLES, OnlineEstimate, OnlineIdentifier
from ...identification.mechanics.textbook import CHANNELS
from ...identification.rows.gate import quasi_static
from ...identification.rows.motor import with_torque
from ...identification.rows.noise import sensor_noise
from ...identification.rows.weight import with_loads
from ..core.errors import InputError
from ..core.recording.types import WheelTable
from ..core.recording.wheel_file import derive
from ..core.soil import Quantity
from ..core.vehicle import Vehicle, Wheel
from .events import SoilDeparts
from .log import WheelRow, table_of_rows
from .observing import described

WINDOW = 200
"""Samples that the estimate rests on, at most [-]."""

STEP_S = 0.1
"""Samples of all wheels together count no more often [s]: what is closer repeats the same ground."""

_SEEN_S = 2.0
"""Samples of each wheel that the gate sees [s]: it smooths over 11 of them, and takes rates over 0.6 s."""

_MOST_WAITING = 2000
_POLL_S = 0.01

_AT_ONCE = 2
"""Rows that the estimate is made from with each sample, at most: after a search those that waited follow one by one."""

_USUAL = np.array([1e3, 0.6, math.log(0.02), math.log(2e5), 0.0])
_ADVICE = {
    "too fast": "drive more slowly",
    "accelerating": "hold the speed",
    "not straight": "drive straight ahead",
    "braked": "do not brake",
    "digging in": "lessen the slip",
    "at standstill": "drive",
}


@dataclass(frozen=True)
class SoilByNow:
    """The soil of the stretch in progress.

    Parameters
    ----------
    time_s
        Of the newest sample [s].
    since_s
        When the stretch began [s].
    class_name
        Its class by the senses; empty where none is probable enough.
    parameters
        By name, each with its 95 % interval; empty before the first estimate.
    n
        Samples that it rests on.
    waiting
        Samples that count and are not part of it yet, as while the estimator searches for another soil.
    reason
        Why the newest sample does not count; empty where it does.
    advice
        What driving would determine what is not determined yet; empty where nothing is missing.
    log_ratio
        Logarithm of the likelihood of any soil over that of the class's stored one [-]; NaN where there is none.
    """

    time_s: float
    since_s: float
    class_name: str
    parameters: Mapping[str, Quantity] = field(default_factory=dict)
    n: int = 0
    reason: str = ""
    advice: str = ""
    log_ratio: float = math.nan
    waiting: int = 0


class SoilWatch:
    """Follows the soil in a thread of its own.

    Parameters
    ----------
    vehicle
        Its wheels, and the noise of its sensors.
    known
        What is stored of the soil, by class: those whose prediction is the textbook wheel's.
    tell
        Called where the soil departs from that of its class.
    """

    def __init__(self, vehicle: Vehicle, known: Mapping[str, ClassSoil], tell: Callable[[SoilDeparts], None]):
        self._vehicle, self._known, self._tell = vehicle, known, tell
        self._changed = threading.Condition()
        self._waiting: deque[tuple[float, WheelRow]] = deque(maxlen=_MOST_WAITING)
        self._has_ended = False
        self._seen: dict[str, deque[tuple[float, WheelRow]]] = {}
        self._counted_s = -math.inf
        self._shape: tuple[float, float] | None = None
        self._stretch = _Stretch(-math.inf, "", None)
        self.now: SoilByNow | None = None
        self.fault = ""
        self._thread = threading.Thread(target=self._work, name="bevameter soil", daemon=True)

    def begin(self) -> None:
        """Begin to follow."""
        self._thread.start()

    def put(self, time_s: float, row: WheelRow) -> None:
        """Take in a sample; where too many wait, the oldest is dropped."""
        with self._changed:
            self._waiting.append((time_s, row))
            self._changed.notify()

    def begin_stretch(self, time_s: float, class_name: str) -> None:
        """Begin anew on ground of another class, which the wheels came onto at a time [s]."""
        soil = self._known.get(class_name)
        test = None if soil is None else DepartureTest(*prediction_of(soil))
        with self._changed:
            self._stretch = _Stretch(time_s, class_name, test)

    def end(self) -> None:
        """Follow what waits, and end."""
        with self._changed:
            self._has_ended = True
            self._changed.notify()
        self._thread.join()

    def _work(self) -> None:
        while True:
            with self._changed:
                while not (self._waiting or self._has_ended or self._stretch.waiting):
                    self._changed.wait(1.0)
                    if not threading.main_thread().is_alive():
                        return
                if self._has_ended and not self._waiting:
                    break
                if not self._waiting:  # rows wait for a search
                    self._changed.wait(_POLL_S)
                rows, stretch = list(self._waiting), self._stretch
                self._waiting.clear()
            try:
                self._follow(rows, stretch)
            except Exception as error:  # the next samples may be usable
                self.fault = f"the soil in progress is not followed: {described(error)}"
        if self.now is not None:
            self._stretch.finish()
            self._say(self.now.time_s, self._stretch, self.now.reason)

    def _follow(self, rows: list[tuple[float, WheelRow]], stretch: _Stretch) -> None:
        by_wheel: dict[str, list[tuple[float, WheelRow]]] = {}
        for time_s, row in rows:
            by_wheel.setdefault(row.wheel, []).append((time_s, row))
        reason = ""
        for name, new in by_wheel.items():
            wheel = self._vehicle.wheel(name or None)
            self._shape = self._shape or (wheel.radius_m, wheel.width_m)
            if (wheel.radius_m, wheel.width_m) != self._shape or wheel.driven is False:
                continue
            try:
                table, vehicle, reasons = self._judged(name, wheel, new)
            except InputError as error:
                reason = error.problem
                continue
            reason = str(reasons[-1])
            for at in range(len(table) - len(new), len(table)):
                time_s = float(table["time_s"][at])
                if not reasons[at] and time_s >= max(self._counted_s + STEP_S - 1e-6, stretch.since_s):
                    self._counted_s = time_s
                    stretch.add(table, at, wheel, vehicle)
        stretch.go_on(_AT_ONCE)
        if rows:
            self._say(rows[-1][0], stretch, reason)
        elif self.now is not None:
            self._say(self.now.time_s, stretch, self.now.reason)

    def _judged(
        self, name: str, wheel: Wheel, new: list[tuple[float, WheelRow]]
    ) -> tuple[WheelTable, Vehicle, np.ndarray]:
        """Give the newest rows of a wheel with what is computed of them, and why each is not to be used."""
        seen = self._seen.setdefault(name, deque())
        seen.extend(new)
        while seen[0][0] < new[0][0] - _SEEN_S:
            seen.popleft()
        table, vehicle = table_of_rows(list(seen)), self._vehicle
        table, _ = with_torque(table, vehicle)
        table, vehicle, _ = with_loads(table, vehicle, None)
        table = derive(table, wheel)
        return table, vehicle, quasi_static(table, wheel)

    def _say(self, time_s: float, stretch: _Stretch, reason: str) -> None:
        since_s = max(stretch.since_s, self.now.since_s if self.now is not None else time_s)
        advice = next((text for start, text in _ADVICE.items() if reason.startswith(start)), "")
        self.now = stretch.by_now(time_s, since_s, reason, advice)
        if stretch.departs and not stretch.is_said:
            stretch.is_said = True
            self._tell(SoilDeparts(time_s, stretch.class_name, stretch.strength_share(self._known), self.now.log_ratio))


@dataclass
class _Stretch:
    """A stretch of ground of one class, and what the wheels have measured on it."""

    since_s: float
    class_name: str
    test: DepartureTest | None
    is_said: bool = False
    _rows: list[tuple[float, WheelRow]] = field(default_factory=list)
    _identifier: OnlineIdentifier | None = None
    _waiting: deque[dict[str, float]] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _found: OnlineEstimate | None = None
    _advice: str = ""

    def add(self, table: WheelTable, at: int, wheel: Wheel, vehicle: Vehicle) -> None:
        """Take in a row that counts."""
        row = {name: float(table[name][at]) for name in CHANNELS if name in table}
        if self._identifier is None:
            self._rows.append((float(table["time_s"][at]), WheelRow("", row)))
            if len(self._rows) < LEAST_SAMPLES:
                return
            found = sensor_noise(table_of_rows(self._rows), vehicle).tolist()
            noise = {str(name): value for name, value in zip(CHANNELS, found, strict=True)}
            self._identifier = OnlineIdentifier(wheel, noise, window=WINDOW, searches_apart=True)
            for _, each in self._rows[:-1]:
                self._identifier.update(**each.channels)
        self._waiting.append(row)

    @property
    def waiting(self) -> int:
        """Rows that wait for the estimator."""
        return len(self._waiting)

    def go_on(self, most: int) -> None:
        """Estimate from rows that wait, `most` of them; from none while the estimator searches."""
        own = self._identifier
        while own is not None and self._waiting and not own.is_searching and most > 0:
            self._found, most = own.update(**self._waiting.popleft()), most - 1
            self._advice = own.advice()
            if self.test is not None and self._found is not None and not own.is_searching:
                self.test.update(*own.vector())

    def finish(self) -> None:
        """Estimate from all rows that wait."""
        while self._identifier is not None and self._waiting:
            self.go_on(WINDOW)
            time.sleep(_POLL_S)

    @property
    def departs(self) -> bool:
        """Whether the soil has left that of its class."""
        return self.test is not None and self.test.has_departed

    def strength_share(self, known: Mapping[str, ClassSoil]) -> float:
        """Shear strength over that of the class, at the stress that the class was driven at."""
        assert self._identifier is not None
        soil = known[self.class_name]
        stress = np.array([1.0, _middle_stress(soil)])
        return float(stress @ self._identifier.vector()[0][:2] / (stress @ soil.strength.mean))

    def by_now(self, time_s: float, since_s: float, reason: str, advice: str) -> SoilByNow:
        """Give what is known of it; `advice` where the newest sample does not count."""
        log_ratio = math.nan if self.test is None else self.test.log_ratio
        found, own = self._found, (time_s, since_s, self.class_name)
        if found is None:
            return SoilByNow(*own, reason=reason, advice=advice, log_ratio=log_ratio, waiting=self.waiting)
        both = "; ".join(filter(None, (advice, self._advice)))
        return SoilByNow(*own, found.parameters, found.n, reason, both, log_ratio, self.waiting)


def prediction_of(soil: ClassSoil) -> tuple[np.ndarray, np.ndarray, float]:
    """Predict the soil of a new place of a class: mean (5,) and covariance of c [Pa], tan phi, ln k, ln stiffness and
    ln n, and degrees of freedom. What no stretch determines may be anything.
    """
    mean, covariance = _USUAL.copy(), np.diag(ANY_SOIL_SD**2)
    mean[:2], covariance[:2, :2] = soil.strength.mean, soil.strength.predictive_covariance
    freedom = [soil.strength.predict(np.array([1.0, _middle_stress(soil)]))[2]]
    for at, name in ((2, "log_k"), (3, "log_stiffness"), (4, "n")):
        if name in soil.others:
            centre, scale, least = soil.others[name].predict(np.ones(1))
            mean[at] = math.log(centre) if name == "n" else centre
            covariance[at, at] = (scale / centre if name == "n" else scale) ** 2
            freedom.append(least)
    return mean, covariance, min(freedom)


def _middle_stress(soil: ClassSoil) -> float:
    """Stress in the middle of those that a class was driven at [Pa]."""
    middle = 0.5 * sum(soil.normal_stress_Pa)
    return middle if math.isfinite(middle) else 20e3
