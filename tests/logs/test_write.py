"""Test that logs are written completely, in canonical form, and the same each time."""

import datetime as dt
import gzip
import hashlib

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rivid.config import Config
from rivid.errors import RividError
from rivid.logs.days import find_days, read_window
from rivid.logs.write import write_days

HOUR = dt.timedelta(hours=1)
DATE = dt.date(2008, 3, 14)
FORMATS = ("csv", "csv.gz", "parquet")


def columns(seed=0, n=650):
    rng = np.random.default_rng(seed)
    return {
        "u_Qi": rng.integers(100, 800, n).astype(float),
        "u_Qo": rng.integers(100, 800, n).astype(float),
        "h_L": np.round(130 + rng.normal(size=n), 2),
    }


def put(folder, form="csv", offset=HOUR, sample_time=133.0, only=None, **changes):
    day = (DATE, only or columns() | changes)
    (path,) = write_days(folder, [day], sample_time=sample_time, offset=offset, format=form)
    return path


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("layout", ["day", "month"])
def test_what_is_written_is_what_the_reader_reads(tmp_path, ending, layout):
    dates = [dt.date(2008, 2, 28) + dt.timedelta(days=k) for k in range(4)]
    days = [(date, columns(k)) for k, date in enumerate(dates)]
    paths = write_days(tmp_path, days, sample_time=133.0, offset=HOUR, format=ending, layout=layout)
    stems = [str(d) for d in dates] if layout == "day" else ["2008-02", "2008-03"]
    assert [p.name for p in paths] == [f"{stem}.{ending}" for stem in stems]
    found = find_days(tmp_path, Config())
    assert [source.date for source in found.days] == dates and not found.bad_files
    for source, (_, expected) in zip(found.days, days, strict=True):
        read = read_window(tmp_path, [source], Config())
        np.testing.assert_array_equal(read.inflow, expected["u_Qi"])
        np.testing.assert_array_equal(read.outflow, expected["u_Qo"])
        np.testing.assert_array_equal(read.output, expected["h_L"])
        assert read.n_filled == 0


def test_csv_holds_iso_times_and_short_numbers(tmp_path):
    values = {"u_Qi": [300.0, 301.5], "u_Qo": [299.0, 0.1], "h_L": [130.0, 130.07]}
    path = put(tmp_path, **{k: np.array(v) for k, v in values.items()})
    assert path.read_text() == (
        "time,u_Qi,u_Qo,h_L\n2008-03-14T00:00:00+01:00,300,299,130\n2008-03-14T00:02:13+01:00,301.5,0.1,130.07\n"
    )


def test_compressed_csv_is_the_same_text(tmp_path):
    plain, packed = put(tmp_path), put(tmp_path, "csv.gz")
    assert gzip.decompress(packed.read_bytes()) == plain.read_bytes()


def test_parquet_has_an_offset_and_page_checksums(tmp_path):
    path = put(tmp_path, "parquet")
    table = pq.read_table(path, page_checksum_verification=True)
    assert table.schema.field("time").type == pa.timestamp("ms", tz="+01:00")
    first = table["time"][0].as_py()
    assert first == dt.datetime(2008, 3, 14, tzinfo=dt.timezone(HOUR))
    damaged = bytearray(path.read_bytes())
    damaged[200] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(OSError, match="(?i)crc|checksum|corrupt"):
        pq.read_table(path, page_checksum_verification=True)


@pytest.mark.parametrize(
    ("offset", "text"), [(-3.5, "-03:30"), (0, "+00:00"), (5.75, "+05:45"), (-0.5, "-00:30")]
)
def test_offsets_of_all_kinds(tmp_path, offset, text):
    offset = dt.timedelta(hours=offset)
    line = put(tmp_path, offset=offset).read_text().splitlines()[1]
    assert line.startswith(f"2008-03-14T00:00:00{text},")
    table = pq.read_table(put(tmp_path, "parquet", offset=offset))
    assert table["time"][0].as_py() == dt.datetime(2008, 3, 14, tzinfo=dt.timezone(offset))


def test_parts_of_a_second_are_kept(tmp_path):
    lines = put(tmp_path, sample_time=62.5).read_text().splitlines()
    assert lines[2].startswith("2008-03-14T00:01:02.500+01:00,")


def test_missing_values_are_empty_or_null(tmp_path):
    level = columns()["h_L"]
    level[3] = np.nan
    assert put(tmp_path, h_L=level).read_text().splitlines()[4].endswith(",")
    assert pq.read_table(put(tmp_path, "parquet", h_L=level))["h_L"].null_count == 1
    frame = pd.read_csv(tmp_path / f"{DATE}.csv")
    np.testing.assert_array_equal(frame["h_L"], level)


@pytest.mark.parametrize("ending", FORMATS)
def test_the_same_day_gives_the_same_bytes(tmp_path, ending):
    digests = {hashlib.sha256(put(tmp_path / str(k), ending).read_bytes()).hexdigest() for k in range(3)}
    assert len(digests) == 1


def test_a_river_has_a_discharge_downstream(tmp_path):
    flows = {"Q_L": np.array([200.0, 201.0]), "u_Qi": np.array([210.0, 205.0])}
    assert put(tmp_path, sample_time=900.0, only=flows).read_text().splitlines()[:2] == [
        "time,u_Qi,Q_L",
        "2008-03-14T00:00:00+01:00,210,200",
    ]


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = put(tmp_path)
    before = path.read_bytes()

    def no_space(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", no_space)
    with pytest.raises(RividError, match="cannot write .*.csv: No space left"):
        put(tmp_path, u_Qi=columns(1)["u_Qi"])
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
