"""CSV as it should be, read in a fraction of a millisecond; anything odd is left to `csvtext`.

Nothing is inferred: each column has its type, times are ISO 8601 or of the declared format, and a cell of
any other kind makes the whole reading step back.
"""

import re
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as compute
import pyarrow.csv as pc
import pyarrow.parquet as pq

from rivid.errors import DataError
from rivid.logs.files import CutError, Limits, refuse_rows, refuse_size
from rivid.logs.header import BadRow, Columns, Header, Micros, check_names
from rivid.logs.spec import Spec
from rivid.logs.text import NumberReader
from rivid.logs.times import FIRST, LAST, UNIX, read_text
from rivid.types import Floats

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


LONGEST_TEXT = 100
"""Characters of a cell: a text column is unpacked only when no cell is longer."""


def read_parquet(content: bytes, spec: Spec, name: str, limits: Limits) -> Columns:
    """The columns of a Parquet log.

    Parameters
    ----------
    content : bytes
    spec : Spec
    name : str
        How messages call the log.
    limits : Limits

    Returns
    -------
    Columns

    Raises
    ------
    DataError
        For a file that is damaged, too large when unpacked, or has not the columns and types asked for;
        CutError for one without its end.
    """
    if content[:4] != b"PAR1":
        raise DataError(f"{name} is not a Parquet file: it does not begin with PAR1")
    if len(content) < 12 or content[-4:] != b"PAR1":
        raise CutError(f"{name} is cut off: a Parquet file ends with PAR1")
    try:
        table = _table(content, spec, name, limits)
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, MemoryError) as error:
        raise DataError(f"{name} is a damaged Parquet file: {' '.join(str(error).split())[:200]}") from None
    return _columns(table, spec, name)


def _table(content: bytes, spec: Spec, name: str, limits: Limits) -> pa.Table:
    wanted = [*spec.time, *spec.sources]
    limit = {"thrift_string_size_limit": 16 << 20, "thrift_container_size_limit": 200_000}
    file = pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True, **limit)
    schema = file.schema_arrow
    check_names(schema.names, spec, name)
    metadata = file.metadata
    refuse_rows(name, metadata.num_rows, limits)
    unpacked = sum(max(metadata.row_group(i).total_byte_size, 0) for i in range(metadata.num_row_groups))
    refuse_size(name, unpacked, limits)
    texts = []
    for column in wanted:
        kind = schema.field(column).type
        if _is_text(kind):
            texts.append(column)
        elif column in spec.time and not pa.types.is_timestamp(kind) and not _is_count(kind, spec):
            hint = ""
            if _is_number(kind):
                hint = '; seconds or milliseconds since 1970 are [input] time_format = "unix" or "unix_ms"'
            raise DataError(f"{name}: column {column!r} is of type {kind}: expected times or text{hint}")
        elif column in spec.sources and not _is_number(kind):
            raise DataError(f"{name}: column {column!r} is of type {kind}: expected numbers")
    if texts:  # as codes, so that a long text that many rows share stays one
        file = pq.ParquetFile(
            pa.BufferReader(content), page_checksum_verification=True, read_dictionary=texts, **limit
        )
    table = file.read(columns=wanted, use_threads=False)
    for column in texts:
        for chunk in table[column].chunks:
            words = chunk.dictionary if pa.types.is_dictionary(chunk.type) else chunk
            longest = compute.max(compute.binary_length(words)).as_py() or 0
            if longest > LONGEST_TEXT:
                raise DataError(
                    f"{name}: a cell of column {column!r} is {longest:,} bytes long: no time or number"
                )
    table.validate(full=True)
    return table


def _is_text(kind: pa.DataType) -> bool:
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


def _is_count(kind: pa.DataType, spec: Spec) -> bool:
    """Whether a column of numbers counts the time since 1970, as declared."""
    return spec.time_format in UNIX and len(spec.time) == 1 and _is_number(kind)


def _columns(table: pa.Table, spec: Spec, name: str) -> Columns:
    count = table.num_rows
    good = np.ones(count, bool)
    bad: dict[int, str] = {}
    times, offsets, aware = _times(table, spec, good, bad, name)
    numbers: dict[str, Floats] = {}
    for column in spec.sources:
        numbers[column] = _numbers(table[column], spec, column, good, bad)
    empty = np.all([np.asarray(table[c].is_null().to_numpy()) for c in (*spec.time, *spec.sources)], axis=0)
    for i in np.flatnonzero(empty):
        bad.pop(int(i), None)
    rows = np.flatnonzero(good)
    before = np.cumsum(good)
    seen = {None if o is None else int(o) for o in (offsets[rows] if offsets is not None else [None])}
    return Columns(
        times[rows],
        aware,
        next(iter(seen)) if len(seen) == 1 else None,
        {n: v[rows] for n, v in numbers.items()},
        lines=rows + 1,
        bad=[BadRow(int(before[i]), f"row {i + 1}: {bad[i]}") for i in sorted(bad)],
        dropped={"empty rows": before[empty].tolist()} if empty.any() else {},
        zone=_named_zone(table[spec.time[0]].type),
        unit="row",
    )


def _times(
    table: pa.Table, spec: Spec, good: np.ndarray, bad: dict[int, str], name: str
) -> tuple[Micros, np.ndarray | None, bool]:
    """Times [us], offsets [s] of text times, and whether there are offsets."""
    columns = [table[column] for column in spec.time]
    if len(columns) == 1 and pa.types.is_timestamp(columns[0].type):
        zone = columns[0].type.tz
        cast = columns[0].cast(pa.timestamp("us", tz=zone), safe=False).cast(pa.int64())
        times = np.asarray(compute.fill_null(cast, 0).to_numpy(), np.int64)
        _mark(np.asarray(columns[0].is_null().to_numpy()), good, bad, "no time")
        _mark((times < FIRST) | (times >= LAST), good, bad, "a year that no log is of")
        return times, _stored_offset(zone, len(times)), zone is not None
    if _is_count(columns[0].type, spec):
        counts = np.asarray(columns[0].cast(pa.float64(), safe=False).to_numpy(), np.float64)
        micros = np.rint(counts * UNIX[spec.time_format or ""])  # exact: below 2^53 until 2200
        _mark(np.isnan(micros), good, bad, "no time")
        _mark(~((micros >= FIRST) & (micros < LAST)), good, bad, "a year that no log is of")
        return np.where(good, micros, 0.0).astype(np.int64), np.zeros(len(counts), np.int64), True
    texts = [c.to_pylist() for c in columns]
    times, offsets = np.zeros(len(good), np.int64), np.full(len(good), None, object)
    for i, cells in enumerate(zip(*texts, strict=True)):
        text = " ".join(str(c) for c in cells)
        time = read_text(text, spec.time_format)
        if time is None:
            good[i], bad[i] = (
                False,
                f"{text[:40]!r} is no time: expected ISO 8601, or set [input] time_format",
            )
        else:
            times[i], offsets[i] = time
    kinds = {o is None for o in offsets[good]}
    if len(kinds) > 1:
        raise DataError(f"{name}: times with and without offset are mixed: expected one kind")
    return times, offsets, kinds == {False}


def _stored_offset(zone: str | None, count: int) -> np.ndarray | None:
    """The one offset of a fixed zone like UTC or +01:00; a named zone must be declared to give local days."""
    if zone is None:
        return None
    if zone.upper() in ("UTC", "Z", "ETC/UTC", "GMT"):
        return np.zeros(count, np.int64)
    if len(zone) == 6 and zone[0] in "+-" and zone[3] == ":" and (zone[1:3] + zone[4:]).isdigit():
        seconds = int(zone[1:3]) * 3600 + int(zone[4:]) * 60
        return np.full(count, -seconds if zone[0] == "-" else seconds, np.int64)
    return None


def _named_zone(kind: pa.DataType) -> str | None:
    zone = kind.tz if pa.types.is_timestamp(kind) else None
    return None if zone is None or _stored_offset(zone, 1) is not None else str(zone)


def _numbers(column: pa.ChunkedArray, spec: Spec, name: str, good: np.ndarray, bad: dict[int, str]) -> Floats:
    if not _is_text(column.type):
        values: Floats = np.array(column.cast(pa.float64()).to_numpy(), np.float64)
        infinite = np.isinf(values)
        if infinite.any():
            _mark(infinite, good, bad, f"column {name!r} holds an infinite number")
        return values
    reader = NumberReader(spec.missing, spec.decimal, spec.thousands)
    values = np.full(len(good), np.nan)
    for i, text in enumerate(column.to_pylist()):
        value = np.nan if text is None else reader.read(text)
        if value is None:
            good[i] = False
            bad.setdefault(i, f"column {name!r} holds {text[:40]!r}, which is no number: {reader.hint(text)}")
        else:
            values[i] = value
    return values


def _mark(rows: np.ndarray, good: np.ndarray, bad: dict[int, str], reason: str) -> None:
    for i in np.flatnonzero(rows):
        bad.setdefault(int(i), reason)
    good &= ~rows
