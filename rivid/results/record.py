"""run.json: settings, counts and versions of a run, and the hashes of its files."""

import datetime as dt
import hashlib
import json
import platform
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from rivid import __version__
from rivid.atomic import write_text
from rivid.config import Config
from rivid.results.tables import SCHEMA_VERSION, refuse_newer

NAME = "run.json"


def last(out: Path) -> dict[str, Any]:
    """The record of the last run into OUT; empty without one.

    Raises
    ------
    RividError
        If a newer rivid wrote it.
    """
    try:
        record = json.loads((out / NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(record, dict) or not isinstance(record.get("schema_version", 0), int):
        return {}
    refuse_newer({"schema_version": 0} | record, out)
    return record


def describe(config: Config, data_dir: Path, started: dt.datetime) -> dict[str, Any]:
    """The part of the record that is known before the run; order and delays are those of [jmap]."""
    settings = config.jmap_settings()
    versions = {"rivid": __version__, "python": platform.python_version()}
    versions |= {"numpy": np.__version__, "pyarrow": pa.__version__}
    versions |= {name: version(name) for name in ("scipy", "matplotlib")}  # not loaded, perhaps
    return {
        "schema_version": SCHEMA_VERSION,
        "reach": config.reach.name,
        "sample_time": config.reach.sample_time,
        "output_unit": config.reach.output_unit,
        "estimators": list(config.run.estimators),
        "order": settings.order,
        "d_min": settings.d_min,
        "d_max": settings.d_max,
        "delay_scale": settings.delay_scale,
        "assumed": assumed(config),
        "data_dir": str(data_dir),
        "started": started.isoformat(timespec="seconds"),
        "versions": versions,
        "config": config.as_used(),
    }


def assumed(config: Config) -> list[str]:
    """Keys of the geometry that are not configured: their defaults are those of another reach (Table I).

    Examples
    --------
    >>> assumed(Config()), assumed(Config.model_validate({"reach": {"length": 15e3, "bed_level": 90.0}}))
    (['length', 'width', 'depth'], ['width'])
    """
    reach = config.reach
    given = reach.model_fields_set | ({"depth"} if reach.bed_level is not None else set())
    return [key for key in ("length", "width", "depth") if key not in given]


def unfinished(out: Path, record: dict[str, Any]) -> None:
    """Write a record without hashes, which no run takes for finished, while files of OUT are replaced."""
    write(out, record | {"content": None, "outputs": {}})


def write(out: Path, record: dict[str, Any]) -> None:
    """Write run.json."""
    write_text(out / NAME, json.dumps(record, indent=2, sort_keys=True) + "\n")


def hashes(out: Path, files: Iterable[Path]) -> dict[str, str]:
    """SHA-256 of files of OUT, by their path in it."""
    return {str(path.relative_to(out)): _hash(path) for path in sorted(files)}


def _hash(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_whole(out: Path, record: dict[str, Any], figures: bool) -> bool:
    """Whether all files of the recorded run, with `figures` also a report, have the recorded hashes."""
    outputs = record.get("outputs") or {}
    if not outputs or (figures and "report.html" not in outputs):
        return False
    try:
        return hashes(out, [out / name for name in outputs]) == outputs
    except OSError:
        return False
