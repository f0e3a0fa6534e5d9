"""Frozen settings of the estimators: the one home of their defaults (section VI of the paper).

This module imports nothing heavy, so that a configuration can be read without numpy.
"""

from dataclasses import dataclass
from math import inf, isfinite
from typing import Literal, get_args

from rivid.errors import ConfigError

Prior = Literal["rayleigh", "uniform"]
Moment = Literal["onset", "alarm"]


@dataclass(frozen=True)
class JmapSettings:
    """How the joint MAP estimate of the delay and the FIR is made.

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
    d_init : int
        First guess of the delay [samples] in Table VI.
    tolerance : float
        epsilon of Table VI: stop when both variances change by less, relatively.
    max_iterations : int
        Give up iterating after so many rounds of Table VI.
    free_start : bool
        False, as in the paper: the reach was at rest at the first sample, u is zero before it. True: what
        came before is left open, only rows of (16) whose M samples of u are all there count, and a
        constant is fitted along. It costs M - 1 rows, and is right where the delay is not short against
        the data set.
    """

    order: int = 30
    d_min: int = 1
    d_max: int = 15
    prior: Prior = "rayleigh"
    delay_scale: float = 6.5
    alpha: float | None = None
    inverse_gamma: bool = True
    d_init: int = 10
    tolerance: float = 1e-3
    max_iterations: int = 200
    free_start: bool = False

    def __post_init__(self) -> None:
        _refuse_order(self.d_min, self.d_max)
        if self.d_max > self.order - 3:
            raise ConfigError(
                f"d_max = {self.d_max} needs an FIR of order >= {self.d_max + 3}, got order = "
                f"{self.order}: raise order or lower d_max"
            )
        if self.prior == "rayleigh" and self.alpha is not None:
            raise ConfigError(
                "a fixed alpha goes with the uniform prior (Table V); the Rayleigh prior weighs "
                "against the noise variance, which Table VI estimates: drop alpha, or set "
                'prior = "uniform"'
            )
        for name in ("delay_scale", "tolerance"):
            value = getattr(self, name)
            if not 0 < value < float("inf"):
                raise ConfigError(f"{name} = {value}: expected a positive number")
        if self.alpha is not None and not 0 < self.alpha < float("inf"):
            raise ConfigError(f"alpha = {self.alpha}: expected a positive number [(m3/s)^2]")
        if self.max_iterations < 2:
            raise ConfigError("max_iterations must be 2 or more: the stop test compares two rounds")


@dataclass(frozen=True)
class SearchSettings:
    """Which delays are tried.

    Parameters
    ----------
    d_min, d_max : int
        Every delay from `d_min` to `d_max` [samples], ``1 <= d_min <= d_max``.

    Raises
    ------
    ConfigError
        For bounds in the wrong order, or below 1: at d = 0 two columns of (14) are the same.
    """

    d_min: int = 1
    d_max: int = 15

    def __post_init__(self) -> None:
        _refuse_order(self.d_min, self.d_max)


@dataclass(frozen=True)
class CusumSettings:
    """What counts as a change.

    The paper names the algorithm and says that it has to be tuned day by day, without a figure. The defaults
    are the textbook's for a change of one standard deviation, and are not tuned to any season.

    Parameters
    ----------
    threshold : float
        g above which there is a change [standard deviations].
    drift : float
        Taken from g at each lag [standard deviations]; half of the smallest change that matters. It also has
        to swallow the slow decay of h that (10) shows before the change.
    mean_lags : int
        The mean before the change is that of the first so many coefficients, from lag 1 on (of those there
        are before lag k, if fewer); 0: of all coefficients from lag 1 to k - 1. Lag 0 is never counted: the
        drop from h[0] to h[1] is the people's feed-forward, not the inflow's arrival.
    mean : float or None
        A known mean before the change instead [output unit per m3/s].
    sd : float or None
        Standard deviation of a coefficient [output unit per m3/s]. None: the day's own, from the median
        absolute deviation of the first differences from lag 1 on, which the one jump does not move.
    moment : {"onset", "alarm"}
        What dates the change: the lag after the last zero of g, or the lag of the alarm, which comes late.
    d_min, d_max : int
        The delays that can be answered [samples], ``1 <= d_min <= d_max``. g stays zero until lag d_min.

    Raises
    ------
    ConfigError
        For values out of range.
    """

    threshold: float = 5.0
    drift: float = 0.5
    mean_lags: int = 3
    mean: float | None = None
    sd: float | None = None
    moment: Moment = "onset"
    d_min: int = 1
    d_max: int = 15

    def __post_init__(self) -> None:
        _refuse_order(self.d_min, self.d_max)
        for name, low_fits in (("threshold", False), ("drift", True), ("sd", False)):
            value = getattr(self, name)
            if value is not None and not (0 < value < inf or (low_fits and value == 0)):
                expected = "zero or a positive number" if low_fits else "a positive number"
                raise ConfigError(f"{name} = {value}: expected {expected}")
        if self.mean is not None and not isfinite(self.mean):
            raise ConfigError(f"mean = {self.mean}: expected a number, or none to take it from the FIR")
        if self.mean_lags < 0:
            raise ConfigError(f"mean_lags = {self.mean_lags}: expected 0 (all lags before) or more")
        if self.moment not in get_args(Moment):
            raise ConfigError(f'moment = "{self.moment}": expected one of {", ".join(get_args(Moment))}')


def _refuse_order(d_min: int, d_max: int) -> None:
    if not 1 <= d_min <= d_max:
        raise ConfigError(f"d_min = {d_min} and d_max = {d_max}: expected 1 <= d_min <= d_max (samples)")


DEFAULT_ALPHA = 10_000.0
"""Fixed regularisation weight [(m3/s)^2] of the MAP (22) and of Table V (section VI, Fig. 14-15)."""

ALPHA_CAP = 1e14
"""Where a degenerate estimate is stopped [(m3/s)^2]: alpha runs away without the inverse-gamma prior."""

MAX_CONDITION = 1e12
"""Condition number of U'U above which a day is unidentifiable.

Days of the paper have 2e4 to 1e5. At 1e16 a solution holds no correct digit; at 1e12 the ML estimate
that Table VI starts from keeps four.
"""
