"""A vehicle's file and the fleet's server, over a link that may be cut at any byte."""

from __future__ import annotations

import contextlib
import random
import re
import signal
import socket
import sqlite3
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.database import merge as merge_module
from bevameter.database.check import check
from bevameter.database.info import info
from bevameter.database.snapshot import Snapshot
from bevameter.database.store import Added
from bevameter.framework.cli.main import app
from sqlalchemy import create_engine, make_url, text
from typer.testing import CliRunner

pytest.importorskip("psycopg")

TABLES = ("terrain_observation", "soil_observation", "drive_import", "drive", "class_physics")


class Link:
    """A TCP proxy before a PostgreSQL server, which breaks all connections once it has carried so many bytes."""

    def __init__(self, url: str) -> None:
        self._server = make_url(url)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._lock, self._sockets, self.carried, self._most = threading.Lock(), set(), 0, sys.maxsize
        options = {name: value for name, value in self._server.query.items() if name not in ("host", "port")}
        port = self._listener.getsockname()[1]
        through = self._server.set(host="127.0.0.1", port=port, query={**options, "sslmode": "disable"})
        self.url = through.render_as_string(hide_password=False)
        threading.Thread(target=self._accept, daemon=True).start()

    def cut_after(self, most: int = sys.maxsize) -> None:
        """Count from zero, and let no more than so many bytes through."""
        with self._lock:
            self.carried, self._most = 0, most

    def close(self) -> None:
        self._listener.close()
        self._break()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                server = self._connect()
                with self._lock:
                    self._sockets |= {client, server}
                for pair in ((client, server), (server, client)):
                    threading.Thread(target=self._carry, args=pair, daemon=True).start()

    def _connect(self) -> socket.socket:
        host = self._server.host or str(self._server.query["host"])
        port = self._server.port or int(str(self._server.query.get("port", 5432)))
        if not host.startswith("/"):
            return socket.create_connection((host, port))
        server = socket.socket(socket.AF_UNIX)
        server.connect(f"{host}/.s.PGSQL.{port}")
        return server

    def _carry(self, source: socket.socket, target: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                with self._lock:
                    allowed = data[: max(self._most - self.carried, 0)]
                    self.carried += len(allowed)
                target.sendall(allowed)
                if len(allowed) < len(data):
                    self._break()
                    return
            target.shutdown(socket.SHUT_WR)

    def _break(self) -> None:
        with self._lock:
            sockets, self._sockets = self._sockets, set()
        for each in sockets:
            with contextlib.suppress(OSError):
                if each.family == socket.AF_INET:
                    each.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                each.shutdown(socket.SHUT_RDWR)
            each.close()


@pytest.fixture
def link(server) -> Iterator[Link]:
    proxy = Link(server)
    yield proxy
    proxy.close()


@pytest.fixture
def portions(monkeypatch) -> None:
    """Portions so small that a drive of this test has several."""
    monkeypatch.setattr(merge_module, "PORTION", 120)
    monkeypatch.setattr(merge_module, "_PART", 30)


@pytest.fixture
def vehicle(tmp_path, make) -> Path:
    """A database with drives of 300, 1 and 0 looks, and soils."""
    path = tmp_path / "vehicle.db"
    with TerrainDatabase(path) as database:
        for digest, looks, stretches in (("d1", 300, 3), ("d2", 1, 1), ("d3", 0, 0)):
            cells = [(index % 20, index // 20) for index in range(looks)]
            terrain = make.seen(cells, [[0.25, 0.75]] * looks)
            soils = tuple(make.soil({"sand": 1.0}, 900.0 + at, at_s=10.0 * at) for at in range(stretches))
            database.add_drive(make.drive(digest, terrain, soils))
    return path


def content(url: str) -> dict[str, list]:
    """Every row of every table, whatever the database."""
    with TerrainDatabase(url, must_exist=True) as database, database.reading() as connection:
        return {
            name: sorted(map(repr, connection.execute(table.select()).all()))
            for name, table in merge_module.Base.metadata.tables.items()
        }


def emptied(url: str) -> None:
    engine = create_engine(make_url(url).set(drivername="postgresql+psycopg"))
    with engine.begin() as connection:
        connection.execute(text(f"TRUNCATE {', '.join(TABLES)}"))
    engine.dispose()


def same_snapshot(one: Snapshot, other: Snapshot) -> bool:
    same = [np.array_equal(getattr(one.cells, name), getattr(other.cells, name), equal_nan=True)
            for name in ("key", "probability", "seen_s", "looks")]  # fmt: skip
    return all(same) and set(one.soils) == set(other.soils) and one.drives == other.drives


def cuts(total: int, number: int) -> list[int]:
    """Bytes after which a link is cut: the edges, and as many others."""
    return [0, 1, total - 2, total - 1, *random.Random(4).sample(range(2, total - 2), number)]


@pytest.mark.parametrize("number", [6, pytest.param(40, marks=pytest.mark.slow)])
@pytest.mark.parametrize("direction", ["push", "pull"])
def test_a_link_that_is_cut_at_any_byte(server, link, vehicle, tmp_path, portions, direction, number):
    local = tmp_path / "local.db"
    with TerrainDatabase(vehicle) as database, TerrainDatabase(server) as fleet:
        drives = {drive.id: drive for drive in database.drives()}
        if direction == "pull":
            fleet.merge(database)
    whole = content(str(vehicle))
    destination = server if direction == "push" else str(local)

    def bring() -> Added:
        source, target = (vehicle, link.url) if direction == "push" else (link.url, local)
        with TerrainDatabase(source, must_exist=True) as one, TerrainDatabase(target) as other:
            return other.merge(one)

    def empty() -> None:
        emptied(server) if direction == "push" else local.unlink(missing_ok=True)

    bring()
    total, parts = link.carried, 0
    assert content(destination) == whole
    for most in cuts(total, number):
        empty()
        link.cut_after(most)
        try:
            bring()
            error = ""
        except InputError as caught:  # unless it was cut after the last statement
            error = str(caught)
        said = re.search(r"; (\d) of 3 drives are complete, the same again goes on from there", error)
        link.cut_after()
        with TerrainDatabase(destination) as database:
            database.make()  # the link may have been cut before
            complete = database.drives()
            view = database.snapshot()
        assert same_snapshot(view, Snapshot.derive(view.site, [drives[each.id] for each in complete]))
        assert said is None or int(said[1]) <= len(complete)
        assert "\n" not in error
        parts += info(destination).unfinished_drives
        bring()
        assert content(destination) == whole, f"cut after {most} of {total} bytes"
    assert check(destination).sound
    assert parts > 0  # of some cut a part of a drive was left, which nothing used


def test_what_is_there_already_is_not_sent_again(server, link, vehicle):
    with TerrainDatabase(vehicle) as database, TerrainDatabase(link.url) as fleet:
        link.cut_after()
        assert fleet.merge(database) == Added(305, 0)
        first = link.carried
        link.cut_after()
        assert fleet.merge(database) == Added(0, 305)
        assert link.carried < first / 10


def test_other_rows_that_are_lost_on_both_sides_are_brought_back_in_part(server, link, vehicle, portions):
    with TerrainDatabase(vehicle) as database, TerrainDatabase(link.url) as fleet:
        link.cut_after()
        fleet.merge(database)
        whole, first = content(server), link.carried
        with closing(sqlite3.connect(vehicle)) as connection, connection:
            connection.execute("DELETE FROM terrain_observation WHERE cell_x = 3 AND cell_y = 3")
        with fleet.writing() as connection:
            connection.execute(text("DELETE FROM terrain_observation WHERE cell_x = 4 AND cell_y = 4"))
        link.cut_after()
        assert fleet.merge(database) == Added(1, 303)
        assert link.carried < first / 2
        assert database.merge(fleet) == Added(1, 304)
    assert content(server) == content(str(vehicle)) == whole


def said(*arguments: str, status: int = 0) -> str:
    result = CliRunner().invoke(app, ["db", *map(str, arguments)])
    assert result.exit_code == status, result.output
    return result.stderr if status else result.stdout


def test_push_and_pull(server, link, vehicle, tmp_path, make):
    with TerrainDatabase(vehicle) as database:
        database.add_drive(make.drive("d4", site="beach"))
    with TerrainDatabase(server) as fleet:
        shown = fleet.name
    assert said("push", vehicle, server, "--site", "beach") == f"{shown}: 2 observations added, 0 known already\n"
    assert said("push", vehicle, server) == f"{shown}: 305 observations added, 2 known already\n"
    assert "no site 'moon' (expected one of beach, quarry)" in said("push", vehicle, server, "--site", "moon", status=2)
    local = tmp_path / "local.db"
    assert "no site 'moon'" in said("pull", local, server, "--site", "beach", "--site", "moon", status=2)
    assert not local.exists()
    assert said("pull", local, server, "--site", "beach") == f"{local}: 2 observations added, 0 known already\n"
    with TerrainDatabase(local, must_exist=True) as database:
        assert database.sites() == ["beach"]
    assert said("pull", local, server) == f"{local}: 305 observations added, 2 known already\n"
    assert content(str(local)) == content(str(vehicle))
    link.cut_after(0)
    assert len(said("push", vehicle, link.url, status=2).splitlines()) == 1


_PUSHING = """
import sys, time
from bevameter.database import merge
from bevameter.framework.cli.main import app

original = merge.insert_columns

def insert_columns(connection, row_type, columns):
    new = original(connection, row_type, columns)
    print("in a portion", flush=True)
    time.sleep(60)
    return new

merge.insert_columns = insert_columns
app(["--quiet", "db", "push", *sys.argv[1:]])
"""


def test_ctrl_c_is_one_line_and_the_same_command_goes_on(server, vehicle):
    command = [sys.executable, "-P", "-c", _PUSHING, str(vehicle), server]
    # a shell's background job ignores SIGINT, and so would what it starts
    listens = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=listens
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "in a portion\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (130, "bevameter: interrupted; what was stored is whole\n")
    assert "305 observations added, 0 known already" in said("push", vehicle, server)


def test_a_link_that_is_cut_in_a_portion_is_one_line(server, link, tmp_path, make):
    looks = make.seen([(index, 0) for index in range(2000)], [[0.5, 0.5]] * 2000)
    with TerrainDatabase(tmp_path / "large.db") as database, TerrainDatabase(server):
        database.add_drive(make.drive(terrain=looks))
    push = ["-m", "bevameter.framework.cli.main", "db", "push", str(tmp_path / "large.db"), link.url]
    link.cut_after(60_000)  # of 250,000
    cut = subprocess.run([sys.executable, "-P", *push], capture_output=True, text=True)
    assert (cut.returncode, len(cut.stderr.splitlines())) == (2, 1), cut.stderr
    assert "; 0 of 1 drives are complete" in cut.stderr


def test_two_vehicles_that_push_the_same_at_a_time(server, vehicle, portions):
    added: list[Added] = []

    def push() -> None:
        with TerrainDatabase(vehicle, must_exist=True) as database, TerrainDatabase(server) as fleet:
            added.append(fleet.merge(database))

    TerrainDatabase(server).make()
    both = [threading.Thread(target=push) for _ in range(2)]
    for each in both:
        each.start()
    for each in both:
        each.join(60)
    assert sum(each.new for each in added) == 305
    assert content(server) == content(str(vehicle))
