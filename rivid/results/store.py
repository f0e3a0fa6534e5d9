"""The files of a run in OUT: its tables, run.json, and the rows of data sets that are done.

A *segment*, under OUT/.rivid, is a Parquet file of a batch's rows (:data:`SEGMENT`), a row per day and
estimator with its FIR and criterion as lists. Its rename is the commit: a killed run leaves whole segments or
none. A segment that fails its checksums is dropped, and its days are computed again. The tables of OUT are
made from segments, a chunk of rows at a time, so that memory does not grow with the record.

A run holds `lock`. Shards of one run share OUT: each holds a lock of its own, taken while it holds `lock` for
a moment; a whole run takes `lock` and then finds no shard at work.
"""

import datetime as dt
import hashlib
import json
import math
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from rivid import __version__
from rivid.atomic import replacing, write_text
from rivid.config import Config
from rivid.errors import LockedError, RividError
from rivid.results.read import RECORD, SCHEMA_VERSION, Results, read_json, results_of
from rivid.types import Bools, Floats

KINDS = {  # types of columns, in `described`; a clock is local time without zone
    "date": pa.date32(), "moment": pa.timestamp("ms", "UTC"), "clock": pa.timestamp("ms"),
    "text": pa.string(), "number": pa.float64(), "whole": pa.int64(), "flag": pa.bool_(),
}  # fmt: skip


def described(columns: str) -> tuple[pa.Schema, dict[str, tuple[str, str]]]:
    """The schema of columns, a line ``name | kind | unit | meaning`` each, and their units and meanings."""
    rows = [[cell.strip() for cell in line.split("|")] for line in columns.strip().splitlines()]
    schema = pa.schema([(name, KINDS[kind]) for name, kind, _, _ in rows])
    return schema, {name: (unit, meaning) for name, _, unit, meaning in rows}


DELAYS, MEANINGS = described("""
date | date | | the day; of a data set of several days, the last
reach | text | | name of the reach
estimator | text | | its name
status | text | | `ok`, `unidentifiable`, `degenerate`, `pending` (today, unfinished) or `failed`
delay_samples | number | samples | d: the level first moves at lag d + 1; a river's `posterior`: rounded t50
delay_s | number | s | d T_s; of `posterior` the travel time with its fraction, of a river t50
travel_time_s | number | s | of `posterior` as delay_s, else the middle, (d + 1/2) T_s
half_response_s | number | s | `posterior`: travel time with half time of the gauge's lag; t50 of a river
at_bound | flag | | the delay is the shortest or longest tried, or lies outside
prior_only | flag | | the data do not single this delay out; empty where the estimator cannot decide that
probability | number | | `posterior`: that the likeliest delay is right, to within a tenth of a sample
delay_low | number | samples | `posterior`: shortest of the fewest delays that hold 90 %, without that tenth
delay_high | number | samples | `posterior`: longest of them
t50_samples | number | samples | rivers: lag by which half of a step has arrived; `posterior`: at mean inflow
alpha | number | (m3/s)^2 | regularisation weight, noise over roughness variance
noise_sd | number | output unit | sigma_w, standard deviation of the noise
roughness_sd | number | output unit per m3/s | sigma_hD, of the response's second differences
output_unit | text | | `m` for a level, `m3/s` for a discharge
criterion | number | | the least criterion: that of the delay
iterations | whole | | rounds of Table VI; 0 where there are none
condition | number | | condition number of U'U; the paper's days have 2e4 to 1e5
n_samples | whole | samples | of the data set
n_filled | whole | samples | of these, that bridge a gap
mean_inflow_m3s | number | m3/s | mean inflow
mean_level_m | number | m | mean level; empty for a river
froude | number | | Froude number (6) at the mean outflow, or the mean inflow where none is logged
bound_gravity_s | number | s | travel time of a gravity wave (5): the fastest
bound_kinematic_s | number | s | travel time of a kinematic wave (5): the slowest
message | text | | why there is no answer, and remarks on the day
""")
"""A row per day and estimator: delays.csv and delays.parquet; units and meanings, in Markdown."""

MEANINGS |= {
    "lag": ("samples", "fir.parquet: from 0"),
    "value": ("output unit per m3/s", "fir.parquet: the impulse response at this lag"),
    "sd": ("output unit per m3/s", "fir.parquet: its standard deviation, where an estimator gives one"),
}

FLOATS = pa.list_(pa.float64())
SEGMENT = pa.schema([
    ("key", pa.string()), *DELAYS, ("fir", FLOATS), ("fir_sd", FLOATS), ("first_candidate", pa.int64()),
    ("curve", FLOATS), ("start", pa.string()),
])  # fmt: skip
"""Rows that workers write: key, row of delays.csv, FIR, the criterion of every candidate delay (of CUSUM its
g, of posteriors the probability), and the begin of a data set shorter than a day."""
TABLES = ("delays.csv", "delays.parquet", "fir.parquet", "criterion.parquet", "posterior.parquet")
"""Files of :func:`write_tables`."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # first characters of a cell that a spreadsheet evaluates


def to_table(columns: Mapping[str, Any], schema: pa.Schema) -> pa.Table:
    """A table of the schema; a column that is not given, or None, is empty, NaN becomes an empty cell."""
    n = len(next(iter(columns.values()), []))
    arrays = []
    for field in schema:
        values = columns.get(field.name)
        if values is None:
            arrays.append(pa.nulls(n, field.type))
        elif isinstance(values, pa.Array | pa.ChunkedArray):
            arrays.append(values)
        else:
            arrays.append(pa.array(values, field.type, from_pandas=pa.types.is_floating(field.type)))
    return pa.Table.from_arrays(arrays, schema=schema)


def lists(values: Floats | None, given: Bools) -> pa.Array | None:
    """A column with, as cells, the rows of `values`, shape (n, width); empty where not `given`, (n,)."""
    if values is None:
        return None
    offsets = np.append(0, np.cumsum(given * values.shape[1])).astype(np.int32)
    return pa.ListArray.from_arrays(offsets, values[given].ravel(), mask=pa.array(~given))


def finite(row: dict[str, Any]) -> dict[str, Any]:
    """A row for JSON, which has no NaN and no infinity: null in their place."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}


def write_parquet(table: pa.Table, path: Path) -> None:
    """Write Parquet atomically."""
    with replacing(path) as scratch, _writer(scratch, table.schema) as writer:
        writer.write_table(table)


def _writer(path: Path, schema: pa.Schema) -> pq.ParquetWriter:
    """A writer with checksums of pages, by which a flipped bit is found on reading.

    Measured numbers hardly repeat: as dictionaries they take twice the time and a tenth more space.
    """
    repeat = [f.name for f in schema if not (pa.types.is_floating(f.type) or pa.types.is_list(f.type))]
    return pq.ParquetWriter(path, schema, compression="zstd", write_page_checksum=True, use_dictionary=repeat)


def write_csv(table: pa.Table, path: Path) -> None:
    """Write CSV atomically."""
    with replacing(path) as scratch:
        pyarrow.csv.write_csv(table, scratch, pyarrow.csv.WriteOptions(quoting_style="needed"))


def write_both(table: pa.Table, stem: Path) -> None:
    """Write a table as Parquet and CSV, each atomically; `stem` is the path without its ending."""
    write_parquet(table, stem.with_suffix(".parquet"))
    write_csv(table, stem.with_suffix(".csv"))


def safe_for_spreadsheets(table: pa.Table, columns: Sequence[str] = ("message",)) -> pa.Table:
    """Prefix text that a spreadsheet would evaluate as a formula with an apostrophe."""
    for name in columns:
        index = table.column_names.index(name)
        cells = table.column(index).to_pylist()
        safe = ["'" + text if text and text.startswith(FORMULA) else text for text in cells]
        table = table.set_column(index, name, pa.array(safe, pa.string()))
    return table


def write_tables(chunks: Iterable[pa.Table], out: Path, spread: bool, starts: bool = False) -> None:
    """Write the :data:`TABLES`, each atomically, from rows of schema :data:`SEGMENT` in their order.

    With `spread`, fir.parquet has a column `sd`, the standard deviation of the response; with `starts`, every
    table has a column `start`.
    """
    start = ["start"] if starts else []
    kept = pa.schema([SEGMENT.field(name) for name in [*DELAYS.names, *start]])
    with ExitStack() as files:
        scratch = files.enter_context(replacing(out / "delays.csv"))
        options = pyarrow.csv.WriteOptions(quoting_style="needed")
        text = files.enter_context(pyarrow.csv.CSVWriter(scratch, kept, write_options=options))
        writers: dict[str, pq.ParquetWriter] = {}
        for chunk in chunks:
            short, sure = chunk.select(kept.names), chunk.filter(chunk["probability"].is_valid())
            fir = _long(chunk, "fir", None, "lag", "value", start)
            tables = {
                "delays": short,
                "fir": _with_sd(fir, chunk) if spread else fir,
                "criterion": _long(chunk, "curve", "first_candidate", "delay_samples", "criterion", start),
                "posterior": _long(sure, "curve", "first_candidate", "delay_samples", "probability", start),
            }
            text.write_table(safe_for_spreadsheets(short))
            for name, table in tables.items():
                if new := name not in writers:
                    scratch = files.enter_context(replacing(out / f"{name}.parquet"))
                    writers[name] = files.enter_context(_writer(scratch, table.schema))
                if new or len(table):
                    writers[name].write_table(table)


def _long(
    rows: pa.Table, column: str, first: str | None, axis: str, value: str, more: Sequence[str]
) -> pa.Table:
    """A row per element of a list column: date, reach, estimator and `more`, axis from `first` on, value."""
    lists = rows[column].combine_chunks()
    lengths = pc.fill_null(pc.list_value_length(lists), 0).to_numpy(zero_copy_only=False)
    of_row = np.repeat(np.arange(len(rows)), lengths)
    labels = np.arange(len(of_row)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    if first is not None:
        labels += pc.fill_null(rows[first], 0).to_numpy()[of_row]
    keys = rows.select(["date", "reach", "estimator", *more]).take(whole_numbers(of_row))
    return keys.append_column(axis, whole_numbers(labels)).append_column(value, pc.list_flatten(lists))


def _with_sd(responses: pa.Table, rows: pa.Table) -> pa.Table:
    """The long table of responses, with their standard deviations; empty where a row has none."""
    lengths = pc.fill_null(pc.list_value_length(rows["fir"]), 0).to_numpy()
    has = np.repeat(rows["fir_sd"].is_valid().to_numpy(), lengths)
    sd = np.zeros(len(has))
    sd[has] = pc.list_flatten(rows["fir_sd"]).to_numpy()
    return responses.append_column("sd", pa.array(sd, mask=~has))


def whole_numbers(values: NDArray[np.int64]) -> pa.Array:
    """An Arrow array of integers; ``pa.array`` of a numpy array would import numpy.ma to check for a mask."""
    values = np.ascontiguousarray(values, np.int64)
    return pa.Array.from_buffers(pa.int64(), len(values), [None, pa.py_buffer(values)])


UNFINISHED: dict[str, Any] = {"content": None, "outputs": {}}
"""Of a record while files of OUT are replaced: no run takes it for finished."""


def describe(config: Config, data_dir: Path, started: dt.datetime) -> dict[str, Any]:
    """The part of the record that is known before the run; order and delays are those of [jmap]."""
    settings = config.jmap_settings()
    versions = {"rivid": __version__, "python": platform.python_version()}
    versions |= {"numpy": np.__version__, "pyarrow": pa.__version__}
    versions |= {name: version(name) for name in ("scipy", "matplotlib")}  # not loaded, perhaps
    return {
        "schema_version": SCHEMA_VERSION,
        "reach": config.reach.name,
        "sample_time": config.reach.sample_time,
        "output_unit": config.reach.output_unit,
        "estimators": list(config.run.estimators),
        "order": settings.order,
        "d_min": settings.d_min,
        "d_max": settings.d_max,
        "delay_scale": settings.delay_scale,
        "assumed": assumed(config),
        "data_dir": str(data_dir),
        "started": started.isoformat(timespec="seconds"),
        "versions": versions,
        "config": config.as_used(),
    }


def assumed(config: Config) -> list[str]:
    """Keys of the geometry that are not configured: their defaults are those of another reach (Table I)."""
    reach = config.reach
    given = reach.model_fields_set | ({"depth"} if reach.bed_level is not None else set())
    return [key for key in ("length", "width", "depth") if key not in given]


def write_record(out: Path, record: dict[str, Any]) -> None:
    write_text(out / RECORD, json.dumps(record, indent=2, sort_keys=True) + "\n")


def hashes(out: Path, files: Iterable[Path]) -> dict[str, str]:
    """SHA-256 of files of OUT, by their path in it."""
    found = {}
    for path in sorted(files):
        with open(path, "rb") as file:
            found[str(path.relative_to(out))] = hashlib.file_digest(file, "sha256").hexdigest()
    return found


def is_whole(out: Path, record: dict[str, Any], figures: bool) -> bool:
    """Whether all files of the recorded run, with `figures` also a report, have the recorded hashes."""
    outputs = record.get("outputs") or {}
    if not outputs or (figures and "report.html" not in outputs):
        return False
    try:
        return hashes(out, [out / name for name in outputs]) == outputs
    except OSError:
        return False


METHOD_VERSION = 8  # raised when the same input and settings give another row: old rows are computed again

SHARD_PATIENCE = 20.0  # time a shard waits for others to begin [s]: each holds the lock for a moment

COMPACT_ABOVE = 12  # segments from which a finished run merges them: reading many small files is slow


def digest(*parts: Any) -> str:
    """SHA-256 of the parts as JSON: the same content has the same key."""
    text = json.dumps([METHOD_VERSION, *parts], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


CHUNK = 8192  # rows in memory at a time, and rows of a row group

SHORT = (  # columns in memory of all rows
    "key", "date", "estimator", "status", "delay_samples", "delay_s", "t50_samples", "prior_only",
    "probability", "at_bound", "mean_inflow_m3s", "bound_gravity_s", "bound_kinematic_s",
)  # fmt: skip


@dataclass(frozen=True)
class Rows:
    """Rows of segments."""

    # columns SHORT, `message` of failed days and of those with a delay beyond all candidates, `spread`
    # (whether the response has one), and `unit` and `row`, where the whole row is
    table: pa.Table
    units: tuple[tuple[Path, int], ...] = ()  # files and their row groups

    def __len__(self) -> int:
        return len(self.table)

    @property
    def spread(self) -> bool:
        """Whether a row has a spread of its response."""
        return bool(pc.any(self.table["spread"]).as_py())

    def arranged(self, keys: Sequence[str], estimators: Sequence[str]) -> "Rows":
        """The rows of :func:`arranged`."""
        return replace(self, table=arranged(self.table, keys, estimators))

    def chunks(self) -> Iterator[pa.Table]:
        """All columns of the rows in their order, :data:`CHUNK` at a time."""
        for start in range(0, max(len(self), 1), CHUNK):
            yield self._read(self.table.slice(start, CHUNK))

    def _read(self, part: pa.Table) -> pa.Table:
        """All columns of some rows of the table."""
        units, rows = part["unit"].to_numpy(), part["row"].to_numpy()
        tables = [SEGMENT.empty_table()]
        for unit in np.unique(units).tolist():
            path, group = self.units[unit]
            whole = _open(path).read_row_group(group).cast(SEGMENT)
            tables.append(whole.take(whole_numbers(rows[units == unit])))
        back = np.argsort(np.argsort(units, kind="stable"))
        return pa.concat_tables(tables).take(whole_numbers(back)).combine_chunks()


def arranged(table: pa.Table, keys: Sequence[str], estimators: Sequence[str]) -> pa.Table:
    """The rows of the given keys, in order of the keys and then of the estimators.

    A key that several segments hold (a killed compaction) counts once: equal keys mean equal rows.
    """
    of_key = _place(table["key"], keys)
    of_name = _place(table["estimator"], estimators)
    place = of_key * len(estimators) + of_name
    rows = np.flatnonzero((of_key >= 0) & (of_name >= 0))
    rows = rows[np.unique(place[rows], return_index=True)[1]]
    return table.take(whole_numbers(rows)).combine_chunks()


def brief_results(rows: pa.Table, config: Config) -> Results:
    """Return the results of the rows that a run keeps in memory (columns :data:`SHORT`).

    Responses, curves and other columns are NaN or empty.
    """
    delays = to_table({name: rows[name] for name in rows.column_names}, DELAYS)
    columns = {"date": pa.date32(), "estimator": pa.string()}
    columns |= dict.fromkeys(("lag", "value", "delay_samples", "criterion"), pa.float64())
    nothing = pa.schema(list(columns.items())).empty_table()
    run = {
        "reach": config.reach.name,
        "sample_time": config.reach.sample_time,
        "output_unit": config.reach.output_unit,
        "delay_scale": np.nan,
        "estimators": config.run.estimators,
        "assumed": assumed(config),
    }
    return results_of(run, delays, nothing, nothing)


def read_rows(segments: Path, before: Rows | None = None) -> tuple[Rows, list[tuple[Path, str]]]:
    """Read the rows of all sound segments; return them and the damaged segments with the reason.

    Segments with the columns of another version are listed without a reason: their keys contain another
    :data:`METHOD_VERSION`. Of rows that were read `before`, only segments written since are read. Every page
    is read once, so that its checksum is verified.
    """
    if before is None:
        before = Rows(_short(SEGMENT.empty_table(), 0))
    damaged: list[tuple[Path, str]] = []
    units, short = list(before.units), [before.table]
    known = {path for path, _ in units}
    for path in sorted(p for p in segments.glob("*.parquet") if p.is_file() and p not in known):
        try:
            file = _open(path)
            if file.schema_arrow.names != SEGMENT.names:
                damaged.append((path, ""))
                continue
            groups = [
                _short(file.read_row_group(group).cast(SEGMENT), len(units) + group)
                for group in range(file.num_row_groups)
            ]
        except (OSError, ValueError, pa.ArrowException) as error:
            damaged.append((path, str(error)))
            continue
        units += [(path, group) for group in range(len(groups))]
        short += groups
    return Rows(pa.concat_tables(short), tuple(units)), damaged


def write_segment(segments: Path, rows: pa.Table | Rows) -> Path:
    """Write rows as one segment; the name follows from their keys, so a repeated batch replaces itself."""
    keys, chunks = (rows.table, rows.chunks()) if isinstance(rows, Rows) else (rows, [rows])
    path = segments / f"{hash_of(keys)[:24]}.parquet"
    with replacing(path) as scratch, _writer(scratch, SEGMENT) as writer:
        for chunk in chunks:
            writer.write_table(chunk)
    return path


def hash_of(rows: pa.Table) -> str:
    """SHA-256 of the keys in their order."""
    return hashlib.sha256("".join(rows["key"].to_pylist()).encode()).hexdigest()


def _open(path: Path) -> pq.ParquetFile:
    return pq.ParquetFile(path, page_checksum_verification=True)


def _place(column: pa.ChunkedArray, values: Sequence[str]) -> NDArray[np.int64]:
    """Index of each element among the values; -1 where it is missing."""
    found = pc.index_in(column, value_set=pa.array(list(values), pa.string()))
    return np.asarray(pc.fill_null(found, -1).to_numpy(), np.int64)


def _short(whole: pa.Table, unit: int) -> pa.Table:
    """The columns of a row group that stay in memory."""
    n, beyond = len(whole), pc.and_(whole["at_bound"], pc.is_null(whole["delay_samples"]))
    kept = pc.or_(pc.equal(whole["status"], "failed"), pc.fill_null(beyond, False))
    return pa.table({name: whole[name] for name in SHORT} | {
        "message": pc.if_else(kept, whole["message"], pa.scalar(None, pa.string())),
        "spread": whole["fir_sd"].is_valid(),
        "unit": whole_numbers(np.full(n, unit)),
        "row": whole_numbers(np.arange(n)),
    })  # fmt: skip


class Store:
    """Holds OUT for one run, or for the shard of that name: ``with Store(out) as store``.

    LockedError when another run holds OUT; a killed run's lock does not block: the system frees it.
    """

    def __init__(self, out: Path, shard: str = "") -> None:
        self.out = out
        self.shard = shard
        self.root = out / ".rivid"
        self.segments = self.root / "segments"
        self._lock = FileLock(self.root / "lock")
        self._shard_lock = FileLock(self.root / f"lock.{shard}")
        self.damaged: list[str] = []

    def __enter__(self) -> "Store":
        try:
            self.segments.mkdir(parents=True, exist_ok=True)
            self._lock.acquire(timeout=SHARD_PATIENCE if self.shard else 0)
            if self.shard:  # it holds its own lock, taken while no whole run is at work
                self._shard_lock.acquire(timeout=0)
                self._lock.release()
            else:
                for path in self.root.glob("lock.*"):
                    with FileLock(path).acquire(timeout=0):
                        path.unlink()  # no shard can take it up: it would need `lock`
            self._sweep()
        except BaseException as error:
            self._lock.release()
            if isinstance(error, Timeout):
                reason = f"another run is writing to {self.out}: wait for it, or give another --out"
                raise LockedError(reason) from None
            if isinstance(error, OSError):
                reason = f"cannot write to {self.out}: {error.strerror}: choose another --out"
                raise RividError(reason) from None
            raise
        return self

    def _sweep(self) -> None:
        """Remove partial files of a killed run or worker; a shard leaves them, as others may be writing."""
        for folder in () if self.shard else (self.segments, self.root, self.out, self.out / "figures"):
            for leftover in folder.glob(".*.part"):
                with suppress(OSError):  # it does no harm; the next run removes it
                    leftover.unlink(missing_ok=True)

    def __exit__(self, *_: object) -> None:
        self._sweep()  # workers terminated after the failure of another leave what they were writing
        self._lock.release()
        self._shard_lock.release()

    def known_files(self, data_dir: Path) -> Any:
        """Facts on the files of DATA_DIR from the last finished run, unchecked; None where there are none."""
        known = read_json(self.root / "files.json")
        return known.get("files") if known.get("data_dir") == str(data_dir.resolve()) else None

    def remember_files(self, data_dir: Path, files: dict[str, Any]) -> None:
        """Store facts on the files of DATA_DIR."""
        known = {"data_dir": str(data_dir.resolve()), "files": files}
        write_text(self.root / "files.json", json.dumps(known, sort_keys=True))

    def read(self, before: Rows | None = None) -> Rows:
        """Read all segments, or those written since `before` was read; drop and list damaged ones."""
        rows, damaged = read_rows(self.segments, before)
        for path, reason in damaged:
            if reason:
                self.damaged.append(f"{path.name}: {reason}")
            path.unlink(missing_ok=True)
        return rows

    def forget(self, keys: Iterable[str]) -> None:
        """Drop the rows of some keys, so that they are computed again."""
        rows = self.read()
        table, unit = rows.table, rows.table["unit"]
        gone = pc.is_in(table["key"], value_set=pa.array(list(keys), pa.string()))
        for path in sorted({rows.units[one][0] for one in pc.unique(unit.filter(gone)).to_pylist()}):
            of_path = [one for one, (file, _) in enumerate(rows.units) if file == path]
            left = pc.and_not(pc.is_in(unit, value_set=pa.array(of_path, pa.int64())), gone)
            own = replace(rows, table=table.filter(left))
            kept = write_segment(self.segments, own) if len(own) else None
            if path != kept:
                path.unlink(missing_ok=True)

    def compact(self, rows: Rows) -> None:
        """Replace many segments by one that holds `rows`; stale rows go with them."""
        paths = sorted(self.segments.glob("*.parquet"))
        if len(paths) <= COMPACT_ABOVE:
            return
        kept = write_segment(self.segments, rows)
        for path in paths:
            if path != kept:
                path.unlink(missing_ok=True)
