"""Frozen settings of the estimators: the one home of their defaults (section VI of the paper).

This module imports nothing heavy, so that a configuration can be read without numpy.
"""

from dataclasses import dataclass
from typing import Literal, get_args

from rivid.errors import ConfigError

Prior = Literal["rayleigh", "uniform"]
EstimatorName = Literal["ml", "map", "jmap", "jmap-uniform", "jmap-uniform-estimated", "jmap-degenerate"]
ESTIMATORS: tuple[str, ...] = get_args(EstimatorName)
"""Names of the estimators that `rivid run` knows."""


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
        if not 1 <= self.d_min <= self.d_max:
            raise ConfigError(
                f"d_min = {self.d_min} and d_max = {self.d_max}: expected 1 <= d_min <= d_max (samples)"
            )
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


DEFAULT_ALPHA = 10_000.0
"""Fixed regularisation weight [(m3/s)^2] of the MAP (22) and of Table V (section VI, Fig. 14-15)."""

ALPHA_CAP = 1e14
"""Where a degenerate estimate is stopped [(m3/s)^2]: alpha runs away without the inverse-gamma prior."""

MAX_CONDITION = 1e12
"""Condition number of U'U above which a day is unidentifiable.

Days of the paper have 2e4 to 1e5. At 1e16 a solution holds no correct digit; at 1e12 the ML estimate
that Table VI starts from keeps four.
"""
