"""A run: estimate what is new, and bring the tables, figures, report and run.json up to date."""

import datetime as dt
import time
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from rivid.config import Config
from rivid.errors import ConfigError, NoDataError, RividError, printable
from rivid.estimators import build
from rivid.results import record
from rivid.results.store import Rows, Store, digest, hash_of
from rivid.results.tables import SCHEMA_VERSION, TABLES, write_tables
from rivid.run.batch import Batch, Window, run_batches
from rivid.run.drawing import draw_with
from rivid.run.plan import Options, Plan, make_plan
from rivid.run.workers import DRAWING, Engine, Here, Processes, Progress, cores, processes, warm

BATCH_DAYS = 128
"""Most days of a batch: few enough to share out, enough to be worth a file."""

ONE_PROCESS_BELOW = 1000
"""New days below which starting worker processes takes longer than the estimates themselves."""

MOST_PAINTERS = 4
"""Most processes that draw: there are a few figures only, and each process reads the results itself."""


class TooManyError(RividError):
    """More days are new than ``Options.most_new``."""


@dataclass
class Summary:
    """Counts and short rows of a run.

    `rows` are all rows of OUT in their order, or those of the shard: columns
    :data:`rivid.results.store.SHORT`, and `message` where a day failed. `windows` data sets are in DATA_DIR;
    `computed_keys` of them were estimated in this run, `asked_keys` were selected by its options, `reused`
    were taken over from earlier runs; `dropped` of earlier runs have no logs any more, as OUT mirrors
    DATA_DIR. `counts` has the rows per estimator and status. `new_failures` and `new_bad_files` are those of
    `failures` (days) and `bad_files` (path, reason) that no finished run has reported. `damaged` segments
    were dropped. `unasked` estimators of the run before are no longer configured: their rows leave the
    tables.
    """

    out: Path
    rows: pa.Table
    windows: int
    computed_keys: set[str]
    asked_keys: set[str]
    reused: int
    dropped: int
    failures: int
    new_failures: int
    counts: dict[str, dict[str, int]]
    bad_files: list[tuple[str, str]]
    new_bad_files: list[tuple[str, str]]
    damaged: list[str]
    unasked: list[str]
    seconds: float = 0.0

    @property
    def exit_code(self) -> int:
        """3 where days or files failed that no finished run has reported, or where every data set failed."""
        new = self.new_failures or self.new_bad_files or 0 < self.failures == self.windows
        return 3 if new else 0

    @property
    def computed(self) -> int:
        """Data sets estimated in this run."""
        return len(self.computed_keys)


def run(
    data_dir: Path,
    out: Path,
    config: Config,
    options: Options,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Summary:
    """Estimate what is new in DATA_DIR and bring OUT up to date.

    Parameters
    ----------
    data_dir, out : Path
        Directories of the logs and of the results.
    config : Config
    options : Options
        With a shard, its days are estimated and stored, and nothing else of OUT is changed.
    progress : callable, optional
        ``progress(total)`` returns a context; its value is called with each number of finished days.
    engine : Engine, optional
        Executes batches; by default as many processes as pay off. Figures are drawn by processes of this
        machine, also where a cluster estimates.

    Raises
    ------
    NoDataError, LockedError, ConfigError, RividError
        If the run cannot begin; nothing has been computed then.
    """
    began, started = time.perf_counter(), dt.datetime.now(dt.UTC)
    painters = min(options.workers or cores(), MOST_PAINTERS)
    build(config)  # refuses settings that contradict each other
    _refuse_places(data_dir, out)
    with Store(out, options.shard.name if options.shard else "") as store:
        before = record.last(out)
        planned = make_plan(data_dir, config, options, store.known_files(data_dir))
        if options.force:
            store.forget([w.key for w in planned.asked])
        kept = store.read()
        new = missing(planned.asked, kept)
        if options.most_new is not None and len(new) > options.most_new:
            raise TooManyError(f"{len(new)} new days in {data_dir}: expected {options.most_new} or fewer")
        if new:
            if options.figures and not options.shard and engine is None and painters > 1:
                warm(DRAWING)  # while this process reads and estimates
            _estimate(store, data_dir, config, new, planned, options, progress, engine)
        windows = planned.asked if options.shard else planned.windows
        rows = (store.read(kept) if new else kept).arranged([w.key for w in windows], config.run.estimators)
        summary, failed = _summarise(rows, planned, new, kept, config, before, store)
        if not options.shard:
            content = digest(hash_of(rows), config.as_used(), summary.bad_files, SCHEMA_VERSION)
            current = before.get("content") == content and record.is_whole(out, before, options.figures)
            if options.force or not current:
                now = record.describe(config, data_dir, started) | {
                    "data_sets": summary.windows,
                    "computed": summary.computed,
                    "reused": summary.reused,
                    "counts": summary.counts,
                    "bad_files": summary.bad_files,
                    "failed": failed,
                }
                files = _write(out, rows, now, before, began, options, engine, painters)
                record.write(out, now | {"content": content, "outputs": record.hashes(out, files)})
                store.compact(rows)
                if summary.dropped:
                    stale = pc.is_in(kept.table["key"], value_set=rows.table["key"].combine_chunks())
                    store.forget(kept.table["key"].filter(pc.invert(stale)).to_pylist())
            store.remember_files(data_dir, {p: f.to_json() for p, f in planned.catalog.files.items()})
    summary.seconds = time.perf_counter() - began
    return summary


def missing(asked: list[Window], kept: Rows) -> list[Window]:
    """The windows that no segment holds."""
    keys = pa.array([window.key for window in asked], pa.string())
    done = pc.is_in(keys, value_set=kept.table["key"].combine_chunks())
    return [window for window, is_done in zip(asked, done.to_pylist(), strict=True) if not is_done]


def _refuse_places(data_dir: Path, out: Path) -> None:
    if not data_dir.exists():
        raise NoDataError(f"{data_dir} does not exist: expected a directory of logs")
    try:
        str(out).encode()
    except UnicodeEncodeError:
        raise ConfigError(
            f"OUT ({printable(str(out))}): its name is not UTF-8, and Parquet files cannot be written there; "
            "give another --out"
        ) from None
    if data_dir.resolve() == out.resolve():
        raise ConfigError(f"OUT is DATA_DIR ({out}): its tables would be taken for logs; give another --out")


def _estimate(
    store: Store,
    data_dir: Path,
    config: Config,
    new: list[Window],
    planned: Plan,
    options: Options,
    progress: Progress | None,
    engine: Engine | None,
) -> None:
    """Estimate the new windows in batches, with as many workers as pay off."""
    if engine is None:
        workers = options.workers or (1 if len(new) < ONE_PROCESS_BELOW else cores())
    else:
        workers = engine.slots
    size = max(1, min(BATCH_DAYS, -(-len(new) // workers)))
    batches = (
        Batch(data_dir, config, tuple(new[at : at + size]), planned.now) for at in range(0, len(new), size)
    )
    with progress(len(new)) if progress else nullcontext(lambda _: None) as done:
        with nullcontext(engine) if engine else processes(workers) as executing:
            run_batches(batches, store.segments, executing, done)


def _summarise(
    rows: Rows,
    planned: Plan,
    new: list[Window],
    kept: Rows,
    config: Config,
    before: dict[str, Any],
    store: Store,
) -> tuple[Summary, list[str]]:
    """The summary, and the content keys of the days that failed."""
    table = rows.table
    dates = {window.date for window in planned.windows}
    bad_files = planned.catalog.bad_files
    estimators = before.get("estimators")  # of a file that users may have edited
    counts: dict[str, dict[str, int]] = {}
    for name in pc.unique(table["estimator"]).to_pylist():
        of = table["status"].filter(pc.equal(table["estimator"], name))
        counts[name] = {c["values"]: c["counts"] for c in pc.value_counts(of).to_pylist()}
    failed_keys = set(table["key"].filter(pc.equal(table["status"], "failed")).to_pylist())
    failed = sorted(w.content for w in planned.windows if w.key in failed_keys)
    summary = Summary(
        out=store.out,
        rows=table,
        windows=len(planned.windows),
        computed_keys={w.key for w in new},
        asked_keys={w.key for w in planned.asked},
        reused=len(pc.unique(table["key"])) - len(new),
        dropped=sum(date not in dates for date in pc.unique(kept.table["date"]).to_pylist()),
        failures=len(failed),
        new_failures=len(set(failed) - set(before.get("failed", []))),
        counts=counts,
        bad_files=bad_files,
        new_bad_files=[b for b in bad_files if list(b) not in before.get("bad_files", [])],
        damaged=store.damaged,
        unasked=[
            name
            for name in map(str, estimators if isinstance(estimators, list) else ())
            if name not in config.run.estimators
        ],
    )
    return summary, failed


def _write(
    out: Path,
    rows: Rows,
    now: dict[str, Any],
    before: dict[str, Any],
    began: float,
    options: Options,
    engine: Engine | None,
    painters: int,
) -> list[Path]:
    """Write tables, and figures and report where wanted; return the files. Adds `seconds` to the record."""
    record.unfinished(out, before)
    write_tables(rows.chunks(), out, rows.spread)
    now["seconds"] = round(time.perf_counter() - began, 3)
    files = [out / name for name in TABLES]
    if not options.figures:
        (out / "report.html").unlink(missing_ok=True)  # it would describe older tables
        return files
    record.unfinished(out, now | {"failed": before.get("failed", [])})
    if isinstance(engine, Here | Processes):
        return files + draw_with(engine, out, now)
    with processes(painters, DRAWING) as painting:
        return files + draw_with(painting, out, now)
