"""What is done already: segments under OUT/.rivid, keyed by content; the lock; what files were seen.

A segment is one Parquet file of a batch's rows (`SEGMENT`). Its rename is the commit:
a killed run leaves whole segments or none. A segment that its checksums do not confirm is dropped, and its
days are computed again.

Who runs holds `lock`. Shards of one run share OUT: each holds a lock of its own, taken while it holds `lock`
for a moment; a whole run takes `lock` and then finds no shard at work.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
from filelock import FileLock, Timeout

from rivid.atomic import write_text
from rivid.errors import LockedError, RividError
from rivid.results.rows import Rows, read_rows, write_rows

METHOD_VERSION = 1
"""Raised whenever the same input and settings would give another row: older rows are then computed again."""

SHARD_PATIENCE = 20.0
"""How long a shard waits for others to begin [s]: each holds the lock for a moment."""

COMPACT_ABOVE = 12
"""Segments are merged into one when a run ends with more than this many."""


def digest(*parts: Any) -> str:
    """SHA-256 of a JSON of the parts: the same content, the same key."""
    text = json.dumps([METHOD_VERSION, *parts], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


class Store:
    """Holds OUT for one run: ``with Store(out) as store``.

    Parameters
    ----------
    out : Path
    shard : str
        Name of the shard that this run is; empty for a whole run.

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

    def read(self, before: Rows | None = None) -> Rows:
        """What all sound segments hold; damaged segments are dropped and named.

        Where `before` is what was read before, only segments written since are.
        """
        rows, damaged = read_rows(self.segments) if before is None else before.and_new(self.segments)
        for path, reason in damaged:
            self.damaged.append(f"{path.name}: {reason}")
            path.unlink(missing_ok=True)
        return rows

    def forget(self, keys: Iterable[str]) -> None:
        """Drop the rows of some keys: they are to be computed again."""
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
