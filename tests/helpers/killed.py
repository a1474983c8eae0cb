"""Work on databases that is killed half way, and what has to hold of a database then."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
from bevameter import ClassEvidence, TerrainDatabase
from bevameter.database import drive_rows
from bevameter.database.maintenance import migrate
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from forked import all_heard, forked, heard

BEGINS, ENDS = "begins", "ends"


def drive(number: int, looks: int = 60, site: str = "quarry") -> Drive:
    """A drive like no other, of a few chunks of rows."""
    rng = np.random.default_rng(number)
    share = rng.integers(0, 257, looks) / 256  # as float32 has them
    evidence = ClassEvidence(
        ("clay", "sand"), np.column_stack([share, 1 - share]), np.ones(looks), np.zeros(looks, bool), ((),) * looks
    )
    cells = rng.integers(-500, 500, (2, looks))
    terrain = TerrainObservations(0.5, *cells, np.arange(looks) / 10, np.full(looks, "fused"), evidence)
    soils = tuple(
        SoilObservation(float(at), at + 1.0, 0.0, 0.0, {"sand": 1.0}, None, (1e3, 2e3), 80.0, gate_reason="too fast")
        for at in range(3)
    )
    return Drive(f"recording {number}", f"drive {number}", site, "rover", None, {}, "m", terrain, soils)


def picture(drive: Drive) -> str:
    """All that a drive holds."""
    terrain, evidence = drive.terrain, drive.terrain.evidence
    columns = (terrain.cell_x, terrain.cell_y, terrain.time_s, terrain.sense, evidence.probabilities, evidence.quality)
    return repr((drive.id, drive.name, drive.site, evidence.classes, [each.tolist() for each in columns], drive.soils))


def pictures(drives: Sequence[Drive]) -> dict[UUID, str]:
    """All that drives hold, by identity."""
    return {each.id: picture(each) for each in drives}


def smaller_chunks() -> None:
    """Write rows a few at a time, so that there is a middle of a drive to be killed in."""
    drive_rows.CHUNK = 20


def add_drives(connection: Connection, place: str, drives: Sequence[Drive]) -> None:
    """Add drives, and say of each when it is stored."""
    smaller_chunks()
    connection.send(BEGINS)
    for each in drives:
        with TerrainDatabase(place) as database:
            database.add_drive(each)
        connection.send(each.id)
    connection.send(ENDS)


def merge(connection: Connection, place: str, other: str) -> None:
    """Merge a database into another."""
    smaller_chunks()
    connection.send(BEGINS)
    with TerrainDatabase(place) as database, TerrainDatabase(other, must_exist=True) as source:
        database.merge(source, progress=lambda stage, share: connection.send(share))
    connection.send(ENDS)


def bring_up_to_date(connection: Connection, place: str) -> None:
    """Migrate a database, or make one."""
    connection.send(BEGINS)
    if Path(place).exists():
        migrate(place)
    else:
        TerrainDatabase(place).make()
    connection.send(ENDS)


def pace(work: Callable[..., None], *arguments: Any) -> tuple[int, float]:
    """How many things work says that nobody disturbs, and how long it takes from one to the next [s]."""
    process, connection = forked(work, *arguments)
    assert heard(connection) == BEGINS
    began = time.perf_counter()
    said = list(all_heard(connection))
    assert said[-1] == ENDS
    process.join()
    connection.close()
    return len(said), (time.perf_counter() - began) / len(said)


def kill(rng: random.Random, paced: tuple[int, float], work: Callable[..., None], *arguments: Any) -> list[Any]:
    """Kill work at a random moment: some time after one of the things that it says. Give what it said."""
    count, longest_s = paced
    process, connection = forked(work, *arguments)
    assert heard(connection) == BEGINS
    said = [heard(connection) for _ in range(rng.randrange(count))]
    time.sleep(rng.uniform(0.0, 1.3 * longest_s))
    process.kill()
    process.join()
    said += all_heard(connection)
    connection.close()
    return said


def check_whole(place: str | Path, whole: Mapping[UUID, str], least: set[UUID]) -> set[UUID]:
    """Say which drives a database holds: whole ones only, with those at least."""
    with TerrainDatabase(place, must_exist=True) as database:
        found = pictures(database.drives())
        assert database.snapshot().drives == len(found)
    for identity, content in found.items():
        assert content == whole[identity], "a part of a drive is there"
    assert least <= found.keys(), "what was acknowledged is lost"
    return set(found)
