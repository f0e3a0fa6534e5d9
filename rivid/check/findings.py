"""Findings of a check as codes and numbers, their wording, and the report on a terminal."""

import datetime as dt
import re
import string
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from rivid.text import count, day_range, spans

Status = Literal["ok", "pending", "failed"]
Values = Mapping[str, Any]

MOST_RANGES = 4  # spans of dates that are listed; the others are counted
MOST_ITEMS = 3  # events of a day that are listed; the others are counted
WIDTH = 79  # columns of the report

_STAMPED = "{column} is stamped {off_s:span} too {sense} against {reference}"
_TIMES = "{large} is {ratio:times} times {small}"
_RANGE = "[reach] discharge_range, {low:g} to {high:g}{is_declared:default}"
_VOLUME = (
    "h_L moves {ratio:multiple} u_Qi and u_Qo imply on [reach] {area_of} = {area:g} m2{is_declared:default}"
)
_BED = "the median of h_L is {median:.4g} m where [reach] bed_level is {bed:g} m: check [input.units] h_L"
_ROWS = "{columns} every {every}"
_PERIOD = "[reach] sample_time is {expected_s:g} s"
_COLUMN = "set [input.interval] {column} = {spacing_s:g}"
TEXTS = {
    "swapped.river": "{output} falls when u_Qi rises: is its sign reversed, or is it another column?",
    "swapped.flows": "h_L falls with u_Qi and rises with u_Qo, after {lag_s:span}: are inflow and outflow "
    "swapped? Check [input] u_Qi and u_Qo",
    "swapped.level": "h_L falls with u_Qi and rises with u_Qo: is it measured downwards, or are inflow and "
    "outflow swapped?",
    "dates": "the dates of {column} are a day too {sense}: it fits the other columns of the day {other_day}",
    "clock.hour": f"{_STAMPED}: is its clock an hour off, or does it keep summer time? Check time_zone and "
    "the logger",
    "clock.shift": f"{_STAMPED}: check the logger's clock",
    "clock.gate": "h_L answers u_Qo {off_s:span} too {sense}, although the gauge is at the gate: is the "
    "clock of {column} {off_s:span} {speed}?",
    "clock.before": "{output} moves {off_s:span} before u_Qi: is the clock of u_Qi fast, or are columns "
    "swapped?",
    "clock.slow": "h_L answers u_Qi after {lag_s:span}, where a wave takes at most {longest_s:span} over "
    "[reach] length = {length:g} m: is this too short, or the clock of u_Qi slow?",
    "drift": "the clock of {column} drifts: it becomes {speed} by {off_s:span} from {first} to {last}, "
    "{per_day_s:.0f} s a day, against the other columns",
    "unit.factor": f"{_TIMES}, and 1 {{declared}} is {{factor:times}} {{unit}}: is {{large}} in {{unit}}? "
    'Set [input.units] {large} = "{unit}"',
    "unit.declared": f"{_TIMES}: is {{small}} in {{unit}}, not in {{declared}} as [input.units] declares? "
    'Set {small} = "{unit}"',
    "unit.twice": f"{_TIMES}, as if {{small}} had been converted from {{unit}} twice: set [input.units] "
    "{small}, or check its source",
    "unit.range": f"the median of {{flows:median}} is far outside {_RANGE}: check [input.units]",
    "unit.range_unit": f"the median of {{flows:median}} is far outside {_RANGE}: check [input.units] "
    '("{unit}" would give {flows:converted} m3/s{also:also})',
    "unit.level_span": "h_L moves by {span:.4g} m over the record, more than {limit:g} m; check "
    "[input.units] h_L and [input] sentinels",
    "unit.level_days": "h_L is {ratio:times} times that of the other days ({height:.4g} m on {date}): is it "
    "in {unit} there, and in {declared} on the others?",
    "unit.bed": f"{_BED} and the datum",
    "unit.bed_unit": f'{_BED} and the datum ("{{unit}}" would give {{converted:.4g}} m)',
    "unit.level": f'{_VOLUME}: is h_L in {{unit}}, not in {{declared}}? [input.units] h_L = "{{unit}}"',
    "unit.flows": f"{_VOLUME}: are both flows in {{unit}}? Set [input.units], or check the area",
    "unit.flows_days": "against the moves of h_L, u_Qi and u_Qo are {ratio:multiple} on the other days: are "
    "both in {unit} there, and in {declared} on the others? [input.units] is for all days: convert these",
    "balance.area": f"{_VOLUME}: {{fitting_area:.2g}} m2 would fit. Check it, the units, and that no part of "
    "a flow is missing",
    "reach.area": "[reach] length x width = {product:g} m2, where surface_area = {area:g} m2: check them",
    "balance.level": "h_L does not follow the flows: with [reach] {area_of} = {area:.2g} m2 their volume "
    "would move it {ratio:times} times as much: is it the level of this pool?",
    "balance.flows": f"{_TIMES}: the water balance does not close; is a part of {{small}} missing?",
    "range": f"{{share:.0%}} of {{column}} ({{lowest:.4g}} to {{highest:.4g}} m3/s) is outside {_RANGE}: the "
    "travel-time bounds do not cover these flows",
    "stuck": "{output} stands still or flickers by one step while the flows move: is the gauge stuck? On "
    "{example}",
    "jump": "{output} jumps and no flow explains it: was the gauge moved, or its datum? On {example}",
    "spike": "{output} leaps away and back: is it a fault of the gauge? If a number means not measured: "
    "[input] sentinels. On {example}",
    "copy.two": "{what} occur on both: is one a copy of the other?",
    "copy.many": "{what} occur on several dates, such as {first} and {second}: are some copies of others?",
    "constant.inflow": "the inflow is constant ({flow:interval} m3/s): no delay can be estimated",
    "constant.inflow_always": "the inflow is constant ({flow:interval} m3/s) on every day: no delay can be "
    "estimated",
    "constant.outflow": "the outflow is constant ({flow:interval} m3/s)",
    "constant.outflow_always": "the outflow is constant ({flow:interval} m3/s) on every day while the inflow "
    "moves: is it a set-point, or a dead line?",
    "negative.some": "{column} is negative, down to {lowest:.4g} m3/s: a sign, a sentinel, or pumping?",
    "negative.mean": "{column} is negative on average, down to {lowest:.4g} m3/s: is its sign reversed?",
    "moment": "{column} is far off for a moment, and returns: a lost digit? On {example}",
    "interval.finer": f"{_ROWS}; {_PERIOD}: flows are averaged over each sample, {{output}} is interpolated",
    "interval.sample_time": f"{_ROWS}; {_PERIOD}: set sample_time = {{spacing_s:g}}",
    "interval.column": f"{_ROWS}; {_PERIOD}: {_COLUMN}",
    "interval.declared": f"{_ROWS}; [input.interval] declares {{expected_s:g}} s: {_COLUMN}",
    "summer time": "an hour of the night {what}, Sundays on which clocks change: the logger keeps summer "
    "time, and its times are read as {read_as}; set [input] time_zone to its zone, such as "
    '"Europe/Paris"',
    "future": "the logs are dated in the future: check the date of the logger and the names of the files",
}
"""Text of each finding; the part of the code before the dot is its kind."""
REMARKS = {
    "range", "constant.inflow", "constant.outflow", "negative.some", "moment", "interval.finer",
}  # fmt: skip
"""Findings that need no action."""
UNTRUE = {"copy", "dates", "spike", "stuck", "swapped", "unit"}
"""Kinds of findings on values that are not those of their column and time, whatever acts on the reach."""
DAYS = {
    "swapped": "inflow and outflow look swapped",
    "dates": "{column} looks dated a day too {sense}",
    "clock": _STAMPED,
    "unit.level_days": "h_L is {height:.4g} m",
    "unit.flows_days": "u_Qi and u_Qo look in {unit}",
    "unit.range": "flows are far outside [reach] discharge_range",
    "unit.range_unit": "flows are far outside [reach] discharge_range",
    "unit": _TIMES,
    "balance": _TIMES,
    "stuck": "{output} stands still {items:spell}",
    "jump": "{output} jumps by {items:jump}",
    "spike": "{output} leaps away and back at {items:spike}",
    "copy": "{column} as on {other}",
    "constant.inflow": "the inflow is constant",
    "constant.outflow": "the outflow is constant",
    "negative": "negative {column}, down to {lowest:.4g} m3/s",
    "moment": "{column} is far off for a moment at {items:time}",
    "interval": _ROWS,
    "summer time": "an hour of the night {what}",
    "future": "dated in the future",
}
"""Text of a finding for one of its days, by code or kind."""
ITEMS = {
    "spell": "from {first} to {last} ({duration_s:span}) at {value:.6g} {unit}",
    "jump": "{change:+.3g} {unit} at {time}",
    "spike": "{time} ({value:.6g} {unit})",
    "time": "{time}",
}
"""Text of one of several events of a day."""
JOINED = {"median": "{column}, {median:.4g} m3/s,", "converted": "{converted:.4g}"}
"""Text of each of several columns, joined by "and"."""


class _Texts(string.Formatter):
    """Format specifications of the templates above, beside Python's own."""

    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec in ITEMS:
            listed = ", ".join(self.format(ITEMS[format_spec], **item) for item in value[:MOST_ITEMS])
            return listed + (f" and {len(value) - MOST_ITEMS} times more" if len(value) > MOST_ITEMS else "")
        if format_spec in JOINED:
            return " and ".join(self.format(JOINED[format_spec], **item) for item in value)
        return SPECIFIED[format_spec](value) if format_spec in SPECIFIED else format(value, format_spec)


FORMAT = _Texts()


@dataclass(frozen=True)
class Finding:
    """A fault or a remark, once for all the days that it applies to.

    `code` is a key of :data:`TEXTS`, `values` are columns, numbers [SI units unless the key ends otherwise]
    and dates of its text. `days` are the days that it applies to, each with its own values; empty for the
    whole record.
    """

    code: str
    values: Values = field(default_factory=dict)
    days: Mapping[dt.date, Values] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """The code before the dot: unit, balance, swapped, clock, drift, ..."""
        return self.code.partition(".")[0]

    @property
    def wrong(self) -> bool:
        """Whether it needs action; otherwise a remark."""
        return self.code not in REMARKS

    @property
    def text(self) -> str:
        """The finding without its dates."""
        values = dict(self.values)
        if "{example}" in TEXTS[self.code]:
            first = min(self.days)
            values["example"] = f"{first}: {self.day_text(first)}"
        return FORMAT.format(TEXTS[self.code], **values)

    def day_text(self, date: dt.date) -> str:
        """The finding for one of its days."""
        template = DAYS.get(self.code) or DAYS[self.kind]
        return FORMAT.format(template, **{**self.values, **self.days[date]})

    def __str__(self) -> str:
        return f"{list_dates(self.days)}: {self.text}" if self.days else self.text

    def to_json(self) -> dict[str, Any]:
        """Return the finding as JSON values."""
        days = {str(date): self.day_text(date) for date in sorted(self.days)}
        return {
            "kind": self.kind, "code": self.code, "text": str(self), "wrong": self.wrong,
            "values": dict(self.values), "days": days,
        }  # fmt: skip


@dataclass(frozen=True)
class DayReport:
    """One day."""

    date: dt.date
    status: Status
    reason: str = ""  # why the day cannot be used; empty otherwise
    notes: list[str] = field(default_factory=list)  # filled, dropped or masked samples, and findings
    n_samples: int = 0
    n_filled: int = 0


@dataclass(frozen=True)
class Report:
    """A check of all days of a reach."""

    days: list[DayReport]
    bad_files: list[tuple[str, str]]  # path and reason of files of no day
    absent: list[dt.date]  # days without a log
    findings: list[Finding]

    def count(self, status: Status) -> int:
        """Return the number of days of a status."""
        return sum(day.status == status for day in self.days)

    @property
    def warnings(self) -> list[str]:
        """Texts of the findings that need action."""
        return [str(finding) for finding in self.findings if finding.wrong]

    @property
    def exit_code(self) -> int:
        """0 if all is well; 3 if a day failed, a file cannot be used, or a finding needs action."""
        return 3 if self.count("failed") or self.bad_files or self.warnings else 0

    @property
    def summary(self) -> dict[str, Any]:
        """The counts as JSON values."""
        return {
            "days": len(self.days), "first": str(self.days[0].date), "last": str(self.days[-1].date),
            "ok": self.count("ok"), "failed": self.count("failed"), "pending": self.count("pending"),
            "absent": len(self.absent), "bad_files": len(self.bad_files),
            "samples": sum(day.n_samples for day in self.days),
            "filled": sum(day.n_filled for day in self.days),
            "warnings": len(self.warnings), "exit_code": self.exit_code,
        }  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Return the report as JSON values."""
        return {
            "days": [asdict(day) | {"date": str(day.date)} for day in self.days],
            "bad_files": [list(bad) for bad in self.bad_files],
            "absent": [str(day) for day in self.absent],
            "findings": [finding.to_json() for finding in self.findings],
            "warnings": self.warnings,
            "failed": self.count("failed"),
            "summary": self.summary,
        }


def list_dates(dates: Iterable[dt.date]) -> str:
    """Return spans of consecutive dates, the first few of them, and the number of days.

    >>> list_dates([dt.date(2008, 3, 1), dt.date(2008, 3, 2), dt.date(2008, 3, 9)])
    '2008-03-01 to 2008-03-02, 2008-03-09 (3 days)'
    """
    ordered = sorted(dates)
    ranges = [day_range(*ends) for ends in spans(ordered)]
    if len(ranges) > MOST_RANGES:
        ranges[MOST_RANGES:] = ["..."]
    return ", ".join(ranges) + (f" ({len(ordered)} days)" if len(ordered) > 1 else "")


def times(ratio: float) -> str:
    """Format a factor with three digits.

    >>> times(35.31), times(999.7)
    ('35.3', '1,000')
    """
    return f"{ratio:.3g}" if ratio < 999.5 else f"{ratio:,.0f}"


def span(seconds: float) -> str:
    """Format a duration: in minutes below two hours.

    >>> span(3600), span(86400 / 4)
    ('60 min', '6.0 h')
    """
    return f"{seconds / 60:.0f} min" if abs(seconds) < 7200 else f"{seconds / 3600:.1f} h"


SPECIFIED: dict[str, Callable[[Any], str]] = {
    "span": span,
    "times": times,
    "multiple": lambda x: f"{times(x)} times as much as" if x > 1 else f"{times(1 / x)} times less than",
    "interval": lambda ends: " to ".join(f"{end:g}" for end in dict.fromkeys(ends)),
    "also": lambda units: f"; {' and '.join(units)} would fit, too" if units else "",
    "default": lambda declared: "" if declared else " (not declared: that of Table I)",
}
"""Numbers of the templates, by format specification."""


def render(report: Report, reach: str) -> str:
    """Return the report of a reach for a terminal: the faults first, each once, then the counts."""
    lines = []
    files: dict[str, list[str]] = {}
    for path, reason in report.bad_files:
        files.setdefault(reason, []).append(path)
    for reason, (first, *others) in files.items():
        more = f" and {len(others)} more files" if others else ""
        lines.append(f"{first}{more} cannot be used: {reason}")
    for status in ("failed", "pending"):
        lines += _grouped((d.date, f"{status}: {d.reason}") for d in report.days if d.status == status)
    lines += [f"wrong: {warning}" for warning in report.warnings]
    lines += [f"remark: {finding}" for finding in report.findings if not finding.wrong]
    found = {(date, f.day_text(date)) for f in report.findings for date in f.days}
    notes = [(day.date, note) for day in report.days for note in day.notes]
    lines += _grouped(note for note in notes if note not in found)
    return "\n".join([*map(_wrapped, lines), *([""] if lines else []), _table(report, reach)])


def render_sound(report: Report, reach: str) -> str:
    """Return one line for a reach without faults."""
    remarks = sum(bool(day.notes) for day in report.days)
    more = f", {remarks} with remarks" if remarks else ""
    return f"{reach}: fine, {count(len(report.days), 'day')}{more}"


def _table(report: Report, reach: str) -> str:
    counts = report.summary
    noted = sum(day.status == "ok" and bool(day.notes) for day in report.days)
    rows = {
        "days": "{days}, {first} to {last}".format(**counts),
        "usable": f"{counts['ok']}" + (f", {noted} of them with remarks" if noted else ""),
        "failed": counts["failed"],
        "pending": counts["pending"],
        "no log": list_dates(report.absent) or "0 days",
        "bad files": counts["bad_files"],
        "samples": "{samples:,}, {filled:,} of them filled".format(**counts),
        "wrong": counts["warnings"],
    }
    return "\n".join([reach, *(_wrapped(f"  {name:10s} {value}", 13) for name, value in rows.items())])


def _grouped(lines: Iterable[tuple[dt.date, str]]) -> list[str]:
    """Merge texts that differ only in their numbers, with all their dates."""
    groups: dict[str, list[tuple[dt.date, str]]] = {}
    for date, text in lines:
        groups.setdefault(re.sub(r"\d+", "0", text), []).append((date, text))
    return [
        f"{list_dates(date for date, _ in group)} {group[0][1]}"
        + (" (on the first)" if len({text for _, text in group}) > 1 else "")
        for group in groups.values()
    ]


def _wrapped(line: str, indent: int = 2) -> str:
    return textwrap.fill(
        line, WIDTH, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )
