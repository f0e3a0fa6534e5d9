"""What is done already: segments under OUT/.rivid, keyed by content; the lock; what files were seen.

A segment is one Parquet file of a batch's rows (:data:`rivid.tables.SEGMENT`). Its rename is the commit:
a killed run leaves whole segments or none. A segment that its checksums do not confirm is dropped, and its
days are computed again.
"""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from filelock import FileLock, Timeout

from rivid.atomic import write_text
from rivid.errors import LockedError, RividError
from rivid.tables import SEGMENT, write_parquet

METHOD_VERSION = 1
"""Raised whenever the same input and settings would give another row: older rows are then computed again."""

COMPACT_ABOVE = 12
"""Segments are merged into one when a run ends with more than this many."""


def digest(*parts: Any) -> str:
    """SHA-256 of a JSON of the parts: the same content, the same key."""
    text = json.dumps([METHOD_VERSION, *parts], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


class Store:
    """Holds OUT for one run: ``with Store(out) as store``.

    Raises
    ------
    LockedError
        At once, when another run holds OUT. A killed run's lock does not block: the system frees it.
    RividError
        When OUT cannot be written.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self.root = out / ".rivid"
        self.segments = self.root / "segments"
        self._lock = FileLock(self.root / "lock")
        self.damaged: list[str] = []

    def __enter__(self) -> "Store":
        try:
            self.segments.mkdir(parents=True, exist_ok=True)
            self._lock.acquire(timeout=0)
        except Timeout:
            raise LockedError(
                f"another run is writing to {self.out}: wait for it, or give another --out"
            ) from None
        except OSError as error:
            raise RividError(f"cannot write to {self.out}: {error.strerror}: choose another --out") from None
        for folder in (self.segments, self.root, self.out, self.out / "figures"):
            for leftover in folder.glob(".*.part"):  # of a killed run
                leftover.unlink(missing_ok=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def known_files(self, data_dir: Path) -> dict[str, Any]:
        """What the last finished run saw of the files of DATA_DIR; empty where that is not known."""
        try:
            known = json.loads((self.root / "files.json").read_text(encoding="utf-8"))
            files = known["files"] if known["data_dir"] == str(data_dir.resolve()) else {}
        except (OSError, ValueError, KeyError, TypeError):
            return {}
        return files if isinstance(files, dict) else {}

    def remember_files(self, data_dir: Path, files: dict[str, Any]) -> None:
        """Keep what was seen of the files of DATA_DIR."""
        known = {"data_dir": str(data_dir.resolve()), "files": files}
        write_text(self.root / "files.json", json.dumps(known, sort_keys=True))

    def read(self) -> pa.Table:
        """All rows of all sound segments; damaged segments are dropped and named."""
        rows, damaged = read_segments(self.segments)
        for path, reason in damaged:
            self.damaged.append(f"{path.name}: {reason}")
            path.unlink(missing_ok=True)
        return rows

    def forget(self, keys: set[str]) -> None:
        """Drop the rows of some keys: they are to be computed again."""
        rows = self.read()
        left = rows.filter(pa.array([key not in keys for key in rows["key"].to_pylist()], pa.bool_()))
        paths = list(self.segments.glob("*.parquet"))
        kept = write_segment(self.segments, left) if len(left) else None
        for path in paths:
            if path != kept:
                path.unlink(missing_ok=True)

    def compact(self, rows: pa.Table) -> None:
        """Replace many segments by one that holds `rows`; stale rows go with them."""
        paths = sorted(self.segments.glob("*.parquet"))
        if len(paths) <= COMPACT_ABOVE:
            return
        kept = write_segment(self.segments, rows)
        for path in paths:
            if path != kept:
                path.unlink(missing_ok=True)


def read_segments(segments: Path) -> tuple[pa.Table, list[tuple[Path, str]]]:
    """The rows of all sound segments, and the damaged ones with what is wrong; changes nothing."""
    tables, damaged = [SEGMENT.empty_table()], []
    for path in sorted(p for p in segments.glob("*.parquet") if p.is_file()):
        try:
            table = pq.read_table(path, page_checksum_verification=True)
            if table.schema.names != SEGMENT.names:
                raise ValueError("another version's columns")
            tables.append(table.cast(SEGMENT))
        except (OSError, ValueError, pa.ArrowException) as error:
            damaged.append((path, str(error)))
    return pa.concat_tables(tables), damaged


def write_segment(segments: Path, rows: pa.Table) -> Path:
    """Write one batch's rows; the name follows from its keys, so a repeated batch replaces itself."""
    name = hashlib.sha256("".join(rows["key"].to_pylist()).encode()).hexdigest()[:24]
    path = segments / f"{name}.parquet"
    write_parquet(rows, path)
    return path


def arrange(rows: pa.Table, keys: Sequence[str], estimators: Sequence[str]) -> pa.Table:
    """The rows of the given keys, in order of the keys and then of the estimators.

    A key that several segments hold (a killed compaction) counts once: equal keys mean equal rows.
    """
    of_key = {key: i for i, key in enumerate(keys)}
    of_name = {name: i for i, name in enumerate(estimators)}
    place: dict[tuple[int, int], int] = {}
    for row, (key, name) in enumerate(
        zip(rows["key"].to_pylist(), rows["estimator"].to_pylist(), strict=True)
    ):
        if key in of_key and name in of_name:
            place[of_key[key], of_name[name]] = row
    return rows.take(pa.array([place[at] for at in sorted(place)], pa.int64())).combine_chunks()
