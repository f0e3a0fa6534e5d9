"""Settings of the posterior of a season: the one home of their defaults."""

from dataclasses import dataclass
from math import inf

from rivid.errors import ConfigError


@dataclass(frozen=True)
class SeasonSettings:
    """How the days of a season help each other.

    Chosen on simulated seasons whose delay drifts, steps or has nothing to do with the day before, and
    proved on others (`benchmarks/peers/seasons.py`).

    Parameters
    ----------
    drifts : tuple of float
        Standard deviations of the travel time's drift from day to day [samples], each as likely.
    exponents : tuple of float
        Powers by which the travel time falls as the discharge grows, each as likely; without a discharge
        there is none.
    jump : float
        Chance that the travel time of a day is anywhere, whatever it was the day before.
    trust : float
        Probability that a day's probability may be believed.
    independent : float
        Probability, beforehand, that the days of the season have nothing to do with each other.
    answer_above : float
        Least probability at which a day is answered.
    """

    drifts: tuple[float, ...] = (0.03, 0.1, 0.3)
    exponents: tuple[float, ...] = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4)
    jump: float = 0.03
    trust: float = 0.98
    independent: float = 0.3
    answer_above: float = 0.72

    def __post_init__(self) -> None:
        if not self.drifts or not all(0.0 <= drift < inf for drift in self.drifts):
            raise ConfigError(f"drifts = {self.drifts}: expected one or more, each 0 or above [samples]")
        if not self.exponents or not all(-2.0 <= b <= 2.0 for b in self.exponents):
            raise ConfigError(f"exponents = {self.exponents}: expected one or more, each from -2 to 2")
        if not 0.0 < self.trust < 1.0:
            raise ConfigError(f"trust = {self.trust}: expected a share above 0, below 1")
        for name in ("jump", "independent", "answer_above"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected a share, 0 to 1")
