"""Test the refusals and counts of ingest, and the files that it must not change."""

import datetime as dt
import json
import os
import shlex
from types import SimpleNamespace
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rivid.cli import cli
from rivid.cli.ingest import _print_days
from rivid.config import Config, load_config, parse
from rivid.errors import ConfigError, DataError, RividError
from rivid.logs.days import find_days, read_window
from rivid.logs.exports import ingest
from tests import examples
from tests.faults.test_disk import limited
from tests.faults.test_mutations import mutated
from tests.run.test_run import command

DAY = dt.date(2008, 3, 10)
REACH = {"sample_time": 900}
NEXT = DAY + dt.timedelta(days=1)


def wide(n=96, start=0, first=DAY, zone="+01:00"):
    """Return rows of time, inflow, outflow, level as lists of text."""
    midnight = dt.datetime.combine(first, dt.time())
    return [
        [(midnight + dt.timedelta(seconds=900 * k)).isoformat() + zone, f"{300 + k}", f"{290 + k}", "118.5"]
        for k in range(start, start + n)
    ]


def write(path, rows, head="time,u_Qi,u_Qo,h_L"):
    path.write_text("\n".join([head, *(",".join(row) for row in rows)]) + "\n")
    return path


def go(tmp_path, rows, options=None, head="time,u_Qi,u_Qo,h_L", reach=None, **given):
    config = parse({"reach": REACH | (reach or {}), "input": given}, Config)
    return ingest([write(tmp_path / "export.csv", rows, head)], tmp_path / "logs", config, **options or {})


def written(folder, config):
    """Read the only day of a directory or file."""
    (source,) = find_days(folder, config).days
    return read_window(folder, [source], config)


def value(outcome, source="u_Qi"):
    return outcome.ledger["sources"][source]


def statuses(outcome):
    return [day.status for day in outcome.days]


class TestWhatIsThere:
    def test_the_same_again_changes_nothing(self, tmp_path):
        assert statuses(go(tmp_path, wide(192))) == ["written", "written"]
        stamps = {p: p.stat().st_mtime_ns for p in (tmp_path / "logs").iterdir()}
        again = go(tmp_path, wide(192))
        assert statuses(again) == ["identical", "identical"] and again.exit_code == 0
        assert {p: p.stat().st_mtime_ns for p in (tmp_path / "logs").iterdir()} == stamps

    @pytest.mark.parametrize("form", ["csv", "csv.gz", "parquet"])
    def test_a_day_that_differs_stays_unless_forced(self, tmp_path, form):
        go(tmp_path, wide(192), dict(format=form))
        path = tmp_path / "logs" / f"{DAY}.{form}"
        before = path.read_bytes()
        rows = wide(192)
        rows[5][1] = "333"
        kept = go(tmp_path, rows, dict(format=form))
        assert statuses(kept) == ["differs", "identical"] and kept.exit_code == 3
        assert path.read_bytes() == before and "--force" in kept.days[0].reason
        assert value(kept)["dropped"] == {"other log in place": 96}
        assert statuses(go(tmp_path, rows, dict(format=form, force=True))) == ["written", "identical"]
        assert path.read_bytes() != before

    def test_a_log_of_another_format_is_no_place_for_a_second_one(self, tmp_path):
        go(tmp_path, wide())
        outcome = go(tmp_path, wide(), dict(format="parquet", force=True))
        assert (
            statuses(outcome) == ["differs"] and "2008-03-10.csv is there already" in outcome.days[0].reason
        )
        assert os.listdir(tmp_path / "logs") == ["2008-03-10.csv"]

    def test_a_link_is_not_followed(self, tmp_path):
        (tmp_path / "logs").mkdir()
        precious = tmp_path / "precious.txt"
        precious.write_text("kept")
        (tmp_path / "logs" / f"{DAY}.csv").symlink_to(precious)
        assert statuses(go(tmp_path, wide(), dict(force=True))) == ["differs"]
        assert precious.read_text() == "kept"

    def test_an_export_among_the_logs_and_a_directory_with_other_logs_are_refused(self, tmp_path):
        (tmp_path / "logs").mkdir()
        path = write(tmp_path / "logs" / "2008-03.csv", wide())
        with pytest.raises(ConfigError, match="would take it for a log"):
            ingest([path], tmp_path / "logs", parse({"reach": REACH}, Config))
        with pytest.raises(ConfigError, match="holds 2008-03.csv, which would mix"):
            go(tmp_path, wide())

    def test_a_configuration_that_differs_is_not_overwritten(self, tmp_path):
        (tmp_path / "logs_run.toml").write_text("# mine\n")
        with pytest.raises(ConfigError, match="exists and differs: --force"):
            go(tmp_path, wide())
        assert not (tmp_path / "logs").exists()
        go(tmp_path, wide(), dict(force=True))
        assert load_config(tmp_path / "logs_run.toml").reach.sample_time == 900

    def test_its_own_configuration_is_brought_up_to_date_without_force(self, tmp_path):
        go(tmp_path, wide())
        path = tmp_path / "logs_run.toml"
        before, log = path.read_text(), (tmp_path / "logs" / f"{DAY}.csv").stat()
        assert before.startswith("# Written by `rivid ingest`")
        again = go(tmp_path, wide(), reach={"name": "lower-river", "length": 15000})
        assert statuses(again) == ["identical"] and again.exit_code == 0
        assert load_config(path).reach.name == "lower-river" and path.read_text() != before
        after = (tmp_path / "logs" / f"{DAY}.csv").stat()
        assert (after.st_ino, after.st_mtime_ns) == (log.st_ino, log.st_mtime_ns)
        go(tmp_path, wide())  # and back again: the mark is renewed
        assert path.read_text() == before

    def test_once_edited_it_stays(self, tmp_path):
        go(tmp_path, wide())
        path = tmp_path / "logs_run.toml"
        ours = path.read_text()
        for mine in (f"{ours}\n[run]\nwindow_days = 2\n", f"{ours}# a remark\n", f"{ours} ", f"# {ours}"):
            path.write_text(mine)
            with pytest.raises(ConfigError, match="exists and differs: --force"):
                go(tmp_path, wide(), reach={"name": "lower-river"})
            assert path.read_text() == mine

    def test_it_stays_too_where_the_logs_would_differ_and_then_none_is_written(self, tmp_path):
        go(tmp_path, wide())
        before = (tmp_path / "logs_run.toml").read_text()
        rows = wide(192)
        rows[5][1] = "333"
        with pytest.raises(ConfigError, match="exists and differs: --force"):
            go(tmp_path, rows, reach={"name": "lower-river"})
        assert os.listdir(tmp_path / "logs") == [f"{DAY}.csv"]
        assert (tmp_path / "logs_run.toml").read_text() == before
        forced = go(tmp_path, rows, dict(force=True), reach={"name": "lower-river"})
        assert statuses(forced) == ["written", "written"]
        assert load_config(tmp_path / "logs_run.toml").reach.name == "lower-river"

    def test_a_dry_run_counts_and_writes_nothing(self, tmp_path):
        outcome = go(tmp_path, wide(), dict(dry_run=True))
        assert statuses(outcome) == ["written"] and value(outcome)["used"] == 96
        assert os.listdir(tmp_path) == ["export.csv"]
        go(tmp_path, wide())
        before = (tmp_path / "logs_run.toml").read_text()
        go(tmp_path, wide(), dict(dry_run=True), reach={"name": "lower-river"})
        assert (tmp_path / "logs_run.toml").read_text() == before

    def test_killed_between_days_and_started_again_it_ends_as_if_never_killed(self, tmp_path, monkeypatch):
        whole = tmp_path / "whole"
        whole.mkdir()
        go(whole, wide(480))
        real, calls = os.replace, []

        def dies(a, b):
            calls.append(b)
            if len(calls) == 3:
                raise KeyboardInterrupt
            return real(a, b)

        monkeypatch.setattr("rivid.atomic.os.replace", dies)
        with pytest.raises(KeyboardInterrupt):
            go(tmp_path, wide(480))
        assert len(os.listdir(tmp_path / "logs")) == 2
        monkeypatch.setattr("rivid.atomic.os.replace", real)
        assert statuses(go(tmp_path, wide(480))) == ["identical"] * 2 + ["written"] * 3
        for path in (whole / "logs").iterdir():
            assert (tmp_path / "logs" / path.name).read_bytes() == path.read_bytes()

    def test_a_full_disk_is_one_line_and_leaves_no_torn_file(self, tmp_path):
        write(tmp_path / "export.csv", wide(960))
        (tmp_path / "c.toml").write_text("[reach]\nsample_time = 900\n")
        words = ("ingest", "export.csv", "--config", "c.toml", "--out", "logs")
        done = command(*words, cwd=tmp_path, preexec_fn=limited(2000))
        assert done.returncode == 1 and done.stderr.count("\n") == 1
        assert done.stderr.startswith("rivid: cannot write logs/2008-03-10.csv: ")
        assert os.listdir(tmp_path / "logs") == []


class TestDays:
    def test_days_that_are_not_whole_are_refused_and_their_values_counted(self, tmp_path):
        outcome = go(tmp_path, wide(n=200, start=40))
        assert statuses(outcome) == ["refused", "written", "refused"] and outcome.exit_code == 3
        assert "gap of 10.0 h from 00:00" in outcome.days[0].reason
        assert value(outcome) == {
            "read": 200, "used": 96, "dropped": {"refused day": 104}, "sorted": 0,
        }  # fmt: skip
        assert os.listdir(tmp_path / "logs") == [f"{NEXT}.csv"]

    @pytest.mark.parametrize(
        ("rows", "options", "status", "dropped"),
        [
            (wide(n=150), {"today": NEXT}, ["written", "pending"], {"unfinished day": 54}),
            (wide(n=200, start=40), {"first": NEXT, "last": NEXT}, ["written"], {"not asked for": 104}),
            (wide(n=97), {}, ["written"], {"not asked for": 1}),
        ],
        ids=["a day that is not over", "days outside the range", "a row at the last midnight"],
    )
    def test_what_is_left_out_is_counted_and_no_failure(self, tmp_path, rows, options, status, dropped):
        outcome = go(tmp_path, rows, options)
        assert statuses(outcome) == status and outcome.exit_code == 0
        assert value(outcome)["dropped"] == dropped

    def test_no_requested_day_is_no_data(self, tmp_path):
        assert go(tmp_path, wide(), dict(first=dt.date(2010, 1, 1))).exit_code == 10

    def test_what_cannot_be_read_refuses_the_day_before_and_after_it(self, tmp_path):
        rows = wide(n=288)
        rows[96] = ["garbage", "1", "2", "3"]
        outcome = go(tmp_path, rows)
        assert statuses(outcome) == ["refused", "refused", "written"]
        assert "line 98" in outcome.days[0].reason and "[input] time_format" in outcome.days[0].reason
        assert value(outcome)["dropped"]["unreadable row"] == 1

    @pytest.mark.parametrize(
        ("column", "cell", "reason"),
        [
            (1, "4e6", "is beyond any river: check [input.units], or, if it means"),
            (1, "4e6", "set [input] sentinels = [4000000]"),
            (3, "-777", "set [input] sentinels = [-777]"),
        ],
    )
    def test_a_value_that_is_none_refuses_its_day_only(self, tmp_path, column, cell, reason):
        rows = wide(192)
        rows[9][column] = cell
        outcome = go(tmp_path, rows)
        assert statuses(outcome) == ["refused", "written"] and reason in outcome.days[0].reason

    def test_a_rate_in_an_unknown_unit_is_refused(self, tmp_path):
        names = {"u_Qi": "in (gal/min)", "u_Qo": "out", "h_L": "level"}
        with pytest.raises(
            ConfigError, match=r"seems to be in gal/min: expected one of m3/s, cfs, .* convert it"
        ):
            go(tmp_path, wide(), head="time,in (gal/min),out,level", **names)
        assert go(tmp_path, wide(), head="time,in (gal/min),out,level", **names, units={"u_Qi": "L/s"})

    def test_a_clock_without_daylight_saving_is_suggested(self, tmp_path):
        rows = wide(first=dt.date(2008, 3, 30), zone="")
        outcome = go(tmp_path, rows, time_zone="Europe/Paris")
        assert 'no daylight saving, set [input] time_zone = "Etc/GMT-1"' in outcome.days[0].reason

    def test_the_next_commands_can_be_copied_where_a_path_has_blanks(self, tmp_path):
        export = write(tmp_path / "export.csv", wide())
        (tmp_path / "c.toml").write_text("[reach]\nsample_time = 900\n")
        done = command("ingest", export, "--config", tmp_path / "c.toml", "--out", tmp_path / "my logs")
        shown = [
            line.split(": ", 1)[1] for line in done.stdout.splitlines() if line.startswith(("next", "then"))
        ]
        assert len(shown) == 2 and all(str(tmp_path / "my logs") in shlex.split(line) for line in shown)

    def test_a_river_and_a_pool_without_outflow(self, tmp_path):
        rows = [[t, i, o] for t, i, o, _ in wide()]
        outcome = go(tmp_path, rows, head="time,up,down", reach={"kind": "river"}, u_Qi="up", Q_L="down")
        assert outcome.exit_code == 0
        (tmp_path / "pool").mkdir()
        pool = go(tmp_path / "pool", rows, head="time,in,level", u_Qi="in", h_L="level", u_Qo="")
        assert pool.exit_code == 0
        for folder, config in ((tmp_path, outcome.run_config), (tmp_path / "pool", pool.run_config)):
            data = written(folder / "logs", load_config(config))
            assert data.outflow is None and data.inflow[3] == 303 and data.output[3] == 293


class TestTimes:
    def test_rows_out_of_order_are_sorted_and_counted(self, tmp_path):
        rows = wide()
        rows[10], rows[20] = rows[20], rows[10]
        outcome = go(tmp_path, rows)
        assert value(outcome) == {"read": 96, "used": 96, "dropped": {}, "sorted": 10}

    def test_duplicates_that_agree_are_dropped_and_those_that_do_not_refuse_the_day(self, tmp_path):
        rows = wide(192)
        outcome = go(tmp_path, [*rows, rows[4]])
        assert value(outcome)["dropped"] == {"duplicate": 1} and outcome.exit_code == 0
        (tmp_path / "b").mkdir()
        other = [rows[4][0], "1.5", *rows[4][2:]]
        outcome = go(tmp_path / "b", [*rows, other])
        assert statuses(outcome) == ["refused", "written"]
        assert (
            "line 194: 2008-03-10 01:00 is logged twice with different u_Qi: 304 and 1.5 (export.csv, line 6)"
            in (outcome.days[0].reason)
        )

    def test_an_ambiguous_hour_is_counted_and_refuses_its_day(self, tmp_path):
        paris = "Europe/Paris"
        day = dt.date(2008, 10, 25)
        midnight = dt.datetime(2008, 10, 25, tzinfo=dt.timezone(dt.timedelta(hours=2)))
        rows = []
        for k in range(96 + 100):
            moment = (midnight + dt.timedelta(seconds=900 * k)).astimezone(ZoneInfo(paris))
            rows.append([f"{moment:%Y-%m-%dT%H:%M}", f"{300 + k}", "290", "118.5"])
        outcome = go(tmp_path, rows, time_zone=paris)
        assert statuses(outcome) == ["written", "refused"] and outcome.days[0].date == day
        assert "[input] ambiguous" in outcome.days[1].reason
        assert value(outcome)["dropped"] == {"ambiguous or impossible time": 8, "refused day": 92}
        (tmp_path / "b").mkdir()
        result = go(tmp_path / "b", rows, time_zone=paris, ambiguous="order")
        assert statuses(result) == ["written", "written"] and value(result)["used"] == 196
        assert (tmp_path / "b" / "logs" / "2008-10-26.csv").read_text().count("\n") == 101
        (tmp_path / "c").mkdir()
        reason = go(tmp_path / "c", rows, time_zone="Etc/GMT-1").days[1].reason
        assert "logged twice" in reason and reason.endswith("its [input] time_zone is not Etc/GMT-1")

    def test_files_with_days_that_differ_need_a_zone(self, tmp_path):
        a = write(tmp_path / "a.csv", wide())
        b = write(tmp_path / "b.csv", wide(first=NEXT, zone="+02:00"))
        with pytest.raises(ConfigError, match="different UTC offsets: set .* time_zone"):
            ingest([a, b], tmp_path / "logs", parse({"reach": REACH}, Config))


def changes(*rows):
    return [[f"2008-03-10T{t}+01:00", tag, v, *more] for t, tag, v, *more in rows]


HOLD = {"layout": "long", "tag": "tag"}


class TestByException:
    """Values that are logged on change."""

    def rows(self):
        """Return rows with a change of the inflow each hour, at odd minutes; the others are regular."""
        rows = []
        for k in range(96):
            time = f"{k // 4:02d}:{15 * (k % 4):02d}:00"
            rows += [(time, "u_Qo", "300"), (time, "h_L", "118.5")]
            if k % 4 == 0:
                rows.append((f"{k // 4:02d}:0{7 if k else 0}:00", "u_Qi", f"{300 + k}"))
        return rows

    def test_it_is_refused_where_it_is_not_declared_or_held_too_short(self, tmp_path):
        rows = self.rows()
        uneven = [row for i, row in enumerate(rows) if row[1] != "u_Qi" or i % 2]
        for export, more in ((uneven, {}), (rows, {"hold": {"u_Qi": 2000}, "max_gap": 0})):
            outcome = go(tmp_path, changes(*export), head="time,tag,value", **more, **HOLD)
            assert statuses(outcome) == ["refused"] and "gap of" in outcome.days[0].reason

    def test_declared_it_is_sampled_and_held(self, tmp_path):
        outcome = go(tmp_path, changes(*self.rows()), head="time,tag,value", hold={"u_Qi": 4000}, **HOLD)
        assert outcome.exit_code == 0
        data = written(tmp_path / "logs", load_config(outcome.run_config))
        # the change at 01:07 is visible at 01:15
        expected = [300 + 4 * ((k - 1) // 4 if k >= 5 else 0) for k in range(96)]
        np.testing.assert_array_equal(data.inflow, expected)
        assert data.n_filled == 0
        assert value(outcome)["used"] == 24

    def test_a_state_ends_what_was_held(self, tmp_path):
        rows = [*self.rows(), ("10:20:00", "u_Qi", "Comm Fail")]
        missing = ["", "Comm Fail"]
        outcome = go(
            tmp_path, changes(*rows), head="time,tag,value", hold={"u_Qi": 4000}, missing=missing,
            max_gap=3600, **HOLD,
        )  # fmt: skip
        assert outcome.exit_code == 0 and outcome.days[0].filled == 3  # 10:30, 10:45, 11:00
        table = (tmp_path / "logs" / f"{DAY}.csv").read_text().splitlines()
        assert [line.split(",")[1] for line in table[42:47]] == ["340", "", "", "", "344"]

    def test_what_comes_between_two_samples_is_counted(self, tmp_path):
        rows = [*self.rows(), ("10:01:00", "u_Qi", "999")]
        outcome = go(tmp_path, changes(*rows), head="time,tag,value", hold={"u_Qi": 4000}, **HOLD)
        assert value(outcome)["dropped"] == {"between samples": 1} and value(outcome)["used"] == 24
        assert "999" not in (tmp_path / "logs" / f"{DAY}.csv").read_text()

    def test_a_value_is_held_over_midnight(self, tmp_path):
        rows = changes(*self.rows()) + [
            [row[0].replace("-10T", "-11T"), *row[1:]]
            for row in changes(*self.rows())
            if not (row[1] == "u_Qi" and row[0][11:16] < "01")
        ]
        outcome = go(tmp_path, rows, head="time,tag,value", hold={"u_Qi": 7200}, **HOLD)
        assert statuses(outcome) == ["written", "written"]
        first = (tmp_path / "logs" / f"{NEXT}.csv").read_text().splitlines()[1]
        assert first == "2008-03-11T00:00:00+01:00,392,300,118.5"

    def test_all_by_exception_a_day_without_a_change_is_held_and_a_last_midnight_is_no_day(self, tmp_path):
        rows = [
            [f"{day}T00:00:00+01:00", tag, value]
            for day in (DAY, NEXT, NEXT + dt.timedelta(days=2))
            for tag, value in (("u_Qi", "300"), ("u_Qo", "290"), ("h_L", "118.5"))
        ]
        hold = dict.fromkeys(("u_Qi", "u_Qo", "h_L"), 3 * 86_400)
        outcome = go(tmp_path, rows, head="time,tag,value", hold=hold, **HOLD)
        assert statuses(outcome) == ["written"] * 3 and outcome.exit_code == 0
        assert value(outcome)["used"] == 2 and value(outcome)["dropped"] == {"not asked for": 1}

    def test_all_by_exception_without_a_possible_time_gives_no_day(self, tmp_path):
        rows = wide(1, 9, dt.date(2008, 3, 30), zone="")  # 02:15, which the clock does not show that night
        hold = dict.fromkeys(("u_Qi", "u_Qo", "h_L"), 7200)
        outcome = go(tmp_path, rows, time_zone="Europe/Paris", hold=hold)
        assert outcome.days == [] and outcome.exit_code == 10
        assert value(outcome)["dropped"] == {"ambiguous or impossible time": 1}

    def test_run_itself_refuses_such_a_configuration(self, tmp_path):
        write(tmp_path / f"{DAY}.csv", wide())
        for table in ({"hold": {"u_Qi": 60}}, {"layout": "long"}):
            with pytest.raises(ConfigError, match="rivid ingest"):
                find_days(tmp_path, parse({"reach": REACH, "input": table}, Config))


class TestFlags:
    def test_an_undeclared_column_of_flags_is_refused(self, tmp_path):
        rows = [[*row, "B" if k == 7 else "G"] for k, row in enumerate(wide())]
        with pytest.raises(ConfigError, match=r"'q' \('B', 'G'\) may hold flags .* quality and good"):
            go(tmp_path, rows, head="time,u_Qi,u_Qo,h_L,q")
        outcome = go(tmp_path, rows, head="time,u_Qi,u_Qo,h_L,q", ignore=["q"])
        assert outcome.exit_code == 0 and value(outcome)["used"] == 96

    def test_declared_they_are_counted_by_flag_and_run_reads_the_export_alike(self, tmp_path):
        rows = [[*row, {7: "B", 8: "?"}.get(k, "G")] for k, row in enumerate(wide())]
        given = {"quality": "q", "good": ["G"], "max_gap": 3600}
        outcome = go(tmp_path, rows, head="time,u_Qi,u_Qo,h_L,q", **given)
        assert outcome.ledger["flags"] == {"B": 3, "?": 3} and outcome.days[0].filled == 2
        config = parse({"reach": REACH, "input": given}, Config)
        straight = written(tmp_path / "export.csv", config)
        assert straight.n_filled == 2 and straight.notes == "6 flagged values dropped"
        made = written(tmp_path / "logs", load_config(outcome.run_config))
        np.testing.assert_array_equal(made.inflow, straight.inflow)

    def test_a_unit_that_the_export_states_must_be_declared(self, tmp_path):
        head = "time,Q cfs,out,level (ft)"
        given = {"u_Qi": "Q cfs", "u_Qo": "out", "h_L": "level (ft)"}
        with pytest.raises(ConfigError, match=r"'Q cfs' seems to be in cfs: set \[input.units\] u_Qi"):
            go(tmp_path, wide(), head=head, **given)
        units = {"u_Qi": "cfs", "h_L": "m"}  # the declaration overrides the name
        assert go(tmp_path, wide(), head=head, units=units, **given).exit_code == 0


class TestNames:
    def test_a_column_that_no_export_holds_is_reported_with_the_nearest(self, tmp_path):
        with pytest.raises(ConfigError, match="no export holds 'u_Qout' for u_Qo; nearest is 'u_Qo'"):
            go(tmp_path, wide(), u_Qo="u_Qout")
        rows = changes(("00:00:00", "in", "1"), ("00:00:00", "LEVEL", "118"), ("00:00:00", "out", "1"))
        given = {"u_Qi": "in", "u_Qo": "out", "h_L": "LEVL"}
        with pytest.raises(ConfigError, match="no export holds 'LEVL' for h_L; nearest is 'LEVEL'"):
            go(tmp_path, rows, head="time,tag,value", **HOLD, **given)

    def test_logs_that_ingest_wrote_say_where_their_configuration_is(self, tmp_path):
        rows = wide()
        go(tmp_path, rows, head="time,in,out,level", u_Qi="in", u_Qo="out", h_L="level")
        config = parse({"reach": REACH, "input": {"u_Qi": "in", "u_Qo": "out", "h_L": "level"}}, Config)
        with pytest.raises(DataError, match="`rivid ingest` wrote, the configuration is next to them"):
            written(tmp_path / "logs", config)

    def test_a_parquet_log_with_flags_is_read_like_a_csv_log_with_flags(self, tmp_path):
        rows = [[*row, "B" if k == 7 else "G"] for k, row in enumerate(wide(96))]
        (tmp_path / "csv").mkdir()
        write(tmp_path / "csv" / f"{DAY}.csv", rows, "time,u_Qi,u_Qo,h_L,q")
        table = pa.csv.read_csv(tmp_path / "csv" / f"{DAY}.csv")
        (tmp_path / "parquet").mkdir()
        pa.parquet.write_table(table, tmp_path / "parquet" / f"{DAY}.parquet")
        given = {"quality": "q", "good": ["G"], "time_zone": "Etc/GMT-1", "max_gap": 3600}
        config = parse({"reach": REACH, "input": given}, Config)
        days = [written(tmp_path / form, config) for form in ("csv", "parquet")]
        assert days[0].notes == days[1].notes == "3 flagged values dropped"
        assert days[0].n_filled == days[1].n_filled == 1
        np.testing.assert_array_equal(days[0].output, days[1].output)
        config = parse({"reach": REACH, "input": {**given, "quality": "p"}}, Config)
        with pytest.raises(DataError, match="no column 'p' for quality; there are"):
            written(tmp_path / "parquet", config)


class TestCommand:
    def test_days_with_the_same_reason_are_one_line(self, capsys):
        reasons = ["", "gap", "gap", "gap", "", "late", "gap"]
        days = [
            SimpleNamespace(date=dt.date(2008, 3, 1 + k), status="refused", reason=reason)
            for k, reason in enumerate(reasons)
        ]
        _print_days(SimpleNamespace(days=days))
        assert [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()] == [
            "2008-03-02 to 2008-03-04, 3 days refused gap", "2008-03-06 refused late",
            "2008-03-07 refused gap",
        ]  # fmt: skip

    def test_converted_and_summed_values_have_the_digits_that_are_measured(self, tmp_path):
        rows = [[row[0], "4.1287", "4.1134", "0.1", "118.5"] for row in wide()]
        write(tmp_path / "e.csv", rows, head="time,a,b,c,d")
        config = tmp_path / "c.toml"
        config.write_text(
            '[reach]\nsample_time = 900\n[input]\nu_Qi = "a"\nu_Qo = ["b", "c"]\nh_L = "d"\n'
            '[input.units]\nu_Qi = "L/s"\nu_Qo = "L/s"\n'
        )
        assert self.invoke(tmp_path, config=config).return_value == 0
        cells = (tmp_path / "logs/2008-03-10.csv").read_text().splitlines()[1].split(",")
        assert cells[1:] == ["0.0041287", "0.0042134", "118.5"]

    def test_days_that_differ_are_one_line(self, tmp_path):
        for size in (1, 2):
            write(tmp_path / "e.csv", [[*row[:3], f"118.{size}"] for row in wide(n=288)])
            result = self.invoke(tmp_path)
        (line,) = (line for line in result.output.splitlines() if "differs" in line)
        assert line.startswith("2008-03-10 to 2008-03-12, 3 days  differs   2008-03-10.csv is there and")

    def invoke(self, tmp_path, *words, config=None):
        if not config:
            config = tmp_path / "c.toml"
            config.write_text("[reach]\nsample_time = 900\n")
        args = ["ingest", tmp_path / "e.csv", "-c", config, "-o", tmp_path / "logs", *words]
        return CliRunner().invoke(cli, list(map(str, args)), standalone_mode=False)

    def test_table_json_and_exit_codes(self, tmp_path):
        write(tmp_path / "e.csv", wide(n=150))
        result = self.invoke(tmp_path)
        assert result.return_value == 3
        assert "2008-03-11  refused" in result.output and "refused day" in result.output
        assert "2 days: 1 written, 1 refused" in result.output
        result = json.loads(self.invoke(tmp_path, "--json").output)
        assert result["counts"] == {"identical": 1, "refused": 1}
        assert result["values"]["sources"]["h_L"]["dropped"] == {"refused day": 54}
        assert result["values"]["files"][0]["rows"] == 150
        assert self.invoke(tmp_path, "--to", "2008-03-10").return_value == 0
        assert self.invoke(tmp_path, "--from", "2009-01-01").return_value == 10

    def test_the_configuration_of_the_exports_is_never_overwritten_and_the_next_commands_are_printed(
        self, tmp_path
    ):
        write(tmp_path / "e.csv", wide())
        *_, first, second = self.invoke(tmp_path).output.splitlines()
        config = tmp_path / "logs_run.toml"
        assert first == f"next: rivid check {tmp_path / 'logs'} --config {config}"
        assert second == f"then: rivid run {tmp_path / 'logs'} --config {config}"
        result = self.invoke(tmp_path, "--force", "--run-config", str(tmp_path / "c.toml"))
        assert isinstance(result.exception, ConfigError) and "is the --config itself" in str(result.exception)
        (tmp_path / "c.toml").rename(tmp_path / "logs_run.toml")
        for more in ([], ["--force"]):
            result = self.invoke(tmp_path, *more, config=tmp_path / "logs_run.toml")
            assert isinstance(result.exception, ConfigError)
            assert "choose another --run-config" in str(result.exception)
        assert (tmp_path / "logs_run.toml").read_text() == "[reach]\nsample_time = 900\n"


TAGS = enumerate(("u_Qi", "u_Qo", "h_L"), 1)
LONG = "\n".join(["time,tag,value", *(f"{r[0]},{tag},{r[j]}" for j, tag in TAGS for r in wide())])
SEEDS = {
    "wide": ("\n".join(["time,u_Qi,u_Qo,h_L", *(",".join(row) for row in wide())]) + "\n").encode(),
    "long": (LONG + "\n").encode(),
}


@pytest.mark.parametrize("kind", SEEDS)
@given(data=st.data())
@settings(
    max_examples=examples(40), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_whatever_bytes_an_export_holds_the_account_is_whole_or_there_is_a_reason(tmp_path, kind, data):
    path = tmp_path / "export.csv"
    path.write_bytes(data.draw(mutated(SEEDS[kind])))
    config = parse({"reach": REACH, "input": HOLD if kind == "long" else {}}, Config)
    try:
        outcome = ingest([path], tmp_path / "logs", config, force=True, dry_run=True)
    except RividError as error:
        assert error.exit_code in (1, 2, 10) and "\n" not in str(error)
        return
    for entry in outcome.ledger["sources"].values():
        assert entry["read"] == entry["used"] + sum(entry["dropped"].values())
    for file in outcome.ledger["files"]:
        assert file["unreadable_rows"] >= 0


def test_a_damaged_file_is_no_configuration_fault(tmp_path):
    path = tmp_path / "a.csv.gz"
    path.write_bytes(b"\x1f\x8b\x08\0garbage")
    with pytest.raises(DataError) as caught:
        ingest([path], tmp_path / "logs", parse({"reach": REACH}, Config))
    assert caught.value.exit_code == 1 and not isinstance(caught.value, ConfigError)
    assert "rivid sniff" not in str(caught.value)
