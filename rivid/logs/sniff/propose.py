"""Propose an `[input]` block for a foreign export, and list in comments what could not be decided."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rivid.config import InputConfig
from rivid.errors import DataError
from rivid.logs.columns import NumberReader
from rivid.logs.files import Limits, read_bytes, shown
from rivid.logs.sniff.columns import (
    Beside,
    ColumnGuess,
    Questions,
    Tagged,
    by_tag,
    guess_column,
    guess_marks,
    look_beside,
    roles_of,
)
from rivid.logs.sniff.layout import Layout, TimeLayout, guess_layout, guess_time
from rivid.logs.spec import MICRO
from rivid.logs.text import LINE, TAIL, footer_lines
from rivid.logs.times import clock_turns_back, read_text

FILL_IN = (
    "# fill in; what is left out is taken from the reach of the examples:",
    "# length =           # m, from dam to dam",
    "# width =            # m, mean",
    "# depth =            # m, mean",
    "# surface_area =     # m2, of the water",
    "# discharge_range =  # m3/s, as [100, 800]: lowest and highest usual",
)
"""What no export tells of a reach."""


@dataclass(frozen=True)
class Proposal:
    """What a file seems to be.

    Attributes
    ----------
    toml : str
        A configuration that `load_config` accepts, with comments.
    open_questions : list of str
        What the file alone does not tell.
    open_keys : tuple of str
        Keys of `[input]` that these are about.
    """

    toml: str
    open_questions: list[str]
    open_keys: tuple[str, ...] = ()


def write_toml(
    name: str,
    kind: str,
    sample_time: float,
    keys: Mapping[str, Any],
    tables: Mapping[str, Mapping[str, Any]],
    undecided: Mapping[str, tuple[Any, ...]],
    questions: Questions,
    instead: Mapping[str, list[Any]] | None = None,
) -> Proposal:
    """The proposal.

    Parameters
    ----------
    name : str
        Of the file, for the first line.
    kind : {"pool", "river"}
    sample_time : float
        [s]; beyond 1 s to a day it is left out.
    keys, tables : mapping
        Of `[input]`.
    undecided : mapping of str to tuple
        Keys that stand in a comment only, with all that they may be: so reading asks for them.
    questions : Questions
    instead : mapping of str to list, optional
        What else keys may be: in comments below them, ready to be used.
    """
    lines = [f"# Proposed for {_safe(name)}. Read it through: what follows was seen, not known."]
    lines += ["[reach]", '# name = "..."       # letters, digits, . _ -', f"kind = {said(kind)}"]
    if 1 <= sample_time <= 86_400:
        lines.append(f"sample_time = {sample_time:g}")
    lines += [*FILL_IN, "", "[input]"]
    for key, value in keys.items():
        lines.append(f"{_safe_key(key)} = {said(value)}")
        lines += [f"# {_safe_key(key)} = {said(other)}" for other in (instead or {}).get(key, ())]
    lines += [
        f"# {key} = {' or '.join(said(v) for v in values)}: choose one" for key, values in undecided.items()
    ]
    for table, entries in tables.items():
        if entries:
            lines += ["", f"[input.{table}]"]
            lines += [f"{_safe_key(key)} = {said(value)}" for key, value in entries.items()]
    lines += ["", "# Not decided:"]
    lines += [f"# - {_safe(text)}" for _, text in questions.asked]
    keyed = tuple(dict.fromkeys(key for key, _ in questions.asked if key))
    return Proposal("\n".join(lines) + "\n", [text for _, text in questions.asked], keyed)


def said(value: Any) -> str:
    """A value as TOML: JSON has the same strings and lists, but for one escape that TOML lacks."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")


def _safe(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


def _safe_key(key: str) -> str:
    return key if key.replace("_", "").isascii() and key.replace("_", "").isalnum() else said(key)


LOOKED_AT = 2 << 20
"""Bytes that are enough to tell a layout."""
ROWS = 20_000
UNSTEADY = 0.3
"""Share of odd steps beyond which values come when they change, not regularly."""


def sniff(path: Path | Sequence[Path], time_zone: str | None = None) -> Proposal:
    """Propose an `[input]` block for an export: text, plain or gzipped.

    Parameters
    ----------
    path : Path, or sequence of Path
        One file, or several of one dialect that belong together.
    time_zone : str, optional
        Zone of its clock, where its times carry no offset.

    Returns
    -------
    Proposal

    Raises
    ------
    DataError
        Where a file is no table with a header and times.
    """
    paths = [path] if isinstance(path, Path) else list(dict.fromkeys(path))
    looks = [_look(each) for each in paths]
    return _propose(looks, ", ".join(shown(each.name) for each in paths[:3]), time_zone)


@dataclass
class _Look:
    """What a file seems to be.

    `columns` are names, units and cells of all that may hold numbers: columns of the wide layout, or tags;
    `footer` are its last lines, where these hold no data.
    """

    layout: Layout
    time: TimeLayout
    tagged: Tagged | None
    columns: list[tuple[str, str, list[str]]] = field(default_factory=list)
    footer: list[str] = field(default_factory=list)


def _look(path: Path) -> _Look:
    name = shown(path.name)
    content, _ = read_bytes(path, name, Limits(512 << 20, 0))
    if content[:4] == b"PAR1" or path.suffix.lower() == ".parquet":
        raise DataError(
            f"{name} is Parquet: it states its columns and types itself; set [input] names and units"
        )
    whole, bigendian = len(content) <= LOOKED_AT, content[:2] == b"\xfe\xff"
    tail = content[-(TAIL + len(content) % 2) :]  # an even number of bytes from the end or from the beginning
    if not whole:
        content = content[: content.rfind(b"\n", 0, LOOKED_AT) + 1] or content[:LOOKED_AT]
    layout = guess_layout(content, name)
    del layout.rows[ROWS:], layout.blocks[ROWS:]
    time = guess_time(layout)
    if time is None:
        raise DataError(
            f"{name}: no column reads as times; columns: {', '.join(layout.names)[:200]}; "
            "set [input] time and time_format"
        )
    footer = _footer_in(tail, bigendian, layout, time)
    while whole and footer and layout.rows and not _has_time(layout.rows[-1], time):
        layout.rows.pop()
    tagged = by_tag(layout, time, path.name)
    look = _Look(layout, time, tagged, footer=footer)
    if tagged is not None:
        look.columns = [(tag, tagged.units.get(tag, ""), cells) for tag, cells in tagged.cells.items()]
        look.time = replace(time, steps=tagged.shortest)
        return look
    for i, column in enumerate(layout.names):
        if i not in time.columns and column:
            look.columns.append((column, layout.units[i], [row[i] for row in layout.rows]))
    return look


def _footer_in(tail: bytes, bigendian: bool, layout: Layout, time: TimeLayout) -> list[str]:
    """The last lines of a file that hold no data."""
    encoding = layout.encoding
    if encoding == "utf-16":  # the mark that tells the order of bytes stands at the other end
        encoding = "utf-16-be" if bigendian else "utf-16-le"
    lines = LINE.split(tail.decode(encoding, "replace"))
    found = footer_lines(lines, time.columns, layout.separator, time.time_format, layout.comment)
    return [lines[at] for at in found]


def _has_time(row: Sequence[str], time: TimeLayout) -> bool:
    return read_text(" ".join(row[i] for i in time.columns), time.time_format) is not None


def _propose(looks: list[_Look], name: str, time_zone: str | None) -> Proposal:
    questions, default = Questions(), InputConfig()
    first = looks[0]
    layout, time, tagged = first.layout, first.time, first.tagged
    unlike = [look for look in looks[1:] if _kind(look) != _kind(first)]
    if unlike:
        questions.ask("encoding", f"{len(unlike)} of the files are of another kind than the first")
    sources = list({entry[0]: entry for look in looks for entry in look.columns}.values())
    beside = look_beside(layout, time, tagged)
    decimal, thousands, doubt = guess_marks([cells for _, _, cells in sources])
    questions.ask("decimal", doubt)
    reader = NumberReader(default.missing, decimal, thousands)
    found = [
        guess_column(source, unit, cells, reader)
        for source, unit, cells in sources
        if source not in beside.columns
    ]
    columns = [column for column in found if column is not None]
    questions.ask("time_format", time.doubt)
    meant = roles_of(columns, questions)
    roles, kind = meant.groups, meant.kind
    used = [column for group in roles.values() for column in group]
    step = sorted(time.steps)[len(time.steps) // 2] / MICRO if time.steps else 0.0
    every = min((column.every for column in used), default=1)
    zrxp = layout.zrxp
    if time_zone is None and zrxp is not None:
        time_zone = zrxp.zone or None

    keys: dict[str, Any] = {"layout": "long" if tagged else "wide"}
    keys |= {"time": _one_or_all([layout.names[i] for i in time.columns])}
    keys |= {role: _one_or_all([column.name for column in group]) for role, group in roles.items()}
    if kind == "pool" and "u_Qo" not in roles:
        keys["u_Qo"] = ""
    if tagged is not None:
        keys |= {"tag": tagged.tag or None, "value": tagged.value}
    if zrxp is not None:
        keys |= {"tag_pattern": zrxp.pattern, "columns": list(zrxp.columns)}
    undecided = {"time_format": (time.time_format, *time.others)} if time.others else {}
    keys |= {"time_format": None if undecided else time.time_format, "time_zone": time_zone}
    keys |= {"encoding": layout.encoding, "separator": layout.separator, "decimal": decimal}
    keys |= {"thousands": thousands, "comment": layout.comment, "skip_rows": layout.skip_rows}
    keys |= {"header_rows": layout.header_rows, "unit_rows": layout.unit_rows}
    keys |= {"footer_rows": max(len(look.footer) for look in looks)}
    if layout.repeated:
        keys["repeated_header"] = "drop"
    texts = list(dict.fromkeys(text for column in used for text in column.texts))
    if texts:
        keys["missing"] = [*default.missing, *texts]
        questions.ask("missing", f"{', '.join(map(repr, texts[:6]))}: taken for values that are not measured")
    keys["sentinels"] = sorted(
        {s for column in used for s in column.sentinels} | set(zrxp.missing if zrxp else ())
    )
    tables: dict[str, dict[str, Any]] = {
        "units": {r: g[0].unit for r, g in roles.items() if g[0].unit},
        "interval": {r: g[0].every * step for r, g in roles.items() if g[0].every > every and step},
    }
    if tagged is not None:
        usual = {r: tagged.usual(g[0].name) / MICRO for r, g in roles.items()}
        tables["interval"] = {r: s for r, s in usual.items() if s > 1.01 * step}
    _ask_of_times(first, beside, time_zone, keys, questions)
    _ask_of_units(roles, questions)
    _add_flags(beside, roles, tagged is not None, keys, tables, questions)
    if footer := max((look.footer for look in looks), key=len):
        ends = ", ".join(repr(line.strip()[:30]) for line in footer[:3])
        lines = f"the last {len(footer)} lines hold" if len(footer) > 1 else "the last line holds"
        questions.ask("footer_rows", f"{lines} no data ({ends}): passed over by footer_rows")
    steps = [tagged.steps.get(c.name, []) for c in used] if tagged else [time.steps]
    if any(map(_unsteady, steps)):
        tables["interval"] = {}
        questions.ask(
            "hold",
            "values come at irregular times: if they are logged when they change, set [input.hold] to the "
            "longest time that one holds, and [reach] sample_time",
        )
    else:
        late = f" ({step * every:g} s)" if step else ""
        questions.ask(
            "stamp",
            'does a value stand for the interval before its time ("end"), after it ("start"), or the '
            f'"instant"? ([input.stamp]) Nothing said is the instant; if that is wrong of a flow, a delay is '
            f"off by up to one interval{late}",
        )
    left = [column.name for column in columns if column not in used]
    if left:
        questions.ask("", f"{'tags' if tagged else 'columns'} left out: {', '.join(left)}")
    needed = {k: v for k, v in keys.items() if v is not None and v != getattr(default, k)}
    instead = {
        role: [_one_or_all([c.name for c in group]) for group in groups]
        for role, groups in meant.instead.items()
    }
    if any(instead.values()):
        questions.ask("", "the lines in comments below u_Qi and the like are other choices, in their place")
    return write_toml(name, kind, step * every, needed, tables, undecided, questions, instead)


def _kind(look: _Look) -> tuple[Any, ...]:
    layout = look.layout
    return (layout.encoding, layout.separator, layout.skip_rows, look.time.time_format, look.tagged is None)


def _ask_of_times(
    look: _Look, beside: Beside, time_zone: str | None, keys: dict[str, Any], questions: Questions
) -> None:
    """Zones, and the hour that comes twice."""
    if look.time.zoned:
        return
    if time_zone is None and not beside.zones:
        questions.ask(
            "time_zone",
            "its times carry no UTC offset: set time_zone to the zone of the log's clock, as Europe/Paris, "
            "America/Los_Angeles; without summer time Etc/GMT+8, which is 8 h behind UTC",
        )
    elif time_zone is None and len(set(beside.zones.values())) > 1:
        questions.ask("time_zone", "its clock is changed: set time_zone to the zone whose days are meant")
    if time_zone is not None and not beside.zones and look.tagged is None:
        texts = [" ".join(row[i] for i in look.time.columns) for row in look.layout.rows]
        if clock_turns_back(texts, look.time.time_format, time_zone):
            keys["ambiguous"] = "order"


def _ask_of_units(roles: dict[str, list[ColumnGuess]], questions: Questions) -> None:
    for role, group in roles.items():
        if len({column.unit for column in group}) > 1:
            questions.ask("units", f"the columns of {role} seem to have different units")
        elif not group[0].unit and group[0].name != role:
            unit = "m" if role == "h_L" else "m3/s"
            questions.ask(
                "units",
                f"no unit is written for {role}: {unit} is taken unless [input.units] says otherwise",
            )


def _add_flags(
    beside: Beside,
    roles: dict[str, list[ColumnGuess]],
    long: bool,
    keys: dict[str, Any],
    tables: dict[str, dict[str, Any]],
    questions: Questions,
) -> None:
    """Columns of flags and zones, and those that may be neither."""
    if beside.zones:
        keys["zone_column"], tables["zones"] = beside.zone_column, beside.zones
        questions.ask("zones", f"offsets of {', '.join(beside.zones)}: by their usual meaning")
    own = {
        role: [beside.flags[column.name] for column in group if column.name in beside.flags]
        for role, group in roles.items()
    }
    whole = {r: _one_or_all(f) for r, f in own.items() if f and len(f) == len(roles[r])}
    if whole and not long:
        tables["quality"] = whole
    elif beside.of_row:
        keys["quality"] = beside.of_row
    if "quality" in tables or "quality" in keys:
        keys["good"] = beside.good
        questions.ask(
            "good", f"flags: {beside.counted}; {', '.join(map(repr, beside.good))} taken as good, no other"
        )
    flagged = {flag for flags in own.values() for flag in flags} | {beside.of_row}
    keys["ignore"] = [column for column in beside.doubtful if column not in flagged]
    if keys["ignore"]:
        questions.ask("ignore", f"{', '.join(keys['ignore'])}: taken as no flags")


def _unsteady(steps: list[int]) -> bool:
    usual = sorted(steps)[len(steps) // 2] if steps else 0
    return bool(steps) and sum(abs(s - usual) > 0.1 * usual for s in steps) > UNSTEADY * len(steps)


def _one_or_all(names: list[str]) -> str | list[str]:
    return names[0] if len(names) == 1 else names
