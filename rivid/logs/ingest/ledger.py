"""The account: of each source, how many values were read, how many are used, and why the others are not."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Fate(IntEnum):
    """What became of a value."""

    USED = 0
    MISSING = 1
    STATUS = 2
    FLAG = 3
    SENTINEL = 4
    TIME = 5
    DUPLICATE = 6
    UNMATCHED = 7
    BETWEEN = 8
    REFUSED = 9
    PENDING = 10
    OUTSIDE = 11
    STANDING = 12
    UNREADABLE = 13


WORDS = {
    Fate.MISSING: "missing",
    Fate.STATUS: "status text",
    Fate.FLAG: "flag",
    Fate.SENTINEL: "sentinel",
    Fate.TIME: "ambiguous or impossible time",
    Fate.DUPLICATE: "duplicate",
    Fate.UNMATCHED: "part of a sum missing",
    Fate.BETWEEN: "between samples",
    Fate.REFUSED: "refused day",
    Fate.PENDING: "unfinished day",
    Fate.OUTSIDE: "not asked for",
    Fate.STANDING: "other log in place",
    Fate.UNREADABLE: "unreadable row",
}
"""Reasons as the table and the JSON call them."""


@dataclass
class FileCount:
    """What one file held.

    Attributes
    ----------
    name : str
    rows, unreadable : int
        Of data; and of these, such as cannot be read.
    comments, headers, empty, footers : int
        Lines without data.
    others : Counter
        Rows of tags that are not asked for.
    """

    name: str
    rows: int
    unreadable: int
    comments: int
    headers: int
    empty: int
    others: Counter[str]
    footers: int = 0

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        named = {"file": self.name, "rows": self.rows, "unreadable_rows": self.unreadable}
        lines = {"comment_lines": self.comments, "repeated_headers": self.headers, "empty_lines": self.empty}
        lines["footer_lines"] = self.footers
        return named | lines | {"rows_of_other_tags": dict(self.others)}


@dataclass
class Ledger:
    """The account of an ingest.

    Attributes
    ----------
    sources : dict of Counter
        Per source, fates of its values; those of rows that cannot be read are counted once per source.
    unsorted : dict of int
        Per source, values that stood behind a later one and were sorted; they are not lost.
    flags : Counter
        Flags for which values were dropped.
    files : list of FileCount
    """

    sources: dict[str, Counter[Fate]] = field(default_factory=dict)
    unsorted: dict[str, int] = field(default_factory=dict)
    flags: Counter[str] = field(default_factory=Counter)
    files: list[FileCount] = field(default_factory=list)

    def count(self, source: str, fates: NDArray[np.int8], unreadable: int, unsorted: int) -> None:
        """Enter a source."""
        kinds, counts = np.unique(fates, return_counts=True)
        entry = Counter({Fate(k): int(n) for k, n in zip(kinds.tolist(), counts.tolist(), strict=True)})
        entry[Fate.UNREADABLE] += unreadable
        self.sources[source] = +entry
        self.unsorted[source] = unsorted

    @property
    def reasons(self) -> list[Fate]:
        """Reasons that occur, in their order."""
        return [fate for fate in WORDS if any(entry[fate] for entry in self.sources.values())]

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it: read = used + all that is dropped."""
        return {
            "sources": {
                name: told(entry) | {"sorted": self.unsorted[name]} for name, entry in self.sources.items()
            },
            "flags": dict(self.flags),
            "files": [file.to_json() for file in self.files],
        }

    def lines(self) -> Iterable[str]:
        """As a table."""
        names = [name[:24] for name in self.sources]
        widths = [max(len(name), 9) for name in names]
        yield "  ".join([f"{'values':28s}", *(f"{n:>{w}s}" for n, w in zip(names, widths, strict=True))])
        rows: list[tuple[str, list[int]]] = [("read", [entry.total() for entry in self.sources.values()])]
        rows += [(WORDS[fate], [entry[fate] for entry in self.sources.values()]) for fate in self.reasons]
        rows.append(("used", [entry[Fate.USED] for entry in self.sources.values()]))
        if any(self.unsorted.values()):
            rows.append(("out of order, sorted", list(self.unsorted.values())))
        for word, counts in rows:
            yield "  ".join([f"{word:28s}", *(f"{n:>{w},d}" for n, w in zip(counts, widths, strict=True))])


def told(entry: Mapping[Fate, int]) -> dict[str, Any]:
    """One source as JSON can hold it."""
    dropped = {WORDS[fate]: entry[fate] for fate in WORDS if entry.get(fate)}
    return {"read": sum(entry.values()), "used": entry.get(Fate.USED, 0), "dropped": dropped}
