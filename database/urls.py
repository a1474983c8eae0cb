"""Which database a path or URL means, how it is named for people, and what is said where it does not answer."""

from __future__ import annotations

import os
from pathlib import Path

from sqlalchemy import URL, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, IntegrityError, ProgrammingError, SQLAlchemyError

from ..framework.core.arguments import shown as shown_value
from ..framework.core.errors import InputError


class Unreachable(InputError):
    """A terrain database whose answer is an error, or that does not answer any more."""


def parse_url(url_or_path: str | Path) -> URL:
    """Turn a path or an SQLAlchemy URL into a URL of a database that is supported.

    Raises
    ------
    InputError
        It is no URL, or names a kind of database that is neither SQLite in a file nor PostgreSQL.
    """
    if not isinstance(url_or_path, str | os.PathLike | URL):
        raise InputError("database", f"{url_or_path!r:.80}", expected="a path or an SQLAlchemy URL")
    given = str(url_or_path)
    if "\0" in given:
        raise InputError(
            "database", shown_value(given), expected="a path or an SQLAlchemy URL, without zero characters"
        )
    if "://" not in given:
        if not given.strip():
            raise InputError("database", "an empty path", expected="a path or an SQLAlchemy URL")
        return URL.create("sqlite+pysqlite", database=given)
    try:
        url = make_url(given)
        backend = url.get_backend_name()
    except (ArgumentError, ValueError):
        raise InputError("database", "not a URL", expected="sqlite:///FILE or postgresql://...") from None
    if backend == "sqlite":
        if not url.database or url.database == ":memory:" or url.database.startswith("file:"):
            raise InputError(given, "no file is named", expected="sqlite:///FILE, which outlives the program")
        _check_options(url)
        return url.set(drivername="sqlite+pysqlite")
    if backend == "postgresql":
        return url.set(drivername="postgresql+psycopg")
    raise InputError("database", f"{backend!r}", expected="sqlite:///FILE or postgresql://...")


def _check_options(url: URL) -> None:
    """Refuse options of an SQLite URL that are of the wrong kind, before any work is done."""
    try:
        url.get_dialect()().create_connect_args(url)
    except (SQLAlchemyError, TypeError, ValueError) as error:
        raise InputError(str(url), f"an option that cannot be read: {error}", expected="sqlite:///FILE") from None


def shown(url: URL) -> str:
    """Name the database for people: the file's path, or the URL without its password."""
    if url.get_backend_name() == "sqlite":
        return str(url.database)
    secret = {name: "***" for name in url.query if "password" in name.lower()}
    return url.update_query_dict(secret).render_as_string(hide_password=True)


def unreachable(url: URL, error: BaseException) -> Unreachable:
    """Say in one line why the database does not answer."""
    cause = str(error.orig if isinstance(error, DBAPIError) else error)
    said = cause.strip().splitlines()[0] if cause.strip() else type(error).__name__
    state = "is sound" if isinstance(error, IntegrityError | ProgrammingError) else "can be reached"
    return Unreachable(shown(url), said, expected=f"a terrain database that {state}")
