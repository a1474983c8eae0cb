"""Rows that a recording holds twice, which would look like repeats without noise."""

from __future__ import annotations

import numpy as np

from ...framework.core.findings import Finding, note
from ...framework.core.recording.types import WHEEL_COLUMNS, WheelTable
from ..mechanics.textbook import ANSWERS

_BY_CHANCE = 0.25
"""Pairs of rows that miss each other by the last digit of one channel, as a share of those that are equal, from which
on coarse readings may be equal by chance [-]. Of a reading that is equal in a share p of its repeats at least
(1 - p) / p as many miss by one step: 0.25 where four of five are equal. Readings still coarser round all repeats to the
same number, and carry no more information than one of them."""

_MOST_NAMED = 4
"""Runs or times of rows left out that a finding names; the others are counted."""


def without_duplicates(table: WheelTable) -> tuple[WheelTable, Finding | None]:
    """Leave out all but the first of rows that are equal in every channel, the time among them.

    Runs and wheels of different names may hold duplicates of one another. Rows stay where coarse readings make them
    equal by chance: more of them are then nearly equal.

    Parameters
    ----------
    table
        Channels as recorded.

    Returns
    -------
    WheelTable
        The other rows.
    Finding or None
        ``duplicate_rows``, where rows are left out.
    """
    answered = [np.isfinite(table[name]) for name in ANSWERS if name in table]
    if not answered:
        return table, None
    rows = np.flatnonzero(np.any(answered, axis=0))
    names = [name for name in WHEEL_COLUMNS if name in table]
    # Rows are compared by 64-bit sums, which are equal by chance once in 2^64.
    parts = [_parts(table[name][rows], seed) for seed, name in enumerate(names)]
    whole = np.sum(parts, axis=0, dtype=np.uint64)
    _, first, which, counts = np.unique(whole, return_index=True, return_inverse=True, return_counts=True)
    duplicates = rows[first[which] != np.arange(len(rows))]
    if not len(duplicates):
        return table, None
    near = sum(
        _one_step_apart(table[name][rows[first]], (whole - part)[first], counts)
        for name, part in zip(names, parts, strict=True)
        if name != "time_s"
    )
    if near > _BY_CHANCE * float((counts * (counts - 1)).sum()) / 2.0:
        return table, None
    kept = np.ones(len(table), dtype=bool)
    kept[duplicates] = False
    labels = list(dict.fromkeys(_label(table, row) for row in duplicates.tolist()))
    found = note("duplicate_rows", n=len(duplicates), rows=labels[:_MOST_NAMED], more=max(len(labels) - _MOST_NAMED, 0))
    return table.select(kept), found


def _parts(values: np.ndarray, seed: int) -> np.ndarray:
    """Give each of a channel's values (n,) a number of its own at random, (n,), not observed ones, too."""
    different, which = np.unique(values, return_inverse=True)
    return np.random.default_rng(seed).integers(0, 2**64, len(different), dtype=np.uint64)[which.ravel()]


def _one_step_apart(values: np.ndarray, others: np.ndarray, counts: np.ndarray) -> float:
    """Count the pairs of rows that are equal in all other channels, whose sums are `others` (m,), and one step apart in
    a channel's values (m,).

    Each of the m stands for as many rows as it counts (m,); a step is the least by which values differ at all.
    """
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    if not len(steps):
        return 0.0
    order = np.lexsort((values, others))
    apart = np.diff(values[order])
    together = (others[order][1:] == others[order][:-1]) & (apart < 1.5 * steps.min())
    return float((counts[order][:-1] * counts[order][1:])[together].sum())


def _label(table: WheelTable, row: int) -> str:
    """Name a row by its run and time [s], as far as it has them."""
    run = [] if table.run is None else [f"run {table.run[row]}"]
    time_s = [f"{table['time_s'][row]:.6g} s"] if "time_s" in table else []
    return " at ".join(run + time_s)
