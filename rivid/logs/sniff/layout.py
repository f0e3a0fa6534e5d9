"""The layout of a foreign text file: encoding, separator, header, and how its times are written."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median_high

from rivid.errors import DataError
from rivid.logs.spec import read_text
from rivid.logs.text import LINE, ZRXP_UNIT, split_cells, unmarked_utf16

# in this order where several fit: a comma may be a decimal mark, a blank may be within a time
SEPARATORS = (";", "\t", "|", ",", " ")
MARKS = ("#", "!", "%", "//")  # prefixes of lines without data, in the order in which they are tried
# regular expression of the comment of a ZRXP file that holds the tag of the rows below
ZRXP_TAG = "#REXCHANGE([^|]+)"
_DATES = (
    "%d/%m/%Y %m/%d/%Y %d.%m.%Y %d-%m-%Y %m-%d-%Y %Y/%m/%d %d/%m/%y %m/%d/%y %d.%m.%y %d-%b-%Y %d-%b-%y"
).split()
_CLOCKS = ("%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p", "%H:%M:%S.%f", "%H:%M:%S,%f", "%H.%M.%S", "%H.%M")
FORMATS: tuple[str | None, ...] = (
    None,
    *(f"{date} {clock}" for date in _DATES for clock in _CLOCKS),
    *("%Y%m%d%H%M%S", "%Y%m%d%H%M", "%Y%m%d%H", "%Y%m%d %H%M", "%Y-%m-%d %I:%M:%S %p"),
)
"""Formats of times that are tried; None is ISO 8601."""
# length of a time without separators: strptime also reads 200810172305, of 12 digits, as 23:00:05
_DIGITS = {"%Y%m%d%H%M%S": 14, "%Y%m%d%H%M": 12, "%Y%m%d%H": 10}
_CLOCK = re.compile(r"\d{1,2}[:.]\d\d([:.]\d\d(\.\d+)?)?( ?[AaPp][Mm])?")
# formats of times that are numbers, and the range of each: 1973 to 2099, which do not overlap
EPOCHS = {"unix": (1e8, 41e8), "unix_ms": (1e11, 41e11), "excel": (26_665.0, 73_051.0)}
# columns that are parts of a time, by their names
_PARTS = {
    "%Y": r"years?|yr|yyyy|jahr|ann[ée]e|a[ñn]o|anno",
    "%m": r"months?|mon?|mm|monat|mois|mes|mese",
    "%d": r"days?|dy|dd|tag|jour|d[ií]a|giorno",
    "%H": r"hours?|hr|h|hh|stunde|heure|hora|ora",
    "%M": r"min(ut[eo]s?)?|mi",
    "%S": r"sec(onds?)?|ss|sek(unde)?|seconde|segundo",
}
# names of columns of times
_TIME = r"time|stamp|unix|epoch|dat[eau]|zeit|fecha|heure|utc|(?<![a-z])(h?ora|ts?)(?![a-z])"
FEWEST_STEPS = 10  # of numbers that are times because they rise in equal steps
_MILLI = r"(?<![a-z])(ms|msec|milli\w*)(?![a-z])"
_LONG_UNIT = r"(?<![a-z])(m|min|minutes?|h|hr|hours?|d|days?)(?![a-z])"  # no time format counts these
# longest step [us] between rows: the wrong order of day and month makes steps of months
LONGEST_JUMP = 20 * 86_400 * 1_000_000


@dataclass
class Layout:
    """The layout of a text file: its text, then its times, then the columns or tags that hold values."""

    encoding: str
    separator: str
    skip_rows: int  # lines before the header
    unit_rows: int  # lines between the header and the data
    names: tuple[str, ...]  # the header
    units: tuple[str, ...]  # the first row of units; empty texts without one
    rows: list[list[str]]  # cells of the data
    comment: str = ""  # prefix of lines without data; empty for none
    header_rows: int = 1  # the cells of these rows together make the names
    repeated: bool = False  # whether the header is repeated among the data
    blocks: list[str] = field(default_factory=list)  # the tag of each row of a ZRXP file
    zone: str = ""  # zone of its clock, where stated
    missing: tuple[float, ...] = ()  # numbers of values that are not measured
    block_units: dict[str, str] = field(default_factory=dict)  # units by tag
    headerless: bool = False  # whether the names are made up
    doubled: bool = False  # whether names occur twice, and are to be declared: `skip_rows` passes the header
    footer: list[str] = field(default_factory=list)  # the last lines, where these hold no data

    time_at: tuple[int, ...] = ()  # columns of the time: one, or two, of date and clock
    time_format: str | None = None  # None is ISO 8601
    zoned: bool = False  # whether the times carry UTC offsets
    # [us] between rows; of the long layout, between the values of the tag that comes most often
    steps: list[int] = field(default_factory=list)
    # formats that mean other times and fit as well; then `time_format` is not decided
    other_formats: tuple[str, ...] = ()
    doubt: str = ""  # the question that these leave; empty for none

    # name, unit and cells of all that may hold numbers: columns of the wide layout, or tags of the long
    columns: list[tuple[str, str, list[str]]] = field(default_factory=list)
    value: str = ""  # column of the values of the long layout; empty for the wide
    tag: tuple[str, ...] = ()  # columns of its tags; empty where lines or the file's name hold them
    tag_steps: dict[str, list[int]] = field(default_factory=dict)  # between the values of each tag [us]

    def time(self, row: Sequence[str]) -> str:
        """The text of a row's time."""
        return " ".join(row[i] for i in self.time_at)

    def cells(self) -> dict[int, list[str]]:
        """The cells of each column but those of the time, by its place."""
        return {i: [row[i] for row in self.rows] for i in range(len(self.names)) if i not in self.time_at}

    def usual(self, tag: str) -> int:
        """The median step of a tag [us]; 0 where there is none."""
        return middle(self.tag_steps.get(tag, []))


def middle(steps: list[int]) -> int:
    """The median of steps; 0 where there is none."""
    return median_high(steps) if steps else 0


def guess_encoding(content: bytes) -> str:
    """The encoding of a text: by its byte order mark, or the first that fits."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if wide := unmarked_utf16(content):
        return wide
    for encoding in ("utf-8", "cp1252"):
        try:
            content.decode(encoding)
        except UnicodeDecodeError as error:
            if encoding == "utf-8" and error.start >= len(content) - 3:
                return encoding  # the part that is read ends within a character
        else:
            return encoding
    return "latin-1"


def guess_layout(content: bytes, name: str) -> Layout:
    """Lay out a text file; DataError where it is no table with a header."""
    encoding = guess_encoding(content)
    text = content.decode(encoding, "replace").lstrip("\ufeff")
    if re.match(r"\s*\[?\s*\{", text):
        raise DataError(
            f"{name} is JSON: expected a table, as text, workbook or Parquet; convert it, for example with "
            "read_json and to_csv of pandas"
        )
    lines = LINE.split(text)
    if zrxp := _zrxp(lines, encoding):
        return zrxp
    comment = _guess_comment(lines)
    at = [i for i, line in enumerate(lines) if not (comment and line.startswith(comment))]
    lines = [lines[i] for i in at]
    separator, width = _guess_separator(lines)
    cells = [split_cells(line, separator) or [] for line in lines]
    if width < 2 or not any(any(row) for row in cells if len(row) == width):
        raise DataError(f"{name} is no table: no separator among ; tab | , blank divides its lines alike")
    header = _find_header(cells, width)
    names = cells[header]
    headerless = sum(map(_looks_like_data, names)) > len(names) // 2
    if headerless:
        names, header = [f"column {k}" for k in range(1, width + 1)], header - 1
    full = [row for row in cells[header + 1 :] if len(row) == width and any(row)]
    body = [row for row in full if row != names]
    above = 0
    while above < min(len(body), 5) and not any(map(_looks_like_data, body[above])):
        above += 1
    if len(body) == above:
        raise DataError(f"{name} has a header and no rows of data")
    # names take as many of the rows above the data as make them distinct; one where none do
    tables = [[names, *body[:more]] for more in range(above + 1)]
    joint = [[" ".join(filter(None, cells)) for cells in zip(*rows, strict=True)] for rows in tables]
    distinct = [len(set(filter(None, each))) == sum(map(bool, each)) for each in joint]
    doubled = not any(distinct)
    header_rows = 1 if doubled else 1 + distinct.index(True)
    only_comments = comment and not any(line.strip() for line in lines[:header])
    return Layout(
        encoding,
        separator,
        skip_rows=0 if only_comments and not doubled else at[header + headerless] + doubled,
        unit_rows=above - header_rows + 1,
        names=tuple(joint[header_rows - 1]),
        units=tuple(body[header_rows - 1]) if above >= header_rows else ("",) * width,
        rows=body[above:],
        comment=comment,
        header_rows=header_rows,
        repeated=len(full) > len(body),
        headerless=headerless,
        doubled=doubled,
    )


def _zrxp(lines: Sequence[str], encoding: str) -> Layout | None:
    """A ZRXP file, of which comments name the columns and the tags; None for another kind."""
    remarks = [line for line in lines if line.startswith("#")]
    layout = next((m for line in remarks if (m := re.search(r"#LAYOUT\(([^)]*)\)", line))), None)
    if layout is None or not any(re.search(ZRXP_TAG, line) for line in remarks):
        return None
    names = tuple(name.strip() for name in layout[1].split(","))
    rows: list[list[str]] = []
    blocks: list[str] = []
    units: dict[str, str] = {}
    tag = ""
    for line in lines:
        if match := re.search(ZRXP_TAG, line):
            tag = match[1].strip()
        if line.startswith("#"):
            if tag and (match := ZRXP_UNIT.search(line)):
                units[tag] = match[1].strip()
        elif len(cells := line.split()) == len(names):
            rows.append(cells)
            blocks.append(tag)
    text = "\n".join(remarks)
    hours = {int(hours) for hours in re.findall(r"TZ(?:UTC|GMT)([+-]?\d{1,2})\b", text)}
    zone = ""
    if len(hours) == 1:
        offset = hours.pop()
        zone = f"Etc/GMT{-offset:+d}" if offset else "UTC"  # POSIX signs are the other way round
    missing = tuple(sorted({float(value) for value in re.findall(r"RINVAL(-?\d+(?:\.\d+)?)", text)}))
    return Layout(
        encoding, " ", 0, 0, names, ("",) * len(names), rows, "#",
        blocks=blocks, zone=zone, missing=missing, block_units=units,
    )  # fmt: skip


def _guess_comment(lines: Sequence[str]) -> str:
    """Prefix of lines without data: by the first line of the file, or by several."""
    filled = [line for line in lines if line.strip()]
    for mark in MARKS:
        count = sum(line.startswith(mark) for line in filled)
        if count and count < len(filled) and (filled[0].startswith(mark) or count >= 3):
            return mark
    return ""


def _find_header(cells: Sequence[list[str]], width: int) -> int:
    """The row of names: before the data, and with most of its cells filled.

    Spreadsheets pad a title with empty cells until it is as wide as the table.
    """
    above = []
    for i, row in enumerate(cells):
        if len(row) != width or not any(row):
            continue
        above.append((sum(map(bool, row)), i))
        if sum(map(_looks_like_data, row)) > width // 2:
            break
    fullest = max(filled for filled, _ in above[:-1] or above)
    return next(i for filled, i in above if 2 * filled > fullest)


def _guess_separator(lines: Sequence[str]) -> tuple[str, int]:
    """The separator that divides most lines into the same number of cells, and that number."""
    best, best_score, width = ",", 0.0, 0
    filled = [line for line in lines if line.strip()][:2000]
    for separator in SEPARATORS if filled else ():
        modal, times = Counter(len(split_cells(line, separator) or []) for line in filled).most_common(1)[0]
        score = times / len(filled) if modal > 1 else 0.0
        if score > best_score + 0.02:  # a clearly larger share: else the earlier one, which is less ambiguous
            best, best_score, width = separator, score, modal
    return best, width


def _looks_like_data(cell: str) -> bool:
    """Whether a cell is a number or begins like a date; names and units are neither."""
    return (
        re.match(r"[+-]?[.,]?\d[\d.,' \u00a0]*([eE][+-]?\d+)?$|\d{1,4}[-/.]\d{1,2}[-/.]\d", cell) is not None
    )


def guess_time(layout: Layout) -> bool:
    """Find the columns and the format of the time; False where no column reads as times."""
    rows = layout.rows
    if _from_parts(layout):
        return True
    for at in range(len(layout.names)):
        clock = at + 1
        has_clock = clock < len(layout.names) and all(_CLOCK.fullmatch(row[clock]) for row in rows[:50])
        if (has_clock and _guess_format(layout, (at, clock))) or _guess_format(layout, (at,)):
            return True
    for at, name in enumerate(layout.names):
        counts = [number(row[at].replace(",", ".")) or 0.0 for row in rows]
        likely = re.search(_TIME, name, re.I) or (at == 0 and all(a < b for a, b in pairwise(counts)))
        for time_format, (least, most) in EPOCHS.items() if likely else ():
            if sum(least <= count < most for count in counts) < 0.95 * len(counts):
                continue
            if time_format == "excel":
                if not 0.0 < counts[-1] - counts[0] < len(counts):  # rows of days are no log
                    continue
                layout.doubt = (
                    f"{name!r} has numbers: they are read as days since 1899-12-30, of a spreadsheet"
                )
            return _guess_format(layout, (at,), (time_format,))
    return any(_from_a_begin(layout, at) for at in range(len(layout.names)))


def _from_parts(layout: Layout) -> bool:
    """Read a column for each of year, month and day, and for hour, minute and second or for the clock."""
    names = [name.strip() for name in layout.names]
    at = {
        part: i for part, pattern in _PARTS.items() for i, name in enumerate(names)
        if re.fullmatch(pattern, name, re.I)
    }  # fmt: skip
    if not {"%Y", "%m", "%d"} <= at.keys():
        return False
    columns, formats = tuple(at.values()), [" ".join(at)]
    few = layout.rows[:50]  # 12.34 is a number
    clock = [i for i in range(len(names)) if all(":" in row[i] and _CLOCK.fullmatch(row[i]) for row in few)]
    if "%H" not in at and clock:
        columns, formats = (*columns, clock[0]), [f"{formats[0]} {one}" for one in _CLOCKS]
    return _guess_format(layout, columns, formats)


def _from_a_begin(layout: Layout, at: int) -> bool:
    """Read a column as seconds or milliseconds in equal steps since a begin that no column states."""
    name = f"{layout.names[at]} {layout.units[at]}"
    steps = [b - a for a, b in pairwise(number(row[at]) or 0.0 for row in layout.rows)]
    usual, named = median_high(steps or [0.0]), re.search(_TIME, name, re.I)
    if len(steps) < FEWEST_STEPS or min(steps) <= 0.0 or re.search(_LONG_UNIT, name, re.I):
        return False
    if not named and (at > 0 or usual == 1.0):  # the number of the row
        return False
    # stamps are rounded, and some may be missing
    if sum(abs(step - usual) < 0.5 * usual for step in steps) < 0.95 * len(steps):
        return False
    layout.doubt = (
        f"{layout.names[at]!r} has no dates: they are counted from 1970-01-01, as if it began there"
    )
    return _guess_format(layout, (at,), ("unix_ms" if re.search(_MILLI, name, re.I) else "unix",))


def _guess_format(layout: Layout, time_at: tuple[int, ...], formats: Sequence[str | None] = FORMATS) -> bool:
    """Find the format of 95 % of the times in these columns; to be quick, first of nine in ten of 40."""
    layout.time_at = time_at
    texts = [layout.time(row) for row in layout.rows]
    fits: dict[str | None, list[tuple[int, int | None]]] = {}
    few = texts[:: max(len(texts) // 40, 1)]
    for time_format in formats:
        long = _DIGITS.get(time_format or "")
        alike = [text for text in few if len(text) == (long or len(text))]
        if sum(read_text(text, time_format) is not None for text in alike) < 0.9 * len(few):
            continue
        read = [time for text in texts if (time := read_text(text, time_format)) is not None]
        if len(read) >= 0.95 * len(texts):
            fits[time_format] = read
    if not fits:
        return False
    best = max(map(len, fits.values()))
    times = {f: [time for time, _ in read] for f, read in fits.items() if len(read) == best}
    if len(times) > 1 and None not in times:
        smooth = {f: t for f, t in times.items() if max(map(abs, steps_of(t)), default=0) < LONGEST_JUMP}
        if len(smooth) == 1:
            times = smooth
        elif len(set(map(tuple, times.values()))) > 1:
            layout.other_formats = tuple(filter(None, [*times][1:]))
            others = ", ".join(map(repr, layout.other_formats))
            layout.doubt = f"{texts[0]!r} also reads as {others}: day or month first?"
    layout.time_format, found = next(iter(times.items()))
    layout.zoned = all(offset is not None for _, offset in fits[layout.time_format])
    layout.steps = steps_of(found if found[0] <= found[-1] else found[::-1])  # some begin with the newest row
    return True


def steps_of(times: Sequence[int]) -> list[int]:
    """The differences of successive times."""
    return [b - a for a, b in pairwise(times)]


def number(text: str) -> float | None:
    """A number as Python writes it; None for any other text."""
    try:
        return float(text)
    except ValueError:
        return None
