"""Test each fault of a log: it gives a reason that names the file, and nothing else is lost."""

import datetime as dt
import gzip
import os
import pickle
import time
import zlib

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rivid.check import check
from rivid.errors import ConfigError, DataError, NoDataError
from rivid.logs import log
from rivid.logs.days import find_days, read_window
from tests.daily import a_day, text_of, write_days
from tests.logs.helpers import DAY, HEAD, config, put, read, rows, text
from tests.run.test_run import rivid


def parquet(folder, name=None, columns=None, **options):
    """Write the day as Parquet, with its own or other columns."""
    times, inflow, outflow, level = a_day(DAY)
    table = {
        "time": pa.array(
            np.array([t[:19] for t in times], "M8[us]") - 3_600_000_000, pa.timestamp("us", "+01:00")
        )
    }
    table |= {"u_Qi": inflow, "u_Qo": outflow, "h_L": level}
    folder.mkdir(exist_ok=True)
    path = folder / (name or f"{DAY}.parquet")
    pq.write_table(pa.table(table | (columns or {})), path, write_page_checksum=True, **options)
    return path


def reason(folder, **given):
    with pytest.raises(DataError) as caught:
        read(folder, **given)
    return str(caught.value)


SINCE = int(dt.datetime.fromisoformat(a_day(DAY)[0][0]).timestamp())
"""Time of the first row [s since 1970]."""


class TestParquet:
    def test_a_sound_file_reads_like_csv(self, tmp_path):
        parquet(tmp_path / "p")
        put(tmp_path / "c", rows())
        a, b = read(tmp_path / "p"), read(tmp_path / "c")
        assert (a.inflow == b.inflow).all() and (a.output == b.output).all()

    @pytest.mark.parametrize("cut", [0, 3, 8, "half", -1])
    def test_truncated(self, tmp_path, cut):
        path = parquet(tmp_path)
        content = path.read_bytes()
        end = len(content) // 2 if cut == "half" else cut
        path.write_bytes(content[:end])
        message = reason(tmp_path)
        assert message.startswith(f"{DAY}.parquet") and ("empty" in message or "PAR1" in message)

    def test_flipped_bytes_are_never_taken_as_data(self, tmp_path):
        path = parquet(tmp_path)
        content = path.read_bytes()
        good = read(tmp_path)
        rng = np.random.default_rng(1)
        refused = 0
        for at in rng.integers(4, len(content) - 4, 150):
            broken = bytearray(content)
            broken[at] ^= int(rng.integers(1, 256))
            path.write_bytes(broken)
            try:
                data = read(tmp_path)
            except DataError:
                refused += 1
            else:  # a byte without meaning, such as a name of the writer
                assert (data.inflow == good.inflow).all() and (data.output == good.output).all()
        assert refused > 100

    @pytest.mark.parametrize(
        ("columns", "given", "reason_part"),
        [
            ({}, {"h_L": "H_l"}, "no column 'H_l' for h_L; nearest is 'h_L'"),
            ({"u_Qi": [[1.0, 2.0]] * 650}, {}, "column 'u_Qi' is of type list"),
            ({"time": np.arange(650)}, {}, "column 'time' is of type int64: expected times or text"),
        ],
    )
    def test_wrong_columns(self, tmp_path, columns, given, reason_part):
        parquet(tmp_path, columns=columns)
        assert reason_part in reason(tmp_path, **given)

    @pytest.mark.parametrize(
        ("time_format", "unit", "kind"),
        [("unix", 1, np.int64), ("unix", 1, np.uint32), ("unix", 1, float), ("unix_ms", 1000, np.int64)],
    )
    def test_times_that_count_from_1970_are_read_where_declared(self, tmp_path, time_format, unit, kind):
        parquet(tmp_path, columns={"time": ((SINCE + 133 * np.arange(650)) * unit).astype(kind)})
        data = read(tmp_path, time_format=time_format, time_zone="Etc/GMT-1")
        assert (data.output == a_day(DAY)[3]).all() and data.notes == ""
        assert 'time_format = "unix" or "unix_ms"' in reason(tmp_path, time_zone="Etc/GMT-1")

    def test_days_of_a_spreadsheet_and_parts_of_dates_are_of_the_local_clock(self, tmp_path):
        clock = SINCE + 3600 + 133 * np.arange(650)
        parquet(tmp_path, columns={"time": np.round(clock / 86_400 + 25_569, 6)})
        data = read(tmp_path, time_format="excel", time_zone="Etc/GMT-1")
        assert (data.output == a_day(DAY)[3]).all() and data.notes == ""
        names = ("Y", "m", "d", "H", "M", "S")
        moments = clock.astype("M8[s]").tolist()
        parts = {name: [int(moment.strftime(f"%{name}")) for moment in moments] for name in names}
        parquet(tmp_path, columns=parts)
        data = read(tmp_path, time=[*names], time_format="%Y %m %d %H %M %S", time_zone="Etc/GMT-1")
        assert (data.output == a_day(DAY)[3]).all()

    def test_counts_of_no_year_and_no_counts(self, tmp_path):
        times = (SINCE + 133 * np.arange(650)).astype(object)
        for wrong, part in ((2**62, "a year that no log is of"), (None, "no time")):
            parquet(tmp_path, columns={"time": pa.array([*times[:8], wrong, *times[9:]], pa.int64())})
            assert f"row 9: {part}" in reason(tmp_path, time_format="unix", time_zone="Etc/GMT-1")

    def test_infinite_and_missing_numbers(self, tmp_path):
        level = a_day(DAY)[3].copy()
        level[20] = np.nan
        parquet(tmp_path, columns={"h_L": level})
        assert read(tmp_path).n_filled == 1
        level[21] = np.inf
        parquet(tmp_path, columns={"h_L": level})
        assert "row 22: column 'h_L' holds an infinite number" in reason(tmp_path)

    def test_rows_of_nulls_are_skipped_and_a_null_time_is_not(self, tmp_path):
        path = parquet(tmp_path)
        table = pq.read_table(path)
        nulls = pa.table(
            {n: pa.nulls(2, t) for n, t in zip(table.schema.names, table.schema.types, strict=True)}
        )
        pq.write_table(pa.concat_tables([table, nulls]), path)
        data = read(tmp_path)
        assert data.notes == "2 empty rows dropped" and (data.output == a_day(DAY)[3]).all()
        timeless = nulls.set_column(1, "u_Qi", pa.array([300.0, 300.0]))
        pq.write_table(pa.concat_tables([table, timeless]), path)
        assert "row 651: " in reason(tmp_path)

    def test_texts_are_read_like_csv(self, tmp_path):
        times, inflow, _, _ = a_day(DAY)
        cells = [f"{v:g}" for v in inflow]
        parquet(tmp_path, columns={"time": times, "u_Qi": cells})
        assert (read(tmp_path).inflow == inflow).all()
        parquet(tmp_path, columns={"time": times, "u_Qi": ["ERR", *cells[1:]]})
        assert "row 1: column 'u_Qi' holds 'ERR', which is no number" in reason(tmp_path)

    def test_a_bomb_is_refused_by_its_rows(self, tmp_path):
        path = parquet(tmp_path)
        n = 20_000_000
        codes = pa.DictionaryArray.from_arrays(pa.array(np.zeros(n, np.int8)), pa.array([300.0]))
        table = pa.table({"time": pa.array(np.zeros(n, np.int64), pa.timestamp("us", "UTC")), "u_Qi": codes})
        pq.write_table(
            table.append_column("u_Qo", codes).append_column("h_L", codes), path, compression="zstd"
        )
        assert path.stat().st_size < 500_000
        before = time.perf_counter()
        assert "too many rows for a log: 20,000,000 (limit 2,000,000)" in reason(tmp_path)
        assert time.perf_counter() - before < 1

    def test_a_long_text_that_many_rows_share_is_not_multiplied(self, tmp_path):
        path = tmp_path / f"{DAY}.parquet"
        words = pa.DictionaryArray.from_arrays(
            pa.array(np.zeros(500_000, np.int32)), pa.array(["9" * 1_000_000])
        )
        numbers = np.zeros(500_000)
        pq.write_table(pa.table({"time": words, "u_Qi": numbers, "u_Qo": numbers, "h_L": numbers}), path)
        assert "1,000,000 bytes long: no time or number" in reason(tmp_path)


class TestCsv:
    @pytest.mark.parametrize("content", [text_of(DAY).rstrip("\n"), text_of(DAY).replace("\n", "\r")])
    def test_a_last_line_without_line_break_and_cr_alone_are_read(self, tmp_path, content):
        (tmp_path / f"{DAY}.csv").write_bytes(content.encode())
        assert (read(tmp_path).output == a_day(DAY)[3]).all()

    @pytest.mark.parametrize("lost", [1, 6, 8, 20])
    def test_a_torn_last_line_fails_the_day(self, tmp_path, lost):
        content = text_of(DAY).rstrip("\n")
        (tmp_path / f"{DAY}.csv").write_text(content[:-lost])
        assert f"{DAY}.csv, line 651: " in reason(tmp_path)

    def test_a_file_cut_in_the_middle_fails_with_its_gap_or_line(self, tmp_path):
        content = text_of(DAY)
        for end in (1, 10, 23, 24, 60, len(content) // 2, len(content) - 300):
            (tmp_path / f"{DAY}.csv").write_text(content[:end])
            assert reason(tmp_path)

    @pytest.mark.parametrize(
        ("cell", "reason_part"),
        [
            ("abc", "line 10: column 'u_Qo' holds 'abc', which is no number"),
            ("inf", "'inf', which is no number"),
            ("NAN", "'NAN', which is no number"),
            ("1_000", "which is no number"),
            ("0x10", "which is no number"),
            ("٣٠٠", "which is no number"),
            ("1e400", "line 10: u_Qo = inf m3/s is beyond any river"),
            ("3.05e+22", "u_Qo = 3.05e+22 m3/s is beyond any river: check [input.units]"),
            ("305,5", "line 10: 5 fields where the header has 4 (decimal commas?"),
            ('"300', "line 10: a quotation mark is not closed"),
        ],
    )
    def test_cells_that_are_no_numbers(self, tmp_path, cell, reason_part):
        lines = rows()
        lines[8][2] = cell
        assert reason_part in reason(put(tmp_path, lines))

    @pytest.mark.parametrize("missing", [["", "#N/A"], ["inf", "Eqp"]])
    def test_missing_cells_and_declared_texts_are_filled(self, tmp_path, missing):
        lines = rows()
        lines[8][2], lines[9][3] = missing
        given = {} if "" in missing else {"missing": ["", *missing]}
        assert read(put(tmp_path, lines), **given).n_filled == 2

    @pytest.mark.parametrize(
        ("content", "expected"),
        [
            (gzip.compress(b"time,u_Qi\n", mtime=0), "is gzip, though"),
            (b"PK\x03\x04\x14\x00", "is a workbook or an archive"),
            (b"PAR1\x15\x04", "is Parquet, though"),
            (b"%PDF-1.7\n", "is a PDF, not text"),
        ],
    )
    def test_what_is_called_a_csv_and_is_none(self, tmp_path, content, expected):
        (tmp_path / f"{DAY}.csv").write_bytes(content)
        assert reason(tmp_path).startswith(f"{DAY}.csv {expected}")

    def test_a_comment_above_the_header_is_reported(self, tmp_path):
        (tmp_path / f"{DAY}.csv").write_text("# station 7, exported by hand\n" + text_of(DAY))
        assert 'set [input] comment = "#", or skip_rows' in reason(tmp_path)
        assert (read(tmp_path, comment="#").output == a_day(DAY)[3]).all()

    @pytest.mark.parametrize(
        ("at", "row", "reason_part"),
        [
            (99, lambda row: row[:3], "line 101: 3 fields where the header has 4"),
            (99, lambda row: [*row, "7"], "line 101: 5 fields where the header has 4"),
            (slice(None), lambda row: [*row, ""], "line 2: 5 fields where the header has 4"),
            (5, lambda row: ["yesterday", *row[1:]], "line 7: 'yesterday' is no time of ISO 8601"),
            (5, lambda row: [row[0][:19], *row[1:]], "line 7: its time has no offset, unlike line 2's"),
        ],
    )
    def test_ragged_rows(self, tmp_path, at, row, reason_part):
        lines = rows()
        lines[at] = [row(line) for line in lines] if isinstance(at, slice) else row(lines[at])
        assert reason_part in reason(put(tmp_path, lines))

    def test_columns_missing_doubled_and_misspelt(self, tmp_path):
        put(tmp_path, rows(), head="time,u_qi,u_Qo,h_L")
        assert "line 1: no column 'u_Qi' for u_Qi; nearest is 'u_qi'; there are: time, u_qi" in reason(
            tmp_path
        )
        put(tmp_path, rows(), head="time,u_Qi,u_Qi,h_L")
        assert "2 columns are named 'u_Qi': expected one" in reason(tmp_path)
        put(tmp_path, [[r[0], r[1], r[3]] for r in rows()], head="time,u_Qi,h_L")
        assert "u_Qo; there are: time, u_Qi, h_L. Set [input] u_Qo to the log's own name, or " in reason(
            tmp_path
        )
        assert 'u_Qo = "" where the outflow is not logged' in reason(tmp_path)

    @pytest.mark.parametrize(
        "content", [b"", b"\n", b"\r\n\r\n", HEAD.encode(), HEAD.encode() + b"\n", b"\0" * 5000]
    )
    def test_nothing_in_it(self, tmp_path, content):
        (tmp_path / f"{DAY}.csv").write_bytes(content)
        assert f"{DAY}.csv" in reason(tmp_path)


class TestGzip:
    @pytest.fixture
    def path(self, tmp_path):
        path = tmp_path / f"{DAY}.csv.gz"
        path.write_bytes(gzip.compress(text_of(DAY).encode()))
        return path

    def test_cut_off(self, path):
        content = path.read_bytes()
        assert (read(path.parent).output == a_day(DAY)[3]).all()
        for end in (0, 3, 12, len(content) // 2, len(content) - 1):
            path.write_bytes(content[:end])
            assert path.name in reason(path.parent)

    def test_flipped_bytes_and_no_gzip_at_all(self, path):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 0xFF
        for damaged in (bytes(content), text_of(DAY).encode()):
            path.write_bytes(damaged)
            assert "is not a sound gzip file" in reason(path.parent)

    def test_a_bomb_is_refused_while_it_unpacks(self, path):
        packer = zlib.compressobj(9, zlib.DEFLATED, 31)
        block = b"0" * (1 << 20)
        path.write_bytes(b"".join(packer.compress(block) for _ in range(105)) + packer.flush())
        assert path.stat().st_size < 120_000
        assert "too large for a log: 64 MB (limit 64 MB, unpacked)" in reason(path.parent)


def test_a_huge_sparse_file_is_not_read(tmp_path):
    path = tmp_path / f"{DAY}.csv"
    with path.open("wb") as file:
        file.truncate(50 << 30)
    before = time.perf_counter()
    assert "too large for a log: 51200 MB" in reason(tmp_path)
    path.rename(tmp_path / "march.csv")
    with pytest.raises(NoDataError, match="too large"):
        find_days(tmp_path, config())
    assert time.perf_counter() - before < 1


class TestNamesAndLinks:
    @pytest.fixture
    def logs(self, tmp_path):
        write_days(tmp_path / "logs", 1)
        (tmp_path / "elsewhere.csv").write_text(text_of(DAY))
        return tmp_path / "logs"

    def bad(self, logs):
        catalog = find_days(logs, config())
        assert [d.date for d in catalog.days] == [DAY]
        return dict(catalog.bad_files)

    def test_a_link_out_of_the_root(self, logs):
        (logs / "2008-03-11.csv").symlink_to(logs.parent / "elsewhere.csv")
        (logs / "2008-03-12.csv").symlink_to("../elsewhere.csv")
        bad = self.bad(logs).values()
        assert len(bad) == 2 and all("leads out of the directory" in why for why in bad)

    def test_a_link_within_the_root_and_a_linked_root_are_read(self, logs):
        (logs / "kept").mkdir()
        (logs / "kept" / "x.csv").write_text(text(rows(DAY)))
        (logs / "2008-03-11.csv").symlink_to(logs / "kept" / "x.csv")
        (logs.parent / "link").symlink_to(logs)
        for root in (logs, logs.parent / "link"):
            assert len(find_days(root, config()).days) == 2

    def test_loops_broken_links_and_pipes(self, logs):
        (logs / "a.csv").symlink_to("b.csv")
        (logs / "b.csv").symlink_to("a.csv")
        (logs / "2008-03-11.csv").symlink_to("nowhere")
        os.mkfifo(logs / "2008-03-12.csv")
        bad = self.bad(logs)
        assert set(bad) == {"a.csv", "b.csv", "2008-03-11.csv", "2008-03-12.csv"}
        assert bad["2008-03-12.csv"] == "is not a regular file"

    def test_names_that_are_no_dates_or_cannot_be_printed(self, logs):
        (logs / "2008-13-45.csv").write_text(text_of(DAY))
        for name in ("CON.csv", "=1+1.csv", os.fsdecode(b"caf\xe9.csv"), "a\nb.csv"):
            (logs / name).write_text("x")
        bad = self.bad(logs)
        assert bad.pop("2008-13-45.csv") == "2008-13-45 is no date: expected YYYY-MM-DD"
        assert set(bad) == {"CON.csv", "=1+1.csv", r"caf\xe9.csv", r"a\nb.csv"}
        assert all(why.startswith("line 1: no column") for why in bad.values())

    def test_reasons_from_a_log_with_an_unreadable_name_can_be_printed(self, logs):
        name, date = os.fsdecode(b"d\xe9bit.csv"), dt.date(2008, 3, 11)
        lines = rows(date) + rows(date + dt.timedelta(days=1))
        lines[700][1] = "ERR"
        (logs / name).write_text(text(lines))
        catalog = find_days(logs, config())
        assert len(read_window(logs, [catalog.days[1]], config()).inflow) == 650
        with pytest.raises(DataError) as caught:
            read_window(logs, [catalog.days[2]], config())
        assert str(caught.value).encode().startswith(rb"d\xe9bit.csv, line 702: ")
        (logs / name).write_text("")
        with pytest.raises(NoDataError) as caught:
            find_days(logs / name, config())
        assert rb"d\xe9bit.csv can be used: " in str(caught.value).encode()


def test_pickles_are_never_opened(tmp_path):
    write_days(tmp_path, 1)

    class Trap:
        def __reduce__(self):
            return (open, (str(tmp_path / "sprung"), "w"))

    (tmp_path / "2008-03-11.pkl").write_bytes(pickle.dumps(Trap()))
    np.save(tmp_path / "2008-03-12.npy", np.array([Trap()], object), allow_pickle=True)
    (tmp_path / "2008-03-13.csv").write_bytes(pickle.dumps(Trap()))
    (tmp_path / "2008-03-14.parquet").write_bytes(pickle.dumps(Trap()))
    catalog = find_days(tmp_path, config())
    assert [d.date.day for d in catalog.days] == [10, 13, 14]
    for source in catalog.days[1:]:
        with pytest.raises(DataError):
            read_window(tmp_path, [source], config())
    assert not (tmp_path / "sprung").exists()


def test_one_bad_file_of_many_loses_nothing_else(tmp_path):
    write_days(tmp_path, 5)
    (tmp_path / "2008-03-12.csv").write_bytes(b"\xff\xfe\x00garbage")
    (tmp_path / "junk.csv").write_text("not,a,log\n1,2,3\n")
    catalog = find_days(tmp_path, config())
    assert [path for path, _ in catalog.bad_files] == ["junk.csv"]
    read_days = []
    for source in catalog.days:
        try:
            read_days.append(read_window(tmp_path, [source], config()).date.day)
        except DataError as error:
            assert "2008-03-12.csv is UTF-16" in str(error)
    assert read_days == [10, 11, 13, 14]


def test_a_file_that_does_not_fit_into_memory_fails_its_day_only(tmp_path, monkeypatch):
    """The first, the middle and the last day are read for their columns before all others."""
    write_days(tmp_path / "logs", 3)
    (tmp_path / "logs" / "many.csv").write_text("time,u_Qi,u_Qo,h_L\n")
    read_table = log.read_table

    def short_of_memory(path, *given, **options):
        if path.name in (f"{DAY}.csv", "many.csv"):
            raise MemoryError
        return read_table(path, *given, **options)

    monkeypatch.setattr(log, "read_table", short_of_memory)
    report = check(tmp_path / "logs", config())
    assert [day.status for day in report.days] == ["failed", "ok", "ok"]
    assert report.days[0].reason == f"{DAY}.csv does not fit into memory (0 MB)"
    assert report.bad_files == [("many.csv", "does not fit into memory (0 MB)")]
    code, text = rivid("run", tmp_path / "logs", "--out", tmp_path / "out", "--no-figures")
    assert code == 3 and "2 ok" in text and "does not fit into memory" in text


@pytest.mark.parametrize(
    ("given", "reason_part"),
    [
        ({"encoding": "no-such"}, "encoding"), ({"encoding": "rot13"}, "encoding"),
        ({"separator": ";;"}, "separator"), ({"separator": "\n"}, "separator"),
        ({"separator": "5"}, "separator"),
        ({"decimal": ",", "thousands": ","}, "thousands"), ({"skip_rows": 10**9}, "skip_rows"),
        ({"time_zone": "../../etc/passwd"}, "time_zone"), ({"time_zone": "Mars/Olympus"}, "time_zone"),
        ({"max_gap": float("nan")}, "max_gap"), ({"colour": "blue"}, "colour"), ({"time": ""}, "time"),
        ({"u_Qi": []}, "u_Qi"), ({"h_L": ""}, 'a reach without level is [reach] kind = "river"'),
        ({"h_L": []}, "h_L"), ({"Q_L": ""}, "Q_L"), ({"u_Qo": []}, 'or "" where the outflow is not logged'),
        ({"u_Qo": ["a", ""]}, "u_Qo"), ({"u_Qo": ["a", "a"]}, "a column occurs twice in u_Qo = ['a', 'a']"),
        ({"u_Qi": "h_L"}, "h_L"), ({"h_L": "time"}, "time"), ({"u_Qi": "q", "u_Qo": "q"}, "column 'q'"),
        ({"u_Qi": ["a", "b"], "h_L": "b"}, "column 'b' stands for u_Qi and for h_L"),
        ({"time_format": "%Q"}, "'Q' is a bad directive in format '%Q'"),
        ({"time_format": "%d/%m %H:%M"}, "time_format"), ({"time_format": "%Y-%m-%d %I:%M"}, "time_format"),
        ({"time_format": "\ud800"}, "time_format"),
    ],
)  # fmt: skip
def test_hostile_declarations_are_refused_in_one_line(given, reason_part):
    with pytest.raises(ConfigError) as caught:
        config(**given)
    assert "\n" not in str(caught.value) and reason_part in str(caught.value)


def test_roles_that_the_reach_has_not_may_name_anything():
    assert config({"kind": "river"}, u_Qi="h_L").input.u_Qi == "h_L"
    assert config(u_Qi="Q_L", u_Qo=["a", "b"]).input.u_Qo == ["a", "b"]
    assert config(u_Qi=["a", "bypass"], u_Qo=["b", "bypass"], h_L="c")
    assert config(time_format="%d.%m.%y %I:%M %p") and config(time_format="%Y-%m-%dT%H:%M:%S%z")
