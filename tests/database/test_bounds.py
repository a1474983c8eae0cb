"""Snapshots of a part of a site answer there as those of all of it."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database.belief import NOT_SEEN, OUTSIDE

COLUMNS = (
    "known", "reason", "class_probability", "shear_strength", "shear_strength_lower", "observation_count", "seen",
)  # fmt: skip


@pytest.fixture(params=["sqlite", "postgresql"])
def anywhere(request, tmp_path):
    """URL of a new database."""
    return str(tmp_path / "t.db") if request.param == "sqlite" else request.getfixturevalue("server")


@pytest.fixture
def site(anywhere, make):
    """Drives of two cell sizes, one of them replaced, and one of another site."""
    rng = np.random.default_rng(8)

    def looks(count: int, size: float, spread: int):
        cells = [tuple(each) for each in rng.integers(-spread, spread, (count, 2)).tolist()]
        unknown = (rng.random(count) < 0.2).tolist()
        return make.seen(
            cells, rng.dirichlet([0.5, 0.5], count).tolist(), unknown=unknown, quality=rng.random(count).tolist(),
            reasons=[("too dark",) if each else () for each in unknown], cell_size_m=size,
        )  # fmt: skip

    soils = tuple(make.soil({"sand": 1.0}, 900.0 + at, at_s=10.0 * at) for at in range(4))
    with TerrainDatabase(anywhere) as database:
        database.add_drive(make.drive("d1", looks(300, 0.3, 20), soils))
        database.add_drive(make.drive("d2", looks(200, 0.7, 9), soils[:2]))
        database.add_drive(make.drive("d2", looks(200, 0.5, 12), soils[2:], model="m2"))
        database.add_drive(make.drive("d3", looks(200, 0.5, 12), start_time=None))
        database.add_drive(make.drive("d4", looks(1, 2.5, 3), model="m1"))
        database.add_drive(make.drive("d4", make.seen([], [], cell_size_m=2.5), model="m3"))
        database.add_drive(make.drive("d5", looks(99, 9.0, 3), site="beach"))
        yield database


def answered(view, places) -> dict[str, np.ndarray]:
    answer = view.along(places, now=0.0)
    return {name: -answer.age if name == "seen" else getattr(answer, name) for name in COLUMNS}


def test_within_the_bounds_a_part_answers_as_the_whole(site):
    whole = site.snapshot("quarry")
    rng = np.random.default_rng(9)
    edges = (0.0, 0.0, 2 * whole.cell_size_m, whole.cell_size_m)
    for bounds in [
        *np.sort(rng.uniform(-7, 7, (12, 2, 2)), axis=1).reshape(-1, 4).tolist(),
        edges,
        (1.2, 0.3, 1.2, 0.3),
    ]:
        part = site.snapshot("quarry", bounds=bounds)
        assert (part.cell_size_m, part.class_names, part.drives) == (whole.cell_size_m, whole.class_names, whole.drives)
        assert set(part.soils) == set(whole.soils)
        places = np.vstack([rng.uniform(bounds[:2], bounds[2:], (60, 2)), np.reshape(bounds, (2, 2))])
        given, expected = answered(part, places), answered(whole, places)
        for name in COLUMNS:
            np.testing.assert_array_equal(given[name], expected[name])
        assert np.array_equal(part.box(*bounds).x, whole.box(*bounds).x)
        assert len(part.cells.key) <= len(whole.cells.key)
        everywhere = rng.uniform(-9, 9, (400, 2))
        x0, y0, x1, y1 = part.bounds
        within = ((everywhere >= (x0, y0)) & (everywhere < (x1, y1))).all(axis=1)
        reason = part.along(everywhere).reason
        assert set(reason[~within]) == {OUTSIDE}
        assert OUTSIDE not in reason[within]
        assert np.array_equal(reason[within], whole.along(everywhere[within]).reason)
    assert NOT_SEEN in whole.along(everywhere).reason
    assert whole.bounds is None


def test_a_part_has_no_more_than_it_needs(site):
    view = site.snapshot("quarry", bounds=(0.1, 0.1, 0.9, 0.9))
    assert 0 < len(view.cells.key) <= 9
    assert site.snapshot("quarry", bounds=(1e5, 1e5, 2e5, 2e5)).along([[0.0, 0.0], [1.5e5, 1.5e5]]).reason.tolist() == [
        OUTSIDE, NOT_SEEN,
    ]  # fmt: skip
    assert site.snapshot("quarry", bounds=(-1e30, -1e30, 1e30, 1e30)).drives == view.drives


@pytest.mark.parametrize("bounds", [(1, 0, 0, 1), (0, 0, 1), 3, (0, 0, float("nan"), 1), "0011", (0, 0, None, 1)])
def test_bounds_that_are_none(tmp_path, make, bounds):
    with TerrainDatabase(tmp_path / "t.db") as database:
        database.add_drive(make.drive())
        with pytest.raises(InputError, match=r"bounds: .*expected x0, y0, x1, y1"):
            database.snapshot(bounds=bounds)
