"""Sums over sites: outcomes, times, stops and bounds by planner, with 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from .driving import ARRIVED, IMMOBILISED, NO_ROUTE, OFF, ROUNDING, Ride
from .planners import SIGHT_M

RESAMPLES = 2000


@dataclass(frozen=True)
class Share:
    """A share [-] of `count` with its 95 % interval (Wilson 1927); NaN where there is nothing to count."""

    value: float
    low: float
    high: float
    count: int

    @staticmethod
    def of(hits: np.ndarray) -> Share:
        """Count the hits (n,) bool."""
        if not len(hits):
            return Share(np.nan, np.nan, np.nan, 0)
        found = binomtest(int(hits.sum()), len(hits)).proportion_ci(method="wilson")
        return Share(float(hits.mean()), float(found.low), float(found.high), len(hits))

    def __str__(self) -> str:
        return f"{100 * self.value:.1f} ({100 * self.low:.1f} to {100 * self.high:.1f})" if self.count else "none"


@dataclass(frozen=True)
class Score:
    """How one planner did.

    Parameters
    ----------
    name
        The planner.
    outcomes
        Share of the pairs by outcome.
    time_ratio
        Time over that of the planner that knows the truth, on pairs on which both arrived: sum over sum, with the 95 %
        interval of a bootstrap over sites; how many pairs.
    longer, unseen
        Shares of the emergency stops that took longer than was promised, where anything was, and than is seen.
    bounds
        Shares of the patches crossed on which acceleration, braking and side force are at least what was taken for
        granted.
    worst_site
        The least of `bounds` on any one site.
    """

    name: str
    outcomes: dict[str, Share]
    time_ratio: tuple[float, float, float, int]
    longer: Share
    unseen: Share
    bounds: tuple[Share, ...]
    worst_site: float


def score(name: str, rides: Sequence[Sequence[Ride]], truth: Sequence[Sequence[Ride]], seed: int = 0) -> Score:
    """Sum up the rides of a planner by site, beside those of the one that knows the truth."""
    every = [one for site in rides for one in site]
    outcome = np.array([one.outcome for one in every])
    stops = [stop for one in every for stop in one.stops]
    promised, achieved = np.array([(stop.promised, stop.achieved) for stop in stops]).reshape(-1, 2).T
    held = [np.concatenate([one.held for one in site]) for site in rides]
    return Score(
        name,
        {each: Share.of(outcome == each) for each in (ARRIVED, IMMOBILISED, OFF, NO_ROUTE)},
        _time_ratio(rides, truth, np.random.default_rng(seed)),
        Share.of((achieved > (1.0 + ROUNDING) * promised)[np.isfinite(promised)]),
        Share.of(achieved > (1.0 + ROUNDING) * SIGHT_M),
        tuple(Share.of(column) for column in np.concatenate(held).T),
        min((float(each.mean(axis=0).min()) for each in held if len(each)), default=np.nan),
    )


def _time_ratio(
    rides: Sequence[Sequence[Ride]], truth: Sequence[Sequence[Ride]], rng: np.random.Generator
) -> tuple[float, float, float, int]:
    pairs = [
        np.array([(one.time_s, best.time_s) for one, best in zip(*site, strict=True)])
        for site in zip(rides, truth, strict=True)
    ]
    both = [each[np.isfinite(each).all(axis=1)] for each in pairs]
    sums, count = np.array([each.sum(axis=0) for each in both]), sum(map(len, both))
    if not count:
        return np.nan, np.nan, np.nan, 0
    drawn = sums[rng.integers(len(sums), size=(RESAMPLES, len(sums)))].sum(axis=1)
    drawn = drawn[drawn[:, 1] > 0.0]
    low, high = np.quantile(drawn[:, 0] / drawn[:, 1], [0.025, 0.975])
    total = sums.sum(axis=0)
    return float(total[0] / total[1]), float(low), float(high), count


def table(scores: Sequence[Score]) -> str:
    """Lay the scores out as Markdown: shares in per cent, with 95 % intervals."""
    heads = (
        "planner", "arrived", "immobilised", "left the path", "no route", "time / truth's",
        "stops longer than promised", "than seen", "acceleration held", "braking held", "side force held",
        "worst site", "routes, stops, patches",
    )  # fmt: skip
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for one in scores:
        ratio, low, high, count = one.time_ratio
        cells = (
            one.name, *map(str, one.outcomes.values()),
            f"{ratio:.2f} ({low:.2f} to {high:.2f}), {count}" if count else "none", str(one.longer), str(one.unseen),
            *map(str, one.bounds), f"{100 * one.worst_site:.1f}",
            f"{one.outcomes[ARRIVED].count}, {one.longer.count}, {one.bounds[0].count}",
        )  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
