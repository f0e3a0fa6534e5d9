"""The level that the operators aim at, which may follow the day's flow."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.data import Record
from rivid.diagnosis.noise.model import NoiseModel, day_weights, fit_noise
from rivid.diagnosis.result import Operators
from rivid.errors import RividError
from rivid.types import HOUR, Bools, Floats

HINGES = 20
"""Flows that are tried as the one above which the set point changes with it."""
SURE = 3.0
"""Standard errors from which a set point that follows the flow is believed."""
BESIDE = (0.0, -0.01, 0.01, -0.02, 0.02, -0.03, 0.03)
"""Levels that are tried beside the days' mean [m]."""
FEWEST_DAYS = 6
"""From which a set point that follows the flow can be seen."""


@dataclass(frozen=True)
class SetPoint:
    """The level aimed at: ``level + slope max(flow - hinge, 0)``, flow the day's mean inflow.

    Attributes
    ----------
    level : float
        [m].
    slope : float
        [m per m3/s].
    hinge : float
        [m3/s].
    """

    level: float
    slope: float = 0.0
    hinge: float = 0.0

    def at(self, flow: Floats) -> Floats:
        """The level aimed at on days of a mean inflow [m3/s]; any shape."""
        return np.asarray(self.level + self.slope * np.maximum(flow - self.hinge, 0.0))


def set_points(record: Record) -> list[SetPoint]:
    """Levels that may be aimed at: about the days' means, one level or one that follows the inflow.

    Within a dead-band the mean is not what they aim at: so levels beside it are tried too.
    """
    flow, level = day_flow(record), _day_means(record.output, record)
    known = np.isfinite(level)
    flow, level = flow[known], level[known]
    best, least = None, np.inf
    for hinge in np.linspace(flow.min(), flow.max(), HINGES, endpoint=False).tolist():
        x = np.maximum(flow - hinge, 0.0)
        if len(x) < FEWEST_DAYS or np.ptp(x) == 0.0:  # the same every day
            continue
        X = np.stack([np.ones_like(x), x], axis=1)
        found = np.linalg.lstsq(X, level, rcond=None)[0]
        left = float(((level - X @ found) ** 2).sum())
        error = np.sqrt(left / (len(x) - 2) / ((x - x.mean()) ** 2).sum())
        if abs(found[1]) > SURE * error and left < least:
            best, least = SetPoint(float(found[0]), float(found[1]), hinge), left
    means = [SetPoint(float(np.median(level)))] + ([] if best is None else [best])
    return [replace(aim, level=aim.level + beside) for aim in means for beside in BESIDE]


def day_flow(record: Record) -> Floats:
    """Mean inflow of each day [m3/s], shape (days,)."""
    return np.asarray(record.inflow[:, record.lead :].mean(axis=1))


def _day_means(values: Floats, record: Record) -> Floats:
    """Mean of each day's samples that count, shape (days,); NaN where there are none."""
    kept = record.used & np.isfinite(values)
    number = kept.sum(axis=1)
    total = np.where(kept, values, 0.0).sum(axis=1)
    return np.asarray(np.divide(total, number, out=np.full(len(values), np.nan), where=number > 0))


PROMPT = 0.5
"""Chance of a move at a sample from which the inflow's move is said to ask for it."""

OFTEN = 0.02
"""Share of the samples at the smallest command from which that is a limit."""


def moves(record: Record) -> Bools:
    """Samples at which the outflow command is new and the level known, shape (days, n)."""
    return np.asarray(_new(record) & record.used & np.isfinite(record.output))


def last_move(record: Record) -> NDArray[np.intp]:
    """Sample of the last new command in the row, shape (days, n); 0 before the first."""
    sample = np.arange(record.time.shape[1])
    return np.asarray(np.maximum.accumulate(np.where(_new(record), sample, 0), axis=1))


def looks(record: Record, lag: int) -> tuple[float, float]:
    """Longest time between looks [s], and the move of the inflow that asks for one at once [m3/s].

    Where there is something to answer, the chance of a move at a sample has two values, below and above
    the notice: the notice is where they tell the logs' moves best, infinite where what lies above is no
    prompt answer either. Moves below it are looks that were due: their usual distance is the time.
    """
    sample, last = np.arange(record.time.shape[1]), last_move(record)
    before = np.concatenate([last[:, :1], last[:, :-1]], axis=1)
    seen = late(record.inflow, lag)
    waiting = np.abs(seen - np.take_along_axis(seen, before, axis=1))[record.used]
    acted, age = moves(record)[record.used], (sample - before)[record.used]
    some = waiting > 0.0
    best, notice = -np.inf, np.inf
    for limit in np.unique(np.quantile(waiting[some], np.linspace(0.0, 0.98, 50))) if some.any() else ():
        above, below = some & (waiting > limit), some & (waiting <= limit)
        told = _nats(acted[above]) + _nats(acted[below])
        if told > best and above.any():
            best, notice = told, float(limit) if acted[above].mean() > PROMPT else np.inf
    due = acted & (waiting <= notice)
    return float(np.median(age[due if due.any() else acted])) * record.sample_time, notice


def step_of(values: Floats) -> float:
    """The step that values come in; 0 where they come in none.

    Examples
    --------
    >>> step_of(np.array([130.01, 130.04, 130.02])), step_of(np.array([1.0, 2.5, 1.3])), step_of(np.ones(3))
    (0.01, 0.1, 0.0)
    """
    there = np.unique(np.round(values[np.isfinite(values)], 9))
    if len(there) < 2:
        return 0.0
    smallest = float(np.diff(there).min())
    for digits in range(-3, 5):
        for part in (5.0, 2.0, 1.0):
            step = part * 10.0**-digits
            off = np.abs(there - np.round(there / step) * step)
            if step <= smallest * (1 + 1e-6) and off.max() < 1e-6:
                return round(step, 9)
    return 0.0


def lowest_of(values: Floats) -> float:
    """The smallest command, if it is given so often that it must be a limit; else 0, or none that is less.

    Examples
    --------
    >>> lowest_of(np.array([40.0, 40.0, 57.0, 63.0])), lowest_of(np.linspace(40.0, 90.0, 100))
    (40.0, 0.0)
    """
    smallest = float(values.min())
    return smallest if np.mean(values == smallest) > OFTEN else min(smallest, 0.0)


def late(values: Floats, lag: int) -> Floats:
    """Values some samples before; a row's first holds before it."""
    if lag == 0:
        return values
    return np.concatenate([np.repeat(values[:, :1], lag, axis=1), values[:, :-lag]], axis=1)


def _new(record: Record) -> Bools:
    return np.asarray(np.diff(record.outflow, axis=1, prepend=record.outflow[:, :1]) != 0.0)


def _nats(happened: Bools) -> float:
    """Largest log-likelihood of a chance that is the same for all."""
    n = len(happened)
    p = happened.mean() if n else 0.0
    return float(n * (p * np.log(p) + (1 - p) * np.log1p(-p))) if 0.0 < p < 1.0 else 0.0


BANDS = (0.0, 0.01, 0.02, 0.03, 0.05, 0.08)
"""Dead-bands that are tried [m]."""
FINER = (0.005, 0.0025)
"""Steps of the level and the dead-band about the best of these [m]."""
FEWEST_MOVES = 100
"""Below, there is no law to see."""
ROUNDS = 3
"""Times that noise and law are fitted in turn."""


@dataclass(frozen=True)
class Law:
    """What the operators do.

    Attributes
    ----------
    feedforward : float
        K_Q [-].
    lag : int
        l [samples].
    level_gain : float
        G = -K_h [m2/s]; 0 where no answer to the level is seen.
    trim_time : float
        T_trim [s]; infinite where a lasting deviation is not trimmed away.
    dead_band : float
        [m].
    set_point : SetPoint
    look, notice : float
        Longest time between looks [s]; move of the inflow that asks for one at once [m3/s].
    quantum, lowest : float
        Step and smallest value of the command [m3/s].
    gauge_quantum : float
        Step of the reading [m].
    """

    feedforward: float
    lag: int
    level_gain: float
    trim_time: float
    dead_band: float
    set_point: SetPoint
    look: float
    notice: float
    quantum: float
    lowest: float
    gauge_quantum: float


def identify(record: Record) -> Law | None:
    """The law behind the outflow commands of some days.

    Parameters
    ----------
    record : Record
        Of a pool; days to fit to, nothing else.

    Returns
    -------
    Law or None
        None where the outflow hardly ever moves.
    """
    moved = moves(record)
    if moved.sum() < FEWEST_MOVES:
        return None
    rows = _Rows.of(moved)
    command = rows.pick(record.outflow)
    inflows = np.stack([rows.pick(late(record.inflow, lag)) for lag in range(record.lead + 1)])
    quantum = step_of(record.outflow[record.used])
    noise = _noise(command - inflows[0], quantum, None)
    aims = _Aims.of([(aim, band) for aim in set_points(record) for band in BANDS], record, rows)
    weights = np.ones(record.days)
    for _ in range(ROUNDS):
        fit = _least_squares(command, inflows, aims, noise, weights)
        left = command - fit.value(inflows, aims)
        noise = _noise(left, quantum, noise)
        weights = day_weights(noise.whiten(left))
    for step in FINER:
        aim, band = aims.tried[fit.aim]
        near = [
            (replace(aim, level=aim.level + i * step), max(band + j * step, 0.0))
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
        ]
        aims = _Aims.of(near, record, rows)
        fit = _least_squares(command, inflows, aims, noise, weights)
    feedforward, gain, trim = fit.coefficients.tolist()
    gain, trim = max(gain, 0.0), max(trim, 0.0)
    if trim > 0.0:  # what only ever trims is a gain that acts within the shortest time
        gain = max(gain, trim * record.sample_time)
    aim, band = aims.tried[fit.aim]
    look, notice = looks(record, fit.lag)
    return Law(
        feedforward=feedforward, lag=fit.lag, level_gain=gain,
        trim_time=gain / trim if trim > 0.0 else np.inf, dead_band=band, set_point=aim, look=look,
        notice=notice, quantum=quantum, lowest=lowest_of(record.outflow[record.used]),
        gauge_quantum=step_of(record.output[record.used]),
    )  # fmt: skip


def judged(law: Law, record: Record) -> Operators:
    """The law with what it explains on other days: of the changes of the outflow within an hour.

    Parameters
    ----------
    law : Law
    record : Record
        Days that the law was not fitted to.

    Notes
    -----
    A change is from the move that was in force an hour before to a move: when they look is their own.
    """
    n = max(round(HOUR / record.sample_time), 1)
    last = last_move(record)
    pairs = moves(record)[:, n:] & (last[:, :-n] > 0)
    e = beyond(record, law.set_point, law.dead_band)

    def change(values: Floats) -> Floats:
        held = np.take_along_axis(values, last, axis=1)
        return np.asarray((held[:, n:] - held[:, :-n])[pairs])

    asked = change(record.outflow)
    by_inflow = law.feedforward * change(late(record.inflow, law.lag))
    by_level = law.level_gain * (change(e) + change(_volume(e, record)) / law.trim_time)
    total, left, plain = (
        float(np.mean(x**2)) if x.size else 0.0
        for x in (asked, asked - by_inflow - by_level, asked - by_inflow)
    )
    return Operators(
        feedforward=law.feedforward, lag_s=law.lag * record.sample_time, level_gain=law.level_gain,
        trim_time_s=law.trim_time if np.isfinite(law.trim_time) else None, dead_band=law.dead_band,
        set_point=float(law.set_point.at(np.array(record.usual_flow))), look_s=law.look,
        notice=law.notice if np.isfinite(law.notice) else None,
        quantum=law.quantum, r2=1.0 - left / total if total > 0.0 else 0.0,
        r2_inflow=1.0 - plain / total if total > 0.0 else 0.0, change=float(np.sqrt(total)),
        left=float(np.sqrt(left)),
    )  # fmt: skip


def beyond(record: Record, aim: SetPoint, band: float) -> Floats:
    """Deviation of the level from the set point beyond a dead-band [m], shape (days, n); 0 where unknown."""
    off = record.output - aim.at(day_flow(record))[:, None]
    return np.where(np.isfinite(off), np.copysign(np.maximum(np.abs(off) - band, 0.0), off), 0.0)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Moves of each day, put next to each other: `index` (days, m) into a row, and which are there."""

    index: NDArray[np.intp]
    there: Bools

    @classmethod
    def of(cls, moved: Bools) -> "_Rows":
        order = np.argsort(~moved, axis=1, kind="stable")
        m = int(moved.sum(axis=1).max())
        return cls(order[:, :m], np.arange(m) < moved.sum(axis=1)[:, None])

    def pick(self, values: Floats) -> Floats:
        """Values at the moves, NaN after a day's last; shape (days, m)."""
        return np.where(self.there, np.take_along_axis(values, self.index, axis=1), np.nan)


@dataclass(frozen=True, eq=False)
class _Aims:
    """Set points and dead-bands to try, and what each makes of the level at the moves.

    `levels` and `trims` have the shape (aims, days, m): deviations [m], and their integrals [m s].
    """

    tried: list[tuple[SetPoint, float]]
    levels: Floats
    trims: Floats

    @classmethod
    def of(cls, tried: list[tuple[SetPoint, float]], record: Record, rows: _Rows) -> "_Aims":
        errors = [beyond(record, aim, band) for aim, band in tried]
        return cls(
            tried,
            np.stack([rows.pick(e) for e in errors]),
            np.stack([rows.pick(_volume(e, record)) for e in errors]),
        )


@dataclass(frozen=True, eq=False)
class _Fit:
    lag: int
    aim: int
    coefficients: Floats

    def value(self, inflows: Floats, aims: _Aims) -> Floats:
        """The command at the moves, less its constant."""
        q, g, i = self.coefficients
        return np.asarray(q * inflows[self.lag] + g * aims.levels[self.aim] + i * aims.trims[self.aim])


def _least_squares(command: Floats, inflows: Floats, aims: _Aims, noise: NoiseModel, weights: Floats) -> _Fit:
    """Whitened least squares for each lag and each aim with its band; the pair that leaves least."""
    white = noise.whiten(np.concatenate([command[None], inflows, aims.levels, aims.trims]), like=command)
    white = (white * np.sqrt(weights)[:, None]).reshape(len(white), -1)
    G = white @ white.T
    n, m = len(inflows), len(aims.levels)
    best, least = _Fit(0, 0, np.zeros(3)), np.inf
    for lag in range(n):
        for aim in range(m):
            at = [1 + lag, 1 + n + aim, 1 + n + m + aim]
            S = G[np.ix_(at, at)]
            scale = np.sqrt(np.maximum(np.diag(S), 1e-300))
            found = np.linalg.lstsq(S / np.outer(scale, scale), G[at, 0] / scale, rcond=1e-10)[0] / scale
            left = G[0, 0] - float(found @ G[at, 0])
            left += SURE**2 if aims.tried[aim][0].slope else 0.0
            if left < least:
                best, least = _Fit(lag, aim, found), left
    return best


def _noise(residual: Floats, quantum: float, start: NoiseModel | None) -> NoiseModel:
    """White and walk and slow drift, in moves for time; the area is one, so that a drift is a rate."""
    try:
        return fit_noise(
            residual, 1.0, 1.0, gauge_floor=quantum / np.sqrt(12.0), starts=() if start is None else (start,),
            alone=start is not None,
        )  # fmt: skip
    except RividError:  # nothing is left: the law is exact
        floor = max(quantum, 1e-6)
        return NoiseModel(floor, floor, 0.0, 100.0, 0.0, 100.0, 1.0, 1.0) if start is None else start


def _volume(values: Floats, record: Record) -> Floats:
    """Integral over time from the row's first sample, each value held to the next; shape (days, n)."""
    passed = np.zeros_like(values)
    np.cumsum(values[:, :-1] * np.diff(record.time, axis=1), axis=1, out=passed[:, 1:])
    return passed
