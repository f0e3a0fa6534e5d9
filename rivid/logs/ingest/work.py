"""The configuration with which the logs that were written are read: `[input]` says no more of the exports."""

import datetime as dt
import difflib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rivid.atomic import replacing, write_text
from rivid.config import Config, parse
from rivid.errors import ConfigError, NoDataError
from rivid.logs.catalog import is_day_file
from rivid.logs.files import SUFFIXES, shown, suffix_of
from rivid.logs.header import UndeclaredError
from rivid.logs.ingest.days import DayLog, canonical, dates_of, judge, settle
from rivid.logs.ingest.export import Export, read_export
from rivid.logs.ingest.series import Fate, FileCount, Gathered, Ledger, gather
from rivid.logs.spec import Spec, spec_of
from rivid.logs.write import Format, rows_as_bytes

KEPT = ("time_zone", "max_gap", "max_filled", "not_sentinels")
"""What says how days are made of values, not what a file looks like."""


def settings_for_logs(config: Config) -> str:
    """A configuration, as TOML, for the logs made of exports.

    Parameters
    ----------
    config : Config
        Of the exports.

    Raises
    ------
    ConfigError
        Where the rest of the configuration cannot do with that `[input]`.
    """
    raw = config.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    given = raw.pop("input", {})
    own = {key: given[key] for key in KEPT if key in given}
    if config.input.u_Qo == "" and config.reach.kind == "pool":
        own["u_Qo"] = ""
    intervals = {name: seconds for name, seconds in config.input.interval.items()}
    if intervals:
        own["interval"] = intervals
    raw = {key: value for key, value in raw.items() if key in ("reach",)} | {"input": own} | raw
    parse(raw, Config, "the configuration for the logs")
    lines: list[str] = []
    for section, entries in raw.items():
        if entries:
            lines += ["", *_table(section, entries)]
    body = "\n".join(lines) + "\n"
    return _first_line(body) + body


def _first_line(body: str) -> str:
    """The first line of what ingest writes: it tells, of the rest, whether people have changed it."""
    mark = sha256(body.encode()).hexdigest()[:12]
    return (
        f"# Written by `rivid ingest` for the logs it made of the exports; it keeps this up to date. {mark}\n"
    )


def _table(name: str, entries: dict[str, Any]) -> list[str]:
    inner = {key: value for key, value in entries.items() if isinstance(value, dict)}
    lines = [f"[{name}]"]
    lines += [f"{key} = {_said(value)}" for key, value in entries.items() if key not in inner]
    for key, value in inner.items():
        if value:
            lines += ["", *_table(f"{name}.{key}", value)]
    return lines


def _said(value: Any) -> str:
    # JSON strings, numbers and lists are TOML ones too, but for escapes that JSON alone knows
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")


Standing = Literal["absent", "same", "own", "other"]


def standing(path: Path, text: str) -> Standing:
    """What is there in place of the settings: nothing, the same, others that ingest wrote, or others."""
    if not path.exists():
        return "absent"
    try:
        there = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return "other"
    if there == text:
        return "same"
    first, _, body = there.partition("\n")
    return "own" if f"{first}\n" == _first_line(body) else "other"


def refuse_settings(path: Path) -> None:
    """Refuse to overwrite unasked what people wrote, or what other logs are read with.

    Raises
    ------
    ConfigError
    """
    raise ConfigError(
        f"{shown(str(path))} is there and says otherwise: --force writes it and differing days again, "
        "--run-config writes it elsewhere"
    )


def write_settings(path: Path, text: str) -> None:
    """Write it whole or not at all."""
    write_text(path, text)


Written = Literal["written", "identical", "differs"]


def refuse_place(out: Path, exports: Sequence[Path]) -> None:
    """Refuse a directory in which the logs would mix with others, or with the exports.

    Raises
    ------
    ConfigError
    """
    if out.exists() and not out.is_dir():
        raise ConfigError(f"--out {shown(str(out))} is a file: expected a directory")
    here = out.resolve()
    for export in exports:
        if export.resolve().parent == here and suffix_of(export.name):
            raise ConfigError(
                f"{shown(str(export))} lies in {shown(str(out))}, where `rivid run` would take it for a log: "
                "choose another --out"
            )
    if not out.is_dir():
        return
    for path in sorted(out.iterdir()):
        if suffix_of(path.name) and not path.name.startswith(".") and not is_day_file(path.name):
            raise ConfigError(
                f"{shown(str(out))} holds {shown(path.name)}, which would mix with the days: choose an empty "
                "directory, or one of daily logs"
            )


def differs(out: Path, date: dt.date, format: str, data: bytes) -> bool:
    """Whether a log of that day is there, and another one."""
    path = out / f"{date}.{format}"
    there = [out / f"{date}{suffix}" for suffix in SUFFIXES]
    if any(other.exists() or other.is_symlink() for other in there if other != path):
        return True
    if path.is_symlink() or (path.exists() and not path.is_file()):
        return True
    return path.is_file() and (path.stat().st_size != len(data) or path.read_bytes() != data)


def put(out: Path, date: dt.date, format: str, data: bytes, *, force: bool) -> tuple[Written, str]:
    """Write a day's log.

    Parameters
    ----------
    out : Path
    date : date
    format : str
        csv, csv.gz or parquet.
    data : bytes
    force : bool
        Overwrite a log of that day that differs.

    Returns
    -------
    (str, str)
        "written", "identical" (it was there, byte by byte), or "differs" (another is there, and stays); and
        the name of the file in question.

    Raises
    ------
    RividError
        Where the disk refuses.
    """
    path = out / f"{date}.{format}"
    for suffix in SUFFIXES:
        other = out / f"{date}{suffix}"
        if other != path and other.exists():
            return "differs", other.name
    if path.is_symlink() or (path.exists() and not path.is_file()):
        return "differs", path.name
    if path.is_file():
        if path.stat().st_size == len(data) and path.read_bytes() == data:
            return "identical", path.name
        if not force:
            return "differs", path.name
    with replacing(path) as scratch:
        scratch.write_bytes(data)
    return "written", path.name


SNIFF = "`rivid sniff` proposes an [input] block"


@dataclass(frozen=True)
class Wish:
    """How to ingest.

    Attributes
    ----------
    format : {"csv", "csv.gz", "parquet"}
    first, last : date or None
        Local days that are asked for; None: from the beginning, to the end.
    force : bool
        Overwrite what differs.
    dry_run : bool
        Write nothing.
    today : date or None
        Of this day on, a log may be unfinished; None: of the clock.
    run_config : Path or None
        Where the configuration for the logs goes; None: beside `out`, ``<out>_run.toml``.
    """

    format: Format = "csv"
    first: dt.date | None = None
    last: dt.date | None = None
    force: bool = False
    dry_run: bool = False
    today: dt.date | None = None
    run_config: Path | None = None


@dataclass(frozen=True)
class DayResult:
    """What became of a day: written, identical, refused, pending, or differs (another log stays in place)."""

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
    """What an ingest did.

    Attributes
    ----------
    days : list of DayResult
        In date order.
    ledger : Ledger
    run_config : Path
    notes : list of str
        Tags and columns that were passed over.
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


def ingest(exports: Sequence[Path], out: Path, config: Config, wish: Wish | None = None) -> Outcome:
    """Make daily logs of exports.

    The configuration that it wrote beside the logs is written again where nothing but that changes; where
    logs differ, or people have edited it, it stays.

    Parameters
    ----------
    exports : sequence of Path
        Files of one dialect.
    out : Path
        DATA_DIR.
    config : Config
    wish : Wish, optional

    Returns
    -------
    Outcome

    Raises
    ------
    ConfigError
        Where the exports are not as declared, or something in place must not be overwritten.
    DataError
        Where a file cannot be read.
    NoDataError
        Where the exports hold no value that is asked for."""
    wish, spec = wish or Wish(), spec_of(config)
    run_config = wish.run_config or run_config_beside(out)
    text = settings_for_logs(config)
    refuse_place(out, exports)
    there = standing(run_config, text)
    if there == "other" and not wish.force:
        refuse_settings(run_config)
    read = _read(exports, spec)
    try:
        gathered = gather(read, spec)
    except UndeclaredError as error:
        raise ConfigError(str(error)) from None
    columns = canonical(gathered.series, spec)
    for series in gathered.series.values():
        series.fates[series.fates == Fate.USED] = Fate.OUTSIDE
    dates = [
        date
        for date in dates_of(columns, gathered, spec)
        if (wish.first or date) <= date <= (wish.last or date)
    ]
    today = wish.today or dt.datetime.now(gathered.zone).date()
    if (
        there == "own" and not wish.force
    ):  # its own file is brought up to date, beside logs that stay as they are
        for date in dates:
            day = judge(date, columns, gathered, spec, today)
            if day.status == "good" and differs(out, date, wish.format, _bytes_of(day, gathered, wish)[0]):
                refuse_settings(run_config)
    results = []
    for date in dates:
        day = judge(date, columns, gathered, spec, today)
        results.append(_finish(day, gathered, out, wish))
    if (
        there != "same"
        and not wish.dry_run
        and any(result.status in ("written", "identical") for result in results)
    ):
        write_settings(run_config, text)
    return Outcome(results, _ledger(read, gathered), run_config, _notes(read))


def run_config_beside(out: Path) -> Path:
    """Where the configuration for the logs goes, unless said otherwise."""
    place = out.resolve()
    return place.with_name(f"{place.name}_run.toml")


def _read(exports: Sequence[Path], spec: Spec) -> list[Export]:
    """All files; what none of them holds is said before any work."""
    read = []
    try:
        for path in dict.fromkeys(exports):
            read.append(read_export(path, spec))
        found = {name for export in read for columns in export.parts for name in columns.numbers}
        for export in read:
            # an export of other tags is no fault; one that was to be read, and of which no row can be, is
            if export.lacking and (not found or not export.seen.others):
                raise UndeclaredError(f"{export.name}, {export.lacking}")
        for signal in spec.signals:
            for source in signal.sources:
                if source not in found:
                    unread = {name for e in read for name in (*e.seen.others, *e.seen.cells)}
                    near = difflib.get_close_matches(source, unread, n=1, cutoff=0.3)
                    nearest = f"; nearest is {near[0]!r}" if near else ""
                    said = f"no export holds {source!r} for {signal.name}{nearest}"
                    raise UndeclaredError(f"{said}: set [input] {signal.name} to the export's own name")
    except UndeclaredError as error:
        more = "" if "rivid sniff" in str(error) else f"; {SNIFF}"
        raise ConfigError(f"{error}{more}") from None
    return read


def _finish(day: DayLog, gathered: Gathered, out: Path, wish: Wish) -> DayResult:
    """Write a good day, and enter what became of its values."""
    if day.status != "good":
        settle(day, Fate.REFUSED if day.status == "refused" else Fate.PENDING)
        return DayResult(day.date, day.status, day.reason)
    data, count = _bytes_of(day, gathered, wish)
    status, name = "written", f"{day.date}.{wish.format}"
    if not wish.dry_run:
        status, name = put(out, day.date, wish.format, data, force=wish.force)
    settle(day, Fate.STANDING if status == "differs" else Fate.USED)
    reason = ""
    if status == "differs":
        reason = f"{name} is there and differs: --force writes it again"
        if name != f"{day.date}.{wish.format}":
            reason = f"{name} is there already: take it away, or choose its --format"
    return DayResult(day.date, status, reason, name, count, day.n_filled)


def _bytes_of(day: DayLog, gathered: Gathered, wish: Wish) -> tuple[bytes, int]:
    """The log of a good day as a file, and how many rows it has."""
    there = np.any([np.isfinite(values) for values in day.columns.values()], axis=0)
    columns = {name: values[there] for name, values in day.columns.items()}
    return rows_as_bytes(day.times[there], columns, gathered.zone, wish.format), int(there.sum())


def _ledger(read: Sequence[Export], gathered: Gathered) -> Ledger:
    ledger = Ledger()
    for name, series in gathered.series.items():
        ledger.count(name, series.fates, series.unreadable, series.unsorted)
    for export in read:
        seen = export.seen
        for columns in export.parts:
            ledger.flags += columns.flags
        unreadable = seen.rows - seen.others.total() - _good_rows(export)
        ledger.files.append(
            FileCount(
                export.name,
                seen.rows,
                unreadable,
                seen.comments,
                seen.headers,
                seen.empty,
                seen.others,
                seen.footers,
            )
        )
    return ledger


def _good_rows(export: Export) -> int:
    return sum(len(columns.times) for columns in export.parts)


def _notes(read: Sequence[Export]) -> list[str]:
    others = Counter[str]()
    unread: dict[str, None] = {}
    for export in read:
        others += export.seen.others
        unread |= dict.fromkeys(export.seen.cells)
    notes = []
    if unread:
        notes.append(f"columns not read: {', '.join(name[:40] for name in unread)}")
    if footers := sum(export.seen.footers for export in read):
        notes.append(f"last lines of files that hold no data (footer_rows): {footers:,d} passed over")
    if others:
        tags = ", ".join(f"{tag[:40]} ({count:,d} rows)" for tag, count in others.most_common(12))
        notes.append(f"tags not asked for: {tags}{', ...' if len(others) > 12 else ''}")
    return notes
