"""The result of a diagnosis: immutable values, and their JSON format."""

import datetime as dt
import json
import math
from dataclasses import asdict, dataclass
from typing import Any, Literal


@dataclass(frozen=True)
class Operators:
    """Identified law of the outflow command; see :mod:`rivid.diagnosis.operators`."""

    feedforward: float  #: change of the outflow per change of the inflow [-]
    lag_s: float  #: delay after the inflow command [s]
    level_gain: float  #: outflow per metre of level beyond the dead-band about the set point [m2/s]
    trim_time_s: float | None  #: integral time of a lasting deviation [s]; None without integral action
    dead_band: float  #: deviation of the level without a response [m]
    set_point: float  #: level set point on a usual day [m]
    look_s: float  #: longest time between two checks by the operators [s]
    notice: float | None  #: change of the inflow that causes an immediate check [m3/s]; None if none does
    quantum: float  #: step of the command [m3/s]; 0 if none is found
    r2: float  #: share of the outflow's hourly changes that the law explains on the selecting days [-]
    r2_inflow: float  #: the same without the level
    change: float  #: root mean square of those changes [m3/s]
    left: float  #: root mean square of their residuals by the law [m3/s]


@dataclass(frozen=True)
class LoopErrors:
    """Errors of a simulation with and without the operators, over the sealed days."""

    open_level: float  #: RMSE of the level with the logged outflow [m]
    level: float  #: RMSE of the level with the operator model in the loop [m]
    outflow: float  #: RMSE of the outflow command with the operator model in the loop [m3/s]
    spread: float  #: standard deviation of the simulated level about each day's mean, in the loop [m]


@dataclass(frozen=True)
class LoopDay:
    """One day in closed loop, for a figure; sequences of length n, with NaN at unused samples."""

    date: dt.date  #: the day
    hour: tuple[float, ...]  #: hour of the day [h]
    inflow: tuple[float, ...]  #: logged inflow [m3/s]
    #: measured, simulated without, and simulated with the named effects [m], [m3/s]
    level: tuple[tuple[float, ...], ...]
    outflow: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ClosedLoop:
    """The reach with its operators, driven by the logged inflow alone."""

    operators: Operators | None  #: None if the outflow hardly moves
    reason: str  #: why there is no simulation; empty if there is one
    days: int = 0  #: sealed days that were simulated to their end
    #: standard deviation of the measured level about each day's mean [m]
    spread_measured: float | None = None
    baseline: LoopErrors | None = None  #: without the named effects; None if the operators cannot be modelled
    augmented: LoopErrors | None = None  #: with the named effects
    shown: LoopDay | None = None  #: not part of diagnosis.json


Verdict = Literal[
    "no_gap", "explained", "partly_explained", "cannot_tell", "unknown", "did_not_hold", "insufficient_data"
]
VERDICTS: dict[str, str] = {
    "no_gap": "Nothing is missing that these data could show.",
    "explained": "What was missing is named and added.",
    "partly_explained": "Part of what was missing is named and added; more is missing.",
    "cannot_tell": "Something is missing; several effects explain it equally well.",
    "unknown": "Something is missing, and no effect of the catalogue is probable enough to be named.",
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
    """When an effect acts; None means always."""

    hours: tuple[float, float] | None = None  #: hours of the day
    dates: tuple[dt.date, dt.date] | None = None  #: first and last day
    regime: str | None = None  #: in words: on which flows, levels or shifts


@dataclass(frozen=True)
class NamedEffect:
    """An effect that was named and added."""

    name: str  #: canonical name of the effect
    family: str  #: flow, timing or level
    p_value: float  #: of its gain over the explanation without it, by Student's t over blocks
    tied_with: tuple[str, ...]  #: names that the data cannot separate from it
    runner_up: str | None  #: the next most probable name
    margin: float | None  #: probability of the effect minus that of the runner-up
    parameters: tuple[Estimate, ...]  #: its parameters
    where: Where  #: when it acts
    breaker: str | None  #: the measurement or gate operation that would separate it from the tied names
    table: dict[str, Any]  #: the effect as a table of a scenario
    events: int = 0  #: number of its events; 0 if it has none
    #: probability that it acts in the reach: the sum over all explanations with it as a material effect
    probability: float | None = None


@dataclass(frozen=True)
class Ranked:
    """An explanation of the record and its probability among all that compete."""

    #: its material effects; empty if nothing is missing and for a purely unknown cause
    names: tuple[str, ...]
    #: its unknown cause: an inflow, an error of the gauge, or a response that no equation with physical
    #: parameters gives
    unknown: Literal["flow", "gauge", "dynamics"] | None
    response: str  #: its most probable reach response
    #: The sum over all explanations is 1. Explanations that differ only in the response or in immaterial
    #: effects are merged.
    probability: float
    #: log predictive density of the open days, each predicted by a fit without its block, above that of
    #: "nothing missing" [nats]; of the most probable of the merged explanations
    gain: float
    material: bool  #: whether it removes the least share of the error that counts


@dataclass(frozen=True)
class Unknown:
    """A remainder that no effect of the catalogue explains."""

    where: Where  #: when it acts
    size_m3s: float  #: root mean square of the unexplained inflow [m3/s]
    drivers: tuple[str, ...]  #: its period and the conditions under which it occurs, in words
    period_s: float | None = None  #: its period [s], if it has one


@dataclass(frozen=True)
class Step:
    """The gap after an effect was added: RMSE at each horizon, and with its events known if it has events."""

    added: str
    rmse: tuple[float, ...]
    rmse_described: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Regime:
    """The gap while the reach is in one state; see :func:`rivid.diagnosis.answer.regimes`."""

    name: str  #: canonical, such as ``inflow_low``
    words: str  #: the state in words, with its numbers
    #: at each horizon, of forecasts that end in this state; NaN if there are none
    rmse_baseline: tuple[float, ...]
    rmse_augmented: tuple[float, ...]  #: the same with all effects
    targets: tuple[int, ...]  #: number of these forecasts at each horizon


@dataclass(frozen=True)
class Gap:
    """Error of the simulation on the sealed days, which neither fit nor selection used."""

    heldout_dates: tuple[dt.date, ...]  #: the sealed days
    horizon_h: tuple[float, ...]  #: time ahead [h]
    unit: str  #: m, or m3/s for a river reach
    rmse_baseline: tuple[float, ...]  #: without effects; events of the day itself unknown
    rmse_augmented: tuple[float, ...]  #: with all effects; events of the day itself unknown
    rmse_floor: tuple[float, ...] | None  #: error of the true model, if it is known
    closed: float | None  #: share of the gap that is closed, with the events of the day known
    closed_forecast: float | None  #: the same with the events of the day unknown
    steps: tuple[Step, ...]  #: the gap after each effect
    #: the gap by the state of the reach, events of the day itself unknown
    by_regime: tuple[Regime, ...] = ()
    #: with all effects, events of the day known; None if there are no events
    rmse_described: tuple[float, ...] | None = None
    #: as `rmse_baseline`, for the open days: each day by a fit without its block
    rmse_open_baseline: tuple[float, ...] | None = None
    rmse_open_augmented: tuple[float, ...] | None = None  #: as `rmse_augmented`, for the open days

    @property
    def reduced(self) -> tuple[float, ...]:
        """Share of the squared error that is removed at each horizon, events of the day itself unknown.

        Negative if the error grows; NaN if there is no error to remove. It needs no floor.
        """
        pairs = zip(self.rmse_baseline, self.rmse_augmented, strict=True)
        return tuple(1.0 - (after / before) ** 2 if before else math.nan for before, after in pairs)


@dataclass(frozen=True)
class Diagnosis:
    """The answer of a diagnosis."""

    verdict: Verdict  #: one of :data:`VERDICTS`
    reason: str  #: reason of the verdict, in a sentence with numbers
    reach_response: str  #: the response of the last explanation
    reach_parameters: tuple[Estimate, ...] = ()  #: its calibrated parameters
    effects: tuple[NamedEffect, ...] = ()  #: what was named and added
    unknown: Unknown | None = None  #: what remains
    gap: Gap | None = None  #: the error without and with the effects
    noise: dict[str, float] | None = None  #: the noise model, SI units
    notes: tuple[str, ...] = ()  #: parameters at limits, days left out, and other remarks
    closed_loop: ClosedLoop | None = None  #: None for a river reach, which has no operators below
    ranking: tuple[Ranked, ...] = ()  #: all explanations, the most probable first
    small: tuple[str, ...] = ()  #: effects that are probable but immaterial: each a sentence with numbers
    #: next measurement or gate operation and what it would decide, in a sentence
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
