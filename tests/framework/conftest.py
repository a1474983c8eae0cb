"""A drive that several tests look at: as a run stores it, and as it is driven."""

from __future__ import annotations

import time

import pytest
from bevameter import TerrainDatabase, read_recording, run_traverse
from live_drive import out_of_order, samples
from live_drives import Seen, begun, wait_for_soil


@pytest.fixture(scope="session")
def live_recording(short_drive):
    return read_recording(short_drive)


@pytest.fixture(scope="session")
def stored_drive(live_recording, small_models, tmp_path_factory):
    """The drive that `run_traverse` stores, and its summary."""
    path = tmp_path_factory.mktemp("run") / "t.db"
    summary = run_traverse(live_recording, path, models=small_models)
    with TerrainDatabase(path) as database:
        return database.drives()[0], summary


@pytest.fixture(scope="session")
def driven(live_recording, small_models, tmp_path_factory):
    """The drive that `LiveTraverse` stores, its summary, and what it said on the way; samples come up to 40 ms late."""
    path, seen = tmp_path_factory.mktemp("live") / "t.db", Seen()
    live = begun(live_recording, small_models, path)
    live.subscribe(seen.events.append)
    for number, hand_over in enumerate(out_of_order(samples(live_recording), 0.04)):
        hand_over(live)
        if number % 200 == 199:
            wait_for_soil(live)
            seen.ahead.append(live.ahead())
            seen.trust.append(live.trust())
            seen.soils.append(live.soil())
            live.snapshot()
    until = time.monotonic() + 20.0
    while len(live.snapshot().soils) < 2 and time.monotonic() < until:  # they are identified in a thread
        time.sleep(0.1)
    seen.soils_on_the_way = live.snapshot().soils
    assert live.problems == ()
    summary = live.close(live_recording.digest)
    seen.snapshot = live.snapshot()
    with TerrainDatabase(path) as database:
        return database.drives()[0], summary, seen, database.snapshot()
