"""A run: plan what is new, estimate it, and write the tables, figures, report and run.json."""

import datetime as dt
import json
import os
import platform
import time
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import pyarrow as pa

from rivid import __version__
from rivid.atomic import write_text
from rivid.batch import Batch, Window
from rivid.config import Config
from rivid.core.settings import JmapSettings
from rivid.estimators import build
from rivid.logs.find import Catalog, FileFacts, find_days
from rivid.logs.read import refuse_columns
from rivid.store import Store, arrange, digest
from rivid.tables import SCHEMA_VERSION, write_tables

BATCH_DAYS = 128
"""Days of a batch at most: small enough to share out, large enough to be worth a file."""

ONE_PROCESS_BELOW = 1000
"""With fewer new days than this, starting worker processes takes longer than the work itself."""

TABLES = ("delays.csv", "delays.parquet", "fir.parquet", "criterion.parquet", "run.json")


@dataclass(frozen=True)
class Options:
    """What a run is asked beyond its configuration."""

    workers: int | None = None
    first: dt.date | None = None
    last: dt.date | None = None
    force: bool = False
    verify: bool = False
    figures: bool = True
    today: dt.date | None = None

    def today_of(self, config: Config) -> dt.date:
        """Today in the reach's time zone."""
        zone = config.input.time_zone
        return self.today or dt.datetime.now(ZoneInfo(zone) if zone else dt.UTC).date()


@dataclass(frozen=True)
class Plan:
    """The windows of DATA_DIR and which of them are asked for now."""

    catalog: Catalog
    windows: list[Window]
    asked: list[Window]


@dataclass
class Summary:
    """What a run did.

    Attributes
    ----------
    counts : dict
        Rows per status over all of OUT, and per estimator.
    computed, reused : int
        Windows estimated now, and taken over from earlier runs.
    new_failures : int
        Days that failed now and had not failed, with the same content, before.
    failures : int
        Days that failed, all of them.
    """

    out: Path
    rows: pa.Table
    windows: int = 0
    computed: int = 0
    reused: int = 0
    new_failures: int = 0
    failures: int = 0
    computed_keys: set[str] = field(default_factory=set)
    asked_keys: set[str] = field(default_factory=set)
    bad_files: list[tuple[str, str]] = field(default_factory=list)
    new_bad_files: list[tuple[str, str]] = field(default_factory=list)
    damaged: list[str] = field(default_factory=list)
    seconds: float = 0.0
    counts: dict[str, dict[str, int]] = field(default_factory=dict)


def make_plan(data_dir: Path, config: Config, options: Options, known: dict[str, Any] | None = None) -> Plan:
    """Find the days and make windows of them.

    Raises
    ------
    NoDataError
        Where there is no log, or none between the dates asked for.
    ConfigError
        Where the logs do not have the columns that the configuration names.
    """
    facts = {path: FileFacts.from_json(value) for path, value in (known or {}).items()}
    catalog = find_days(data_dir, config, facts, verify=options.verify)
    refuse_columns(data_dir, catalog.days, config)
    sources = {day.date: day for day in catalog.days}
    length, settings, today = config.run.window_days, config.model_dump(mode="json"), options.today_of(config)
    windows = []
    for date in sources:
        days = [date - dt.timedelta(days=k) for k in range(length - 1, -1, -1)]
        if days[0] < catalog.days[0].date:
            continue  # the record begins inside this window
        present = tuple(sources[day] for day in days if day in sources)
        missing = tuple(day for day in days if day not in sources)
        parts = [[str(s.date), *(part.digest for part in s.parts)] for s in present]
        # today's log may answer "pending" today and something else tomorrow, with the same content
        unfinished = str(today) if date >= today else None
        windows.append(Window(date, present, digest(str(date), parts, settings, unfinished), missing))
    first, last = options.first or dt.date.min, options.last or dt.date.max
    return Plan(catalog, windows, [w for w in windows if first <= w.date <= last])


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
    estimators = build(config)  # settings that contradict each other are said before any work
    with Store(out) as store:
        known = store.known_files()
        planned = make_plan(data_dir, config, options, known)
        if options.force:
            store.forget({w.key for w in planned.asked})
        kept = store.read()
        done = set(kept["key"].to_pylist())
        new = [w for w in planned.asked if w.key not in done]
        _estimate(store, data_dir, config, new, options, progress)

        rows = arrange(store.read() if new else kept, [w.key for w in planned.windows], config.run.estimators)
        summary = _summarise(rows, planned, new, done, out)
        summary.damaged = store.damaged
        before = _last_record(out)
        summary.new_bad_files = [
            bad for bad in summary.bad_files if list(bad) not in before.get("bad_files", [])
        ]
        settings = config.model_dump(mode="json")
        content = digest(rows["key"].to_pylist(), settings, summary.bad_files, SCHEMA_VERSION)
        wanted = [*TABLES, "report.html"] if options.figures else TABLES
        whole = all((out / name).exists() for name in wanted)
        if options.force or not whole or before.get("content") != content:
            write_tables(rows, out)
            summary.seconds = time.perf_counter() - began
            record = _record(summary, config, estimators[0].settings, data_dir, started)
            _write_run(out, record)  # without its content: complete only with its figures
            if options.figures:
                _draw(out, record)
            else:
                (out / "report.html").unlink(missing_ok=True)  # it would speak of older tables
            _write_run(out, record | {"content": content})
            store.compact(rows)
        store.remember_files({path: facts.to_json() for path, facts in planned.catalog.files.items()})
    summary.seconds = time.perf_counter() - began
    return summary


def _estimate(
    store: Store,
    data_dir: Path,
    config: Config,
    new: list[Window],
    options: Options,
    progress: Any,
) -> None:
    """Share the new windows out over batches and workers."""
    from contextlib import nullcontext

    from rivid.workers import run_batches

    workers = options.workers or (1 if len(new) < ONE_PROCESS_BELOW else os.cpu_count() or 1)
    size = max(1, min(BATCH_DAYS, -(-len(new) // workers)))
    batches = (
        Batch(data_dir, config, tuple(new[at : at + size]), options.today_of(config))
        for at in range(0, len(new), size)
    )
    with progress(len(new)) if progress and new else nullcontext(lambda _: None) as done:
        run_batches(batches, store.segments, workers, done)


def _summarise(rows: pa.Table, planned: Plan, new: list[Window], done: set[str], out: Path) -> Summary:
    counts: dict[str, dict[str, int]] = {}
    failed = set()
    for key, estimator, status in zip(
        *(rows[c].to_pylist() for c in ("key", "estimator", "status")), strict=True
    ):
        of = counts.setdefault(estimator, {})
        of[status] = of.get(status, 0) + 1
        if status == "failed":
            failed.add(key)
    computed = {w.key for w in new}
    return Summary(
        out=out,
        rows=rows,
        windows=len(planned.windows),
        computed=len(new),
        reused=len(set(rows["key"].to_pylist()) - computed),
        new_failures=len(failed & computed - done),
        failures=len(failed),
        computed_keys=computed,
        asked_keys={w.key for w in planned.asked},
        bad_files=planned.catalog.bad_files,
        counts=counts,
    )


def _last_record(out: Path) -> dict[str, Any]:
    try:
        record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}


def _record(
    summary: Summary, config: Config, settings: JmapSettings, data_dir: Path, started: dt.datetime
) -> dict[str, Any]:
    versions = {"rivid": __version__, "python": platform.python_version()}
    versions |= {name: version(name) for name in ("numpy", "scipy", "pyarrow", "matplotlib")}
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
        "data_dir": str(data_dir),
        "started": started.isoformat(timespec="seconds"),
        "seconds": round(summary.seconds, 3),
        "data_sets": summary.windows,
        "computed": summary.computed,
        "reused": summary.reused,
        "counts": summary.counts,
        "bad_files": summary.bad_files,
        "versions": versions,
        "config": config.model_dump(mode="json"),
    }


def _write_run(out: Path, record: dict[str, Any]) -> None:
    write_text(out / "run.json", json.dumps(record, indent=2, sort_keys=True) + "\n")


def _draw(out: Path, record: dict[str, Any]) -> None:
    from rivid.figures import draw_all
    from rivid.report import write_report
    from rivid.results import load_results

    results = load_results(out)
    write_report(results, draw_all(results, out), out, summary=record)
