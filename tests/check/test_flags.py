"""Test flags of single values, and jumps that the maintenance of the gauge explains."""

import csv
import datetime as dt

import pyarrow.parquet as pq
import pytest

from rivid.check import check
from rivid.check.findings import DayReport, Finding, Report
from rivid.check.flags import SCHEMA, explained, flags, read_maintenance
from rivid.errors import ConfigError
from tests.check.test_command import invoke
from tests.daily import FIRST, write_days
from tests.logs.helpers import config, put, rows

JUMP = {FIRST: {"items": [{"time": "08:03", "change": 0.1, "unit": "m"}]},
        FIRST + dt.timedelta(1): {"items": [{"time": "10:00", "change": -0.1, "unit": "m"}]}}  # fmt: skip


def report_of(*findings, days=()):
    return Report(list(days), [], [], list(findings))


def test_the_values_of_an_event_are_flagged_and_no_others(tmp_path):
    write_days(tmp_path, 2)
    spell = {"first": "06:00", "last": "07:00", "duration_s": 3600.0, "value": 118.0, "unit": "m"}
    stuck = Finding("stuck", {"output": "h_L"}, {FIRST: {"items": [spell]}})
    table = flags(report_of(stuck, Finding("jump", {"output": "h_L"}, JUMP)), tmp_path, config())
    assert table.schema == SCHEMA and set(table["column"].to_pylist()) == {"h_L"}
    of = {rule: [] for rule in ("stuck", "jump")}
    for row in table.to_pylist():
        of[row["rule"]].append(row["time"].astimezone(dt.timezone(dt.timedelta(hours=1))))
    spell = [time for time in of["stuck"] if time.date() == FIRST]
    assert len(spell) == len(of["stuck"]) and 27 <= len(spell) <= 30
    assert spell[0].hour == 5 and spell[0].minute >= 59 or spell[0].hour == 6
    assert len(of["jump"]) in (2, 3, 4) and {t.hour for t in of["jump"]} <= {8, 9, 10}


def test_days_and_whole_records_are_flagged_value_by_value(tmp_path):
    write_days(tmp_path, 3)
    put(tmp_path, [[r[0], "300", *r[2:]] for r in rows(FIRST)], name=f"{FIRST}.csv")
    put(tmp_path, rows(FIRST + dt.timedelta(1))[:300], name=f"{FIRST + dt.timedelta(1)}.csv")
    found = flags(check(tmp_path, config()), tmp_path, config()).to_pylist()
    constant = [row for row in found if row["rule"] == "constant.inflow"]
    assert len(constant) == 650 and {(r["column"], r["flag"]) for r in constant} == {("u_Qi", "remark")}
    (failed,) = (row for row in found if row["flag"] == "failed")
    assert "gap of" in failed["reason"] and failed["column"] == ""


def test_a_jump_on_a_day_of_maintenance_is_no_fault(tmp_path):
    day = DayReport(FIRST, "ok")
    report = report_of(Finding("jump", {"output": "h_L"}, JUMP), days=[day])
    assert report.exit_code == 3
    once = explained(report, [FIRST])
    assert list(once.findings[0].days) == [FIRST + dt.timedelta(1)] and once.exit_code == 3
    assert explained(report, list(JUMP)).findings == []
    log = tmp_path / "maintenance.txt"
    log.write_text("date,what\n2008-03-10,gauge cleaned\n\n2008-03-11 10:00 moved\n")
    assert read_maintenance(log) == list(JUMP)
    log.write_text("nothing\n")
    with pytest.raises(ConfigError, match="no line begins with a date"):
        read_maintenance(log)


def test_the_command(tmp_path):
    write_days(tmp_path / "logs", 2)
    log = tmp_path / "maintenance.txt"
    log.write_text("2008-03-10\n")
    done = invoke(tmp_path / "logs", "--flags", tmp_path / "out", "--maintenance", log)
    assert done.return_value == 0
    assert pq.read_table(tmp_path / "out/flags.parquet").num_rows == 0
    assert next(csv.reader((tmp_path / "out/flags.csv").read_text().splitlines())) == SCHEMA.names
