"""Where the days go: whole files or none, and nothing that is there is overwritten unasked."""

import datetime as dt
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from rivid.atomic import replacing
from rivid.errors import ConfigError
from rivid.logs.catalog import is_day_file
from rivid.logs.files import SUFFIXES, shown, suffix_of

Written = Literal["written", "identical", "differs"]


def refuse_place(out: Path, exports: Sequence[Path]) -> None:
    """Refuse a directory in which the logs would mix with others, or with the exports.

    Raises
    ------
    ConfigError
    """
    if out.exists() and not out.is_dir():
        raise ConfigError(f"--out {shown(str(out))} is a file: expected a directory")
    here = out.resolve()
    for export in exports:
        if export.resolve().parent == here and suffix_of(export.name):
            raise ConfigError(
                f"{shown(str(export))} lies in {shown(str(out))}, where `rivid run` would take it for a log: "
                "choose another --out"
            )
    if not out.is_dir():
        return
    for path in sorted(out.iterdir()):
        if suffix_of(path.name) and not path.name.startswith(".") and not is_day_file(path.name):
            raise ConfigError(
                f"{shown(str(out))} holds {shown(path.name)}, which would mix with the days: choose an empty "
                "directory, or one of daily logs"
            )


def differs(out: Path, date: dt.date, format: str, data: bytes) -> bool:
    """Whether a log of that day is there, and another one."""
    path = out / f"{date}.{format}"
    there = [out / f"{date}{suffix}" for suffix in SUFFIXES]
    if any(other.exists() or other.is_symlink() for other in there if other != path):
        return True
    if path.is_symlink() or (path.exists() and not path.is_file()):
        return True
    return path.is_file() and (path.stat().st_size != len(data) or path.read_bytes() != data)


def put(out: Path, date: dt.date, format: str, data: bytes, *, force: bool) -> tuple[Written, str]:
    """Write a day's log.

    Parameters
    ----------
    out : Path
    date : date
    format : str
        csv, csv.gz or parquet.
    data : bytes
    force : bool
        Overwrite a log of that day that differs.

    Returns
    -------
    (str, str)
        "written", "identical" (it was there, byte by byte), or "differs" (another is there, and stays); and
        the name of the file in question.

    Raises
    ------
    RividError
        Where the disk refuses.
    """
    path = out / f"{date}.{format}"
    for suffix in SUFFIXES:
        other = out / f"{date}{suffix}"
        if other != path and other.exists():
            return "differs", other.name
    if path.is_symlink() or (path.exists() and not path.is_file()):
        return "differs", path.name
    if path.is_file():
        if path.stat().st_size == len(data) and path.read_bytes() == data:
            return "identical", path.name
        if not force:
            return "differs", path.name
    with replacing(path) as scratch:
        scratch.write_bytes(data)
    return "written", path.name
