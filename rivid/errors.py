"""The kinds of error that rivid raises on purpose.

Every message says what came, what was expected and what to do. ``exit_code`` is what the
command line returns for it.
"""

from collections.abc import Iterable
from typing import ClassVar

EXIT_CODES: dict[int, tuple[str, str]] = {
    0: ("all well", ""),
    1: ("failure: the disk is full, a file cannot be written", "read the one line on stderr"),
    2: ("usage or configuration", "the line names the option or the key"),
    3: (
        "days failed that had not failed before, or every day failed; all else is written (`--strict`: any)",
        "read `message` of these days; where others are well, tomorrow it is 0 again",
    ),
    10: ("no data", "is DATA_DIR right?"),
    11: ("another run holds OUT", "wait"),
    130: ("interrupted (SIGINT)", "start it again: what is done stays done"),
    143: ("ended (SIGTERM)", "start it again: what is done stays done"),
}
"""What the command line returns: the meaning, and what to do; in Markdown."""


def printable(text: str) -> str:
    """The text with what UTF-8 cannot hold (file names of other encodings) as escapes."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def nearest(came: object, names: Iterable[str]) -> str:
    """A hint at the nearest of the names, as the end of a message; "" where none is near."""
    from difflib import get_close_matches

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
