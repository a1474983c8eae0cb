from __future__ import annotations

import pickle

from bevameter import InputError


def test_an_error_is_one_line_whatever_the_name_of_the_file():
    assert str(InputError("a\nb.db", "two\nlines", expected="one", place="row 1")) == (
        "a b.db, row 1: two lines (expected one)"
    )


def test_an_error_comes_out_of_a_worker_process_as_it_was_raised():
    given = InputError("wheel.csv", "'abc'", expected="a number", place="row 12")
    found = pickle.loads(pickle.dumps(given))
    assert (type(found), str(found), vars(found)) == (InputError, str(given), vars(given))
