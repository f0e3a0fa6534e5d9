"""What a check has found: of a day, of many days, of the whole record; and dates in words."""

import datetime as dt
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from rivid.types import ONE_DAY

Status = Literal["ok", "pending", "failed"]
MOST_RANGES = 4
"""Spans of dates that a sentence names; the rest is a number."""


@dataclass(frozen=True)
class Finding:
    """Something that looks wrong, said once for all the days that it is true of.

    Attributes
    ----------
    kind : str
        A word for machines: unit, balance, swapped, clock, drift, dates, stuck, jump, spike, copy, constant,
        negative, interval, summer time,
        future, moment.
    text : str
        In words, without the dates.
    days : dict of date to str
        The days it is true of, each with its own numbers in words; empty for the whole record.
    wrong : bool
        Whether something must be done about it; a remark otherwise.
    """

    kind: str
    text: str
    days: dict[dt.date, str] = field(default_factory=dict)
    wrong: bool = True

    def __str__(self) -> str:
        """In words, with the dates."""
        return f"{dates_in_words(self.days)}: {self.text}" if self.days else self.text

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {
            "kind": self.kind,
            "text": str(self),
            "wrong": self.wrong,
            "days": {str(date): words for date, words in sorted(self.days.items())},
        }


@dataclass(frozen=True)
class DayReport:
    """One day.

    Attributes
    ----------
    date : date
    status : {"ok", "pending", "failed"}
    reason : str
        Why it cannot be used; empty where it can.
    notes : list of str
        What was filled, dropped or masked, and what looks odd.
    n_samples, n_filled : int
    """

    date: dt.date
    status: Status
    reason: str = ""
    notes: list[str] = field(default_factory=list)
    n_samples: int = 0
    n_filled: int = 0


@dataclass(frozen=True)
class Report:
    """All days, the files that speak of none, the days without a log, and what looks wrong."""

    days: list[DayReport]
    bad_files: list[tuple[str, str]]
    absent: list[dt.date]
    findings: list[Finding]

    def count(self, status: Status) -> int:
        """Days of a status."""
        return sum(day.status == status for day in self.days)

    @property
    def failed(self) -> int:
        """Days that cannot be used."""
        return self.count("failed")

    @property
    def warnings(self) -> list[str]:
        """What is to be put right, in words."""
        return [str(finding) for finding in self.findings if finding.wrong]

    @property
    def exit_code(self) -> int:
        """0 where all is fine; 3 where a day failed, a file cannot be used, or something looks wrong."""
        return 3 if self.failed or self.bad_files or self.warnings else 0

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it, dates as text."""
        return {
            "days": [asdict(day) | {"date": str(day.date)} for day in self.days],
            "bad_files": [list(bad) for bad in self.bad_files],
            "absent": [str(day) for day in self.absent],
            "findings": [finding.to_json() for finding in self.findings],
            "warnings": self.warnings,
            "failed": self.failed,
            "summary": {
                "days": len(self.days),
                "first": str(self.days[0].date),
                "last": str(self.days[-1].date),
                "ok": self.count("ok"),
                "failed": self.failed,
                "pending": self.count("pending"),
                "absent": len(self.absent),
                "bad_files": len(self.bad_files),
                "samples": sum(day.n_samples for day in self.days),
                "filled": sum(day.n_filled for day in self.days),
                "warnings": len(self.warnings),
                "exit_code": self.exit_code,
            },
        }


def dates_in_words(dates: Iterable[dt.date]) -> str:
    """Spans of consecutive dates, the longest list of them cut short, and how many days they are.

    Examples
    --------
    >>> dates_in_words([dt.date(2008, 3, 1), dt.date(2008, 3, 2), dt.date(2008, 3, 9)])
    '2008-03-01 to 2008-03-02, 2008-03-09 (3 days)'
    """
    ordered = sorted(dates)
    spans: list[list[dt.date]] = []
    for date in ordered:
        if spans and date - spans[-1][1] == ONE_DAY:
            spans[-1][1] = date
        else:
            spans.append([date, date])
    words = [f"{first} to {last}" if first != last else f"{first}" for first, last in spans[:MOST_RANGES]]
    more = ", ..." if len(spans) > MOST_RANGES else ""
    count = f" ({len(ordered)} days)" if len(ordered) > 1 else ""
    return ", ".join(words) + more + count


def times(ratio: float) -> str:
    """A factor in words.

    Examples
    --------
    >>> times(35.31), times(999.7)
    ('35.3', '1,000')
    """
    return f"{ratio:.3g}" if ratio < 999.5 else f"{ratio:,.0f}"


def hours(seconds: float) -> str:
    """A span of time in words: minutes below two hours.

    Examples
    --------
    >>> hours(3600), hours(86400 / 4)
    ('60 min', '6.0 h')
    """
    return f"{seconds / 60:.0f} min" if abs(seconds) < 7200 else f"{seconds / 3600:.1f} h"
