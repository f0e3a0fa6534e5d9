"""The columns of a foreign table: their numbers, marks, sentinels, units and roles."""

import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rivid.logs.log import sentinels_in
from rivid.logs.sniff.layout import Layout, number, steps_of
from rivid.logs.spec import read_text, stem_of
from rivid.logs.text import MANY_TEXTS, NumberReader, is_unit_column

MARKS = ((".", ""), (",", ""), (".", ","), (",", "."), (",", " "), (".", " "), (".", "'"), (",", "'"))
"""Decimal and thousands marks that are tried, the plainest first."""

_FLOW_UNITS = (
    ("kcfs", r"kcfs|1000 ?cfs"),
    ("cfs", r"cfs|ft3/s|ft³/s|ft\^3/s|ft3 s-1|cu\.? ?ft|00060"),
    ("m3/h", r"m3/h|m³/h"),
    ("L/s", r"l/s|lps"),
    ("ML/d", r"ml/d(ay)?|mld|megalit(er|re)s?/d(ay)?"),
    ("MGD", r"mgd"),
    ("m3/min", r"m3/min|m³/min"),
    ("m3/s", r"m3/s|m³/s|m\^3/s|m3s|m3\.s|m3 ?s-1|m\^?3 ?s\^-1|cms|cumec|mc/s"),
)
# 00060, 00065 and the like are the parameter codes of the USGS
_LEVEL_UNITS = (
    ("ft", r"ft|feet|foot|00065|00062|62614|62615"),
    ("cm", r"cm"),
    ("mm", r"mm"),
    ("m", r"m|masl|m ?asl|mngf|m ?ngf|mnn|m ?ahd|msnm|m ?od"),
)
# what may follow the unit of a level: its datum, as in `cm s.l.m.`, `m ü. NN`, `ft NAVD88`
_DATUM = r"( ?(\+|above|over|über|ü[. man]|a\.? ?s\.? ?l|s\.? ?l\.? ?m|n\.? ?[ahgn]).*)?"
# names of an outside level: the level of the reach only where no other is logged
TIDE = r"(?<![a-z])(tid(e|es|al)|mar[ée]es?|gezeiten|tide?n|mareas?|maree)(?![a-z])"
_ROLES = (
    (
        "h_L",
        r"level|stage|niveau|c[oô]t[ea]|pegel|spiegel|wasserstand|elev|height|forebay|hauteur|livell[oi]|n[ií]vel"
        r"|lvl|stauziel|headwater el|[ _]el$|^h[ _]|(?<![a-z])(hw|wsp|[ou]wp)(?![a-z])"
        r"|quota|altezza|altura|idrometr|limn[ií]|plan d'eau|l[áâa]mina|^h(_l)?$|^z$"
        rf"|{TIDE}"
        r"|^w$|[._ -][hw]$|_(00065|00062|62614|62615)\b",
    ),
    (
        "u_Qo",
        r"out|u_qo|aval|sortie|downstream|tailrace|abfluss|ablauf|abgabe|(^|(?<![a-z])q)ab(?![a-z])"
        r"|turbin|spill|vanne|gate|unit[ _]?\d|groupe|salien|wehr|weir|d[ée]vers|[ée]vacuateur|aliviadero"
        r"|compuerta|sluice|powerhouse|generation"
        r"|deflu|efluent|vertid|jusante|sortan|aguas?[ _]abajo|unterwasser|unterlieger|(?<![a-z])uw(?![a-z])"
        r"|(?<![a-z])valle(?![a-z])|scaric|uscent|uscita",
    ),
    (
        "u_Qi",
        r"inflow|u_qi|q_?in\b|(?<![a-z])in(?![a-z])|amont|entr|upstream|zufluss|zulauf"
        r"|(^|(?<![a-z])q)zu(?![a-z])|release|q_?i$|incoming"
        r"|entrante|aff?lu|apport|montante|aguas?[ _]arriba|oberwasser|oberlieger|(?<![a-z])ow(?![a-z])"
        r"|(?<![a-z])monte(?![a-z])|arrivo|ingress",
    ),
    ("flow", r"flow|discharge|d[ée]bit|durchfluss|caudal|vaz[ãa]o|portata|^q|cfs|cms|[._ -]q$|_00060\b"),
)
_SURE = {
    "u_Qi": r"inflow|u_qi|q_?in\b|(?<![a-z])in(?![a-z])|entr|zufluss|zulauf|(^|(?<![a-z])q)zu(?![a-z])"
    r"|incoming|aff?lu|apport",
    "u_Qo": r"outflow|u_qo|q_?out\b|(?<![a-z])out(?![a-z])|sortie|sortan|abfluss|ablauf|abgabe"
    r"|(^|(?<![a-z])q)ab(?![a-z])|outgoing|salien|deflu|efluent",
    "flow": r"^q_l$",
}
# words for the upstream and the downstream side of the reach
_UP = (
    r"upstream|upper|amont|arriba|montante|oberlieger|oberstufe|superior|uppstr|oppstr|(?<![a-z])up(?![a-z])"
)
_DOWN = (
    r"downstream|lower|aval|abajo|jusante|unterlieger|unterstufe|inferior|nedstr|(?<![a-z])(dn|down)(?![a-z])"
)
_PLANNED = r"set[ _-]?point|(?<![a-z])soll|consign|vorgabe"
# names and units of other quantities than a discharge or a level
_OTHER = (
    r"(?<![a-z])(rain|temp)|precip|niederschlag|pluie|lluvia|pioggia|chuva|(?<![a-z])wind(?![a-z])|[ée]vap"
    r"|opening|ouverture|öffnung|apertura"
    r"|leistung|puissance|potencia|potenza|energ|(?<![a-z])(mwh?|rpm)(?![a-z])|[ _]kwh?$|%"
)
_OTHER_UNIT = r"°?[cfk]|[kmg]?wh?|bar|hz|[ak]?v|h?m3|m³|hm³|ac-?ft|af|rpm|deg.*"
# names of a side of the reach; other names are of a place or a device on one side or the other
_PLACE = r"wasser|lieger|(?<![a-z])[ou]w(?![a-z])|amont|aval|stream|arriba|abajo|montante|monte|jusante|valle"

_QUALITY = "qual|calidad|flag|status|stato|estado|valid|state|etat|état|güte"  # names of a column of flags

Questions = list[tuple[str, str]]
"""Open questions: the key of `[input]`, which may be empty, and the question."""


def looks_like_flags(column: str, texts: set[str] | None, read: set[str]) -> bool:
    """Whether a column outside `read` may hold flags; `texts` are its different cells, None for many."""
    if texts is None or texts <= {""} or is_unit_column(column):
        return False
    low = column.lower()
    zone = {"tz", "utc", "gmt"} & set(re.split(r"[^a-z]+", low))
    if zone or re.search(rf"{_QUALITY}|qc|remark|code|zone", low):
        return True
    if any(low != name.lower() and low.startswith(name.lower()) for name in read):
        return True
    plain = [text for text in texts if number(text.replace(",", ".")) is None]
    return len(texts) > 1 and bool(set(plain) - {""}) and max(map(len, texts)) <= 12


@dataclass(frozen=True)
class ColumnGuess:
    """A column of numbers."""

    name: str
    role: str  # u_Qi, u_Qo, h_L, "flow" for another discharge, or empty
    unit: str  # as in `[input.units]`; empty where the log does not state it
    sentinels: tuple[float, ...]
    texts: tuple[str, ...]  # texts of cells that hold no number
    every: int  # rows from one value to the next, usually
    sure: bool = False  # whether the name leaves no doubt that it is an inflow, or an outflow


def guess_marks(columns: Sequence[Sequence[str]]) -> tuple[str, str, str]:
    """Decimal mark, thousands mark, and what stays open, of the cells of all columns."""
    cells = [cell for column in columns for cell in column if re.search(r"\d", cell)]
    readers = [NumberReader((), *marks) for marks in MARKS]
    best = max(readers, key=lambda reader: sum(reader.read(cell) is not None for cell in cells))
    commas = [] if any("." in cell for cell in cells) else [cell for cell in cells if "," in cell]
    doubt = ""
    for mark, name, marked in ((",", "comma", commas), (r"\.", "point", cells)):
        if marked and all(re.fullmatch(rf"[+-]?\d{{1,3}}{mark}\d{{3}}", cell) for cell in marked):
            doubt = f"{marked[0]!r}: is the {name} a decimal mark (as taken here) or between thousands?"
    return best.decimal, best.thousands, doubt


def guess_column(name: str, unit: str, cells: Sequence[str], reader: NumberReader) -> ColumnGuess | None:
    """The role, unit and other traits of a column; None for one that does not hold numbers."""
    read = [reader.read(cell) for cell in cells]
    texts = [cell for cell, value in zip(cells, read, strict=True) if value is None]
    values = {i: value for i, value in enumerate(read) if value is not None and value == value}
    if not values or len(values) < len(texts):
        return None
    steps = Counter(b - a for a, b in pairwise(values))
    every = steps.most_common(1)[0][0] if steps else 1
    role, known = _guess_role(name, unit)
    if not role and len({*cells}) == 1 and _is_identifier(name, [*cells]):
        return None  # the number of the station in each row
    sure = re.search(_SURE.get(role, "$^"), name.lower()) is not None
    sure = sure and not re.search(_PLANNED, name.lower())
    found = tuple(sentinels_in(np.array([*values.values()])))
    return ColumnGuess(name, role, known, found, tuple(dict.fromkeys(texts)), every, sure)


def _guess_role(name: str, unit_text: str) -> tuple[str, str]:
    text = name.lower()
    unit_text = unit_text or bracketed(name)
    if _is_other(name, unit_text):
        return "", ""
    flow = stated_unit(name, unit_text, level=False)
    level = "" if flow else stated_unit("", unit_text, level=True)
    if not unit_text and not flow:  # "OWP m ü.A."; of a name that ends in mm it is rather rain
        ends = (text[match.end() :] for match in _BREAK.finditer(text))
        level = next((u for end in ends if (u := stated_unit("", end, level=True)) not in ("", "mm")), "")
    role = next((role for role, words in _ROLES if re.search(words, text)), "")
    if role == "h_L" and re.search(_PLANNED, text):
        return "", ""
    if role == "h_L" and flow:
        return "flow", flow
    if role == "h_L":
        return role, stated_unit(name, unit_text, level=True)
    if level and (not role or re.search(_PLACE, text)):
        return "h_L", level  # "Oberwasser [m]"
    if level:
        return "", ""  # the opening of a gate
    return role or ("flow" if flow else ""), flow


def _is_other(name: str, unit: str) -> bool:
    """Whether a column holds another quantity than a discharge or a level, by its name or unit."""
    return bool(re.search(_OTHER, name.lower()) or re.fullmatch(_OTHER_UNIT, unit.strip().lower()))


def bracketed(name: str) -> str:
    """The text in brackets in the name of a column, usually its unit; empty for none."""
    match = re.search(r"[\[(]([^\])]*)[\])]", name)
    return match[1].strip() if match else ""


def stated_unit(name: str, text: str, *, level: bool) -> str:
    """The unit of a level, or else of a discharge, in its name or in the text of its unit; empty for none."""
    datum = _DATUM if level else ""
    for unit, words in _LEVEL_UNITS if level else _FLOW_UNITS:
        if re.fullmatch(rf"[\[(]?({words}){datum}[\])]?", text.strip().lower()):
            return unit
        if re.search(rf"(?<![a-z0-9])({words})(?![a-z0-9])", name.lower().replace("_", " ")):
            return unit
    return ""


MOST_TAGS = 200
VALUE = re.compile(r"values?|val|v|pv|wert|messwert|valeurs?|valor|valore|reading|vtq|magnitude", re.I)
_IDENTIFIER = re.compile(
    r"station|site|sensor|gau?ge|tag|point|param|series|(^|[^a-z])(id|no|nr|num|number|code)$|id$", re.I
)
_FLAGS = re.compile(rf"{_QUALITY}|\bqc\b|remark|tz|zone", re.I)
NUMBER = re.compile(r"[+-]?[\d.,' \u00a0]*\d[\d.,' \u00a0]*([eE][+-]?\d+)?")


def find_tags(layout: Layout, file: str) -> None:
    """Find the columns of values, or the tags of a long table; `file` names the tag if no column does."""
    names, value_at = layout.names, _value_column(layout)
    tags_at = () if value_at is None else _tag_columns(layout, value_at)
    if value_at is None or not (layout.blocks or tags_at or VALUE.fullmatch(names[value_at])):
        cells = layout.cells()
        layout.columns = [(names[i], layout.units[i], cells[i]) for i in cells if names[i]]
    elif layout.blocks:
        _by_tag(layout, value_at, layout.blocks, layout.block_units)
    elif tags_at:
        tags = [" ".join(row[i] for i in tags_at) for row in layout.rows]
        # the column of values may state a unit, as discharge_cfs
        flow, level = (stated_unit(names[value_at], "", level=level) for level in (False, True))
        units = dict.fromkeys(tags, flow or level)
        unit_at = next((i for i, name in enumerate(names) if is_unit_column(name)), None)
        if unit_at is not None:
            units = {tag: row[unit_at] for tag, row in zip(tags[::-1], layout.rows[::-1], strict=True)}
        layout.tag = tuple(names[i] for i in tags_at)
        _by_tag(layout, value_at, tags, units)
    else:
        _by_tag(layout, value_at, [stem_of(file)] * len(layout.rows), {})


def _value_column(layout: Layout) -> int | None:
    """The one column of numbers that is no flag or identifier; None where there are several."""
    numbers = {i: cells for i, cells in layout.cells().items() if _numeric(cells)}
    names = {i: layout.names[i] for i, cells in numbers.items() if not _is_identifier(layout.names[i], cells)}
    rest = [i for i, name in names.items() if not _FLAGS.search(name)]
    named = [i for i in rest if VALUE.fullmatch(names[i])]
    return named[0] if len(named) == 1 else rest[0] if len(rest) == 1 else None


def _is_identifier(name: str, cells: list[str]) -> bool:
    """Whether a column holds whole numbers that name a station or a quantity."""
    return _IDENTIFIER.search(name) is not None and all(re.fullmatch(r"\d*", cell) for cell in cells)


def _tag_columns(layout: Layout, value_at: int) -> tuple[int, ...]:
    """The first columns of names or identifiers that together make each time of a tag unique."""
    found: list[int] = []
    for i, cells in layout.cells().items():
        name, texts = layout.names[i], set(cells)
        if i == value_at or _FLAGS.search(name) or is_unit_column(name):
            continue
        if not 2 <= len(texts) <= MOST_TAGS or "" in texts:
            continue
        if _numeric(cells) and not _is_identifier(name, cells):
            continue
        found.append(i)
        keys = Counter((layout.time(row), *(row[k] for k in found)) for row in layout.rows)
        if max(keys.values()) == 1:
            return tuple(found)
    return tuple(found[:1])


def _by_tag(layout: Layout, value_at: int, tags: list[str], units: dict[str, str]) -> None:
    """Set the tags: the tag of each row, and the unit of each tag that states one."""
    cells: dict[str, list[str]] = defaultdict(list)
    times: dict[str, set[int]] = defaultdict(set)
    for tag, row in zip(tags, layout.rows, strict=True):
        moment = read_text(layout.time(row), layout.time_format)
        cells[tag].append(row[value_at])
        if moment is not None:
            times[tag].add(moment[0])
    layout.value = layout.names[value_at]
    layout.columns = [(tag, units.get(tag, ""), values) for tag, values in cells.items()]
    layout.tag_steps = {tag: steps_of(sorted(known)) for tag, known in times.items()}
    stepping = [tag for tag in layout.tag_steps if layout.usual(tag)]
    layout.steps = layout.tag_steps[min(stepping, key=layout.usual)] if stepping else []


# flags that usually mean a good value; beside OPC's 192, 0 means a bad one
GOOD = frozenset(("good", "ok", "valid", "a", "approved", "0", "192", "g", "gut", "bon", "normal"))
OFFSETS = {
    "UTC": "+00:00", "GMT": "+00:00", "Z": "+00:00", "WET": "+00:00", "WEST": "+01:00", "BST": "+01:00",
    "CET": "+01:00", "MEZ": "+01:00", "CEST": "+02:00", "MESZ": "+02:00", "EET": "+02:00", "EEST": "+03:00",
    "EST": "-05:00", "EDT": "-04:00", "CST": "-06:00", "CDT": "-05:00", "MST": "-07:00", "MDT": "-06:00",
    "PST": "-08:00", "PDT": "-07:00", "AKST": "-09:00", "AKDT": "-08:00",
}  # fmt: skip
"""Usual offsets of the abbreviations of zones."""


def code_columns(layout: Layout) -> list[int]:
    """Places of the columns of quality codes: whole numbers without unit, behind each column of values.

    Most rows of each have the same one. The values state the unit of a flow, or the codes have one name.
    """
    names, units = layout.names, layout.units
    cells = {i: column for i, column in layout.cells().items() if names[i]}
    flows, levels = ({i for i in cells if stated_unit(names[i], units[i], level=k)} for k in (False, True))
    whole = {i for i in cells.keys() - flows - levels if all(re.fullmatch(r"\d*", cell) for cell in cells[i])}
    few = {i for i in whole if len(set(cells[i])) <= MANY_TEXTS}
    codes = [i + 1 for i, column in cells.items() if i not in few and _numeric(column)]
    if len(codes) < 2 or not few >= set(codes) or not (flows or len({names[i] for i in codes}) == 1):
        return []
    common = [Counter(cells[i]).most_common(1)[0] for i in codes]
    alike = len({code for code, _ in common} | {""}) == 2
    return codes if alike and 2 * min(count for _, count in common) > len(layout.rows) else []


def name_each(layout: Layout) -> None:
    """Make names that occur twice unique: of flags by the column to their left, of others by their place."""
    counts, codes, names = Counter(layout.names), code_columns(layout), list(layout.names)
    for i, name in enumerate(layout.names):
        if name and counts[name] > 1:
            flag = i in codes or (_is_flag(name) and names[i - 1] not in ("", name))
            names[i] = f"{names[i - 1]} {name}" if flag else f"{name} {i + 1}"
    layout.names = tuple(names)


@dataclass(frozen=True)
class Flags:
    """Columns of flags and zones."""

    owned: dict[str, str]  # column of flags by the column it belongs to
    of_row: str  # the one column of flags for the whole row; may be empty
    good: list[str]  # flags that are taken as good
    counted: str  # all flags, with counts
    zone_column: str
    zones: dict[str, str]  # offset by zone
    doubtful: list[str]  # columns that `ingest` refuses undeclared: other flags, or to be ignored


def find_flags(layout: Layout) -> Flags:
    """Find columns of flags and zones."""
    cells = {layout.names[i]: column for i, column in layout.cells().items()}
    names = [name for name in cells if name and name not in (*layout.tag, layout.value)]
    texts = {name: set(cells[name]) for name in names}
    zone_column = next((name for name in names if texts[name] and texts[name] <= set(OFFSETS)), "")
    zones = {zone: OFFSETS[zone] for zone in sorted(texts.get(zone_column, ()))}
    codes = {} if layout.value else {layout.names[i]: layout.names[i - 1] for i in code_columns(layout)}
    numbers = {n for n in names if n not in codes and not _is_flag(n) and _numeric(cells[n])}
    read = {layout.value} if layout.value else numbers
    few = {name: found if len(found) <= MANY_TEXTS else None for name, found in texts.items()}
    others = [name for name in names if name != zone_column and not is_unit_column(name)]
    doubtful = [name for name in others if name in codes or looks_like_flags(name, few[name], read)]
    if doubtful:  # where others are used, an empty one is a column of flags too
        empty = [name for name in names if texts[name] == {""} and _is_flag(name) and _owner(name, read)]
        doubtful = [name for name in names if name in doubtful or name in empty]
    flags = {} if layout.value else {o: n for n in doubtful if (o := codes.get(n) or _owner(n, read))}
    free = [name for name in doubtful if _is_flag(name) and name not in flags.values()]
    of_row = free[0] if len(free) == 1 and not flags else ""
    chosen = [*flags.values()] or ([of_row] if of_row else [])
    counts = Counter(text for name in chosen for text in cells[name])
    common = counts.most_common(1)[0][0] if counts else ""
    good = [f for f in counts if f == common or f.lower() in GOOD and not (f == "0" and "192" in counts)]
    counted = ", ".join(f"{flag!r} {count}" for flag, count in counts.most_common(12))
    return Flags(flags, of_row, good, counted, zone_column, zones, doubtful)


def _numeric(cells: list[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return 2 * sum(NUMBER.fullmatch(cell) is not None for cell in filled) > len(filled)


def _owner(name: str, columns: set[str]) -> str:
    """The column of values that a column of flags is named after."""
    owners = [column for column in columns if name != column and name.startswith(column)]
    return max(owners, key=len, default="")


def _is_flag(name: str) -> bool:
    return re.search(rf"{_QUALITY}|\bqc\b|_cd$", name, re.I) is not None


Group = list[ColumnGuess]
NO_INFLOW = "no column is called like an inflow: set u_Qi"
NO_OUTPUT = "no column is called like a level or a second discharge: set h_L, or Q_L of a river"
MOST = 6  # other choices that are shown
_BREAK = re.compile(r"[\s._:/\\|-]+")
_NO_SITE = re.compile(
    r"(q|h|w|z|flows?|discharge|in|out|inflow|outflow|level|stage|elev\w*|debit|débit|niveau|cot[ea]|hauteur"
    r"|pegel|wasserstand|durchfluss|zufluss|abfluss|caudal|vaz[ãa]o|n[ií]vel|altura|portata|livello|quota|altezza"
    r"|total|sum|mean|avg"
    r"|(u|g|t|unit|units|groupe|turbines?|gates?|spill\w*|vannes?|tor|wehr|release"
    r"|weir|sluice|powerhouse|generation|power|compuertas?|aliviadero|[eé]vacuateur)\d*)"
)
"""First words of names that are a quantity or a machine, not a place."""
_TOTAL = re.compile(r"(?<![a-z])(total|sum|gesamt|summe|somme|suma|totale)(?![a-z])")
_TAILWATER = re.compile(r"tail|unterwasser|(?<![a-z])[ut]w(?![a-z])|down|aval|abajo")
_UPPER = re.compile(r"upper|superior|ober(e|er|es|stufe)(?![a-z])")


def _outside(level: ColumnGuess) -> tuple[bool, ...]:
    """Sort key of levels: those of the reach, of the pool above, of its tailwater, of the tide."""
    name = level.name.lower()
    return tuple(re.search(words, name) is not None for words in (TIDE, _TAILWATER, _UPPER))


Roles = tuple[dict[str, Group], str, dict[str, list[Group]]]
"""Columns by canonical column (several are summed, none may be found), kind of reach, other choices."""


def roles_of(columns: list[ColumnGuess], questions: Questions) -> Roles:
    """Assign columns to roles; `questions` get what the names do not determine.

    What no name and no unit assigns is another choice of the roles that are not found.
    """
    if len(columns) > 1 and not any(c.role for c in columns):
        return _by_order(columns, questions)
    free = [c for c in columns if not c.role and not _is_other(c.name, bracketed(c.name))]
    named = {c.role for c in columns if c.role}
    sure = {c.role for c in columns if c.sure}
    names = " or ".join(c.name for c in free)
    lacking = ""
    if any(re.search(r"[\[(]", c.name) for c in free):
        pass  # in brackets is the unit of something else
    elif len(free) == 2 and named == {"h_L"}:
        lacking = "flow"
    elif len(free) == 1 and {"u_Qi", "u_Qo"} <= sure and "h_L" not in named:
        lacking = "h_L"
        questions.append(("h_L", f"h_L: is {names} the level? (no name states it)"))
    if lacking:
        columns, free = [c if c.role else replace(c, role=lacking) for c in columns], []
    roles, kind, instead = _by_words(columns, questions)
    for role in ("u_Qi", "u_Qo") if kind == "pool" else ("u_Qi", "Q_L", "h_L"):
        if free and not roles.get(role):
            instead[role] = [[c] for c in free[:MOST]]
            if role == "u_Qo":
                questions.append((role, f'u_Qo: is it {names}, or "" as the outflow is not logged?'))
            elif role == "h_L":
                text = f'is {names} the level? Then kind = "pool", and u_Qo is what Q_L is here'
                questions.append((role, text))
    return roles, kind, instead


def _by_words(columns: list[ColumnGuess], questions: Questions) -> Roles:
    """Assign columns to roles by the words in their names, and their units."""
    flows = _by_side([c for c in columns if c.role in ("u_Qi", "u_Qo", "flow")])
    levels = [c for c in columns if c.role == "h_L"]
    if not levels:
        return _river(flows, questions)
    level = min(levels, key=_outside)
    instead: dict[str, list[Group]] = {}
    if len(levels) > 1:
        names = ", ".join(c.name for c in levels)
        questions.append(("h_L", f"h_L: which of {names} is the level at the downstream dam?"))
        instead["h_L"] = [[c] for c in levels if c is not level]
    sites, ends = (_sites([*flows, level], backwards) for backwards in (False, True))
    found = _by_site(flows, level, sites)
    if not found and not any(c.sure and c.role == "u_Qi" for c in flows):
        found = _by_site(flows, level, ends)
    ins, outs, why = found or _by_name(flows, sites)
    if not ins:
        questions.append(("u_Qi", NO_INFLOW))
    doubt = len(outs) > 1 if not ins else len(flows) > 1 or not ins[0].sure
    if doubt and not _unmistakable(ins, outs, flows):
        for role, what, group, reason in (("u_Qi", "inflow", ins, why[0]), ("u_Qo", "outflow", outs, why[1])):
            names = ", ".join(c.name for c in group)
            if len(group) > 1:
                names, reason = f"the sum of {names}", f"{reason}; a list is a sum"
            if group:
                questions.append((role, f"{role}: is {names} the {what}? ({reason})"))
        instead |= _others(ins, outs, flows, sites)
    return {"h_L": [level], "u_Qi": ins, "u_Qo": outs}, "pool", instead


def _by_order(columns: Group, questions: Questions) -> Roles:
    """Columns without a name that states a quantity: in the order of rivid's own logs."""
    kind, roles = ("river", ("u_Qi", "Q_L")) if len(columns) == 2 else ("pool", ("u_Qi", "u_Qo", "h_L"))
    names = ", ".join(c.name for c in columns)
    text = f"no name states what {names} are: {', '.join(roles)} in their order, check each"
    questions.append(("u_Qi", text))
    return {role: [c] for role, c in zip(roles, columns, strict=False)}, kind, {}


def _river(flows: Group, questions: Questions) -> Roles:
    named = [c for c in flows if c.role == "u_Qi"]
    rest = [c for kind in ("flow", "u_Qo") for c in flows if c.role == kind]
    order = [*named[:1], *rest, *named[1:]]  # what is not called an inflow is rather the output
    ins, outs = order[:1], order[1:2]
    instead: dict[str, list[Group]] = {}
    if not ins:
        questions.append(("u_Qi", NO_INFLOW))
    if not outs:
        questions.append(("h_L", NO_OUTPUT))
    elif not _unmistakable(ins, outs, flows):
        many = "more than two discharges" if len(order) > 2 else "two discharges"
        questions.append(("u_Qi", f"{many} and no level: which is the inflow, which the output?"))
        instead = {"u_Qi": _distinct([[c] for c in order], ins), "Q_L": _distinct([[c] for c in order], outs)}
    return {"u_Qi": ins, "Q_L": outs}, "river", instead


def _by_side(flows: Group) -> Group:
    """Set the roles of flows by the side of the reach in their names, where both sides are named."""
    # a dam's turbines, weirs and releases are on its side
    found = [[re.search(words, c.name.lower()) is not None for words in (_UP, _DOWN)] for c in flows]
    if not {(True, False), (False, True)} <= {(up, down) for up, down in found}:
        return flows
    roles = ["u_Qi" if up else "u_Qo" if down else c.role for c, (up, down) in zip(flows, found, strict=True)]
    return [
        c if c.role == role or c.sure and c.role == "u_Qi" else replace(c, role=role, sure=False)
        for c, role in zip(flows, roles, strict=True)
    ]


def _unmistakable(ins: Group, outs: Group, flows: Group) -> bool:
    """Whether names alone determine the inflow and the outflow."""
    sure_in = [c for c in flows if c.sure and c.role == "u_Qi"]
    sure_out = [c for c in flows if c.sure and c.role != "u_Qi"]
    return len(ins) == 1 and len(outs) <= 1 and ins == sure_in and outs == sure_out


def _sites(columns: Group, backwards: bool = False) -> dict[str, str]:
    """The site of each column by its name: the first word that they do not all share; empty for none.

    Or, backwards, the last word.
    """
    words = {c.name: _BREAK.split(re.sub(r"[\[(].*", "", c.name).strip().lower()) for c in columns}
    if backwards:
        words = {name: parts[::-1] if not parts[-1].isdigit() else [] for name, parts in words.items()}
    shared = 0
    while all(len(w) > shared + 1 for w in words.values()) and len({w[shared] for w in words.values()}) == 1:
        shared += 1
    sites = {name: parts[shared] if len(parts) > shared + 1 else "" for name, parts in words.items()}
    return {name: "" if _NO_SITE.fullmatch(site) else site for name, site in sites.items()}


def _by_site(
    flows: Group, level: ColumnGuess, sites: dict[str, str]
) -> tuple[Group, Group, tuple[str, str]] | None:
    """The flows of the level's site, downstream, and those of the first other one; None without two sites."""
    here = sites[level.name]
    others = [sites[c.name] for c in flows if sites[c.name] not in ("", here)]
    own = [c for c in flows if sites[c.name] == here]
    if not here or not others or all(c.sure and c.role == "u_Qi" for c in own):
        return None
    outs = _leaving(own)
    ins = _leaving([c for c in flows if sites[c.name] == others[0]])
    # the names as they are written, up to the site
    words = ((c.name, rf"(?<![^\W\d_]){re.escape(sites[c.name])}(?![^\W\d_])") for c in (ins[0], level))
    that, this = (name[: m.end() if (m := re.search(word, name.lower())) else None] for name, word in words)
    return ins, outs, (f"of {that}, not of the level's site", f"of {this}, as the level")


def _leaving(group: Group) -> Group:
    """The outflows of a site: without those called an inflow, and a total rather than the sum of all."""
    group = [c for c in group if not (c.sure and c.role == "u_Qi")] or group
    return [c for c in group if _TOTAL.search(c.name.lower())][:1] or group


def _by_name(flows: Group, sites: dict[str, str]) -> tuple[Group, Group, tuple[str, str]]:
    """The inflow, the outflow and the reasons, by the names of the columns, else in their order."""
    called_in = sorted((c for c in flows if c.role == "u_Qi"), key=lambda c: not c.sure)
    called_out = [c for c in flows if c.role == "u_Qo"]
    neutral = [c for c in flows if c.role == "flow"]
    ins = called_in[:1] or neutral[:1]
    outs = called_out or [c for c in [*neutral, *called_in] if c not in ins][:1]
    outs = [c for c in outs if c.sure] or outs
    if all(sites[c.name] for c in outs):  # sites are never mixed in a sum
        outs = [c for c in outs if sites[c.name] == sites[outs[0].name]]
    outs = [c for c in outs if _TOTAL.search(c.name.lower())][:1] or outs
    if not ins:
        ins = [c for c in called_out if c not in outs and sites[c.name] != sites[outs[0].name]][:1]
    guessed = "guessed by its name"
    first = "it is only the first discharge" if ins and ins[0].role == "flow" else guessed
    second = "its name does not determine it" if outs and outs[0].role == "flow" else guessed
    return ins, outs, (first, second)


def _others(ins: Group, outs: Group, flows: Group, sites: dict[str, str]) -> dict[str, list[Group]]:
    """Other choices of inflow and outflow: each other, all of another site, any other column."""
    named = dict.fromkeys(filter(None, (sites[c.name] for c in flows)))
    whole = [_leaving([c for c in flows if sites[c.name] == site]) for site in named]
    left, rest = [[c] for c in flows if c not in ins and c not in outs], [c for c in flows if c not in ins]
    rest = rest if len({sites[c.name] for c in rest} - {""}) < 2 else []  # no sum is of two sites
    return {
        "u_Qi": _distinct([outs, *whole, *left], ins),
        "u_Qo": _distinct([rest, ins, *whole, *left], outs),
    }


def _distinct(groups: Sequence[Group], but: Group) -> list[Group]:
    """The first groups that are not empty, not `but`, and not there yet."""
    return [g for k, g in enumerate(groups) if g and g != but and g not in groups[:k]][:MOST]
