"""What is done already: segments under OUT/.rivid, keyed by content; the lock; the files seen.

A segment is one Parquet file of a batch's rows (:data:`rivid.results.tables.SEGMENT`). Its rename is the
commit: a killed run leaves whole segments or none. A segment that fails its checksums is dropped, and its
days are computed again. Long columns of a row, its response and its criterion, are read from disk in chunks,
so that memory does not grow with the record; a few rows are kept whole.

A run holds `lock`. Shards of one run share OUT: each holds a lock of its own, taken while it holds `lock` for
a moment; a whole run takes `lock` and then finds no shard at work.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from rivid.atomic import replacing, write_text
from rivid.errors import LockedError, RividError
from rivid.results.tables import SEGMENT, whole_numbers, write_parquet

METHOD_VERSION = 1
"""Increased whenever the same input and settings give another row: older rows are then computed again."""

SHARD_PATIENCE = 20.0
"""Time a shard waits for others to begin [s]: each holds the lock for a moment."""

COMPACT_ABOVE = 12
"""Segments from which a finished run merges them into one: reading many small files is slow."""


def digest(*parts: Any) -> str:
    """SHA-256 of the parts as JSON: the same content has the same key."""
    text = json.dumps([METHOD_VERSION, *parts], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


CHUNK = 8192
"""Rows in memory at a time, and rows of a row group."""

SHORT = (
    "key", "date", "estimator", "status", "delay_samples", "delay_s", "t50_samples", "prior_only",
    "probability", "at_bound",
)  # fmt: skip
"""Columns in memory of all rows; of the messages, those of failed days."""


@dataclass(frozen=True)
class Rows:
    """Rows of segments.

    `table` has the columns :data:`SHORT`, `message` (of failed days), `spread` (whether the response has
    one), and `unit` and `row`: where the whole row is. `units` are files and their row groups. `kept` holds
    all columns of these rows, in their order, where they are few.
    """

    table: pa.Table
    units: tuple[tuple[Path, int], ...] = ()
    kept: pa.Table | None = None

    def __len__(self) -> int:
        return len(self.table)

    @property
    def spread(self) -> bool:
        """Whether a row has a spread of its response."""
        return bool(pc.any(self.table["spread"]).as_py())

    def and_new(self, segments: Path) -> tuple["Rows", list[tuple[Path, str]]]:
        """These rows and those of segments written since, and the damaged of these."""
        known = {path for path, _ in self.units}
        paths = [p for p in sorted(segments.glob("*.parquet")) if p.is_file() and p not in known]
        new, damaged = read_rows(segments, paths)
        n = pa.scalar(len(self.units), pa.int64())
        at = new.table.column_names.index("unit")
        table = pa.concat_tables([self.table, new.table.set_column(at, "unit", pc.add(new.table["unit"], n))])
        few = self.kept is not None and new.kept is not None and len(table) <= CHUNK
        kept = pa.concat_tables([self.kept, new.kept]) if few else None
        return Rows(table, self.units + new.units, kept), damaged

    def chosen(self, mask: pa.Array) -> "Rows":
        """The rows of a mask."""
        kept = None if self.kept is None else self.kept.filter(mask)
        return replace(self, table=self.table.filter(mask), kept=kept)

    def arranged(self, keys: Sequence[str], estimators: Sequence[str]) -> "Rows":
        """The rows of the given keys, in order of the keys and then of the estimators.

        A key that several segments hold (a killed compaction) counts once: equal keys mean equal rows.
        """
        of_key = _place(self.table["key"], keys)
        of_name = _place(self.table["estimator"], estimators)
        place = of_key * len(estimators) + of_name
        rows = np.flatnonzero((of_key >= 0) & (of_name >= 0))
        rows = rows[np.argsort(place[rows], kind="stable")]
        place = place[rows]
        last = np.append(place[1:] != place[:-1], True)[: len(place)]
        order = whole_numbers(rows[last])
        kept = None if self.kept is None else self.kept.take(order).combine_chunks()
        return replace(self, table=self.table.take(order).combine_chunks(), kept=kept)

    def chunks(self) -> Iterator[pa.Table]:
        """All columns of the rows in their order, :data:`CHUNK` at a time."""
        for start in range(0, max(len(self), 1), CHUNK):
            if self.kept is not None:
                yield self.kept.slice(start, CHUNK)
            else:
                yield self._read(self.table.slice(start, CHUNK))

    def _read(self, part: pa.Table) -> pa.Table:
        units, rows = part["unit"].to_numpy(), part["row"].to_numpy()
        order = np.lexsort((rows, units))
        files: dict[Path, pq.ParquetFile] = {}
        tables = [SEGMENT.empty_table()]
        for unit in np.unique(units).tolist():
            path, group = self.units[unit]
            if path not in files:
                files = {path: _open(path)}
            wanted = rows[order[units[order] == unit]]
            tables.append(_cast(files[path].read_row_group(group)).take(whole_numbers(wanted)))
        back = np.empty(len(order), np.int64)
        back[order] = np.arange(len(order))
        return pa.concat_tables(tables).take(whole_numbers(back)).combine_chunks()


def read_rows(segments: Path, paths: Sequence[Path] | None = None) -> tuple[Rows, list[tuple[Path, str]]]:
    """Read the rows of all sound segments; return them and the damaged segments with the reason.

    Every page is read once, so that its checksum is verified. Nothing is changed.
    """
    if paths is None:
        paths = sorted(p for p in segments.glob("*.parquet") if p.is_file())
    damaged: list[tuple[Path, str]] = []
    units: list[tuple[Path, int]] = []
    short = [_short(SEGMENT.empty_table(), 0)]
    kept: list[pa.Table] | None = [SEGMENT.empty_table()]
    count = 0
    for path in paths:
        try:
            file = _open(path)
            if file.schema_arrow.names != SEGMENT.names:
                raise ValueError("another version's columns")
            groups = []
            for group in range(file.num_row_groups):
                whole = _cast(file.read_row_group(group))
                groups.append(_short(whole, len(units) + group))
                count += len(whole)
                kept = None if kept is None or count > CHUNK else [*kept, whole]
        except (OSError, ValueError, pa.ArrowException) as error:
            damaged.append((path, str(error)))
            kept = None  # it may hold rows of the damaged one
            continue
        units += [(path, group) for group in range(len(groups))]
        short += groups
    held = None if kept is None else pa.concat_tables(kept)
    return Rows(pa.concat_tables(short), tuple(units), held), damaged


def write_segment(segments: Path, rows: pa.Table) -> Path:
    """Write one batch's rows; the name follows from its keys, so a repeated batch replaces itself."""
    name = hashlib.sha256("".join(rows["key"].to_pylist()).encode())
    path = segments / f"{name.hexdigest()[:24]}.parquet"
    write_parquet(rows, path)
    return path


def write_rows(segments: Path, rows: Rows) -> Path:
    """Write rows as one segment, chunk by chunk."""
    if len(rows) <= CHUNK:
        return write_segment(segments, next(rows.chunks()))
    path = segments / f"{hash_of(rows)[:24]}.parquet"
    with replacing(path) as scratch:
        with pq.ParquetWriter(scratch, SEGMENT, compression="zstd", write_page_checksum=True) as writer:
            for chunk in rows.chunks():
                writer.write_table(chunk)
    return path


def hash_of(rows: Rows) -> str:
    """SHA-256 of the keys in their order."""
    total = hashlib.sha256()
    for start in range(0, len(rows), CHUNK):
        total.update("".join(rows.table["key"].slice(start, CHUNK).to_pylist()).encode())
    return total.hexdigest()


def _open(path: Path) -> pq.ParquetFile:
    return pq.ParquetFile(path, page_checksum_verification=True)


def _cast(table: pa.Table) -> pa.Table:
    return table if table.schema.equals(SEGMENT) else table.cast(SEGMENT)


def _place(column: pa.ChunkedArray, values: Sequence[str]) -> NDArray[np.int64]:
    """Index of each element among the values; -1 where it is missing."""
    found = pc.index_in(column, value_set=pa.array(list(values), pa.string()))
    return np.asarray(pc.fill_null(found, -1).to_numpy(), np.int64)


def _short(whole: pa.Table, unit: int) -> pa.Table:
    """The columns of a row group that stay in memory."""
    n = len(whole)
    failed = pc.equal(whole["status"], "failed")
    table = whole.select(list(SHORT))
    message = pc.if_else(failed, whole["message"], pa.scalar(None, pa.string()))
    table = table.append_column("message", message)
    table = table.append_column("spread", whole["fir_sd"].is_valid())
    table = table.append_column("unit", whole_numbers(np.full(n, unit, np.int64)))
    return table.append_column("row", whole_numbers(np.arange(n, dtype=np.int64)))


class Store:
    """Holds OUT for one run, or for the shard of that name: ``with Store(out) as store``.

    Raises
    ------
    LockedError
        At once, when another run holds OUT. A killed run's lock does not block: the system frees it.
    RividError
        When OUT cannot be written.
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
            self._hold()
        except Timeout:
            raise LockedError(
                f"another run is writing to {self.out}: wait for it, or give another --out"
            ) from None
        except OSError as error:
            raise RividError(f"cannot write to {self.out}: {error.strerror}: choose another --out") from None
        for folder in () if self.shard else (self.segments, self.root, self.out, self.out / "figures"):
            for leftover in folder.glob(".*.part"):  # of a killed run
                leftover.unlink(missing_ok=True)
        return self

    def _hold(self) -> None:
        """Take the lock; of a shard its own, while no whole run is at work."""
        self._lock.acquire(timeout=SHARD_PATIENCE if self.shard else 0)
        try:
            if self.shard:
                self._shard_lock.acquire(timeout=0)
                self._lock.release()
                return
            for path in self.root.glob("lock.*"):
                with FileLock(path).acquire(timeout=0):
                    path.unlink()  # no shard can take it up: it would need `lock`
        except BaseException:
            self._lock.release()
            raise

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()
        self._shard_lock.release()

    def known_files(self, data_dir: Path) -> dict[str, Any]:
        """Facts on the files of DATA_DIR from the last finished run; empty where there are none."""
        try:
            known = json.loads((self.root / "files.json").read_text(encoding="utf-8"))
            files = known["files"] if known["data_dir"] == str(data_dir.resolve()) else {}
        except (OSError, ValueError, KeyError, TypeError):
            return {}
        return files if isinstance(files, dict) else {}

    def remember_files(self, data_dir: Path, files: dict[str, Any]) -> None:
        """Store facts on the files of DATA_DIR."""
        known = {"data_dir": str(data_dir.resolve()), "files": files}
        write_text(self.root / "files.json", json.dumps(known, sort_keys=True))

    def read(self, before: Rows | None = None) -> Rows:
        """Read all segments, or those written since `before` was read; drop and list damaged ones."""
        rows, damaged = read_rows(self.segments) if before is None else before.and_new(self.segments)
        for path, reason in damaged:
            self.damaged.append(f"{path.name}: {reason}")
            path.unlink(missing_ok=True)
        return rows

    def forget(self, keys: Iterable[str]) -> None:
        """Drop the rows of some keys, so that they are computed again."""
        self.read()  # and with it what is damaged
        gone = pa.array(keys if isinstance(keys, list) else list(keys), pa.string())
        for path in sorted(self.segments.glob("*.parquet")):
            rows, _ = read_rows(self.segments, [path])
            left = pc.invert(pc.is_in(rows.table["key"], value_set=gone))
            if pc.all(left, min_count=0).as_py():
                continue
            kept = write_rows(self.segments, rows.chosen(left)) if pc.any(left).as_py() else None
            if path != kept:
                path.unlink(missing_ok=True)

    def compact(self, rows: Rows) -> None:
        """Replace many segments by one that holds `rows`; stale rows go with them."""
        paths = sorted(self.segments.glob("*.parquet"))
        if len(paths) <= COMPACT_ABOVE:
            return
        kept = write_rows(self.segments, rows)
        for path in paths:
            if path != kept:
                path.unlink(missing_ok=True)
