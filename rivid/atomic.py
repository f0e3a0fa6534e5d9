"""Files that are either whole or not there: write to a sibling, flush to disk, rename."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rivid.errors import RividError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary sibling of `path` to write to; on success it takes the place of `path`.

    The directory of the file is made where it is missing. RividError, in one line, where the file cannot be
    written (disk full, not permitted).
    """
    scratch = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield scratch
        with open(scratch, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(scratch, path)
    except OSError as error:
        raise RividError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # it may not exist; the error is raised above
            scratch.unlink()


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically, UTF-8."""
    with replacing(path) as scratch:
        scratch.write_text(text, encoding="utf-8", errors="backslashreplace")
