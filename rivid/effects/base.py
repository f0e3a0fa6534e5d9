"""What an effect is: a name, parameters with limits, and what it changes in a reach."""

import datetime as dt
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

from rivid.errors import ConfigError
from rivid.reach.changes import Changes
from rivid.types import DAY, Floats

Family = Literal["flow", "timing", "level"]
FAMILIES: tuple[Family, ...] = ("flow", "timing", "level")


@dataclass(frozen=True)
class Quantity:
    """Unit, limits (both allowed) and meaning of a parameter.

    `many` parameters may be sequences; unit and limits then hold for each element.
    """

    unit: str
    low: float
    high: float
    meaning: str
    many: bool = False


def quantity(default: Any, unit: str, low: float, high: float, meaning: str, *, many: bool = False) -> Any:
    """A parameter of an effect, as a field of its dataclass."""
    return field(default=default, metadata={"quantity": Quantity(unit, low, high, meaning, many)})


@dataclass(frozen=True, eq=False)
class World:
    """Where an effect takes place: the time grid, what the logs hold there, and the usual state.

    Parameters
    ----------
    time : ndarray, shape (n,) or (days, n)
        Sample times [s] since midnight, local time, of `first_day`; increasing along the last axis.
        What stands before 0 is lead time.
    inflow, outflow : ndarray, same shape
        Logged commands [m3/s]; `outflow` is None while the operators have yet to give it.
    first_day : datetime.date
    sample_time : float
        T_s [s].
    level : float
        Usual level at the gauge [m]: what level-dependent effects count from.
    flow : float
        Usual discharge [m3/s].
    seed : tuple of int
        For effects that are drawn: the same seed, the same draw.
    """

    time: Floats
    inflow: Floats
    outflow: Floats | None
    first_day: dt.date
    sample_time: float
    level: float
    flow: float
    seed: tuple[int, ...] = (0,)

    def rng(self, stream: int = 0) -> np.random.Generator:
        """A generator of its own for each stream."""
        return np.random.default_rng([*self.seed, stream])

    @property
    def hour(self) -> Floats:
        """Hour of the day of each sample, 0 to 24 [h]."""
        return np.asarray(np.mod(self.time, DAY) / 3600.0)

    def day_of(self, date: dt.date) -> float:
        """Midnight at which a date begins [s]."""
        return (date - self.first_day).days * DAY


@dataclass(frozen=True, kw_only=True)
class Effect(ABC):
    """Something that a simulation of the reach lacks.

    A subclass is a frozen dataclass whose fields, made by :func:`quantity`, are its parameters. It says
    once how it enters the reach, and serves both sides: `rivid simulate` applies it, `rivid diagnose`
    differentiates it.

    Attributes
    ----------
    name : str
        Canonical name.
    family : {"flow", "timing", "level"}
    sentence : str
        What it is, for an engineer.
    looks : str
        What it looks like in the logs.
    windowed : bool
        Whether it may be limited to dates and hours.

    Parameters
    ----------
    dates : (datetime.date, datetime.date) or None
        First and last day on which it is there, both included; None is always.
    hours : (float, float) or None
        Hours of the day between which it is there; (22, 6) passes midnight; None is always.
    """

    name: ClassVar[str]
    family: ClassVar[Family]
    sentence: ClassVar[str]
    looks: ClassVar[str]
    windowed: ClassVar[bool] = True

    dates: tuple[dt.date, dt.date] | None = None
    hours: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for one, said in self.parameters().items():
            value = getattr(self, one)
            if isinstance(value, tuple) and not said.many:
                raise ConfigError(f"{self.name}: {one} = {list(value)}: expected one number [{said.unit}]")
            for i, part in enumerate(value if isinstance(value, tuple) else (value,)):
                number = isinstance(part, int | float | np.number) and not isinstance(part, bool)
                if not number or not said.low <= part <= said.high:
                    at = f"[{i}]" if isinstance(value, tuple) else ""
                    came = f"{part:g}" if number else repr(part)
                    raise ConfigError(
                        f"{self.name}: {one}{at} = {came}: expected a number from {said.low:g} to "
                        f"{said.high:g} [{said.unit}] ({said.meaning})"
                    )
        if (self.dates is not None or self.hours is not None) and not self.windowed:
            raise ConfigError(f"{self.name}: dates and hours are given, but it is always there: remove them")
        if self.dates is not None and self.dates[0] > self.dates[1]:
            raise ConfigError(
                f"{self.name}: dates = {self.dates[0]} to {self.dates[1]}: expected the first before the last"
            )
        if self.hours is not None and not all(0.0 <= h <= 24.0 for h in self.hours):
            raise ConfigError(f"{self.name}: hours = {list(self.hours)}: expected two hours from 0 to 24")
        if self.hours is not None and self.hours[0] % 24.0 == self.hours[1] % 24.0 and self.hours != (0, 24):
            raise ConfigError(f"{self.name}: hours = {list(self.hours)}: expected two different hours")

    @classmethod
    def parameters(cls) -> dict[str, Quantity]:
        """Unit, limits and meaning of each parameter, by name."""
        return {f.name: f.metadata["quantity"] for f in cls._quantities()}

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Usual value of each parameter."""
        return {f.name: f.default for f in cls._quantities() if f.default is not MISSING}

    @classmethod
    def _quantities(cls) -> list[Field[Any]]:
        return [f for f in fields(cls) if "quantity" in f.metadata]

    @classmethod
    def from_table(cls, table: dict[str, Any]) -> Self:
        """Build from the keys of a configuration; `name` may be among them.

        Raises
        ------
        ConfigError
            Naming the effect and the key.
        """
        given = {key: value for key, value in table.items() if key != "name"}
        valid = [*cls.parameters(), "dates", "hours"]
        for key in given:
            if key not in valid:
                raise ConfigError(f"{cls.name}: unknown key {key!r}: expected {', '.join(valid)}")
        for key, value in given.items():
            if isinstance(value, list):
                given[key] = tuple(value)
        if "dates" in given:
            given["dates"] = _two_dates(cls.name, given["dates"])
        if "hours" in given and (
            not isinstance(given["hours"], tuple)
            or len(given["hours"]) != 2
            or not all(isinstance(h, int | float) for h in given["hours"])
        ):
            raise ConfigError(f"{cls.name}: hours = {table['hours']!r}: expected [from, to] in hours")
        return cls(**given)

    def with_values(self, **values: Any) -> Self:
        """The same effect with other values of some parameters."""
        return replace(self, **values)

    def to_table(self) -> dict[str, Any]:
        """The keys that give this effect again, for a configuration."""
        table: dict[str, Any] = {"name": self.name}
        for one in self.parameters():
            value = getattr(self, one)
            table[one] = list(value) if isinstance(value, tuple) else value
        if self.dates is not None:
            table["dates"] = list(self.dates)
        if self.hours is not None:
            table["hours"] = list(self.hours)
        return table

    def active(self, world: World) -> Floats:
        """1 where dates and hours allow the effect, 0 elsewhere; shape of the time grid."""
        on = np.ones(world.time.shape, bool)
        if self.dates is not None:
            first, last = (world.day_of(date) for date in self.dates)
            on &= (world.time >= first) & (world.time < last + DAY)
        if self.hours is not None:
            start, end = self.hours
            hour = world.hour
            on &= (hour >= start) & (hour < end) if start <= end else (hour >= start) | (hour < end)
        return on.astype(float)

    @abstractmethod
    def changes(self, world: World) -> Changes:
        """What the effect changes. With `world.outflow` None it may not depend on the outflow."""


def _two_dates(name: str, value: Sequence[Any]) -> tuple[dt.date, dt.date]:
    try:
        if any(isinstance(v, dt.datetime) for v in value):  # which is a date as well, to Python
            raise TypeError
        first, last = (v if isinstance(v, dt.date) else dt.date.fromisoformat(v) for v in value)
    except (TypeError, ValueError):
        raise ConfigError(f"{name}: dates = {value!r}: expected [first, last] as YYYY-MM-DD") from None
    return first, last
