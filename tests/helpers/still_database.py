"""What a user does with a database that may only be read, in a process that is not root's."""

from __future__ import annotations

import tempfile
from pathlib import Path

from bevameter import InputError, TerrainDatabase
from bevameter.database.check import check
from bevameter.database.info import info
from bevameter.database.maintenance import migrate, prune, superseded
from bevameter.database.observations import Drive
from bevameter.database.rebuild import rebuild
from bevameter.framework.cli.main import app
from forked import as_nobody
from typer.testing import CliRunner


def read(folder: Path) -> tuple:
    """All that reads ``t.db`` and, of an older schema, ``old.db``."""
    path = folder / "t.db"
    CliRunner().invoke(app, ["db", "info", str(path)])  # imports what nobody else may read where root has Python
    as_nobody()
    with (
        tempfile.TemporaryDirectory() as elsewhere,
        TerrainDatabase(path, must_exist=True) as database,
        TerrainDatabase(f"{elsewhere}/new.db") as new,
    ):
        known = database.snapshot().along([[0.1, 0.1]]).known.tolist()
        added = new.merge(database).new
        faults = rebuild(path, f"{elsewhere}/again.db").faults
        status = CliRunner().invoke(app, ["db", "info", str(path)]).exit_code
        return (known, added, faults, len(superseded(database).drives), check(path).sound, info(path).sites[0].drives,
                info(folder / "old.db").schema, migrate(path).copy, check(folder / "old.db").sound, status)  # fmt: skip


def write(folder: Path, drive: Drive) -> list[tuple[int, str]]:
    """All that writes them, or beside them; gives exit statuses and what is said."""
    path, old, said = folder / "t.db", folder / "old.db", []
    CliRunner().invoke(app, ["db", "info", str(path)])
    CliRunner().invoke(app, ["db", "export", str(path), "/dev/null/x.csv"])
    as_nobody()
    with TerrainDatabase(path) as database, tempfile.TemporaryDirectory() as elsewhere:
        with TerrainDatabase(f"{elsewhere}/new.db") as other:
            other.add_drive(drive)
            for attempt in (
                lambda: database.add_drive(drive),
                lambda: database.merge(other),
                lambda: prune(database),
                lambda: migrate(old),
                lambda: TerrainDatabase(old, must_exist=True),
                lambda: TerrainDatabase(folder / "new.db"),
                lambda: rebuild(path, folder / "new.db"),
            ):
                try:
                    said.append((0, repr(attempt())))
                except InputError as error:
                    said.append((2, str(error)))
        for command in (
            ["merge", path, f"{elsewhere}/new.db"], ["prune", path, "--yes"], ["migrate", old],
            ["export", path, folder / "x.csv"],
        ):  # fmt: skip
            result = CliRunner().invoke(app, ["db", *map(str, command)])
            said.append((result.exit_code, result.stderr.rstrip("\n") + result.stdout))
    return said
