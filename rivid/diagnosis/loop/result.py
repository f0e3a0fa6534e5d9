"""What a diagnosis says of the operators and of the reach with them in the loop."""

import datetime as dt
from dataclasses import dataclass


@dataclass(frozen=True)
class Operators:
    """The answer of the outflow command, from the logs; see :mod:`rivid.diagnosis.loop.operator_law`.

    Attributes
    ----------
    feedforward : float
        Outflow for inflow [-].
    lag_s : float
        How long after the inflow command [s].
    level_gain : float
        Outflow for each metre of level above the band about the set point [m2/s].
    trim_time_s : float or None
        Time in which a lasting deviation adds as much again [s]; None where it never does.
    dead_band : float
        Deviation of the level that nobody acts on [m].
    set_point : float
        Level aimed at, on a usual day [m].
    look_s : float
        Longest time between two looks [s].
    notice : float or None
        Move of the inflow that makes them look at once [m3/s]; None where none does.
    quantum : float
        Step of the command [m3/s]; 0 where none is seen.
    r2 : float
        Share of the hourly changes of the outflow that the law explains on the selecting days [-].
    r2_inflow : float
        The same without the level.
    change, left : float
        Root mean square of those changes, and of what the law leaves of them [m3/s].
    """

    feedforward: float
    lag_s: float
    level_gain: float
    trim_time_s: float | None
    dead_band: float
    set_point: float
    look_s: float
    notice: float | None
    quantum: float
    r2: float
    r2_inflow: float
    change: float
    left: float


@dataclass(frozen=True)
class LoopErrors:
    """A simulation beside the measurement, over the days kept apart.

    Attributes
    ----------
    open_level : float
        RMSE of the level with the logged outflow [m].
    level, outflow : float
        RMSE of level [m] and outflow command [m3/s] with the operator model in the loop.
    spread : float
        Standard deviation of the simulated level about each day's mean, in the loop [m].
    """

    open_level: float
    level: float
    outflow: float
    spread: float


@dataclass(frozen=True)
class LoopDay:
    """One day in closed loop, for the picture; all of length n, with NaN where nothing counts.

    Attributes
    ----------
    date : datetime.date
    hour : tuple of float
        [h].
    inflow : tuple of float
        Logged [m3/s].
    level, outflow : tuple of tuple of float
        Measured, simulated without, and with the named effects [m], [m3/s].
    """

    date: dt.date
    hour: tuple[float, ...]
    inflow: tuple[float, ...]
    level: tuple[tuple[float, ...], ...]
    outflow: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ClosedLoop:
    """The reach with its operators, driven by the logged inflow alone.

    Attributes
    ----------
    operators : Operators or None
        None where the logs do not move enough to see any.
    reason : str
        Why there is no loop; empty where there is one.
    days : int
        Days kept apart that were simulated to their end.
    spread_measured : float or None
        Standard deviation of the measured level about each day's mean [m].
    baseline, augmented : LoopErrors or None
        Without and with the named effects; None where the operators cannot be modelled.
    shown : LoopDay or None
        Not part of diagnosis.json.
    """

    operators: Operators | None
    reason: str
    days: int = 0
    spread_measured: float | None = None
    baseline: LoopErrors | None = None
    augmented: LoopErrors | None = None
    shown: LoopDay | None = None
