"""
Planning with and without a terrain database
============================================

Close the loop: learn several sites slowly, then drive them fast with the database, without it, and with the truth.

::

    python docs/gallery/closed_loop.py OUT.png --routes 200

Everything is simulated. On each site a rover creeps over some patches of each class of ground; `identify` gives their
soils, a classifier with errors the classes of the cells, and both go into a terrain database. Then planners that
believe different things about the same ground plan the same routes, which are driven on the true ground
(`proving_ground`). The table printed, and what was assumed, are explained on the page docs/planning.md.
"""

# sphinx_gallery_thumbnail_path = 'images/closed-loop.png'

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Rectangle
from proving_ground.driving import ARRIVED, IMMOBILISED, Held, Ride, held_by_patch, ride
from proving_ground.learn import learn
from proving_ground.planners import (
    SIGHT_M,
    Planner,
    Route,
    by_database,
    by_means,
    by_one_soil,
    by_truth,
    cell_speeds,
    cells_along,
    draw_pairs,
    plan,
)
from proving_ground.score import Score, calibration_table, score, table
from proving_ground.site import CELL_M, CELLS, CLASSES, Site, make_site

TRUTH, DATABASE, MEANS = "truth", "database", "database's means, no bounds"
FOUR, TWO = "database, 4 stretches a class", "database, 2 stretches a class"
ONE_SOIL, WITH_MARGIN = "one soil, no database", "one soil, 70 % of its forces"
DRAWN = {TRUTH: ("black", "-"), DATABASE: ("#1b6ca8", "-"), ONE_SOIL: ("#c4372e", "--")}
COLOURS = {"clay": "#b5754f", "gravel": "#9a9a9a", "loam": "#c9b27c", "mud": "#5f4b3c", "sand": "#efdf9f"}
CONFIDENCES = (0.6, 0.8, 0.9, 0.95)
TOP_M = 11.0
"""Longer stops are drawn here [m]."""


@dataclass(frozen=True)
class Driven:
    """One site, learnt on the patches `visited`, and driven.

    Routes and rides are by planner, one for each pair of start and goal; what of the database's bounds holds on the
    whole site is by confidence.
    """

    site: Site
    visited: np.ndarray
    planners: dict[str, Planner]
    routes: dict[str, list[Route | None]]
    rides: dict[str, list[Ride]]
    held: dict[float, Held]


def drive_site(seed: int, number: int, routes: int, stretches: int, folder: Path) -> Driven:
    """Make a site, learn it on so many stretches of each class, and drive so many routes with every planner."""
    began = time.monotonic()
    rng = np.random.default_rng([seed, number])
    site = make_site(rng)
    learnt = learn(site, rng, stretches)
    view = learnt.snapshot(folder)
    planners = [
        by_truth(TRUTH, site), by_database(DATABASE, view), by_database(FOUR, learnt.snapshot(folder, 4)),
        by_database(TWO, learnt.snapshot(folder, 2)), by_means(MEANS, view), by_one_soil(ONE_SOIL),
        by_one_soil(WITH_MARGIN, 0.7),
    ]  # fmt: skip
    pairs = draw_pairs(site, rng, routes, planners[1].ground.known)
    planned = {each.name: plan(each, pairs) for each in planners}
    # The alarms of a pair sound at the same draws for every planner.
    rides = {
        each.name: [
            ride(site, each, route, np.random.default_rng([seed, number, index]))
            for index, route in enumerate(planned[each.name])
        ]
        for each in planners
    }
    used = sum(one.estimate is not None for one in learnt.drive.soils)
    print(
        f"site {number}: {used} stretches identified on {len(learnt.visited)} patches, classes right on "
        f"{100 * learnt.right:.1f} % of the recognised cells, {time.monotonic() - began:.0f} s",
        file=sys.stderr,
    )
    everywhere = np.arange(CELLS**2)
    held = {level: held_by_patch(site, by_database("", view, level), everywhere) for level in CONFIDENCES}
    return Driven(site, learnt.visited, {each.name: each for each in planners}, planned, rides, held)


def main(
    out: Path, routes: int = 200, sites: int = 8, stretches: int = 8, seed: int = 1
) -> tuple[list[Score], str]:  # fmt: skip
    """Drive so many routes on so many sites, draw the picture, and give the scores by planner, and all as Markdown."""
    counts = [routes // sites + (number < routes % sites) for number in range(sites)]
    with TemporaryDirectory() as folder:
        driven = [drive_site(seed, number, count, stretches, Path(folder)) for number, count in enumerate(counts)]
    draw(driven, out)
    truth, visited = [each.rides[TRUTH] for each in driven], [each.visited for each in driven]
    scores = [score(name, [each.rides[name] for each in driven], truth, visited) for name in driven[0].planners]
    levels = [(level, [each.held[level] for each in driven]) for level in CONFIDENCES]
    return scores, table(scores) + "\n\n" + calibration_table(levels, visited)


def draw(driven: list[Driven], out: Path) -> None:
    """Draw an example, what the database allows there, and the stops of all sites."""
    figure, panels = plt.subplots(1, 3, figsize=(16.0, 5.8), layout="constrained")
    shown, pair = example(driven)
    site, edge = shown.site, CELLS * CELL_M
    box = {"origin": "lower", "extent": (0.0, edge, 0.0, edge), "interpolation": "nearest"}
    panels[0].imshow(
        site.cell_class.T, cmap=ListedColormap([COLOURS[name] for name in CLASSES]), vmin=-0.5, vmax=4.5, **box
    )
    axis = (np.arange(CELLS) + 0.5) * CELL_M
    panels[0].contourf(axis, axis, site.acceleration.T, levels=[-1e3, 0.0], colors="none", hatches=["xxx"])
    for name, (colour, line) in DRAWN.items():
        route, went = shown.routes[name][pair], shown.rides[name][pair]
        if route is None:
            continue
        label = f"{name}: {went.outcome}" + (f", {went.time_s:.1f} s" if went.outcome == ARRIVED else "")
        panels[0].plot(*route.path.T, color="white", lw=3.5)
        panels[0].plot(*route.path.T, color=colour, ls=line, lw=1.8, label=label)
        if went.outcome == IMMOBILISED:
            at = np.flatnonzero(site.acceleration.ravel()[cells_along(route.path)] < 0.0)[0]
            panels[0].plot(*route.path[at], "X", color=colour, ms=11, mec="white")
    patches = [Rectangle((0, 0), 1, 1, color=COLOURS[name]) for name in CLASSES]
    stuck = Rectangle((0, 0), 1, 1, fill=False, hatch="xxx")
    below = {"fontsize": 8, "frameon": False, "borderaxespad": 0.0}
    first = panels[0].legend(loc="upper left", bbox_to_anchor=(-0.05, -0.12), **below)
    panels[0].add_artist(first)
    kinds = [*CLASSES, "immobilised"]
    panels[0].legend([*patches, stuck], kinds, loc="upper right", bbox_to_anchor=(1.05, -0.12), ncols=2, **below)
    panels[0].set(title="True ground, and the routes of one pair", xlabel="x [m]", ylabel="y [m]")
    speed = cell_speeds(shown.planners[DATABASE].ground).reshape(CELLS, CELLS)
    image = panels[1].imshow(np.where(speed > 0.0, speed, np.nan).T, cmap="viridis", vmin=0.0, **box)
    panels[1].set(title="Speed that the database allows (white: none; dark: unknown)", xlabel="x [m]")
    figure.colorbar(image, ax=panels[1], label="[m/s]", shrink=0.8)
    for name, colour in ((ONE_SOIL, "#c4372e"), (MEANS, "#e0a030"), (DATABASE, "#1b6ca8")):
        stops = [stop for each in driven for went in each.rides[name] for stop in went.stops]
        predicted, achieved = (np.array([getattr(stop, key) for stop in stops]) for key in ("predicted", "achieved"))
        late = 100.0 * np.mean(achieved > predicted) if len(stops) else np.nan
        label = f"{name}: {late:.0f} % of {len(stops)} longer than predicted"
        panels[2].plot(predicted, np.minimum(achieved, TOP_M), ".", ms=4, alpha=0.6, color=colour, label=label)
    panels[2].plot([0.0, TOP_M], [0.0, TOP_M], color="0.4", lw=1)
    panels[2].axhline(SIGHT_M, color="0.4", lw=1, ls=":")
    panels[2].set(title="Emergency stops (at 11 m: longer, or off the path)", xlabel="stopping distance predicted [m]",
                  ylabel="achieved [m]", xlim=(0.0, 8.0), ylim=(0.0, 13.5))  # fmt: skip
    panels[2].legend(loc="upper left", fontsize=8)
    panels[2].spines[["top", "right"]].set_visible(False)
    figure.savefig(out, dpi=90, bbox_inches="tight")
    plt.close(figure)


def example(driven: list[Driven]) -> tuple[Driven, int]:
    """Find the first pair on which truth and database arrive and the one soil is immobilised; else the very first."""
    for each in driven:
        for pair in range(len(each.rides[TRUTH])):
            if [each.rides[name][pair].outcome for name in DRAWN] == [ARRIVED, ARRIVED, IMMOBILISED]:
                return each, pair
    return driven[0], 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[1])
    parser.add_argument("out", type=Path, help="PNG file to write")
    parser.add_argument("--routes", type=int, default=200, help="pairs of start and goal, over all sites")
    parser.add_argument("--sites", type=int, default=8)
    parser.add_argument("--stretches", type=int, default=8, help="slow stretches on each class of ground")
    parser.add_argument("--seed", type=int, default=1)
    print(main(**vars(parser.parse_args()))[1])
