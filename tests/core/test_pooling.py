"""Cells of the ground, their keys, and the pool of class probabilities."""

import numpy as np
import pytest
from bevameter.framework.core.pooling import (
    cell_keys,
    cells_from_keys,
    cells_of,
    centred_logs,
    pooled,
    rows_of_keys,
    sums_by,
)
from hypothesis import given
from hypothesis import strategies as st

whole = st.integers(-(2**31) + 1, 2**31 - 1)


@given(st.lists(st.tuples(whole, whole), min_size=1))
def test_a_key_is_of_one_cell_and_sorts_by_x_and_then_y(pairs):
    cells = np.array(pairs, dtype=np.int64)
    keys = cell_keys(cells)
    assert cells_from_keys(keys).tolist() == cells.tolist()
    assert len(set(keys.tolist())) == len(set(pairs))
    assert cells[np.argsort(keys, kind="stable")].tolist() == sorted(cells.tolist())


def test_cells_cover_from_their_lower_edge():
    cells = cells_of(np.array([0.0, 0.49, 0.5, -0.01]), np.array([0.0, 0.0, 0.0, -0.5]), 0.5)
    assert cells.tolist() == [[0, 0], [0, 0], [1, 0], [-1, -1]]
    with pytest.raises(ValueError, match="not finite"):
        cells_of(np.array([np.nan]), np.array([0.0]), 0.5)
    with pytest.raises(ValueError, match="too far"):
        cells_of(np.array([1e12]), np.array([0.0]), 0.1)


def test_rows_of_keys_are_those_of_the_cells_that_are_there():
    keys = cell_keys(np.array([[-1, 5], [0, 0], [3, -2]]))
    assert rows_of_keys(keys, cell_keys(np.array([[3, -2], [0, 1], [-1, 5]]))).tolist() == [2, -1, 0]
    assert rows_of_keys(keys[:0], keys).tolist() == [-1, -1, -1]


def test_independent_opinions_pool_as_bayes_rule_does():
    logs = centred_logs(np.array([[0.3, 0.7], [0.2, 0.8], [0.5, 0.5]]))
    both = pooled(sums_by(np.array([0, 0, 2]), logs, 3))
    expected = np.array([0.3 * 0.2, 0.7 * 0.8])
    np.testing.assert_allclose(both, [expected / expected.sum(), [0.5, 0.5], [0.5, 0.5]])


def test_no_classes_pool_to_no_probabilities():
    assert pooled(sums_by(np.array([0, 1]), centred_logs(np.zeros((2, 0))), 2)).shape == (2, 0)
