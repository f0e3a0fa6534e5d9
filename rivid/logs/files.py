"""The bytes of a log, never more of them than a log can have."""

import gzip
import os
import stat
import zlib
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from rivid.errors import DataError

SUFFIXES = (".csv", ".csv.gz", ".parquet")
DAY_BYTES = 64 << 20
"""A day's file, unpacked: a day logged every 0.1 s is about half of it."""
DAY_ROWS = 2_000_000
MANY_BYTES = 512 << 20
"""A file of many days, unpacked: some thirty years at T_s = 133 s."""
MANY_ROWS = 20_000_000


class CutError(DataError):
    """A log that ends too early: of today's it means that it is still being written."""


@dataclass(frozen=True)
class Limits:
    """How large a log may be."""

    bytes: int
    rows: int


DAY = Limits(DAY_BYTES, DAY_ROWS)
MANY = Limits(MANY_BYTES, MANY_ROWS)


def suffix_of(name: str) -> str | None:
    """The suffix of a log's name, in small letters; None for a name that is no log's."""
    lower = name.lower()
    return next((s for s in SUFFIXES[::-1] if lower.endswith(s)), None)


def shown(name: str) -> str:
    """A file's name as it can be printed: bytes that are not UTF-8, and what no line can hold, escaped."""
    if name.isprintable():
        return name
    text = os.fsencode(name).decode("utf-8", "backslashreplace")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def read_bytes(path: Path, name: str, limits: Limits) -> tuple[bytes, str]:
    """The unpacked content of a log and the digest of its file.

    Parameters
    ----------
    path : Path
        File to read.
    name : str
        How messages call it.
    limits : Limits

    Returns
    -------
    content : bytes
    digest : str
        SHA-256 of the file as it lies on disk.

    Raises
    ------
    DataError
        For a file that is too large, packed or unpacked, or that cannot be read; CutError for one that
        ends too early.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        with open(descriptor, "rb", buffering=0) as file:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise DataError(f"{name} is not a regular file")
            refuse_size(name, status.st_size, limits)
            packed = file.read(limits.bytes + 1)
    except OSError as error:
        raise DataError(f"{name} cannot be read: {error.strerror}") from None
    refuse_size(name, len(packed), limits)
    digest = sha256(packed).hexdigest()
    if not packed:
        raise CutError(f"{name} is empty")
    return (_unpack(packed, name, limits) if name.lower().endswith(".gz") else packed), digest


def refuse_size(name: str, size: int, limits: Limits) -> None:
    """Refuse a file by its size, before it is read."""
    if size > limits.bytes:
        raise DataError(
            f"{name} is too large for a log: {size / 2**20:.0f} MB (limit {limits.bytes >> 20} MB, unpacked)"
        )


def refuse_rows(name: str, rows: int, limits: Limits) -> None:
    """Refuse a file by its number of rows, before they are unpacked."""
    if rows > limits.rows:
        raise DataError(f"{name} has too many rows for a log: {rows:,} (limit {limits.rows:,})")


def _unpack(packed: bytes, name: str, limits: Limits) -> bytes:
    import io

    try:
        with gzip.GzipFile(fileobj=io.BytesIO(packed)) as file:
            content = file.read(limits.bytes + 1)
    except EOFError:
        raise CutError(f"{name} is cut off: the gzip stream does not end") from None
    except (OSError, zlib.error) as error:
        raise DataError(f"{name} is not a sound gzip file: {error}") from None
    refuse_size(name, len(content), limits)
    if not content:
        raise CutError(f"{name} is empty")
    return content
