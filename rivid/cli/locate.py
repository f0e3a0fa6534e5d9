"""Locate the configuration where --config is not given, and OUT where --out is not (cron needs no flags).

A ``rivid.toml`` is searched in DATA_DIR, links resolved, then in its parent directories up to the home
directory or the filesystem's root. The nearest one applies as a whole. Because it can direct writes elsewhere
(`[run] out`) and name Python code to run (`[diagnose] effects_file`), a file that another user owns or that
everybody can write to is refused.
"""

import os
import stat
from contextlib import suppress
from pathlib import Path

from rivid.cli.console import Console
from rivid.errors import ConfigError

NAME = "rivid.toml"


def configuration(given: Path | None, data_dir: Path, console: Console) -> Path | None:
    """Return --config, or the nearest rivid.toml (:func:`find`, named on stderr), or None without."""
    if given is not None:
        return given
    path = find(data_dir)
    if path is not None:
        console.info(f"configuration: {path}")
    return path


def find(data_dir: Path) -> Path | None:
    """Return the nearest rivid.toml from DATA_DIR, or the directory of a log file, upward; None without one.

    The path is absolute, with links resolved. ConfigError if the nearest one belongs to another user or is
    writable by everybody.
    """
    start = data_dir.resolve()
    if not start.is_dir():
        start = start.parent
    home = None
    with suppress(OSError, RuntimeError):  # a user without a home directory
        home = Path.home().resolve()
    with suppress(OSError):  # a directory without read permission: its parents are not the user's
        device = _device(start)
        for folder in (start, *start.parents):
            if _device(folder) != device:
                break
            if path := own(folder):
                return path
            if folder == home:
                break
    return None


def own(folder: Path) -> Path | None:
    """Return the rivid.toml in a directory itself; errors as :func:`find`."""
    path = folder / NAME
    try:
        facts = [path.lstat(), path.stat()]  # of a link, and of its target
    except OSError:
        return None
    _refuse_foreign(path, facts)
    return path


def _device(folder: Path) -> int:
    return folder.stat().st_dev


def _refuse_foreign(path: Path, facts: list[os.stat_result]) -> None:
    """Raise if the file, or the link to it, belongs to another user or is writable by everybody."""
    if not hasattr(os, "geteuid"):
        return  # Windows: no owner to compare
    advice = f"use it with --config {path}, or remove it"
    for one in facts:
        if one.st_uid not in (0, os.geteuid()):
            mine = "root" if os.geteuid() == 0 else f"{_user(os.geteuid())} or root"
            raise ConfigError(
                f"{path} belongs to {_user(one.st_uid)}, not to {mine}: a configuration that is found by "
                f"search can write results anywhere; if you trust it, {advice}"
            )
        if not stat.S_ISLNK(one.st_mode) and one.st_mode & stat.S_IWOTH:
            raise ConfigError(
                f"{path} is writable by everybody: a configuration that is found by search can write results "
                f"anywhere; `chmod o-w` it, {advice}"
            )


def _user(uid: int) -> str:
    import pwd

    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"user {uid}"


def results(given: Path | None, config: Path | None, data_dir: Path) -> Path:
    """Return OUT: --out, or `[run] out` relative to the configuration, or ``out`` in this directory.

    Of a fleet's directory of configurations, `[run] out` of its defaults.toml applies. ConfigError if OUT,
    without --out, holds results of other logs, which the run would replace.
    """
    if given is not None:
        return given
    configured, logs = _configured_out(config), data_dir.resolve()
    out = configured or Path("out")
    leads = f"[run] out leads to {out}, which" if configured else f"the default OUT, {out},"
    if (before := _logs_of(out)) not in (None, logs):  # OUT mirrors DATA_DIR: their results would be removed
        raise ConfigError(
            f"{leads} holds results of {before}: those of {data_dir} would replace them; give --out"
        )
    if (out / "fleet.json").is_file() and _logs_of(out / logs.name) == logs:
        raise ConfigError(
            f"{leads} holds results of a fleet: for {data_dir} alone give --out {out / logs.name}"
        )
    return out


def _configured_out(config: Path | None) -> Path | None:
    """Return `[run] out`; errors in the file are reported where it is loaded."""
    if config is None:
        return None
    from rivid.config import read_toml

    path = config / "defaults.toml" if config.is_dir() else config
    if not path.is_file():  # a pipe can be read only once, and has no directory that OUT could be relative to
        return None
    try:
        out = read_toml(path)["run"]["out"]
    except (ConfigError, KeyError, TypeError):
        return None
    return path.parent / out if isinstance(out, str) and out and "\0" not in out else None


def _logs_of(out: Path) -> Path | None:
    """Return DATA_DIR of the last run into OUT, if it is known and still exists."""
    from rivid.results.read import RECORD, read_json

    logs = read_json(out / RECORD).get("data_dir")
    return Path(logs).resolve() if isinstance(logs, str) and Path(logs).is_dir() else None
