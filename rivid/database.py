"""Logs from a database, and results into one, by SQLAlchemy (``rivid[database]``)."""

import csv
import datetime as dt
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rivid.errors import ConfigError, DataError, RividError
from rivid.types import ONE_DAY

if TYPE_CHECKING:
    import pandas as pd
    import sqlalchemy as sa

KEYS = ("reach", "date", "estimator")
"""Keys of a row of the table of delays; where a day has several data sets, `start` is another."""
CHUNK = 5_000
"""Rows sent at once."""


@contextmanager
def connected(url: str) -> "Iterator[sa.Connection]":
    """A transaction; ``$NAME`` in the URL stands for a variable of the environment.

    ConfigError where SQLAlchemy or the driver is not installed, or the URL is none; DataError where the
    database refuses, in its words.
    """
    try:
        import sqlalchemy as sa
    except ModuleNotFoundError:
        raise ConfigError("a database needs SQLAlchemy: pip install 'rivid[database]'") from None
    try:
        engine = sa.create_engine(os.path.expandvars(url))
    except (sa.exc.ArgumentError, ModuleNotFoundError, ValueError) as error:
        raise ConfigError(
            f"database URL {_hidden(url)}: {error}; expected one like postgresql+psycopg://user@host/name or "
            "sqlite:///file.db, with its driver installed"
        ) from None
    try:
        with engine.begin() as connection:
            yield connection
    except sa.exc.SQLAlchemyError as error:
        first = str(getattr(error, "orig", None) or error).strip().splitlines()[0]
        raise DataError(f"database {_hidden(url)}: {first}") from None
    finally:
        engine.dispose()


def _hidden(url: str) -> str:
    """The URL without a password."""
    scheme, _, rest = url.partition("://")
    user, at, place = rest.rpartition("@")
    return f"{scheme}://{user.partition(':')[0]}{at}{place}"


def queried(url: str, query: str, first: dt.date | None, last: dt.date | None) -> bytes:
    """The rows of a query, in SQL, as a table in CSV, UTF-8.

    ``:first`` and ``:last`` in it stand for the day before `first` and the second day after `last`, at
    midnight: the rows of these local days, by default all, lie between them in any zone.
    """
    limits = {
        "first": first - ONE_DAY if first else dt.date(1900, 1, 1),
        "last": last + 2 * ONE_DAY if last else dt.date(2200, 1, 1),
    }
    with connected(url) as connection:
        import sqlalchemy as sa

        statement = sa.text(query)
        named = statement.compile().params
        wanted = {name: dt.datetime.combine(day, dt.time()) for name, day in limits.items() if name in named}
        result = connection.execute(statement, wanted)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(result.keys())
        for rows in result.partitions(CHUNK):
            writer.writerows(
                [v.isoformat() if isinstance(v, dt.datetime) else v for v in row] for row in rows
            )
    return text.getvalue().encode()


def publish(delays: "pd.DataFrame", url: str, table: str) -> int:
    """Write a table of delays to a database: a row of the same day, reach and estimator is replaced.

    `delays` are those of :func:`rivid.load_delays`; the `table` is made where it does not exist. Returns the
    number of rows written: all of them, or none. Errors are those of :func:`connected`, and RividError where
    the table that is there lacks columns.
    """
    import pandas as pd

    names = [str(name) for name in delays]
    keys = [*KEYS, "start"] if "start" in delays else list(KEYS)
    frame = delays.assign(date=delays["date"].dt.date)
    rows = frame.astype(object).where(pd.notna(frame), None).to_dict("records")
    with connected(url) as connection:
        import sqlalchemy as sa

        kinds: dict[str, Any] = {"b": sa.Boolean, "i": sa.BigInteger, "f": sa.Double}
        of_text = {name: sa.String(64 if name in keys else None) for name in names}
        made = sa.Table(table, sa.MetaData(), *(
            sa.Column(
                name,
                sa.Date if name == "date" else kinds.get(delays[name].dtype.kind, of_text[name]),
                primary_key=name in keys,
                autoincrement=False,
            )
            for name in names
        ))  # fmt: skip
        made.create(connection, checkfirst=True)
        there = {column["name"] for column in sa.inspect(connection).get_columns(table)}
        if lacking := [name for name in names if name not in there]:
            raise RividError(
                f"table {table!r} lacks {', '.join(lacking)}: add these columns, or name another with --table"
            )
        same = sa.and_(*(made.c[key] == sa.bindparam(f"_{key}") for key in keys))
        for at in range(0, len(rows), CHUNK):
            some = rows[at : at + CHUNK]
            connection.execute(
                sa.delete(made).where(same), [{f"_{key}": row[key] for key in keys} for row in some]
            )
            connection.execute(sa.insert(made), some)
    return len(rows)
