"""Files that Arrow reads: clean CSV logs in a fraction of a millisecond, and Parquet.

Nothing is inferred. A CSV column has its type, times are ISO 8601 or of the declared format, and a cell of
other kind leaves the file to :mod:`rivid.logs.text`. Of Parquet, size and types are checked before anything
is unpacked.
"""

import re
from collections import Counter
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as compute
import pyarrow.csv as pc

from rivid.errors import DataError
from rivid.logs.columns import Columns, Fault, NumberReader, Table, check_names
from rivid.logs.files import CutError, Limits, refuse_rows, refuse_size
from rivid.logs.spec import Spec
from rivid.logs.text import Header, RowReader
from rivid.logs.times import FIRST, LAST, UNIX, read_text
from rivid.types import Bools, Floats, Ints

pa.enable_signal_handlers(False)  # its CSV reader loses a signal that comes while a file is refused

_OFFSET = re.compile(r"\d{1,2}:?\d\d.*?(Z|[+-]\d\d(?::?\d\d)?)$")
_FLOAT = pa.float64()
_NAIVE = pa.timestamp("us")
_AWARE = pa.timestamp("us", tz="UTC")
LONGEST_TEXT = 200
"""Characters of a cell of Parquet: a text column is unpacked only where no cell is longer."""
_FOOTER = {"thrift_string_size_limit": 16 << 20, "thrift_container_size_limit": 200_000}
"""Of the metadata of Parquet: a damaged length must not ask for gigabytes."""
_NO_YEAR = "a year that no log is of"


def read_fast(content: bytes, header: Header, spec: Spec) -> Columns | None:
    """The columns of a clean CSV log in UTF-8; None where it needs the tolerant reader."""
    given = spec.input
    if not spec.plain or given.separator == " " or content[-1:] not in b"\r\n":
        return None
    if len(spec.time) > 1 or given.thousands or given.time_format in UNIX:
        return None
    if "%z" in (given.time_format or "").lower():
        return None
    offset = _first_offset(content, header, spec) if given.time_format is None else ""
    body = memoryview(content)[header.body :]
    try:
        table = pc.read_csv(pa.BufferReader(pa.py_buffer(body)), *_options(header.names, spec, bool(offset)))
    except (pa.ArrowException, ValueError, KeyError, OSError):
        return None
    if not table.num_rows or (
        offset and not given.time_zone and _mixed(content, header, spec, offset, table)
    ):
        return None
    times = table.column(0)
    if times.null_count:
        return None
    micros = times.to_numpy().view(np.int64)
    if micros.min() < FIRST or micros.max() >= LAST:
        return None
    if given.time_format and _may_have_rolled(micros):
        return None
    numbers = {}
    for i, name in enumerate(spec.sources, 1):
        column = table.column(i)
        values = column.to_numpy()
        if np.count_nonzero(np.isfinite(values)) != len(values) - column.null_count:
            return None  # infinite, or a NaN that is not declared missing
        numbers[name] = values
    seconds = _seconds(offset) if offset else None
    return Columns(micros, bool(offset), seconds, numbers, header.line + given.unit_rows + 1)


@lru_cache(maxsize=16)
def _options(names: tuple[str, ...], spec: Spec, aware: bool) -> tuple[Any, Any, Any]:
    given, wanted = spec.input, [spec.time[0], *spec.sources]
    # unused columns may be doubled or nameless; arrow wants distinct names
    distinct = [n if n in wanted else f"\x00{i}" for i, n in enumerate(names)]
    types = {name: _FLOAT for name in spec.sources} | {spec.time[0]: _AWARE if aware else _NAIVE}
    return (
        pc.ReadOptions(use_threads=False, column_names=distinct, block_size=1 << 30),
        pc.ParseOptions(delimiter=given.separator),
        pc.ConvertOptions(
            column_types=types,
            include_columns=wanted,
            null_values=given.missing,
            decimal_point=given.decimal,
            timestamp_parsers=[given.time_format] if given.time_format else None,
        ),
    )


def _first_offset(content: bytes, header: Header, spec: Spec) -> str:
    """The UTC offset written in the first row, empty where there is none."""
    end = content.find(b"\n", header.body)
    row = content[header.body : end if end >= 0 else None].decode("utf-8", "replace")
    cells = row.split(spec.input.separator)
    at = header.names.index(spec.time[0])
    match = _OFFSET.search(cells[at].strip().strip('"')) if at < len(cells) else None
    return match[1] if match else ""


def _mixed(content: bytes, header: Header, spec: Spec, offset: str, table: pa.Table) -> bool:
    """Whether some rows may have another offset."""
    last = header.names.index(spec.time[0]) == len(header.names) - 1
    follows = b"\n" if last else spec.input.separator.encode()
    return bool(content.count(offset.encode() + follows, header.body) != table.num_rows)


def _may_have_rolled(micros: Ints) -> bool:
    """Whether 30 February may be among the times: arrow's strptime takes it for the 1st or 2nd of March."""
    days = np.unique(micros // 86_400_000_000).astype("datetime64[D]")
    of_month = (days - days.astype("datetime64[M]")).astype(int)
    return bool((of_month < 3).any())


def _seconds(offset: str) -> int:
    """Seconds of an offset like Z, +01, +0100 or +01:00."""
    digits = offset[1:].replace(":", "").ljust(4, "0")
    seconds = int(digits[:2]) * 3600 + int(digits[2:]) * 60
    return -seconds if offset[0] == "-" else seconds


def read_parquet(
    content: bytes, spec: Spec, name: str, limits: Limits, stem: str = "", *, watch: bool = False
) -> Table:
    """Read a Parquet file.

    Numbers and times are taken as they are. With flags, zones or tags, or to `watch` the other columns, cells
    are read as texts: by the same rules as in text files.

    Parameters
    ----------
    content : bytes
    spec : Spec
    name : str
        File name for messages.
    limits : Limits
    stem : str
        Tag of all rows of the long layout where no column holds it.
    watch : bool
        Whether to collect the texts of columns that are not read; some of the sources are then enough.

    Raises
    ------
    DataError
        For a file that is damaged, too large when unpacked, or lacks the required columns and types;
        CutError for one without its end.
    """
    if content[:4] != b"PAR1":
        raise DataError(f"{name} is not a Parquet file: it does not begin with PAR1")
    if len(content) < 12 or content[-4:] != b"PAR1":
        raise CutError(f"{name} is cut off: a Parquet file ends with PAR1")
    try:
        if watch:
            return _as_texts(_unpack(content, None, spec, name, limits), spec, stem, watch)
        wanted = dict.fromkeys(
            [*spec.time, *spec.sources, *spec.flags.values(), spec.input.zone_column or ""]
        )
        table = _unpack(content, [*filter(None, wanted)], spec, name, limits)
        return _as_numbers(table, spec, name) if spec.plain else _as_texts(table, spec, stem, watch)
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, MemoryError) as error:
        raise DataError(f"{name} is a damaged Parquet file: {' '.join(str(error).split())[:200]}") from None


def _unpack(content: bytes, wanted: list[str] | None, spec: Spec, name: str, limits: Limits) -> pa.Table:
    """The wanted columns, or all, after a check of names, sizes and types."""
    import pyarrow.parquet as pq  # 65 ms, which a directory of CSV logs need not wait for

    def opened(texts: list[str]) -> Any:
        source = pa.BufferReader(content)
        return pq.ParquetFile(source, page_checksum_verification=True, read_dictionary=texts, **_FOOTER)

    file = opened([])
    schema = file.schema_arrow
    check_names(schema.names, spec, name, some=wanted is None)
    metadata = file.metadata
    refuse_rows(name, metadata.num_rows, limits)
    unpacked = sum(max(metadata.row_group(i).total_byte_size, 0) for i in range(metadata.num_row_groups))
    refuse_size(name, unpacked, limits)
    counts = Counter(schema.names)
    read = wanted or [column for column in schema.names if counts[column] == 1]
    texts = [column for column in read if _is_text(schema.field(column).type)]
    for column in wanted or ():
        kind = schema.field(column).type
        if column in texts:
            continue
        if column in spec.time and not pa.types.is_timestamp(kind) and not _is_count(kind, spec):
            hint = ""
            if _is_number(kind):
                hint = '; seconds or milliseconds since 1970 are [input] time_format = "unix" or "unix_ms"'
            raise DataError(f"{name}: column {column!r} is of type {kind}: expected times or text{hint}")
        if column in spec.sources and not _is_number(kind):
            raise DataError(f"{name}: column {column!r} is of type {kind}: expected numbers")
    if texts:  # as codes, so that a long text that many rows share stays one
        file = opened(texts)
    table = file.read(columns=wanted, use_threads=False)
    for column in texts:
        for chunk in table[column].chunks:
            words = chunk.dictionary if pa.types.is_dictionary(chunk.type) else chunk
            longest = compute.max(compute.binary_length(words.cast(pa.large_string()))).as_py() or 0
            if longest > LONGEST_TEXT:
                raise DataError(
                    f"{name}: a cell of column {column!r} is {longest:,} bytes long: no time or number"
                )
    table.validate(full=True)
    return table


def _is_text(kind: pa.DataType) -> bool:
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    return str(kind) in ("string", "large_string", "string_view")


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


def _is_count(kind: pa.DataType, spec: Spec) -> bool:
    """Whether a column of numbers counts the time since 1970, as declared."""
    return spec.input.time_format in UNIX and len(spec.time) == 1 and _is_number(kind)


def _as_texts(table: pa.Table, spec: Spec, stem: str, watch: bool) -> Table:
    """The rows of a table as a text file would hold them."""
    names = tuple(table.column_names)
    kinds = {str(table.schema.field(column).type) for column in spec.time}
    if all(kind.startswith("timestamp") for kind in kinds):
        spec = replace(spec, input=spec.input.model_copy(update={"time_format": None}))
    reader = RowReader(names, spec, stem, watch, unit="row")
    columns = [_texts(column, spec.input.decimal) for column in table.columns]
    for number, cells in enumerate(zip(*columns, strict=True), 1):
        reader.row(number, list(cells))
    return reader.table()


def _texts(column: pa.ChunkedArray, decimal: str) -> list[str]:
    texts = []
    for cell in column.to_pylist():
        if cell is None:
            text = ""
        elif isinstance(cell, float):
            text = "" if cell != cell else repr(cell).replace(".", decimal)
        else:
            text = cell.isoformat() if hasattr(cell, "isoformat") else str(cell)
        if len(text) > LONGEST_TEXT:
            raise ValueError(f"a cell is {len(text):,} characters long")
        texts.append(text.strip())
    return texts


def _as_numbers(table: pa.Table, spec: Spec, name: str) -> Table:
    """Times and numbers of a table, column by column."""
    good = np.ones(table.num_rows, bool)
    bad: dict[int, str] = {}
    times, offsets, aware, zone = _times(table, spec, good, bad, name)
    numbers = {column: _numbers(table[column], spec, column, good, bad) for column in spec.sources}
    empty = np.all([np.asarray(table[c].is_null().to_numpy()) for c in (*spec.time, *spec.sources)], axis=0)
    for i in np.flatnonzero(empty):
        bad.pop(int(i), None)
    rows = np.flatnonzero(good)
    before = np.cumsum(good)
    known = set(offsets[rows].tolist()) if offsets is not None else {None}
    faults = [Fault(int(before[i]), f"row {i + 1}: {bad[i]}") for i in sorted(bad)]
    if not len(rows):
        return Table([], faults[0].text if faults else "a header and no rows")
    columns = Columns(
        times[rows],
        aware,
        known.pop() if len(known) == 1 else None,
        {column: values[rows] for column, values in numbers.items()},
        lines=rows + 1,
        bad=faults,
        dropped={"empty rows": before[empty].tolist()} if empty.any() else {},
        zone=zone,
        unit="row",
    )
    return Table([columns], rows=table.num_rows)


def _times(
    table: pa.Table, spec: Spec, good: Bools, bad: dict[int, str], name: str
) -> tuple[Ints, np.ndarray | None, bool, str | None]:
    """Times [us], offsets [s] where known, whether there are offsets, and the name of a stored zone."""
    columns = [table[column] for column in spec.time]
    given = spec.input.time_format
    if len(columns) == 1 and pa.types.is_timestamp(columns[0].type):
        zone = columns[0].type.tz
        cast = columns[0].cast(pa.timestamp("us", tz=zone), safe=False).cast(pa.int64())
        times = np.asarray(compute.fill_null(cast, 0).to_numpy(), np.int64)
        _mark(np.asarray(columns[0].is_null().to_numpy()), good, bad, "no time")
        _mark((times < FIRST) | (times >= LAST), good, bad, _NO_YEAR)
        offset = _fixed_offset(zone)
        if offset is None:
            return times, None, zone is not None, zone
        return times, np.full(len(times), offset, np.int64), True, None
    if _is_count(columns[0].type, spec):
        counts = np.asarray(columns[0].cast(_FLOAT, safe=False).to_numpy(), np.float64)
        micros = np.rint(counts * UNIX[given or ""])  # exact: below 2^53 until 2200
        _mark(np.isnan(micros), good, bad, "no time")
        _mark(~((micros >= FIRST) & (micros < LAST)), good, bad, _NO_YEAR)
        return np.where(good, micros, 0.0).astype(np.int64), np.zeros(len(counts), np.int64), True, None
    texts = [column.to_pylist() for column in columns]
    times, offsets = np.zeros(len(good), np.int64), np.full(len(good), None, object)
    for i, cells in enumerate(zip(*texts, strict=True)):
        text = " ".join(str(c) for c in cells)
        time = read_text(text, given)
        if time is None:
            good[i] = False
            bad[i] = f"{text[:40]!r} is no time: expected ISO 8601, or set [input] time_format"
        else:
            times[i], offsets[i] = time
    kinds = {offset is None for offset in offsets[good]}
    if len(kinds) > 1:
        raise DataError(f"{name}: times with and without offset are mixed: expected one kind")
    return times, offsets, kinds == {False}, None


def _fixed_offset(zone: str | None) -> int | None:
    """The offset of a fixed zone like UTC or +01:00 [s]; None for a named one: it must give local days."""
    if zone is not None and zone.upper() in ("UTC", "Z", "ETC/UTC", "GMT"):
        return 0
    return _seconds(zone) if zone is not None and re.fullmatch(r"[+-]\d\d:\d\d", zone) else None


def _numbers(column: pa.ChunkedArray, spec: Spec, name: str, good: Bools, bad: dict[int, str]) -> Floats:
    if not _is_text(column.type):
        # an integer beyond 2^53 loses digits: no value of a river, so the day fails by its size
        values: Floats = np.array(column.cast(_FLOAT, safe=False).to_numpy(), np.float64)
        _mark(np.isinf(values), good, bad, f"column {name!r} holds an infinite number")
        return values
    given = spec.input
    reader = NumberReader(given.missing, given.decimal, given.thousands)
    values = np.full(len(good), np.nan)
    for i, text in enumerate(column.to_pylist()):
        value = np.nan if text is None else reader.read(text)
        if value is None:
            good[i] = False
            bad.setdefault(i, reader.refusal(name, text))
        else:
            values[i] = value
    return values


def _mark(rows: Bools, good: Bools, bad: dict[int, str], reason: str) -> None:
    for i in np.flatnonzero(rows):
        bad.setdefault(int(i), reason)
    good &= ~rows
