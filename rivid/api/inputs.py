"""Conversion of arguments to configurations, scenarios and dates; the base class of the library's results."""

import datetime as dt
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rivid.config import Config, load_config, parse
from rivid.errors import ConfigError
from rivid.simulation.scenario import Scenario, load_scenario

if TYPE_CHECKING:
    from rivid.plots.library import Panel
    from rivid.plots.style import Picture

GivenConfig = Config | Path | str | Mapping[str, Any] | None
GivenScenario = Scenario | Path | str | Mapping[str, Any] | None
GivenDate = dt.date | str | None


class Result(ABC):
    """A frozen result with a repr of one line, and a figure with the same facts in its heading."""

    _between = 0.34

    @abstractmethod
    def _facts(self) -> str: ...

    @abstractmethod
    def _title(self) -> str: ...

    @abstractmethod
    def _panels(self) -> "Sequence[Panel]": ...

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._facts()})"

    def plot(self) -> "Picture":
        """Draw the result, for a notebook or ``.savefig``."""
        from rivid.plots.library import picture

        return picture(self._title(), self._note(), self._panels(), self._between)

    def _note(self) -> str:
        """The line under the heading."""
        return self._facts()


def as_config(given: GivenConfig) -> Config:
    """Return a configuration from a TOML file, a mapping, or the defaults; ConfigError names the key."""
    if isinstance(given, Config):
        return given
    if isinstance(given, Mapping):
        return parse(dict(given), Config)
    return load_config(None if given is None else Path(given))


def as_scenario(given: GivenScenario, changes: Mapping[str, Any]) -> Scenario:
    """Return a scenario likewise, with single keys changed; `days` alone keeps the share of missing days."""
    if isinstance(given, (str, Path)):
        given = load_scenario(given)
    raw = given.model_dump(exclude_unset=True) if isinstance(given, Scenario) else dict(given or {})
    if isinstance(days := changes.get("days"), int) and raw.get("missing_days"):
        whole = parse(raw, Scenario, "scenario")
        raw["missing_days"] = days * whole.missing_days // whole.days
    return parse(raw | dict(changes), Scenario, "scenario")


def as_date(given: GivenDate) -> dt.date | None:
    """Return a date from its ISO 8601 text; ConfigError if the text is no date."""
    if not isinstance(given, str):
        return given
    try:
        return dt.date.fromisoformat(given)
    except ValueError:
        raise ConfigError(f"date {given!r}: expected a date like 2008-03-14") from None
