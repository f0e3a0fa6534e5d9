"""Test logs from a database and results into one: SQLite, and PostgreSQL if it is installed."""

import datetime as dt
import glob
import os
import shutil
import sqlite3
import subprocess
import tempfile
import tomllib

import pandas as pd
import pytest
from click.testing import CliRunner

from rivid.cli import cli
from rivid.database import publish, queried
from rivid.errors import ConfigError, DataError, RividError

NIGHT = dt.datetime(2024, 5, 1)
DELAYS = pd.DataFrame(
    {
        "date": pd.to_datetime(["2024-05-01", "2024-05-01", "2024-05-02"]),
        "reach": "pool", "estimator": ["jmap", "posterior", "jmap"], "status": ["ok", "ok", "failed"],
        "delay_s": [931.0, 940.5, None], "at_bound": pd.array([False, None, None], "boolean"),
        "iterations": pd.array([4, 0, None], "Int64"), "message": ["", "", "a gap"],
    }
)  # fmt: skip


@pytest.fixture(scope="module")
def postgres():
    """Return the URL of a server that ends with the test."""
    found = shutil.which("initdb") or next(iter(sorted(glob.glob("/usr/lib/postgresql/*/bin/initdb"))), None)
    if found is None:
        pytest.skip("no PostgreSQL on this system")
    user = "postgres" if os.geteuid() == 0 else None  # it refuses to run as root
    folder = tempfile.mkdtemp(dir="/tmp")
    if user:
        shutil.chown(folder, user)
    call = {"check": True, "stdout": subprocess.DEVNULL, "cwd": folder, "user": user}
    control = [found.replace("initdb", "pg_ctl"), "-D", f"{folder}/db", "-w"]
    subprocess.run([found, "-D", f"{folder}/db", "-U", "rivid", "-A", "trust"], **call)
    options = f"-k {folder} -c listen_addresses='' -c fsync=off"
    subprocess.run([*control, "-o", options, "-l", f"{folder}/log", "start"], **call)
    yield f"postgresql+psycopg://rivid@/postgres?host={folder}"
    subprocess.run([*control, "-m", "immediate", "stop"], **call)
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request, tmp_path):
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path}/plant.db"
    return request.getfixturevalue("postgres")


def stored(url, table):
    import sqlalchemy as sa

    engine = sa.create_engine(url)
    with engine.connect() as connection:
        rows = connection.execute(sa.text(f"SELECT * FROM {table} ORDER BY date, estimator")).mappings().all()
    engine.dispose()
    return [dict(row) for row in rows]


def test_a_published_row_replaces_that_of_its_day_and_no_other(url):
    assert publish(DELAYS, url, "delays") == 3
    changed = DELAYS.iloc[2:].assign(delay_s=900.0, status="ok", message="")
    assert publish(changed, url, "delays") == 1
    rows = stored(url, "delays")
    assert [(str(r["date"])[:10], r["estimator"], r["delay_s"], r["status"]) for r in rows] == [
        ("2024-05-01", "jmap", 931.0, "ok"), ("2024-05-01", "posterior", 940.5, "ok"),
        ("2024-05-02", "jmap", 900.0, "ok"),
    ]  # fmt: skip
    assert rows[1]["at_bound"] is None and rows[2]["iterations"] is None


def test_a_failure_writes_nothing(url):
    publish(DELAYS.iloc[:1], url, "whole")
    twice = pd.concat([DELAYS.iloc[1:], DELAYS.iloc[1:2]])  # the key of a row is repeated
    with pytest.raises(DataError, match="database"):
        publish(twice, url, "whole")
    assert len(stored(url, "whole")) == 1


def test_a_table_without_the_columns_is_refused(url):
    publish(DELAYS[["date", "reach", "estimator"]], url, "narrow")
    with pytest.raises(RividError, match="'narrow' lacks status, delay_s"):
        publish(DELAYS, url, "narrow")


def test_a_query_is_limited_to_the_days_that_are_wanted(url):
    pd_rows = pd.DataFrame({"at": [NIGHT + dt.timedelta(hours=6 * k) for k in range(40)], "flow": 1.5})
    import sqlalchemy as sa

    engine = sa.create_engine(url)
    pd_rows.to_sql("log", engine, index=False, if_exists="replace")
    engine.dispose()
    query = "SELECT at AS time, flow FROM log WHERE at >= :first AND at < :last ORDER BY at"
    text = queried(url, query, dt.date(2024, 5, 4), dt.date(2024, 5, 4)).decode().splitlines()
    assert text[0] == "time,flow"
    assert (text[1][:10], text[-1][:10], len(text)) == ("2024-05-03", "2024-05-05", 13)
    assert len(queried(url, query, None, None).splitlines()) == 41


def test_ingest_and_publish_from_the_command_line(tmp_path, monkeypatch):
    """From a table of tags to daily logs, to a run, and back to a table."""
    from tests.daily import a_day

    times, *columns = a_day(dt.date(2008, 3, 10))
    with sqlite3.connect(tmp_path / "plant.db") as database:
        database.execute("CREATE TABLE log (at TEXT, tag TEXT, value REAL)")
        for tag, values in zip(("IN", "OUT", "LEVEL"), columns, strict=True):
            database.executemany(
                "INSERT INTO log VALUES (?, ?, ?)", zip(times, [tag] * 650, values.tolist(), strict=True)
            )
    database.close()
    monkeypatch.setenv("PLANT", str(tmp_path / "plant.db"))
    monkeypatch.chdir(tmp_path)
    config = tmp_path / "plant.toml"
    config.write_text(
        '[reach]\nsample_time = 133\nname = "pool"\n[input]\ndatabase = "sqlite:///$PLANT"\n'
        'query = "SELECT at AS time, tag, value FROM log"\n'
        'layout = "long"\ntag = "tag"\nu_Qi = "IN"\nu_Qo = "OUT"\nh_L = "LEVEL"\n'
    )
    call = lambda *words: CliRunner().invoke(cli, [str(word) for word in words])  # noqa: E731
    result = call("ingest", "--config", config, "--out", "logs")
    assert result.exit_code == 0, result.output
    assert "query" not in tomllib.loads((tmp_path / "logs_run.toml").read_text()).get("input", {})
    assert call("run", "logs", "--config", "logs_run.toml", "--out", "out", "--no-figures").exit_code == 0
    result = call("publish", "out", "--to", "sqlite:///$PLANT")
    assert result.output == "2 rows written to rivid_delays\n"
    assert {row["reach"] for row in stored(f"sqlite:///{tmp_path}/plant.db", "rivid_delays")} == {"pool"}
    assert call("publish", "out", "--to", "sqlite:///$PLANT", "--from", "2008-03-11").output.startswith(
        "0 rows"
    )


@pytest.mark.parametrize(
    ("url", "error", "expected"),
    [
        ("no url", ConfigError, "expected one like postgresql"),
        ("nothing://user:secret@host/x", ConfigError, "nothing://user@host/x"),
        ("sqlite:////nowhere/at/all.db", DataError, "unable to open"),
    ],
)
def test_a_database_that_is_not_there_is_named_without_its_password(url, error, expected):
    with pytest.raises(error, match=expected) as found:
        publish(DELAYS, url, "delays")
    assert "secret" not in str(found.value)


@pytest.mark.parametrize("words", [[], ["plant.toml"]])
def test_ingest_wants_exports_or_a_query(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    query = '[input]\ndatabase = "sqlite://"\nquery = "SELECT 1"\n' if words else ""
    (tmp_path / "plant.toml").write_text(query)
    result = CliRunner().invoke(cli, ["ingest", *words, "--config", "plant.toml", "--out", "logs"])
    assert "EXPORTS or from [input] query" in str(result.exception)
