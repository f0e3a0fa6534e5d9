"""Writing a day's rows as they are: at any times, on local clocks that may change."""

import datetime as dt
import gzip
import io
from collections.abc import Mapping

import numpy as np
import pyarrow as pa

from rivid.logs.columns import Micros
from rivid.logs.spec import MICRO
from rivid.logs.times import EPOCH
from rivid.logs.write import COLUMNS, Format, number_text, offset_text, write_parquet
from rivid.types import Floats


def rows_as_bytes(times: Micros, columns: Mapping[str, Floats], zone: dt.tzinfo, format: Format) -> bytes:
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


def clocks_of(times: Micros, zone: dt.tzinfo) -> list[str]:
    """ISO 8601 with the offset of each moment; fractions of a second only where there are some."""
    offsets = offsets_of(times, zone)
    local = np.datetime64(EPOCH, "us") + (times + offsets * MICRO).astype("timedelta64[us]")
    whole, thousandth = not (times % MICRO).any(), not (times % 1000).any()
    texts = np.datetime_as_string(local, unit="s" if whole else "ms" if thousandth else "us")
    zones = {offset: offset_text(dt.timedelta(seconds=offset)) for offset in set(offsets.tolist())}
    return [f"{text}{zones[offset]}" for text, offset in zip(texts.tolist(), offsets.tolist(), strict=True)]


def offsets_of(times: Micros, zone: dt.tzinfo) -> Micros:
    """Offsets from UTC [s]; within a day the clock is changed once at most."""

    def offset(time: int) -> int:
        moment = dt.datetime.fromtimestamp(time // MICRO, zone).utcoffset()
        assert moment is not None
        return round(moment.total_seconds())

    first, last = offset(int(times[0])), offset(int(times[-1]))
    if first == last:
        return np.full(len(times), first, np.int64)
    return np.array([offset(int(time)) for time in times], np.int64)


def _parquet(times: Micros, columns: Mapping[str, Floats], zone: dt.tzinfo) -> bytes:
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
