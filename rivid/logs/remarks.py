"""Lines of an export that hold no data, and what ZRXP says in them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

MARKS = ("#", "!", "%", "//")
PATTERN = "#REXCHANGE([^|]+)"


@dataclass(frozen=True)
class Zrxp:
    """What the comments of a ZRXP file say.

    Attributes
    ----------
    columns : tuple of str
        Of the rows, which have no header.
    pattern : str
        Regular expression that finds the tag of the rows below.
    missing : tuple of float
        Numbers that stand for values that are not there.
    zone : str
        Of the clock, as the zone of a fixed offset; empty where it is not said.
    units : dict of str
        Per tag.
    """

    columns: tuple[str, ...]
    pattern: str
    missing: tuple[float, ...]
    zone: str
    units: dict[str, str]


def guess_comment(lines: Sequence[str]) -> str:
    """How lines begin that hold no data: by the first line of the file, or by several."""
    filled = [line for line in lines if line.strip()]
    for mark in MARKS:
        count = sum(line.startswith(mark) for line in filled)
        if count and count < len(filled) and (filled[0].startswith(mark) or count >= 3):
            return mark
    return ""


def read_zrxp(lines: Sequence[str]) -> Zrxp | None:
    """What a ZRXP file says of itself; None for a file of another kind."""
    remarks = [line for line in lines if line.startswith("#")]
    layout = next((m for line in remarks if (m := re.search(r"#LAYOUT\(([^)]*)\)", line))), None)
    if layout is None or not any(re.search(PATTERN, line) for line in remarks):
        return None
    text = "\n".join(remarks)
    missing = {float(value) for value in re.findall(r"RINVAL(-?\d+(?:\.\d+)?)", text)}
    zones = set(re.findall(r"TZ(?:UTC|GMT)([+-]?\d{1,2})\b", text))
    units, tag = {}, ""
    for line in remarks:
        if match := re.search(PATTERN, line):
            tag = match[1].strip()
        if tag and (match := re.search(r"CUNIT([^|*]+)", line)):
            units[tag] = match[1].strip()
    zone = _zone(int(zones.pop())) if len(zones) == 1 else ""
    columns = tuple(name.strip() for name in layout[1].split(","))
    return Zrxp(columns, PATTERN, tuple(sorted(missing)), zone, units)


def _zone(hours: int) -> str:
    return "UTC" if hours == 0 else f"Etc/GMT{-hours:+d}"  # POSIX signs are the other way round
