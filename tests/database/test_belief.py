import numpy as np
import pytest
from bevameter.database.belief import combine
from bevameter.framework.core.pooling import PROBABILITY_FLOOR, cells_from_keys

CLASSES = ("clay", "sand")


def test_a_single_look_keeps_its_probabilities(make):
    cells = combine([make.drive(terrain=make.seen([(0, 0)], [[0.3, 0.7]], quality=[0.2]))], CLASSES, 0.5)
    np.testing.assert_allclose(cells.probability, [[0.3, 0.7]])


def test_independent_drives_multiply(make):
    one, two = (make.drive(name, make.seen([(0, 0)], [[0.3, 0.7]])) for name in "ab")
    cells = combine([one, two], CLASSES, 0.5)
    assert cells.probability[0, 1] == pytest.approx(0.49 / (0.49 + 0.09))
    assert cells.looks.tolist() == [2]


def test_a_poor_further_look_adds_little(make):
    good = make.drive("a", make.seen([(0, 0)], [[0.1, 0.9]]))
    poor = make.drive("b", make.seen([(0, 0)], [[0.9, 0.1]], quality=[0.1]))
    cells = combine([poor, good], CLASSES, 0.5)
    assert 0.85 < cells.probability[0, 1] < 0.9


def test_looks_of_one_drive_count_once(make):
    twice = make.drive("a", make.seen([(0, 0), (0, 0)], [[0.3, 0.7], [0.3, 0.7]]))
    cells = combine([twice], CLASSES, 0.5)
    np.testing.assert_allclose(cells.probability, [[0.3, 0.7]])
    assert cells.looks.tolist() == [1]


def test_no_look_rules_a_class_out(make):
    sure = [make.drive("a", make.seen([(0, 0)], [[1.0, 0.0]])), make.drive("b", make.seen([(0, 0)], [[0.0, 1.0]]))]
    np.testing.assert_allclose(combine(sure, CLASSES, 0.5).probability, [[0.5, 0.5]])
    other = make.drive("c", make.seen([(0, 0)], [[1.0]], classes=("sand",)))  # its model knows no clay
    assert combine([other], CLASSES, 0.5).probability[0, 0] == pytest.approx(PROBABILITY_FLOOR, rel=0.01)


def test_only_fused_looks_count(make):
    camera = make.drive(terrain=make.seen([(0, 0)], [[0.3, 0.7]], sense="camera"))
    assert len(combine([camera], CLASSES, 0.5).key) == 0


def test_a_cell_that_nobody_recognised_says_why(make):
    dark = make.seen([(0, 0), (1, 0)], [[0.5, 0.5]] * 2, unknown=[True, True], reasons=[("too dark", "wind"), ()])
    cells = combine([make.drive(terrain=dark)], CLASSES, 0.5)
    assert np.all(np.isnan(cells.probability))
    assert [cells.reasons[code] for code in cells.reason] == [
        "seen, but not recognised: too dark; wind",
        "seen, but not recognised",
    ]
    bright = make.drive("later", make.seen([(0, 0)], [[0.1, 0.9]]))
    both = combine([make.drive(terrain=dark), bright], CLASSES, 0.5)
    assert both.probability[0].tolist() == pytest.approx([0.1, 0.9])
    assert both.reason[0] == 0


def test_a_finer_grid_goes_into_the_coarser_cells(make):
    fine = make.seen([(0, 0), (3, 3), (4, 0), (-1, 0)], [[0.5, 0.5]] * 4, cell_size_m=0.25)
    cells = combine([make.drive(terrain=fine)], CLASSES, 1.0)
    assert cells_from_keys(cells.key).tolist() == [[-1, 0], [0, 0], [1, 0]]
