"""The layout of a foreign CSV: encoding, separator, where the header is."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from rivid.errors import DataError
from rivid.logs.remarks import Zrxp, guess_comment, read_zrxp

SEPARATORS = (";", "\t", "|", ",")
"""In this order where several fit: a comma may be a decimal mark, the others hardly anything else."""


@dataclass(frozen=True)
class Layout:
    """How a text file is laid out.

    Attributes
    ----------
    encoding, separator : str
    skip_rows, unit_rows : int
        Lines before the header, and after it before the data.
    names : tuple of str
        The header.
    units : tuple of str
        The first row of units, empty texts without one.
    rows : list of list of str
        Cells of the data that was looked at.
    comment : str
        How lines begin that hold no data; empty for none.
    header_rows : int
        Rows whose cells together make the names.
    repeated : bool
        Whether the header stands again among the data.
    zrxp : Zrxp or None
        What the comments of a ZRXP file say; it has no header.
    blocks : list of str
        The tag of each row, where a line above tells it.
    """

    encoding: str
    separator: str
    skip_rows: int
    unit_rows: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: list[list[str]]
    comment: str = ""
    header_rows: int = 1
    repeated: bool = False
    zrxp: Zrxp | None = None
    blocks: list[str] = field(default_factory=list)


def guess_encoding(content: bytes) -> str:
    """The encoding of a text: by its byte order mark, or the first that fits."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if content[:2000].count(b"\0") > len(content[:2000]) // 4:
        return "utf-16-le" if content[1:2] == b"\0" else "utf-16-be"
    for encoding in ("utf-8", "cp1252"):
        try:
            content.decode(encoding)
        except UnicodeDecodeError as error:
            if encoding == "utf-8" and error.start >= len(content) - 3:
                return encoding  # the part that was looked at ends within a character
        else:
            return encoding
    return "latin-1"


def guess_layout(content: bytes, name: str) -> Layout:
    """Lay out a text file.

    Raises
    ------
    DataError
        Where it is no table with a header.
    """
    encoding = guess_encoding(content)
    text = content.decode(encoding, "replace").lstrip("\ufeff")
    lines = re.split(r"\r\n|\n|\r", text)
    if zrxp := read_zrxp(lines):
        return _of_zrxp(lines, zrxp, encoding)
    comment = guess_comment(lines)
    numbered = [(i, line) for i, line in enumerate(lines) if not (comment and line.startswith(comment))]
    lines = [line for _, line in numbered]
    separator, width = _guess_separator(lines)
    if width < 2:
        raise DataError(f"{name} is no table: no separator among ; tab | , divides its lines alike")
    cells = [_split(line, separator) for line in lines]
    header = _find_header(cells, width)
    names = cells[header]
    if sum(_looks_like_data(cell) for cell in names) > len(names) // 2:
        raise DataError(
            f"{name} has no header: line {header + 1} is already data; add a line of column names"
        )
    full = [row for row in cells[header + 1 :] if len(row) == width and any(row)]
    body = [row for row in full if row != names]
    above = 0
    while above < min(len(body), 5) and not any(_looks_like_data(cell) for cell in body[above]):
        above += 1
    if len(body) == above:
        raise DataError(f"{name} has a header and no rows of data")
    header_rows = _rows_of_names([names, *body[:above]])
    parts = zip(*[names, *body[: header_rows - 1]], strict=True)
    names = [" ".join(filter(None, cells)) for cells in parts]
    units = tuple(body[header_rows - 1]) if above >= header_rows else ("",) * width
    remarks = comment and not any(line.strip() for line in lines[:header])
    return Layout(
        encoding,
        separator,
        0 if remarks else numbered[header][0],
        above - header_rows + 1,
        tuple(names),
        units,
        body[above:],
        comment,
        header_rows,
        len(full) > len(body),
    )


def _of_zrxp(lines: Sequence[str], zrxp: Zrxp, encoding: str) -> Layout:
    """No header: the comments name the columns, and the series of the rows below them."""
    rows, blocks, tag = [], [], ""
    for line in lines:
        if match := re.search(zrxp.pattern, line):
            tag = match[1].strip()
        cells = line.split()
        if not line.startswith("#") and len(cells) == len(zrxp.columns):
            rows.append(cells)
            blocks.append(tag)
    none = ("",) * len(zrxp.columns)
    return Layout(encoding, " ", 0, 0, zrxp.columns, none, rows, "#", 1, False, zrxp, blocks)


def _rows_of_names(rows: Sequence[Sequence[str]]) -> int:
    """How many of the rows above the data it takes for distinct names; one where that cannot be."""
    for count in range(1, len(rows) + 1):
        names = [" ".join(filter(None, cells)) for cells in zip(*rows[:count], strict=True)]
        if len(set(filter(None, names))) == len(list(filter(None, names))):
            return count
    return 1


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


def _split(line: str, separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return []


def _guess_separator(lines: Sequence[str]) -> tuple[str, int]:
    """The separator that divides most lines into the same number of cells, and that number."""
    best, best_score, width = ",", 0.0, 0
    filled = [line for line in lines if line.strip()][:2000]
    for separator in SEPARATORS:
        counts = Counter(len(_split(line, separator)) for line in filled)
        if not counts:
            continue
        modal, times = counts.most_common(1)[0]
        score = times / len(filled) if modal > 1 else 0.0
        if score > best_score + 0.02:
            best, best_score, width = separator, score, modal
    return best, width


def _looks_like_data(cell: str) -> bool:
    """Whether a cell is a number or begins like a date; names and units are neither."""
    return (
        re.match(r"[+-]?[.,]?\d[\d.,' \u00a0]*([eE][+-]?\d+)?$|\d{1,4}[-/.]\d{1,2}[-/.]\d", cell) is not None
    )
