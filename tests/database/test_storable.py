"""A drive that one database would refuse, or that nobody could read back, is refused by all."""

from __future__ import annotations

import dataclasses
import math
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database.observations import SoilEffect
from bevameter.database.storable import LONGEST_SITE
from bevameter.framework.core.findings import note

FIELDS = ("recording_digest", "name", "site", "vehicle_name", "method")


def spoilt(make, **changes):
    return dataclasses.replace(make.drive(soils=(make.soil({"sand": 1.0}),)), **changes)


def with_soil(make, **changes):
    return make.drive(soils=(dataclasses.replace(make.soil({"sand": 1.0}), **changes),))


def with_estimate(make, **changes):
    return with_soil(make, estimate=dataclasses.replace(make.estimate(), **changes))


def refuse(path, drive, said: str) -> None:
    with TerrainDatabase(path) as database:
        with pytest.raises(InputError, match=said) as caught:
            database.add_drive(drive)
        assert database.drives() == []
    assert "\n" not in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("text", ["a\0b", "half \ud800 of a letter"])
def test_text_that_some_database_refuses(tmp_path, make, text):
    path = tmp_path / "t.db"
    for name in FIELDS:
        refuse(path, spoilt(make, **{name: text}), f"{name}: 'a.x00b'|{name}: 'half .ud800")
    looks = make.seen([(0, 0)], [[0.5, 0.5]], reasons=[("dark", text)])
    refuse(path, spoilt(make, terrain=looks), "reasons: ")
    refuse(path, spoilt(make, models={"camera": text}), "models: ")
    refuse(path, with_soil(make, gate_reason=text), "soil from 0.0 s to 5.0 s, gate_reason: ")
    refuse(path, with_soil(make, effects=(SoilEffect(text, {}),)), "effects: ")
    refuse(path, with_estimate(make, advice=text), "estimate: ")
    refuse(path, with_estimate(make, findings=(note("x", of=[text]),)), "estimate: ")


def test_what_is_no_text_or_too_long(tmp_path, make):
    path = tmp_path / "t.db"
    for name in FIELDS:
        refuse(path, spoilt(make, **{name: 7}), f"{name}: 7 .expected text")
    refuse(path, spoilt(make, models={"camera": 1}), "models: 1")
    refuse(path, spoilt(make, models=None), "models: None")
    refuse(path, spoilt(make, recording_digest="0" * 129), "recording_digest: 129 letters .expected 128")
    refuse(path, spoilt(make, site="x" * (LONGEST_SITE + 1)), "site: 201 letters")


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_numbers_that_json_does_not_have(tmp_path, make, value):
    refuse(tmp_path / "t.db", with_soil(make, effects=(SoilEffect("slip_sinkage", {"n1": value}),)), "effects: ")
    with TerrainDatabase(tmp_path / "t.db") as database:  # of a finding it is one that is not known
        database.add_drive(with_estimate(make, findings=(note("x", value=value),)))
        assert database.drives()[0].soils[0].estimate.findings == (note("x", value=None),)


@pytest.mark.parametrize("mean", [[math.inf, 0.5], [1e9, 0.5], [500.0, -0.1], [500.0, math.inf]])
def test_an_estimate_that_no_snapshot_would_read(tmp_path, make, mean):
    refuse(tmp_path / "t.db", with_estimate(make, mean_c_tan_phi=np.array(mean)), "soil from 0.0 s.*of no soil")


@pytest.mark.parametrize(
    "start",
    [
        "yesterday",
        datetime(1, 1, 1, tzinfo=timezone(timedelta(hours=5))),
        datetime(9999, 12, 31, 23, tzinfo=timezone(timedelta(hours=-5))),
    ],
)
def test_a_start_that_is_no_time_in_utc(tmp_path, make, start):
    refuse(tmp_path / "t.db", spoilt(make, start_time=start), "start_time: .*expected a time of the years 1 to 9999")


@pytest.mark.parametrize("cell", [2**31, -(2**31), 2**63 - 1, -(2**63), 2**63, 2**64 - 1])
def test_cells_that_a_column_does_not_hold(make, cell):
    looks = make.seen([(0, 0)], [[0.5, 0.5]])
    with pytest.raises(ValueError, match="cell_x must be whole numbers"):
        dataclasses.replace(looks, cell_x=np.array([cell]))


def test_strange_text_comes_back_from_both_databases(tmp_path, server, make):
    text = "Sables d'Olonne \U0001f3d6 \u202e%s :x 'q' \"p\" \\ ; --"
    start = datetime(1, 1, 1, tzinfo=UTC)
    given = dataclasses.replace(
        spoilt(make, name=text, site=(text * 5)[:LONGEST_SITE], vehicle_name=text, method=text, models={text: text}),
        recording_digest="\U0001f3d6" * 128,
        terrain=make.seen([(0, 0)], [[0.5, 0.5]], classes=("clay", text), reasons=[(text,)]),
        soils=(dataclasses.replace(make.soil({text: 1.0}), gate_reason=text),),
        start_time=start,
    )
    for place in (tmp_path / "t.db", server):
        with TerrainDatabase(place) as database:
            database.add_drive(given)
            (read,) = database.drives()
        assert read.id == given.id
        assert read.started == start
        assert read.terrain.evidence.reasons == ((text,),)
        assert read.soils[0].gate_reason == text
