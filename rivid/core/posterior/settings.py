"""Settings of the posterior of the delay: the one home of their defaults."""

from dataclasses import dataclass
from math import ceil, inf

from rivid.errors import ConfigError


@dataclass(frozen=True)
class PosteriorSettings:
    """How the probability of the delay is made.

    The temperatures, errors and `wave_lag` were chosen on simulated worlds (`benchmarks/posterior`)
    and proved on others.

    Parameters
    ----------
    d_min, d_max : int
        The delays that can be answered [samples], ``1 <= d_min <= d_max``.
    order : int
        Length M of the FIR that is given [samples], above `d_max`.
    store_temperature, wave_temperature : float
        By which the log evidence of a front's place is divided within an equation, 1 or more: no equation is
        the truth, and hundreds of samples make the least wrong place look far surer than it is.
    between_temperature : float
        The same between equations.
    sharp : float
        Prior share of fronts that lie at a sampling instant, where the front moves the level at once.
    wave_lead : float
        By how much the place of a wave's front lies before a travel time of whole samples [samples].
    wave_lag : float
        Share of its sharpness that a wave loses with each sample of its travel.
    store_error, wave_error : float
        Scale of the logistic error of a front's place [samples].
    answer_above : float
        Least probability of being right at which a day is answered.
    """

    d_min: int = 1
    d_max: int = 15
    order: int = 30
    store_temperature: float = 1.4
    wave_temperature: float = 2.0
    between_temperature: float = 1.5
    sharp: float = 0.8
    wave_lead: float = 0.18
    wave_lag: float = 0.11
    store_error: float = 0.02
    wave_error: float = 0.038
    answer_above: float = 0.72

    def __post_init__(self) -> None:
        if not 1 <= self.d_min <= self.d_max:
            raise ConfigError(
                f"d_min = {self.d_min} and d_max = {self.d_max}: expected 1 <= d_min <= d_max (samples)"
            )
        if self.order <= self.d_max:
            raise ConfigError(
                f"order = {self.order} ends before the front of d_max = {self.d_max}: raise "
                "order or lower d_max"
            )
        for name in ("store_temperature", "wave_temperature", "between_temperature"):
            if not 1.0 <= getattr(self, name) < inf:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected 1 or more")
        for name in ("store_error", "wave_error"):
            if not 0.0 < getattr(self, name) < inf:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected a positive number [samples]")
        for name in ("sharp", "answer_above"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected a share, 0 to 1")
        for name in ("wave_lead", "wave_lag"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected 0 or more, below 1")


GUARD = 2.0
"""Travel times beyond each edge of the range [samples]: no answers, but a reason not to give one."""


def lags_of(d_max: int) -> int:
    """Longest lag of a response [samples] whose t50 may be d_max: a slow tail has to end within it."""
    return ceil(1.9 * (d_max + GUARD)) + 4


@dataclass(frozen=True)
class RiverSettings:
    """How the probability of a river's travel time is made.

    Temperatures and spread were chosen on simulated rivers and on a measured one, and proved on others (see
    `benchmarks/posterior_river.py`).

    Parameters
    ----------
    d_min, d_max : int
        Travel times t50 that can be answered [samples], ``1 <= d_min < d_max``.
    warm : int
        Samples before each window that are history only; at least :attr:`n_lags`.
    day : int
        Samples in a day, the period of a daily inflow that no log holds.
    gain, gain_sd : float
        Prior of the response's sum [-]: near 1, for the water arrives.
    temperature : float
        By which the log evidence of one day's rows is divided, 1 or more.
    temperature_growth : float
        Power with which that grows as the window has more rows than a day.
    spread, spread_share : float
        Standard error that no window can see [samples, share of t50]: no river is one of the families.
    link_above : float
        Least probability that the output follows the inflow at which a window is answered.
    widest : float
        Widest 90 % band that is an answer [samples]; half of t50 is allowed on top.
    """

    d_min: int = 1
    d_max: int = 40
    warm: int = 96
    day: int = 96
    gain: float = 1.0
    gain_sd: float = 0.35
    temperature: float = 1.5
    temperature_growth: float = 0.57
    spread: float = 0.3
    spread_share: float = 0.01
    link_above: float = 0.95
    widest: float = 4.0

    def __post_init__(self) -> None:
        if not 1 <= self.d_min < self.d_max:
            raise ConfigError(
                f"d_min = {self.d_min} and d_max = {self.d_max}: expected 1 <= d_min < d_max (samples)"
            )
        if self.warm < self.n_lags:
            raise ConfigError(
                f"warm = {self.warm}: d_max = {self.d_max} needs {self.n_lags} samples of history or more"
            )
        if not 1.0 <= self.temperature < inf:
            raise ConfigError(f"temperature = {self.temperature}: expected 1 or more")
        for name in ("temperature_growth", "spread_share", "link_above"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected a share, 0 to 1")
        for name in ("day", "gain", "gain_sd", "spread", "widest"):
            if not 0.0 < getattr(self, name) < inf:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected a positive number")

    @property
    def n_lags(self) -> int:
        """Longest lag of a response [samples]."""
        return lags_of(self.d_max)

    def flattening(self, n_rows: int) -> float:
        """Temperature of a window of so many rows."""
        return max(1.0, self.temperature * float((n_rows / self.day) ** self.temperature_growth))
