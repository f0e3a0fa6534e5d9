"""Settings of the estimators: defaults (section VI of the paper) and limits, defined here only.

The configuration validates these types with pydantic. This module imports neither pydantic nor numpy, so
that a configuration is read without numpy.
"""

import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from math import ceil, isfinite
from typing import Annotated, Any, Literal, Self, get_args, get_origin

from rivid.errors import ConfigError, nearest

DEFAULT_ALPHA = 10_000.0
"""Fixed regularisation weight [(m3/s)^2] of the MAP (22) and of Table V (section VI, Fig. 14-15)."""

ALPHA_CAP = 1e14
"""Upper limit of alpha [(m3/s)^2]: without the inverse-gamma prior the iteration of Table VI diverges."""

MAX_CONDITION = 1e12
"""Condition number of U'U above which a day is unidentifiable.

Days of the paper have 2e4 to 1e5. At 1e16 a solution holds no correct digit; at 1e12 the ML estimate
that Table VI starts from keeps four.
"""

MAX_ORDER = 1000
"""Longest FIR [samples]: the time of a day grows with the square of the order."""

GUARD = 2
"""Travel times beyond each edge of the delays tried [samples] that are computed as well, so that a day with
a delay outside is recognised."""


@dataclass(frozen=True)
class Limits:
    """Limits of a number, as metadata of its type; infinity and NaN are always refused."""

    ge: float | None = None
    gt: float | None = None
    le: float | None = None
    lt: float | None = None

    def __get_pydantic_core_schema__(
        self, source: Any, handler: Callable[[Any], dict[str, Any]]
    ) -> dict[str, Any]:
        """The schema by which pydantic validates a value of the configuration."""
        schema = handler(source)
        finite = {"allow_inf_nan": False} if schema["type"] == "float" else {}
        return schema | finite | {name: value for name, value in vars(self).items() if value is not None}

    def fault(self, value: float) -> str:
        """What is expected of a value, or "" for a value within the limits."""
        words = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}
        given = {name: limit for name, limit in vars(self).items() if limit is not None}
        if isfinite(value) and all(getattr(operator, name)(value, limit) for name, limit in given.items()):
            return ""
        expected = ["a finite number", *(f"{words[name]} {limit:g}" for name, limit in given.items())]
        return " and ".join(expected)


Order = Annotated[int, Limits(ge=6, le=MAX_ORDER)]
Delay = Annotated[int, Limits(ge=1, le=MAX_ORDER)]
Alpha = Annotated[float, Limits(ge=1e-9, le=ALPHA_CAP)]
DelayScale = Annotated[float, Limits(ge=0.1, le=1e4)]
Tolerance = Annotated[float, Limits(ge=1e-9, lt=1)]
Rounds = Annotated[int, Limits(ge=2, le=10_000)]  # the stop test compares two iterations
Positive = Annotated[float, Limits(gt=0)]
Shape = Annotated[float, Limits(ge=-1)]
Scale = Annotated[float, Limits(ge=0)]
Temperature = Annotated[float, Limits(ge=1, le=1e6)]
Share = Annotated[float, Limits(ge=0, le=1)]
Part = Annotated[float, Limits(ge=0, lt=1)]
Spread = Annotated[float, Limits(gt=0, le=100)]
Prior = Literal["rayleigh", "uniform"]
Jumps = Literal["both", "delay"]
Moment = Literal["onset", "alarm"]


ALIASES = {"M": "order", "sigma_d": "delay_scale"}
"""Symbols of the paper for settings that have a name."""


def named(changes: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """Changes to settings of these names, by name or by the paper's symbol; ConfigError for any other."""
    known, found = list(names), {}
    for key, value in changes.items():
        name = ALIASES.get(key, key)
        if name not in known:
            symbols = [symbol for symbol, of in ALIASES.items() if of in known]
            valid = [*known, *symbols]
            raise ConfigError(f"unknown setting {key}; valid here: {', '.join(valid)}{nearest(key, valid)}")
        if name in found:
            raise ConfigError(f"{name} is given twice, as {name} and by its symbol: expected one of them")
        found[name] = value
    return found


class Checked:
    """Base of dataclasses that check the :class:`Limits` and the names of their fields."""

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """The same with some settings changed; see :func:`named`."""
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]  # all are dataclasses
        return replace(self, **named(changes, names))  # type: ignore[type-var]

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]  # the classes below are dataclasses
            value = getattr(self, field.name)
            if get_origin(field.type) is Literal and value not in get_args(field.type):
                names = ", ".join(get_args(field.type))
                raise ConfigError(f'{field.name} = "{value}": expected one of {names}')
            given = value if isinstance(value, tuple) else () if value is None else (value,)
            for part in (field.type, *get_args(field.type)):
                for limits in getattr(part, "__metadata__", ()):
                    if expected := next(filter(None, map(limits.fault, given)), ""):
                        raise ConfigError(f"{field.name} = {value}: expected {expected}")


class _Delays(Checked):
    """Settings with ``1 <= d_min <= d_max``."""

    d_min: int
    d_max: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_min > self.d_max:
            raise ConfigError(
                f"d_min = {self.d_min} and d_max = {self.d_max}: expected 1 <= d_min <= d_max (samples)"
            )


@dataclass(frozen=True)
class JmapSettings(_Delays):
    """Settings of the joint MAP estimate of the delay and the FIR.

    The model is ``y = U h + w`` (16) with ``w ~ N(0, sigma_w2 I)`` (19), ``D_d h ~ N(0, sigma_hD2 I)``
    (25) and ``d`` Rayleigh (26) or uniform; ``sigma_hD2`` is inverse gamma (32).

    Parameters
    ----------
    order : int
        Length M of the FIR [samples].
    d_min, d_max : int
        The candidates: every delay from `d_min` to `d_max` [samples], ``1 <= d_min <= d_max <= order - 3``.
    prior : {"rayleigh", "uniform"}
        Prior on the delay.
    delay_scale : float
        sigma_d [samples], scale and mode of the Rayleigh prior (26).
    alpha : float or None
        Fixed regularisation weight sigma_w2 / sigma_hD2 [(m3/s)^2] of Table V; None estimates both
        variances (Table VI). A Rayleigh prior needs them estimated.
    inverse_gamma : bool
        The inverse-gamma prior on sigma_hD2 (32). Without it the estimate degenerates (section V).
    alpha_h, beta_h : float or None
        Its parameters; None: the paper's, M / 2 and ||D h_ML||^2 / 2 [(output unit per m3/s)^2] of each day.
    alpha_w, beta_w : float
        The same of sigma_w2, beta_w in squares of the output's unit. The paper's prior is uniform (31): -1
        and 0, which give (38).
    d_init : int
        First guess of the delay [samples] in Table VI.
    tolerance : float
        epsilon of Table VI: stop when both variances change by less, relatively.
    max_iterations : int
        Largest number of iterations of Table VI.
    free_start : bool
        False, as in the paper: the reach was at rest at the first sample, u is zero before it. True: the
        time before the first sample is left open. Only rows of (16) with all M samples of u count, and a
        constant is fitted as well. This costs M - 1 rows, and is right where the delay is not short
        compared with the data set.
    jumps : {"both", "delay"}
        Where the response may jump, our readings of (24): at lags 1 and d + 1, as in Fig. 10, or at d + 1
        alone, as in section I. D_d has no rows there.

    Raises
    ------
    ConfigError
        For values out of range, and settings that contradict each other.
    """

    order: Order = 30
    d_min: Delay = 1
    d_max: Delay = 15
    prior: Prior = "rayleigh"
    delay_scale: DelayScale = 6.5
    alpha: Alpha | None = None
    inverse_gamma: bool = True
    alpha_h: Shape | None = None
    beta_h: Scale | None = None
    alpha_w: Shape = -1.0
    beta_w: Scale = 0.0
    d_init: Delay = 10
    tolerance: Tolerance = 1e-3
    max_iterations: Rounds = 200
    free_start: bool = False
    jumps: Jumps = "both"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_max > self.order - 3:
            raise ConfigError(
                f"d_max = {self.d_max} needs an FIR of order >= {self.d_max + 3}, got order = "
                f"{self.order}: raise order or lower d_max"
            )
        if not self.inverse_gamma and (self.alpha_h, self.beta_h) != (None, None):
            raise ConfigError(
                "alpha_h and beta_h are those of the inverse-gamma prior: drop them, or inverse_gamma = false"
            )
        if self.prior == "rayleigh" and self.alpha is not None:
            raise ConfigError(
                "a fixed alpha goes with the uniform prior (Table V); the Rayleigh prior weighs "
                "against the noise variance, which Table VI estimates: drop alpha, or set "
                'prior = "uniform"'
            )


@dataclass(frozen=True)
class SearchSettings(_Delays):
    """The delays that `direct` and `indirect` try: every one from `d_min` to `d_max` [samples]."""

    d_min: Delay = 1
    d_max: Delay = 15


@dataclass(frozen=True)
class CusumSettings(_Delays):
    """Settings of the CUSUM test.

    The paper names the algorithm and states that it has to be tuned day by day, without a figure. The
    defaults are those of textbooks for a change of one standard deviation, and are not tuned to a season.
    """

    threshold: Annotated[float, Limits(gt=0, le=1e6)] = 5.0
    """g above which there is a change [standard deviations]."""
    drift: Annotated[float, Limits(ge=0, le=1e6)] = 0.5
    """Taken from g at each lag [standard deviations]; half of the smallest change that matters. It also has
    to absorb the slow decay of h that (10) shows before the change."""
    mean_lags: Annotated[int, Limits(ge=0, le=MAX_ORDER)] = 3
    """The mean before the change is that of the first so many coefficients, from lag 1 on (of those there are
    before lag k, if fewer); 0: of all coefficients from lag 1 to k - 1. Lag 0 is never counted: the drop from
    h[0] to h[1] is the feed-forward of the operators, not the arrival of the inflow."""
    mean: Annotated[float, Limits()] | None = None
    """A known mean before the change instead [output unit per m3/s]."""
    sd: Positive | None = None
    """Standard deviation of a coefficient [output unit per m3/s]. None: the day's own, from the median
    absolute deviation of the first differences from lag 1 on, which the one jump does not move."""
    moment: Moment = "onset"
    """What dates the change: the lag after the last zero of g, or the lag of the alarm, which comes late."""
    d_min: Delay = 1  # the delays that can be estimated [samples]; g stays zero until lag d_min
    d_max: Delay = 15


@dataclass(frozen=True)
class PosteriorSettings(_Delays):
    """Settings of the probability of the delay.

    All but the range and `answer_above` have the values of the highest log score of the true travel time on
    333 pools drawn at random (`benchmarks/posterior`, seeds below 1,100), and were tested on others.
    """

    d_min: Delay = 1  # the delays that can be estimated [samples]
    d_max: Delay = 15
    order: Order = 30  # length M of the FIR that is returned [samples], above `d_max`
    store_temperature: Temperature = 1.1
    """Divisor of the log evidence of a front's place within an equation, 1 or more: no equation is exact, and
    hundreds of samples make the least wrong place look far surer than it is."""
    wave_temperature: Temperature = 3.2
    """The same in the equations of waves."""
    between_temperature: Temperature = 2.3
    """The same between equations."""
    sharp: Share = 0.61
    """Prior share of fronts that lie at a sampling instant, where the front moves the level at once."""
    wave_gate: Part = 0.48
    """Longest time that a gate needs from one command to the next [samples]; a shorter one is as likely."""
    wave_lag: Part = 0.022
    """By how much longer a wave takes to pass with each sample of its travel [samples]."""
    wave_store: Share = 0.09
    """Share of waves with the travel time itself as their place, as in a store: behind a stilling well a
    store follows the wave equations."""
    store_error: Spread = 0.043
    """Scale of the logistic error of a front's place in a store [samples]."""
    wave_error: Spread = 0.1
    """The same of a wave's place [samples]."""
    answer_above: Share = 0.68
    """Smallest probability of being right at which a day has a delay."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.order <= self.d_max:
            raise ConfigError(
                f"order = {self.order} ends before the front of d_max = {self.d_max}: raise "
                "order or lower d_max"
            )


def lags_of(d_max: int) -> int:
    """Longest lag of a response [samples] with a t50 of up to d_max: a slow tail has to end within it."""
    return ceil(1.9 * (d_max + GUARD)) + 4


@dataclass(frozen=True)
class RiverSettings(_Delays):
    """Settings of the probability of a river's travel time.

    Temperatures and spread were chosen on simulated rivers and on a measured one, and tested on others (see
    `benchmarks/posterior_river.py`).
    """

    d_min: Delay = 1  # travel times t50 that can be estimated [samples], 1 <= d_min < d_max
    d_max: Delay = 40
    # samples before each window that are history only; at least :attr:`n_lags`
    warm: Annotated[int, Limits(ge=1)] = 96
    # samples in a day, the period of a daily inflow that is not logged
    day: Annotated[int, Limits(ge=1)] = 96
    gain: Positive = 1.0  # prior of the sum of the response [-]: near 1, because volume is kept
    gain_sd: Positive = 0.35
    temperature: Temperature = 1.5  # divisor of the log evidence of one day's rows
    temperature_growth: Share = 0.57  # power with which that grows as the window has more rows than a day
    # standard error that a window cannot show [samples, share of t50]: no river is one of the families
    spread: Positive = 0.3
    spread_share: Share = 0.01
    link_above: Share = 0.95  # smallest probability that the output follows the inflow for a t50
    widest: Positive = 4.0  # widest 90 % band with a t50 [samples]; half of t50 is allowed on top

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_min == self.d_max:
            raise ConfigError(
                f"d_min = {self.d_min} and d_max = {self.d_max}: expected 1 <= d_min < d_max (samples)"
            )
        if self.warm < self.n_lags:
            raise ConfigError(
                f"warm = {self.warm}: d_max = {self.d_max} needs {self.n_lags} samples of history or more"
            )

    @property
    def n_lags(self) -> int:
        """Longest lag of a response [samples]."""
        return lags_of(self.d_max)

    def flattening(self, n_rows: int) -> float:
        """Temperature of a window of so many rows."""
        return max(1.0, self.temperature * float((n_rows / self.day) ** self.temperature_growth))
