"""Test rows at midnight: the last row of a day may be in the next file, and is no day of its own."""

import datetime as dt
import json

import numpy as np
import pytest

from rivid.errors import DataError, NoDataError, PendingError
from rivid.logs.days import FileFacts, find_days, read_window
from tests.logs.helpers import DAY, config, put, rows, text

STEP, N_DAYS = 900, 3
RIVER = {"kind": "river", "sample_time": STEP}
END = {"u_Qi": "end", "Q_L": "end"}
HEAD = "time,u_Qi,Q_L"
DATES = [DAY + dt.timedelta(days=k) for k in range(N_DAYS + 1)]


def river(n_days=N_DAYS, stamp=STEP):
    """Return rows of consecutive days, stamped at the end of their intervals."""
    lines = []
    for k in range(n_days):
        for i, row in enumerate(rows(DAY + dt.timedelta(days=k), n=96, step=STEP, start=stamp)):
            lines.append([row[0], row[1], f"{200 + (7 * i) % 50 + k}"])
    return lines


def by_label(folder, lines):
    """Write a file per day of the stamps: the row of 24:00 is in the next day's file."""
    for date in sorted({line[0][:10] for line in lines}):
        put(folder, [line for line in lines if line[0][:10] == date], name=f"{date}.csv", head=HEAD)
    return folder


def days_of(folder, settings, **options):
    return find_days(folder, settings, **options).days


def same(a, b):
    return (a.inflow == b.inflow).all() and (a.output == b.output).all() and a.n_filled == b.n_filled == 0


class TestAFilePerDayStampedAtTheEnd:
    @pytest.fixture
    def settings(self):
        return config(RIVER, stamp=END)

    @pytest.fixture
    def folder(self, tmp_path):
        return by_label(tmp_path / "days", river())

    def test_it_reads_like_one_file_of_all_days(self, folder, tmp_path, settings):
        one = put(tmp_path / "one", river(), name="all.csv", head=HEAD)
        days, whole = days_of(folder, settings), days_of(one, settings)
        assert [d.date for d in days] == [d.date for d in whole] == DATES[:-1]
        for a, b in zip(days, whole, strict=True):
            data = read_window(folder, [a], settings)
            assert same(data, read_window(one, [b], settings)) and data.notes == ""
        assert same(read_window(folder, days, settings), read_window(one, whole, settings))

    def test_a_change_of_the_next_file_is_a_change_of_the_day(self, folder, settings):
        before = days_of(folder, settings)
        file = folder / f"{DATES[1]}.csv"
        lines = file.read_text().splitlines()
        assert "T00:00:00" in lines[1]
        lines[1] = lines[1].rsplit(",", 1)[0] + ",321"
        file.write_text("\n".join(lines) + "\n")
        after = days_of(folder, settings)
        changed = [a.date for a, b in zip(before, after, strict=True) if a != b]
        assert changed == DATES[:2]
        assert read_window(folder, [after[0]], settings).output[-1] == 321
        with pytest.raises(DataError, match="not what it was when it was listed"):
            read_window(folder, [before[0]], settings)

    def test_without_the_next_file_the_reason_states_what_is_missing(self, folder, settings):
        (folder / f"{DATES[-1]}.csv").unlink()
        last = days_of(folder, settings)[-1]
        with pytest.raises(DataError, match="gap of 15 min from 23:45 in u_Qi: the row that closes the day"):
            read_window(folder, [last], settings)
        with pytest.raises(PendingError):
            read_window(folder, [last], settings, today=last.date)

    def test_a_damaged_next_file_costs_its_own_day_and_that_row(self, folder):
        (folder / f"{DATES[1]}.csv").write_text("")
        settings = config(RIVER, stamp=END, max_gap=STEP)
        first, second, third = days_of(folder, settings)
        assert read_window(folder, [first], settings).n_filled == 1
        with pytest.raises(DataError, match="2008-03-11.csv is empty"):
            read_window(folder, [second], settings)
        assert read_window(folder, [third], settings).n_filled == 0

    @pytest.mark.parametrize("in_one_file", [False, True])
    def test_a_faulty_closing_row_is_not_taken(self, tmp_path, settings, in_one_file):
        lines = river()
        lines[95][1] = "-9999"
        folder = (
            put(tmp_path, lines, name="march.csv", head=HEAD) if in_one_file else by_label(tmp_path, lines)
        )
        for day in days_of(folder, settings)[:2]:
            with pytest.raises(DataError, match=r"line (2|97): column 'u_Qi' holds -9999"):
                read_window(folder, [day], settings)

    def test_its_own_closing_row_comes_first(self, folder, settings):
        (folder / f"{DAY}.csv").write_text(text(river(1), head=HEAD))  # 00:15 to 24:00
        data = read_window(folder, days_of(folder, settings)[:1], settings)
        assert data.notes == "" and data.output[-1] == float(river(1)[-1][2])

    def test_what_is_known_of_a_closing_row_alone_is_kept(self, folder, settings, monkeypatch):
        before = find_days(folder, settings)
        known = {
            name: FileFacts(**json.loads(json.dumps(vars(facts)))) for name, facts in before.files.items()
        }
        assert known == before.files
        monkeypatch.setattr("rivid.logs.days._hash", None)
        assert days_of(folder, settings, known=known) == before.days

    def test_off_the_hour(self, tmp_path):
        lines = river(stamp=STEP - 300)  # 00:10 to 23:55; the last row, at 00:10, belongs to no day
        settings = config(RIVER, stamp=END, max_gap=STEP)
        lines.append([f"{DATES[-1]}T00:10:00+01:00", "300", "250"])
        folder = by_label(tmp_path, lines)
        days = days_of(folder, settings)
        assert [d.date for d in days] == DATES[:-1]
        before, last = float(lines[-2][1]), 300.0  # the interval that ends at 00:10 begins at 23:55
        mixed = (before * 600 + last * 300) / STEP
        assert read_window(folder, days[-1:], settings).inflow[-1] == pytest.approx(mixed)


class TestARowAtMidnightAlone:
    @pytest.mark.parametrize(
        ("stamp", "after"),
        [({}, 1), ({"u_Qi": "end"}, 1), ({"h_L": "end"}, 1), ({"u_Qi": "end"}, 0),
         ({"u_Qi": "end", "u_Qo": "end", "h_L": "end"}, 0)],
    )  # fmt: skip
    def test_is_no_day_at_the_end_or_the_start_of_an_export(self, tmp_path, stamp, after):
        lines = rows() + rows(DATES[1]) + rows(DATES[2])[:after]
        folder = put(tmp_path, lines, name="march.csv")
        assert [d.date for d in days_of(folder, config(stamp=stamp))] == DATES[:2]

    def test_completes_a_day_of_another_file(self, tmp_path):
        lines = river()
        put(tmp_path, lines[:191], name="a.csv", head=HEAD)  # to 23:45 of the second day
        put(tmp_path, lines[191:], name="b.csv", head=HEAD)
        settings = config(RIVER, stamp=END)
        days = days_of(tmp_path, settings)
        assert [d.date for d in days] == DATES[:-1] and len(days[1].parts) == 2
        assert read_window(tmp_path, [days[1]], settings).inflow[-1] == float(lines[191][1])

    def test_is_a_day_where_a_day_has_few_rows(self, tmp_path):
        reach = {"kind": "river", "sample_time": 86_400}
        lines = [[f"{date}T00:00:00+01:00", "300", "301"] for date in DATES]
        folder = put(tmp_path, lines, name="march.csv", head=HEAD)
        assert [d.date for d in days_of(folder, config(reach))] == DATES

    def test_hides_no_broken_rows_behind_it(self, tmp_path):
        lines = rows() + rows(DATES[1])[:1] + [["2008-03-11T00:02:13+01:00", "ERR", "1", "1"]]
        folder = put(tmp_path, lines, name="march.csv")
        assert [d.date for d in days_of(folder, config())] == DATES[:2]

    def test_fails_in_a_days_own_file_and_is_no_data_elsewhere(self, tmp_path):
        own = put(tmp_path / "own", rows()[:1])
        with pytest.raises(DataError, match="gap of"):
            read_window(own, days_of(own, config()), config())
        put(tmp_path / "other", rows()[:1], name="march.csv")
        with pytest.raises(NoDataError, match="more of a day than the row at its midnight"):
            find_days(tmp_path / "other", config())


def test_a_log_from_midnight_to_midnight_drops_nothing(tmp_path):
    lines = [[r[0], r[1], r[3]] for r in rows(n=97, step=STEP)]
    folder = put(tmp_path, lines, head=HEAD)
    settings = config(RIVER, stamp=END)
    (day,) = days_of(folder, settings)
    data = read_window(folder, [day], settings)
    assert data.notes == "" and np.array_equal(data.inflow, [float(r[1]) for r in lines[1:]])
