"""What is known of DATA_DIR: the days, the files that speak of each, and what spares looking twice."""

import datetime as dt
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rivid.logs.files import shown, suffix_of

_DAY_NAME = re.compile(r"\d{4}-\d\d-\d\d")


def is_day_file(path: str) -> bool:
    """Whether a log's name says that it is of one day."""
    suffix = suffix_of(path)
    return suffix is not None and _DAY_NAME.fullmatch(path[: -len(suffix)]) is not None


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

    def closes(self, date: dt.date) -> bool:
        """Whether it is the next day's file, of which only the rows that close `date` count."""
        return is_day_file(self.path) and self.path[:10] != date.isoformat()


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
        Of a file of many days: ISO date and digest of each. Empty for a day's file that holds no more
        than the row at its midnight.
    settings : str
        Digest of the settings that this was found with.
    edges : tuple of str
        Of `days`, those of which the file holds no more than the row at one of their midnights.
    """

    size: int
    mtime_ns: int
    digest: str
    days: tuple[tuple[str, str], ...] | None = None
    settings: str = ""
    edges: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        days = None if self.days is None else [list(day) for day in self.days]
        return {
            "size": self.size,
            "mtime_ns": self.mtime_ns,
            "digest": self.digest,
            "days": days,
            "settings": self.settings,
            "edges": list(self.edges),
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
            tuple(map(str, value.get("edges", ()))),
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
