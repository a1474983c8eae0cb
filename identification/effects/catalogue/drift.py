"""A channel drifts with time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...mechanics.textbook import CHANNELS
from ..effect import PULL, SINKAGE, TORQUE, Drive, Effect, Parameter, Situation
from ..registry import register
from ..sensors import SYMBOLS

_FEW_ORDERS, _ORDERS, _GAIN_ORDERS = 3, 6, 3
"""Polynomials of a curved drift at first and at most, and of one of a gain: more than are needed err at the drive's
ends, which nothing else determines."""

_BENT = {_FEW_ORDERS: ", bent", _ORDERS: ", curved"}
"""End of the form's name by the number of polynomials."""

_MOST_GAIN = 0.15
"""Bound of each polynomial of a gain: the gain changes by 30 % at most [-]."""

_SHORTEST_WARM, _WARM_STARTS = 0.1, (0.12, 0.35)
"""Lower bound of the time constant of warming, and the values from which fits start, as shares of the drive [-]: faster
ones look like an offset, and slower ones like a straight line."""

_PREDICTED = 0.87
"""Share of the variance of a curved drift that slip and load predict, above which no data separate it from a missing
dependence on slip and load [-]. Simulated drives with one ramp of slip at each of three to five loads have 0.96 and
more, bench tests 0.73 at most, field drives 0.85."""

_PRIOR = "engineering judgement: sensors drift by a tenth of the usual reading, less the more the drift is curved"


@register
class ChannelDrift(Effect):
    """A channel drifts smoothly with time, from zero at the drive's beginning."""

    slug = "drift"
    title = "drift"
    what_happens = "a channel drifts with time"
    check = "read the channel with the wheel lifted and at rest before, during and after the drive"
    kind = "instrument"
    of_one_drive = True
    needs = ("time_s",)
    source = "A.-M. Legendre (1785): polynomials orthogonal over the drive"

    def __init__(self, channel: int, usual: float, orders: int, time_s: np.ndarray) -> None:
        self._channel, self._made_of = channel, (channel, usual, orders, time_s)
        name, unit = CHANNELS[channel], SYMBOLS[channel][1]
        self.form = name + ("" if orders == 1 else _BENT.get(orders, f", bent {orders - 1} times"))
        self.equation = f"{name} reported = {name} + {_sum('d', orders)}"
        self.changes = (channel,)
        self.constants = {"t_first": float(np.nanmin(time_s)), "t_last": float(np.nanmax(time_s))}
        self.parameters = tuple(
            Parameter(f"d{order}", unit, -2.0 * usual, 2.0 * usual, 0.0, 0.1 * usual / order, _PRIOR)
            for order in range(1, orders + 1)
        )

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the drifts of each channel; none that is curved where slip and load predict it."""
        return _forms(situation, curved=not curves_predicted(situation.drive))

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give all drifts of each channel."""
        return _forms(situation, curved=True)

    def extensions(self) -> list[Effect]:
        channel, usual, orders, time_s = self._made_of
        if orders != _FEW_ORDERS:
            return []
        return [ChannelDrift(channel, usual, more, time_s) for more in range(_FEW_ORDERS + 1, _ORDERS + 1)]

    def course(self, drive: Drive, values: np.ndarray) -> np.ndarray:
        """Give the polynomials' sum (n,), zero at the drive's beginning."""
        first, last = self.constants["t_first"], self.constants["t_last"]
        along = np.nan_to_num(2.0 * (drive.time_s - first) / (last - first) - 1.0)
        series = np.concatenate([[0.0], values])
        return np.polynomial.legendre.legval(along, series) - np.polynomial.legendre.legval(-1.0, series)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, self._channel] += self.course(drive, values)


class GainDrift(ChannelDrift):
    """The gain of a channel drifts with time, as of a motor or an amplifier that warms."""

    source = "definition; polynomials of A.-M. Legendre (1785), from the drive's beginning to its end"

    def __init__(self, channel: int, time_s: np.ndarray, orders: int = 1, *, bends: bool = False) -> None:
        super().__init__(channel, 1.0, orders, time_s)
        name = CHANNELS[channel]
        self.form = f"{name}, gain" + ", curved" * (orders > 1)
        self.equation = f"{name} reported = {name} [1 + {_sum('g', orders)}]"
        source = "engineering judgement: gains drift by 10 %, less the more the drift is curved"
        self.parameters = tuple(
            Parameter(f"g{order}", "", -_MOST_GAIN, _MOST_GAIN, 0.0, 0.1 / order, source)
            for order in range(1, orders + 1)
        )
        self._further: list[Effect] = [GainDrift(channel, time_s, _GAIN_ORDERS)] if bends else []

    def extensions(self) -> list[Effect]:
        return list(self._further)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, self._channel] *= 1.0 + self.course(drive, values)


class WarmUp(ChannelDrift):
    """A channel drifts from the drive's beginning to where it settles, as of a sensor or an amplifier that warms."""

    required = ("d", "tau")
    source = "I. Newton, Phil. Trans. R. Soc. 22 (1701), 824: warming at a rate in proportion to what is left of it"

    def __init__(self, channel: int, usual: float, time_s: np.ndarray) -> None:
        name, unit = CHANNELS[channel], SYMBOLS[channel][1]
        self._channel, self.changes = channel, (channel,)
        self.form = f"{name}, warming"
        self.equation = f"{name} reported = {name} + d (1 - exp(-max(t - t_first, 0) / tau))"
        self.constants = {"t_first": float(np.nanmin(time_s))}
        self._long = long = float(np.nanmax(time_s)) - self.constants["t_first"]
        source = "engineering judgement: it settles within the drive"
        self.parameters = (
            Parameter("d", unit, -2.0 * usual, 2.0 * usual, 0.0, 0.1 * usual, _PRIOR),
            Parameter("tau", "s", _SHORTEST_WARM * long, long, 0.2 * long, long, source, null=0.2 * long),
        )

    def extensions(self) -> list[Effect]:
        return []

    def starts(self) -> list[np.ndarray]:
        return [np.array([0.0, share * self._long]) for share in _WARM_STARTS]

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        # A drive that began earlier found it as cold as it was at first.
        since = np.maximum(np.nan_to_num(drive.time_s - self.constants["t_first"]), 0.0)
        channels[:, self._channel] -= values[0] * np.expm1(-since / values[1])


def _sum(symbol: str, orders: int) -> str:
    """Give the sum of polynomials of an equation."""
    return " + ".join(f"{symbol}{order} (P{order}(t) - P{order}(0))" for order in range(1, orders + 1))


def _forms(situation: Situation, *, curved: bool) -> Sequence[Effect]:
    """Give the drifts of each channel that was measured, where there is a clock."""
    time_s = situation.drive.time_s
    if not situation.drive.has("time_s"):
        return ()
    answers = [channel for channel in (TORQUE, SINKAGE, PULL) if situation.measures(channel)]
    usual = {channel: float(situation.typical[channel]) for channel in answers}
    orders = (1, _FEW_ORDERS) if curved else (1,)
    return [
        *(ChannelDrift(channel, usual[channel], order, time_s) for channel in answers for order in orders),
        *(WarmUp(channel, usual[channel], time_s) for channel in answers if curved),
        *(GainDrift(channel, time_s, bends=curved) for channel in answers),
    ]


def curves_predicted(drive: Drive) -> bool:
    """Say whether slip (of second degree) and load (of fourth) predict any curved drift."""
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
    coefficients, _, rank, _ = np.linalg.lstsq(terms, courses, rcond=None)
    # Few rows are predicted well by any terms: variance by the degrees of freedom.
    left = (courses - terms @ coefficients).var(axis=0) * (len(terms) - 1) / max(len(terms) - rank, 1)
    return bool(np.mean(1.0 - left / courses.var(axis=0)) > _PREDICTED)
