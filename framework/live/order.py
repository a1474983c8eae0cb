"""Samples in the order of their times: those of a stream wait for late ones as long as the horizon allows."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from typing import Generic, TypeVar

_Sample = TypeVar("_Sample")


class InOrder(Generic[_Sample]):
    """Samples of one stream that wait until no earlier one is expected any more.

    Attributes
    ----------
    passed_s
        Time of the last sample that was given on [s].
    taken_s
        Of a drive that is resumed: those before were taken in before [s], and are left out without a word.
    late
        How many came after a later one had been given on, and were left out.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[float, int, _Sample]] = []
        self._count = 0
        self.passed_s = self.taken_s = -math.inf
        self.late = 0

    def put(self, time_s: float, sample: _Sample) -> bool:
        """Take in a sample; False where it is late. One of the same time as the last is not."""
        if time_s < self.passed_s:
            self.late += time_s >= self.taken_s
            return False
        heapq.heappush(self._waiting, (time_s, self._count, sample))
        self._count += 1
        return True

    def until(self, time_s: float) -> Iterator[tuple[float, _Sample]]:
        """Give on the samples up to a time [s], in order; those of one time in the order in which they came."""
        while self._waiting and self._waiting[0][0] <= time_s:
            self.passed_s, _, sample = heapq.heappop(self._waiting)
            yield self.passed_s, sample
