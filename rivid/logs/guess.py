"""What the columns of a foreign table are: numbers, marks, sentinels, units, and which is which."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rivid.logs.numbers import NumberReader
from rivid.logs.sentinels import sentinels_in

MARKS = ((".", ""), (",", ""), (".", ","), (",", "."), (",", " "), (".", " "), (".", "'"), (",", "'"))
"""Decimal and thousands marks that are tried, the plainest first."""

_FLOW_UNITS = (
    ("cfs", r"cfs|ft3/s|ft³/s|ft\^3/s|cu\.? ?ft|00060"),
    ("m3/h", r"m3/h|m³/h"),
    ("L/s", r"l/s|lps"),
    ("m3/s", r"m3/s|m³/s|m\^3/s|m3s|m3\.s|cms|cumec"),
)
# 00060, 00065 and the like are the parameter codes of the USGS
_LEVEL_UNITS = (
    ("ft", r"ft|feet|foot|00065|00062|62614|62615"),
    ("cm", r"cm"),
    ("mm", r"mm"),
    ("m", r"m|masl|m ?asl|mngf|m ?ngf|mnn"),
)
_ROLES = (
    (
        "h_L",
        r"level|stage|niveau|cote|pegel|wasserstand|elev|height|forebay|hauteur|livello|nivel|^h(_l)?$|^z$"
        r"|[._ -][hw]$|_(00065|00062|62614|62615)\b",
    ),
    (
        "u_Qo",
        r"out|u_qo|aval|sortie|downstream|tailrace|abfluss|turbin|spill|vanne|gate|unit[ _]?\d|groupe|salien"
        r"|sortan|aguas?[ _]abajo|unterwasser|unterlieger|(?<![a-z])uw(?![a-z])",
    ),
    (
        "u_Qi",
        r"inflow|u_qi|q_?in\b|(?<![a-z])in(?![a-z])|amont|entr|upstream|zufluss|release|q_?i$|incoming|entrante"
        r"|aguas?[ _]arriba|oberwasser|oberlieger|(?<![a-z])ow(?![a-z])",
    ),
    ("flow", r"flow|discharge|d[ée]bit|durchfluss|caudal|portata|^q|cfs|cms|[._ -]q$|_00060\b"),
)
_SURE = {
    "u_Qi": r"inflow|u_qi|q_?in\b|(?<![a-z])in(?![a-z])|entr|zufluss|incoming",
    "u_Qo": r"outflow|u_qo|q_?out\b|(?<![a-z])out(?![a-z])|sortie|sortan|abfluss|outgoing|salien",
    "flow": r"^q_l$",
}
_PLACE = r"wasser|lieger|(?<![a-z])[ou]w(?![a-z])|amont|aval|stream|arriba|abajo"
"""Names that tell which way the water goes; all others tell a place or a device, on one side or the other."""


@dataclass(frozen=True)
class ColumnGuess:
    """A column of numbers.

    Attributes
    ----------
    name : str
    role : str
        u_Qi, u_Qo, h_L, flow for a discharge of which no more is known, or empty.
    unit : str
        As `[input.units]` writes it; empty where the log does not say.
    sentinels : tuple of float
    texts : tuple of str
        What stands in cells that hold no number.
    every : int
        Rows from one value to the next, usually.
    sure : bool
        Whether the name leaves no doubt that it is an inflow, or an outflow.
    """

    name: str
    role: str
    unit: str
    sentinels: tuple[float, ...]
    texts: tuple[str, ...]
    every: int
    sure: bool = False


def guess_marks(columns: Sequence[Sequence[str]]) -> tuple[str, str, str]:
    """Decimal mark, thousands mark, and what stays open, of the cells of all columns."""
    cells = [cell for column in columns for cell in column if re.search(r"\d", cell)]
    counts = []
    for decimal, thousands in MARKS:
        reader = NumberReader((), decimal, thousands)
        counts.append(sum(reader.read(cell) is not None for cell in cells))
    decimal, thousands = MARKS[counts.index(max(counts))]
    with_comma = [cell for cell in cells if "," in cell]
    doubt = ""
    if with_comma and all(re.fullmatch(r"[+-]?\d{1,3},\d{3}", cell) for cell in with_comma):
        if not any("." in cell for cell in cells):
            doubt = f"{with_comma[0]!r}: is the comma a decimal mark (as taken here) or between thousands?"
    if cells and all(re.fullmatch(r"[+-]?\d{1,3}\.\d{3}", cell) for cell in cells):
        doubt = f"{cells[0]!r}: is the point a decimal mark (as taken here) or between thousands?"
    return decimal, thousands, doubt


def guess_column(name: str, unit: str, cells: Sequence[str], reader: NumberReader) -> ColumnGuess | None:
    """What a column is; None for one that does not hold numbers."""
    values, texts, at = [], Counter[str](), []
    for i, cell in enumerate(cells):
        value = reader.read(cell)
        if value is None:
            texts[cell] += 1
        elif value == value:
            values.append(value)
            at.append(i)
    if not values or len(values) < texts.total():
        return None
    steps = Counter(b - a for a, b in pairwise(at))
    every = steps.most_common(1)[0][0] if steps else 1
    role, known = _guess_role(name, unit)
    sure = re.search(_SURE.get(role, "$^"), name.lower()) is not None
    return ColumnGuess(name, role, known, tuple(sentinels_in(np.array(values))), tuple(texts), every, sure)


def _guess_role(name: str, unit_text: str) -> tuple[str, str]:
    text = name.lower()
    if not unit_text and (match := re.search(r"[\[(]([^\])]*)[\])]", name)):
        unit_text = match[1]
    flow = _unit_in(text, unit_text, _FLOW_UNITS)
    role = next((role for role, words in _ROLES if re.search(words, text)), "")
    if role == "h_L" and flow:
        role = "flow"
    if role == "h_L":
        return role, _unit_in(text, unit_text, _LEVEL_UNITS)
    level = "" if flow else _unit_in("", unit_text, _LEVEL_UNITS)
    if role and level and re.search(_PLACE, text):
        return "h_L", level  # "Oberwasser [m]"
    if not role:
        return ("flow", flow) if flow else ("h_L", level) if level else ("", "")
    return role, flow


def unit_said(name: str, unit: str, *, level: bool) -> str:
    """The unit of a level, or else of a discharge, that its name or the text beside it tells; empty: none."""
    return _unit_in(name.lower(), unit, _LEVEL_UNITS if level else _FLOW_UNITS)


def _unit_in(text: str, unit_text: str, units: tuple[tuple[str, str], ...]) -> str:
    for unit, words in units:
        if re.fullmatch(rf"[\[(]?({words})[\])]?", unit_text.strip().lower()):
            return unit
        if re.search(rf"(?<![a-z0-9])({words})(?![a-z0-9])", re.sub("_", " ", text)):
            return unit
    return ""
