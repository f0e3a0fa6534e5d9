"""The days in DATA_DIR: a file a day, or files of many days; changes are found by content."""

import datetime as dt
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from rivid.config import Config
from rivid.errors import ConfigError, DataError, NoDataError
from rivid.logs.files import DAY, SUFFIXES, is_day_file, shown, suffix_of
from rivid.logs.log import load
from rivid.logs.spec import Spec, spec_of
from rivid.types import ONE_DAY


@dataclass(frozen=True)
class Part:
    """The part of one file that is of one day."""

    path: str  # relative to the root, with ``/``
    # SHA-256 (hex) of what matters for that day: of the file, or of that day's rows in a file of many
    # days
    digest: str

    @property
    def name(self) -> str:
        """File name for messages."""
        return shown(self.path)

    def closes(self, date: dt.date) -> bool:
        """Whether it is the next day's file, of which only the rows that close `date` count."""
        return is_day_file(self.path) and self.path[:10] != date.isoformat()


@dataclass(frozen=True)
class DaySource:
    """A day and the files that hold a part of it."""

    date: dt.date
    parts: tuple[Part, ...]


@dataclass(frozen=True)
class FileFacts:
    """What is known of a file; stored, so that it is not hashed and opened again."""

    # a file whose size, modification time and change time are the same is not hashed again. The change
    # time cannot be set: it finds a file whose modification time was restored
    size: int
    mtime_ns: int
    ctime_ns: int
    digest: str  # SHA-256 (hex) of the file
    # of a file of many days: ISO date and digest of each. Empty for a day's file that holds no more
    # than the row at its midnight
    days: tuple[tuple[str, str], ...] | None = None
    settings: str = ""  # digest of the settings that this was found with
    # of `days`, those of which the file holds no more than the row at one of their midnights
    edges: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        days = None if self.days is None else [list(day) for day in self.days]
        return {**self.__dict__, "days": days, "edges": list(self.edges)}

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> "FileFacts":
        """The inverse of :meth:`to_json`."""
        days = value.get("days")
        return cls(
            int(value["size"]),
            int(value["mtime_ns"]),
            int(value.get("ctime_ns", -1)),
            str(value["digest"]),
            None if days is None else tuple((str(date), str(digest)) for date, digest in days),
            str(value.get("settings", "")),
            tuple(map(str, value.get("edges", ()))),
        )


@dataclass(frozen=True)
class Catalog:
    """The content of DATA_DIR.

    Attributes
    ----------
    days : list of DaySource
        In date order.
    bad_files : list of (str, str)
        Relative path, printable, and reason, of files of no day.
    files : dict of FileFacts
        By relative path.
    """

    days: list[DaySource]
    bad_files: list[tuple[str, str]] = field(default_factory=list)
    files: dict[str, FileFacts] = field(default_factory=dict)


FEW_ROWS, FEW_BYTES = 4, 8192
"""A day's file of more rows or bytes holds more than the single row at its midnight, and is not opened."""


def find_days(
    root: Path, config: Config, known: Mapping[str, FileFacts] | None = None, *, verify: bool = False
) -> Catalog:
    """List the days in a directory of logs.

    Hidden files and files that are no logs are ignored.

    Parameters
    ----------
    root : Path
        DATA_DIR, or one file.
    config : Config
    known : mapping of str to FileFacts, optional
        The `files` of an earlier catalog.
    verify : bool
        Hash every file, also where size and modification time are as known.

    Returns
    -------
    Catalog

    Raises
    ------
    NoDataError
        Where there is no log.
    ConfigError
        Where the configuration is for exports of the long layout.
    """
    key = 'layout = "long"' if config.input.layout == "long" else "hold" if config.input.hold else ""
    if key:
        raise ConfigError(
            f"[input] {key} is for exports: make daily logs of them with `rivid ingest` first, and use the "
            "configuration that it writes with these"
        )
    paths, folder = _candidates(root, shown(str(root)))
    within = os.path.realpath(folder) if folder == root else None
    spec = spec_of(config)
    settings = spec.digest
    parts: dict[dt.date, list[Part]] = {}
    bad: list[tuple[str, str]] = []
    files: dict[str, FileFacts] = {}
    next_files: dict[dt.date, list[Part]] = {}
    edges: list[tuple[dt.date, Part]] = []
    for path in paths:
        name = path.name
        try:
            files[name] = facts = _look(path, within, spec, settings, (known or {}).get(name), verify)
        except DataError as error:
            bad.append((shown(name), _without_name(str(error), shown(name))))
            continue
        if is_day_file(name):
            date, part = _date_of(name), Part(name, facts.digest)
            next_files.setdefault(date - ONE_DAY, []).append(part)
            if facts.days is None:
                parts.setdefault(date, []).append(part)
            continue
        for iso, digest in facts.days or ():
            date, part = dt.date.fromisoformat(iso), Part(name, digest)
            if iso in facts.edges:
                edges.append((date, part))
            else:
                parts.setdefault(date, []).append(part)
    for date, part in edges:
        if date in parts:  # a row at midnight alone makes no day; with others it may complete one
            parts[date].append(part)
    if spec.latest:
        for date in parts:  # the row that closes it may be in the next day's file
            parts[date] += next_files.get(date, [])
    if not parts:
        _refuse_empty(shown(str(root)), bool(files), bad)
    return Catalog([DaySource(date, tuple(parts[date])) for date in sorted(parts)], bad, files)


def _refuse_empty(root: str, any_file: bool, bad: list[tuple[str, str]]) -> None:
    if any_file:
        raise NoDataError(f"no log in {root} holds more of a day than the row at its midnight")
    if bad:
        raise NoDataError(f"no log in {root} can be used: {bad[0][0]}: {bad[0][1]}")
    names = ", YYYY-MM-DD".join(SUFFIXES)
    raise NoDataError(
        f"no logs in {root}: looked for YYYY-MM-DD{names}, or files of many days with these suffixes"
    )


def _candidates(root: Path, name: str) -> tuple[list[Path], Path]:
    """Paths that may be logs, in order of name, and the folder they are in."""
    try:
        if root.is_file():
            if suffix_of(root.name) is None:
                raise NoDataError(
                    f"{name} is no log: expected a directory, or a file ending in {', '.join(SUFFIXES)}"
                )
            return [root], root.parent
        names = sorted(os.listdir(root))
    except OSError as error:
        raise NoDataError(f"{name} cannot be read: {error.strerror}; expected a directory of logs") from None
    return [root / name for name in names if suffix_of(name) and not name.startswith(".")], root


def _look(
    path: Path, inside: str | None, spec: Spec, settings: str, known: FileFacts | None, verify: bool
) -> FileFacts:
    """The facts of a file; a link must not lead out of `inside`."""
    try:
        status = os.lstat(path)
        if stat.S_ISLNK(status.st_mode):
            target = os.path.realpath(path, strict=True)
            if inside is not None and os.path.commonpath([inside, target]) != inside:
                raise DataError(
                    "is a link that leads out of the directory of logs: put the file itself there"
                )
            status = os.stat(path)
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror}") from None
    except ValueError:
        raise DataError("is a link to another drive: put the file itself there") from None
    if stat.S_ISDIR(status.st_mode):
        raise DataError("is a directory: expected a file")
    if not stat.S_ISREG(status.st_mode):
        raise DataError("is not a regular file")
    same = not verify and known is not None and (known.size, known.mtime_ns, known.ctime_ns) == _stamp(status)
    single = is_day_file(path.name)
    date = _date_of(path.name) if single else None
    if same and known is not None and known.settings == settings and (single or known.days is not None):
        return known
    if date is None:
        return _split(path, spec, status, settings)
    digest, rows = _hash(path, status.st_size)
    few = rows <= spec.input.skip_rows + spec.input.unit_rows + FEW_ROWS
    days = () if spec.latest and few and _is_edge(path, spec, date) else None
    return FileFacts(*_stamp(status), digest, days, settings)


def _stamp(status: os.stat_result) -> tuple[int, int, int]:
    """Size, modification time and change time of a file."""
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _is_edge(path: Path, spec: Spec, date: dt.date) -> bool:
    """Whether a day's file holds no more than the row at its midnight: an end of the day before."""
    try:
        log = load(path, shown(path.name), spec, fresh=True)
    except DataError:
        return False
    start, end = log.bounds(date)
    return log.is_edge(date) and start <= log.times[0] and log.times[-1] < end


def _split(path: Path, spec: Spec, status: os.stat_result, settings: str) -> FileFacts:
    """The days of a file of many."""
    log = load(path, shown(path.name), spec, fresh=True)
    dates = log.dates()
    days = tuple((date.isoformat(), log.digest_of(date)) for date in dates)
    if not days:
        raise DataError("has no values in the required columns")
    edges = tuple(date.isoformat() for date in dates if log.is_edge(date))
    return FileFacts(*_stamp(status), log.digest, days, settings, edges)


def _date_of(name: str) -> dt.date:
    try:
        return dt.date.fromisoformat(name[:10])
    except ValueError:
        raise DataError(f"{name[:10]} is no date: expected YYYY-MM-DD") from None


def _hash(path: Path, size: int) -> tuple[str, int]:
    """Digest of a day's file, and about how many lines it has, or bytes where they cannot be counted.

    One beyond the limit of size is not read: its data will not be either.
    """
    if size > DAY.bytes:
        return sha256(f"too large: {size}".encode()).hexdigest(), size
    try:
        with open(path, "rb", buffering=0) as file:
            content = file.read(size + 1)
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror}") from None
    packed = suffix_of(path.name) != ".csv"
    rows = max(size - FEW_BYTES, 0) if packed else content.count(b"\n")
    return sha256(content).hexdigest(), rows


def _without_name(reason: str, name: str) -> str:
    """The reason without the file name that it begins with: both are shown together."""
    return reason.removeprefix(name).lstrip(" ,:") or reason
