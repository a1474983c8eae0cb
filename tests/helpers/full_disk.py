"""What a user does with databases on a disk that is full."""

from __future__ import annotations

import resource
from collections.abc import Sequence
from pathlib import Path

from bevameter import InputError, TerrainDatabase
from bevameter.database.maintenance import migrate, prune
from bevameter.database.observations import Drive
from bevameter.database.rebuild import rebuild
from bevameter.framework.cli.main import app
from typer.testing import CliRunner


def attempt(folder: Path, other: Path, drives: Sequence[Drive], most_bytes: int | None = None) -> dict[str, str]:
    """Read and write databases; give what each attempt says, nothing where it is done.

    ``t.db`` is to be read and written, ``old.db`` is of an older schema, `other` is merged and lies elsewhere. No file
    of this process gets longer than `most_bytes`.
    """
    if most_bytes is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))
    path, old = folder / "t.db", folder / "old.db"
    said = {}
    with TerrainDatabase(path) as database, TerrainDatabase(other, must_exist=True) as source:
        attempts = {
            "read": lambda: database.snapshot().drives,
            "add": lambda: [database.add_drive(each) for each in drives],
            "merge": lambda: database.merge(source),
            "prune": lambda: prune(database),
            "migrate": lambda: migrate(old),
            "open": lambda: TerrainDatabase(old, must_exist=True),
            "rebuild": lambda: rebuild(other, folder / "rebuilt.db"),
            "make": lambda: TerrainDatabase(folder / "new.db"),
        }
        for name, work in attempts.items():
            try:
                work()
                said[name] = ""
            except InputError as error:
                said[name] = str(error)
    commands = [["export", other, folder / f"x.{kind}"] for kind in ("csv", "parquet", "geojson", "mcap")]
    for command in ["merge", path, other], *commands:
        result = CliRunner().invoke(app, ["db", *map(str, command)])
        assert result.exit_code == (2 if result.stderr else 0), (command, result.stderr, result.exception)
        said[f"{command[0]} {command[2]}"] = result.stderr.rstrip("\n")
    return said
