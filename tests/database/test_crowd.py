"""Eight readers and two writers on one database: no error reaches a user, and what is read is whole."""

from __future__ import annotations

import os

import crowd
import pytest
from bevameter import TerrainDatabase
from bevameter.database.check import check
from forked import forked, heard
from killed import drive

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX forks")


@pytest.mark.parametrize("seconds", [3.0, pytest.param(60.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["sqlite", "postgresql"])
def test_readers_and_writers(kind, seconds, tmp_path, request):
    place = str(tmp_path / "t.db") if kind == "sqlite" else request.getfixturevalue("server")
    with TerrainDatabase(place) as database:
        database.add_drive(drive(0, crowd.LOOKS))
    readers = [forked(crowd.read, place, seed, seconds) for seed in range(1, 9)]
    writers = [forked(crowd.write, place, seed, seconds) for seed in range(1, 3)]
    read, written = ([heard(connection) for _, connection in each] for each in (readers, writers))
    for process, connection in readers + writers:
        process.join()
        connection.close()
    print(f"{kind}, {seconds:g} s: {sum(n for n, _ in read)} reads, {sum(n for n, _ in written)} drives")
    assert [problem for _, problem in read + written if problem] == []
    assert min(n for n, _ in read + written) > 0
    assert check(place).sound
