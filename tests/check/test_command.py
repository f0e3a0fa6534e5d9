"""Test `rivid check` as a function and as a command: text and JSON, for one reach and for a fleet."""

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


def invoke(*words, name="check"):
    return CliRunner().invoke(cli, [name, *map(str, words)], standalone_mode=False)


def test_sound_logs_are_fine_in_text_and_json(tmp_path):
    write_days(tmp_path, 2)
    report = check(tmp_path, config())
    assert (report.exit_code, report.warnings, report.absent, report.bad_files) == (0, [], [], [])
    assert [(d.status, d.n_samples, d.notes) for d in report.days] == [("ok", 650, [])] * 2
    result = invoke(tmp_path, "--json")
    assert result.return_value == 0
    answer = json.loads(result.output)
    assert [d["date"] for d in answer["days"]] == ["2008-03-10", "2008-03-11"] and answer["failed"] == 0
    assert answer["summary"] == {
        "days": 2, "first": "2008-03-10", "last": "2008-03-11", "ok": 2, "failed": 0, "pending": 0,
        "absent": 0, "bad_files": 0, "samples": 1300, "filled": 0, "warnings": 0, "exit_code": 0,
    }  # fmt: skip


def test_each_day_has_its_reason(tmp_path):
    dates = write_days(tmp_path, 5)
    put(tmp_path, rows(dates[1])[:300], name=f"{dates[1]}.csv")
    put(tmp_path, [r for k, r in enumerate(rows(dates[2])) if k not in (7, 8)], name=f"{dates[2]}.csv")
    put(tmp_path, [[r[0], "300", *r[2:]] for r in rows(dates[3])], name=f"{dates[3]}.csv")
    (tmp_path / f"{dates[4]}.csv").unlink()
    put(tmp_path, rows(dt.date(2008, 3, 16)), name="2008-03-16.csv")
    (tmp_path / "junk.csv").write_text("a,b\n1,2\n")
    report = check(tmp_path, config())
    assert [d.status for d in report.days] == ["ok", "failed", "ok", "ok", "ok"]
    assert "gap of 12.9 h from 11:05 in u_Qi" in report.days[1].reason
    assert report.days[2].notes == ["2 of 650 samples filled"]
    assert report.days[3].notes == ["the inflow is constant"]
    assert [str(d) for d in report.absent] == ["2008-03-14", "2008-03-15"]
    assert report.bad_files[0][0] == "junk.csv"
    assert (report.count("failed"), report.exit_code) == (1, 3)


def test_days_in_the_future(tmp_path):
    write_days(tmp_path, 4)
    assert check(tmp_path, config(), today=dt.date(2008, 3, 12)).findings == []  # tomorrow in some zone
    (finding,) = check(tmp_path, config(), today=dt.date(2008, 3, 10)).findings
    assert finding.kind == "future" and list(finding.days) == [dt.date(2008, 3, 12), dt.date(2008, 3, 13)]


def test_an_unfinished_log_of_today_in_the_zone_of_the_logs_is_pending(tmp_path):
    put(tmp_path, rows(zone="-07:00")[:300])
    for now, status, code in (("2008-03-11T06:00Z", "pending", 0), ("2008-03-11T08:00Z", "failed", 3)):
        report = check(tmp_path, config(), today=dt.datetime.fromisoformat(now))
        assert (report.days[0].status, report.exit_code) == (status, code)
    assert check(tmp_path, config(), today=DAY).exit_code == 0


def test_no_logs_and_columns_that_no_log_has_are_errors(tmp_path):
    with pytest.raises(NoDataError, match="looked for"):
        check(tmp_path, config())
    write_days(tmp_path, 3)
    with pytest.raises(ConfigError, match="no column 'u_QI' for u_Qi; nearest is 'u_Qi'"):
        check(tmp_path, config(u_Qi="u_QI"))


def test_a_fault_of_many_days_or_files_is_one_line(tmp_path):
    for k, date in enumerate(write_days(tmp_path, 12)):
        lines = rows(date)
        if 5 <= k < 9:  # each file is truncated at another row
            lines = lines[: 300 + k]
        for line in lines:
            line[1] = f"{float(line[1]) * 35.3147:.6g}"
        put(tmp_path, lines, name=f"{date}.csv")
    for k in range(4):
        (tmp_path / f"junk{k}.csv").write_text("a,b\n1,2\n")
    result = invoke(tmp_path)
    lines = result.output.splitlines()
    assert result.return_value == 3
    assert len(lines) < 18 and max(map(len, lines)) < 80
    for part in ("junk0.csv", "2008-03-15 to 2008-03-18 (4 days)", "u_Qi is 35.4 times u_Qo"):
        assert sum(part in line for line in lines) == 1, part


def test_json_gives_each_day_its_findings(tmp_path):
    dates = write_days(tmp_path, 6)
    for date in dates[2:4]:
        lines = [[r[0], r[1], f"{float(r[2]) * 35.3147:.6g}", r[3]] for r in rows(date)]
        put(tmp_path, lines, name=f"{date}.csv")
    answer = json.loads(invoke(tmp_path, "--json").output)
    (finding,) = answer["findings"]
    assert finding["kind"] == "unit" and finding["wrong"]
    assert list(finding["days"]) == ["2008-03-12", "2008-03-13"]
    assert answer["days"][2]["notes"] == [finding["days"]["2008-03-12"]]
    assert answer["days"][1]["notes"] == [] and answer["summary"]["exit_code"] == 3


def test_sniff_prints_a_configuration_that_check_takes(tmp_path):
    write_days(tmp_path / "logs", 1)
    (tmp_path / "c.toml").write_text(invoke(tmp_path / "logs" / f"{DAY}.csv", name="sniff").output)
    assert invoke(tmp_path / "logs", "--config", tmp_path / "c.toml").return_value == 0


def test_a_fleet_is_checked_reach_by_reach_even_if_one_cannot_be_read(tmp_path):
    folder, configs = tmp_path / "fleet", tmp_path / "configs"
    write_days(folder / "sound", 2)
    dates = write_days(folder / "torn", 2)
    put(folder / "torn", rows(dates[1])[:300], name=f"{dates[1]}.csv")
    result = invoke(folder)
    assert result.return_value == 3
    assert "sound: fine, 2 days\n" in result.output and "failed: gap of 12.9 h" in result.output
    assert result.output.endswith("2 reaches, 1 of them with faults\n")
    configs.mkdir()
    write_days(folder / "other", 1)
    (configs / "other.toml").write_text("[input]\nu_Qi = 'inflow'\n")
    (configs / "gone.toml").write_text("")
    result = invoke(folder, "--config", configs)
    assert result.return_value == 2 and "other: " in result.output
    answer = json.loads(invoke(folder, "--config", configs, "--json").output)
    reaches = answer["reaches"]
    assert (answer["exit_code"], reaches["other"]["exit_code"], reaches["gone"]["exit_code"]) == (2, 2, 10)
    assert reaches["sound"]["summary"]["exit_code"] == 0 and reaches["torn"]["failed"] == 1


def test_exit_codes_of_nothing_to_check_and_of_a_wrong_configuration(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "c.toml").write_text("[reech]\n")
    for words, code in (((tmp_path / "empty",), 10), ((tmp_path, "--config", tmp_path / "c.toml"), 2)):
        assert command("check", *words).returncode == code
