import copy
import dataclasses
import math
import pickle
from datetime import timedelta

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase, Vehicle, Wheel
from bevameter.database.cell_index import NOWHERE as NO_ROW
from bevameter.database.cell_index import UNSEEN, CellIndex
from bevameter.database.mixture import MixtureTable
from bevameter.database.snapshot import Snapshot
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.pooling import cell_keys, cells_from_keys
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.special import stdtrit

COLUMNS = (
    "x", "y", "known", "reason", "class_index", "class_probability", "cohesion", "friction_angle", "covariance",
    "shear_strength", "shear_strength_lower", "age", "observation_count", "extrapolated",
)  # fmt: skip
WHEEL = Wheel(radius_m=0.15, width_m=0.12)
SAND, CLAY, DARK, ASPHALT, NOWHERE = (0.1, 0.1), (0.6, 0.1), (1.2, 0.1), (-1.3, -0.8), (50.0, 50.0)


@pytest.fixture
def view(drive_with_soil) -> Snapshot:
    return Snapshot.derive("quarry", [drive_with_soil])


def arrays(thing, seen=None):
    """Every array that can be reached from a dataclass."""
    if isinstance(thing, np.ndarray):
        yield thing
    elif dataclasses.is_dataclass(thing):
        for entry in dataclasses.fields(thing):
            yield from arrays(getattr(thing, entry.name))
    elif hasattr(thing, "values"):
        for value in thing.values():
            yield from arrays(value)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda view: view.along([[0, 1], [0]]), r"path: \[\[0, 1\], \[0\]\] .expected \(n, 2\)"),
        (lambda view: view.along([("a", "b")]), "path: .*'a'"),
        (lambda view: view.along(None), "path: None"),
        (lambda view: view.at("here", 1), "x: 'here' .expected numbers"),
        (lambda view: view.at([0, 1, 2], [0, 1]), "x and y: 3 and 2 places"),
        (lambda view: view.at(0, 1, normal_stress="20 kPa"), r"normal stress: '20 kPa' .expected a number \[Pa\]"),
        (lambda view: view.at(0, 1, confidence=None), "confidence: None"),
        (lambda view: view.near(0, "b", 1), "y: 'b'"),
        (lambda view: view.near(0, 1, "far"), "radius: 'far'"),
        (lambda view: view.box(0, 0, "a", 1), "box: 'a'"),
    ],
)
def test_what_is_no_number_is_one_clear_error(view, ask, said):
    with pytest.raises(InputError, match=said):
        ask(view)


def test_known_and_unknown_ground(view):
    ahead = view.along([SAND, CLAY, DARK, ASPHALT, NOWHERE, (math.nan, 0.0), (1e300, 0.0)])
    assert ahead.known.tolist() == [True, True, False, False, False, False, False]
    assert ahead.reason.tolist() == [
        "",
        "",
        "seen, but not recognised: too dark; blurred",
        "no soil data for class asphalt",
        "nobody has seen this ground",
        "the place is not a finite number",
        "nobody has seen this ground",
    ]
    assert ahead.labels() == ["sand", "clay", "unknown", "asphalt", "unknown", "unknown", "unknown"]
    assert ahead.class_names == ("asphalt", "clay", "sand")
    assert ahead.observation_count.tolist() == [1, 1, 0, 1, 0, 0, 0]
    for name in ("cohesion", "friction_angle", "covariance", "shear_strength", "shear_strength_lower"):
        values = getattr(ahead, name)
        assert np.all(np.isfinite(values[:2])), name
        assert np.all(np.isnan(values[2:])), name  # never a number that looks measured
    np.testing.assert_allclose(ahead.cohesion[:2], [530.0, 3030.0], rtol=0.02)
    np.testing.assert_allclose(np.tan(ahead.friction_angle[:2]), [0.6075, 0.4075], rtol=0.01)
    np.testing.assert_allclose(ahead.shear_strength[:2], [530 + 20e3 * 0.6075, 3030 + 20e3 * 0.4075], rtol=0.01)
    assert np.all(ahead.shear_strength_lower[:2] < ahead.shear_strength[:2])
    np.testing.assert_allclose(np.nansum(ahead.class_probability, axis=1), [1, 1, 0, 1, 0, 0, 0])


def test_an_empty_database_knows_nothing(tmp_path):
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.make()
        empty = database.snapshot()
    ahead = empty.along([SAND, NOWHERE])
    assert not ahead.known.any()
    assert set(ahead.reason) == {"nobody has seen this ground"}
    assert ahead.class_probability.shape == (2, 0)
    assert np.all(np.isnan(ahead.shear_strength_lower))
    assert ahead.labels() == ["unknown", "unknown"]
    assert len(empty.box(-9, -9, 9, 9)) == 0
    assert len(empty.along(np.zeros((0, 2)))) == 0


def test_ground_without_any_soil_data(make):
    ahead = Snapshot.derive("quarry", [make.drive()]).at(0.1, 0.1)
    assert (ahead.known.tolist(), ahead.reason.tolist()) == ([False], ["no soil data for class sand"])
    assert ahead.class_probability[0].tolist() == pytest.approx([0.1, 0.9])


def test_answers_are_read_only(view):
    found = list(arrays(view))
    assert len(found) > 10
    assert not any(array.flags.writeable for array in found)
    with pytest.raises(dataclasses.FrozenInstanceError):
        view.site = "elsewhere"  # type: ignore[misc]
    with pytest.raises(TypeError):
        view.soils["sand"] = view.soils["clay"]
    with pytest.raises(TypeError):
        view.soils["sand"].others["n"] = view.soils["clay"].others["n"]
    before = view.along([SAND, CLAY], now=0.0)
    answer = view.along([SAND, CLAY], now=0.0)
    for name in COLUMNS:
        assert not getattr(answer, name).flags.writeable, name
    with pytest.raises(ValueError, match="read-only"):
        answer.class_probability[:] = 0.0
    path = np.array([SAND, CLAY])
    answer = view.along(path)
    path[:] = 0.0  # the path stays the planner's own
    np.testing.assert_array_equal(answer.x, [SAND[0], CLAY[0]])
    np.testing.assert_array_equal(view.along([SAND, CLAY], now=0.0).class_probability, before.class_probability)


def test_answers_need_no_database_any_more(tmp_path, drive_with_soil, make):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(drive_with_soil)
        frozen = database.snapshot()
        before = frozen.along([SAND, CLAY, DARK], now=0.0).shear_strength_lower
        database.add_drive(make.drive("d2", soils=(make.soil({"sand": 1.0}, 9000.0),)))
        assert database.snapshot().at(*SAND).cohesion[0] > 2 * frozen.at(*SAND).cohesion[0]
    path.unlink()
    np.testing.assert_array_equal(frozen.along([SAND, CLAY, DARK], now=0.0).shear_strength_lower, before)


def slowly(view: Snapshot, place: np.ndarray, stress: float, confidence: float) -> dict[str, object]:
    """What is known of one place, from its cell and the classes' soils, one after the other."""
    nothing = dict.fromkeys(("cohesion", "friction_angle", "shear_strength", "shear_strength_lower"), math.nan)
    nothing |= {"known": False, "extrapolated": False, "observation_count": 0, "label": "unknown"}
    if not np.isfinite(place).all():
        return {**nothing, "reason": "the place is not a finite number"}
    cell_x, cell_y = (math.floor(each / view.cell_size_m) for each in place)
    key = cell_x * 2**32 + cell_y
    if key not in view.cells.key.tolist():
        return {**nothing, "reason": "nobody has seen this ground"}
    row = view.cells.key.tolist().index(key)
    why = view.cells.reasons[view.cells.reason[row]]
    nothing["observation_count"] = int(view.cells.looks[row])
    if why:
        return {**nothing, "reason": why}
    belief = dict(zip(view.class_names, view.cells.probability[row], strict=True))
    nothing["label"] = max(belief, key=belief.__getitem__)
    lacking = {name: share for name, share in belief.items() if name not in view.soils}
    if sum(lacking.values()) > 1.0 - confidence:
        name = max(lacking, key=lacking.__getitem__)
        said = f"no soil data for class {name}"
        if name != nothing["label"]:
            said += (
                f", and this may be {name}: {math.floor(1000 * sum(lacking.values())) / 10:.1f} %, where "
                f"{100 * (1 - confidence):.4g} % are allowed; drive slowly on {name}, or look at this ground again"
            )
        return {**nothing, "reason": said}
    measured = sum(belief[name] for name in view.soils)
    weight = {name: belief[name] / measured for name in view.soils}
    mean = sum(weight[name] * soil.strength.mean for name, soil in view.soils.items())
    second = sum(
        weight[name] * (soil.strength.predictive_covariance + np.outer(soil.strength.mean, soil.strength.mean))
        for name, soil in view.soils.items()
    )
    students = np.array([soil.strength.predict(np.array([1.0, stress])) for soil in view.soils.values()]).T
    table = MixtureTable.of_student(*students, 1.0 - confidence)
    share = np.array([[belief[name] for name in view.soils]])
    driven = [soil.normal_stress_Pa for soil in view.soils.values()]
    far = [stress > 2.0 * high or stress < 0.5 * low for low, high in driven]
    return {
        "known": True, "reason": "", "label": nothing["label"], "observation_count": nothing["observation_count"],
        "cohesion": mean[0], "friction_angle": math.atan(mean[1]), "covariance": second - np.outer(mean, mean),
        "shear_strength": mean[0] + stress * mean[1],
        "shear_strength_lower": max(float(table.lower_bound(share, np.array([measured - confidence]))[0]), 0.0),
        "extrapolated": any(w > 1.0 - confidence for w, beyond in zip(weight.values(), far, strict=True) if beyond),
    }  # fmt: skip


@pytest.mark.parametrize(("stress", "confidence"), [(20e3, 0.95), (2e3, 0.8), (90e3, 0.99)])
def test_what_is_tabulated_is_what_each_place_gives_by_itself(make, rng, stress, confidence):
    classes = ("asphalt", "clay", "gravel", "sand")
    cells = [(int(x), int(y)) for x in range(-9, 9) for y in range(-7, 8)]
    belief = rng.dirichlet((0.05, 0.4, 0.4, 0.4), len(cells))
    dark = rng.random(len(cells)) < 0.1
    terrain = make.seen(
        cells, belief.tolist(), classes=classes, unknown=dark.tolist(), reasons=[("dark",)] * len(cells)
    )
    soils = [
        make.soil({name: 1.0}, 400.0 * index + 30.0 * place, 0.3 + 0.1 * index)
        for index, name in enumerate(classes[1:]) for place in range(index + 1)
    ]  # fmt: skip
    view = Snapshot.derive("quarry", [make.drive(terrain=terrain, soils=tuple(soils))])
    places = np.concatenate([rng.uniform(-5.5, 5.5, (300, 2)), [[math.nan, 0.0], [1e300, 0.0], [0.0, math.inf]]])
    answer = view.along(places, normal_stress=stress, confidence=confidence)
    labels = answer.labels()
    assert labels == [(*view.class_names, "unknown")[index] for index in answer.class_index]
    assert 50 < np.count_nonzero(answer.known) < 290
    for at, place in enumerate(places):
        for name, expected in slowly(view, place, stress, confidence).items():
            found = labels[at] if name == "label" else getattr(answer, name)[at]
            if isinstance(expected, str):
                assert found == expected
            else:
                np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12, err_msg=name)


def test_a_cell_takes_less_than_a_hundred_bytes(make, rng):
    classes, cells = ("asphalt", "clay", "grass", "gravel", "sand"), [(x, y) for x in range(64) for y in range(64)]
    terrain = make.seen(cells, rng.dirichlet(np.ones(5), len(cells)).tolist(), classes=classes)
    soils = tuple(make.soil({name: 1.0}) for name in classes)
    view = Snapshot.derive("quarry", [make.drive(terrain=terrain, soils=soils)])
    answer = view.along([SAND])
    assert answer.known.all()
    assert answer.class_index.all()
    assert answer.shear_strength_lower[0] < answer.shear_strength[0]
    kept = [view.cells, view._index, *(vars(table) for table in view._tables.values())]
    size = sum({id(array): array.nbytes for thing in kept for array in arrays(thing)}.values())
    assert 50 < size / len(cells) < 100


def test_places_far_from_the_origin_lose_no_precision(make, drive_with_soil):
    """As coordinates of a UTM zone are."""
    cells, belief = [(0, 0), (1, 0), (0, 1), (3, 2)], [[0.9, 0.1], [0.1, 0.9], [0.5, 0.5], [0.2, 0.8]]
    far = [(x + 1_000_000, y + 10_000_000) for x, y in cells]
    here, there = (
        Snapshot.derive("q", [dataclasses.replace(drive_with_soil, terrain=make.seen(each, belief))])
        for each in (cells, far)
    )
    places = np.array([(0.001, 0.499), (0.999, 0.001), (0.4, 0.501), (1.75, 1.25), (0.5, 0.5)])
    shifted = places + np.array([500_000.0, 5_000_000.0])
    for name in COLUMNS[2:]:
        found = getattr(there.along(shifted, now=2e9), name)
        np.testing.assert_array_equal(found, getattr(here.along(places, now=2e9), name), err_msg=name)
    np.testing.assert_array_equal(there.along(shifted).x, shifted[:, 0])
    assert len(there.box(500_000.0, 5_000_000.0, 500_001.0, 5_000_001.0)) == 3
    assert len(there.near(500_000.25, 5_000_000.25, 0.51)) == 3


def test_every_cell_is_found_where_keys_are_as_far_apart_as_can_be(rng):
    cells = np.unique(rng.integers(-(2**31) + 1, 2**31 - 1, (5000, 2)), axis=0)
    cells = np.concatenate([cells, [[-(2**31) + 1, 2**31 - 1], [0, 0], [-1, -1]]])
    key = np.sort(cell_keys(cells))
    index = CellIndex.of(key, 0.25)
    centres = (cells_from_keys(key) + 0.5) * 0.25
    np.testing.assert_array_equal(index.rows(centres), np.arange(len(key)))
    assert index.rows(np.array([[1e300, 0.0], [0.3, 0.0], [math.nan, 0.0]])).tolist() == [UNSEEN, UNSEEN, NO_ROW]
    assert CellIndex.of(np.zeros(0, dtype=np.int64), 0.25).rows(np.zeros((1, 2))).tolist() == [UNSEEN]


def test_at_is_along(view):
    one = view.at(*SAND, normal_stress=5e3, confidence=0.8, now=0.0)
    assert one.shear_strength_lower == view.along([SAND], normal_stress=5e3, confidence=0.8).shear_strength_lower
    many = view.at(np.array([SAND[0], CLAY[0]]), 0.1)
    assert many.labels() == ["sand", "clay"]


def test_the_bound_of_a_pure_class_is_its_student_quantile(view):
    for confidence in (0.5, 0.8, 0.95, 0.96):
        answer = view.class_answer("sand", normal_stress=10e3, confidence=confidence)
        location, scale, freedom = view.soils["sand"].strength.predict(np.array([1.0, 10e3]))
        assert answer.shear_strength_lower[0] == pytest.approx(
            max(location + scale * stdtrit(freedom, 1 - confidence), 0.0), rel=1e-6
        )
    assert view.class_answer("sand", confidence=0.9999999).shear_strength_lower[0] == 0.0  # strength is not negative


def test_the_bound_of_a_mixture_is_the_mixtures_quantile(rng):
    location, scale, freedom = np.array([10.0, 20.0, 12.0]), np.array([1.0, 2.0, 0.1]), np.array([3.0, 30.0, 8.0])
    weight = np.array([[0.2, 0.7, 0.1], [0.0, 1.0, 0.0], [0.01, 0.98, 0.01], [1 / 3, 1 / 3, 1 / 3]])
    for level in (0.01, 0.05, 0.2, 0.5):
        table = MixtureTable.of_student(location, scale, freedom, level)
        bound = table.lower_bound(weight, np.full(4, level))
        draws = location + scale * rng.standard_t(freedom, (400_000, 3))
        below = np.stack([np.mean(draws <= one, axis=0) for one in bound])
        np.testing.assert_allclose(np.sum(weight * below, axis=1), level, atol=0.003)


def test_classes_without_soil_count_as_no_strength(make):
    soils = tuple(make.soil({"sand": 1.0}, 500.0 + 20.0 * index) for index in range(9))
    bounds = []
    for asphalt in (0.0, 0.02, 0.045, 0.06):
        terrain = make.seen([(0, 0)], [[asphalt, 1.0 - asphalt]], classes=("asphalt", "sand"))
        answer = Snapshot.derive("quarry", [make.drive(terrain=terrain, soils=soils)]).at(0.1, 0.1)
        bounds.append(answer.shear_strength_lower[0])
        assert bool(answer.known[0]) == (asphalt < 0.05)
    assert bounds[0] > bounds[1] > bounds[2]
    assert math.isnan(bounds[3])


def test_uncertainty_of_the_class_widens_the_covariance(make, drive_with_soil):
    terrain = make.seen([(0, 0), (1, 0)], [[0.5, 0.5], [0.001, 0.999]])
    answer = Snapshot.derive("q", [dataclasses.replace(drive_with_soil, terrain=terrain)]).along([SAND, CLAY])
    assert answer.covariance[0, 0, 0] > 1250.0**2 > answer.covariance[1, 0, 0]
    # Three quarters of the way down the weaker class still holds nearly half of the mass.
    assert answer.shear_strength_lower[0] < answer.shear_strength_lower[1]


def test_evidence_that_ages_loses_weight_and_no_bound_rises_by_it(make, drive_with_soil):
    terrain = make.seen([(0, 0), (1, 0), (2, 0)], [[0.002, 0.998], [0.998, 0.002], [0.7, 0.3]])
    drive = dataclasses.replace(drive_with_soil, terrain=terrain)
    view = Snapshot.derive("q", [drive])
    start, path, day = drive.start_time.timestamp(), [SAND, CLAY, (1.2, 0.1), (1.7, 0.1)], 86400.0
    fresh = view.along(path, now=start)
    answers = [view.along(path, now=start + days * day, half_life=day) for days in (0, 1, 3, 400)]
    for before, after in zip([fresh, *answers], answers, strict=False):
        assert np.all((after.shear_strength_lower <= before.shear_strength_lower + 1.0)[:3])
        assert np.all(after.class_probability.max(axis=1)[:3] <= before.class_probability.max(axis=1)[:3] + 1e-4)
    np.testing.assert_allclose(answers[0].shear_strength_lower, fresh.shear_strength_lower, rtol=1e-3)
    odds = answers[1].class_probability[1]
    assert odds[0] / odds[1] == pytest.approx(math.sqrt(0.998 / 0.002), rel=1e-3), "after a half-life half of the nats"
    np.testing.assert_allclose(answers[3].class_probability[:3], 0.5)
    assert answers[3].reason[3] == "nobody has seen this ground"
    assert np.all(answers[1].age[:2] == pytest.approx(day, abs=2.0))
    timeless = Snapshot.derive("q", [dataclasses.replace(drive, start_time=None)])
    np.testing.assert_allclose(timeless.along(path, half_life=day).class_probability[:3], 0.5)
    for wrong in (0.0, -1.0, math.nan, "a day"):
        with pytest.raises(InputError, match="half_life"):
            view.along(path, half_life=wrong)
    pulls = [
        view.along(path, now=start + days * day, half_life=day).drawbar_pull(Vehicle(wheels=(WHEEL,)), 0.3).lower
        for days in (0, 2, 50)
    ]
    assert np.all(pulls[0][:3] >= pulls[1][:3])
    assert np.all(pulls[1][:3] >= pulls[2][:3] - 1e-9)


def test_age(view, make, drive_with_soil):
    now = make.START + timedelta(hours=1)
    answer = view.along([SAND, CLAY, DARK, NOWHERE], now=now)
    assert answer.age[:3].tolist() == [3600.0, 3599.0, 3598.0]
    assert math.isnan(answer.age[3])
    assert view.at(*SAND, now=now.replace(tzinfo=None)).age == view.at(*SAND, now=now.timestamp()).age
    undated = Snapshot.derive("q", [dataclasses.replace(drive_with_soil, start_time=None)])
    assert math.isnan(undated.at(*SAND).age[0])
    assert undated.at(*SAND).known[0]


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-8, 8), st.integers(-8, 8)), min_size=1, max_size=60, unique=True),
    st.tuples(*(st.floats(-6, 6),) * 4),
    st.floats(0, 5),
)
def test_regions_hold_what_lies_in_them(make, cells, corners, radius):
    view = Snapshot.derive("q", [make.drive(terrain=make.seen(cells, [[0.5, 0.5]] * len(cells)))])
    centres = (np.array(cells) + 0.5) * 0.5
    x0, y0, x1, y1 = corners
    low, high = np.minimum([x0, y0], [x1, y1]), np.maximum([x0, y0], [x1, y1])
    inside = centres[np.all((centres >= low) & (centres <= high), axis=1)]
    box = view.box(*corners)
    assert sorted(map(tuple, inside)) == sorted(zip(box.x.tolist(), box.y.tolist(), strict=True))
    closest = np.clip([x0, y0], centres - 0.25, centres + 0.25)
    distance = np.hypot(*(closest - [x0, y0]).T)
    assume(np.all(np.abs(distance - radius) > 1e-9))  # rounding decides there
    around = centres[distance <= radius]
    near = view.near(x0, y0, radius)
    assert sorted(map(tuple, around)) == sorted(zip(near.x.tolist(), near.y.tolist(), strict=True))
    assert not (near.reason == "nobody has seen this ground").any()


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda view: view.along([1.0, 2.0]), "shape"),
        (lambda view: view.along([SAND], confidence=1.0), "confidence"),
        (lambda view: view.along([SAND], confidence=0.2), "confidence"),
        (lambda view: view.along([SAND], confidence=math.nan), "confidence"),
        (lambda view: view.along([SAND], normal_stress=-1.0), "normal stress"),
        (lambda view: view.along([SAND], normal_stress=math.inf), "normal stress"),
        (lambda view: view.near(0.0, 0.0, -1.0), "radius"),
        (lambda view: view.near(math.nan, 0.0, 1.0), "box"),
        (lambda view: view.box(0.0, 0.0, math.inf, 1.0), "box"),
        (lambda view: view.class_answer("snow"), "asphalt, clay, sand"),
    ],
)
def test_questions_that_make_no_sense(view, ask, said):
    with pytest.raises(InputError, match=said):
        ask(view)


def test_strength_far_from_the_stresses_driven_is_reported_to_be_extrapolated(view):
    """Driven at 5 to 30 kPa."""
    answers = [view.class_answer("sand", normal_stress=stress) for stress in (1e3, 5e3, 50e3, 70e3, 1e9)]
    assert [bool(each.extrapolated[0]) for each in answers] == [True, False, False, True, True]
    assert not view.class_answer("asphalt", normal_stress=1e9).extrapolated.any()
    # The bound holds the error of the line's slope, however far it is drawn.
    strength = view.soils["sand"].strength
    slope_sd = math.sqrt(strength.predictive_covariance[1, 1])
    assert answers[-1].shear_strength_lower[0] < 1e9 * (strength.mean[1] - 1.64 * slope_sd)


@pytest.mark.parametrize("again", [copy.deepcopy, lambda view: pickle.loads(pickle.dumps(view))])
def test_a_snapshot_can_be_handed_to_another_process(tmp_path, drive_with_soil, again):
    values = dict(zip(PARAMETERS, (700.0, 0.5, 0.02, 4e5, 0.9), strict=True))
    with TerrainDatabase(tmp_path / "t.db") as database:
        database.add_drive(drive_with_soil)
        database.add_physics("sand", AugmentedSimulator({k: Estimate(v, 0.0) for k, v in values.items()}), source="x")
        view = database.snapshot()
    path = [[0.1, 0.1], [0.6, 0.1], [1.1, 0.1], [9.0, 9.0]]
    before, size = view.along(path, now=0.0), len(pickle.dumps(view))
    before.shear_strength_lower  # noqa: B018  # of what is computed nothing goes along
    assert len(pickle.dumps(view)) == size
    other = again(view)
    after = other.along(path, now=0.0)
    assert other.site == view.site
    assert after.reason.tolist() == before.reason.tolist()
    for name in ("class_probability", "covariance", "shear_strength_lower", "age"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    assert other.physics["sand"].to_json() == view.physics["sand"].to_json()
    assert not any(array.flags.writeable for array in arrays(other))
    with pytest.raises(TypeError):
        other.soils["sand"] = None
    with pytest.raises(TypeError):
        other.physics["sand"].soil["c_Pa"] = None
