"""Functions of tests in processes of their own, which begin within milliseconds: they are forked from one process that
has imported what they need, and has one thread.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

IMPORTED = [
    "alembic.command",
    "alembic.config",
    "bevameter.database.check",
    "bevameter.database.exports",
    "bevameter.database.info",
    "bevameter.database.maintenance",
    "bevameter.database.rebuild",
    "bevameter.database.store",
    "bevameter.identification.effects.stored",
    "sqlalchemy.dialects.sqlite",
]

PATIENCE_S = 120.0
"""How long a child may say nothing [s]."""


def forked(function: Callable[..., Any], *arguments: Any) -> tuple[BaseProcess, Connection]:
    """Run ``function(connection, *arguments)`` in another process; give it, and the other end of the connection."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(IMPORTED)
    here, there = context.Pipe()
    process = context.Process(target=function, args=(there, *arguments), daemon=True)
    process.start()
    there.close()
    return process, here


def heard(connection: Connection) -> Any:
    """Give what a child says next; raises EOFError where it ended."""
    assert connection.poll(PATIENCE_S), "the child says nothing"
    return connection.recv()


def all_heard(connection: Connection) -> Iterator[Any]:
    """Give what a child that ended has said."""
    while True:
        try:
            yield heard(connection)
        except (EOFError, ConnectionResetError):
            return


def answer(function: Callable[..., Any], *arguments: Any) -> Any:
    """Give what a function returns in another process; what it raises is raised here."""
    process, connection = forked(_answering, function, arguments)
    try:
        result, error = heard(connection)
    finally:
        process.kill()
        process.join()
        connection.close()
    if error is not None:
        raise error
    return result


def _answering(connection: Connection, function: Callable[..., Any], arguments: tuple) -> None:
    try:
        connection.send((function(*arguments), None))
    except Exception as error:
        connection.send((None, error))


def as_nobody() -> None:
    """Give up root, who may write anywhere; others are who they are."""
    if os.geteuid() == 0:
        os.setgroups([])
        os.setgid(65534)
        os.setuid(65534)
