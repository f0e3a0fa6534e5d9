"""The configuration where --config is not given, and OUT where --out is not: so that cron needs no flags.

A ``rivid.toml`` is looked for in DATA_DIR, links followed, then in the directories above it, as far as the
home directory or the filesystem reach. The nearest counts, whole. It may lead writes elsewhere (`[run]
out`) and name Python to run (`[diagnose] effects_file`): one that others own or may write to is refused.
"""

import os
import stat
from pathlib import Path

from rivid.cli.telling import Teller
from rivid.errors import ConfigError

NAME = "rivid.toml"
DEFAULT_OUT = Path("out")
"""Results, where nothing says otherwise."""


def configuration(given: Path | None, data_dir: Path, tell: Teller) -> Path | None:
    """--config, or the rivid.toml that is found, with a word about it; None: the defaults.

    Parameters
    ----------
    given : Path or None
        --config: it wins.
    data_dir : Path
    tell : Teller

    Returns
    -------
    Path or None

    Raises
    ------
    ConfigError
        As :func:`find`.
    """
    if given is not None:
        return given
    path = find(data_dir)
    if path is not None:
        tell.note(f"configuration: {path}")
    return path


def find(data_dir: Path) -> Path | None:
    """The nearest rivid.toml from DATA_DIR upward; None where there is none.

    Parameters
    ----------
    data_dir : Path
        A directory of logs, or a log: then it is looked for beside it.

    Returns
    -------
    Path or None
        Absolute, links resolved.

    Raises
    ------
    ConfigError
        Where the nearest belongs to somebody else, or everybody may write to it.
    """
    start = data_dir.resolve()
    if not start.is_dir():
        start = start.parent
    home = _home()
    try:
        device = _device(start)
        for folder in (start, *start.parents):
            if _device(folder) != device:
                return None
            if found := own(folder):
                return found
            if folder == home:
                return None
    except OSError:  # a directory that may not be looked at: what is above it is not ours
        return None
    return None


def own(folder: Path) -> Path | None:
    """The rivid.toml of a directory itself.

    Raises
    ------
    ConfigError
        As :func:`find`.
    """
    path = folder / NAME
    try:
        facts = [path.lstat(), path.stat()]  # of a link, and of what it leads to
    except OSError:
        return None
    _refuse_strangers(path, facts)
    return path


def _device(folder: Path) -> int:
    return folder.stat().st_dev


def _home() -> Path | None:
    try:
        return Path.home().resolve()
    except (OSError, RuntimeError):  # a user without one
        return None


def _refuse_strangers(path: Path, facts: "list[os.stat_result]") -> None:
    if not hasattr(os, "geteuid"):
        return  # Windows: no owner to compare
    advice = f"take it with --config {path}, or take it away"
    for one in facts:
        if one.st_uid not in (0, os.geteuid()):
            raise ConfigError(
                f"{path} belongs to {_user(one.st_uid)}, not to {_mine()}: a found configuration may lead "
                f"results anywhere; if you trust it, {advice}"
            )
        if not stat.S_ISLNK(one.st_mode) and one.st_mode & stat.S_IWOTH:
            raise ConfigError(
                f"{path} may be written by everybody: a found configuration may lead results anywhere; "
                f"`chmod o-w` it, {advice}"
            )


def _mine() -> str:
    return "root" if os.geteuid() == 0 else f"{_user(os.geteuid())} or root"


def _user(uid: int) -> str:
    import pwd

    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"user {uid}"


def results(given: Path | None, config: Path | None, data_dir: Path) -> Path:
    """OUT: --out, or `[run] out` of the configuration, relative to it, or ``out`` here.

    Parameters
    ----------
    given : Path or None
        --out.
    config : Path or None
        A file, or a fleet's directory of configurations: then its defaults.toml speaks.
    data_dir : Path

    Returns
    -------
    Path

    Raises
    ------
    ConfigError
        Where the configuration leads to results of other logs, which would be lost.
    """
    if given is not None:
        return given
    said = _said(config)
    if said is None:
        return DEFAULT_OUT
    _refuse_others(said, data_dir)
    return said


def _said(config: Path | None) -> Path | None:
    """`[run] out`; what is wrong with the file is said where it is loaded."""
    if config is None:
        return None
    import tomllib

    path = config / "defaults.toml" if config.is_dir() else config
    if not path.is_file():  # a pipe can be read once only, and has no place that OUT could be relative to
        return None
    try:
        with open(path, "rb") as file:
            raw = tomllib.loads(file.read(1_000_000).decode("utf-8-sig"))
        out = raw["run"]["out"]
    except (OSError, ValueError, RecursionError, KeyError, TypeError):
        return None
    return path.parent / out if isinstance(out, str) and out and "\0" not in out else None


def _refuse_others(out: Path, data_dir: Path) -> None:
    """OUT mirrors DATA_DIR: the results of other logs would leave it. Asked for by --out, they may."""
    before = _logs_of(out)
    if before is not None and before != data_dir.resolve():
        raise ConfigError(
            f"[run] out leads to {out}, which holds results of {before}: those of {data_dir} would replace "
            "them; give --out"
        )
    of_reach = out / data_dir.resolve().name
    if (out / "fleet.json").is_file() and _logs_of(of_reach) == data_dir.resolve():
        raise ConfigError(
            f"[run] out leads to {out}, which holds results of a fleet: for {data_dir} alone give "
            f"--out {of_reach}"
        )


def _logs_of(out: Path) -> Path | None:
    """DATA_DIR of the last run into OUT, where it can be told and is there still."""
    import json

    try:
        said = Path(json.loads((out / "run.json").read_text(encoding="utf-8"))["data_dir"])
        return said.resolve() if said.is_dir() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None
