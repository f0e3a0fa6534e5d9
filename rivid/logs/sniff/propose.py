"""Propose an `[input]` block for a foreign export, and list in comments what could not be decided."""

import json
import re
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rivid.errors import DataError
from rivid.input_config import InputConfig
from rivid.logs.formats import as_text
from rivid.logs.log import head_of_parquet
from rivid.logs.sniff.columns import (
    Group,
    Questions,
    bracketed,
    find_flags,
    find_tags,
    guess_column,
    guess_marks,
    name_each,
    roles_of,
)
from rivid.logs.sniff.layout import ZRXP_TAG, Layout, guess_layout, guess_time, middle
from rivid.logs.spec import MANY, MICRO, clock_turns_back, read_bytes, read_text, shown
from rivid.logs.text import LINE, TAIL, NumberReader, footer_lines
from rivid.types import HOUR

DEFAULT = InputConfig()
WIDTH = 80  # characters of a line of the proposal
HEAD_BYTES = 2 << 20  # bytes from the beginning that are read for the layout: a year at 10 min, and quick
HEAD_ROWS = 20_000  # rows of these
MOST_NAMES = 3  # files that are named at the top of the proposal
UNSTEADY = 0.3  # share of odd steps [-] beyond which values come when they change, not regularly
CLOCK_CHANGE = 2.0 * HOUR  # longer than any step back of a clock that is changed [s]
BRIEF = 1.0  # sample time below which a record is taken for one of minutes, of a laboratory [s]
FILL_IN = (
    "# fill in; what is left out is taken from the reach of the examples:",
    "# length =           # m, from dam to dam",
    "# width =            # m, mean",
    "# depth =            # m, mean",
    "# surface_area =     # m2, of the water",
    "# discharge_range =  # m3/s, as [100, 800]: lowest and highest usual",
)
"""Keys of `[reach]` that no export states."""


def sniff(path: Path | Sequence[Path], time_zone: str | None = None) -> "Proposal":
    """Propose an `[input]` block for an export: one file, or several of one dialect.

    `time_zone` is that of its clock, where its times carry no offset. DataError where a file is no table.
    """
    paths = [path] if isinstance(path, Path) else list(dict.fromkeys(path))
    names = [shown(path.name) for path in paths]
    if len(names) > MOST_NAMES:
        names[MOST_NAMES:] = [f"... ({len(names)} files)"]
    return Proposal([_look(each) for each in paths], ", ".join(names), time_zone)


def _look(path: Path) -> Layout:
    """The layout of a file."""
    name = shown(path.name)
    content, _ = read_bytes(path, name, MANY[0])
    if content[:4] == b"PAR1" or path.suffix.lower() == ".parquet":
        content = head_of_parquet(content, name, HEAD_ROWS)
    content = as_text(content, name)
    whole, bigendian = len(content) <= HEAD_BYTES, content[:2] == b"\xfe\xff"
    tail = content[-(TAIL + len(content) % 2) :]  # an even number of bytes from the end or from the beginning
    if not whole:
        content = content[: content.rfind(b"\n", 0, HEAD_BYTES) + 1] or content[:HEAD_BYTES]
    layout = guess_layout(content, name)
    rows = layout.rows
    del rows[HEAD_ROWS:], layout.blocks[HEAD_ROWS:]
    if not guess_time(layout):
        raise DataError(
            f"{name}: no column reads as times; columns: {', '.join(layout.names)[:200]}; "
            'set [input] time and time_format: that of strptime, "unix" for s since 1970 or another begin, '
            '"unix_ms" for ms, "excel" for the days of a spreadsheet'
        )
    encoding = layout.encoding
    if encoding == "utf-16":  # the byte order mark is at the other end
        encoding = "utf-16-be" if bigendian else "utf-16-le"
    lines = LINE.split(tail.decode(encoding, "replace"))
    found = footer_lines(lines, layout.time_at, layout.separator, layout.time_format, layout.comment)
    layout.footer = [lines[at] for at in found]
    while whole and found and rows and read_text(layout.time(rows[-1]), layout.time_format) is None:
        rows.pop()
    if layout.doubled:
        name_each(layout)
    find_tags(layout, path.name)
    return layout


class Proposal:
    """The keys of `[input]` for files of one dialect, `toml`, and the questions that they leave open."""

    def __init__(self, layouts: list[Layout], name: str, time_zone: str | None) -> None:
        self.layout = layout = layouts[0]
        self.footer = max((each.footer for each in layouts), key=len)
        self.time_zone = time_zone or layout.zone or None
        self.questions: Questions = []
        if not self.time_zone and not layout.zoned and (stated := _zone_in(layout)):
            self.time_zone = stated
            self.ask("time_zone", f"its times are in {stated}: by the name of their column")
        if unlike := sum(_kind(other) != _kind(layout) for other in layouts[1:]):
            self.ask("encoding", f"{unlike} of the files are of another kind than the first")
        sources = list({entry[0]: entry for each in layouts for entry in each.columns}.values())
        self.flags = find_flags(layout)
        self.decimal, self.thousands, doubt = guess_marks([cells for _, _, cells in sources])
        self.ask("decimal", doubt)
        reader = NumberReader(DEFAULT.missing, self.decimal, self.thousands)
        others = {*self.flags.doubtful, self.flags.zone_column}
        guesses = [guess_column(*source, reader) for source in sources if source[0] not in others]
        self.columns: Group = [column for column in guesses if column is not None]
        if layout.headerless:
            self.ask("columns", "the file has no header: the names in columns are made up, in its order")
        if layout.doubled:
            self.ask("columns", "names occur twice in the header: those in columns are made up, in its order")
        self.ask("time_format", layout.doubt)
        if not layout.value and min(layout.steps, default=0) < -CLOCK_CHANGE * MICRO:
            self.ask(
                "layout",
                'its times go back: for series one below the other set layout = "long", value, and '
                "tag_pattern to a regular expression that finds the tag of each in a line above its rows",
            )
        roles, self.kind, self.instead = roles_of(self.columns, self.questions)
        self.roles = {role: group for role, group in roles.items() if group}
        self.used = [column for group in self.roles.values() for column in group]
        self.step = middle(layout.steps) / MICRO
        self.every = min((column.every for column in self.used), default=1)
        self.keys = self._keys()
        self._clock()
        self._units()
        self._flags()
        if self.footer:
            ends, count = ", ".join(repr(line.strip()[:30]) for line in self.footer[:3]), len(self.footer)
            lines = f"the last {count} lines hold" if count > 1 else "the last line holds"
            self.ask("footer_rows", f"{lines} no data ({ends}): passed over by footer_rows")
        self._stamps()
        used = {column.name for column in self.used}
        if left := [column.name for column in self.columns if column.name not in used]:
            self.ask("", f"{'tags' if layout.value else 'columns'} left out: {', '.join(left)}")
        if any(self.instead.values()):
            self.ask("", "the lines in comments of u_Qi and the like are other choices, in their place")
        self.toml = self._toml(name)

    def ask(self, key: str, question: str) -> None:
        """Add a question about a key, unless it is empty."""
        if question:
            self.questions.append((key, question))

    def _keys(self) -> dict[str, Any]:
        layout = self.layout
        keys: dict[str, Any] = {"layout": "long" if layout.value else "wide"}
        keys["time"] = _one_or_all([layout.names[i] for i in layout.time_at])
        keys |= {role: _names(group) for role, group in self.roles.items()}
        keys |= {role: None for role in self.instead if role not in self.roles}  # to be chosen
        if self.kind == "pool" and "u_Qo" not in keys:
            keys["u_Qo"] = ""
        if layout.value:
            keys |= {"tag": _one_or_all([*layout.tag]) if layout.tag else None, "value": layout.value}
        if layout.blocks:
            keys["tag_pattern"] = ZRXP_TAG
        if layout.blocks or layout.headerless or layout.doubled:
            keys["columns"] = list(layout.names)
        keys |= {
            "time_format": None if layout.other_formats else layout.time_format,
            "time_zone": self.time_zone,
            "encoding": layout.encoding,
            "separator": layout.separator,
            "decimal": self.decimal,
            "thousands": self.thousands,
            "comment": layout.comment,
            "skip_rows": layout.skip_rows,
            "header_rows": layout.header_rows,
            "unit_rows": layout.unit_rows,
            "footer_rows": len(self.footer),
            "repeated_header": "drop" if layout.repeated else None,
            "sentinels": sorted({s for column in self.used for s in column.sentinels} | {*layout.missing}),
        }
        if texts := list(dict.fromkeys(text for column in self.used for text in column.texts)):
            keys["missing"] = [*DEFAULT.missing, *texts]
            self.ask("missing", f"{', '.join(map(repr, texts[:6]))}: taken for values that are not measured")
        return keys

    def _clock(self) -> None:
        """Zones, and the hour that comes twice."""
        zones, layout = self.flags.zones, self.layout
        if layout.zoned:
            return
        if self.time_zone is None and not zones:
            self.ask(
                "time_zone",
                "its times carry no UTC offset: set time_zone to the zone of the log's clock, as "
                "Europe/Paris, America/Los_Angeles; without summer time Etc/GMT+8, which is 8 h behind UTC",
            )
        elif self.time_zone is None and len(set(zones.values())) > 1:
            self.ask("time_zone", "its clock is changed: set time_zone to the zone whose days are meant")
        if self.time_zone is not None and not zones and not layout.value:
            texts = [layout.time(row) for row in layout.rows]
            if clock_turns_back(texts, layout.time_format, self.time_zone):
                self.keys["ambiguous"] = "order"

    def _units(self) -> None:
        self.keys["units"] = {role: group[0].unit for role, group in self.roles.items() if group[0].unit}
        stated = {name: unit for name, unit, _ in self.layout.columns}
        for role, group in self.roles.items():
            if len({column.unit for column in group}) > 1:
                self.ask("units", f"the columns of {role} seem to have different units")
            elif not group[0].unit and group[0].name != role:
                unit, text = DEFAULT.unit(role), stated.get(group[0].name) or bracketed(group[0].name)
                doubt = f"the unit of {role}, {text!r}, is not known" if text else ""
                doubt = doubt or f"no unit is written for {role}"
                self.ask("units", f"{doubt}: {unit} is taken unless [input.units] states another")

    def _flags(self) -> None:
        """Columns of flags and zones, and those that may be neither."""
        flags = self.flags
        if flags.zones:
            self.keys |= {"zone_column": flags.zone_column, "zones": flags.zones}
            self.ask("zones", f"offsets of {', '.join(flags.zones)}: by their usual meaning")
        own = {
            role: [flags.owned[column.name] for column in group if column.name in flags.owned]
            for role, group in self.roles.items()
        }
        whole = {r: _one_or_all(f) for r, f in own.items() if f and len(f) == len(self.roles[r])}
        if whole or flags.of_row:
            self.keys |= {"quality": whole or flags.of_row, "good": flags.good}
            good = ", ".join(map(repr, flags.good))
            self.ask("good", f"flags: {flags.counted}; {good} taken as good, no other")
        flagged = {flag for columns in own.values() for flag in columns} | {flags.of_row}
        self.keys["ignore"] = [column for column in flags.doubtful if column not in flagged]
        if self.keys["ignore"]:
            self.ask("ignore", f"{', '.join(self.keys['ignore'])}: taken as no flags")

    def _stamps(self) -> None:
        """Intervals of the columns, and the question of their time stamps."""
        layout, step = self.layout, self.step
        others = (column for groups in self.instead.values() for group in groups for column in group)
        tags = [layout.tag_steps.get(column.name, []) for column in (*self.used, *others)]
        if any(map(_unsteady, tags if layout.value else [layout.steps])):
            self.ask(
                "hold",
                "values come at irregular times: if they are logged when they change, set [input.hold] to "
                "the longest time that one holds, and [reach] sample_time",
            )
            return
        if layout.value:
            usual = {role: layout.usual(group[0].name) / MICRO for role, group in self.roles.items()}
            intervals = {role: seconds for role, seconds in usual.items() if seconds > 1.01 * step}
        else:
            slow = {role: group[0].every for role, group in self.roles.items() if group[0].every > self.every}
            intervals = {role: every * step for role, every in slow.items() if step}
        self.keys["interval"] = intervals
        if step * self.every > DEFAULT.max_gap:  # one value may be missing
            self.keys["max_gap"] = step * self.every
        late = f" ({step * self.every:g} s)" if step else ""
        self.ask(
            "stamp",
            'does a value stand for the interval before its time ("end"), after it ("start"), or the '
            '"instant"? ([input.stamp]) Without it, a time is an instant; if that is wrong of a flow, '
            f"a delay is off by up to one interval{late}",
        )
        if 0.0 < step * self.every < BRIEF:
            self.ask("", 'a data set is a day: for shorter ones set [run] window, as window = "60 s"')

    def _toml(self, name: str) -> str:
        """The keys that differ from the defaults, other choices in comments below them, and the questions."""
        lines = _comment(f"Proposed for {name}. Check each line: it is inferred from the file alone.", "# ")
        lines += ["[reach]", '# name = "..."       # letters, digits, . _ -', f"kind = {_toml(self.kind)}"]
        if 0.01 <= self.step * self.every <= 86_400:
            lines.append(f"sample_time = {self.step * self.every:g}")
        lines += [*FILL_IN, "", "[input]"]
        for key, value in self.keys.items():
            if isinstance(value, dict) or (value is not None and value == getattr(DEFAULT, key)):
                continue
            lines += _entry(key, value) if value is not None else []
            for group in self.instead.get(key, ()):
                lines += [f"# {line}" for line in _entry(key, _names(group), WIDTH - 2)]
        if self.layout.other_formats:
            formats = " or ".join(map(_toml, (self.layout.time_format, *self.layout.other_formats)))
            lines.append(f"# time_format = {formats}: choose one")
        for table in ("units", "interval", "zones", "quality"):
            entries = self.keys.get(table)
            if entries and isinstance(entries, dict):
                lines += ["", f"[input.{table}]"]
                lines += [line for key, value in entries.items() for line in _entry(_key(key), value)]
        lines += ["", "# Not decided:"]
        lines += [line for _, text in self.questions for line in _comment(text, "# - ")]
        return "\n".join(lines) + "\n"


def _zone_in(layout: Layout) -> str:
    """The zone that the name of the time's column states, as `Time (UTC+1)`; empty for none."""
    name = " ".join(layout.names[i] for i in layout.time_at)
    match = re.search(r"\b(?:utc|gmt) ?(?:([+-]\d{1,2})(?::?00)?)?(?![\w:+-])", name, re.I)
    return "" if not match else f"Etc/GMT{-int(match[1]):+d}" if match[1] and int(match[1]) else "UTC"


def _kind(layout: Layout) -> tuple[Any, ...]:
    """Equal for files of one dialect."""
    text = layout.encoding, layout.separator, layout.skip_rows
    return *text, layout.time_format, bool(layout.value), layout.doubled and layout.names


def _unsteady(steps: list[int]) -> bool:
    usual = middle(steps)
    return sum(abs(step - usual) > 0.1 * usual for step in steps) > UNSTEADY * len(steps)


def _names(group: Group) -> str | list[str]:
    return _one_or_all([column.name for column in group])


def _one_or_all(names: list[str]) -> str | list[str]:
    return names[0] if len(names) == 1 else names


def _toml(value: Any) -> str:
    """A value as TOML in one line: JSON differs in one escape that TOML lacks."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")


def _key(key: str) -> str:
    return key if key.replace("_", "").isascii() and key.replace("_", "").isalnum() else _toml(key)


def _entry(key: str, value: Any, width: int = WIDTH) -> list[str]:
    """`key = value` in lines of at most `width` characters; only a list is divided."""
    line = f"{key} = {_toml(value)}"
    if len(line) <= width or not isinstance(value, list):
        return [line]
    lines = [""]
    for cell in map(_toml, value):
        if lines[-1] and len(lines[-1]) + len(cell) > width - 8:
            lines.append("")
        lines[-1] += f"{cell}, "
    return [f"{key} = [", *(f"    {line.rstrip()}" for line in lines), "]"]


def _comment(text: str, indent: str) -> list[str]:
    printable = "".join(c if c.isprintable() else "?" for c in text)
    return textwrap.wrap(
        printable, WIDTH, initial_indent=indent, subsequent_indent="#".ljust(len(indent)),
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip
