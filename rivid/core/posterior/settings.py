"""Settings of the posterior of the delay: the one home of their defaults."""

from dataclasses import dataclass
from math import inf

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
