"""The result of a diagnosis: immutable values, and their JSON format."""

import datetime as dt
import json
import math
from dataclasses import asdict, dataclass
from typing import Any, Literal


@dataclass(frozen=True)
class Operators:
    """Identified law of the outflow command; see :mod:`rivid.diagnosis.operators`.

    Attributes
    ----------
    feedforward : float
        Change of the outflow per change of the inflow [-].
    lag_s : float
        Delay after the inflow command [s].
    level_gain : float
        Outflow per metre of level beyond the dead-band about the set point [m2/s].
    trim_time_s : float or None
        Integral time of a lasting deviation [s]; None without integral action.
    dead_band : float
        Deviation of the level without a response [m].
    set_point : float
        Level set point on a usual day [m].
    look_s : float
        Longest time between two checks by the operators [s].
    notice : float or None
        Change of the inflow that causes an immediate check [m3/s]; None if no change does.
    quantum : float
        Step of the command [m3/s]; 0 if none is found.
    r2 : float
        Share of the hourly changes of the outflow that the law explains on the selecting days [-].
    r2_inflow : float
        The same without the level.
    change, left : float
        Root mean square of those changes, and of their residuals by the law [m3/s].
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
    """Errors of a simulation with and without the operators, over the sealed days.

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
    """One day in closed loop, for a figure; sequences of length n, with NaN at unused samples.

    Attributes
    ----------
    date : datetime.date
    hour : tuple of float
        Hour of the day [h].
    inflow : tuple of float
        Logged inflow [m3/s].
    level, outflow : tuple of tuple of float
        Measured, simulated without, and simulated with the named effects [m], [m3/s].
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
        None if the outflow hardly moves.
    reason : str
        Why there is no simulation; empty if there is one.
    days : int
        Sealed days that were simulated to their end.
    spread_measured : float or None
        Standard deviation of the measured level about each day's mean [m].
    baseline, augmented : LoopErrors or None
        Without and with the named effects; None if the operators cannot be modelled.
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


Verdict = Literal[
    "no_gap", "explained", "partly_explained", "cannot_tell", "unknown", "did_not_hold", "insufficient_data"
]
VERDICTS: dict[str, str] = {
    "no_gap": "Nothing is missing that these data could show.",
    "explained": "What was missing is named and added.",
    "partly_explained": "Part of what was missing is named and added; more is missing.",
    "cannot_tell": "Something is missing; several effects explain it equally well.",
    "unknown": "Something is missing, and it is none of the effects known here.",
    "did_not_hold": "What the fitted days show does not hold on the days kept apart.",
    "insufficient_data": "These data are too few for a verdict.",
}
"""Description of each verdict."""


@dataclass(frozen=True)
class Estimate:
    """A parameter with its 95 % interval."""

    name: str
    value: float
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class Where:
    """When an effect acts; None means always.

    Attributes
    ----------
    hours : (float, float) or None
        Hours of the day.
    dates : (datetime.date, datetime.date) or None
        First and last day.
    regime : str or None
        In words: on which flows, levels or shifts.
    """

    hours: tuple[float, float] | None = None
    dates: tuple[dt.date, dt.date] | None = None
    regime: str | None = None


@dataclass(frozen=True)
class NamedEffect:
    """An effect that was named and added.

    Attributes
    ----------
    name, family : str
    p_value : float
        Of its gain over the explanation without it, by Student's t over blocks.
    tied_with : tuple of str
        Names that the data cannot separate from it.
    runner_up : str or None
        The next most probable name.
    margin : float or None
        Probability of the effect minus that of the runner-up.
    parameters : tuple of Estimate
    where : Where
    breaker : str or None
        The measurement or gate operation that would separate it from the tied names.
    table : dict
        The effect as a table of a scenario.
    events : int
        Number of its events; 0 if it has none.
    probability : float or None
        Probability that it acts in the reach: the sum over all explanations with it as a material effect.
    """

    name: str
    family: str
    p_value: float
    tied_with: tuple[str, ...]
    runner_up: str | None
    margin: float | None
    parameters: tuple[Estimate, ...]
    where: Where
    breaker: str | None
    table: dict[str, Any]
    events: int = 0
    probability: float | None = None


@dataclass(frozen=True)
class Ranked:
    """An explanation of the record and its probability among all that compete.

    Attributes
    ----------
    names : tuple of str
        Its material effects; empty if nothing is missing and for a purely unknown cause.
    unknown : {"flow", "gauge", "dynamics"} or None
        Its unknown cause: an inflow, an error of the gauge, or a response that no equation with physical
        parameters gives.
    response : str
        Its most probable reach response.
    probability : float
        The sum over all explanations is 1. Explanations that differ only in the response or in immaterial
        effects are merged.
    gain : float
        Log predictive density of the open days, each predicted by a fit without its block, above that of
        "nothing missing" [nats]; of the most probable of the merged explanations.
    material : bool
        Whether it removes the least share of the error that counts.
    """

    names: tuple[str, ...]
    unknown: Literal["flow", "gauge", "dynamics"] | None
    response: str
    probability: float
    gain: float
    material: bool


@dataclass(frozen=True)
class Unknown:
    """A remainder that no effect of the catalogue explains.

    Attributes
    ----------
    where : Where
    size_m3s : float
        Root mean square of the unexplained inflow [m3/s].
    drivers : tuple of str
        Its period and the conditions under which it occurs, in words.
    period_s : float or None
        Its period [s], if it has one.
    """

    where: Where
    size_m3s: float
    drivers: tuple[str, ...]
    period_s: float | None = None


@dataclass(frozen=True)
class Step:
    """The gap after an effect was added: RMSE at each horizon, and with its events known if it has events."""

    added: str
    rmse: tuple[float, ...]
    rmse_described: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Regime:
    """The gap while the reach is in one state; see :func:`rivid.diagnosis.answer.regimes`.

    Attributes
    ----------
    name : str
        Canonical, such as ``inflow_low``.
    words : str
        The state in words, with its numbers.
    rmse_baseline, rmse_augmented : tuple of float
        At each horizon, of forecasts that end in this state; NaN if there are none.
    targets : tuple of int
        Number of these forecasts at each horizon.
    """

    name: str
    words: str
    rmse_baseline: tuple[float, ...]
    rmse_augmented: tuple[float, ...]
    targets: tuple[int, ...]


@dataclass(frozen=True)
class Gap:
    """Error of the simulation on the sealed days, which neither fit nor selection used.

    Attributes
    ----------
    heldout_dates : tuple of datetime.date
    horizon_h : tuple of float
        [h].
    unit : {"m", "m3/s"}
    rmse_baseline, rmse_augmented : tuple of float
        Without and with all effects; events of the day itself unknown.
    rmse_floor : tuple of float or None
        Error of the true model, if it is known.
    closed, closed_forecast : float or None
        Share of the gap that is closed: with the events of the day known, and unknown.
    steps : tuple of Step
    by_regime : tuple of Regime
        The gap by the state of the reach, events of the day itself unknown.
    rmse_described : tuple of float or None
        With all effects, events of the day known; None if there are no events.
    rmse_open_baseline, rmse_open_augmented : tuple of float or None
        As `rmse_baseline` and `rmse_augmented`, for the open days: each day by a fit without its block.
    """

    heldout_dates: tuple[dt.date, ...]
    horizon_h: tuple[float, ...]
    unit: str
    rmse_baseline: tuple[float, ...]
    rmse_augmented: tuple[float, ...]
    rmse_floor: tuple[float, ...] | None
    closed: float | None
    closed_forecast: float | None
    steps: tuple[Step, ...]
    by_regime: tuple[Regime, ...] = ()
    rmse_described: tuple[float, ...] | None = None
    rmse_open_baseline: tuple[float, ...] | None = None
    rmse_open_augmented: tuple[float, ...] | None = None

    @property
    def reduced(self) -> tuple[float, ...]:
        """Share of the squared error that is removed at each horizon, events of the day itself unknown.

        Negative if the error grows; NaN if there is no error to remove. It needs no floor.
        """
        pairs = zip(self.rmse_baseline, self.rmse_augmented, strict=True)
        return tuple(1.0 - (after / before) ** 2 if before else math.nan for before, after in pairs)


@dataclass(frozen=True)
class Diagnosis:
    """The answer of a diagnosis.

    Attributes
    ----------
    verdict : str
        One of :data:`VERDICTS`.
    reason : str
        Reason of the verdict, in a sentence with numbers.
    reach_response : str
    reach_parameters : tuple of Estimate
    effects : tuple of NamedEffect
    unknown : Unknown or None
    gap : Gap or None
    noise : dict
        The noise model, SI units.
    notes : tuple of str
        Parameters at limits, days left out, and other remarks.
    closed_loop : ClosedLoop or None
        None for a river reach, which has no operators below.
    ranking : tuple of Ranked
        All explanations, the most probable first.
    small : tuple of str
        Effects that are probable but immaterial: each a sentence with numbers.
    next_measurement : str or None
        Next measurement or gate operation and what it would decide, in a sentence.
    """

    verdict: Verdict
    reason: str
    reach_response: str
    reach_parameters: tuple[Estimate, ...] = ()
    effects: tuple[NamedEffect, ...] = ()
    unknown: Unknown | None = None
    gap: Gap | None = None
    noise: dict[str, float] | None = None
    notes: tuple[str, ...] = ()
    closed_loop: ClosedLoop | None = None
    ranking: tuple[Ranked, ...] = ()
    small: tuple[str, ...] = ()
    next_measurement: str | None = None

    def to_json(self) -> str:
        """Return the text of diagnosis.json; numbers that are not finite become null."""
        document = asdict(self)
        if self.gap is not None:
            document["gap"]["reduced"] = self.gap.reduced
        if document["closed_loop"] is not None:
            del document["closed_loop"]["shown"]
        return json.dumps(_plain(document), indent=1, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, dt.date):
        return value.isoformat()
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return value
    number = float(value)
    if not math.isfinite(number):
        return None
    return int(value) if isinstance(value, int) else number


def closed_share(base: float, augmented: float, floor: float) -> float | None:
    """Return the share of the squared error above the floor that is gone, or None if none was above it.

    Examples
    --------
    >>> closed_share(5.0, 3.0, 3.0), closed_share(3.0, 3.0, 3.0)
    (1.0, None)
    """
    excess = base * base - floor * floor
    return (base * base - augmented * augmented) / excess if excess > 0 else None
