"""Faults of instruments in time: a channel that arrives late, a channel that wanders."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

from ..mechanics.textbook import CHANNELS
from .effect import LOAD, PULL, SINKAGE, SLIP, TORQUE, Drive, Effect, Parameter, Situation

_LONGEST_LAG = 40
"""Longest delay that is looked for, in samples."""

_FEW_ORDERS, _ORDERS, _GAIN_ORDERS = 3, 6, 3
"""Polynomials of a course that bends, at first and at most, and of one of a gain: each that is not needed errs at the
drive's ends, which nothing but these tells."""

_BENT = {_FEW_ORDERS: ", bent", _ORDERS: ", curved"}
"""What a course of so many polynomials is called."""

_MOST_GAIN = 0.15
"""Most of each of a gain's polynomials: it goes on by 30 per cent of itself, and never to nothing [-]."""

_SHORTEST_WARM, _WARMS_IN = 0.1, (0.12, 0.35)
"""Least time constant of what warms, and those from which it is sought, as shares of the drive [-]: what has settled
when the drive has hardly begun looks like a wrong zero, and slower ones go nearly straight."""

_FORETOLD = 0.87
"""Share of such a course that slip and load foretell, from which on no data tell it from a law that leaves out what
depends on them [-]. Of 60 drives each of the study's generator with one ramp of slip for each of three to five loads
0.96 at least is foretold, of its bench tests 0.73 at most, of its field drives 0.85."""

_CHORD, _ONE_RATE = 20, 0.9
"""Rows over which slip changes, and share of its mean square change that its mean change makes from which on it has one
rate [-]. Of 30 drives each of the study's generator half the ramps of slip have more than 0.99, its bench tests 0.024
at most, its field drives 0.002."""


def delayed(values: np.ndarray, time_s: np.ndarray, runs: Sequence[np.ndarray], lag_s: float) -> np.ndarray:
    """Values (n,) as they were `lag_s` ago, interpolated within each of the clock's runs; their ends are held."""
    answer = np.empty_like(values)
    for rows in runs:
        good = rows[np.isfinite(values[rows]) & np.isfinite(time_s[rows])]
        answer[rows] = np.interp(time_s[rows] - lag_s, time_s[good], values[good]) if good.size else np.nan
    return answer


def filtered(values: np.ndarray, time_s: np.ndarray, runs: Sequence[np.ndarray], constant_s: float) -> np.ndarray:
    """Values (n,) behind a first-order low-pass of time constant [s], within each of the clock's runs.

    Exact for values that go straight from one sample to the next.
    """
    answer = values.copy()
    for rows in runs:
        good = rows[np.isfinite(values[rows]) & np.isfinite(time_s[rows])]
        if len(good) < 2:
            continue
        step = float(np.median(np.diff(time_s[good])))
        constant = max(constant_s, 1e-9 * step)
        keep = math.exp(-step / constant)
        reached = (1.0 - keep) * constant / step
        now, before = 1.0 - reached, reached - keep
        # The run starts settled.
        answer[good], _ = lfilter([now, before], [1.0, -keep], values[good], zi=[(before + keep) * values[good[0]]])
    return answer


class LowPass(Effect):
    """A channel is smoothed by its amplifier or its driver, and so arrives late."""

    slug = "time_lag"
    kind = "instrument"
    remembers = True
    needs = ("time_s",)
    source = "definition of a first-order low-pass"

    def __init__(self, channel: int, step_s: float) -> None:
        self.form = f"{CHANNELS[channel]}, low-pass"
        self.equation = f"tau d({CHANNELS[channel]} reported)/dt = {CHANNELS[channel]} - {CHANNELS[channel]} reported"
        self._channel, self._step = channel, step_s
        self.parameters = (Parameter("tau", "s", 0.0, _LONGEST_LAG * step_s, step_s, 4.0 * step_s, step=0.2 * step_s),)

    def starts(self) -> list[np.ndarray]:
        return [np.array([samples * self._step]) for samples in (1.0, 5.0)]

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, self._channel] = filtered(channels[:, self._channel], drive.time_s, drive.runs, float(values[0]))


class TimeLag(Effect):
    """A channel arrives late (early, where negative)."""

    slug = "time_lag"
    kind = "instrument"
    remembers = True
    needs = ("time_s",)
    source = "definition"

    def __init__(self, channel: int, step_s: float) -> None:
        self.form = CHANNELS[channel]
        self.equation = f"{self.form} reported at t = {self.form} at t - tau"
        self._channel, self._step = channel, step_s
        longest = _LONGEST_LAG * step_s
        self.parameters = (Parameter("tau", "s", -longest, longest, step_s, 4.0 * step_s, step=0.2 * step_s),)

    def starts(self) -> list[np.ndarray]:
        return [np.array([samples * self._step]) for samples in (1.5, 6.0, 20.0, -2.0)]

    def delay(self, values: np.ndarray) -> tuple[int, float]:
        return self._channel, float(values[0]) / self._step

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        if self._channel in (LOAD, SLIP):
            column = 0 if self._channel == LOAD else 1
            imposed[:, column] = delayed(imposed[:, column], drive.time_s, drive.runs, -values[0])

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        if self._channel not in (LOAD, SLIP):
            channels[:, self._channel] = delayed(channels[:, self._channel], drive.time_s, drive.runs, values[0])


class ChannelDrift(Effect):
    """A channel wanders smoothly with time, from zero when the drive began."""

    slug = "drift"
    kind = "instrument"
    needs = ("time_s",)
    source = "A.-M. Legendre (1785): polynomials orthogonal over the drive"

    def __init__(self, channel: int, usual: float, orders: int, time_s: np.ndarray) -> None:
        self._made_of = channel, usual, orders, time_s
        self.form = CHANNELS[channel]
        self.equation = f"{self.form} reported = {self.form} + " + " + ".join(
            f"d{order} (P{order}(t) - P{order}(0))" for order in range(1, orders + 1)
        )
        self._channel = channel
        self.constants = {"t_first": float(np.nanmin(time_s)), "t_last": float(np.nanmax(time_s))}
        self.parameters = tuple(
            Parameter(f"d{order}", _unit(channel), -2.0 * usual, 2.0 * usual, 0.0, 0.1 * usual / order)
            for order in range(1, orders + 1)
        )
        if orders > 1:
            self.any_course = (self.form, "time_s")
            self.form += _BENT.get(orders, f", bent {orders - 1} times")
            self.freed = orders > _FEW_ORDERS

    def freer(self) -> list[Effect]:
        channel, usual, orders, time_s = self._made_of
        if orders != _FEW_ORDERS:
            return []
        return [ChannelDrift(channel, usual, more, time_s) for more in range(_FEW_ORDERS + 1, _ORDERS + 1)]

    def course(self, drive: Drive, values: np.ndarray) -> np.ndarray:
        """Give the polynomials' sum (n,), zero when the drive began."""
        first, last = self.constants["t_first"], self.constants["t_last"]
        along = np.nan_to_num(2.0 * (drive.time_s - first) / (last - first) - 1.0)
        series = np.concatenate([[0.0], values])
        return np.polynomial.legendre.legval(along, series) - np.polynomial.legendre.legval(-1.0, series)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, self._channel] += self.course(drive, values)


class GainDrift(ChannelDrift):
    """The constant of a channel wanders with time, as of a motor or an amplifier that warms."""

    source = "definition; polynomials of A.-M. Legendre (1785), from the drive's beginning to its end"

    def __init__(self, channel: int, time_s: np.ndarray, orders: int = 1, *, bends: bool = False) -> None:
        super().__init__(channel, 1.0, orders, time_s)
        name = CHANNELS[channel]
        courses = " + ".join(f"g{order} (P{order}(t) - P{order}(0))" for order in range(1, orders + 1))
        self.equation = f"{name} reported = {name} [1 + {courses}]"
        self.form = f"{name}, gain" + ", curved" * (orders > 1)
        self.parameters = tuple(
            Parameter(f"g{order}", "", -_MOST_GAIN, _MOST_GAIN, 0.0, 0.1 / order) for order in range(1, orders + 1)
        )
        self.freed, self.any_course = orders > 1, None
        self._freer = [GainDrift(channel, time_s, _GAIN_ORDERS)] if bends else []

    def freer(self) -> list[Effect]:
        return list(self._freer)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, self._channel] *= 1.0 + self.course(drive, values)


class WarmUp(Effect):
    """A channel wanders from when the drive began to where it settles, as of a sensor or an amplifier that warms."""

    slug = "drift"
    kind = "instrument"
    needs = ("time_s",)
    required = ("d", "tau")
    source = "I. Newton, Phil. Trans. R. Soc. 22 (1701), 824: what warms does so by a share of what it lacks"

    def __init__(self, channel: int, usual: float, time_s: np.ndarray) -> None:
        name = CHANNELS[channel]
        self.form = f"{name}, warming"
        self.equation = f"{name} reported = {name} + d (1 - exp(-max(t - t_first, 0) / tau))"
        self._channel = channel
        self.constants = {"t_first": float(np.nanmin(time_s))}
        self._long = long = float(np.nanmax(time_s)) - self.constants["t_first"]
        self.parameters = (
            Parameter("d", _unit(channel), -2.0 * usual, 2.0 * usual, 0.0, 0.1 * usual),
            Parameter("tau", "s", _SHORTEST_WARM * long, long, 0.2 * long, long, 0.2 * long),
        )

    def starts(self) -> list[np.ndarray]:
        return [np.array([0.0, share * self._long]) for share in _WARMS_IN]

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        # On another drive, which began before, it was as it is at first.
        since = np.maximum(np.nan_to_num(drive.time_s - self.constants["t_first"]), 0.0)
        channels[:, self._channel] -= values[0] * np.expm1(-since / values[1])


def _unit(channel: int) -> str:
    """Unit of a channel, which its name ends with."""
    return CHANNELS[channel].rsplit("_", 1)[-1].replace("Nm", "N m")


def bends_foretold(drive: Drive) -> bool:
    """Say whether slip, of second degree, and load, of fourth, foretell any course that bends with time."""
    known = np.isfinite(drive.time_s)
    time_s, slip, load_N = drive.time_s[known], drive.slip[known], drive.load_N[known]
    if not drive.has("time_s") or not np.ptp(time_s) > 0.0:
        return False
    along = 2.0 * (time_s - time_s.min()) / float(np.ptp(time_s)) - 1.0
    courses = np.polynomial.legendre.legvander(along, _ORDERS)[:, 1:]
    courses = courses - courses.mean(axis=0)
    slip, load_N = ((each - each.mean()) / max(float(each.std()), 1e-9) for each in (slip, load_N))
    terms = np.column_stack([slip**i * load_N**j for i in range(3) for j in range(5)])
    if len(terms) <= terms.shape[1]:
        return False
    told, _, rank, _ = np.linalg.lstsq(terms, courses, rcond=None)
    # Of few rows any terms foretell much.
    left = (courses - terms @ told).var(axis=0) * (len(terms) - 1) / max(len(terms) - rank, 1)
    return bool(np.mean(1.0 - left / courses.var(axis=0)) > _FORETOLD)


def slips_at_one_rate(drive: Drive) -> bool:
    """Say whether slip rises, or falls, at one rate while the clock runs on: late is only greater or less then."""
    together = drive.stretch[_CHORD:] == drive.stretch[:-_CHORD]
    change = (drive.slip[_CHORD:] - drive.slip[:-_CHORD])[together]
    return bool(change.any()) and float(change.mean() ** 2) > _ONE_RATE * float(np.mean(change**2))


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the faults that these data can show: no courses that bend where slip and load foretell them, and no delay of
    a slip that changes at one rate.
    """
    drive = situation.drive
    every = _faults(situation, bends=not bends_foretold(drive))
    if slips_at_one_rate(drive):
        every = tuple(effect for effect in every if effect.name != f"{TimeLag.slug}[{CHANNELS[SLIP]}]")
    return every


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the faults that a recording may have: there has to be a clock."""
    return _faults(situation, bends=True)


def _faults(situation: Situation, *, bends: bool) -> tuple[Effect, ...]:
    """Give the faults that there may be, of courses those that bend only if asked for: there has to be a clock."""
    drive = situation.drive
    if not drive.has("time_s"):
        return ()
    steps = np.diff(drive.time_s)[np.diff(drive.stretch) == 0]
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    answers = [channel for channel in (TORQUE, SINKAGE, PULL) if situation.seen(channel)]
    lags = [TimeLag(channel, step) for channel in [*answers, LOAD, SLIP]]
    drifts = [
        ChannelDrift(channel, float(situation.typical[channel]), orders, drive.time_s)
        for channel in answers
        for orders in ((1, _FEW_ORDERS) if bends else (1,))
    ]
    drifts += [WarmUp(channel, float(situation.typical[channel]), drive.time_s) for channel in answers if bends]
    drifts += [GainDrift(channel, drive.time_s, bends=bends) for channel in answers]
    low_passes = [LowPass(channel, step) for channel in answers]
    # Where no row follows from another nothing comes late.
    return (*lags, *low_passes, *drifts) if drive.timed else tuple(drifts)
