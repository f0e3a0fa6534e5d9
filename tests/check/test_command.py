"""`rivid check` as a command: text and JSON, of one reach and of a fleet."""

import datetime as dt
import json

import pytest
from click.testing import CliRunner

from rivid.check import check
from rivid.cli import cli
from rivid.errors import ConfigError, NoDataError
from tests.daily import write_days
from tests.logs.helpers import DAY, config, put, rows
from tests.run.test_run import command

NAMES = ("u_Qi", "u_Qo", "h_L")


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
    assert report.days[3].notes == ["the inflow is constant"]
    assert [str(d) for d in report.absent] == ["2008-03-14", "2008-03-15"]
    assert report.bad_files[0][0] == "junk.csv"
    assert (report.failed, report.exit_code) == (1, 3)


def test_an_unfinished_log_of_today_is_pending_and_fine(tmp_path):
    report = check(put(tmp_path, rows()[:300]), config(), today=DAY)
    assert (report.days[0].status, report.exit_code) == ("pending", 0)


def test_days_in_the_future(tmp_path):
    write_days(tmp_path, 4)
    assert check(tmp_path, config(), today=dt.date(2008, 3, 13)).findings == []
    assert check(tmp_path, config(), today=dt.date(2008, 3, 12)).findings == []  # it may be tomorrow there
    (finding,) = check(tmp_path, config(), today=dt.date(2008, 3, 10)).findings
    assert finding.kind == "future" and list(finding.days) == [dt.date(2008, 3, 12), dt.date(2008, 3, 13)]


def test_today_is_a_day_in_the_zone_of_the_logs(tmp_path):
    put(tmp_path, rows(zone="-07:00")[:300])
    for now, status in (("2008-03-11T06:00Z", "pending"), ("2008-03-11T08:00Z", "failed")):
        (day,) = check(tmp_path, config(), today=dt.datetime.fromisoformat(now)).days
        assert day.status == status


def test_no_logs_at_all(tmp_path):
    with pytest.raises(NoDataError, match="looked for"):
        check(tmp_path, config())


def test_columns_that_no_log_has_are_one_error(tmp_path):
    write_days(tmp_path, 3)
    with pytest.raises(ConfigError, match="no column 'u_QI' for u_Qi; nearest is 'u_Qi'"):
        check(tmp_path, config(u_Qi="u_QI"))


class TestCommand:
    def invoke(self, *words):
        return CliRunner().invoke(cli, ["check", *map(str, words)], standalone_mode=False)

    def test_text_and_a_table(self, tmp_path):
        dates = write_days(tmp_path, 3)
        put(tmp_path, rows(dates[1])[:300], name=f"{dates[1]}.csv")
        result = self.invoke(tmp_path)
        assert result.return_value == 3
        assert "2008-03-11 failed: gap of 12.9 h" in result.output
        assert "  usable     2\n  failed     1\n" in result.output

    def test_a_fault_of_many_days_is_one_line(self, tmp_path):
        for k, date in enumerate(write_days(tmp_path, 40)):
            lines = rows(date)
            if 10 <= k < 20:  # each torn somewhere else
                lines = lines[: 300 + k]
            for line in lines:
                line[1] = f"{float(line[1]) * 35.3147:.6g}"
            put(tmp_path, lines, name=f"{date}.csv")
        result = self.invoke(tmp_path)
        lines = result.output.splitlines()
        assert result.return_value == 3
        assert len(lines) < 16 and max(map(len, lines)) < 80
        assert lines[0].startswith("2008-03-20 to 2008-03-29 (10 days) failed: gap of ")
        assert "wrong: u_Qi is 35.3 times u_Qo, and 1 m3/s is 35.3 cfs: is u_Qi in cfs? Set" in lines[2]

    def test_files_that_are_no_logs_are_one_line(self, tmp_path):
        write_days(tmp_path, 1)
        for k in range(40):
            (tmp_path / f"junk{k}.csv").write_text("a,b\n1,2\n")
        result = self.invoke(tmp_path)
        assert result.return_value == 3
        assert result.output.startswith("junk0.csv and 39 more files cannot be used: line 1: no column")

    def test_json(self, tmp_path):
        write_days(tmp_path, 2)
        result = self.invoke(tmp_path, "--json")
        assert result.return_value == 0
        answer = json.loads(result.output)
        assert [d["date"] for d in answer["days"]] == ["2008-03-10", "2008-03-11"] and answer["failed"] == 0
        assert answer["summary"] | {"samples": 0} == {
            "days": 2, "first": "2008-03-10", "last": "2008-03-11", "ok": 2, "failed": 0, "pending": 0,
            "absent": 0, "bad_files": 0, "samples": 0, "filled": 0, "warnings": 0, "exit_code": 0,
        }  # fmt: skip

    def test_json_gives_each_day_its_findings(self, tmp_path):
        dates = write_days(tmp_path, 6)
        for date in dates[2:4]:
            lines = [[r[0], r[1], f"{float(r[2]) * 35.3147:.6g}", r[3]] for r in rows(date)]
            put(tmp_path, lines, name=f"{date}.csv")
        answer = json.loads(self.invoke(tmp_path, "--json").output)
        (finding,) = answer["findings"]
        assert finding["kind"] == "unit" and finding["wrong"]
        assert list(finding["days"]) == ["2008-03-12", "2008-03-13"]
        assert answer["days"][2]["notes"] == [finding["days"]["2008-03-12"]]
        assert answer["days"][1]["notes"] == [] and answer["summary"]["exit_code"] == 3

    def test_sniff_prints_a_configuration_that_check_takes(self, tmp_path):
        write_days(tmp_path / "logs", 1)
        result = CliRunner().invoke(
            cli, ["sniff", str(tmp_path / "logs" / f"{DAY}.csv")], standalone_mode=False
        )
        (tmp_path / "c.toml").write_text(result.output)
        assert self.invoke(tmp_path / "logs", "--config", tmp_path / "c.toml").return_value == 0

    def test_a_fleet_is_checked_reach_by_reach(self, tmp_path):
        write_days(tmp_path / "fleet" / "sound", 2)
        dates = write_days(tmp_path / "fleet" / "torn", 2)
        put(tmp_path / "fleet" / "torn", rows(dates[1])[:300], name=f"{dates[1]}.csv")
        result = self.invoke(tmp_path / "fleet")
        assert result.return_value == 3
        assert "sound: fine, 2 days\n" in result.output and "failed: gap of 12.9 h" in result.output
        assert result.output.endswith("2 reaches, 1 of them with faults\n")
        answer = json.loads(self.invoke(tmp_path / "fleet", "--json").output)
        assert answer["exit_code"] == 3
        assert answer["reaches"]["sound"]["summary"]["exit_code"] == 0
        assert answer["reaches"]["torn"]["failed"] == 1

    def test_the_other_reaches_of_a_fleet_are_checked_if_one_cannot_be_read(self, tmp_path):
        write_days(tmp_path / "fleet" / "sound", 1)
        write_days(tmp_path / "fleet" / "other", 1)
        (tmp_path / "configs").mkdir()
        (tmp_path / "configs" / "other.toml").write_text("[input]\nu_Qi = 'inflow'\n")
        (tmp_path / "configs" / "gone.toml").write_text("")
        result = self.invoke(tmp_path / "fleet", "--config", tmp_path / "configs")
        assert result.return_value == 2
        assert "sound: fine, 1 days" in result.output and "other: " in result.output
        answer = json.loads(
            self.invoke(tmp_path / "fleet", "--config", tmp_path / "configs", "--json").output
        )
        assert answer["reaches"]["other"]["exit_code"] == 2 and answer["reaches"]["gone"]["exit_code"] == 10

    def test_exit_codes_of_nothing_to_check_and_of_a_wrong_configuration(self, tmp_path):
        (tmp_path / "empty").mkdir()
        (tmp_path / "c.toml").write_text("[reech]\n")
        for words, code in (((tmp_path / "empty",), 10), ((tmp_path / "none",), 10),
                            ((tmp_path, "--config", tmp_path / "c.toml"), 2)):  # fmt: skip
            assert command("check", *words).returncode == code
