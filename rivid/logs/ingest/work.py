"""Exports to daily logs: read, judge, write whole files, count; and the configuration for the logs."""

import datetime as dt
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from rivid.atomic import replacing, write_text
from rivid.config import Config, parse
from rivid.errors import ConfigError, NoDataError
from rivid.logs.ingest.days import DayLog, canonical, dates_of, judge
from rivid.logs.ingest.series import Gathered, Ledger, ValueStatus, gather, ledger_of, read_exports
from rivid.logs.spec import SUFFIXES, is_day_file, shown, spec_of, suffix_of
from rivid.logs.text import Table, UndeclaredError
from rivid.logs.write import Format, rows_as_bytes

KEPT = ("time_zone", "max_gap", "max_filled", "not_sentinels")
"""Keys of `[input]` on how days are made of values, not on what a file looks like."""


@dataclass(frozen=True)
class DayResult:
    """A day and its status: written, identical, refused, pending, or differs (another log stays in place)."""

    date: dt.date
    status: str
    reason: str = ""
    file: str = ""
    rows: int = 0
    filled: int = 0

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {**self.__dict__, "date": str(self.date)}


@dataclass(frozen=True)
class Outcome:
    """The result of an ingest.

    Attributes
    ----------
    days : list of DayResult
        In date order.
    ledger : Ledger
    run_config : Path
    notes : list of str
        Tags and columns that were not read.
    """

    days: list[DayResult]
    ledger: Ledger
    run_config: Path
    notes: list[str] = field(default_factory=list)

    @property
    def counts(self) -> Counter[str]:
        """Days by status."""
        return Counter(day.status for day in self.days)

    @property
    def exit_code(self) -> int:
        """0: all well; 3: a day is refused, or kept out by another log; 10: there is none."""
        if not self.days:
            return NoDataError.exit_code
        return 3 if self.counts["refused"] or self.counts["differs"] else 0

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {
            "days": [day.to_json() for day in self.days],
            "counts": dict(self.counts),
            "values": self.ledger.to_json(),
            "notes": self.notes,
            "run_config": str(self.run_config),
        }


def ingest(
    exports: Sequence[Path],
    out: Path,
    config: Config,
    *,
    format: Format = "csv",
    first: dt.date | None = None,
    last: dt.date | None = None,
    force: bool = False,
    dry_run: bool = False,
    today: dt.date | None = None,
    run_config: Path | None = None,
) -> Outcome:
    """Make daily logs of exports.

    The configuration that it wrote next to the logs is written again where nothing but that changes; where
    logs differ, or the file was edited, it stays.

    Parameters
    ----------
    exports : sequence of Path
        Files of one dialect.
    out : Path
        DATA_DIR.
    config : Config
    format : {"csv", "csv.gz", "parquet"}
    first, last : date, optional
        First and last local day that is written.
    force : bool
        Overwrite what differs.
    dry_run : bool
        Write nothing.
    today : date, optional
        From this day on, a log may be unfinished; default: by the clock.
    run_config : Path, optional
        File for the configuration of the logs; default: ``<out>_run.toml``.

    Raises
    ------
    ConfigError
        Where the exports are not as declared, or something in place must not be overwritten.
    DataError
        Where a file cannot be read.
    NoDataError
        Where the exports hold no value of the required columns.
    """
    spec = spec_of(config)
    run_config = run_config or run_config_of(out)
    text = config_for_logs(config)
    _refuse_place(out, exports)
    there = _standing(run_config, text)
    if there == "other" and not force:
        _refuse_overwriting(run_config)
    try:
        tables = read_exports(exports, spec)
        gathered = gather(tables, spec)
    except UndeclaredError as error:
        more = "" if "rivid sniff" in str(error) else "; `rivid sniff` proposes an [input] block"
        raise ConfigError(f"{error}{more}") from None
    columns = canonical(gathered.series, spec)
    for series in gathered.series.values():
        series.statuses[series.statuses == ValueStatus.USED] = ValueStatus.OUTSIDE
    dates = [d for d in dates_of(columns, gathered, spec) if (first or d) <= d <= (last or d)]
    today = today or dt.datetime.now(gathered.zone).date()
    if there == "own" and not force:  # it is brought up to date next to logs that stay as they are
        for date in dates:
            day = judge(date, columns, gathered, spec, today)
            if (
                day.status == "good"
                and _standing_log(out / f"{date}.{format}", _bytes_of(day, gathered, format)[0])[0]
                == "differs"
            ):
                _refuse_overwriting(run_config)
    results = []
    for date in dates:
        day = judge(date, columns, gathered, spec, today)
        results.append(_finish(day, gathered, out, format, force=force, dry_run=dry_run))
    written = any(result.status in ("written", "identical") for result in results)
    if there != "same" and not dry_run and written:
        write_text(run_config, text)
    return Outcome(results, ledger_of(tables, gathered), run_config, _notes(tables))


def _finish(
    day: DayLog, gathered: Gathered, out: Path, format: Format, *, force: bool, dry_run: bool
) -> DayResult:
    """Write a good day, and set the status of its values."""
    if day.status != "good":
        day.settle(ValueStatus.REFUSED if day.status == "refused" else ValueStatus.PENDING)
        return DayResult(day.date, day.status, day.reason)
    data, count = _bytes_of(day, gathered, format)
    path = out / f"{day.date}.{format}"
    status, name, reason = "written", path.name, ""
    if not dry_run:
        status, name = _standing_log(path, data)
        plain = name == path.name and path.is_file() and not path.is_symlink()
        if status == "absent" or (status == "differs" and force and plain):
            with replacing(path) as scratch:
                scratch.write_bytes(data)
            status = "written"
    if status == "differs":
        reason = f"{name} is there and differs: --force writes it again"
        if name != path.name:
            reason = f"{name} is there already: take it away, or choose its --format"
    day.settle(ValueStatus.STANDING if status == "differs" else ValueStatus.USED)
    return DayResult(day.date, status, reason, name, count, day.n_filled)


def _bytes_of(day: DayLog, gathered: Gathered, format: Format) -> tuple[bytes, int]:
    """The log of a good day as a file, and how many rows it has."""
    there = np.any([np.isfinite(values) for values in day.columns.values()], axis=0)
    columns = {name: values[there] for name, values in day.columns.items()}
    return rows_as_bytes(day.times[there], columns, gathered.zone, format), int(there.sum())


def _standing_log(path: Path, data: bytes) -> tuple[str, str]:
    """Whether the log of a day is "absent", "identical", or one that "differs"; and its file name."""
    stem = path.name[:10]
    for other in (path.with_name(f"{stem}{suffix}") for suffix in SUFFIXES):
        if other != path and (other.exists() or other.is_symlink()):
            return "differs", other.name
    if not path.exists() and not path.is_symlink():
        return "absent", path.name
    plain = path.is_file() and not path.is_symlink()
    same = plain and path.stat().st_size == len(data) and path.read_bytes() == data
    return "identical" if same else "differs", path.name


def _refuse_place(out: Path, exports: Sequence[Path]) -> None:
    """Refuse a directory in which the logs would mix with others, or with the exports."""
    if out.exists() and not out.is_dir():
        raise ConfigError(f"--out {shown(str(out))} is a file: expected a directory")
    here = out.resolve()
    for export in exports:
        if export.resolve().parent == here and suffix_of(export.name):
            raise ConfigError(
                f"{shown(str(export))} lies in {shown(str(out))}, where `rivid run` would take it for a log: "
                "choose another --out"
            )
    for path in sorted(out.iterdir()) if out.is_dir() else ():
        if suffix_of(path.name) and not path.name.startswith(".") and not is_day_file(path.name):
            raise ConfigError(
                f"{shown(str(out))} holds {shown(path.name)}, which would mix with the days: choose an empty "
                "directory, or one of daily logs"
            )


def _notes(tables: Sequence[Table]) -> list[str]:
    others = Counter[str]()
    unread: dict[str, None] = {}
    for table in tables:
        others += table.others
        unread |= dict.fromkeys(table.cells)
    notes = []
    if unread:
        notes.append(f"columns not read: {', '.join(name[:40] for name in unread)}")
    if footers := sum(table.footers for table in tables):
        notes.append(f"last lines of files that hold no data (footer_rows): {footers:,d} passed over")
    if others:
        tags = ", ".join(f"{tag[:40]} ({count:,d} rows)" for tag, count in others.most_common(12))
        notes.append(f"tags not asked for: {tags}{', ...' if len(others) > 12 else ''}")
    return notes


def run_config_of(out: Path) -> Path:
    """The file for the configuration of the logs, unless another is chosen."""
    place = out.resolve()
    return place.with_name(f"{place.name}_run.toml")


def config_for_logs(config: Config) -> str:
    """TOML for the written logs: `[input]` without the exports' keys; ConfigError if the rest disagrees."""
    raw = config.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    given = raw.pop("input", {})
    own = {key: given[key] for key in KEPT if key in given}
    if config.input.u_Qo == "" and config.reach.kind == "pool":
        own["u_Qo"] = ""
    if config.input.interval:
        own["interval"] = dict(config.input.interval)
    reach = {"reach": raw.pop("reach")} if "reach" in raw else {}
    raw = reach | {"input": own} | raw
    parse(raw, Config, "the configuration for the logs")
    body = tomli_w.dumps({section: entries for section, entries in raw.items() if entries})
    return _first_line(body) + body


def _first_line(body: str) -> str:
    """The first line of a configuration that ingest writes; its digest shows whether the rest was edited."""
    mark = sha256(body.encode()).hexdigest()[:12]
    return (
        f"# Written by `rivid ingest` for the logs it made of the exports; it keeps this up to date. {mark}\n"
    )


def _standing(path: Path, text: str) -> str:
    """Whether a configuration is "absent", the "same", ingest's "own" but different, or any "other"."""
    if not path.exists():
        return "absent"
    try:
        there = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return "other"
    first, _, body = there.partition("\n")
    return "same" if there == text else "own" if f"{first}\n" == _first_line(body) else "other"


def _refuse_overwriting(path: Path) -> None:
    """Refuse to overwrite an edited configuration, or one that other logs are read with."""
    raise ConfigError(
        f"{shown(str(path))} exists and differs: --force overwrites it and differing days again, "
        "--run-config writes it elsewhere"
    )
