"""Physics is kept under names that something will match, and drives bring names that tell classes apart."""

from __future__ import annotations

import dataclasses
import sqlite3
from contextlib import closing

import pytest
from bevameter import InputError, SoilKnowledge, TerrainDatabase
from bevameter.database.store import Added
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator

VALUES = dict(zip(PARAMETERS, (700.0, 0.5, 0.02, 4e5, 0.9), strict=True))
SINKS = AugmentedSimulator({name: Estimate(value, 0.0) for name, value in VALUES.items()})


@pytest.fixture
def database(tmp_path, drive_with_soil):
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.add_drive(drive_with_soil)
        yield database


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Sand", "expected 'sand', as it is spelt here"), ("sand ", "expected 'sand'"), ("CLAY", "expected 'clay'"),
        ("Asphalt", "expected 'asphalt'"), ("unknown", "the answer of a closed gate"), ("Unknown", "closed gate"),
        ("moon dust ", "no spaces at its ends"), ("a\nb", "a name on one line"), ("", "1 to 200 letters"),
        (3, "1 to 200 letters"),
    ],
)  # fmt: skip
def test_physics_of_a_misspelt_or_reserved_class_is_not_stored(database, name, said):
    with pytest.raises(InputError, match=said) as caught:
        database.add_physics(name, SINKS, source="x")
    assert "class_name" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert database.physics() == []


def test_physics_may_be_stored_ahead_of_drives_and_then_has_its_spelling(database):
    assert database.add_physics("moon dust", SINKS, source="x") == Added(1, 0)
    with pytest.raises(InputError, match="'moon dust'"):
        database.add_physics("Moon dust", SINKS, source="x")
    assert database.add_physics("asphalt", SINKS, source="x") == Added(1, 0), "seen, without soil so far"


def test_a_class_with_soil_only_has_its_spelling(database, make):
    database.add_drive(make.drive("d2", soils=(make.soil({"gravel": 1.0}),)))
    with pytest.raises(InputError, match="'gravel'"):
        database.add_physics("Gravel", SINKS, source="x")


@pytest.mark.parametrize(("name", "said"), [("Sand", "'sand'"), ("unknown", "closed gate")])
def test_a_merge_takes_no_physics_of_a_misspelt_or_reserved_class(database, tmp_path, name, said):
    with TerrainDatabase(tmp_path / "other.db") as other:
        other.add_physics("gravel", SINKS, source="x")
        with closing(sqlite3.connect(tmp_path / "other.db")) as connection:  # as versions before stored it
            connection.execute("UPDATE class_physics SET class_name = ?", (name,))
            connection.commit()
        with pytest.raises(InputError, match=f"other.db, physics of {name}.*{said}"):
            database.merge(other)
    assert database.physics() == []


def test_a_merge_brings_physics_with_the_drives_whose_class_it_is_of(database, tmp_path, make):
    """Another vehicle's models may spell a class otherwise: its physics is its own drives'."""
    terrain = make.seen([(0, 0)], [[0.1, 0.9]], classes=("Clay", "Sand"))
    with TerrainDatabase(tmp_path / "other.db") as other:
        other.add_drive(make.drive("d2", terrain))
        other.add_physics("Sand", SINKS, source="x")
        assert database.merge(other) == Added(2, 0)


def test_a_drive_whose_classes_are_one_is_not_stored(database, make):
    before = len(database.drives())
    for names in (("Sand", "sand"), ("sand", "unknown")):
        terrain = make.seen([(0, 0)], [[0.1, 0.9]], classes=names)
        with pytest.raises(InputError, match="drive 'drive d3', classes"):
            database.add_drive(make.drive("d3", terrain))
    with pytest.raises(InputError, match="'Clay'"):
        database.add_drive(make.drive("d3", soils=(make.soil({"Clay": 1.0}),)))
    assert len(database.drives()) == before


def test_what_is_no_physics_is_named(database):
    bare = AugmentedSimulator({"c_Pa": Estimate(700.0)})
    for given, said in (
        ({"a": 1}, r"^physics: \{'a': 1\} .expected an AugmentedSimulator"), (None, "^physics: None"),
        (SoilKnowledge(), "^physics: SoilKnowledge"), (bare, "^physics of sand: KeyError 'phi_rad'"),
        (dataclasses.replace(SINKS, effects=("slip_sinkage",)), "^physics of sand: .*expected soil and effects"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=said):
            database.add_physics("sand", given, source="x")
    for call in (database.merge, database.add_drive):
        with pytest.raises(InputError, match=r"^(other|drive): 'other.db'"):
            call("other.db")
