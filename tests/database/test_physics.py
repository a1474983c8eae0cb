"""Physics of classes: kept with the class, merged as a set, and used by what planners predict."""

from __future__ import annotations

import dataclasses
import json
import math
import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase, Vehicle, Wheel
from bevameter.database import schema
from bevameter.database.snapshot import Snapshot
from bevameter.database.store import Added
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator, StoredEffect
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.simulate import simulate
from old_schema import TO_FIRST

SAND, CLAY = (1.1, 0.1), (0.6, 0.1)
WHEEL = Wheel(radius_m=0.15, width_m=0.12)
ROVER = Vehicle(wheels=(WHEEL,))
FOUND = datetime(2026, 11, 2, 9, 0, tzinfo=UTC)
SOIL = Soil(700.0, math.atan(0.55), 0.02, 4e5, 0.9)


def physics(*effects: StoredEffect, soil: Soil = SOIL) -> AugmentedSimulator:
    return AugmentedSimulator({name: Estimate(getattr(soil, name), 0.0) for name in PARAMETERS}, effects)


def effect(slug: str, form: str = "", sd: float = 0.0, **parameters: float) -> StoredEffect:
    return StoredEffect(slug, form, {name: Estimate(value, sd) for name, value in parameters.items()})


SINKS = physics(effect("slip_sinkage", "exponent", n1=0.6))


@pytest.fixture(scope="module")
def traverse(make):
    terrain = make.seen([(2, 0), (1, 0)], [[0.0, 1.0], [1.0, 0.0]])
    soils = tuple(
        make.soil({name: 1.0}, c, t, at_s=10.0 * index)
        for name, c, t in (("clay", 3000.0, 0.4), ("sand", 500.0, 0.6))
        for index in range(40)
    )
    return make.drive(terrain=terrain, soils=soils)


def test_physics_is_stored_once_and_read_back(tmp_path):
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        assert database.add_physics("sand", SINKS, source="drive 3", time=FOUND) == Added(1, 0)
        assert database.add_physics("sand", SINKS, source="drive 3", time=FOUND) == Added(0, 1)
        assert database.add_physics("sand", SINKS, source="drive 4", time=FOUND) == Added(1, 0)
        (one, two) = database.physics("sand")
        assert {one.source, two.source} == {"drive 3", "drive 4"}
        assert one.physics.to_json() == SINKS.to_json()
        assert one.observed_at == FOUND
        assert database.physics("clay") == []
        assert len(database.physics()) == 2


def test_physics_of_no_stated_time_that_is_the_newest_already_adds_nothing(tmp_path):
    other = physics(effect("slip_sinkage", "exponent", n1=0.3))
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        assert database.add_physics("sand", SINKS, source="drive", time=FOUND) == Added(1, 0)
        assert database.add_physics("sand", SINKS, source="drive") == Added(0, 1)
        assert database.add_physics("sand", SINKS, source="/data/drive") == Added(0, 1), "the same by another path"
        assert database.add_physics("sand", SINKS, source="drive", site="quarry") == Added(1, 0)
        assert database.add_physics("clay", SINKS, source="drive") == Added(1, 0)
        assert database.add_physics("sand", other, source="drive") == Added(1, 0)
        assert database.add_physics("sand", SINKS, source="drive") == Added(1, 0), "in use again"
        assert [each.physics.to_json() for each in database.physics("sand") if not each.site] == [
            each.to_json() for each in (SINKS, other, SINKS)
        ]


def test_databases_merge_their_physics_as_sets(tmp_path, traverse):
    with TerrainDatabase(tmp_path / "a.db") as first, TerrainDatabase(tmp_path / "b.db") as second:
        first.add_drive(traverse)
        first.add_physics("sand", SINKS, source="a", time=FOUND)
        second.add_physics("sand", SINKS, source="a", time=FOUND)
        second.add_physics("clay", SINKS, source="b", time=FOUND)
        assert first.merge(second) == Added(1, 1)
        assert first.merge(second) == Added(0, 2)
        total = len(traverse.terrain) + len(traverse.soils)
        assert second.merge(first) == Added(total, 2)
        assert [each.id for each in first.physics()] == [each.id for each in second.physics()]
        assert set(second.snapshot().physics) == {"clay", "sand"}


def test_the_newest_physics_of_the_site_counts(tmp_path, traverse):
    later = physics(effect("exit_angle", "peak kept", c2=0.3))
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.add_drive(traverse)
        assert dict(database.snapshot().physics) == {}
        database.add_physics("sand", later, source="b", time=FOUND + timedelta(hours=1))
        database.add_physics("sand", SINKS, source="a", time=FOUND)
        database.add_physics("sand", SINKS, source="elsewhere", time=FOUND + timedelta(hours=2), site="beach")
        assert database.snapshot().physics["sand"].to_json() == later.to_json()
        database.add_physics("sand", SINKS, source="here", time=FOUND + timedelta(hours=3), site="quarry")
        assert database.snapshot().physics["sand"].to_json() == SINKS.to_json()


def test_what_is_no_physics_is_not_stored(tmp_path):
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        for spoilt in (
            physics(effect("slip_sinkage", "exponent", n1=99.0)), physics(effect("gravity", g=1.0)),
            physics(effect("slip_sinkage", "exponent", n1=math.nan)),
        ):  # fmt: skip
            with pytest.raises(InputError, match="physics of sand"):
                database.add_physics("sand", spoilt, source="x")
        with pytest.raises(InputError, match="class_name"):
            database.add_physics("", SINKS, source="x")
        assert database.physics() == []


def test_tampered_physics_is_one_line(tmp_path, traverse):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(traverse)
        database.add_physics("sand", SINKS, source="x", time=FOUND)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("""UPDATE class_physics SET physics = '{"schema": 1, "soil": {}, "effects": []}'""")
        connection.commit()
    with TerrainDatabase(path) as database, pytest.raises(InputError, match="physics of sand") as caught:
        database.snapshot()
    assert "\n" not in str(caught.value)


def test_a_database_of_before_is_upgraded_and_loses_nothing(tmp_path, traverse):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(traverse)
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(TO_FIRST)
    with TerrainDatabase(path, must_exist=True) as database:
        (again,) = database.drives()
        assert again.id == traverse.id
        assert len(again.soils) == len(traverse.soils)
        assert len(again.terrain) == len(traverse.terrain)
        assert database.add_drive(traverse).new == 0
        assert database.add_physics("sand", SINKS, source="x", time=FOUND) == Added(1, 0)
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("SELECT version_num FROM bevameter_schema").fetchone() == (schema.REVISIONS[-1],)
        connection.executescript("DROP TABLE class_physics")
    with pytest.raises(InputError, match="lacks the table class_physics"):
        TerrainDatabase(path)


def test_predictions_use_the_classs_own_physics(traverse):
    plain, own = Snapshot.derive("q", [traverse]), Snapshot.derive("q", [traverse], {"sand": SINKS})
    before, after = (view.along([SAND, CLAY]).drawbar_pull(ROVER, slip=0.6) for view in (plain, own))
    assert after.known.all()
    assert after.mean[1] == pytest.approx(
        before.mean[1], abs=0.02
    )  # clay has none of its own; a trace of it may be sand
    assert after.lower[1] == pytest.approx(before.lower[1], abs=0.02)
    table = simulated(SINKS, slip=0.6)
    assert after.mean[0] == pytest.approx(table, abs=1.5)
    assert abs(after.mean[0] - before.mean[0]) > 3.0
    assert after.lower[0] < after.mean[0]
    textbook = equilibrium(WHEEL, SOIL, np.array([80.0]), np.array([0.6])).drawbar_pull_N[0]
    assert abs(textbook - table) > 1.0


def simulated(found: AugmentedSimulator, slip: float) -> float:
    """Drawbar pull of the wheel under 80 N, by the simulator that was stored."""
    from bevameter.framework.core.recording.types import WheelTable

    drive = WheelTable({"load_N": np.array([80.0]), "slip": np.array([slip])}, None, None, "drive")
    return float(simulate(ROVER, SOIL, drive, [each.named for each in found.effects])["drawbar_pull_N"][0])


def test_instruments_and_the_vehicle_that_drove_there_are_left_out(traverse):
    textbook = physics()
    faults = physics(
        effect("torque_gain", g=0.4), effect("rolling_radius", e=0.1), effect("load_gain", g=0.3),
        effect("drivetrain_friction", "coulomb", T_c=0.4), effect("tyre_deflection", compliance=1e-4),
    )  # fmt: skip
    one, two = (
        Snapshot.derive("q", [traverse], {"sand": found}).along([SAND]).drawbar_pull(ROVER, slip=0.3)
        for found in (textbook, faults)
    )
    assert one.mean[0] == two.mean[0]
    assert one.lower[0] == two.lower[0]
    exact = equilibrium(WHEEL, SOIL, np.array([80.0]), np.array([0.3])).drawbar_pull_N[0]
    assert one.mean[0] == pytest.approx(exact, abs=1.5)


def test_what_is_not_known_of_the_effect_widens_the_bound(traverse):
    sure, unsure = (
        Snapshot.derive("q", [traverse], {"sand": physics(effect("bulldozing", "wedge", sd=sd, s=6.0))})
        .along([SAND])
        .drawbar_pull(ROVER, slip=0.4)
        for sd in (0.0, 3.0)
    )
    assert unsure.lower[0] < sure.lower[0] - 0.5
    assert unsure.mean[0] == pytest.approx(sure.mean[0], abs=0.3)


def test_what_the_fit_does_not_know_of_the_soil_widens_the_bound(traverse):
    def answer(found: AugmentedSimulator):
        return Snapshot.derive("q", [traverse], {"sand": found}).along([SAND]).drawbar_pull(ROVER, slip=0.3)

    sure = physics()
    sd = {"c_Pa": 400.0, "phi_rad": 0.06, "k_m": 0.002, "stiffness_Pa": 4e4, "n": 0.05}
    unsure = dataclasses.replace(sure, soil={name: Estimate(sure.soil[name].value, sd[name]) for name in PARAMETERS})
    # Cohesion and friction are strongly correlated, as in a fit at one load.
    ridge = np.eye(5)
    ridge[0, 1] = ridge[1, 0] = -0.98
    correlated = dataclasses.replace(unsure, correlation=tuple(map(tuple, ridge.tolist())))
    unknown = dataclasses.replace(sure, soil={name: Estimate(sure.soil[name].value) for name in PARAMETERS})
    exact, wide, narrow, nobody = map(answer, (sure, unsure, correlated, unknown))
    assert wide.lower[0] < narrow.lower[0] - 0.5 < exact.lower[0] - 1.0
    assert nobody.lower[0] < exact.lower[0] - 1.0
    assert wide.mean[0] == pytest.approx(exact.mean[0], abs=2.0)


def test_the_bound_holds_where_soils_are_drawn_from_what_the_fit_knows(traverse):
    """Of soils within the fit's uncertainty one in twenty pulls less than the bound, or fewer."""
    sd = {"c_Pa": 400.0, "phi_rad": 0.06, "k_m": 0.004, "stiffness_Pa": 1e5, "n": 0.15}
    found = AugmentedSimulator({name: Estimate(getattr(SOIL, name), sd[name]) for name in PARAMETERS})
    view = Snapshot.derive("q", [traverse], {"sand": found}).along([SAND], confidence=0.95)
    for slip in (0.1, 0.3, 0.6):
        lower = view.drawbar_pull(ROVER, slip=slip).lower[0]
        rng = np.random.default_rng(11)
        soils = [Soil(*(max(getattr(SOIL, name) + sd[name] * rng.normal(), 1e-3) for name in PARAMETERS))
                 for _ in range(400)]  # fmt: skip
        pulls = [equilibrium(WHEEL, soil, np.array([80.0]), np.array([slip])).drawbar_pull_N[0] for soil in soils]
        assert np.mean(np.array(pulls) < lower) <= 0.06


def test_what_is_less_likely_than_not_is_not_kept(tmp_path):
    guess = dataclasses.replace(effect("slip_sinkage", "exponent", n1=0.6), probability=0.4)
    likely = dataclasses.replace(guess, probability=0.96)
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        with pytest.raises(InputError, match=r"slip_sinkage is there with probability 0.4 \(expected 0.5 or more"):
            database.add_physics("sand", physics(likely, guess), source="x")
        assert database.add_physics("sand", physics(likely), source="x").new == 1
        assert database.physics()[0].physics.effects[0].probability == 0.96


def test_a_merge_takes_no_physics_that_is_not_added(tmp_path, traverse):
    guess = dataclasses.replace(effect("slip_sinkage", "exponent", n1=0.6), probability=0.4965)
    for name, spoilt in (("likely", physics(guess).to_json()), ("no physics", {"schema": 1})):
        with TerrainDatabase(tmp_path / f"{name}.db") as other, TerrainDatabase(tmp_path / f"{name} own.db") as own:
            other.add_drive(traverse)
            other.add_physics("sand", SINKS, source="a", time=FOUND)
            with closing(sqlite3.connect(tmp_path / f"{name}.db")) as connection:
                connection.execute("UPDATE class_physics SET physics = ?", (json.dumps(spoilt),))
                connection.commit()
            with pytest.raises(InputError, match="0.4965" if name == "likely" else "physics of sand, document"):
                own.merge(other)
            assert list(own.drives()) == []
            assert own.physics() == []


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("class_name", {"class_name": " "}), ("class_name", {"class_name": "sa\0nd"}),
        ("class_name", {"class_name": "sand\ud83d"}), ("source", {"source": "x" * 5000}),
        ("observed_at", {"time": "today"}), ("observed_at", {"time": 5.0}),
        ("observed_at", {"time": datetime.max.replace(tzinfo=timezone(timedelta(hours=-5)))}),
    ],
)  # fmt: skip
def test_what_no_database_takes_is_refused_in_one_line(tmp_path, name, given):
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        with pytest.raises(InputError, match=name):
            database.add_physics(**{"class_name": "sand", "physics": SINKS, "source": "x"} | given)
        assert database.add_physics("sand", SINKS, source="/" + "a/" * 900).new == 1


_PHYSICS = "UPDATE class_physics SET physics = ?"


@pytest.mark.parametrize(
    ("statement", "value"),
    [
        (_PHYSICS, "{bad"), (_PHYSICS, ""), (_PHYSICS, "[" * 100_000), (_PHYSICS, '{"schema": ' + "9" * 5001 + "}"),
        ("UPDATE class_physics SET observed_at = ?", "garbage"), ("UPDATE class_physics SET id = ?", "zz"),
    ],
)  # fmt: skip
def test_physics_that_cannot_even_be_decoded_is_one_line(tmp_path, traverse, statement, value):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(traverse)
        database.add_physics("sand", SINKS, source="x", time=FOUND)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(statement, (value,))
        connection.commit()
    with TerrainDatabase(path) as database, pytest.raises(InputError, match="cannot be read") as caught:
        database.snapshot()
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_mobility_uses_it_and_a_class_without_an_estimate_of_k_becomes_predictable(make):
    blind = make.soil({"sand": 1.0}, 500.0, 0.6)
    parameters = {name: entry for name, entry in blind.estimate.parameters.items() if name != "k_m"}
    blind = dataclasses.replace(blind, estimate=dataclasses.replace(blind.estimate, parameters=parameters))
    terrain = make.seen([(2, 0)], [[0.0, 1.0]])
    drive = make.drive(terrain=terrain, soils=(blind,) * 6)
    answer = Snapshot.derive("q", [drive]).along([SAND]).mobility(ROVER)
    assert answer.reason[0] == "no shear modulus k known of class sand"
    answer = Snapshot.derive("q", [drive], {"sand": SINKS}).along([SAND]).mobility(ROVER)
    assert answer.known[0]
    assert answer.go_probability[0] > 0.8
    stuck = physics(effect("bulldozing", "wedge", s=20.0), effect("stress_peak_shift", a1=0.9))
    worse = Snapshot.derive("q", [drive], {"sand": stuck}).along([SAND]).mobility(ROVER)
    assert worse.drawbar_pull_lower[0] < answer.drawbar_pull_lower[0]


def test_a_snapshot_does_not_change_and_needs_no_database(tmp_path, traverse):
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(traverse)
        database.add_physics("sand", SINKS, source="a", time=FOUND)
        view = database.snapshot()
        database.add_physics("sand", physics(), source="b", time=FOUND + timedelta(days=1))
    path.unlink()
    with pytest.raises(TypeError):
        view.physics["sand"] = physics()
    with pytest.raises(dataclasses.FrozenInstanceError):
        view.physics["sand"].effects = ()
    with pytest.raises(TypeError):
        view.physics["sand"].soil["c_Pa"] = Estimate(0.0)
    pull = view.along([SAND]).drawbar_pull(ROVER, slip=0.6)
    assert pull.mean[0] == pytest.approx(simulated(SINKS, slip=0.6), abs=1.5)
