"""The header of a CSV log, and the words for a column that is not there."""

import csv
import difflib
from collections.abc import Sequence
from dataclasses import dataclass

from rivid.errors import DataError
from rivid.logs.files import CutError
from rivid.logs.spec import Spec

UTF8_BOM = b"\xef\xbb\xbf"
UTF16_BOMS = (b"\xff\xfe", b"\xfe\xff")


class ColumnError(DataError):
    """A column that is asked for is missing or doubled."""


@dataclass(frozen=True)
class Header:
    """Column names of a CSV log and where its rows begin.

    Attributes
    ----------
    names : tuple of str
    body : int
        Bytes before the first row.
    line : int
        Number of the header's line.
    """

    names: tuple[str, ...]
    body: int
    line: int


def plain_bytes(content: bytes, spec: Spec, name: str) -> bytes:
    """The log in UTF-8 without a byte order mark.

    Raises
    ------
    DataError
        Where the bytes are not of the declared encoding.
    """
    if spec.encoding.lower().replace("_", "-") in ("utf-8", "utf8", "ascii", "utf-8-sig"):
        if content.startswith(UTF16_BOMS):
            raise DataError(f'{name} is UTF-16, not {spec.encoding}: set [input] encoding = "utf-16"')
        return content[3:] if content.startswith(UTF8_BOM) else content
    try:
        text = content.decode(spec.encoding)
    except (UnicodeError, LookupError) as error:
        raise DataError(f"{name} is not {spec.encoding}: {error}; set [input] encoding") from None
    return text.lstrip("\ufeff").encode("utf-8", "replace")


def read_header(content: bytes, spec: Spec, name: str) -> Header:
    """Find and read the header of a log in UTF-8.

    Raises
    ------
    ColumnError
        Where a column that is asked for is missing or doubled.
    """
    start, line = 0, spec.skip_rows + 1
    for _ in range(spec.skip_rows):
        start = _end_of_line(content, start)
    end = body = _end_of_line(content, start)
    if not content[start:end].strip():
        raise CutError(f"{name} has no header on line {line}")
    for _ in range(spec.unit_rows):
        body = _end_of_line(content, body)
    try:
        text = content[start:end].decode("utf-8")
        names = next(csv.reader([text.strip("\r\n")], delimiter=spec.separator, strict=True))
    except UnicodeDecodeError:
        raise DataError(not_utf8(name, line)) from None
    except csv.Error as error:
        raise DataError(f"{name}, line {line}: the header cannot be read: {error}") from None
    header = Header(tuple(n.strip() for n in names), body, line)
    check_names(header.names, spec, f"{name}, line {line}", text)
    return header


def not_utf8(name: str, line: int) -> str:
    """What to say of bytes that are not UTF-8."""
    return f'{name}, line {line}: not UTF-8: set [input] encoding, for example "latin-1" or "cp1252"'


def check_names(names: Sequence[str], spec: Spec, where: str, header: str = "") -> None:
    """Refuse a log in which a column that is asked for is missing or doubled.

    Raises
    ------
    ColumnError
        Names the nearest column.
    """
    wanted = [(column, "time") for column in spec.time]
    wanted += [(column, signal.name) for signal in spec.signals for column in signal.sources]
    for column, role in wanted:
        count = names.count(column)
        if count == 1:
            continue
        if count > 1:
            raise ColumnError(f"{where}: {count} columns are named {column!r}: expected one")
        raise ColumnError(
            f"{where}: no column {column!r} for {role}; {_advice(column, role, names, spec, header)}"
        )


def _advice(column: str, role: str, names: Sequence[str], spec: Spec, header: str) -> str:
    for mark, said in ((";", ";"), ("\t", "\\t"), (",", ","), ("|", "|")):
        if len(names) == 1 and mark != spec.separator and mark in header:
            return f'the header is separated by "{said}": set [input] separator = "{said}"'
    lower = {name.lower(): name for name in names if name}
    near = difflib.get_close_matches(column.lower(), lower, n=1, cutoff=0.3)
    nearest = f"nearest is {lower[near[0]]!r}; " if near else ""
    listed = ", ".join(name[:40] for name in names[:12]) + (", ..." if len(names) > 12 else "")
    none = ' or "" where it is not logged' if role == "u_Qo" else ""
    return f"{nearest}there are: {listed}. Set [input] {role} to the log's own name{none}"


def _end_of_line(content: bytes, start: int) -> int:
    """Where the next line begins; lines end with LF, CR LF or CR."""
    feed = content.find(b"\n", start)
    end = len(content) if feed < 0 else feed
    back = content.find(b"\r", start, end)
    if back >= 0 and back + 1 != feed:
        return back + 1
    return len(content) if feed < 0 else feed + 1
