"""Errors that rivid raises on purpose.

Every message states the value found, the value expected and the remedy. ``exit_code`` is the exit code of the
command line.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import ClassVar


def printable(text: str) -> str:
    """The text with control characters, and what UTF-8 cannot hold (other encodings' file names), escaped."""
    text = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def nearest(came: object, names: Iterable[str]) -> str:
    """A hint at the nearest of the names, as the end of a message; "" where none is near."""
    close = get_close_matches(str(came), list(names), 1)
    return f"; did you mean {close[0]}?" if close else ""


class RividError(Exception):
    """Base of all errors that rivid raises on purpose."""

    exit_code: ClassVar[int] = 1


class ConfigError(RividError):
    """The configuration or the command line cannot be used."""

    exit_code = 2


class DataError(RividError):
    """A log, or one day of it, cannot be used; the message is the day's reason."""


class NoDataError(RividError):
    """There is nothing to work on."""

    exit_code = 10


class LockedError(RividError):
    """Another run holds the output directory."""

    exit_code = 11


class PendingError(DataError):
    """Today's log is not finished: not a failure, only not yet a day."""
