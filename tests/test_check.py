"""`rivid check` says in words what is wrong, day by day and on the whole."""

import datetime as dt
import json

import pytest
from click.testing import CliRunner

from rivid.check import check
from rivid.cli import cli
from rivid.errors import NoDataError
from tests.daily import write_days
from tests.logs.helpers import DAY, config, put, rows

NAMES = ("u_Qi", "u_Qo", "h_L")


def scaled(folder, column, factor, n_days=2):
    """Days whose column is in another unit."""
    for k in range(n_days):
        date = DAY + dt.timedelta(days=k)
        lines = rows(date)
        for line in lines:
            line[1 + column] = f"{float(line[1 + column]) * factor:.6g}"
        put(folder, lines, name=f"{date}.csv")
    return folder


def test_sound_logs_are_fine(tmp_path):
    write_days(tmp_path, 3)
    report = check(tmp_path, config())
    assert (report.exit_code, report.warnings, report.absent, report.bad_files) == (0, [], [], [])
    assert [(d.status, d.n_samples, d.notes) for d in report.days] == [("ok", 650, [])] * 3


def test_each_day_has_its_reason(tmp_path):
    dates = write_days(tmp_path, 5)
    put(tmp_path, rows(dates[1])[:300], name=f"{dates[1]}.csv")
    put(tmp_path, [r for k, r in enumerate(rows(dates[2])) if k not in (7, 8)], name=f"{dates[2]}.csv")
    put(tmp_path, [[r[0], "300", *r[2:]] for r in rows(dates[3])], name=f"{dates[3]}.csv")
    (tmp_path / f"{dates[4]}.csv").rename(tmp_path / "2008-03-16.csv")
    put(tmp_path, rows(dt.date(2008, 3, 16)), name="2008-03-16.csv")
    (tmp_path / "junk.csv").write_text("a,b\n1,2\n")
    report = check(tmp_path, config())
    assert [d.status for d in report.days] == ["ok", "failed", "ok", "ok", "ok"]
    assert "gap of 12.9 h from 11:05 in u_Qi" in report.days[1].reason
    assert report.days[2].notes == ["2 of 650 samples filled"]
    assert report.days[3].notes == ["the inflow is constant: no delay can be told"]
    assert [str(d) for d in report.absent] == ["2008-03-14", "2008-03-15"]
    assert report.bad_files[0][0] == "junk.csv"
    assert (report.failed, report.exit_code) == (1, 3)


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [
        (0, 35.3147, "u_Qi is 35.4 times u_Qo: is u_Qi in cfs"),
        (1, 35.3147, "u_Qo is 35.2 times u_Qi: is u_Qo in cfs"),
        (1, 1000, "is u_Qo in L/s"),
        (0, 0.0283168, "u_Qo is 35.2 times u_Qi"),
        (1, 2, "the water balance does not close: u_Qo is 1.99 times u_Qi"),
        (2, 1000, "h_L moves by"),
    ],
)
def test_wrong_units_are_warned_of(tmp_path, column, factor, said):
    warnings = check(scaled(tmp_path, column, factor), config()).warnings
    assert any(said in warning for warning in warnings), warnings


def test_both_flows_in_another_unit_are_seen_by_their_range(tmp_path):
    for name in (0, 1):
        scaled(tmp_path / str(name), name, 1)
    lines = [[r[0], *(f"{float(c) * 35.3147:.2f}" for c in r[1:3]), r[3]] for r in rows()]
    warnings = check(put(tmp_path / "both", lines), config()).warnings
    assert len(warnings) == 2 and '"cfs" would give' in warnings[0]


def test_a_stuck_gauge_is_said(tmp_path):
    report = check(put(tmp_path, [[*r[:3], "118.000"] for r in rows()]), config())
    assert report.days[0].notes == ["h_L is constant: is the gauge stuck?"]


def test_an_unfinished_log_of_today_is_pending_and_fine(tmp_path):
    report = check(put(tmp_path, rows()[:300]), config(), today=DAY)
    assert (report.days[0].status, report.exit_code) == ("pending", 0)


def test_today_is_a_day_of_the_logs_own_zone(tmp_path):
    put(tmp_path, rows(zone="-07:00")[:300])
    for now, status in (("2008-03-11T06:00Z", "pending"), ("2008-03-11T08:00Z", "failed")):
        (day,) = check(tmp_path, config(), today=dt.datetime.fromisoformat(now)).days
        assert day.status == status


def test_no_logs_at_all(tmp_path):
    with pytest.raises(NoDataError, match="looked for"):
        check(tmp_path, config())


class TestCommand:
    def invoke(self, *words):
        return CliRunner().invoke(cli, ["check", *map(str, words)], standalone_mode=False)

    def test_words_and_a_table(self, tmp_path):
        dates = write_days(tmp_path, 3)
        put(tmp_path, rows(dates[1])[:300], name=f"{dates[1]}.csv")
        result = self.invoke(tmp_path)
        assert result.return_value == 3
        assert "2008-03-11  failed   gap of 12.9 h" in result.output
        assert "  fine       2\n  failed     1\n" in result.output

    def test_json(self, tmp_path):
        write_days(tmp_path, 2)
        result = self.invoke(tmp_path, "--json")
        assert result.return_value == 0
        told = json.loads(result.output)
        assert [d["date"] for d in told["days"]] == ["2008-03-10", "2008-03-11"] and told["failed"] == 0

    def test_sniff_prints_a_configuration_that_check_takes(self, tmp_path):
        write_days(tmp_path / "logs", 1)
        result = CliRunner().invoke(
            cli, ["sniff", str(tmp_path / "logs" / f"{DAY}.csv")], standalone_mode=False
        )
        (tmp_path / "c.toml").write_text(result.output)
        assert self.invoke(tmp_path / "logs", "--config", tmp_path / "c.toml").return_value == 0
