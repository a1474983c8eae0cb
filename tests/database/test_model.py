"""Two databases, driven at random by Hypothesis, hold what two dictionaries hold."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from uuid import UUID

import pytest
from bevameter import TerrainDatabase
from bevameter.database.check import check
from bevameter.database.maintenance import prune as remove_superseded
from bevameter.database.observations import Drive
from bevameter.database.store import Added
from bevameter.database.tables import Base
from bevameter.database.urls import parse_url
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.pooling import cells_from_keys
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import AugmentedSimulator
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test
from killed import picture
from sqlalchemy import create_engine

FOUND = datetime(2026, 11, 2, 9, 0, tzinfo=UTC)
RECORDINGS, METHODS, SITES, HOURS = range(3), range(2), ("beach", "quarry"), range(3)
CLASSES = ({"clay": 0.75, "sand": 0.25}, {"grass": 1.0}, {"clay": 0.5, "grass": 0.25, "sand": 0.25})
WHICH = st.integers(0, 1)


@dataclass
class Model:
    """What a database holds: drives by identity, and by identity when each was imported; physics by its key."""

    drives: dict[UUID, Drive] = field(default_factory=dict)
    imports: dict[UUID, set[int]] = field(default_factory=dict)
    physics: set[tuple[str, str, int]] = field(default_factory=set)

    def in_order(self) -> list[UUID]:
        return sorted(self.drives, key=lambda each: (max(self.imports[each]), each))

    def newest(self) -> list[Drive]:
        ordered = [self.drives[each] for each in self.in_order()]
        last = {drive.recording_digest: drive.id for drive in ordered}
        return [drive for drive in ordered if last[drive.recording_digest] == drive.id]

    def add(self, drive: Drive, moment: int) -> int:
        if drive.id not in self.drives:
            self.drives[drive.id], self.imports[drive.id] = drive, {moment}
            return len(drive.terrain) + len(drive.soils)
        if drive.id not in {each.id for each in self.newest()}:
            self.imports[drive.id].add(moment)
        return 0

    def merge(self, other: Model) -> None:
        for identity, drive in other.drives.items():
            self.drives[identity] = drive
            self.imports[identity] = self.imports.get(identity, set()) | other.imports[identity]
        self.physics |= other.physics

    def prune(self) -> None:
        kept = {each.id for each in self.newest()}
        self.drives = {key: each for key, each in self.drives.items() if key in kept}
        self.imports = {key: each for key, each in self.imports.items() if key in kept}
        self.physics = set(self.newest_physics().values())

    def newest_physics(self) -> dict[tuple[str, str], tuple[str, str, int]]:
        return {(name, site): (name, site, hour) for name, site, hour in sorted(self.physics)}


def physics(hour: int) -> AugmentedSimulator:
    values = dict(zip(PARAMETERS, (700.0 + hour, 0.5, 0.02, 4e5, 0.9), strict=True))
    return AugmentedSimulator({name: Estimate(value, 0.0) for name, value in values.items()})


def machine(make, places: tuple[str, str], clear):
    """Give the state machine over two databases, which `clear` empties."""

    class TwoDatabases(RuleBasedStateMachine):
        @initialize()
        def begin(self) -> None:
            clear()
            self.databases = [TerrainDatabase(place) for place in places]
            self.models = [Model(), Model()]
            self.moment = 0

        def teardown(self) -> None:
            for place, model in zip(places, self.models, strict=True):
                assert check(place).sound
                assert check(place).rows["drive"] == len(model.drives)
            for each in self.databases:
                each.close()

        @rule(which=WHICH, recording=st.sampled_from(RECORDINGS), method=st.sampled_from(METHODS),
              site=st.sampled_from(SITES))  # fmt: skip
        def add_drive(self, which, recording, method, site) -> None:
            classes = CLASSES[(recording + method) % 3]
            looks = make.seen(
                [(recording, method), (recording, 9)], [list(classes.values())] * 2, classes=tuple(classes)
            )
            soils = (make.soil({next(iter(classes)): 1.0}, 900.0 + method),)
            drive = make.drive(f"r{recording}", looks, soils, site=site, model=f"m{method}")
            self.moment += 1
            new = self.models[which].add(drive, self.moment)
            assert self.databases[which].add_drive(drive) == Added(new, 3 - new)

        @rule(which=WHICH, name=st.sampled_from(("clay", "grass")), site=st.sampled_from(("", "quarry")),
              hour=st.sampled_from(HOURS))  # fmt: skip
        def add_physics(self, which, name, site, hour) -> None:
            new = (name, site, hour) not in self.models[which].physics
            self.models[which].physics.add((name, site, hour))
            added = self.databases[which].add_physics(
                name, physics(hour), source="x", time=FOUND + timedelta(hours=hour), site=site
            )
            assert added == Added(int(new), int(not new))

        @rule(which=WHICH)
        def merge(self, which) -> None:
            mine, other = self.models[which], self.models[1 - which]
            new = 3 * len(other.drives.keys() - mine.drives.keys()) + len(other.physics - mine.physics)
            total = 3 * len(other.drives) + len(other.physics)
            mine.merge(other)
            assert self.databases[which].merge(self.databases[1 - which]) == Added(new, total - new)

        @rule(which=WHICH)
        def prune(self, which) -> None:
            model = self.models[which]
            drives, found = len(model.drives), len(model.physics)
            model.prune()
            removed = remove_superseded(self.databases[which])
            assert (len(removed.drives), len(removed.physics)) == (
                drives - len(model.drives), found - len(model.physics),
            )  # fmt: skip

        @rule(which=WHICH)
        def reopen(self, which) -> None:
            self.databases[which].close()
            self.databases[which] = TerrainDatabase(places[which], must_exist=True)

        @invariant()
        def holds_what_the_model_holds(self) -> None:
            for database, model in zip(self.databases, self.models, strict=True):
                newest = model.newest()
                assert [picture(each) for each in database.drives()] == [
                    picture(model.drives[each]) for each in model.in_order()
                ]
                assert [each.id for each in database.drives(newest=True)] == [each.id for each in newest]
                assert database.sites() == sorted({each.site for each in newest})
                found = {(each.class_name, each.site, each.observed_at) for each in database.physics()}
                assert found == {(name, site, FOUND + timedelta(hours=hour)) for name, site, hour in model.physics}
                for site in database.sites():
                    self.check_snapshot(database.snapshot(site), [each for each in newest if each.site == site], model)

        def check_snapshot(self, view, drives, model) -> None:
            assert view.drives == len(drives)
            assert set(view.class_names) == {name for each in drives for name in each.terrain.evidence.classes}
            looks = [each.terrain for each in drives]
            cells = {cell for each in looks for cell in zip(each.cell_x, each.cell_y, strict=True)}
            assert {tuple(cell) for cell in cells_from_keys(view.cells.key)} == cells
            assert sum(soil.stretches for soil in view.soils.values()) == len(drives)
            last = {name: hour for hour, name, site in sorted((h, n, s) for n, s, h in model.physics)
                    if site in ("", view.site)}  # fmt: skip
            assert {name: each.soil["c_Pa"].value for name, each in view.physics.items()} == {
                name: 700.0 + hour for name, hour in last.items()
            }

        @rule(which=WHICH, data=st.data())
        def read_one(self, which, data) -> None:
            model, unknown = self.models[which], UUID(int=0)
            identity = data.draw(st.sampled_from([unknown, *model.in_order()]))
            found = self.databases[which].drive(identity)
            assert (found and picture(found)) == (picture(model.drives[identity]) if identity != unknown else None)

    return TwoDatabases


FEW = settings(max_examples=6, stateful_step_count=8, deadline=None)
MANY = settings(max_examples=150, stateful_step_count=30, deadline=None)
SUITES = pytest.mark.parametrize("extent", [FEW, pytest.param(MANY, marks=pytest.mark.slow)], ids=["few", "many"])


@SUITES
def test_two_files(extent, tmp_path, make):
    places = (str(tmp_path / "a.db"), str(tmp_path / "b.db"))
    TerrainDatabase(tmp_path / "empty").make()

    def clear() -> None:
        for place in places:
            shutil.copy(tmp_path / "empty", place)

    run_state_machine_as_test(machine(make, places, clear), settings=extent)


@SUITES
def test_a_file_and_a_server(extent, tmp_path, server, make):
    TerrainDatabase(tmp_path / "empty").make()
    TerrainDatabase(server).make()
    engine = create_engine(parse_url(server))

    def clear() -> None:
        shutil.copy(tmp_path / "empty", tmp_path / "a.db")
        with engine.begin() as connection:
            for table in reversed(Base.metadata.sorted_tables):
                connection.execute(table.delete())

    run_state_machine_as_test(machine(make, (str(tmp_path / "a.db"), server), clear), settings=extent)
    engine.dispose()
