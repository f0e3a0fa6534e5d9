"""Test a day on its grid: names, units, stamps, gaps, duplicates, windows."""

import datetime as dt

import numpy as np
import pytest

from rivid.errors import DataError, PendingError
from rivid.logs.days import find_days, read_window
from tests.daily import a_day, write_days
from tests.logs.helpers import DAY, HEAD, config, put, read, rows

RIVER = {"kind": "river", "sample_time": 900}


def test_a_canonical_day_is_read_as_written(tmp_path):
    data = read(put(tmp_path, rows()))
    _, inflow, outflow, level = a_day(DAY)
    assert (data.inflow == inflow).all() and (data.outflow == outflow).all() and (data.output == level).all()
    assert (data.date, data.n_filled, data.notes) == (DAY, 0, "")


def test_quick_and_tolerant_reading_give_the_same_bits(tmp_path, monkeypatch):
    lines = rows()
    lines[40][3] = "NA"
    quick = read(put(tmp_path / "a", lines))
    monkeypatch.setattr("rivid.logs.log.read_fast", lambda *_: None)
    slow = read(put(tmp_path / "b", lines))
    assert (quick.output == slow.output).all() and (quick.inflow == slow.inflow).all()
    assert quick.n_filled == slow.n_filled == 1


def test_columns_may_be_renamed_summed_and_converted(tmp_path):
    lines = [[r[0], r[1], "100", r[2], "12.5", r[3]] for r in rows()]
    folder = put(tmp_path, lines, head="when,q_in,unit1,unit2,spill,stage")
    data = read(
        folder, time="when", u_Qi="q_in", u_Qo=["unit1", "unit2", "spill"], h_L="stage",
        units={"u_Qi": "cfs", "h_L": "ft"},
    )  # fmt: skip
    _, inflow, outflow, level = a_day(DAY)
    np.testing.assert_allclose(data.inflow, inflow * 0.028316846592, rtol=1e-15)
    np.testing.assert_allclose(data.outflow, outflow + 112.5, rtol=1e-15)
    np.testing.assert_allclose(data.output, level * 0.3048, rtol=1e-15)


def test_a_pool_whose_outflow_is_not_logged_and_a_river_need_two_columns(tmp_path):
    pool = put(tmp_path / "pool", [[r[0], r[1], r[3]] for r in rows()], head="time,u_Qi,h_L")
    data = read(pool, u_Qo="")
    assert data.outflow is None and len(data.inflow) == 650
    lines = [[r[0], r[1], r[2]] for r in rows(n=96, step=900)]
    data = read(put(tmp_path / "river", lines, head="time,u_Qi,Q_L"), reach=RIVER)
    assert data.outflow is None and (data.output == [float(r[2]) for r in lines]).all()


def test_hourly_commands_between_quarter_hours_are_held_and_no_gap(tmp_path):
    lines = [
        [r[0], str(100 + k // 4) if k % 4 == 0 else "", r[2]] for k, r in enumerate(rows(n=96, step=900))
    ]
    folder = put(tmp_path, lines, head="time,u_Qi,Q_L")
    data = read(folder, reach=RIVER, interval={"u_Qi": 3600})
    assert (data.inflow == 100 + np.arange(96) // 4).all()
    assert data.n_filled == 0
    with pytest.raises(DataError, match=r"u_Qi comes every 60 min: .* set \[input.interval\] u_Qi = 3600"):
        read(folder, reach=RIVER)


def test_a_stamp_at_the_end_moves_the_command_to_the_start_of_its_interval(tmp_path):
    lines = rows(n=96, step=900, start=900)  # 00:15 ... 24:00
    folder = put(tmp_path, [[r[0], r[1], r[2]] for r in lines], head="time,u_Qi,Q_L")
    data = read(folder, reach=RIVER, stamp={"u_Qi": "end", "Q_L": "end"})
    assert (data.inflow == [float(r[1]) for r in lines]).all()
    assert (data.output == [float(r[2]) for r in lines]).all()
    assert data.n_filled == 0 and data.notes == ""
    late = read(folder, reach=RIVER, stamp={"u_Qi": "end"})
    assert (late.inflow == data.inflow).all()
    assert (late.output[1:] == data.output[:-1]).all()


@pytest.mark.parametrize(("column", "step"), [("u_Qi", 60), ("h_L", 60), ("u_Qi", 300)])
def test_a_stamp_at_the_end_of_an_undeclared_interval_is_asked_for(tmp_path, column, step):
    lines = rows(n=86_400 // step, step=step, start=step)
    put(tmp_path, lines)
    with pytest.raises(DataError) as caught:
        read(tmp_path, stamp={column: "end"}, max_filled=1)
    assert f"{column} is stamped at the end of its interval" in str(caught.value)
    assert f"comes every {step} s, not every 133 s as [reach] sample_time" in str(caught.value)
    assert str(caught.value).endswith(f": set [input.interval] {column} = {step}")
    declared = read(tmp_path, stamp={column: "end"}, interval=dict.fromkeys(("u_Qi", "u_Qo", "h_L"), step))
    if column == "u_Qi":
        each = np.repeat([float(line[1]) for line in lines], step)
        means = [each[133 * k : 133 * (k + 1)].mean() for k in range(650)]
        np.testing.assert_allclose(declared.inflow, means, rtol=1e-12)


def test_commands_are_averaged_and_levels_interpolated(tmp_path):
    lines = rows(step=133, start=66)
    data = read(put(tmp_path, lines[:649]))
    inflow, level = np.array([[float(r[1]), float(r[3])] for r in lines]).T
    mixed = (66 * inflow[:648] + 67 * inflow[1:649]) / 133
    np.testing.assert_allclose(data.inflow[1:649], mixed, rtol=1e-12)
    np.testing.assert_allclose(data.output[1:649], level[:648] + 67 / 133 * np.diff(level)[:648], rtol=1e-12)
    assert data.n_filled == 1  # before the first row


def test_clocks_rounded_to_milliseconds_decide_no_sample(tmp_path):
    lines = []
    for k in range(2592):
        t = round(k * 100 / 3 + 0.0004, 3)
        time = f"2008-03-10T{int(t) // 3600:02d}:{int(t) // 60 % 60:02d}:{t % 60:06.3f}+01:00"
        lines.append([time, str(k), "5", "1"])
    data = read(put(tmp_path, lines), reach={"sample_time": 100 / 3})
    assert (data.inflow == np.arange(2592)).all()


def test_a_short_gap_is_filled_and_counted(tmp_path):
    lines = rows()
    del lines[100:104]
    data = read(put(tmp_path, lines))
    _, inflow, _, level = a_day(DAY)
    assert data.n_filled == 4
    assert (data.inflow[100:104] == inflow[99]).all()
    np.testing.assert_allclose(
        data.output[100:104], np.interp([1, 2, 3, 4], [0, 5], level[[99, 104]]), rtol=1e-12
    )


def test_a_long_gap_fails_the_day_and_reports_where(tmp_path):
    lines = rows()
    for line in lines[354:375]:
        line[3] = ""
    with pytest.raises(
        DataError, match=r"gap of 47 min from 13:04:42 in h_L \(limit 10 min, \[input\] max_gap\)"
    ):
        read(put(tmp_path, lines))
    assert read(tmp_path, max_gap=3600).n_filled == 21


def test_too_many_short_gaps_fail_the_day(tmp_path):
    lines = [r for k, r in enumerate(rows()) if k % 3 == 0]
    with pytest.raises(DataError, match=r"67% of the samples lie in gaps .* the log comes every 399 s"):
        read(put(tmp_path, lines))


@pytest.mark.parametrize(
    ("reach", "hint"),
    [
        ({}, r"max_filled\); \[reach\] sample_time is not set: the log comes every 300 s"),
        ({"sample_time": 120}, r"\[reach\] sample_time = 120 s, but the log comes every 300 s"),
    ],
)
def test_a_log_coarser_than_the_sample_time_names_that_key_first(tmp_path, reach, hint):
    put(tmp_path, rows(n=288, step=300))
    with pytest.raises(DataError, match=hint + r": set \[reach\] sample_time = 300; or, .*interval\] u_Qi"):
        read(tmp_path, reach=reach)
    assert read(tmp_path, reach={"sample_time": 300}).n_filled == 0


def test_one_column_coarser_than_the_others_names_its_interval(tmp_path):
    lines = [[r[0], r[1] if k % 3 == 0 else "", *r[2:]] for k, r in enumerate(rows(n=288, step=300))]
    with pytest.raises(DataError, match=r"; u_Qi comes every 15 min: .* set \[input.interval\] u_Qi = 900$"):
        read(put(tmp_path, lines), reach={"sample_time": 300})


def test_a_coarser_log_is_read_where_declared(tmp_path):
    data = read(put(tmp_path, rows(n=288, step=300)), interval={"u_Qi": 300, "u_Qo": 300, "h_L": 300})
    assert (len(data.inflow), data.n_filled) == (650, 0)


def halved(lines):
    """Write a row in two halves."""
    half = [*lines[299][:3], ""]
    lines[299][1] = ""
    return [*lines[:300], half, *lines[300:]]


@pytest.mark.parametrize(
    ("edit", "notes"),
    [
        (lambda lines: [*lines[:300], lines[299], lines[299], *lines[300:]], "2 duplicates dropped"),
        (halved, "1 duplicates dropped"),
        (
            lambda lines: [*lines[:10], lines[500], *lines[11:500], lines[10], *lines[501:]],
            "490 rows out of order sorted",
        ),
        (lambda lines: rows(DAY - dt.timedelta(days=1))[-7:] + lines, "7 rows of other days dropped"),
        (lambda lines: [[*r, "ok", "", '"a, b"'] for r in lines], ""),
    ],
    ids=["duplicates", "halves", "out of order", "other days", "unused columns"],
)
def test_rows_that_change_no_value_are_sorted_or_dropped_and_counted(tmp_path, edit, notes):
    lines = edit(rows())
    data = read(put(tmp_path, lines, head=HEAD + ",,note,note" if len(lines[0]) > 4 else HEAD))
    assert data.notes == notes
    for values, truth in zip((data.inflow, data.outflow, data.output), a_day(DAY)[1:], strict=True):
        assert (values == truth).all()


def test_duplicates_that_conflict_fail_the_day(tmp_path):
    lines = rows()
    lines.insert(300, [*lines[299][:3], "99.5"])
    with pytest.raises(DataError, match=r"2008-03-10.csv, line 302: 2008-03-10 11:02:47 is logged twice with "
                       r"different h_L: .* and 99.5 \(line 301\)"):  # fmt: skip
        read(put(tmp_path, lines))


def test_a_file_of_another_day_reports_which_days_it_holds(tmp_path):
    folder = put(tmp_path, rows(DAY + dt.timedelta(days=5)))
    with pytest.raises(DataError, match="2008-03-10.csv holds 2008-03-15 and nothing of 2008-03-10"):
        read(folder)


def test_sentinels_are_masked_and_counted(tmp_path):
    lines = rows()
    for k in (5, 200, 201):
        lines[k][3] = "-999.0"
    data = read(put(tmp_path, lines), sentinels=[-999, -1000])
    assert data.notes == "3 sentinels masked"
    assert data.n_filled == 3 and data.output.min() > 100


def test_a_window_is_one_regular_grid(tmp_path):
    write_days(tmp_path, 3)
    settings = config(window_days=3)
    data = read_window(tmp_path, find_days(tmp_path, settings).days, settings)
    assert len(data.inflow) == -(-3 * 86400 // 133)
    assert data.date == DAY + dt.timedelta(days=2)
    assert (data.inflow[:649] == a_day(DAY)[1][:649]).all()
    # the second day's rows begin 50 s before the grid's: a command of 00:00 holds at 00:00:50
    assert data.inflow[650] == a_day(DAY + dt.timedelta(days=1))[1][0]


def test_days_of_a_window_must_follow_each_other(tmp_path):
    write_days(tmp_path, 3)
    days = find_days(tmp_path, config()).days
    with pytest.raises(DataError, match="not consecutive"):
        read_window(tmp_path, [days[0], days[2]], config())


def fails(folder, match=None, **given):
    """Check that the day fails permanently."""
    with pytest.raises(DataError, match=match) as caught:
        read(folder, **given)
    assert not isinstance(caught.value, PendingError)


class TestToday:
    def test_a_log_that_ends_early_or_in_a_torn_line_today_is_pending(self, tmp_path):
        folder = put(tmp_path, rows()[:400])
        with pytest.raises(PendingError, match="2008-03-10 is not finished: gap of 9.2 h from 14:46:40"):
            read(folder, today=DAY)
        fails(folder, today=DAY + dt.timedelta(days=1))
        with (folder / f"{DAY}.csv").open("a") as file:
            file.write("2008-03-10T14:46:40+01:00,30")
        with pytest.raises(PendingError):
            read(folder, today=DAY)

    @pytest.mark.parametrize(
        ("zone", "given", "last_hour", "first_hour_after"),
        [
            ("+01:00", {}, "2008-03-10T22:59", "2008-03-10T23:00"),
            ("-07:00", {}, "2008-03-11T06:59", "2008-03-11T07:00"),
            ("", {"time_zone": "Asia/Tokyo"}, "2008-03-10T14:59", "2008-03-10T15:00"),
        ],
    )
    def test_a_moment_is_a_day_of_the_logs_zone(self, tmp_path, zone, given, last_hour, first_hour_after):
        folder = put(tmp_path, rows(zone=zone)[:400])
        moment, after = (dt.datetime.fromisoformat(text + "Z") for text in (last_hour, first_hour_after))
        for same in (moment, moment.astimezone(dt.timezone.max)):
            with pytest.raises(PendingError):
                read(folder, today=same, **given)
        fails(folder, today=after, **given)

    def test_a_log_without_any_row_is_pending_until_its_day_is_over_everywhere(self, tmp_path):
        (tmp_path / f"{DAY}.csv").write_text("")
        with pytest.raises(PendingError, match="2008-03-10.csv is empty"):
            read(tmp_path, today=dt.datetime.fromisoformat("2008-03-11T11:59Z"))
        fails(tmp_path, "2008-03-10.csv is empty", today=dt.datetime.fromisoformat("2008-03-11T12:00Z"))

    def test_a_complete_log_of_today_is_read_and_a_conflict_is_a_failure(self, tmp_path):
        lines = rows()
        assert len(read(put(tmp_path, lines), today=DAY).inflow) == 650
        lines[300:] = [[*lines[299][:3], "99.5"], *lines[300:400]]
        fails(put(tmp_path, lines), "twice", today=DAY)


def test_a_fault_in_a_file_of_many_days_fails_its_day_only(tmp_path):
    lines = rows() + rows(DAY + dt.timedelta(days=1)) + rows(DAY + dt.timedelta(days=2))
    lines[800][1] = "ERR"
    lines[1200] = ["garbage"]
    folder = put(tmp_path, lines, name="march.csv")
    assert len(read(folder, day=DAY).inflow) == 650
    with pytest.raises(DataError, match=r"march.csv, line 802: column 'u_Qi' holds 'ERR'.*\(and 1 more\)"):
        read(folder, day=DAY + dt.timedelta(days=1))
    assert read(folder, day=DAY + dt.timedelta(days=2)).notes == ""


def test_reading_every_day_of_a_file_parses_it_once(tmp_path, monkeypatch):
    import rivid.logs.log as log

    lines = [row for k in range(5) for row in rows(DAY + dt.timedelta(days=k))]
    folder = put(tmp_path, lines, name="march.csv")
    catalog = find_days(folder, config())
    parsed = []
    monkeypatch.setattr(
        log, "read_table", lambda *given, real=log.read_table: parsed.append(1) or real(*given)
    )
    log._kept.clear()
    settings = config()
    for source in catalog.days:
        read_window(folder, [source], settings)
    assert len(parsed) == 1
