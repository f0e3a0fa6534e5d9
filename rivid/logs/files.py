"""Names of logs, and their bytes: never more of them than a log can have."""

import gzip
import io
import os
import re
import stat
import zlib
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import BinaryIO

from rivid.errors import DataError

SUFFIXES = (".csv", ".csv.gz", ".parquet")
_DAY_NAME = re.compile(r"\d{4}-\d\d-\d\d")
CHUNK = 1 << 20
"""Bytes that are read at a time where the size is not known: small next to any limit of memory."""


class CutError(DataError):
    """A log that ends too early: of today's it means that it is still being written."""


@dataclass(frozen=True)
class Limits:
    """Largest size, unpacked, and number of rows of a log."""

    bytes: int
    rows: int


DAY = Limits(64 << 20, 2_000_000)
"""A file of one day: a day logged every 0.1 s is about half of it."""
MANY = Limits(512 << 20, 20_000_000)
"""A file of many days: some thirty years at T_s = 133 s."""


def suffix_of(name: str) -> str | None:
    """The suffix of a log's name, in small letters; None for a name that is no log's."""
    lower = name.lower()
    return next((s for s in SUFFIXES[::-1] if lower.endswith(s)), None)


def stem_of(name: str) -> str:
    """A file's name without its endings: its tag in the long layout, where nothing else states one."""
    plain = name[:-3] if name.lower().endswith(".gz") else name
    return plain.rpartition(".")[0] or plain


def is_day_file(path: str) -> bool:
    """Whether a log is of one day by its name."""
    suffix = suffix_of(path)
    return suffix is not None and _DAY_NAME.fullmatch(path[: -len(suffix)]) is not None


def limits_of(path: str) -> Limits:
    """The limits of a log, by its name."""
    return DAY if is_day_file(path) else MANY


def shown(name: str) -> str:
    """A file's name as it can be printed: bytes that are not UTF-8 and control characters are escaped."""
    if name.isprintable():
        return name
    text = os.fsencode(name).decode("utf-8", "backslashreplace")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def read_bytes(path: Path, name: str, limits: Limits) -> tuple[bytes, str]:
    """The unpacked content of a log and the SHA-256 of its file; DataError if it is unreadable or too large.

    CutError for a packed file that ends too early.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        with open(descriptor, "rb", buffering=0) as file:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise DataError(f"{name} is not a regular file")
            refuse_size(name, status.st_size, limits)
            packed = _in_chunks(file, status.st_size + 1, limits.bytes)
    except OSError as error:
        raise DataError(f"{name} cannot be read: {error.strerror}") from None
    refuse_size(name, len(packed), limits)
    content = packed
    if packed and name.lower().endswith(".gz"):
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(packed)) as unpacked:
                content = _in_chunks(unpacked, CHUNK, limits.bytes)
        except EOFError:
            raise CutError(f"{name} is cut off: the gzip stream does not end") from None
        except (OSError, zlib.error) as error:
            raise DataError(f"{name} is not a sound gzip file: {error}") from None
        refuse_size(name, len(content), limits)
    if not content:
        raise CutError(f"{name} is empty")
    return content, sha256(packed).hexdigest()


def _in_chunks(file: BinaryIO | io.FileIO | gzip.GzipFile, chunk: int, most: int) -> bytes:
    """The bytes of a file, `most` + 1 of a longer one; memory is taken as they come."""
    parts: list[bytes] = []
    size = 0
    while size <= most and (part := file.read(min(chunk, most + 1 - size))):
        parts.append(part)
        size += len(part)
    return b"".join(parts)


def refuse_size(name: str, size: int, limits: Limits) -> None:
    """Raise DataError for a file that is too large, before it is read."""
    if size > limits.bytes:
        raise DataError(
            f"{name} is too large for a log: {size / 2**20:.0f} MB (limit {limits.bytes >> 20} MB, unpacked)"
        )


def refuse_rows(name: str, rows: int, limits: Limits) -> None:
    """Raise DataError for too many rows, before they are unpacked."""
    if rows > limits.rows:
        raise DataError(f"{name} has too many rows for a log: {rows:,} (limit {limits.rows:,})")
