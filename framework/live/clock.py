"""The one clock of a drive, though a sensor's time stamps jump."""

from __future__ import annotations

import math
from typing import Any

JUMP_S = 5.0
"""A time stamp this far from the newest one is a jump of the clock, a pause, or wrong [s]."""

_MOST_SHIFTS = 5
"""So many settings of the clock are known at once: a sample may still be on its way since the one before."""

_AGREEING = 3
"""So many samples of one sensor in a row, all after a jump, are believed."""


_STEADY_S, _ALIKE = 1.0, 0.8
"""A sensor has a clock of its own if for so long [s] its time and that of the others go on alike, by this share [-]."""


class DriveClock:
    """Puts time stamps on one clock that does not jump back.

    A stamp far from the newest one is held until two more of its sensor agree with it: one that is wrong by itself
    leaves no trace. Forwards they are believed then, as after a pause. Backwards the clock was set: from there on the
    drive's clock goes on from where it was, for all sensors. Where others went on meanwhile as fast as
    it did, the sensor has a clock of its own. It is put on that of the others, which it does not move. Where it went on
    more slowly or faster, what it gives is late, and left out until it has caught up.

    Attributes
    ----------
    newest_s
        The newest time [s].
    jumps
        What happened, in words.
    """

    def __init__(self) -> None:
        self.newest_s = -math.inf
        self.jumps: list[str] = []
        self.wrong = 0
        self._shifts = [0.0]
        self._own: dict[str, float] = {}
        self._since: dict[str, float] = {}
        self._held: dict[str, list[tuple[float, Any]]] = {}

    def state(self) -> dict[str, Any]:
        """Give what a drive that is resumed has to know of it."""
        return {"shifts": self._shifts, "own": self._own, "jumps": self.jumps, "wrong": self.wrong}

    def restore(self, state: dict[str, Any], newest_s: float) -> None:
        """Go on from a state, at a time [s]."""
        self._shifts, self._own = list(state["shifts"]), dict(state["own"])
        self.jumps, self.wrong = list(state["jumps"]), state["wrong"]
        self.newest_s = newest_s

    @property
    def problems(self) -> tuple[str, ...]:
        """What happened, and how many samples were left out."""
        wrong = f"{self.wrong} samples with times far from all others were left out"
        return (*self.jumps, *((wrong,) if self.wrong else ()))

    def on_one_clock(self, stream: str, stamp_s: float, sample: Any) -> list[tuple[float, Any]]:
        """Give samples of a sensor with their times [s], the new one the last; none while its stamp is in doubt."""
        time_s, is_own = self._shifted(stream, stamp_s)
        if abs(time_s - self.newest_s) <= JUMP_S or math.isinf(self.newest_s):
            if not is_own:
                self.newest_s = max(self.newest_s, time_s)
            return [*self.let_go(stream), (time_s, sample)]
        held = self._held.setdefault(stream, [])
        if held and not held[-1][0] <= stamp_s <= held[-1][0] + JUMP_S:
            self.wrong += len(held)
            held.clear()
        if not held:
            self._since[stream] = self.newest_s
        held.append((stamp_s, sample))
        first = held[0][0]
        if (others_s := self.newest_s - self._since[stream]) > 0.0:  # neither a pause nor a jump: others went on
            own_s = stamp_s - first
            if max(own_s, others_s) < _STEADY_S:
                return []
            if min(own_s, others_s) < _ALIKE * max(own_s, others_s):  # late: it falls behind, or catches up
                self.wrong += len(held)
                held.clear()
                return []
            del self._held[stream]
            self._own[stream] = self.newest_s - stamp_s
            self.jumps.append(f"{stream} has a clock of its own at {stamp_s:.1f} s; it is put on that of the others")
            return [(each + self._own[stream], one) for each, one in held]
        is_back = first + self._shifts[-1] < self.newest_s
        if len(held) < _AGREEING or (is_back and stamp_s - first < _STEADY_S):
            return []
        del self._held[stream]
        if is_back:
            back_s = self.newest_s - first - self._shifts[-1]
            said = f"the clock jumped back by {back_s:.1f} s at {self.newest_s:.1f} s"
            self.jumps.append(f"{said}; times go on from there")
            self._shifts = [*self._shifts[1 - _MOST_SHIFTS :], self.newest_s - first]
        self.newest_s = max(self.newest_s, stamp_s + self._shifts[-1])
        return [(each + self._shifts[-1], one) for each, one in held]

    def let_go(self, stream: str) -> list[tuple[float, Any]]:
        """Give those that were held of a sensor, and that the clock has come up with since."""
        held = [(self._shifted(stream, each)[0], one) for each, one in self._held.pop(stream, [])]
        good = [each for each in held if abs(each[0] - self.newest_s) <= JUMP_S]
        self.wrong += len(held) - len(good)
        return good

    def _shifted(self, stream: str, stamp_s: float) -> tuple[float, bool]:
        """Put a stamp on the clock, and say whether it is that of the sensor's own.

        A stamp that was on its way when the clock was set is still on the one before.
        """
        shared = min((stamp_s + each for each in self._shifts), key=lambda time_s: abs(time_s - self.newest_s))
        own = stamp_s + self._own[stream] if stream in self._own else math.inf
        is_own = abs(own - self.newest_s) < abs(shared - self.newest_s)
        return (own, True) if is_own else (shared, False)
