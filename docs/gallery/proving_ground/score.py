"""Sums over sites: outcomes, times, stops and bounds by planner, with 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from .driving import ARRIVED, IMMOBILISED, NO_ROUTE, OFF, ROUNDING, Held, Ride
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
        Shares of the emergency stops that took longer than was predicted, where anything was, and than is seen.
    bounds
        Shares of the patches crossed on which acceleration, braking and side force are at least what was taken for
        granted.
    fresh
        Share of the patches crossed, without those measured at low speed, on which all three are.
    worst_site
        The least of `bounds` on any one site.
    """

    name: str
    outcomes: dict[str, Share]
    time_ratio: tuple[float, float, float, int]
    longer: Share
    unseen: Share
    bounds: tuple[Share, ...]
    fresh: Share
    worst_site: float


def score(
    name: str, rides: Sequence[Sequence[Ride]], truth: Sequence[Sequence[Ride]], visited: Sequence[np.ndarray],
    seed: int = 0,
) -> Score:  # fmt: skip
    """Sum up the rides of a planner by site, beside those of the one that knows the truth.

    Parameters
    ----------
    name
        The planner.
    rides, truth
        By site and pair.
    visited
        By site, the numbers of the patches on which the rover crept.
    seed
        Of the bootstrap.
    """
    every = [one for site in rides for one in site]
    outcome = np.array([one.outcome for one in every])
    stops = [stop for one in every for stop in one.stops]
    predicted, achieved = np.array([(stop.predicted, stop.achieved) for stop in stops]).reshape(-1, 2).T
    held = [_joined([one.held for one in site]) for site in rides]
    return Score(
        name,
        {each: Share.of(outcome == each) for each in (ARRIVED, IMMOBILISED, OFF, NO_ROUTE)},
        _time_ratio(rides, truth, np.random.default_rng(seed)),
        Share.of((achieved > (1.0 + ROUNDING) * predicted)[np.isfinite(predicted)]),
        Share.of(achieved > (1.0 + ROUNDING) * SIGHT_M),
        tuple(Share.of(column) for column in np.concatenate([each.bounds for each in held]).T),
        fresh_share(held, visited),
        min((float(each.bounds.mean(axis=0).min()) for each in held if len(each.bounds)), default=np.nan),
    )


def fresh_share(held: Sequence[Held], visited: Sequence[np.ndarray]) -> Share:
    """Share of all sites' patches, without those measured at low speed, on which all three bounds hold."""
    fresh = [each.bounds[~np.isin(each.patch, there)] for each, there in zip(held, visited, strict=True)]
    return Share.of(np.concatenate(fresh).all(axis=1))


def _joined(parts: Sequence[Held]) -> Held:
    return Held(np.concatenate([each.patch for each in parts]), np.concatenate([each.bounds for each in parts]))


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
    """Lay the scores out as two Markdown tables: shares in per cent, with 95 % intervals."""
    routes = [("planner", "routes", ARRIVED, IMMOBILISED, OFF, NO_ROUTE, "time over the truth's, routes")]
    bounds = [
        (
            "planner", "stops", "longer than predicted", "longer than seen", "patches", "acceleration held",
            "braking held", "side force held", "all three, unmeasured patches", "least on a site",
        )
    ]  # fmt: skip
    for one in scores:
        ratio, low, high, count = one.time_ratio
        time = f"{ratio:.2f} ({low:.2f} to {high:.2f}), {count}" if count else "none"
        total = one.outcomes[ARRIVED].count
        routes.append((one.name, str(total), *map(str, one.outcomes.values()), time))
        bounds.append(
            (
                one.name, str(one.unseen.count), str(one.longer), str(one.unseen), str(one.bounds[0].count),
                *map(str, one.bounds), str(one.fresh), f"{100.0 * one.worst_site:.1f}",
            )
        )  # fmt: skip
    return "\n\n".join("\n".join(_lines(rows)) for rows in (routes, bounds))


def calibration_table(found: Sequence[tuple[float, Sequence[Held]]], visited: Sequence[np.ndarray]) -> str:
    """Lay out as Markdown how many bounds hold, by the confidence asked: one cell of each patch of all sites."""
    rows = [("confidence [%]", "patches", "acceleration held", "braking held", "side force held",
             "all three, unmeasured patches")]  # fmt: skip
    for confidence, held in found:
        bounds = _joined(held).bounds
        shares = (*(Share.of(column) for column in bounds.T), fresh_share(held, visited))
        rows.append((f"{100.0 * confidence:g}", str(len(bounds)), *map(str, shares)))
    return "\n".join(_lines(rows))


def _lines(rows: Sequence[tuple[str, ...]]) -> list[str]:
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return [lines[0], "|---" * len(rows[0]) + "|", *lines[1:]]
