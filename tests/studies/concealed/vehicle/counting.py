"""Information in a drive over several grounds: the textbook's wheel refitted to each ground, on its own.

Soil and variation of each ground are its own, so that a drive is weighed as so many recordings (`weighing`), and the
nats that the textbook loses add up. Rows near a border count for nothing: nobody knows to the metre where ground
changes. Of many rows every q-th is taken, as the mean of q rows would be: of so few rows that bumps of the soil could
stand for what changes quickly, the nats are less than they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..mechanics import Body, Channels, Ground, simulate
from ..sensors import Sensors, Variation
from ..strength import LEAST_R2
from ..weighing import Case, Refit, Weights, refit_textbook, soil_slopes, still, vector, weights
from .confined import Confined, VehicleDrive, rows_of
from .grounds import Stretches
from .journey import Journey

BORDER_M = 0.5
"""Rows nearer than that to another ground do not count [m]."""

MOST_ROWS, FEW_ROWS = 6000, 900
"""Rows that are counted, about; and rows on which strengths are looked for, before they are counted."""

MOST_SINKAGE = 0.5
"""In radii [-]: a wheel that sinks deeper is not driven on."""


@dataclass(frozen=True)
class Counted:
    """A drive for the counting of its nats.

    Parameters
    ----------
    body, drive, ground
        Wheels, what they do in all rows, and the soil's mean by row.
    textbook, theta_1
        What the textbook's wheel answers in all rows, and its entry angles.
    cases
        The grounds, each with the rows that count.
    rows
        Their numbers.
    thinning
        How many rows each of them stands for.
    """

    body: Body
    drive: VehicleDrive
    ground: Ground
    textbook: Channels
    theta_1: np.ndarray
    cases: tuple[Case, ...]
    rows: tuple[np.ndarray, ...]
    thinning: int

    @property
    def start(self) -> np.ndarray:
        """Give the soils as logarithms, (g, 5)."""
        return np.array([vector(case.ground) for case in self.cases])

    def reported(self, changes: Sequence[Confined]) -> tuple[Channels, np.ndarray] | None:
        """Give what ideal sensors report in all rows, and the entry angles; None where the wheel sinks in."""
        if any(change.moves_wheel for change in changes):
            channels, theta_1 = simulate(self.ground, self.body, self.drive, changes, guess=self.theta_1)
        else:
            channels, theta_1 = self.textbook, self.theta_1
            for change in changes:
                channels = change.forces(channels, self.drive, self.ground, self.body)
            for change in changes:
                channels = change.reported(channels, self.drive)
        sunk = self.body.radius_m * (1.0 - np.cos(theta_1))
        passable = still(replace(channels, sinkage_m=sunk), theta_1) and sunk.max() < MOST_SINKAGE * self.body.radius_m
        return (channels, theta_1) if passable else None

    def seen(self, changes: Sequence[Confined]) -> list[tuple[Channels, np.ndarray]] | None:
        """Give the same of the rows that count, by ground."""
        if any(change.remembers for change in changes) or not any(change.moves_wheel for change in changes):
            whole = self.reported(changes)
            return None if whole is None else [(rows_of(whole[0], rows), whole[1][rows]) for rows in self.rows]
        chosen = np.concatenate(self.rows)
        few = replace(
            self, drive=self.drive.rows(chosen), ground=_rows_of_ground(self.ground, chosen),
            textbook=rows_of(self.textbook, chosen), theta_1=self.theta_1[chosen],
        )  # fmt: skip
        whole = few.reported(changes)
        if whole is None:
            return None
        parts = np.split(np.arange(len(chosen)), np.cumsum([len(rows) for rows in self.rows])[:-1])
        return [(rows_of(whole[0], part), whole[1][part]) for part in parts]

    def refit(self, changes: Sequence[Confined], start: np.ndarray) -> Refit | None:
        """Refit the textbook's soils, (g, 5) logarithms, to a drive with these changes; None where a wheel sinks in."""
        seen = self.seen(changes)
        if seen is None:
            return None
        fits, weighed = [], []
        for case, (observed, theta_1), soil in zip(self.cases, seen, start, strict=True):
            weighed.append(weights(case, list(changes), observed, theta_1))
            fits.append(refit_textbook(case, observed, weighed[-1], soil))
        data = [case.answers(observed) for case, (observed, _) in zip(self.cases, seen, strict=True)]
        return Refit(
            np.array([fit.parameters for fit in fits]), sum(fit.nats for fit in fits),
            np.concatenate([fit.answers for fit in fits]), self._r2([fit.answers for fit in fits], data, weighed),
        )  # fmt: skip

    def _r2(self, answers: Sequence[np.ndarray], data: Sequence[np.ndarray], weighed: Sequence[Weights]) -> np.ndarray:
        """R2 that all noisy rows would show, (c,)."""
        independent = np.concatenate([each.scale**-2 for each in weighed])
        noise = np.mean(np.concatenate([each.variance for each in weighed]) + (self.thinning - 1) * independent, axis=0)
        values = np.concatenate(list(data))
        lost = np.mean((np.concatenate(list(answers)) - values) ** 2, axis=0) + noise
        return 1.0 - lost / (np.var(values, axis=0) + noise)

    def shares(self, pair: Sequence[Confined]) -> list[float]:
        """Of two effects: what each still explains once the other one's magnitude is refitted with the soils.

        In proportion to what it explains alone, both to first order; zeros where the pair sinks in or stands for a
        soil that the textbook does not fit.
        """
        both = self.refit(pair, self.start)
        alone = [self.seen([each]) for each in pair]
        if both is None or np.any(both.r2 < LEAST_R2) or any(each is None for each in alone):
            return [0.0, 0.0]
        marks: list[list[np.ndarray]] = [[], []]
        for index, case in enumerate(self.cases):
            rows = self.rows[index]
            theta_1 = self.theta_1[rows]
            weight = weights(case, (), rows_of(self.textbook, rows), theta_1)
            basis, _ = np.linalg.qr(weight.whiten(soil_slopes(case, case.drive, vector(case.ground), theta_1)))
            for own, seen in zip(marks, alone, strict=True):
                assert seen is not None
                observed = seen[index][0]
                inputs = replace(case.drive, load_N=observed.load_N, slip=observed.slip)
                expected, _ = simulate(case.ground, case.body, inputs, guess=theta_1)
                mark = weight.whiten(case.answers(observed) - case.answers(expected))
                own.append(mark - basis @ (basis.T @ mark))
        one, other = (np.concatenate(own) for own in marks)
        alike = float(one @ other) ** 2 / max(float(one @ one) * float(other @ other), 1e-300)
        return [1.0 - alike] * 2


def count(
    body: Body, journey: Journey, stretches: Stretches, sensors: Sensors, variations: Sequence[Variation],
    textbook: Channels, theta_1: np.ndarray, most_rows: int = MOST_ROWS,
) -> Counted:  # fmt: skip
    """Prepare the counting.

    Parameters
    ----------
    body, journey, stretches
        Wheels, what they do, and the grounds.
    sensors
        Sensors of all wheels.
    variations
        Of each ground along its rows.
    textbook, theta_1
        What the textbook's wheel answers, and its entry angles.
    most_rows
        Rows that are counted, about.
    """
    drive = journey.drive
    thinning = max(1, round(len(drive) / most_rows))
    # Autocorrelated noise does not average out as white noise does.
    longer = np.sqrt((1.0 + sensors.correlation) / (1.0 - sensors.correlation))
    fewer = sensors.louder(thinning**-0.5)
    fewer = replace(fewer, noise={name: sd * longer for name, sd in fewer.noise.items()}, correlation=0.0)
    apart = np.min(np.abs(drive.x_m[:, None] - journey.borders_m[None, 1:-1]), axis=1)
    cases, counted = [], []
    for number, (soil, variation) in enumerate(zip(stretches.soils, variations, strict=True)):
        there = np.flatnonzero(drive.ground == number)
        chosen = np.arange(thinning // 2, len(there), thinning)
        chosen = chosen[apart[there[chosen]] > BORDER_M]
        rows = there[chosen]
        bumps = replace(variation, bumps=variation.bumps[chosen])
        pulls = "drawbar_pull_N" in journey.columns
        cases.append(Case(body, soil, drive.rows(rows), fewer, bumps, pulls, {}))
        counted.append(rows)
    ground = stretches.by_row(drive.ground)
    return Counted(body, drive, ground, textbook, theta_1, tuple(cases), tuple(counted), thinning)


def _rows_of_ground(ground: Ground, rows: np.ndarray) -> Ground:
    return Ground(*(np.asarray(value)[rows] for value in vars(ground).values()))
