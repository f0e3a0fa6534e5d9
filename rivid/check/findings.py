"""What a check has found: of a day, of many days, of the whole record; and dates in words."""

import datetime as dt
import re
import textwrap
from collections.abc import Iterable, Iterator
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


WIDTH = 79


def in_words(report: Report, reach: str) -> str:
    """All that is to be said of a reach.

    Parameters
    ----------
    report : Report
    reach : str
        Its name.
    """
    lines = []
    files: dict[str, list[str]] = {}
    for path, reason in report.bad_files:
        files.setdefault(reason, []).append(path)
    for reason, paths in files.items():
        more = f" and {len(paths) - 1} more files" if len(paths) > 1 else ""
        lines.append(f"{paths[0]}{more} cannot be used: {reason}")
    lines += _alike([(day.date, f"failed: {day.reason}") for day in report.days if day.status == "failed"])
    lines += _alike([(day.date, f"pending: {day.reason}") for day in report.days if day.status == "pending"])
    lines += [f"wrong: {warning}" for warning in report.warnings]
    lines += [f"remark: {finding}" for finding in report.findings if not finding.wrong]
    lines += _alike([(day.date, note) for day in report.days for note in _of_reading(day, report)])
    text = "\n".join(_wrapped(line) for line in lines)
    return f"{text}\n\n{table(report, reach)}" if text else table(report, reach)


def table(report: Report, reach: str) -> str:
    """The counts."""
    filled = sum(day.n_filled for day in report.days)
    samples = sum(day.n_samples for day in report.days)
    noted = sum(day.status == "ok" and bool(day.notes) for day in report.days)
    rows = [
        ("days", f"{len(report.days)}, {report.days[0].date} to {report.days[-1].date}"),
        ("usable", f"{report.count('ok')}" + (f", of {noted} of them something is said" if noted else "")),
        ("failed", f"{report.failed}"),
        ("pending", f"{report.count('pending')}"),
        ("no log", dates_in_words(report.absent) if report.absent else "0 days"),
        ("bad files", f"{len(report.bad_files)}"),
        ("samples", f"{samples:,}, {filled:,} of them filled"),
        ("wrong", f"{len(report.warnings)}"),
    ]
    return "\n".join([reach, *(_wrapped(f"  {name:10s} {value}", 13) for name, value in rows)])


def in_a_line(report: Report, reach: str) -> str:
    """A reach that is fine."""
    remarks = sum(bool(day.notes) for day in report.days)
    said = f", {remarks} with remarks" if remarks else ""
    return f"{reach}: fine, {len(report.days)} days{said}"


def _of_reading(day: DayReport, report: Report) -> Iterator[str]:
    """The notes of a day that no finding says already."""
    said = {finding.days[day.date] for finding in report.findings if day.date in finding.days}
    return (note for note in day.notes if note not in said)


def _alike(lines: list[tuple[dt.date, str]]) -> list[str]:
    """Texts that differ in their numbers only are said once, with all their dates."""
    groups: dict[str, list[tuple[dt.date, str]]] = {}
    for date, text in lines:
        groups.setdefault(re.sub(r"\d+", "0", text), []).append((date, text))
    return [
        f"{dates_in_words(date for date, _ in group)} {group[0][1]}"
        + (", for one" if len({text for _, text in group}) > 1 else "")
        for group in groups.values()
    ]


def _wrapped(line: str, indent: int = 2) -> str:
    return textwrap.fill(
        line, WIDTH, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
