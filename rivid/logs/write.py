"""Writing daily logs: canonical columns, whole files or none, the same bytes for the same days."""

import datetime as dt
import gzip
import io
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rivid.atomic import replacing
from rivid.errors import RividError
from rivid.logs.spec import MICRO
from rivid.logs.times import EPOCH
from rivid.types import Floats, Ints

Format = Literal["csv", "csv.gz", "parquet"]
Layout = Literal["day", "month"]
COLUMNS = ("u_Qi", "u_Qo", "h_L", "Q_L")
"""Canonical columns in the order of the files, after ``time``; discharges in m3/s, the level in m."""
Day = tuple[dt.date, Mapping[str, Floats]]


def write_day(
    path: Path, date: dt.date, columns: Mapping[str, Floats], *, sample_time: float, offset: dt.timedelta
) -> None:
    """Write one day's log.

    Parameters
    ----------
    path : Path
        The file; its ending says the format: .csv, .csv.gz or .parquet.
    date : datetime.date
        The local day; its first sample is at midnight.
    columns : mapping of str to ndarray, shape (N,)
        Some of u_Qi, u_Qo, Q_L [m3/s], h_L [m]; NaN is written as an empty cell or null.
    sample_time : float
        T_s [s]; times are rounded to the millisecond.
    offset : datetime.timedelta
        Offset of local time from UTC.

    Raises
    ------
    RividError
        Where a column is not canonical or of another length, the ending is unknown, or the disk refuses.
    """
    _write(path, [(date, columns)], sample_time, offset)


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

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    days : iterable of (date, columns)
        In date order; see :func:`write_day`.
    sample_time, offset
        See :func:`write_day`.
    format : {"csv", "csv.gz", "parquet"}
    layout : {"day", "month"}

    Returns
    -------
    list of Path
        The files, in date order.

    Raises
    ------
    RividError
        See :func:`write_day`.
    """
    paths = []
    for stem, group in groupby(days, key=lambda day: stem_of(day[0], layout)):
        path = folder / f"{stem}.{format}"
        _write(path, list(group), sample_time, offset)
        paths.append(path)
    return paths


def stem_of(date: dt.date, layout: Layout) -> str:
    """Name, without its ending, of the file that holds a day."""
    return date.isoformat() if layout == "day" else f"{date:%Y-%m}"


def _write(path: Path, days: Sequence[Day], sample_time: float, offset: dt.timedelta) -> None:
    names = _names(days)
    if path.name.endswith(".parquet"):
        table = _table(days, names, sample_time, offset)
        with replacing(path) as scratch:
            write_parquet(table, scratch)
        return
    if not path.name.endswith((".csv", ".csv.gz")):
        raise RividError(f"{path.name}: expected a name ending in .csv, .csv.gz or .parquet")
    data = _text(days, names, sample_time, offset).encode("ascii")
    if path.name.endswith(".gz"):
        data = gzip.compress(data, mtime=0)  # the clock must not get into the bytes
    with replacing(path) as scratch:
        scratch.write_bytes(data)


def write_parquet(table: pa.Table, where: Any) -> None:
    """Write a table of logs, `time` first, to a path or a stream: small, with checksums."""
    pq.write_table(
        table,
        where,
        compression="zstd",
        compression_level=9,
        use_dictionary=table.column_names[1:],  # few distinct values: whole m3/s, whole centimetres
        column_encoding={"time": "DELTA_BINARY_PACKED"},
        write_page_checksum=True,
        store_schema=True,  # Parquet itself keeps no offset, only its Arrow schema does
    )


def _names(days: Sequence[Day]) -> tuple[str, ...]:
    """Columns of the file, in canonical order; the same on all its days."""
    first = set(days[0][1])
    for date, columns in days:
        unknown = set(columns) - set(COLUMNS)
        if unknown or not columns:
            raise RividError(f"{date}: columns {sorted(columns)}; expected some of {', '.join(COLUMNS)}")
        if set(columns) != first:
            raise RividError(
                f"{date}: columns {sorted(columns)} beside days with {sorted(first)} in one file"
            )
        lengths = {name: len(values) for name, values in columns.items()}
        if len(set(lengths.values())) > 1:
            raise RividError(f"{date}: columns of different lengths {lengths}")
    return tuple(name for name in COLUMNS if name in first)


def _milliseconds(n: int, sample_time: float) -> Ints:
    """Sample times after midnight [ms]."""
    return np.round(np.arange(n) * (1000.0 * sample_time)).astype(np.int64)


def offset_text(offset: dt.timedelta) -> str:
    """Like +01:00."""
    minutes = round(offset.total_seconds() / 60)
    sign = "-" if minutes < 0 else "+"
    return f"{sign}{abs(minutes) // 60:02d}:{abs(minutes) % 60:02d}"


def _table(days: Sequence[Day], names: tuple[str, ...], sample_time: float, offset: dt.timedelta) -> Any:
    times = []
    for date, columns in days:
        midnight = dt.datetime.combine(date, dt.time(), dt.timezone(offset))
        n = len(columns[names[0]])
        times.append(round(midnight.timestamp()) * 1000 + _milliseconds(n, sample_time))
    stamp = pa.timestamp("ms", tz=offset_text(offset))
    arrays = [pa.array(np.concatenate(times)).cast(stamp)]
    fields = [pa.field("time", stamp, nullable=False)]
    for name in names:
        values = np.concatenate([np.asarray(columns[name], float) for _, columns in days])
        arrays.append(pa.array(values, from_pandas=True))  # NaN becomes null
        fields.append(pa.field(name, pa.float64()))
    return pa.table(arrays, schema=pa.schema(fields))


def _text(days: Sequence[Day], names: tuple[str, ...], sample_time: float, offset: dt.timedelta) -> str:
    zone = offset_text(offset)
    lines = [",".join(("time", *names))]
    for date, columns in days:
        clocks = _clocks(date, len(columns[names[0]]), sample_time)
        cells = [[number_text(x) for x in np.asarray(columns[name], float).tolist()] for name in names]
        lines += [f"{clock}{zone}," + ",".join(row) for clock, *row in zip(clocks, *cells, strict=True)]
    return "\n".join(lines) + "\n"


def _clocks(date: dt.date, n: int, sample_time: float) -> list[str]:
    """Local times as ISO text; milliseconds only where there are some."""
    ms = _milliseconds(n, sample_time)
    stamps = np.datetime64(date, "ms") + ms.astype("timedelta64[ms]")
    return [
        str(stamp) for stamp in np.datetime_as_string(stamps, unit="s" if not (ms % 1000).any() else "ms")
    ]


def number_text(x: float) -> str:
    """The shortest text that reads back as the same number; nothing for NaN."""
    return "" if x != x else repr(x).removesuffix(".0")


def rows_as_bytes(times: Ints, columns: Mapping[str, Floats], zone: dt.tzinfo, format: Format) -> bytes:
    """A log of these rows.

    Parameters
    ----------
    times : ndarray, (n,)
        Ascending [us UTC].
    columns : mapping of str to ndarray, (n,)
        Some of u_Qi, u_Qo, Q_L [m3/s], h_L [m]; NaN is written as an empty cell or null.
    zone : tzinfo
        Of the local clock that the log shows.
    format : {"csv", "csv.gz", "parquet"}

    Returns
    -------
    bytes
        The same for the same rows.
    """
    names = [name for name in COLUMNS if name in columns]
    if format == "parquet":
        return _parquet(times, {name: columns[name] for name in names}, zone)
    clocks = clocks_of(times, zone)
    cells = [[number_text(x) for x in columns[name].tolist()] for name in names]
    lines = [",".join(("time", *names)), *(",".join(row) for row in zip(clocks, *cells, strict=True))]
    text = ("\n".join(lines) + "\n").encode("ascii")
    return gzip.compress(text, mtime=0) if format == "csv.gz" else text


def clocks_of(times: Ints, zone: dt.tzinfo) -> list[str]:
    """ISO 8601 with the offset of each moment; fractions of a second only where there are some."""
    offsets = offsets_of(times, zone)
    local = np.datetime64(EPOCH, "us") + (times + offsets * MICRO).astype("timedelta64[us]")
    whole, thousandth = not (times % MICRO).any(), not (times % 1000).any()
    texts = np.datetime_as_string(local, unit="s" if whole else "ms" if thousandth else "us")
    zones = {offset: offset_text(dt.timedelta(seconds=offset)) for offset in set(offsets.tolist())}
    return [f"{text}{zones[offset]}" for text, offset in zip(texts.tolist(), offsets.tolist(), strict=True)]


def offsets_of(times: Ints, zone: dt.tzinfo) -> Ints:
    """Offsets from UTC [s]; within a day the clock is changed once at most."""

    def offset(time: int) -> int:
        moment = dt.datetime.fromtimestamp(time // MICRO, zone).utcoffset()
        assert moment is not None
        return round(moment.total_seconds())

    first, last = offset(int(times[0])), offset(int(times[-1]))
    if first == last:
        return np.full(len(times), first, np.int64)
    return np.array([offset(int(time)) for time in times], np.int64)


def _parquet(times: Ints, columns: Mapping[str, Floats], zone: dt.tzinfo) -> bytes:
    name = getattr(zone, "key", None) or offset_text(dt.timedelta(seconds=int(offsets_of(times, zone)[0])))
    unit = "us" if (times % 1000).any() else "ms"
    stamp = pa.timestamp(unit, tz=name)
    arrays = [pa.array(times if unit == "us" else times // 1000).cast(stamp)]
    fields = [pa.field("time", stamp, nullable=False)]
    for column, values in columns.items():
        arrays.append(pa.array(values, from_pandas=True))  # NaN becomes null
        fields.append(pa.field(column, pa.float64()))
    sink = io.BytesIO()
    write_parquet(pa.table(arrays, schema=pa.schema(fields)), sink)
    return sink.getvalue()
