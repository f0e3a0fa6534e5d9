"""Find the days in DATA_DIR: a file a day, or files of many days; by content, never by time alone."""

import datetime as dt
import os
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from rivid.config import Config
from rivid.errors import DataError, NoDataError
from rivid.logs.files import DAY, MANY, SUFFIXES, shown, suffix_of

_DAY_NAME = re.compile(r"\d{4}-\d\d-\d\d")
LOOKED_FOR = f"YYYY-MM-DD{', YYYY-MM-DD'.join(SUFFIXES)}, or files of many days with these suffixes"


@dataclass(frozen=True)
class Part:
    """What one file says of one day.

    Attributes
    ----------
    path : str
        Relative to the root, with ``/``.
    digest : str
        SHA-256 (hex) of what matters for that day: of the file, or of that day's rows in a file of many days.
    """

    path: str
    digest: str

    @property
    def name(self) -> str:
        """How messages call the file."""
        return shown(self.path)


@dataclass(frozen=True)
class DaySource:
    """A day and the files that speak of it."""

    date: dt.date
    parts: tuple[Part, ...]


@dataclass(frozen=True)
class FileFacts:
    """What is known of a file, to spare hashing and opening it again.

    Attributes
    ----------
    size, mtime_ns : int
        Where these have not changed, neither has the file, as far as one cares to look.
    digest : str
        SHA-256 (hex) of the file.
    days : tuple of (str, str), or None
        Of a file of many days: ISO date and digest of each.
    settings : str
        Digest of the settings that `days` was found with.
    """

    size: int
    mtime_ns: int
    digest: str
    days: tuple[tuple[str, str], ...] | None = None
    settings: str = ""

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        days = None if self.days is None else [list(day) for day in self.days]
        return {
            "size": self.size,
            "mtime_ns": self.mtime_ns,
            "digest": self.digest,
            "days": days,
            "settings": self.settings,
        }

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> "FileFacts":
        """The inverse of :meth:`to_json`."""
        days = value.get("days")
        return cls(
            int(value["size"]),
            int(value["mtime_ns"]),
            str(value["digest"]),
            None if days is None else tuple((str(date), str(digest)) for date, digest in days),
            str(value.get("settings", "")),
        )


@dataclass(frozen=True)
class Catalog:
    """What DATA_DIR holds.

    Attributes
    ----------
    days : list of DaySource
        In date order.
    bad_files : list of (str, str)
        Relative path, printable, and reason, of files that speak of no day.
    files : dict of FileFacts
        By relative path.
    """

    days: list[DaySource]
    bad_files: list[tuple[str, str]] = field(default_factory=list)
    files: dict[str, FileFacts] = field(default_factory=dict)


def is_day_file(path: str) -> bool:
    """Whether a log's name says that it is of one day."""
    suffix = suffix_of(path)
    return suffix is not None and _DAY_NAME.fullmatch(path[: -len(suffix)]) is not None


def find_days(
    root: Path, config: Config, known: Mapping[str, FileFacts] | None = None, *, verify: bool = False
) -> Catalog:
    """List the days in a directory of logs.

    Hidden files, directories and files that are no logs are passed over.

    Parameters
    ----------
    root : Path
        DATA_DIR, or one file.
    config : Config
    known : mapping of str to FileFacts, optional
        What an earlier look found.
    verify : bool
        Hash every file, also where size and modification time are as known.

    Returns
    -------
    Catalog

    Raises
    ------
    NoDataError
        Where there is no log.
    """
    paths, folder = _candidates(root, shown(str(root)))
    inside = os.path.realpath(folder)
    parts: dict[dt.date, list[Part]] = {}
    bad: list[tuple[str, str]] = []
    files: dict[str, FileFacts] = {}
    for path in paths:
        name = path.name
        try:
            facts = _look(path, inside if folder == root else None, config, (known or {}).get(name), verify)
        except DataError as error:
            bad.append((shown(name), _without_name(str(error), shown(name))))
            continue
        files[name] = facts
        if facts.days is None:
            parts.setdefault(_date_of(name), []).append(Part(name, facts.digest))
        for date, digest in facts.days or ():
            parts.setdefault(dt.date.fromisoformat(date), []).append(Part(name, digest))
    if not parts:
        if bad:
            raise NoDataError(f"no log in {shown(str(root))} can be used: {bad[0][0]}: {bad[0][1]}")
        raise NoDataError(f"no logs in {shown(str(root))}: looked for {LOOKED_FOR}")
    return Catalog([DaySource(date, tuple(parts[date])) for date in sorted(parts)], bad, files)


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


def _look(path: Path, inside: str | None, config: Config, known: FileFacts | None, verify: bool) -> FileFacts:
    """What a file is and says of which days; `inside` is where a link may lead."""
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
    same = (
        not verify
        and known is not None
        and (known.size, known.mtime_ns) == (status.st_size, status.st_mtime_ns)
    )
    if is_day_file(path.name):
        _date_of(path.name)
        if same and known is not None and known.days is None:
            return known
        return FileFacts(status.st_size, status.st_mtime_ns, _hash(path, status.st_size))
    from rivid.logs.spec import spec_of

    settings = spec_of(config).digest
    if same and known is not None and known.days is not None and known.settings == settings:
        return known
    return _split(path, config, status, settings)


def _split(path: Path, config: Config, status: os.stat_result, settings: str) -> FileFacts:
    """The days of a file of many."""
    from rivid.logs.load import load
    from rivid.logs.spec import spec_of

    log = load(path, shown(path.name), spec_of(config), MANY, fresh=True)
    days = tuple((date.isoformat(), log.digest_of(date)) for date in log.dates())
    if not days:
        raise DataError("has no values in the columns that are asked for")
    return FileFacts(status.st_size, status.st_mtime_ns, log.digest, days, settings)


def _date_of(name: str) -> dt.date:
    try:
        return dt.date.fromisoformat(name[:10])
    except ValueError:
        raise DataError(f"{name[:10]} is no date: expected YYYY-MM-DD") from None


def _hash(path: Path, size: int) -> str:
    """Digest of a day's file; one beyond the limits is not read for it, as it will not be for its data."""
    if size > DAY.bytes:
        return sha256(f"too large: {size}".encode()).hexdigest()
    try:
        with open(path, "rb", buffering=0) as file:
            return sha256(file.read(DAY.bytes + 1)).hexdigest()
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror}") from None


def _without_name(reason: str, name: str) -> str:
    """A reason that is shown beside the name need not begin with it."""
    return reason.removeprefix(name).lstrip(" ,:") or reason
