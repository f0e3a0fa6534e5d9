"""The plan of a run: its options, its shard, and the data sets to estimate."""

import datetime as dt
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

from rivid.config import Config
from rivid.errors import ConfigError, NoDataError
from rivid.logs.days import Catalog, FileFacts, find_days, refuse_columns
from rivid.results.store import METHOD_VERSION, digest
from rivid.run.batch import Window

BLOCK = 32
"""Consecutive days of one shard: neighbours share files and windows."""

MOST = 100_000
"""Most shards of a run."""


@dataclass(frozen=True)
class Shard:
    """Part `index` of `count`, counted from 1.

    Examples
    --------
    >>> Shard.parse("3/16")
    Shard(index=3, count=16)
    """

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

    def holds_place(self, place: int) -> bool:
        """Whether the reach at this place, counted from 0, belongs to this shard."""
        return place % self.count == self.index - 1


@dataclass(frozen=True)
class Options:
    """Options of a run beyond its configuration; of `first` to `last`, both included, days are estimated.

    `workers`: by default as many as pay off. `force` estimates again data sets that are done already,
    `verify` hashes every file, also where its size and times are unchanged. `figures` draws figures and
    report. `today` replaces today's date. With `shard`, this part of the days is estimated only, and tables
    and figures are left to the run that follows. More than `most_new` new days are refused.
    """

    workers: int | None = None
    first: dt.date | None = None
    last: dt.date | None = None
    force: bool = False
    verify: bool = False
    figures: bool = True
    today: dt.date | None = None
    shard: Shard | None = None
    most_new: int | None = None

    def now(self, config: Config) -> dt.date | dt.datetime:
        """Today in the time zone of the reach; without one the current time, dated by the offset of a log."""
        moment = dt.datetime.now(dt.UTC)
        zone = config.input.time_zone
        return self.today or (moment.astimezone(ZoneInfo(zone)).date() if zone else moment)


@dataclass(frozen=True)
class Plan:
    """The data sets of DATA_DIR, those selected by the options, and the current date or time."""

    catalog: Catalog
    windows: list[Window]
    asked: list[Window]
    now: dt.date | dt.datetime


def make_plan(data_dir: Path, config: Config, options: Options, known: dict[str, Any] | None = None) -> Plan:
    """Find the days of DATA_DIR and make windows of them.

    `known` are the files seen by the last finished run, to avoid hashing them.

    Raises
    ------
    NoDataError
        If there is no log, no whole window, or none between the dates selected.
    ConfigError
        If the logs lack columns that the configuration names.
    """
    catalog = find_days(data_dir, config, _facts(known or {}), verify=options.verify)
    refuse_columns(data_dir, catalog.days, config)
    sources = {day.date: day for day in catalog.days}
    length, settings = config.run.window_days, config.as_used()
    del settings["diagnose"]
    now = options.now(config)
    # today's log may answer "pending" today and something else tomorrow, with the same content
    may_be_today = now.date() - dt.timedelta(days=1) if isinstance(now, dt.datetime) else now
    key_of = _under(settings)
    windows = []
    for date in sources:
        days = [date - dt.timedelta(days=k) for k in range(length - 1, -1, -1)]
        if days[0] < catalog.days[0].date:
            continue  # the record begins inside this window
        present = tuple(sources[day] for day in days if day in sources)
        missing = tuple(day for day in days if day not in sources)
        content = digest(str(date), [[str(s.date), *(sha for _, sha, _ in s.parts)] for s in present])
        unfinished = str(may_be_today) if date >= may_be_today else None
        windows.append(Window(date, present, key_of(content, unfinished), missing, content))
    if not windows:
        raise NoDataError(
            f"{len(sources)} days of logs in {data_dir}: a data set takes {length} days in a row "
            "([run] window_days)"
        )
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


def _under(settings: dict[str, Any]) -> Callable[[str, str | None], str]:
    """The key of a content under settings: ``digest(content, settings, unfinished)``, quickly."""
    mark = "\0"
    text = json.dumps([METHOD_VERSION, mark, settings], sort_keys=True, default=str)
    begun, between = text.split(json.dumps(mark), 1)

    def key(content: str, unfinished: str | None) -> str:
        rest = f"{begun}{json.dumps(content)}{between[:-1]}, {json.dumps(unfinished)}]"
        return hashlib.sha256(rest.encode()).hexdigest()

    return key


def _facts(known: dict[str, Any]) -> dict[str, FileFacts]:
    """Facts stored by an earlier run; none where they cannot be read."""
    try:
        return {path: FileFacts.from_json(value) for path, value in known.items()}
    except (AttributeError, KeyError, TypeError, ValueError):
        return {}
