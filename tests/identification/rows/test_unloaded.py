"""Rows of a wheel in the air, whose load cell reads the noise of its zero."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter import Vehicle, Wheel, WheelTable
from bevameter.identification.explain.samples import gather
from bevameter.identification.rows.unloaded import carries_nothing

ONE = np.zeros(600, dtype=int)


def lifted(rng, load_N: float, rows: int) -> tuple[np.ndarray, slice]:
    """Load of a drive [N], whose cell is noisy by 1 N, and where the wheel is in the air."""
    load, there = load_N + rng.normal(size=600), slice(200, 200 + rows)
    load[there] -= load_N
    return load, there


@pytest.mark.parametrize("load_N", [8.0, 60.0])
@pytest.mark.parametrize(("rows", "share"), [(20, 0.9), (60, 0.97)])
def test_a_wheel_in_the_air_carries_nothing(rng, load_N, rows, share):
    found = []
    for _ in range(50):
        load, there = lifted(rng, load_N, rows)
        nothing = carries_nothing(load, ONE)
        found.append(nothing[there].mean())
        assert not nothing[: there.start].any()
        assert not nothing[there.stop :].any()
    assert np.mean(found) > share


@pytest.mark.parametrize(("noises", "most"), [(2.0, 30), (3.0, 0), (10.0, 0)])
def test_a_wheel_that_carries_little_loses_no_row_above_zero(rng, noises, most):
    """Of 30,000; a load of two noises is below zero in one row of 44."""
    lost = sum(int((carries_nothing(load, ONE) & (load > 0.0)).sum()) for load in noises + rng.normal(size=(50, 600)))
    assert lost <= most


def test_a_stretch_ends_where_its_rows_do(rng):
    """The next stretch begins with a load as small as the noise."""
    load = np.concatenate([-np.abs(rng.normal(size=20)), np.full(40, 0.5)])
    assert carries_nothing(load, np.repeat([0, 1], [20, 40])).sum() == 20


def test_exact_zeros_and_gross_errors_do_not_affect_their_neighbours():
    load = np.full(100, 60.0)
    load[40:60] = 0.0
    load[50] = 5.0
    load[70] = -500.0
    nothing = carries_nothing(load, np.zeros(100))
    np.testing.assert_array_equal(np.flatnonzero(nothing), [*range(40, 50), *range(51, 60), 70])


def test_trials_are_judged_each_by_itself(rng):
    load = rng.normal(size=40)
    np.testing.assert_array_equal(carries_nothing(load, np.arange(40)), load <= 0.0)


def test_a_note_counts_them(rng):
    load, _ = lifted(rng, 60.0, 60)
    columns = {
        "time_s": 0.1 * np.arange(600), "load_N": load, "slip": 0.2 + 0.01 * rng.normal(size=600),
        "sinkage_m": 0.01 + 1e-4 * rng.normal(size=600),
    }  # fmt: skip
    wheel = Wheel(radius_m=0.15, width_m=0.12)
    samples = gather(WheelTable(columns, None, None, Path("drive.csv")), wheel, Vehicle(wheels=(wheel,)))
    below = int((load <= 0.0).sum())
    above = int(carries_nothing(load, ONE).sum()) - below
    assert above > 20
    assert f"{below} rows whose wheel carries nothing are left out" in samples.notes
    assert f"{above} rows among them whose load is the noise of a zero are left out" in samples.notes
    assert len(samples) == 600 - below - above
