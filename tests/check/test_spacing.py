"""How often rows come, against sample_time; nights on which the clock of the logger changes."""

import datetime as dt

import pytest

from rivid.check import check
from tests.daily import write_days
from tests.logs.helpers import DAY, config, put, rows


def of_kind(folder, kind, **given):
    return [finding for finding in check(folder, config(**given)).findings if finding.kind == kind]


def every(folder, seconds, n_days=2):
    for k in range(n_days):
        date = DAY + dt.timedelta(days=k)
        put(folder, rows(date, n=-(-86400 // seconds), step=seconds), name=f"{date}.csv")
    return folder


def test_rows_that_come_more_often_than_sample_time_are_a_remark(tmp_path):
    report = check(every(tmp_path, 60), config())
    (finding,) = report.findings
    assert finding.text == (
        "u_Qi, u_Qo, h_L come every 60 s; [reach] sample_time is 133 s: what lies between samples is not used"
    )
    assert not finding.wrong and report.exit_code == 0


def test_rows_that_come_less_often_are_wrong_and_say_what_to_set(tmp_path):
    report = check(every(tmp_path, 300), config())
    (finding,) = (f for f in report.findings if f.kind == "interval")
    assert finding.text.endswith("come every 300 s; [reach] sample_time is 133 s: set sample_time = 300")
    assert report.exit_code == 3


def test_rows_that_come_nearly_every_sample(tmp_path):
    (finding,) = of_kind(every(tmp_path, 140), "interval")
    assert "come every 140 s" in finding.text and finding.wrong


def test_one_column_that_comes_less_often(tmp_path):
    for k in range(2):
        date = DAY + dt.timedelta(days=k)
        lines = [[r[0], r[1] if j % 4 == 0 else "", *r[2:]] for j, r in enumerate(rows(date))]
        put(tmp_path, lines, name=f"{date}.csv")
    (finding,) = of_kind(tmp_path, "interval")
    assert (
        finding.text.startswith("u_Qi comes every 532 s; ") and "[input.interval] u_Qi = 532" in finding.text
    )


def test_a_day_with_holes_is_no_other_interval(tmp_path):
    dates = write_days(tmp_path, 30)
    put(tmp_path, rows(dates[3])[::3], name=f"{dates[3]}.csv")
    assert of_kind(tmp_path, "interval") == []


@pytest.mark.parametrize("zone", ["+01:00", ""])
def test_a_logger_that_keeps_summer_time_is_told_by_both_nights(tmp_path, zone):
    """Its clock is put forward in March and back in October; it is read as if it never were."""
    march, october = dt.date(2008, 3, 30), dt.date(2008, 10, 26)
    for date in (march, october):
        put(tmp_path, rows(date - dt.timedelta(days=1), zone=zone), name=f"{date - dt.timedelta(days=1)}.csv")
    put(
        tmp_path, [r for r in rows(march, zone=zone) if not "T02" <= r[0][10:13] < "T03"], name=f"{march}.csv"
    )
    autumn = rows(october, zone=zone)
    again = [[r[0], r[1], r[2], f"{float(r[3]) + 0.01:.3f}"] for r in autumn if r[0][10:13] == "T02"]
    put(tmp_path, [*autumn[:82], *again, *autumn[82:]], name=f"{october}.csv")
    report = check(tmp_path, config(time_zone="Etc/GMT-1") if not zone else config())
    (finding,) = (f for f in report.findings if f.kind == "summer time")
    assert "an hour of the night is missing on 2008-03-30 and one comes twice on 2008-10-26" in finding.text
    assert '"Europe/Paris"' in finding.text and report.exit_code == 3
    assert [d.status for d in report.days if d.date in (march, october)] == ["failed", "failed"]


def test_an_hour_that_is_missing_on_another_night_is_a_gap_only(tmp_path):
    for date in (dt.date(2008, 3, 29), dt.date(2008, 7, 27)):
        put(tmp_path, [r for r in rows(date) if r[0][10:13] != "T02"], name=f"{date}.csv")
    assert of_kind(tmp_path, "summer time") == []


def test_a_night_that_is_read_in_its_own_zone_is_fine(tmp_path):
    date = dt.date(2008, 3, 30)
    kept = [r for r in rows(date, zone="") if r[0][10:13] != "T02"]
    report = check(put(tmp_path, kept, name=f"{date}.csv"), config(time_zone="Europe/Paris"))
    assert report.findings == [] and report.exit_code == 0
