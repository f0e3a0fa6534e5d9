"""Find the reaches of a fleet, and the configuration of each: its own file over shared defaults."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rivid.errors import ConfigError, NoDataError, RividError
from rivid.logs import suffix_of

if TYPE_CHECKING:
    from rivid.config import Config

DEFAULTS = "defaults.toml"
"""File of the keys that all reaches share, in a directory of configurations."""

NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,79}")
DATED = re.compile(
    r"(19|20)\d\d([-_.]?(0[1-9]|1[0-2])([-_.]?(0[1-9]|[12]\d|3[01]))?)?|0?[1-9]|[12]\d|3[01]", re.ASCII
)
"""Names of directories of a year, a month or a day."""
OWN = ("fleet.html", "fleet.csv", "fleet.parquet", "fleet.json")
"""Files of the fleet itself in OUT; no reach may have such a name."""


@dataclass(frozen=True)
class Reach:
    """One reach of a fleet, its configuration not yet validated."""

    data_dir: Path
    raw: dict[str, Any]  # its TOML, own keys over shared ones
    source: str  # the file of it, for messages
    fault: RividError | None = None  # why it cannot be run

    @property
    def name(self) -> str:
        """Name of its directory of logs."""
        return self.data_dir.name

    def config(self) -> "Config":
        """The validated configuration; ConfigError or NoDataError, in one line, where there is none."""
        from rivid.config import Config, merged, parse

        if self.fault:
            raise self.fault
        raw = merged({"reach": {"name": self.name}}, self.raw)
        reach = raw["reach"]
        if isinstance(reach, dict) and reach["name"] != self.name:
            raise ConfigError(
                f"{self.source}: reach.name = {reach['name']!r}: in a fleet the directory names the reach: "
                f"leave it out, or write {self.name!r}"
            )
        return parse(raw, Config, self.source)


def find_fleet(
    data_dir: Path,
    configs: Path | None,
    estimators: Sequence[str] = (),
    beside: Callable[[Path], Path | None] | None = None,
) -> list[Reach] | None:
    """The reaches of a fleet, by name; None where DATA_DIR is that of a single reach.

    DATA_DIR is a fleet's where it holds directories of logs and no log itself, or where `configs` is a
    directory: then each reach has the keys of ``<reach>.toml`` there over those of ``defaults.toml``. A file
    is shared by all reaches. `estimators` replace the configured ones. `beside` returns the configuration in
    the directory of a reach's logs, or None; its keys replace shared ones, and a ConfigError of it becomes
    the fault of that reach. ConfigError if the shared configuration cannot be read; NoDataError if there are
    configurations of a fleet and no reach, or if all directories are those of years, months or days.
    """
    from rivid.config import Config, merged, parse, read_config

    asked = configs is not None and configs.is_dir()
    if asked and not data_dir.is_dir():
        raise NoDataError(f"{data_dir} is no directory: a fleet is expected there, as {configs} is one")
    if not asked and holds_logs(data_dir):
        return None
    folders = {
        path: holds_logs(path)
        for path in data_dir.iterdir()
        if not path.name.startswith(".") and path.is_dir()
    }
    if not asked and not any(folders.values()):
        return None
    shared: dict[str, Any] = {}
    own: dict[str, Path] = {}
    if configs is not None and asked:
        own = {path.stem: path for path in configs.glob("[!.]*.toml") if path.name != DEFAULTS}
        shared = read_config(configs / DEFAULTS) if (configs / DEFAULTS).exists() else {}
    elif configs is not None:
        shared = read_config(configs)
        parse(shared, Config, str(configs))  # a fault of it is reported once, not for each reach

    holding = [path for path, holds in folders.items() if holds]
    if holding and all(path.name not in own and _is_dated(path) for path in holding):
        from rivid.logs.days import below

        which = f"the directories in {data_dir} are dates, not reaches, such as {min(holding).name}"
        raise NoDataError(f"{which}: {below(data_dir)}")

    def made(path: Path, mine: Path | None) -> Reach:
        fault = _fault(path, data_dir)
        raw: dict[str, Any] = {}
        source = mine or configs or "the defaults"
        try:
            if beside is not None and not fault:  # not through a link that leads elsewhere
                mine = mine or beside(path)
                source = mine or source
            raw = merged(shared, read_config(mine) if mine else {})
        except RividError as error:
            fault = fault or str(error)
        if estimators:
            raw = merged(raw, {"run": {"estimators": list(estimators)}})
        return Reach(path, raw, str(source), ConfigError(fault) if fault else None)

    reaches = [
        made(path, own.pop(path.name, None)) for path, holds in folders.items() if holds or path.name in own
    ]
    for name, path in own.items():
        missing = f"{path} is of a reach without directory of logs: {data_dir / name} does not exist"
        reaches.append(Reach(data_dir / name, {}, str(path), NoDataError(missing)))
    if not reaches:
        raise NoDataError(
            f"no reach in {data_dir}: a directory of logs is expected for each, {data_dir}/<reach>/"
        )
    return sorted(reaches, key=lambda reach: reach.name)


def holds_logs(folder: Path) -> bool:
    """Whether a directory holds a log, or cannot be read: its run reports why."""
    try:
        with os.scandir(folder) as entries:
            return any(
                suffix_of(e.name) is not None and not e.name.startswith(".") and not e.is_dir()
                for e in entries
            )
    except OSError:
        return True


def _is_dated(folder: Path) -> bool:
    """Whether a directory is of a year, a month or a day: by its name, and by those of its daily logs."""
    from rivid.logs.spec import is_day_file

    if not DATED.fullmatch(folder.name):
        return False
    try:
        days = [path.name.replace("-", "") for path in folder.iterdir() if is_day_file(path.name)]
    except OSError:
        return False
    name = re.sub(r"\D", "", folder.name).zfill(2)
    if len(name) > 2:
        return all(day.startswith(name) for day in days)
    return bool(days) and any({day[k : k + 2] for day in days} == {name} for k in (4, 6))


def _fault(path: Path, data_dir: Path) -> str:
    """Why a directory cannot be a reach, or ""."""
    from rivid.logs.spec import shown

    name = path.name
    if not NAME.fullmatch(name):
        return f"{shown(name)!r} cannot name a reach: expected at most 80 letters, digits, . _ -: rename it"
    if name in OWN:
        return f"{name!r} cannot name a reach: OUT/{name} is the fleet's own: rename it"
    if path.is_symlink() and path.resolve().parent != data_dir.resolve():
        return f"{path} is a link that leads out of {data_dir}: put the directory itself there"
    return ""
