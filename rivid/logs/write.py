"""Writing daily logs: canonical columns, whole files or none, the same bytes for the same days."""

import datetime as dt
import gzip
import io
from collections.abc import Iterable, Mapping
from itertools import groupby
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rivid.atomic import replacing
from rivid.logs.spec import MICRO, local
from rivid.types import Floats, Ints

Format = Literal["csv", "csv.gz", "parquet"]
Layout = Literal["day", "month"]
# canonical columns in the order of the files, after ``time``; discharges in m3/s, the level in m
COLUMNS = ("u_Qi", "u_Qo", "h_L", "Q_L")
Day = tuple[dt.date, Mapping[str, Floats]]


def write_days(
    folder: Path,
    days: Iterable[Day],
    *,
    sample_time: float,
    offset: dt.timedelta,
    format: Format = "csv",
    layout: Layout = "day",
) -> list[Path]:
    """Write days into a directory: a file for each (2008-03-14.csv) or one for each month (2008-03.parquet).

    The days are in date order. Their columns, of shape (N,), are some of u_Qi, u_Qo, Q_L [m3/s], h_L [m],
    alike in all days of a file; NaN is written as an empty cell or null. The first sample is at local
    midnight, which is `offset` from UTC; times at T_s, `sample_time` [s], are rounded to the millisecond.
    Returns the files, in date order. RividError where the disk refuses.
    """
    paths, zone = [], dt.timezone(offset)
    for stem, group in groupby(days, key=lambda day: stem_of(day[0], layout)):
        listed = list(group)
        names = list(listed[0][1])
        times = []
        for date, columns in listed:
            midnight = round(dt.datetime.combine(date, dt.time(), zone).timestamp())
            ms = np.round(np.arange(len(columns[names[0]])) * (1000.0 * sample_time)).astype(np.int64)
            times.append(midnight * MICRO + ms * 1000)
        joined = {n: np.concatenate([np.asarray(c[n], float) for _, c in listed]) for n in names}
        path = folder / f"{stem}.{format}"
        data = rows_as_bytes(np.concatenate(times), joined, zone, format)
        with replacing(path) as scratch:
            scratch.write_bytes(data)
        paths.append(path)
    return paths


def stem_of(date: dt.date, layout: Layout) -> str:
    """Name, without its ending, of the file that holds a day."""
    return date.isoformat() if layout == "day" else f"{date:%Y-%m}"


def rows_as_bytes(times: Ints, columns: Mapping[str, Floats], zone: dt.tzinfo, format: Format) -> bytes:
    """A log of rows at ascending times (n,) [us UTC] shown in `zone`; equal rows give equal bytes.

    Columns are some of u_Qi, u_Qo, Q_L [m3/s], h_L [m]; NaN is written as an empty cell or null.
    """
    names = [name for name in COLUMNS if name in columns]
    if format == "parquet":
        return _parquet(times, {name: columns[name] for name in names}, zone)
    cells = [[_number(x) for x in columns[name].tolist()] for name in names]
    whole, thousandth = not (times % MICRO).any(), not (times % 1000).any()
    clocks = _clocks(times, zone, "s" if whole else "ms" if thousandth else "us")
    lines = [",".join(("time", *names)), *(",".join(row) for row in zip(clocks, *cells, strict=True))]
    text = ("\n".join(lines) + "\n").encode("ascii")
    return gzip.compress(text, mtime=0) if format == "csv.gz" else text  # mtime: no clock in the bytes


def _number(x: float) -> str:
    """The shortest text that reads back as the same number; nothing for NaN."""
    return "" if x != x else repr(x).removesuffix(".0")


def _clocks(times: Ints, zone: dt.tzinfo, unit: Literal["s", "ms", "us"]) -> list[str]:
    """Ascending times [us UTC] by ISO 8601 with their offsets, to whole `unit`."""
    first, last = (local(time, zone) for time in times[[0, -1]].tolist())
    if first.utcoffset() != last.utcoffset():  # within a day or a month, the clock is changed once at most
        middle = len(times) // 2
        return _clocks(times[:middle], zone, unit) + _clocks(times[middle:], zone, unit)
    offset, mark = first.utcoffset() or dt.timedelta(), first.isoformat()[19:]
    there = (times + offset // dt.timedelta(microseconds=1)).astype("M8[us]")
    return [text + mark for text in np.datetime_as_string(there, unit=unit).tolist()]


def _parquet(times: Ints, columns: Mapping[str, Floats], zone: dt.tzinfo) -> bytes:
    """A small Parquet file with checksums of its pages."""
    unit = "us" if (times % 1000).any() else "ms"
    name = getattr(zone, "key", None) or local(int(times[0]), zone).isoformat()[19:]
    stamp = pa.timestamp(unit, tz=name)
    clock = pa.array(times if unit == "us" else times // 1000).cast(stamp)
    numbers = [pa.array(values, from_pandas=True) for values in columns.values()]  # NaN becomes null
    schema = [pa.field("time", stamp, nullable=False), *((name, pa.float64()) for name in columns)]
    sink = io.BytesIO()
    pq.write_table(
        pa.table([clock, *numbers], pa.schema(schema)),
        sink,
        compression="zstd",
        compression_level=9,
        use_dictionary=list(columns),  # few distinct values: whole m3/s, whole centimetres
        column_encoding={"time": "DELTA_BINARY_PACKED"},
        write_page_checksum=True,
        store_schema=True,  # Parquet itself keeps no offset, only its Arrow schema does
    )
    return sink.getvalue()
