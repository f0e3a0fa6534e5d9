"""The last lines of an export that hold no data: averages, "end of report"."""

import re
from collections.abc import Sequence

from rivid.logs.header import Header, split_cells
from rivid.logs.spec import Spec
from rivid.logs.times import read_text

MOST = 20
"""Lines that are looked at, from the end."""
TAIL = 64 << 10
"""Bytes that are enough for these."""
LINE = re.compile(r"\r\n|\n|\r")
_DATE = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d|\d{8}")


def footer_lines(
    lines: Sequence[str], time_at: Sequence[int], separator: str, time_format: str | None, comment: str = ""
) -> list[int]:
    """Which of the last lines hold no data: the cells of the time, at `time_at`, hold none.

    Parameters
    ----------
    lines : sequence of str
        Split at each line break: the last one is empty where the text ends with one.
    time_at : sequence of int
    separator : str
    time_format : str or None
        None is ISO 8601.
    comment : str
        How lines begin that hold no data anyway; empty for none.

    Returns
    -------
    list of int
        Ascending; without empty lines, rows of empty cells and comments. A line whose time begins like a
        date is none of them, nor is one that begins with a digit where no line break follows: it may be a row
        that is damaged or cut off. None at all where there are too many.
    """
    found: list[int] = []
    for at in range(len(lines) - 1, -1, -1):
        line = lines[at]
        if not line.strip() or (comment and line.startswith(comment)):
            continue
        cells = split_cells(line, separator)
        if cells is not None and not any(cells):
            continue
        if at == len(lines) - 1 and line.lstrip(' "')[:1].isdigit():
            break
        text = " ".join((cells or [])[i] for i in time_at if i < len(cells or []))
        if _DATE.match(text) or read_text(text, time_format) is not None:
            break
        found.append(at)
        if len(found) > MOST:
            return []
    return found[::-1]


def cut_footer(content: bytes, header: Header, spec: Spec) -> tuple[bytes, int]:
    """A log without the lines that `[input] footer_rows` declares, and how many these are.

    A line with a time is never one of them, so a file that has no footer, or not yet, loses nothing.

    Parameters
    ----------
    content : bytes
        In UTF-8.
    header : Header
    spec : Spec

    Returns
    -------
    content : bytes
    count : int
        At most `footer_rows`.
    """
    if not spec.footer_rows:
        return content, 0
    begin = max(header.body, len(content) - TAIL)
    tail = content[begin:].decode("utf-8", "surrogateescape")
    lines = LINE.split(tail)
    known = 1 if begin > header.body else 0  # the first line may be a part of one
    time_at = [header.names.index(name) for name in spec.time]
    found = footer_lines(lines[known:], time_at, spec.separator, spec.time_format, spec.dialect.comment)
    found = found[-spec.footer_rows :]
    if not found:
        return content, 0
    behind = known + found[0]
    ends = [match.end() for match in LINE.finditer(tail)]
    kept = tail[: ends[behind - 1] if behind else 0]
    return content[: begin + len(kept.encode("utf-8", "surrogateescape"))], len(found)
