"""A drive that is handed over sample by sample, left, resumed or killed, against `run_traverse`."""

from __future__ import annotations

import random

import pytest
from bevameter import InputError, LiveTraverse, TerrainDatabase
from bevameter.framework.live.journal import unfinished
from forked import forked, heard
from live_drive import drive_on, replay
from live_drives import assert_same, begun, rover


@pytest.fixture(scope="module")
def replayed(driven):
    return driven[:2]


def test_a_replay_gives_the_observations_of_a_run(stored_drive, replayed):
    (one, summary), (other, again) = stored_drive, replayed
    assert len(one.terrain) > 300
    assert other.id == one.id
    assert_same(one, other)
    for a, b in zip(summary.senses, again.senses, strict=True):
        assert (a.absent, a.items, dict(a.said), dict(a.closed)) == (b.absent, b.items, dict(b.said), dict(b.closed))
    assert again.problems == summary.problems
    assert again.track_m == pytest.approx(summary.track_m)


@pytest.fixture(scope="module")
def resumed(live_recording, small_models, tmp_path_factory):
    """The drive that was left on its way, and resumed."""
    path = tmp_path_factory.mktemp("resumed") / "t.db"
    live = begun(live_recording, small_models, path)
    replay(live_recording, live, to_s=34.0)
    live.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    again = begun(live_recording, small_models, path, resume=live.journal)
    assert 30.0 < again.needed_s < 34.0
    replay(live_recording, again, from_s=again.needed_s)
    assert again.problems == ()  # what was taken before, and is handed over once more, is not late
    again.close(live_recording.digest)
    assert not live.journal.exists()
    with TerrainDatabase(path) as database:
        return database.drives()[0]


def test_a_drive_that_was_left_and_resumed_is_that_of_a_run(stored_drive, resumed):
    assert resumed.id == stored_drive[0].id
    assert_same(stored_drive[0], resumed)


def test_journals_of_other_drives_are_named_and_not_mixed_up(tmp_path):
    path = tmp_path / "t.db"
    first = LiveTraverse(path, rover(), site="field")
    first.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert unfinished(path) == (first.journal,)
    second = LiveTraverse(path, rover(), site="field")
    assert str(first.journal) in second.problems[0]
    with pytest.raises(InputError, match="locked"):
        LiveTraverse(path, rover(), site="field", resume=second.journal)
    with pytest.raises(InputError, match="a drive of another cell_size_m"):
        LiveTraverse(path, rover(), site="field", resume=first.journal, cell_size_m=0.4)
    with pytest.raises(InputError, match="no such file"):
        LiveTraverse(path, rover(), site="field", resume=tmp_path / "none")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_drive_that_is_killed_again_and_again_is_that_of_a_run_in_the_end(
    stored_drive, short_drive, small_models, tmp_path, seed
):
    path, rng, kills = tmp_path / "t.db", random.Random(seed), 0
    while True:
        process, connection = forked(drive_on, short_drive, small_models, path)
        assert heard(connection) == "begins"
        if connection.poll(rng.uniform(1.0, 4.0) if kills < 3 else 120.0):
            assert heard(connection) == "stored"
            break
        process.kill()
        process.join()
        kills += 1
    assert kills
    assert unfinished(path) == ()
    with TerrainDatabase(path) as database:
        (drive,) = database.drives()
    assert drive.id == stored_drive[0].id
    assert_same(stored_drive[0], drive)
