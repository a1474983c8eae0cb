"""Processes that read and write one database at the same time."""

from __future__ import annotations

import dataclasses
import random
import time
from multiprocessing.connection import Connection

from bevameter import TerrainDatabase
from bevameter.database.maintenance import prune
from killed import drive

LOOKS = 20


def write(connection: Connection, place: str, seed: int, seconds: float) -> None:
    """Add drives, process recordings again, and remove what that replaced; say how many drives were added, or why
    not.
    """
    rng, number, added, end = random.Random(seed), 1000 * seed, 0, time.monotonic() + seconds
    try:
        while not added or time.monotonic() < end:
            number += 1
            for method in ("m", "again")[: rng.choice((1, 2))]:
                with TerrainDatabase(place) as database:
                    assert database.add_drive(dataclasses.replace(drive(number, LOOKS), method=method)).new
                added += 1
            if rng.random() < 0.3:
                with TerrainDatabase(place) as database:
                    prune(database)
            time.sleep(rng.uniform(0.0, 0.05))
        connection.send((added, ""))
    except Exception as error:
        connection.send((added, f"{type(error).__name__}: {error}"))


def read(connection: Connection, place: str, seed: int, seconds: float) -> None:
    """Take snapshots and drives; say how many, or what was wrong with one."""
    rng, taken, recordings, end = random.Random(seed), 0, 0, time.monotonic() + seconds
    try:
        database = TerrainDatabase(place, must_exist=True)
        while not taken or time.monotonic() < end:
            if rng.random() < 0.5:
                database = TerrainDatabase(place, must_exist=True)
            snapshot, drives = database.snapshot(), database.drives(newest=True)
            partial = [each.name for each in drives if (len(each.terrain), len(each.soils)) != (LOOKS, 3)]
            assert not partial, f"parts of {partial} only"
            assert recordings <= snapshot.drives <= len(drives), (recordings, snapshot.drives, len(drives))
            recordings = len(drives)
            taken += 2
        connection.send((taken, ""))
    except Exception as error:
        connection.send((taken, f"{type(error).__name__}: {error}"))
