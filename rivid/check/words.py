"""A report in words, within 80 columns: what is wrong first, each thing once."""

import datetime as dt
import re
import textwrap
from collections.abc import Iterator

from rivid.check.findings import DayReport, Report, dates_in_words

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
