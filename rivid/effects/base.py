"""Base class of effects: parameters with limits, changes to a reach, and properties for the diagnosis."""

import datetime as dt
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any, ClassVar, Literal, Self, get_args

import numpy as np

from rivid.errors import ConfigError
from rivid.reach.changes import Changes
from rivid.types import DAY, Bools, Floats

Family = Literal["flow", "timing", "level"]
FAMILIES: tuple[Family, ...] = get_args(Family)
Dates = Literal["all", "from", "until", "between"]
"""Windows of dates that are scanned: the whole season, from or until a date, between two dates."""
FoundAs = Literal["", "recession", "pulse", "jump", "level noise", "swing"]
EVENTS: tuple[FoundAs, ...] = ("recession", "pulse", "jump")
"""Searches that return events, from which :meth:`Effect.from_events` makes the effect."""
LEVEL_NOISES: tuple[FoundAs, ...] = ("level noise", "swing")
"""Searches that return a noise of the level, which the noise model represents, not the simulation."""


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
    """Return a dataclass field that is a parameter of an effect."""
    return field(default=default, metadata={"quantity": Quantity(unit, low, high, meaning, many)})


Sizes = float | tuple[float, ...]
"""Of a parameter that may be `many`."""
LOW, HIGH = -87_600.0, 876_000.0
"""Limits of a start: ten years before the first day and a hundred after it [h]."""


@dataclass(frozen=True, eq=False)
class World:
    """Input of an effect: the time grid, the logged flows, and the usual state.

    `time` has shape (n,) or (days, n), and increases along the last axis; the flows have the same shape.
    """

    time: Floats  #: sample times [s] since midnight, local time, of `first_day`; below 0 it is lead time
    inflow: Floats  #: logged commands [m3/s]
    outflow: Floats | None  #: the same; None before the operators are simulated
    first_day: dt.date
    sample_time: float  #: T_s [s]
    level: float  #: usual level at the gauge [m]: reference of level-dependent effects
    flow: float  #: usual discharge [m3/s]
    earlier: Floats | None = None  #: commands of the outflow before each row [m3/s], (days, m); None: unknown
    seed: tuple[int, ...] = (0,)  #: for random effects: the same seed gives the same draw

    def rng(self, stream: int = 0) -> np.random.Generator:
        """Random generator of a stream."""
        return np.random.default_rng([*self.seed, stream])

    @property
    def hour(self) -> Floats:
        """Hour of the day of each sample, 0 to 24 [h]."""
        return np.asarray(np.mod(self.time, DAY) / 3600.0)

    @property
    def edges(self) -> Floats:
        """Beginning of each sample and end of the last [s]; shape (..., n + 1).

        The last sample is as long as all others, but ends at midnight, where the grid begins anew.
        """
        last = self.time[..., -1:]
        midnight = (np.floor(last / DAY) + 1.0) * DAY
        return np.concatenate([self.time, np.minimum(last + self.sample_time, midnight)], axis=-1)

    def mean_of(self, volume: Callable[[Floats], Floats]) -> Floats:
        """Mean over each sample of a flow with a given cumulative volume [m3/s]."""
        ends = self.edges
        return np.asarray(np.diff(volume(ends), axis=-1) / np.diff(ends, axis=-1))

    def day_of(self, date: dt.date) -> float:
        """Midnight at which a date begins [s]."""
        return (date - self.first_day).days * DAY


@dataclass(frozen=True)
class Trial:
    """Columns by which the diagnosis tests an effect.

    A column is the change of the simulated output for a small or usual size of the effect, per unit of the
    coefficient that is estimated. Effects that are not proportional to their size (lags, clocks, basins)
    have a trial for each of several sizes.
    """

    name: str  # canonical name of the effect
    label: str  # which of its trials
    effects: tuple["Effect", ...]  # one for each column; empty where columns come from the step response
    sizes: tuple[float, ...]  # of each instance, in units of its coefficient
    make: Callable[[Floats], "Effect"]  # the effect for coefficients of shape (k,)
    free: tuple[str, ...]  # parameters that are fitted once the effect is in the model
    dates: Dates = "all"  # windows to scan
    sign: int = 0  # that a single coefficient must have; 0 is either
    hourly: str = ""  # "up" or "down": a column for each hour, from the step response to a flow at that dam


@dataclass(frozen=True, kw_only=True)
class Effect(ABC):
    """Something that a simulation of the reach lacks.

    A subclass is a frozen dataclass; its fields, made by :func:`quantity`, are its parameters. `rivid
    simulate` applies it and `rivid diagnose` searches for it; all that either needs stands on the class.

    Parameters
    ----------
    dates : (datetime.date, datetime.date) or None
        First and last day on which it is there, both included; None is always.
    hours : (float, float) or None
        Hours of the day between which it is there; (22, 6) passes midnight; None is always.
    """

    name: ClassVar[str]  #: canonical name
    family: ClassVar[Family]
    sentence: ClassVar[str]  #: description in one sentence
    looks: ClassVar[str]  #: how it appears in the logs
    windowed: ClassVar[bool] = True  #: it may be limited to dates and hours
    acts_on_river: ClassVar[bool] = True  #: possible in a river, which has neither an outflow nor a level
    acts_on_pool: ClassVar[bool] = True  #: possible in any other reach
    #: without dates it is part of the response, as a clock that was always off is a travel time
    needs_dates: ClassVar[bool] = False
    repeatable: ClassVar[bool] = False  #: a diagnosis may name it more than once
    varies_with_date: ClassVar[str] = ""  #: parameter that may hold several values spread over the dates
    #: parameters in which the output changes in steps; they are found by trying values
    stepwise: ClassVar[tuple[str, ...]] = ()
    #: search of the diagnosis that finds it, in addition to its trials. Recessions, pulses and jumps are
    #: events and need :meth:`from_events`; the others set the parameters of `wind_setup` and `seiche`
    found_as: ClassVar[FoundAs] = ""
    #: parameters that are not fitted beside a parameter of the response, by its name
    held_by: ClassVar[dict[str, str]] = {}
    #: effects with nearly the same column: when one is in the model, its remainder is not named another
    twins: ClassVar[tuple[str, ...]] = ()
    #: parameters that it is proportional to, and the small value of each at which its column is computed
    linear_trials: ClassVar[dict[str, float]] = {}
    #: other parameters, and the sizes at which the diagnosis tries each
    sized_trials: ClassVar[dict[str, tuple[float, ...]]] = {}
    #: its linear trial is an error of the gauge that grows with the days, and is gone at the midnight after
    #: its last date
    set_right: ClassVar[bool] = False
    trial_dates: ClassVar[Dates] = "all"  #: windows that these trials scan
    trial_sign: ClassVar[int] = 0  #: that the coefficient of the linear ones must have
    #: effects that data of normal operation may not separate from it, each with the measurement or gate
    #: operation that does; one of the two classes suffices
    confounded_with: ClassVar[dict[str, str]] = {}

    dates: tuple[dt.date, dt.date] | None = None
    hours: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for key, spec in self.parameters().items():
            value = getattr(self, key)
            if isinstance(value, tuple) and not spec.many:
                raise ConfigError(f"{self.name}: {key} = {list(value)}: expected one number [{spec.unit}]")
            for i, part in enumerate(value if isinstance(value, tuple) else (value,)):
                number = isinstance(part, int | float | np.number) and not isinstance(part, bool)
                if not number or not spec.low <= part <= spec.high:
                    at = f"[{i}]" if isinstance(value, tuple) else ""
                    came = f"{part:g}" if number else repr(part)
                    raise ConfigError(
                        f"{self.name}: {key}{at} = {came}: expected a number from {spec.low:g} to "
                        f"{spec.high:g} [{spec.unit}] ({spec.meaning})"
                    )
        if (self.dates is not None or self.hours is not None) and not self.windowed:
            raise ConfigError(f"{self.name}: dates and hours are given, but it is always there: remove them")
        if self.dates is not None and self.dates[0] > self.dates[1]:
            raise ConfigError(
                f"{self.name}: dates = {self.dates[0]} to {self.dates[1]}: expected the first before the last"
            )
        if self.hours is None:
            return
        if not all(0.0 <= h <= 24.0 for h in self.hours):
            raise ConfigError(f"{self.name}: hours = {list(self.hours)}: expected two hours from 0 to 24")
        if self.hours[0] % 24.0 == self.hours[1] % 24.0 and self.hours != (0, 24):
            raise ConfigError(f"{self.name}: hours = {list(self.hours)}: expected two different hours")

    @classmethod
    def acts_on(cls, kind: str) -> bool:
        """Whether it is possible in a reach of `kind` "pool" or "river"."""
        return cls.acts_on_river if kind == "river" else cls.acts_on_pool

    @classmethod
    def parameters(cls) -> dict[str, Quantity]:
        """Unit, limits and meaning of each parameter, by name."""
        return {f.name: f.metadata["quantity"] for f in fields(cls) if "quantity" in f.metadata}

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Usual value of each parameter."""
        return {
            f.name: f.default for f in fields(cls) if "quantity" in f.metadata and f.default is not MISSING
        }

    @classmethod
    def from_table(cls, table: dict[str, Any]) -> Self:
        """Build from the keys of a configuration, with `name` or without; ConfigError names both."""
        given = {key: tuple(v) if isinstance(v, list) else v for key, v in table.items() if key != "name"}
        valid = [*cls.parameters(), "dates", "hours"]
        for key in given:
            if key not in valid:
                raise ConfigError(f"{cls.name}: unknown key {key!r}: expected {', '.join(valid)}")
        if "dates" in given:
            given["dates"] = _two_dates(cls.name, given["dates"])
        match given.get("hours", (0, 24)):
            case (int() | float(), int() | float()):
                return cls(**given)
        raise ConfigError(f"{cls.name}: hours = {table['hours']!r}: expected [from, to] in hours")

    @property
    def degenerate(self) -> bool:
        """Whether its values are at limits at which it would be another effect."""
        return False

    def with_values(self, **values: Any) -> Self:
        """The same effect with other values of some parameters."""
        return replace(self, **values)

    def to_table(self) -> dict[str, Any]:
        """The effect as a table of a configuration."""
        windows = [key for key in ("dates", "hours") if getattr(self, key) is not None]
        values = {key: getattr(self, key) for key in (*self.parameters(), *windows)}
        listed = {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}
        return {"name": self.name} | listed

    def active(self, world: World) -> Floats:
        """1 where dates and hours allow the effect, 0 elsewhere; shape of the time grid."""
        return self.allows(world.time, world).astype(float)

    def allows(self, time: Floats, world: World) -> Bools:
        """Whether dates and hours allow the effect at times [s]; shape of `time`."""
        on = np.ones(time.shape, bool)
        if self.dates is not None:
            first, last = (world.day_of(date) for date in self.dates)
            on &= (time >= first) & (time < last + DAY)
        if self.hours is not None:
            start, end = self.hours
            hour = np.mod(time, DAY) / 3600.0
            on &= (hour >= start) & (hour < end) if start <= end else (hour >= start) | (hour < end)
        return on

    @classmethod
    def trials(cls, world: World) -> list[Trial]:
        """Trials in a record's diagnosis; unless a class defines others, the effect at its usual size."""
        dates, sign = cls.trial_dates, cls.trial_sign
        tried = [cls.linear_trial(k, at, dates=dates, sign=sign) for k, at in cls.linear_trials.items()]
        tried += [cls.trial_at(k, at, dates=dates) for k, sizes in cls.sized_trials.items() for at in sizes]
        if tried:
            return tried
        usual = cls.defaults()
        free = tuple(key for key, value in usual.items() if isinstance(value, float | int) and value != 0)
        if cls.found_as in ("jump", *LEVEL_NOISES) or set(cls.parameters()) - set(usual) or not free:
            return []
        key, size = free[0], float(usual[free[0]])
        return [
            Trial(cls.name, "usual size", (cls(),), (1.0,), lambda c: cls.with_size(key, c[0] * size), free)
        ]

    @classmethod
    def linear_trial(
        cls, key: str, unit: float, *, dates: Dates = "all", sign: int = 0, also: tuple[str, ...] = (),
        **fixed: Any,
    ) -> Trial:  # fmt: skip
        """A trial with the parameter `key` as its coefficient; its column is computed at the value `unit`."""

        def make(c: Floats) -> Effect:
            return cls.with_size(key, c[0], **fixed)

        small = cls(**fixed | {key: unit})
        return Trial(cls.name, _label(fixed) or key, (small,), (unit,), make, (key, *also), dates, sign)

    @classmethod
    def trial_at(
        cls, key: str, size: float, *, dates: Dates = "all", also: tuple[str, ...] = (), within: float = 3.0,
        **fixed: Any,
    ) -> Trial:  # fmt: skip
        """A trial at one size of the parameter `key`; its coefficient is the share of that size.

        The column holds near the size that it was computed at: up to `within` times that, and down to its
        part.
        """

        def make(c: Floats) -> Effect:
            return cls.with_size(key, float(np.clip(c[0], 1.0 / within, within)) * size, **fixed)

        values = fixed | {key: size}
        return Trial(cls.name, _label(values), (cls(**values),), (1.0,), make, (key, *also), dates, 1)

    @classmethod
    def hourly_trial(cls, dam: Literal["up", "down"], **fixed: Any) -> Trial:
        """A trial of a release of one `size` at a dam in a run of hours of the day."""

        def make(c: Floats) -> Effect:
            return cls.with_size("size", c[0], **fixed)

        return Trial(cls.name, "hours", (), (), make, ("size",), "between", 1, dam)

    @classmethod
    def with_size(cls, key: str, value: float, **others: Any) -> Self:
        """The effect with a value of the parameter `key`, within its limits, and other parameters."""
        return cls(**others | {key: cls.clipped(key, value)})

    @classmethod
    def clipped(cls, key: str, value: float) -> float:
        """A value within the limits of a parameter."""
        limits = cls.parameters()[key]
        return float(min(max(value, limits.low), limits.high))

    @classmethod
    def from_events(cls, starts: Sequence[float], sizes: Sequence[float], duration: Sizes) -> "Effect":
        """The effect with given events: starts [h], sizes [m3/s], of jumps [m], and durations [h].

        `duration` is one number, or one for each start. ConfigError where the effect is not made of events.
        """
        raise ConfigError(f"{cls.name}: expected a method from_events, as found_as = {cls.found_as!r} needs")

    @abstractmethod
    def changes(self, world: World) -> Changes:
        """Return what the effect changes; it may not depend on the outflow where `world.outflow` is None."""


def _label(values: dict[str, Any]) -> str:
    def text(value: Any) -> str:
        return " to ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:g}"

    return ", ".join(f"{name} {text(value)}" for name, value in values.items())


def _two_dates(name: str, value: Sequence[Any]) -> tuple[dt.date, dt.date]:
    try:
        if any(isinstance(v, dt.datetime) for v in value):  # which is a date as well, to Python
            raise TypeError
        first, last = (v if isinstance(v, dt.date) else dt.date.fromisoformat(v) for v in value)
    except (TypeError, ValueError):
        raise ConfigError(f"{name}: dates = {value!r}: expected [first, last] as YYYY-MM-DD") from None
    return first, last
