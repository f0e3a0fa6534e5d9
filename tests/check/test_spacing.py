"""Test the spacing of rows against sample_time, and nights on which the clock of the logger changes."""

import datetime as dt

import numpy as np
import pytest

from rivid.check import check
from tests.daily import write_days
from tests.logs.helpers import DAY, config, put, rows


def of_kind(folder, kind, **given):
    return [finding for finding in check(folder, config(**given)).findings if finding.kind == kind]


@pytest.mark.parametrize(("seconds", "code"), [(60, "finer"), (140, "sample_time")])
def test_rows_with_another_spacing(tmp_path, seconds, code):
    for date in (DAY, DAY + dt.timedelta(days=1)):
        put(tmp_path, rows(date, n=-(-86400 // seconds), step=seconds), name=f"{date}.csv")
    report = check(tmp_path, config())
    (finding,) = (f for f in report.findings if f.kind == "interval")
    values = finding.values
    assert (finding.code, values["columns"]) == (f"interval.{code}", "u_Qi, u_Qo, h_L")
    assert (values["spacing_s"], values["expected_s"]) == (seconds, 133)
    assert finding.wrong is (code != "finer") and report.exit_code == (3 if finding.wrong else 0)
    assert ("h_L is interpolated" in finding.text) is (code == "finer")


def test_one_column_with_another_spacing(tmp_path):
    for k in range(2):
        date = DAY + dt.timedelta(days=k)
        lines = [[r[0], r[1] if j % 4 == 0 else "", *r[2:]] for j, r in enumerate(rows(date))]
        put(tmp_path, lines, name=f"{date}.csv")
    (finding,) = of_kind(tmp_path, "interval")
    assert (finding.code, finding.values["column"]) == ("interval.column", "u_Qi")
    assert finding.values["spacing_s"] == 532


def test_missing_rows_are_no_irregular_times(tmp_path):
    rng = np.random.default_rng(1)
    for k in range(2):
        date = DAY + dt.timedelta(days=k)
        kept = [row for row in rows(date) if rng.random() < 0.6]
        put(tmp_path, kept, name=f"{date}.csv")
    assert of_kind(tmp_path, "interval") == []


def test_a_day_with_gaps_has_no_other_spacing(tmp_path):
    dates = write_days(tmp_path, 30)
    put(tmp_path, rows(dates[3])[::3], name=f"{dates[3]}.csv")
    assert of_kind(tmp_path, "interval") == []


@pytest.mark.parametrize(
    ("sample_time", "found"), [(302, ["interval.sample_time"]), (360, []), (600, ["interval.finer"])]
)
def test_rows_at_irregular_times_are_one_finding(tmp_path, sample_time, found):
    rng = np.random.default_rng(2)
    for date in (DAY + k * dt.timedelta(days=1) for k in range(8)):
        each = rows(date, n=288, step=300)
        at = [dt.datetime.combine(date, dt.time()) + dt.timedelta(seconds=300 * k) for k in range(288)]
        lines = []
        for column in (1, 2, 3):
            for k in range(288):  # intervals of 3 to 7 min
                late = dt.timedelta(seconds=int(rng.integers(-60, 61)) if k else 0)
                cells = [each[k][c] if c == column else "" for c in (1, 2, 3)]
                lines.append([f"{(at[k] + late).isoformat()}+01:00", *cells])
        put(tmp_path, sorted(lines), name=f"{date}.csv")
    findings = check(tmp_path, config({"sample_time": sample_time})).findings
    interval = [finding for finding in findings if finding.kind == "interval"]
    assert [finding.code for finding in interval] == found
    for finding in interval:
        assert finding.values["columns"] == "u_Qi, u_Qo, h_L" and finding.days == {}
        assert finding.values["spacing_s"] == 360 and "at irregular times" in finding.text


@pytest.mark.parametrize("zone", ["+01:00", ""])
def test_a_logger_that_keeps_summer_time_is_found_by_both_nights(tmp_path, zone):
    march, october = dt.date(2008, 3, 30), dt.date(2008, 10, 26)
    for date in (march, october):
        before = date - dt.timedelta(days=1)
        put(tmp_path, rows(before, zone=zone), name=f"{before}.csv")
    spring = [r for r in rows(march, zone=zone) if not "T02" <= r[0][10:13] < "T03"]
    put(tmp_path, spring, name=f"{march}.csv")
    autumn = rows(october, zone=zone)
    again = [[r[0], r[1], r[2], f"{float(r[3]) + 0.01:.3f}"] for r in autumn if r[0][10:13] == "T02"]
    put(tmp_path, [*autumn[:82], *again, *autumn[82:]], name=f"{october}.csv")
    report = check(tmp_path, config(time_zone="Etc/GMT-1") if not zone else config())
    (finding,) = (f for f in report.findings if f.kind == "summer time")
    assert finding.days == {march: {"what": "is missing"}, october: {"what": "comes twice"}}
    assert report.exit_code == 3
    assert [d.status for d in report.days if d.date in (march, october)] == ["failed", "failed"]


def test_a_missing_hour_of_another_night_or_in_the_zone_of_the_logs_is_no_finding(tmp_path):
    for date in (dt.date(2008, 3, 29), dt.date(2008, 7, 27)):
        put(tmp_path / "a", [r for r in rows(date) if r[0][10:13] != "T02"], name=f"{date}.csv")
    assert of_kind(tmp_path / "a", "summer time") == []
    date = dt.date(2008, 3, 30)
    kept = [r for r in rows(date, zone="") if r[0][10:13] != "T02"]
    report = check(put(tmp_path / "b", kept, name=f"{date}.csv"), config(time_zone="Europe/Paris"))
    assert report.findings == [] and report.exit_code == 0
    date = dt.date(2008, 10, 26)
    autumn = rows(date, zone="")
    again = [[r[0], f"{float(r[1]) + 1:g}", *r[2:]] for r in autumn if r[0][10:13] == "T02"]
    whole = [*autumn[:82], *again, *autumn[82:]]
    report = check(put(tmp_path / "c", whole, name=f"{date}.csv"), config(time_zone="Europe/Paris"))
    assert "occurs twice in Europe/Paris" in report.days[0].reason and report.findings == []
