"""Operators of the downstream dam: (9) with shifts, dead-band, intermittent looks and a slow trim.

They act in steps; one step is :func:`rivid.reach.gate.operate`.
"""

from dataclasses import dataclass

import numpy as np

from rivid.errors import ConfigError
from rivid.reach.gate import OperatorArrays
from rivid.types import Floats, Ints


@dataclass(frozen=True)
class OperatorSettings:
    """How the outflow is commanded."""

    feedforward: float = 1.0
    """K_Q of (9), mean over operators [-]."""
    feedforward_spread: float = 0.08
    """Its standard deviation between operators [-]."""
    level_gain: float = -300.0
    """K_h of (9) [m2/s], negative: the outflow grows by ``-K_h`` for each metre of level."""
    level_gain_spread: float = 0.25
    """Its relative spread between operators [-]."""
    dead_band: float = 0.02
    """Level error that is not acted on [m]."""
    set_point_spread: float = 0.02
    """Standard deviation between operators of the level aimed at [m]."""
    trim_time: float = 10_800.0
    """Time in which the trim repeats the feedback of a lasting error [s]."""
    look: tuple[float, float] = (600.0, 1800.0)
    """Shortest and longest time between two looks [s]."""
    notice: float = 4.0
    """A look is taken at once when the inflow has moved by more than this [m3/s]."""
    quantum: float = 1.0
    """Step of the outflow command [m3/s]."""
    lowest: float = 0.0
    """Smallest outflow command [m3/s]."""
    shift_start: float = 5.0
    """Hour of the first change of shift of the day; a shift has 8 hours."""
    people: int = 9
    """Number of operators who share the shifts."""


Crew = tuple[Floats, Floats, Floats]
"""K_Q [-], K_h [m2/s] and offset of the level aimed at [m] of each operator; arrays of shape (operators,)."""

SHIFT = 8 * 3600.0
"""Length of a shift [s] (section I)."""


def draw_crew(settings: OperatorSettings, drop: float, rng: np.random.Generator) -> Crew:
    """Draw the gains of each operator, limited to the correction of the whole error at one look.

    `drop` is how far the level at the dam falls until the longest look where 1 m3/s more is let out [m per
    m3/s]: ``look / A`` in a still pool, more where a wave must first call the water from upstream. The
    feedback takes away ``-K_h drop`` of an error from look to look: below 1 the level comes back without
    swinging, at 2 the loop of a pool is unstable. ConfigError where the mean gain makes the loop oscillate.
    """
    gain = -settings.level_gain * drop
    if gain > 1.0:
        raise ConfigError(
            f"operators.level_gain = {settings.level_gain:g} m2/s with a look every {settings.look[1]:g} s "
            f"corrects {gain:.2g} of a level error at once and makes the level swing: expected above "
            f"-{1.0 / drop:.0f} m2/s, or looks more often"
        )
    n = settings.people
    spread = np.exp(settings.level_gain_spread * rng.standard_normal(n))
    feedforward = settings.feedforward + settings.feedforward_spread * rng.standard_normal(n)
    level_gain = np.maximum(settings.level_gain * spread, -1.0 / drop)
    return feedforward, level_gain, settings.set_point_spread * rng.standard_normal(n)


def roster(time: Floats, settings: OperatorSettings, rng: np.random.Generator) -> Ints:
    """Operator on duty at each time since a midnight [s], an index into the crew that changes every shift."""
    shift = np.floor((time - settings.shift_start * 3600.0) / SHIFT).astype(np.intp)
    shift -= shift[0]
    steps = rng.integers(1, max(settings.people, 2), shift[-1] + 1)
    return np.asarray((np.cumsum(steps) % settings.people)[shift], np.intp)


def quantise(values: Floats, quantum: float) -> Floats:
    """Values in whole quanta; unchanged where the quantum is zero.

    The product is rounded again, so that 13602 quanta of 0.01 are written 136.02.
    """
    return values if quantum == 0 else np.round(np.round(values / quantum) * quantum, 9)


def operator_arrays(
    inflow: Floats, disturbance: Floats, set_point: Floats, settings: OperatorSettings, crew: Crew,
    duty: Ints, *, gauge_quantum: float, rng: np.random.Generator,
) -> OperatorArrays:  # fmt: skip
    """Operators of a season, for :func:`rivid.reach.integrator.pool_level` or the Saint-Venant reach.

    All series have shape (n,): announced inflow command u_Qi [m3/s], reading of the gauge minus level and
    level aimed at [m], and the operator on duty (:func:`roster`). `gauge_quantum` is the step of the reading
    [m], 0 for none; `rng` draws the times between looks.
    """
    feedforward, level_gain, offset = (gain[duty] for gain in crew)
    s = settings
    return OperatorArrays(
        inflow=inflow, disturbance=disturbance, aim=set_point + offset, feedforward=feedforward,
        level_gain=level_gain, wait=rng.uniform(*s.look, len(inflow)), dead_band=s.dead_band,
        trim_time=s.trim_time, notice=s.notice, quantum=s.quantum, lowest=s.lowest,
        gauge_quantum=gauge_quantum,
    )  # fmt: skip
