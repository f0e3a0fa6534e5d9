"""A run: estimate what is new, and bring the tables, figures, report and run.json up to date."""

import datetime as dt
import os
import time
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa

from rivid import record
from rivid.batch import Batch, Window
from rivid.config import Config
from rivid.errors import ConfigError, NoDataError
from rivid.estimators import build
from rivid.plan import Options, Plan, make_plan
from rivid.store import Store, arrange, digest
from rivid.tables import SCHEMA_VERSION, TABLES, write_tables
from rivid.workers import run_batches

BATCH_DAYS = 128
"""Days of a batch at most: small enough to share out, large enough to be worth a file."""

ONE_PROCESS_BELOW = 1000
"""With fewer new days than this, starting worker processes takes longer than the work itself."""


@dataclass
class Summary:
    """What a run did.

    Attributes
    ----------
    out : Path
    rows : pyarrow.Table
        All rows of OUT, of schema :data:`rivid.tables.SEGMENT`.
    windows : int
        Data sets of DATA_DIR.
    computed, reused : int
        Those estimated now, and taken over from earlier runs.
    dropped : int
        Data sets of earlier runs whose logs are gone: OUT mirrors DATA_DIR.
    failures, new_failures : int
        Days that failed; of them those that no finished run has told of.
    counts : dict
        Rows per estimator and status.
    bad_files, new_bad_files : list of (path, reason)
        Files that are no logs; of them those that no finished run has told of.
    damaged : list of str
        Segments that were damaged and dropped.
    """

    out: Path
    rows: pa.Table
    windows: int
    computed_keys: set[str]
    asked_keys: set[str]
    bad_files: list[tuple[str, str]]
    new_bad_files: list[tuple[str, str]]
    dropped: int
    damaged: list[str]
    failures: int = 0
    new_failures: int = 0
    reused: int = 0
    seconds: float = 0.0
    counts: dict[str, dict[str, int]] = field(default_factory=dict)

    @property
    def computed(self) -> int:
        """Data sets estimated now."""
        return len(self.computed_keys)


def run(data_dir: Path, out: Path, config: Config, options: Options, progress: Any = None) -> Summary:
    """Estimate what is new in DATA_DIR and bring OUT up to date.

    Parameters
    ----------
    data_dir, out : Path
        Where the logs are; where the results go.
    config : Config
    options : Options
    progress : callable, optional
        ``progress(total)`` gives a context manager whose value is called with each number of days done.

    Returns
    -------
    Summary

    Raises
    ------
    NoDataError, LockedError, ConfigError, RividError
        Before anything is computed, where the run cannot begin.
    """
    began, started = time.perf_counter(), dt.datetime.now(dt.UTC)
    build(config)  # settings that contradict each other are said before any work
    _refuse_places(data_dir, out)
    with Store(out) as store:
        before = record.last(out)
        planned = make_plan(data_dir, config, options, store.known_files(data_dir))
        if options.force:
            store.forget({w.key for w in planned.asked})
        kept = store.read()
        done = set(kept["key"].to_pylist())
        new = [w for w in planned.asked if w.key not in done]
        _estimate(store, data_dir, config, new, planned, options, progress)
        rows = arrange(store.read() if new else kept, [w.key for w in planned.windows], config.run.estimators)

        summary, failed = _summarise(rows, planned, new, kept, before, store, out)
        content = digest(rows["key"].to_pylist(), config.as_used(), summary.bad_files, SCHEMA_VERSION)
        current = before.get("content") == content and record.is_whole(out, before, options.figures)
        if options.force or not current:
            record.unfinished(out, before)
            write_tables(rows, out)
            now = record.describe(config, data_dir, started) | {
                "data_sets": summary.windows,
                "computed": summary.computed,
                "reused": summary.reused,
                "counts": summary.counts,
                "bad_files": summary.bad_files,
                "failed": failed,
                "seconds": round(time.perf_counter() - began, 3),
            }
            files = [out / name for name in TABLES]
            if options.figures:
                record.unfinished(out, now | {"failed": before.get("failed", [])})
                files += _draw(out, now)
            else:
                (out / "report.html").unlink(missing_ok=True)  # it would speak of older tables
            record.write(out, now | {"content": content, "outputs": record.hashes(out, files)})
            store.compact(rows)
            if summary.dropped:
                store.forget(set(kept["key"].to_pylist()) - set(rows["key"].to_pylist()))
        store.remember_files(data_dir, {p: f.to_json() for p, f in planned.catalog.files.items()})
    summary.seconds = time.perf_counter() - began
    return summary


def _refuse_places(data_dir: Path, out: Path) -> None:
    if not data_dir.exists():
        raise NoDataError(f"{data_dir} does not exist: expected a directory of logs")
    if data_dir.resolve() == out.resolve():
        raise ConfigError(f"OUT is DATA_DIR ({out}): its tables would be taken for logs; give another --out")


def _estimate(
    store: Store,
    data_dir: Path,
    config: Config,
    new: list[Window],
    planned: Plan,
    options: Options,
    progress: Any,
) -> None:
    """Share the new windows out over batches and workers."""
    workers = options.workers or (1 if len(new) < ONE_PROCESS_BELOW else os.cpu_count() or 1)
    size = max(1, min(BATCH_DAYS, -(-len(new) // workers)))
    batches = (
        Batch(data_dir, config, tuple(new[at : at + size]), planned.now) for at in range(0, len(new), size)
    )
    with progress(len(new)) if progress and new else nullcontext(lambda _: None) as done:
        run_batches(batches, store.segments, workers, done)


def _summarise(
    rows: pa.Table,
    planned: Plan,
    new: list[Window],
    kept: pa.Table,
    before: dict[str, Any],
    store: Store,
    out: Path,
) -> tuple[Summary, list[str]]:
    """The summary, and the content of the days that failed."""
    summary = Summary(
        out=out,
        rows=rows,
        windows=len(planned.windows),
        computed_keys={w.key for w in new},
        asked_keys={w.key for w in planned.asked},
        bad_files=planned.catalog.bad_files,
        new_bad_files=[b for b in planned.catalog.bad_files if list(b) not in before.get("bad_files", [])],
        dropped=len(set(kept["date"].to_pylist()) - {w.date for w in planned.windows}),
        damaged=store.damaged,
    )
    failed_keys = set()
    for key, name, status in zip(*(rows[c].to_pylist() for c in ("key", "estimator", "status")), strict=True):
        of = summary.counts.setdefault(name, {})
        of[status] = of.get(status, 0) + 1
        if status == "failed":
            failed_keys.add(key)
    failed = sorted(w.content for w in planned.windows if w.key in failed_keys)
    summary.failures = len(failed)
    summary.new_failures = len(set(failed) - set(before.get("failed", [])))
    summary.reused = len(set(rows["key"].to_pylist()) - summary.computed_keys)
    return summary, failed


def _draw(out: Path, now: dict[str, Any]) -> list[Path]:
    """Figures and report; gives the files written."""
    from rivid.figures import draw_all
    from rivid.report import write_report
    from rivid.results import load_results

    results = load_results(out)
    figures = draw_all(results, out)
    return [*(figure.path for figure in figures), write_report(results, figures, out, summary=now)]
