"""CSV as it should be, read in a fraction of a millisecond; anything odd is left to `csvtext`.

Nothing is inferred: each column has its type, times are ISO 8601 or of the declared format, and a cell of
any other kind makes the whole reading step back.
"""

import re
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from rivid.logs.columns import Columns, Micros
from rivid.logs.header import Header
from rivid.logs.spec import Spec
from rivid.logs.times import FIRST, LAST, UNIX

_OFFSET = re.compile(r"\d{1,2}:?\d\d.*?(Z|[+-]\d\d(?::?\d\d)?)$")
_FLOAT = pa.float64()
_NAIVE = pa.timestamp("us")
_AWARE = pa.timestamp("us", tz="UTC")


def read_fast(content: bytes, header: Header, spec: Spec) -> Columns | None:
    """The columns of a clean log.

    Parameters
    ----------
    content : bytes
        The log in UTF-8.
    header : Header
    spec : Spec

    Returns
    -------
    Columns or None
        None where the log needs the tolerant reader: to be read, or to say what is wrong.
    """
    if not spec.dialect.plain or spec.separator == " ":
        return None
    if len(spec.time) > 1 or spec.thousands or spec.time_format in UNIX or content[-1:] not in b"\r\n":
        return None
    if "%z" in (spec.time_format or "").lower():
        return None
    offset = ""
    if spec.time_format is None:
        offset = _first_offset(content, header, spec)
    body = memoryview(content)[header.body :]
    try:
        table = pc.read_csv(pa.BufferReader(pa.py_buffer(body)), *_options(header.names, spec, bool(offset)))
    except (pa.ArrowException, ValueError, KeyError, OSError):
        return None
    if not table.num_rows or (offset and not spec.time_zone and _mixed(content, header, spec, offset, table)):
        return None
    times = table.column(0)
    if times.null_count:
        return None
    micros = times.to_numpy().view(np.int64)
    if micros.min() < FIRST or micros.max() >= LAST:
        return None
    if spec.time_format and _may_have_rolled(micros):
        return None
    numbers = {}
    for i, name in enumerate(spec.sources, 1):
        column = table.column(i)
        values = column.to_numpy()
        if np.count_nonzero(np.isfinite(values)) != len(values) - column.null_count:
            return None  # infinite, or a NaN that is not declared missing
        numbers[name] = values
    seconds = _seconds(offset) if offset else None
    line = header.line + spec.unit_rows + 1
    return Columns(micros, bool(offset), seconds, numbers, line)


@lru_cache(maxsize=16)
def _options(names: tuple[str, ...], spec: Spec, aware: bool) -> tuple[Any, Any, Any]:
    wanted = [spec.time[0], *spec.sources]
    # unused columns may be doubled or nameless; arrow wants distinct names
    distinct = [n if n in wanted else f"\x00{i}" for i, n in enumerate(names)]
    types = {name: _FLOAT for name in spec.sources} | {spec.time[0]: _AWARE if aware else _NAIVE}
    return (
        pc.ReadOptions(use_threads=False, column_names=distinct, block_size=1 << 30),
        pc.ParseOptions(delimiter=spec.separator),
        pc.ConvertOptions(
            column_types=types,
            include_columns=wanted,
            null_values=list(spec.missing),
            decimal_point=spec.decimal,
            timestamp_parsers=[spec.time_format] if spec.time_format else None,
        ),
    )


def _first_offset(content: bytes, header: Header, spec: Spec) -> str:
    """The UTC offset written in the first row, empty where there is none."""
    end = content.find(b"\n", header.body)
    row = content[header.body : end if end >= 0 else None].decode("utf-8", "replace").split(spec.separator)
    at = header.names.index(spec.time[0])
    match = _OFFSET.search(row[at].strip().strip('"')) if at < len(row) else None
    return match[1] if match else ""


def _mixed(content: bytes, header: Header, spec: Spec, offset: str, table: pa.Table) -> bool:
    """Whether not every row is seen to have this very offset."""
    last = header.names.index(spec.time[0]) == len(header.names) - 1
    follows = b"\n" if last else spec.separator.encode()
    return bool(content.count(offset.encode() + follows, header.body) != table.num_rows)


def _may_have_rolled(micros: Micros) -> bool:
    """Whether 30 February may be among the times: arrow's strptime takes it for the 1st or 2nd of March."""
    days = np.unique(micros // 86_400_000_000).astype("datetime64[D]")
    of_month = (days - days.astype("datetime64[M]")).astype(int)
    return bool((of_month < 3).any())


def _seconds(offset: str) -> int:
    if offset == "Z":
        return 0
    digits = offset[1:].replace(":", "").ljust(4, "0")
    seconds = int(digits[:2]) * 3600 + int(digits[2:]) * 60
    return -seconds if offset[0] == "-" else seconds
