"""What a user may give for a configuration, a scenario or a date, made into one kind of thing."""

import datetime as dt
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rivid.config import Config, load_config, parse
from rivid.errors import ConfigError
from rivid.simulation.scenario import Scenario, load_scenario

GivenConfig = Config | Path | str | Mapping[str, Any] | None
GivenScenario = Scenario | Path | str | Mapping[str, Any] | None
GivenDate = dt.date | str | None


def as_config(given: GivenConfig) -> Config:
    """A configuration from a TOML file, from tables, or the defaults.

    Raises
    ------
    ConfigError
        For an unknown key or an impossible value; it names the key.
    """
    if isinstance(given, Config):
        return given
    if isinstance(given, Mapping):
        return parse(dict(given), Config)
    return load_config(None if given is None else Path(given))


def as_scenario(given: GivenScenario, changes: Mapping[str, Any]) -> Scenario:
    """A scenario from a TOML file, from tables, or the defaults, with single keys changed.

    Raises
    ------
    ConfigError
        For an unknown key or an impossible value; it names the key.
    """
    if given is None:
        said = Scenario()
    elif isinstance(given, Scenario):
        said = given
    elif isinstance(given, Mapping):
        said = parse(dict(given), Scenario, "scenario")
    else:
        said = load_scenario(given)
    if not changes:
        return said
    return parse(said.model_dump(exclude_unset=True) | dict(changes), Scenario, "scenario")


def as_date(given: GivenDate) -> dt.date | None:
    """A date, or its ISO 8601 text.

    Raises
    ------
    ConfigError
        Where the text is no date.
    """
    if not isinstance(given, str):
        return given
    try:
        return dt.date.fromisoformat(given)
    except ValueError:
        raise ConfigError(f"date {given!r}: expected a date like 2008-03-14") from None
