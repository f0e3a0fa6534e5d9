"""A log file in memory: sorted columns in UTC and SI units, what was masked or dropped, and its faults.

Arrow reads Parquet, and clean CSV logs in a fraction of a millisecond. Nothing is inferred: a CSV column has
its type, times are ISO 8601 or of the declared format, and a cell of another kind leaves the file to
:mod:`rivid.logs.text`. Of Parquet, size and types are checked before anything is unpacked.
"""

import datetime as dt
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from hashlib import sha256
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pyarrow.compute as compute
import pyarrow.csv as pc

from rivid.errors import DataError
from rivid.logs.formats import as_text
from rivid.logs.spec import (
    COUNTS,
    DAY,
    FIRST,
    LAST,
    MANY,
    MICRO,
    CutError,
    Signal,
    Spec,
    clock,
    day_bounds,
    is_day_file,
    local,
    read_bytes,
    refuse_rows,
    refuse_size,
    seconds_of,
    shown,
    stem_of,
    to_utc,
)
from rivid.logs.text import (
    LINE,
    Columns,
    Fault,
    Header,
    RowReader,
    Table,
    UndeclaredError,
    check_names,
    cut_footer,
    end_of_lines,
    read_header,
    read_lines,
    split_cells,
    to_utf8,
)
from rivid.types import Bools, Floats, Ints

pa.enable_signal_handlers(False)  # its CSV reader loses a signal that comes while a file is refused

_OFFSET = re.compile(r"\d{1,2}:?\d\d.*?(Z|[+-]\d\d(?::?\d\d)?)$")
_FLOAT = pa.float64()
LONGEST_TEXT = 200  # characters of a cell of Parquet: a text column is unpacked only where no cell is longer
# of the metadata of Parquet: a damaged length must not ask for gigabytes
_FOOTER = {"thrift_string_size_limit": 16 << 20, "thrift_container_size_limit": 200_000}


def read_fast(content: bytes, header: Header, spec: Spec) -> Columns | None:
    """The columns of a clean CSV log in UTF-8; None where it needs the tolerant reader."""
    given, (names, begin, line) = spec.input, header
    odd = given.separator == " " or len(spec.time) > 1 or given.thousands or given.time_format in COUNTS
    if odd or not spec.plain or content[-1:] not in b"\r\n" or "%z" in (given.time_format or "").lower():
        return None
    offset = _first_offset(content, header, spec) if given.time_format is None else ""
    body = pa.py_buffer(memoryview(content)[begin:])
    try:
        table = pc.read_csv(pa.BufferReader(body), *_options(names, spec, bool(offset)))
    except (pa.ArrowException, ValueError, KeyError, OSError):
        return None
    if not table.num_rows or table.column(0).null_count:
        return None
    if offset and not given.time_zone:  # some rows may have another offset
        follows = b"\n" if names.index(spec.time[0]) == len(names) - 1 else given.separator.encode()
        if content.count(offset.encode() + follows, begin) != table.num_rows:
            return None
    micros = table.column(0).to_numpy().view(np.int64)
    if micros.min() < FIRST or micros.max() >= LAST or (given.time_format and _may_have_rolled(micros)):
        return None
    numbers = {name: table[name].to_numpy() for name in spec.sources}
    if any(np.count_nonzero(~np.isfinite(v)) != table[name].null_count for name, v in numbers.items()):
        return None  # infinite, or a NaN that is not declared missing
    first = line + given.unit_rows + 1
    seconds = seconds_of(offset) if offset else None
    return Columns(micros, bool(offset), seconds, numbers, range(first, first + len(micros)))


@lru_cache(maxsize=16)
def _options(names: tuple[str, ...], spec: Spec, aware: bool) -> tuple[Any, Any, Any]:
    given, wanted = spec.input, [spec.time[0], *spec.sources]
    # unused columns may be doubled or nameless; arrow wants distinct names
    distinct = [n if n in wanted else f"\x00{i}" for i, n in enumerate(names)]
    types = {name: _FLOAT for name in spec.sources}
    types[spec.time[0]] = pa.timestamp("us", tz="UTC" if aware else None)
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
    names, begin, _ = header
    row = content[begin : end_of_lines(content, begin)].decode("utf-8", "replace")
    cells = row.split(spec.input.separator)
    at = names.index(spec.time[0])
    match = _OFFSET.search(cells[at].strip().strip('"')) if at < len(cells) else None
    return match[1] if match else ""


def _may_have_rolled(micros: Ints) -> bool:
    """Whether 30 February may be among the times: arrow's strptime takes it for the 1st or 2nd of March."""
    days = np.unique(micros // 86_400_000_000).astype("datetime64[D]")
    of_month = (days - days.astype("datetime64[M]")).astype(int)
    return bool((of_month < 3).any())


def read_parquet(
    content: bytes, spec: Spec, name: str, limits: tuple[int, int], stem: str, *, watch: bool
) -> Table:
    """Read a Parquet file; `limits` of bytes, unpacked, and rows; `stem`, `watch` as of :class:`RowReader`.

    Numbers and times are taken as they are. With texts, flags, zones or tags, or to `watch` the other
    columns, cells are read as in text files.
    """
    if content[:4] != b"PAR1":
        raise DataError(f"{name} is not a Parquet file: it does not begin with PAR1")
    if len(content) < 12 or content[-4:] != b"PAR1":
        raise CutError(f"{name} is cut off: a Parquet file ends with PAR1")
    try:
        if watch:
            return _as_texts(_unpack(content, None, spec, name, limits), spec, stem, watch)
        wanted = [*spec.time, *spec.sources, *spec.flags.values(), spec.input.zone_column]
        table = _unpack(content, [*filter(None, dict.fromkeys(wanted))], spec, name, limits)
        typed = spec.plain and len(spec.time) == 1 and not any(map(_is_text, table.schema.types))
        return _as_numbers(table, spec) if typed else _as_texts(table, spec, stem, watch)
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, MemoryError) as error:
        raise DataError(f"{name} is a damaged Parquet file: {' '.join(str(error).split())[:200]}") from None


def head_of_parquet(content: bytes, name: str, rows: int) -> bytes:
    """The first rows of a Parquet file as CSV, to be looked at as a text file is."""
    sink = pa.BufferOutputStream()
    try:
        batches = _opened(content, name, MANY).iter_batches(rows, use_threads=False)
        pc.write_csv(pa.Table.from_batches([next(batches)]), sink)
    except (pa.ArrowException, OSError, ValueError, StopIteration, MemoryError) as error:
        reason = " ".join(str(error).split())[:200] or "it holds no rows"
        raise DataError(f"{name}: this Parquet file cannot be read as a table: {reason}") from None
    return bytes(sink.getvalue())


def _opened(content: bytes, name: str, limits: tuple[int, int], **given: Any) -> Any:
    """A Parquet file, after a check of the sizes that it states."""
    import pyarrow.parquet as pq  # 65 ms, which a directory of CSV logs need not wait for

    file = pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True, **_FOOTER, **given)
    metadata = file.metadata
    refuse_rows(name, metadata.num_rows, limits[1])
    unpacked = sum(max(metadata.row_group(i).total_byte_size, 0) for i in range(metadata.num_row_groups))
    refuse_size(name, unpacked, limits[0])
    return file


def _unpack(
    content: bytes, wanted: list[str] | None, spec: Spec, name: str, limits: tuple[int, int]
) -> pa.Table:
    """The wanted columns, or all, after a check of names, sizes and types."""
    file = _opened(content, name, limits)
    schema = file.schema_arrow
    check_names(schema.names, spec, name, some=wanted is None)
    read = wanted or [column for column in schema.names if schema.names.count(column) == 1]
    texts = [column for column in read if _is_text(schema.field(column).type)]
    for column in wanted or ():
        kind, expected = schema.field(column).type, ""
        is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)
        counted = is_number and (len(spec.time) > 1 or spec.input.time_format in COUNTS)
        if column in spec.time and not pa.types.is_timestamp(kind) and not counted:
            hint = '; seconds or milliseconds since 1970 are [input] time_format = "unix" or "unix_ms", '
            hint += 'days of a spreadsheet "excel"'
            expected = f"times or text{hint if is_number else ''}"
        elif column in spec.sources and not is_number:
            expected = "numbers"
        if expected and column not in texts:
            raise DataError(f"{name}: column {column!r} is of type {kind}: expected {expected}")
    if texts:  # as codes, so that a long text that many rows share stays one
        file = _opened(content, name, limits, read_dictionary=texts)
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


def _as_texts(table: pa.Table, spec: Spec, stem: str, watch: bool) -> Table:
    """The rows of a table as a text file would hold them; in a log, a cell of nothing is not measured."""
    kinds = [table.schema.field(column).type for column in spec.time]
    given: dict[str, Any] = {} if watch else {"missing": [*spec.input.missing, ""]}
    if all(map(pa.types.is_timestamp, kinds)):
        given["time_format"] = None
    spec = replace(spec, input=spec.input.model_copy(update=given))
    names = tuple(table.column_names)
    reader = RowReader(names, spec, stem, watch, unit="row")
    columns = [_texts(table[i], "." if n in spec.time else spec.input.decimal) for i, n in enumerate(names)]
    for number, cells in enumerate(zip(*columns, strict=True), 1):
        if watch or any(cells):
            reader.row(number, list(cells))
        else:
            reader.dropped["empty rows"].append(reader.count)
    read, zone = reader.table(), getattr(kinds[0], "tz", None)
    if _fixed_offset(zone) is None:
        read.parts = [replace(columns, zone=zone) for columns in read.parts]
    return read


def _texts(column: pa.ChunkedArray, decimal: str) -> list[str]:
    kind = column.type
    if pa.types.is_timestamp(kind):  # Python has no nanoseconds
        column = column.cast(pa.timestamp("us", tz=kind.tz), safe=False)
    elif pa.types.is_decimal(kind):
        column = column.cast(_FLOAT, safe=False)

    def text(cell: Any) -> str:
        if cell is None or cell != cell:
            return ""
        if isinstance(cell, float):
            return repr(cell).replace(".", decimal)
        return cell.isoformat() if hasattr(cell, "isoformat") else str(cell).strip()

    return [text(cell) for cell in column.to_pylist()]


def _as_numbers(table: pa.Table, spec: Spec) -> Table:
    """A time and numbers, none of them texts, column by column."""
    bad: dict[int, str] = {}
    times, zone = _times(table[spec.time[0]], spec, bad)
    offset, numbers = _fixed_offset(zone), {}
    for name in spec.sources:
        # an integer beyond 2^53 loses digits: no value of a river, so the day fails by its size
        numbers[name] = np.asarray(table[name].cast(_FLOAT, safe=False).to_numpy(), np.float64)
        _mark(np.isinf(numbers[name]), bad, f"column {name!r} holds an infinite number")
    good = np.ones(table.num_rows, bool)
    good[list(bad)] = False
    empty = np.all([column.is_null().to_numpy() for column in table.columns], axis=0)
    rows, before = np.flatnonzero(good), np.cumsum(good)
    faults = [Fault(int(before[i]), f"row {i + 1}: {bad[i]}") for i in sorted(bad) if not empty[i]]
    if not len(rows):
        return Table([], faults[0].text if faults else "a header and no rows")
    columns = Columns(
        times[rows],
        zone is not None,
        offset,
        {column: values[rows] for column, values in numbers.items()},
        range(1, len(rows) + 1) if len(rows) == len(good) else (rows + 1).tolist(),
        bad=faults,
        dropped={"empty rows": before[empty].tolist()},
        zone=zone if offset is None else None,
        unit="row",
    )
    return Table([columns], rows=table.num_rows)


def _times(column: pa.ChunkedArray, spec: Spec, bad: dict[int, str]) -> tuple[Ints, str | None]:
    """Times [us], and their zone: that of the timestamps or counts."""
    if pa.types.is_timestamp(column.type):
        zone = column.type.tz
        micros = column.cast(pa.timestamp("us", tz=zone), safe=False).cast(pa.int64()).to_numpy()
    else:
        time_format = spec.input.time_format or ""
        zone = None if time_format == "excel" else "UTC"
        steps, length, begin = COUNTS[time_format]
        micros = np.rint((column.cast(_FLOAT, safe=False).to_numpy() - begin) * steps) * length
    known = (micros >= FIRST) & (micros < LAST)  # as floating-point numbers they are exact until 2200
    _mark(np.isnan(micros), bad, "no time")
    _mark(~known, bad, "a year that no log is of")
    return np.where(known, micros, 0).astype(np.int64), zone


def _fixed_offset(zone: str | None) -> int | None:
    """The offset of a fixed zone like UTC or +01:00 [s]; None for a named one: it must give local days."""
    if zone is not None and zone.upper() in ("UTC", "Z", "ETC/UTC", "GMT"):
        return 0
    return seconds_of(zone) if zone is not None and re.fullmatch(r"[+-]\d\d:\d\d", zone) else None


def _mark(rows: Bools, bad: dict[int, str], reason: str) -> None:
    for i in np.flatnonzero(rows).tolist():
        bad.setdefault(i, reason)


LARGEST = 1e6  # largest flow [m3/s] or level [m]: beyond any river or gauge, so a larger number is damage

PLAIN = (
    *(-999.0, -999.9, -999.99, -999.999, -9999.0, -9999.9, -9999.99, -99999.0, -999999.0),
    *(-7777.0, -7999.0, -8888.0, -6999.0, -32767.0, -32768.0, 6999.0, 7999.0, 9999.0, 9999.9, 9999.99),
    *(32767.0, 65535.0, 99999.0, 99999.9, 99999.99, 999999.0),
)
"""Numbers that loggers write where nothing was measured, and that no flow or dam is set to."""
ROUND = (-99.0, -99.9, -99.99, -777.0, -1000.0)
"""Others, which a pump may be set to: they must lie farther off, and among values that are all positive."""
SENTINELS = (*PLAIN, *ROUND)
# a number that is off by less than the range of the values and this part of the largest is taken as data
NEAR = 0.1
FARTHER = 2.0  # number of such distances by which a number of :data:`ROUND` must be off
_LEAST, _MOST = max(s for s in SENTINELS if s < 0), min(s for s in SENTINELS if s > 0)
_HOUR = 3600 * MICRO

_kept: dict[tuple[object, ...], "Log"] = {}  # the oldest first; an OrderedDict hashes keys to list its values
# files and rows that a process keeps in memory, as windows share days; two files are kept in any case
KEPT_FILES, KEPT_ROWS = 40, 1_000_000


@dataclass(frozen=True, eq=False)
class Log:
    """A log file, read."""

    name: str  # file name for messages
    spec: Spec
    zone: dt.tzinfo  # of the local days
    times: Ints  # (n,) distinct times of its rows, ascending [us UTC]
    # per canonical column: times from which its values count [us], and those that are there [m3/s or m]
    series: dict[str, tuple[Ints, Floats]]
    faults: tuple[Fault, ...]  # in order of time
    events: dict[str, Ints]  # times [us], ascending, of what was masked, dropped or sorted, per kind
    digest: str  # SHA-256 of the file

    def bounds(self, date: dt.date) -> tuple[int, int]:
        """A local day's rows are those from the first instant on, before the second [us]."""
        start, end = day_bounds(date, self.zone)
        return start - self.spec.tolerance, end - self.spec.tolerance

    def of_day(self, date: dt.date) -> dict[str, tuple[Ints, Floats]]:
        """The part of each series that belongs to a local day."""
        return {name: cut(*column, *self.bounds(date)) for name, column in self.series.items()}

    def closing(self, end: int) -> dict[str, tuple[Ints, Floats]]:
        """The part of each series that is stamped from `end` on, but belongs before it [us]."""
        signals = self.spec.signals
        return {one.name: cut(*self.series[one.name], end - one.shift, end) for one in signals}

    def is_edge(self, date: dt.date) -> bool:
        """Whether a local day has no row but such as begin or end another day, at its midnights."""
        return at_midnights(self.times, self.faults, *self.bounds(date), self.spec)

    def faults_of(self, date: dt.date) -> list[Fault]:
        """The faults of a local day, those of the rows that close it included."""
        start, end = self.bounds(date)
        return [fault for fault in self.faults if start <= fault.at < end + self.spec.latest]

    def events_of(self, date: dt.date) -> dict[str, int]:
        """Number of values that were masked, dropped or sorted on a local day, by kind."""
        start, end = self.bounds(date)
        counts = {k: int(np.diff(t.searchsorted((start, end)))[0]) for k, t in self.events.items()}
        return {kind: count for kind, count in counts.items() if count}

    def digest_of(self, date: dt.date) -> str:
        """Digest of a local day: changes when, and only when, what is read of that day changes."""
        digest = sha256()
        for name, (times, values) in self.of_day(date).items():
            digest.update(f"{name} {len(times)};".encode())
            digest.update(times.data)
            digest.update(values.data)
        digest.update(repr((self.faults_of(date), sorted(self.events_of(date).items()))).encode())
        return digest.hexdigest()

    def dates(self) -> list[dt.date]:
        """Local days of which the log has values or faults, ascending."""
        parts = list({id(times): times for times, _ in self.series.values()}.values())  # mostly shared
        parts.append(np.array([fault.at for fault in self.faults], np.int64))
        return days_of(np.concatenate(parts), self.zone, self.spec.tolerance)


def cut(times: Ints, values: Floats, start: int, end: int) -> tuple[Ints, Floats]:
    """Ascending times (n,) from `start` on, before `end` [us UTC], and the values (n,) there."""
    low, high = times.searchsorted((start, end)).tolist()
    return times[low:high], values[low:high]


def at_midnights(stamps: Ints, faults: Sequence[Fault], start: int, end: int, spec: Spec) -> bool:
    """Whether stamps (n,) of a day's bounds [us UTC] are those of rows at its midnights alone."""
    much_of_a_day = 2 * max(signal.spacing for signal in spec.signals) > end - start
    if much_of_a_day or any(start <= fault.at < end for fault in faults):
        return False
    low, high = stamps.searchsorted((start + max(2 * spec.tolerance + 1, spec.latest), end))
    return bool(low == high)


def days_of(times: Ints, zone: dt.tzinfo, early: int) -> list[dt.date]:
    """Local days of times [us UTC], ascending; up to `early` [us] before midnight counts for the next day."""
    days, at = [], 0
    times = np.sort(times, kind="stable") + early  # columns in order: sorted in one pass
    while at < len(times):
        date = local(int(times[at]), zone).date()
        days.append(date)
        at = int(times.searchsorted(day_bounds(date, zone)[1]))
    return days


def load(path: Path, spec: Spec, *, fresh: bool = False) -> Log:
    """Read a log, or return it as read before; `fresh` reads it in any case."""
    try:
        status = path.stat()
    except OSError as error:
        raise DataError(f"{shown(path.name)} cannot be read: {error.strerror}") from None
    # within the clock's tick a changed file may look unchanged
    key = (path, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns, spec)
    log = None if fresh else _kept.pop(key, None)
    if log is None:
        try:
            log = make_log(read_table(path, spec), spec)
        except MemoryError:
            size = f"{status.st_size / 1e6:,.0f} MB"
            raise DataError(f"{shown(path.name)} does not fit into memory ({size})") from None
    _kept[key] = log
    while len(_kept) > 2 and (
        len(_kept) > KEPT_FILES or sum(len(kept.times) for kept in _kept.values()) > KEPT_ROWS
    ):
        del _kept[next(iter(_kept))]
    return log


def read_table(path: Path, spec: Spec, *, export: bool = False) -> Table:
    """Read a log; or an `export`: of any suffix, with some of the sources, and columns that are not read.

    UndeclaredError where it is not as declared, DataError where nothing can be used, CutError where it ends
    too early.
    """
    name, limits = shown(path.name), DAY if is_day_file(path.name) and not export else MANY
    content, digest = read_bytes(path, name, limits[0])
    stem = stem_of(path.name)
    if content[:4] == b"PAR1" if export else path.name.lower().endswith(".parquet"):
        table = read_parquet(content, spec, name, limits, stem, watch=export)
    else:
        content = as_text(content, name) if export else content
        table = table_of(content, spec, name, limits, stem, export=export)
    table.name, table.digest = name, digest
    return table


def table_of(
    content: bytes, spec: Spec, name: str, limits: tuple[int, int], stem: str, *, export: bool
) -> Table:
    """Read a text: the part of :func:`read_table` that needs no file."""
    content = to_utf8(content, spec, name)
    refuse_rows(name, content.count(b"\n"), limits[1])
    header = names, body, _ = read_header(content, spec, name, some=export)
    content, footers = cut_footer(content, header, spec)
    # of an export, other columns and the texts of empty cells matter, too
    as_fast = not export or set(names) == {*spec.time, *spec.sources}
    fast = read_fast(content, header, spec) if as_fast else None
    if fast is None or (export and any(np.isnan(v).any() for v in fast.numbers.values())):
        table = read_lines(content, header, spec, name, stem, watch=export)
    else:
        table = Table([fast], rows=len(fast.times))
    if export and not spec.long and spec.input.unit_rows:
        above = LINE.split(content[:body].decode("utf-8", "replace").rstrip("\r\n"))
        rows = [split_cells(line, spec.input.separator) or [] for line in above[-spec.input.unit_rows :]]
        for source in set(spec.sources) & set(names):
            at = names.index(source)
            table.units[source] = next((row[at] for row in rows if at < len(row) and row[at]), "")
    table.name, table.footers = name, footers
    for columns in table.parts:
        columns.dropped["footer rows"] = [len(columns.times)] * footers
    return table


def make_log(table: Table, spec: Spec) -> Log:
    """Bring the columns to UTC, SI units and order; DataError without any row or zone of local days."""
    if not table.parts:
        raise DataError(f"{table.name}, {table.lacking}")
    (columns,) = table.parts
    zone = zone_of(columns, spec, table.name)
    events: dict[str, list[int]] = {}
    times, faults = in_utc(columns, zone, spec)  # faults are at a row
    refused = set(times[[fault.at for fault in faults]].tolist())
    values = {signal.name: _total(signal, columns, spec, events) for signal in spec.signals}
    faults += suspect(columns, times, spec, zone)
    faults += [bad._replace(at=max(bad.at - 1, 0)) for bad in columns.bad]
    events["flagged values dropped"] = [row for row, _ in columns.flagged]
    events |= {f"{kind} dropped": [max(n - 1, 0) for n in before] for kind, before in columns.dropped.items()}
    events["rows out of order sorted"] = np.flatnonzero(times < np.maximum.accumulate(times)).tolist()
    timed = {kind: np.sort(times[rows]) for kind, rows in events.items() if rows}
    dated = [fault._replace(at=int(times[fault.at])) for fault in faults]

    order = np.argsort(times, kind="stable")
    times, values = times[order], {name: column[order] for name, column in values.items()}
    again = np.flatnonzero(np.diff(times) == 0) + 1
    if len(again):
        timed["duplicates dropped"] = times[again]
    series = {}
    for signal in spec.signals:
        column, own = values[signal.name], times - signal.shift if signal.shift else times
        there = np.flatnonzero(np.isfinite(column))
        # values that agree, or are there only once, are joined
        twice, found = repeated(
            signal.name, times, column, there, zone, lambda row: columns.place(int(order[row]))
        )
        dated += [fault for fault in found if fault.at not in refused]
        there = np.delete(there, twice)
        series[signal.name] = (own, column) if len(there) == len(own) else (own[there], column[there])
    times = np.delete(times, again) if len(again) else times  # mostly shared with the series
    return Log(table.name, spec, zone, times, series, tuple(sorted(dated)), timed, table.digest)


def zone_of(columns: Columns, spec: Spec, name: str) -> dt.tzinfo:
    """The zone of the midnight that begins a day; UndeclaredError where neither log nor config states it."""
    if spec.input.time_zone:
        return ZoneInfo(spec.input.time_zone)
    if not columns.aware:
        why = "its times have no UTC offset: set the zone of the log's clock,"
    elif columns.zone is not None:
        try:
            return ZoneInfo(columns.zone)
        except (OSError, ValueError, KeyError):
            why = f"its time zone {columns.zone[:40]!r} is unknown: set"
    elif columns.offset is not None:
        return dt.timezone(dt.timedelta(seconds=columns.offset))
    else:
        why = "its times have several UTC offsets: set the zone of the days,"
    raise UndeclaredError(
        f'{name}: {why} for example [input] time_zone = "Europe/Paris" or "America/Los_Angeles" ("Etc/GMT+8" '
        "is 8 h behind UTC)"
    )


def in_utc(columns: Columns, zone: dt.tzinfo, spec: Spec) -> tuple[Ints, list[Fault]]:
    """Times in UTC [us], and the rows with a time that does not exist, or occurs twice and may not."""
    if columns.aware:
        return columns.times, []
    times, refused = to_utc(columns.times, zone, spec.input.ambiguous)
    return times, [Fault(row, f"{columns.place(row)}: {reason}") for row, reason in refused]


def _total(signal: Signal, columns: Columns, spec: Spec, events: dict[str, list[int]]) -> Floats:
    """A canonical column from those of the log: sentinels masked, summed, in SI units."""
    parts = []
    for source in signal.sources:
        values = columns.numbers[source]
        masked = np.isin(values, spec.input.sentinels)
        if masked.any():
            events.setdefault("sentinels masked", []).extend(np.flatnonzero(masked).tolist())
            values = np.where(masked, np.nan, values)
        parts.append(values)
    return reduce(np.add, parts) * signal.factor


def repeated(
    name: str, times: Ints, values: Floats, there: Ints, zone: dt.tzinfo, place: Callable[[int], str]
) -> tuple[Ints, list[Fault]]:
    """The rows of `there` that repeat the time of the row before, and a fault for each with another value."""
    again, faults = np.flatnonzero(np.diff(times[there]) == 0) + 1, []
    for old, new in zip(there[again - 1].tolist(), there[again].tolist(), strict=True):
        if values[old] != values[new]:
            moment = clock(int(times[new]), zone, with_date=True)
            text = f"{moment} is logged twice with different {name}: {values[old]:.6g} and {values[new]:.6g}"
            faults.append(Fault(int(times[new]), f"{place(new)}: {text} ({place(old)})", twice=True))
    return again, faults


def sentinels_in(values: Floats) -> list[float]:
    """Well-known sentinels, ascending, among values (n,) of a day, far from all others; NaN is no value."""
    known = np.isin(values, SENTINELS)
    if not known.any():
        return []
    others = values[~known & np.isfinite(values)]
    return [s for s in np.unique(values[known]).tolist() if _is_far(s, others)]


def _is_far(sentinel: float, others: Floats) -> bool:
    if not len(others):
        return sentinel in PLAIN
    low, high = float(others.min()), float(others.max())
    span = high - low + NEAR * max(abs(low), abs(high))
    off = max(low - sentinel, sentinel - high)
    if sentinel in ROUND:
        return low > 0 and off > FARTHER * span
    return off > span or (low >= 0 > sentinel)


def suspect(columns: Columns, times: Ints, spec: Spec, zone: dt.tzinfo) -> list[Fault]:
    """Faults at rows: values beyond any river, and each day's undeclared sentinels; times (n,) [us UTC]."""
    given, found, faults = spec.input, [], []
    for source in spec.sources:
        if source not in columns.numbers:
            continue  # it is in another file
        values = columns.numbers[source]
        low, high = np.fmin.reduce(values), np.fmax.reduce(values)
        signal = next(signal for signal in spec.signals if source in signal.sources)
        if max(high, -low) * signal.factor > LARGEST:
            unit, declared = "m" if signal.name == "h_L" else "m3/s", np.isin(values, given.sentinels)
            for row in np.flatnonzero((np.abs(values) * signal.factor > LARGEST) & ~declared).tolist():
                size = f"{source} = {values[row] * signal.factor:.3g} {unit}"
                text = (
                    f"{columns.place(row)}: {size} is beyond any river: check [input.units], or, if it means "
                )
                faults.append(
                    Fault(row, f'{text}"not measured", set [input] sentinels = [{values[row]:.10g}]')
                )
        if low > _LEAST and high < _MOST:
            continue  # no sentinel lies between
        there = ~np.isin(values, given.sentinels)
        suspects = there & np.isin(values, SENTINELS)
        hours = np.unique(times[suspects] // _HOUR) * _HOUR
        for date in sorted({local(int(hour), zone).date() for hour in hours}):
            start, end = day_bounds(date, zone)
            rows = np.flatnonzero(there & (times >= start) & (times < end))
            known = sentinels_in(values[rows])
            found += [(source, rows, sentinel) for sentinel in known if sentinel not in given.not_sentinels]
    declare = ", ".join(f"{s:.10g}" for s in dict.fromkeys([*given.sentinels, *(s for *_, s in found)]))
    for source, rows, sentinel in found:
        values = columns.numbers[source][rows]
        at = rows[values == sentinel]
        others = values[np.isfinite(values) & ~np.isin(values, SENTINELS)]
        count = f" {len(at)} times" if len(at) > 1 else ""
        apart = f", far from the day's {others.min():g} to {others.max():g}" if len(others) else ""
        text = (
            f"{columns.place(int(at[0]))}: column {source!r} holds {sentinel:.10g}{count}{apart}: if that "
            f'means "not measured", set [input] sentinels = [{declare}]; if it is measured, not_sentinels'
        )
        faults.append(Fault(int(at[0]), text))
    return faults
