"""Test Parquet logs of unusual types, and the memory used for reading."""

import tracemalloc

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from rivid.errors import DataError
from rivid.logs.days import find_days, read_window, refuse_columns
from rivid.logs.spec import DAY as LIMITS
from rivid.logs.spec import read_bytes
from tests.logs.helpers import DAY, config, put, read, rows


def write(folder, date=DAY, **replaced):
    """Write the usual day as Parquet, with some columns replaced."""
    time, *numbers = zip(*rows(date), strict=True)
    columns = {
        name: pa.array(map(float, cells))
        for name, cells in zip(("u_Qi", "u_Qo", "h_L"), numbers, strict=True)
    }
    pq.write_table(pa.table({"time": pa.array(time)} | columns | replaced), folder / f"{date}.parquet")


@pytest.mark.parametrize("cell", [-(2**63), 2**53 + 1, 2**63 - 1])
def test_an_integer_beyond_2_to_53_fails_its_day_only(tmp_path, cell):
    flows = [300] * 650
    flows[7] = cell
    write(tmp_path, u_Qi=pa.array(flows, pa.int64()))
    put(tmp_path, rows(DAY.replace(day=11)), name="2008-03-11.csv")
    days = find_days(tmp_path, config()).days
    refuse_columns(tmp_path, days, config())
    with pytest.raises(DataError, match=r"row 8: .*(is beyond any river|sentinels)"):
        read_window(tmp_path, days[:1], config())
    assert len(read_window(tmp_path, days[1:], config()).inflow) == 650


def test_columns_of_string_views_are_read_as_texts(tmp_path):
    write(tmp_path, h_L=pa.array([row[3] for row in rows()]).cast(pa.string_view()))
    np.testing.assert_array_equal(read(tmp_path).output, [float(row[3]) for row in rows()])


@pytest.mark.parametrize("suffix", ["csv", "csv.gz"])
def test_reading_takes_memory_for_the_file_not_for_the_limit(tmp_path, suffix):
    import gzip

    content = b"0" * (1 << 20)
    path = tmp_path / f"{DAY}.{suffix}"
    path.write_bytes(gzip.compress(content) if suffix == "csv.gz" else content)
    tracemalloc.start()
    try:
        assert read_bytes(path, path.name, LIMITS[0])[0] == content
        assert tracemalloc.get_traced_memory()[1] < 6 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_a_byte_order_mark_is_named(tmp_path, encoding):
    text = put(tmp_path, rows()) / f"{DAY}.csv"
    text.write_bytes(text.read_text().encode(encoding))
    with pytest.raises(DataError, match=f'encoding = "{encoding}"') as caught:
        read(tmp_path)
    assert "\0" not in str(caught.value)
    assert len(read(tmp_path, encoding=encoding).inflow) == 650


def test_a_quoted_comma_before_three_digits_hints_at_thousands(tmp_path):
    lines = [[row[0], '"1,308"', *row[2:]] for row in rows()]
    with pytest.raises(DataError, match=r'decimal = ","; if it separates thousands, thousands = ","'):
        read(put(tmp_path, lines))
    assert read(tmp_path, thousands=",").inflow[0] == 1308
