"""A run: plan the data sets, estimate what is new, and bring tables, figures, report and run.json up to date.

A day has the same row in any batch. A worker writes the segment of its batch itself, so that rows never
travel between processes and finished batches are kept.
"""

import datetime as dt
import re
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from platform import node
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from threadpoolctl import threadpool_limits

from rivid.config import Config
from rivid.core.fir import half_time
from rivid.errors import ConfigError, DataError, NoDataError, PendingError, RividError, printable
from rivid.estimators import ESTIMATORS, Answer, Days, Prepared, build
from rivid.logs import days as logs
from rivid.logs.days import Catalog, DataSet, DaySource, FileFacts, Span
from rivid.logs.spec import MICRO, is_day_file
from rivid.results import store
from rivid.results.read import SCHEMA_VERSION, last_record
from rivid.results.store import Rows, Store
from rivid.run.drawing import MOST_PAINTERS, draw_with
from rivid.run.workers import DRAWING, ESTIMATING, Engine, Progress, cores, each, processes, warm
from rivid.types import Bools, Floats

BLOCK = 32  # consecutive days of one shard: neighbours share files and windows
MOST = 100_000  # most shards of a run


@dataclass(frozen=True)
class Shard:
    """Part `index` of `count`, counted from 1."""

    index: int
    count: int

    @classmethod
    def parse(cls, text: str) -> "Shard":
        """Read I/N; ConfigError if it is not two whole numbers with 1 <= I <= N."""
        parts = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text)
        if parts and 1 <= int(parts[1]) <= int(parts[2]) <= MOST:
            return cls(int(parts[1]), int(parts[2]))
        raise ConfigError(
            f"--shard {text}: expected I/N with 1 <= I <= N <= {MOST:,}, for example 3/16; "
            "a job array that counts from 0 adds 1"
        )

    @property
    def name(self) -> str:
        """The shard in names of files."""
        return f"{self.index}-of-{self.count}"

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"

    def holds(self, date: dt.date) -> bool:
        """Whether a day belongs to this shard; it depends on the date alone."""
        return date.toordinal() // BLOCK % self.count == self.index - 1


@dataclass(frozen=True)
class Options:
    """Options of a run beyond its configuration."""

    workers: int | None = None  # by default as many as pay off
    first: dt.date | None = None  # days from here
    last: dt.date | None = None  # to here, both included, are estimated
    force: bool = False  # estimate again what is done already
    verify: bool = False  # hash every file, also where its size and times are unchanged
    figures: bool = True  # draw figures and report
    today: dt.date | None = None  # in place of today's date
    shard: Shard | None = None  # estimate this part of the days; the run that follows writes the tables
    most_new: int | None = None  # refuse more new days


@dataclass(frozen=True)
class Window:
    """A data set to read."""

    date: dt.date  # the last one
    sources: tuple[DaySource, ...]
    key: str  # of content and settings
    missing: tuple[dt.date, ...] = ()
    content: str = ""  # key of the content alone
    span: Span | None = None  # of a data set shorter than a day
    start: str | None = None  # its local begin (ISO 8601)


@dataclass(frozen=True)
class Plan:
    """The data sets of DATA_DIR, and the current date or time."""

    catalog: Catalog
    windows: list[Window]
    asked: list[Window]  # those selected by the options
    now: dt.date | dt.datetime


def make_plan(
    data_dir: Path, config: Config, options: Options, known: Any = None, engine: Engine | None = None
) -> Plan:
    """Find the days of DATA_DIR and make windows of them; where much is new, the engine's workers read it.

    `known` are the files seen by the last finished run, to avoid hashing them. NoDataError if there is no
    log, no whole window, or none between the dates selected; ConfigError if the logs lack columns.
    """
    facts: dict[str, FileFacts] = {}
    with suppress(AttributeError, KeyError, TypeError, ValueError):  # what cannot be read is hashed again
        facts = {path: FileFacts(**value) for path, value in (known or {}).items()}
    if engine is not None and not options.verify:
        paths = logs.unread(data_dir, facts)
        large = sum(path.stat().st_size for path in paths) >= LISTED_HERE
        if large and engine.slots > 1:  # in this order: a finished run contacts no scheduler
            tasks = ((logs.look_ahead, path, config) for path in paths)
            facts |= {task[1].name: found for task, found, _ in each(tasks, engine) if found is not None}
    catalog = logs.find_days(data_dir, config, facts, verify=options.verify)
    logs.refuse_columns(data_dir, catalog.days, config)
    sources = {day.date: day for day in catalog.days}
    length, settings = config.run.window_days, config.as_used()
    del settings["diagnose"]
    now = options.today or logs.now_at(config)
    # today's log may answer "pending" today and something else tomorrow, with the same content
    may_be_today = now.date() - dt.timedelta(days=1) if isinstance(now, dt.datetime) else now
    used = store.digest(settings)
    windows = []
    for date in sources:
        days = [date - dt.timedelta(days=k) for k in range(length - 1, -1, -1)]
        if days[0] < catalog.days[0].date:
            continue  # the record begins inside this window
        present = tuple(sources[day] for day in days if day in sources)
        missing = tuple(day for day in days if day not in sources)
        content = store.digest(str(date), [[str(s.date), *(sha for _, sha, _ in s.parts)] for s in present])
        unfinished = str(may_be_today) if date >= may_be_today else None
        for span, start in _spans(data_dir, present[-1:], config):
            part = store.digest(content, span) if span else content
            key = store.digest(part, used, unfinished)
            windows.append(Window(date, present, key, missing, part, span, start))
    if not windows:
        takes = f"{length} days in a row ([run] window_days)"
        if config.run.window:
            takes = f"{config.run.window} ([run] window)"
        raise NoDataError(f"{len(sources)} days of logs in {data_dir}: a data set takes {takes}")
    first, last = options.first or dt.date.min, options.last or dt.date.max
    asked = [w for w in windows if first <= w.date <= last]
    if asked and options.shard:
        asked = [w for w in asked if options.shard.holds(w.date)]  # perhaps none: the shard is done
    elif not asked:
        raise NoDataError(
            f"no data set from {options.first or 'the first'} to {options.last or 'the last'}: "
            f"{data_dir} has them from {windows[0].date} to {windows[-1].date}"
        )
    return Plan(catalog, windows, asked, now)


def _spans(
    data_dir: Path, sources: tuple[DaySource, ...], config: Config
) -> list[tuple[Span | None, str | None]]:
    """Data sets of a day and their local begins; one without a span for whole days and for a faulty log."""
    if not config.run.window or not sources:
        return [(None, None)]
    try:
        spans, zone = logs.spans_of(data_dir, sources[0], config)
    except DataError:
        return [(None, None)]  # it fails with the reason when it is read
    begin = [dt.datetime.fromtimestamp(start / MICRO, zone) for start, _ in spans]
    return [(span, f"{moment:%Y-%m-%dT%H:%M:%S.%f}") for span, moment in zip(spans, begin, strict=True)]


Done = Callable[[int], None]
Refused = tuple[Window, str, DataError]  # a row without an estimate: window, estimator, reason


@dataclass(frozen=True)
class Batch:
    """Windows to estimate together, with all that a worker needs."""

    root: Path
    config: Config
    windows: tuple[Window, ...]
    now: dt.date | dt.datetime


def estimate_batch(batch: Batch) -> pa.Table:
    """Read and estimate every window of a batch: a row of schema SEGMENT per window and estimator."""
    config, names = batch.config, batch.config.run.estimators
    alike: dict[tuple[int, bool], list[tuple[Window, DataSet]]] = defaultdict(list)
    refused: list[Refused] = []
    for window in batch.windows:
        try:
            data = _read(batch, window)
        except DataError as error:
            refused += [(window, name, error) for name in names]
        else:
            alike[len(data.inflow), data.outflow is None].append((window, data))
    tables = []
    with threadpool_limits(1):
        for (n, _), group in alike.items():
            windows = [window for window, _ in group]
            days, shared, notes = _measured(windows, [data for _, data in group], config)
            for name, estimator in build(config).items():
                if n < estimator.min_samples:
                    longer = estimator.min_samples * config.reach.sample_time
                    reason = DataError(
                        f"{n} samples are too few for {estimator.needed_for}: "
                        f"{config.run.lengthen(longer)}, or lower {estimator.key}"
                    )
                    refused += [(window, name, reason) for window in windows]
                else:
                    tables.append(_rows(days, shared, notes, config, name, estimator))
    tables.append(_refused(refused, config))
    return store.arranged(pa.concat_tables(tables), [window.key for window in batch.windows], names)


def _read(batch: Batch, window: Window) -> DataSet:
    if window.missing:
        days = ", ".join(str(day) for day in window.missing)
        raise DataError(f"a data set of {batch.config.run.window_days} days needs {days}: no log of that day")
    try:
        if batch.config.run.window and not window.span:
            logs.spans_of(batch.root, window.sources[0], batch.config)  # raises the reason
        return logs.read_window(batch.root, window.sources, batch.config, today=batch.now, span=window.span)
    except (OSError, MemoryError, ValueError) as error:
        raise DataError(f"cannot be read: {type(error).__name__}: {error}") from error


def _refused(refused: Sequence[Refused], config: Config) -> pa.Table:
    """Rows without an estimate, and the reason."""
    columns = _named([window for window, _, _ in refused], config) | {
        "estimator": [name for _, name, _ in refused],
        "status": ["pending" if isinstance(reason, PendingError) else "failed" for _, _, reason in refused],
        "message": [printable(" ".join(str(reason).split())[:500]) for _, _, reason in refused],
    }
    return store.to_table(columns, store.SEGMENT)


def _named(windows: Sequence[Window], config: Config) -> dict[str, list[Any]]:
    """Columns that name a row, for any estimator."""
    columns: dict[str, list[Any]] = {
        name: [getattr(window, name) for window in windows] for name in ("key", "date", "start")
    }
    given = {"reach": config.reach.name, "output_unit": config.reach.output_unit}
    return columns | {name: [value] * len(windows) for name, value in given.items()}


def _measured(
    windows: list[Window], sets: list[DataSet], config: Config
) -> tuple[Days, dict[str, Any], list[list[str]]]:
    """Data sets of one length: what estimators need, the columns they share, and remarks on each."""
    reach = config.reach
    inflow = np.stack([data.inflow for data in sets])
    output = np.stack([data.output for data in sets])
    logged = [data.outflow for data in sets if data.outflow is not None]  # all of a group, or none
    outflow = np.stack(logged) if logged else None
    days = Days.of(inflow, output, outflow, config.run.min_motion)
    notes = [[data.notes] if data.notes else [] for data in sets]
    mean_inflow = inflow.mean(axis=1)
    level = output.mean(axis=1) if reach.kind == "pool" else np.full(len(sets), np.nan)
    if reach.bed_level is not None:
        for i in np.flatnonzero(level <= reach.bed_level):
            notes[i].append(
                f"mean level {level[i]:.2f} m is not above [reach] bed_level: depth of [reach] taken"
            )
    bounds = reach.bounds(mean_inflow if outflow is None else outflow.mean(axis=1), level)
    return days, _named(windows, config) | {
        "n_samples": [len(data.inflow) for data in sets],
        "n_filled": [data.n_filled for data in sets],
        "mean_inflow_m3s": mean_inflow,
        "mean_level_m": level,
        "froude": bounds.froude,
        "bound_gravity_s": bounds.gravity,
        "bound_kinematic_s": bounds.kinematic,
    }, notes  # fmt: skip


def _rows(
    days: Days, shared: dict[str, Any], notes: list[list[str]], config: Config, name: str, estimator: Prepared
) -> pa.Table:
    """The rows of one estimator on data sets of one length."""
    answer, reach, n = estimator.estimate(days), config.reach, len(days.u)
    identified = np.asarray(answer.status != "unidentifiable", bool)

    def given(values: Floats | None) -> Floats:
        return np.full(n, np.nan) if values is None else values

    delay, travel = given(answer.delay), answer.travel
    if travel is None:  # in whole nanoseconds: 6 samples of 0.1 s are 0.6 s, not 0.6000000000000001
        begin, middle = (np.round((delay + part) * reach.sample_time, 9) for part in (0.0, 0.5))
    else:
        begin = middle = travel * reach.sample_time
    columns: dict[str, Any] = shared | {
        "estimator": [name] * n,
        "status": answer.status.tolist(),
        "delay_samples": delay,
        "delay_s": begin,
        "travel_time_s": middle,
        "half_response_s": given(answer.half) * reach.sample_time,
        "noise_sd": np.sqrt(given(answer.noise_variance)),
        "roughness_sd": np.sqrt(given(answer.roughness_variance)),
        "iterations": np.zeros(n, np.int64) if answer.iterations is None else answer.iterations,
        "message": ["; ".join(_notes(i, notes[i], answer, days, config, name, estimator)) for i in range(n)],
        "fir": store.lists(answer.fir, identified),
        "fir_sd": store.lists(answer.fir_sd, identified),
    }
    for column in ("probability", "delay_low", "delay_high", "alpha", "condition"):
        columns[column] = getattr(answer, column)
    if answer.fir is not None and reach.kind == "river":
        half = half_time(answer.fir) if travel is None else travel
        columns["t50_samples"] = np.where(identified, half, np.nan)
    outside: Bools = np.zeros(n, bool) if answer.outside is None else answer.outside
    at_bound, known = outside, outside
    if answer.candidates is not None and answer.curve is not None:
        searched = identified | np.isfinite(given(answer.probability))
        at_bound = outside | np.isin(delay, answer.candidates[[0, -1]])
        known = outside | searched
        columns["first_candidate"] = pa.array(np.full(n, answer.candidates[0]), mask=~searched)
        columns["curve"] = store.lists(answer.curve, searched)
        if answer.prior_only is not None:
            columns["prior_only"] = pa.array(answer.prior_only, mask=~searched)
        if answer.criterion is not None:
            columns["criterion"] = np.where(searched, answer.criterion.min(axis=1), np.nan)
    columns["at_bound"] = pa.array(at_bound, mask=~known)
    return store.to_table(columns, store.SEGMENT)


def _notes(
    i: int, notes: list[str], answer: Answer, days: Days, config: Config, name: str, estimator: Prepared
) -> list[str]:
    """All remarks on day `i`, those on its data (`notes`) last."""
    first = []
    if answer.status[i] == "unidentifiable":
        first.append(_why(answer, i, days, config))
    elif ESTIMATORS[name].notes_bound and answer.candidates is not None and answer.delay is not None:
        delay = answer.delay[i]
        if delay == answer.candidates[-1]:
            first.append(f"d = {delay:.0f} is the longest delay tried: the true one may be longer")
        elif delay == answer.candidates[0] == 1:
            first.append(
                "d = 1 is the shortest delay that is tried: the true one may be about one sample or less"
            )
        elif delay == answer.candidates[0]:
            first.append(f"d = {delay:.0f} is the shortest delay tried: the true one may be shorter")
    if answer.iterations is not None and estimator.max_iterations is not None:
        if answer.iterations[i] >= estimator.max_iterations:
            first.append(f"not settled after {estimator.max_iterations} rounds ([jmap] tolerance)")
    return [*first, *notes]


def _why(answer: Answer, i: int, days: Days, config: Config) -> str:
    if not days.u[i].any():
        return "the inflow does not move enough: nothing to identify"
    if not days.y[i].any():
        what = "level" if config.reach.kind == "pool" else "output discharge"
        return f"the {what} does not move: nothing to identify (gauge stuck?)"
    if answer.reason is not None and answer.reason[i]:
        return str(answer.reason[i])
    number = np.nan if answer.condition is None else answer.condition[i]
    condition = f"condition number of U'U is {number:.1e}"
    settings, n = config.jmap_settings(), days.u.shape[1]
    order, unused = settings.order, settings.order - 1 if settings.free_start else 0
    if 2 * order > n - unused:  # fewer than two samples for each coefficient
        history = f", of which {unused} are history only" if unused else ""
        return (
            f"an FIR of order {order} is too long for {n} samples{history} ({condition}): "
            f"{config.run.lengthen((2 * order + unused) * config.reach.sample_time)}, or lower [jmap] order"
        )
    return f"the inflow moves too little: {condition}"


def run_batches(batches: Iterable[Batch], segments: Path, engine: Engine, done: Done) -> None:
    """Estimate batches as workers become free; `done` is called with the windows of each finished one."""
    for (_, batch, _), _, lost in each(((work, batch, segments) for batch in batches), engine):
        if lost:
            _alone(batch, segments, engine, done)
        else:
            done(len(batch.windows))


def work(batch: Batch, segments: Path) -> None:
    """Estimate a batch and write its segment, in a worker; a lost disk is a RividError and no failed day."""
    for place in (batch.root, segments):
        if not place.exists():
            raise RividError(
                f"a worker on {node()} does not see {place}: DATA_DIR and OUT must be there, under these "
                "paths, on every machine that works; what is done is kept"
            )
    store.write_segment(segments, estimate_batch(batch))


def _alone(batch: Batch, segments: Path, engine: Engine, done: Done) -> None:
    """Estimate alone a batch during which a worker died; halve it until the day that kills is alone."""
    try:
        with engine.one() as single:
            single.submit(work, batch, segments).result()
        done(len(batch.windows))
    except engine.died:
        if len(batch.windows) == 1:
            reason = DataError("the worker process died on this day (out of memory?)")
            rows: list[Refused] = [(batch.windows[0], name, reason) for name in batch.config.run.estimators]
            store.write_segment(segments, _refused(rows, batch.config))
            done(1)
            return
        middle = len(batch.windows) // 2
        for windows in (batch.windows[:middle], batch.windows[middle:]):
            _alone(replace(batch, windows=windows), segments, engine, done)


LEAST_BATCH = 128  # least days of a batch: enough to be worth a file
BATCH_DAYS = 366  # most days: one worker reads a log of a year
BATCHES_EACH = 4  # batches for each worker, so that all end at about the same time
ONE_PROCESS_BELOW = 1000  # new days: starting worker processes takes longer than to estimate fewer
LISTED_HERE = 10 << 20  # bytes of new files that this process reads: workers take as long to start


class TooManyError(RividError):
    """More days are new than ``Options.most_new``."""


@dataclass
class Summary:
    """Counts and short rows of a run."""

    out: Path
    rows: pa.Table  # of OUT in their order, or of the shard: see :class:`rivid.results.store.Rows`
    windows: int  # data sets in DATA_DIR
    computed_keys: set[str]  # estimated in this run
    asked_keys: set[str]  # selected by its options
    reused: int  # taken over from earlier runs
    dropped: int  # days of earlier runs without logs: OUT mirrors DATA_DIR
    failed: list[str]  # content keys of days
    new_failures: int  # of these, that no finished run has reported
    counts: dict[str, dict[str, int]]  # rows per estimator and status
    bad_files: list[tuple[str, str]]  # path and reason
    new_bad_files: list[tuple[str, str]]  # of these, that no finished run has reported
    damaged: list[str]  # segments that were dropped
    unasked: list[str]  # estimators that are no longer configured: their rows leave the tables
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

    @property
    def failures(self) -> int:
        """Days that failed."""
        return len(self.failed)


def run(
    data_dir: Path,
    out: Path,
    config: Config,
    options: Options,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Summary:
    """Estimate what is new in DATA_DIR and bring OUT up to date.

    With a shard, its days are estimated and stored, and nothing else of OUT is changed. The `engine` executes
    batches, by default as many processes as pay off; figures are drawn by processes of this machine, also
    where a cluster estimates. NoDataError, LockedError, ConfigError or RividError if the run cannot begin.
    """
    began, started = time.perf_counter(), dt.datetime.now(dt.UTC)
    painters = min(options.workers or cores(), MOST_PAINTERS)
    build(config)  # refuses settings that contradict each other
    _refuse_places(data_dir, out)
    if config.run.window:  # figures and report are of whole days
        options = replace(options, figures=False)
    draws = options.figures and not options.shard and engine is None and painters > 1
    # they begin with their first task
    own = processes(options.workers or cores(), DRAWING if draws else ESTIMATING)
    with Store(out, options.shard.name if options.shard else "") as held:
        before = last_record(out)
        with nullcontext(engine) if engine else own as executing:
            planned = make_plan(data_dir, config, options, held.known_files(data_dir), executing)
            if options.force:
                held.forget([w.key for w in planned.asked])
            kept = held.read()
            new = missing(planned.asked, kept)
            if options.most_new is not None and len(new) > options.most_new:
                raise TooManyError(f"{len(new)} new days in {data_dir}: expected {options.most_new} or fewer")
            if new:
                if draws:
                    warm(DRAWING)  # while this process reads and estimates
                few = engine is None and options.workers is None and len(new) < ONE_PROCESS_BELOW
                estimating = Engine() if few else executing
                batches = _batches(data_dir, config, new, planned, estimating)
                with progress(len(new)) if progress else nullcontext(lambda _: None) as done:
                    run_batches(batches, held.segments, estimating, done)
        windows = planned.asked if options.shard else planned.windows
        rows = (held.read(kept) if new else kept).arranged([w.key for w in windows], config.run.estimators)
        summary = _summarise(rows, planned, new, kept, config, before, held)
        if not options.shard:
            keys = store.hash_of(rows.table)
            content = store.digest(keys, config.as_used(), summary.bad_files, SCHEMA_VERSION)
            current = before.get("content") == content and store.is_whole(out, before, options.figures)
            if options.force or not current:
                now = store.describe(config, data_dir, started) | {
                    "data_sets": summary.windows,
                    "computed": summary.computed,
                    "reused": summary.reused,
                    "counts": summary.counts,
                    "bad_files": summary.bad_files,
                    "failed": summary.failed,
                }
                files = _write(out, rows, now, before, began, options, engine, painters)
                store.write_record(out, now | {"content": content, "outputs": store.hashes(out, files)})
                held.compact(rows)
                if summary.dropped:
                    stale = pc.is_in(kept.table["key"], value_set=rows.table["key"].combine_chunks())
                    held.forget(kept.table["key"].filter(pc.invert(stale)).to_pylist())
            held.remember_files(data_dir, {p: vars(f) for p, f in planned.catalog.files.items()})
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


def _batches(
    data_dir: Path, config: Config, new: list[Window], planned: Plan, engine: Engine
) -> Iterator[Batch]:
    """Cut the new windows into batches for an engine, at the ends of files where these are of many days."""
    shared = -(-len(new) // engine.slots)
    size = min(shared, BATCH_DAYS, max(LEAST_BATCH, shared // BATCHES_EACH))
    begin = 0
    for at in range(1, len(new) + 1):
        whole = at - begin >= size or at == len(new)
        if whole or (at - begin >= size // 2 and _file_of(new[at]) != _file_of(new[at - 1])):
            yield Batch(data_dir, config, tuple(new[begin:at]), planned.now)
            begin = at


def _file_of(window: Window) -> str:
    """The file of many days with the last day of a window; empty for one of a single day."""
    path = window.sources[-1].parts[0][0]
    return "" if is_day_file(path) else path


def _summarise(
    rows: Rows,
    planned: Plan,
    new: list[Window],
    kept: Rows,
    config: Config,
    before: dict[str, Any],
    held: Store,
) -> Summary:
    table = rows.table
    dates = {window.date for window in planned.windows}
    bad_files = planned.catalog.bad_files
    # users may have edited the record of the run before
    reported, known_bad, known = (
        value if isinstance(value := before.get(key), list) else []
        for key in ("failed", "bad_files", "estimators")
    )
    counts: dict[str, dict[str, int]] = {}
    for name in pc.unique(table["estimator"]).to_pylist():
        of = table["status"].filter(pc.equal(table["estimator"], name))
        counts[name] = {c["values"]: c["counts"] for c in pc.value_counts(of).to_pylist()}
    failed_keys = set(table["key"].filter(pc.equal(table["status"], "failed")).to_pylist())
    failed = sorted(w.content for w in planned.windows if w.key in failed_keys)
    return Summary(
        out=held.out,
        rows=table,
        windows=len(planned.windows),
        computed_keys={w.key for w in new},
        asked_keys={w.key for w in planned.asked},
        reused=len(pc.unique(table["key"])) - len(new),
        dropped=sum(date not in dates for date in pc.unique(kept.table["date"]).to_pylist()),
        failed=failed,
        new_failures=len(set(failed).difference(map(str, reported))),
        counts=counts,
        bad_files=bad_files,
        new_bad_files=[b for b in bad_files if list(b) not in known_bad],
        damaged=held.damaged,
        unasked=[str(name) for name in known if str(name) not in config.run.estimators],
    )


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
    store.write_record(out, before | store.UNFINISHED)
    store.write_tables(rows.chunks(), out, rows.spread, starts="window" in now["config"]["run"])
    now["seconds"] = round(time.perf_counter() - began, 3)
    files = [out / name for name in store.TABLES]
    if not options.figures:
        (out / "report.html").unlink(missing_ok=True)  # it would describe older tables
        return files
    store.write_record(out, now | store.UNFINISHED | {"failed": before.get("failed", [])})
    with nullcontext(engine) if engine and engine.draws else processes(painters, DRAWING) as painting:
        return files + draw_with(painting, out, now)
