"""Settings of the law of delay and discharge: the one home of their defaults."""

from dataclasses import dataclass
from math import inf

from rivid.errors import ConfigError


@dataclass(frozen=True)
class LawSettings:
    """How the law is found.

    Parameters
    ----------
    discharge_error : float
        Relative standard error of a day's discharge [-]; without it a law is too flat.
    tails : float
        Degrees of freedom of Student's t, above 2: the fewer, the less a far day pulls.
    block : int
        Calendar days that are left out together, at least; more where the days' distances from the law stay
        alike for longer than a quarter of that, as long as `least_blocks` remain.
    least_blocks : int
        Fewer blocks give no law, 4 or more.
    least_range : float
        Least range of ln Q [-].
    least_sd : float
        Smallest standard deviation of ln T that a day is believed to have [-].
    level : float
        What the intervals hold.
    classes : int
        Rows of the table.
    """

    discharge_error: float = 0.0
    tails: float = 4.0
    block: int = 14
    least_blocks: int = 6
    least_range: float = 0.1
    least_sd: float = 1e-4
    level: float = 0.9
    classes: int = 5

    def __post_init__(self) -> None:
        if not 0.0 <= self.discharge_error < 1.0:
            raise ConfigError(f"discharge_error = {self.discharge_error}: expected 0 or more, below 1")
        if not 2.0 < self.tails < inf:
            raise ConfigError(f"tails = {self.tails}: expected more than 2")
        if self.least_blocks < 4:
            raise ConfigError(f"least_blocks = {self.least_blocks}: expected 4 or more")
        for name in ("block", "classes"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected 1 or more")
        for name in ("least_range", "least_sd"):
            if not 0.0 < getattr(self, name) < inf:
                raise ConfigError(f"{name} = {getattr(self, name)}: expected a positive number")
        if not 0.0 < self.level < 1.0:
            raise ConfigError(f"level = {self.level}: expected a share above 0, below 1")
