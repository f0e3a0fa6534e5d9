"""Propose an `[input]` block for a foreign CSV, and say in comments what could not be decided."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rivid.config import InputConfig
from rivid.errors import DataError
from rivid.logs.files import Limits, read_bytes, shown
from rivid.logs.guess import ColumnGuess, guess_column, guess_marks
from rivid.logs.layout import Layout, TimeLayout, guess_layout, guess_time
from rivid.logs.numbers import NumberReader
from rivid.logs.spec import MICRO

LOOKED_AT = 2 << 20
"""Bytes that are enough to tell a layout."""
ROWS = 20_000


@dataclass(frozen=True)
class Proposal:
    """What a file seems to be.

    Attributes
    ----------
    toml : str
        A configuration that `load_config` accepts, with comments.
    open_questions : list of str
        What the file alone does not tell.
    """

    toml: str
    open_questions: list[str]


def sniff(path: Path, time_zone: str | None = None) -> Proposal:
    """Propose an `[input]` block for a CSV, plain or gzipped.

    Parameters
    ----------
    path : Path
    time_zone : str, optional
        Zone of its clock, where its times carry no offset.

    Returns
    -------
    Proposal

    Raises
    ------
    DataError
        Where the file is no table with a header and times.
    """
    name = shown(path.name)
    if path.suffix.lower() == ".parquet":
        raise DataError(
            f"{name} is Parquet: it states its columns and types itself; set [input] names and units"
        )
    content, _ = read_bytes(path, name, Limits(512 << 20, 0))
    if len(content) > LOOKED_AT:
        content = content[: content.rfind(b"\n", 0, LOOKED_AT) + 1] or content[:LOOKED_AT]
    layout = guess_layout(content, name)
    del layout.rows[ROWS:]
    time = guess_time(layout)
    if time is None:
        raise DataError(
            f"{name}: no column reads as times; columns: {', '.join(layout.names)[:200]}; "
            "set [input] time and time_format"
        )
    return _propose(layout, time, path.name, time_zone)


def _propose(layout: Layout, time: TimeLayout, name: str, time_zone: str | None) -> Proposal:
    rest = [i for i in range(len(layout.names)) if i not in time.columns and layout.names[i]]
    cells = {i: [row[i] for row in layout.rows] for i in rest}
    decimal, thousands, mark_doubt = guess_marks(list(cells.values()))
    default = InputConfig()
    reader = NumberReader(default.missing, decimal, thousands)
    found = [guess_column(layout.names[i], layout.units[i], cells[i], reader) for i in rest]
    columns = [column for column in found if column is not None]
    questions = [doubt for doubt in (time.doubt, mark_doubt) if doubt]
    roles, kind = _roles(columns, questions)
    used = [column for group in roles.values() for column in group]
    step = sorted(time.steps)[len(time.steps) // 2] / MICRO if time.steps else 0.0
    every = min((column.every for column in used), default=1)

    keys: dict[str, Any] = {"time": _one_or_all([layout.names[i] for i in time.columns])}
    keys |= {role: _one_or_all([column.name for column in group]) for role, group in roles.items()}
    if kind == "pool" and "u_Qo" not in roles:
        keys["u_Qo"] = ""
    keys |= {"time_format": time.time_format, "time_zone": time_zone, "encoding": layout.encoding}
    keys |= {"separator": layout.separator, "decimal": decimal, "thousands": thousands}
    keys |= {"skip_rows": layout.skip_rows, "unit_rows": layout.unit_rows}
    texts = [t for t in dict.fromkeys(text for column in used for text in column.texts)]
    if texts:
        keys["missing"] = [*default.missing, *texts]
    keys["sentinels"] = sorted({s for column in used for s in column.sentinels})
    tables = {
        "units": {r: g[0].unit for r, g in roles.items() if g[0].unit},
        "interval": {r: g[0].every * step for r, g in roles.items() if g[0].every > every and step},
    }
    if not time.zoned and time_zone is None:
        questions.append("its times carry no UTC offset: set time_zone to the zone of the log's clock")
    for role, group in roles.items():
        if len({column.unit for column in group}) > 1:
            questions.append(f"the columns of {role} seem to have different units")
        elif not group[0].unit and group[0].name != role:
            unit = "m" if role == "h_L" else "m3/s"
            questions.append(
                f"no unit is written for {role}: {unit} is taken unless [input.units] says otherwise"
            )
    if texts:
        questions.append(f"{', '.join(map(repr, texts[:6]))}: taken for values that are not measured")
    questions.append(
        "does a value stand for the interval before its time, after it, or the instant? ([input.stamp])"
    )
    left = [column.name for column in columns if column not in used]
    if left:
        questions.append(f"columns left out: {', '.join(left)}")
    toml = _write(
        name, kind, step * every, {k: v for k, v in keys.items() if _needed(k, v, default)}, tables, questions
    )
    return Proposal(toml, questions)


def _roles(columns: list[ColumnGuess], questions: list[str]) -> tuple[dict[str, list[ColumnGuess]], str]:
    """Which column is which; several columns that leave the reach are summed."""
    roles: dict[str, list[ColumnGuess]] = {}
    by_role = {role: [c for c in columns if c.role == role] for role in ("u_Qi", "u_Qo", "h_L", "flow")}
    flows = by_role["flow"]
    if by_role["h_L"]:
        roles["h_L"] = by_role["h_L"][:1]
        roles["u_Qi"] = by_role["u_Qi"][:1] or flows[:1]
        roles["u_Qo"] = by_role["u_Qo"] or [c for c in flows if c not in roles["u_Qi"]][:1]
        kind = "pool"
    else:
        named, others = by_role["u_Qi"][:1], [*flows, *by_role["u_Qo"]]
        order = [*named, *others, *by_role["u_Qi"][1:]]  # what is not called an inflow is rather the output
        roles["u_Qi"], roles["Q_L"], kind = order[:1], order[1:2], "river"
        if len(order) > 2:
            questions.append("more than two discharges and no level: which is the inflow, which the output?")
    if len(by_role["u_Qi"]) > 1 and kind == "pool":
        questions.append(f"u_Qi: which of {', '.join(c.name for c in by_role['u_Qi'])}, or the sum of some?")
    if not roles["u_Qi"]:
        questions.append("no column is called like an inflow: set u_Qi")
    if kind == "river" and not roles["Q_L"]:
        questions.append("no column is called like a level or a second discharge: set h_L, or Q_L of a river")
    if len(roles.get("u_Qo", [])) > 1:
        questions.append(f"u_Qo: the sum of {', '.join(c.name for c in roles['u_Qo'])}?")
    return {role: group for role, group in roles.items() if group}, kind


def _one_or_all(names: list[str]) -> str | list[str]:
    return names[0] if len(names) == 1 else names


def _needed(key: str, value: Any, default: InputConfig) -> bool:
    return value is not None and value != getattr(default, key)


def _write(
    name: str,
    kind: str,
    sample_time: float,
    keys: dict[str, Any],
    tables: dict[str, Any],
    questions: list[str],
) -> str:
    # JSON strings, numbers and lists are TOML ones too, but for escapes that JSON alone knows
    def said(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")

    safe = "".join(c if c.isprintable() else "?" for c in name)
    lines = [f"# Proposed for {safe}. Read it through: what follows was seen, not known.", "[reach]"]
    lines += [f"kind = {said(kind)}"] + (
        [f"sample_time = {sample_time:g}"] if 1 <= sample_time <= 86_400 else []
    )
    lines += ["", "[input]"]
    lines += [f"{key} = {said(value)}" for key, value in keys.items()]
    for table, entries in tables.items():
        if entries:
            lines += ["", f"[input.{table}]"]
            lines += [f"{key} = {said(value)}" for key, value in entries.items()]
    lines += ["", "# Not decided:"]
    lines += ["# - " + "".join(c if c.isprintable() else "?" for c in question) for question in questions]
    return "\n".join(lines) + "\n"
