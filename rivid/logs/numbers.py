"""Texts to numbers, exactly as declared: nothing is guessed, and a refusal says what to declare."""

import re
from collections.abc import Iterable
from functools import lru_cache

NAN = float("nan")
LARGEST = 1e6
"""No river carries more m3/s, no gauge reads more m: beyond this a number is damage."""


class NumberReader:
    """Reads the cells of one log.

    Parameters
    ----------
    missing : iterable of str
        Markers of values that are not there.
    decimal, thousands : str
        Marks; an empty `thousands` allows none.
    """

    def __init__(self, missing: Iterable[str], decimal: str = ".", thousands: str = "") -> None:
        self.missing = frozenset(missing)
        self.decimal, self.thousands = decimal, thousands
        self._plain, self._grouped = _patterns(decimal, thousands)

    def read(self, text: str) -> float | None:
        """The number in a cell; NaN where it is declared missing, None where it is no number."""
        text = text.strip()
        if text in self.missing:
            return NAN
        if not self._plain.fullmatch(text):
            if self._grouped is None or not self._grouped.fullmatch(text):
                return None
            text = text.replace(self.thousands, "").replace("\u00a0", "").replace("\u202f", "")
        return float(text.replace(self.decimal, ".") if self.decimal != "." else text)

    def hint(self, text: str) -> str:
        """What to declare so that a refused cell could be read."""
        text = text.strip()
        if text.lower().lstrip("+-") in ("inf", "infinity", "nan"):
            return f'if it means "not measured", add "{text}" to [input] missing'
        if re.fullmatch(r"[+-]?\d+,\d+", text) and self.decimal == ".":
            return 'if the comma is the decimal mark, set [input] decimal = ","'
        if re.fullmatch(r"[+-]?\d+\.\d+", text) and self.decimal == ",":
            return '[input] decimal is ",", and the cell has a point'
        if match := re.fullmatch(r"[+-]?\d{1,3}([ .,'\u00a0\u202f])\d{3}(?:\1\d{3})*(?:[.,]\d+)?", text):
            mark = match[1] if match[1] not in "\u00a0\u202f" else " "
            return f'if "{mark}" separates thousands, set [input] thousands = "{mark}"'
        return f'if it means "not measured", add "{text[:40]}" to [input] missing'


@lru_cache(maxsize=32)
def _patterns(decimal: str, thousands: str) -> tuple[re.Pattern[str], re.Pattern[str] | None]:
    point = re.escape(decimal)
    plain = re.compile(rf"[+-]?(?:[0-9]+(?:{point}[0-9]*)?|{point}[0-9]+)(?:[eE][+-]?[0-9]{{1,3}})?")
    if not thousands:
        return plain, None
    # spreadsheets write a no-break space where a space is meant
    mark = "[ \u00a0\u202f]" if thousands == " " else re.escape(thousands)
    return plain, re.compile(rf"[+-]?[0-9]{{1,3}}(?:{mark}[0-9]{{3}})+(?:{point}[0-9]*)?")
