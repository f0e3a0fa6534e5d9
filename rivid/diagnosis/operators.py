"""Identification of how the operators command the outflow, from the logs.

They act in steps. After move k the command is, in the integrated form of (9),

    u_Qo(k) = c + K_Q u_Qi(k - l) + G e(k) + (G / T_trim) integral of e dt + n(k),

with e the level's deviation from the set point beyond the dead-band, G = -K_h, and n the remainder: rounding
is white, differences between operators give a slow walk. The level that they see results from their earlier
moves, so that ordinary least squares would attribute n to the level. Whitened by the model of n, the
remainder at a move is independent of everything before it, the level included: least squares are consistent.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.data import Record
from rivid.diagnosis.noise.model import NoiseModel, day_weights, fit_noise
from rivid.diagnosis.response.base import lagged
from rivid.diagnosis.result import Operators
from rivid.errors import RividError
from rivid.reach.transport import held_volume
from rivid.types import HOUR, Bools, Floats

HINGES = 20  # number of flows tried as the one above which the set point depends on the flow
SURE = 3.0  # standard errors of its slope at which a set point that depends on the flow is accepted
OFFSETS = (0.0, -0.01, 0.01, -0.02, 0.02, -0.03, 0.03)  # offsets from the days' mean level that are tried [m]
FEWEST_DAYS = 6  # fewest days for a set point that depends on the flow
PROMPT = 0.5  # probability of a move at a sample above which a change of the inflow is taken as its cause
OFTEN = 0.02  # share of samples at the smallest command above which it is a limit
BANDS = (0.0, 0.01, 0.02, 0.03, 0.05, 0.08)  # dead-bands that are tried [m]
FINER = (0.005, 0.0025)  # steps of the level and the dead-band in the refinement of the best pair [m]
FEWEST_MOVES = 100  # fewest moves from which a law is identified
FARTHEST = 60
"""Longest lag of the outflow behind the inflow that is tried [samples]: twice the travel time of a wave in a
reach of 30 samples."""
ROUNDS = 3  # number of alternating fits of noise and law


@dataclass(frozen=True)
class SetPoint:
    """Level set point ``level + slope max(flow - hinge, 0)``, with flow the day's mean inflow."""

    level: float  # [m]
    slope: float = 0.0  # [m per m3/s]
    hinge: float = 0.0  # [m3/s]

    def at(self, flow: Floats) -> Floats:
        """Return the set point on days of a mean inflow [m3/s]; any shape."""
        return np.asarray(self.level + self.slope * np.maximum(flow - self.hinge, 0.0))


def set_points(record: Record) -> list[SetPoint]:
    """Return possible set points: about the days' mean levels, constant or dependent on the inflow."""
    # Within a dead-band the mean level is not the set point, so offsets from it are tried too.
    known = record.used.any(axis=1)
    read = np.where(record.used, record.output, np.nan)[known]
    flow, level = day_flow(record)[known], np.nanmean(read, axis=1)
    best, least = None, np.inf
    for hinge in np.linspace(flow.min(), flow.max(), HINGES, endpoint=False).tolist():
        x = np.maximum(flow - hinge, 0.0)
        if len(x) < FEWEST_DAYS or np.ptp(x) == 0.0:  # constant, or too few days
            continue
        X = np.stack([np.ones_like(x), x], axis=1)
        found = np.linalg.lstsq(X, level, rcond=None)[0]
        left = float(((level - X @ found) ** 2).sum())
        error = np.sqrt(left / (len(x) - 2) / ((x - x.mean()) ** 2).sum())
        if abs(found[1]) > SURE * error and left < least:
            best, least = SetPoint(float(found[0]), float(found[1]), hinge), left
    means = [SetPoint(float(np.median(level)))] + ([] if best is None else [best])
    return [replace(aim, level=aim.level + offset) for aim in means for offset in OFFSETS]


def day_flow(record: Record) -> Floats:
    """Return the mean inflow of each day [m3/s], shape (days,)."""
    return np.asarray(record.inflow[:, record.lead :].mean(axis=1))


def moves(record: Record) -> Bools:
    """Return samples at which the outflow command is new and the level known, shape (days, n)."""
    return _new(record) & record.used


def last_move(record: Record) -> NDArray[np.intp]:
    """Return the sample of the last new command in the row, shape (days, n); 0 before the first."""
    sample = np.arange(record.time.shape[1])
    return np.asarray(np.maximum.accumulate(np.where(_new(record), sample, 0), axis=1))


def looks(record: Record, lag: int) -> tuple[float, float]:
    """Estimate the time between checks [s], and the change of the inflow that causes one at once [m3/s]."""
    # After a change of the inflow the probability of a move at a sample has two values, below and above the
    # notice. The notice maximises the likelihood of the logged moves; it is infinite if moves above it are
    # not prompt either. Moves below it are checks that were due: their median distance is the time.
    sample, last = np.arange(record.time.shape[1]), last_move(record)
    before = lagged(last, 1)
    seen = lagged(record.inflow, lag)
    waiting = np.abs(seen - np.take_along_axis(seen, before, axis=1))[record.used]
    acted, age = moves(record)[record.used], (sample - before)[record.used]
    some = waiting > 0.0
    best, notice = -np.inf, np.inf
    for limit in np.unique(np.quantile(waiting[some], np.linspace(0.0, 0.98, 50))) if some.any() else ():
        above, below = some & (waiting > limit), some & (waiting <= limit)
        likelihood = _nats(acted[above]) + _nats(acted[below])
        if likelihood > best and above.any():
            best, notice = likelihood, float(limit) if acted[above].mean() > PROMPT else np.inf
    due = acted & (waiting <= notice)
    return float(np.median(age[due if due.any() else acted])) * record.sample_time, notice


def step_of(values: Floats) -> float:
    """Return the step of quantised values, or 0 if there is none.

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


def _new(record: Record) -> Bools:
    return np.asarray(np.diff(record.outflow, axis=1, prepend=record.outflow[:, :1]) != 0.0)


def _nats(moved: Bools) -> float:
    """Return the largest log-likelihood of a common probability."""
    n = len(moved)
    p = moved.mean() if n else 0.0
    return float(n * (p * np.log(p) + (1 - p) * np.log1p(-p))) if 0.0 < p < 1.0 else 0.0


Aim = tuple[SetPoint, float]
"""A set point and a dead-band [m]."""


@dataclass(frozen=True)
class Law:
    """The law of the operators."""

    feedforward: float  # K_Q [-]
    lag: int  # l [samples]
    level_gain: float  # G = -K_h [m2/s]; 0 if no response to the level is found
    trim_time: float  # T_trim [s]; infinite if a lasting deviation is not corrected
    dead_band: float  # [m]
    set_point: SetPoint
    look: float  # longest time between checks [s]; change of the inflow that causes one at once [m3/s]
    notice: float
    quantum: float  # step and smallest value of the command [m3/s]
    lowest: float
    gauge_quantum: float  # step of the reading [m]


def identify(record: Record) -> Law | None:
    """Identify the law of the outflow commands of a pool's days; None if the outflow hardly ever moves."""
    moved = moves(record)
    if moved.sum() < FEWEST_MOVES:
        return None
    order = np.argsort(~moved, axis=1, kind="stable")[:, : int(moved.sum(axis=1).max())]
    there = np.arange(order.shape[1]) < moved.sum(axis=1)[:, None]

    def at_moves(values: Floats) -> Floats:
        """Return values at the moves, NaN after a day's last; shape (days, m)."""
        return np.where(there, np.take_along_axis(values, order, axis=1), np.nan)

    def levels(tried: list[Aim]) -> tuple[Floats, Floats]:
        """Return deviations [m] and their integrals [m s] at the moves, shape (aims, days, m) each."""
        errors = [beyond(record, aim, band) for aim, band in tried]
        return np.stack([at_moves(e) for e in errors]), np.stack(
            [at_moves(held_volume(record.time, e)) for e in errors]
        )

    command = at_moves(record.outflow)
    lags = range(min(record.lead, FARTHEST) + 1)
    inflows = np.stack([at_moves(lagged(record.inflow, lag)) for lag in lags])
    quantum = step_of(record.outflow[record.used])
    noise = _noise(command - inflows[0], quantum, None)
    tried: list[Aim] = [(aim, band) for aim in set_points(record) for band in BANDS]
    level, trimmed = levels(tried)
    weights = np.ones(record.days)
    for _ in range(ROUNDS):
        lag, best, (q, g, i) = _least_squares(command, inflows, level, trimmed, tried, noise, weights)
        left = command - (q * inflows[lag] + g * level[best] + i * trimmed[best])
        noise = _noise(left, quantum, noise)
        weights = day_weights(noise.whiten(left))
    for step in FINER:
        aim, band = tried[best]
        tried = [
            (replace(aim, level=aim.level + i * step), max(band + j * step, 0.0))
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
        ]
        level, trimmed = levels(tried)
        lag, best, found = _least_squares(command, inflows, level, trimmed, tried, noise, weights)
    feedforward, gain, trim = found.tolist()
    gain, trim = max(gain, 0.0), max(trim, 0.0)
    if trim > 0.0:  # integral action alone: gain with the shortest T_trim
        gain = max(gain, trim * record.sample_time)
    aim, band = tried[best]
    look, notice = looks(record, lag)
    logged = record.outflow[record.used]
    lowest = float(logged.min())
    return Law(
        feedforward=feedforward, lag=lag, level_gain=gain,
        trim_time=gain / trim if trim > 0.0 else np.inf, dead_band=band, set_point=aim, look=look,
        notice=notice, quantum=quantum,
        lowest=lowest if np.mean(logged == lowest) > OFTEN else min(lowest, 0.0),
        gauge_quantum=step_of(record.output[record.used]),
    )  # fmt: skip


def validate(law: Law, record: Record) -> Operators:
    """Return the law with the share of the outflow's changes in an hour that it explains on other days."""
    # A change is from the move in force an hour before to a move: times of checks are not predicted.
    n = max(round(HOUR / record.sample_time), 1)
    last = last_move(record)
    pairs = moves(record)[:, n:] & (last[:, :-n] > 0)
    e = beyond(record, law.set_point, law.dead_band)

    def change(values: Floats) -> Floats:
        held = np.take_along_axis(values, last, axis=1)
        return np.asarray((held[:, n:] - held[:, :-n])[pairs])

    seen = change(record.outflow)
    by_inflow = law.feedforward * change(lagged(record.inflow, law.lag))
    by_level = law.level_gain * (change(e) + change(held_volume(record.time, e)) / law.trim_time)
    total, left, plain = (
        float(np.mean(x**2)) if x.size else 0.0 for x in (seen, seen - by_inflow - by_level, seen - by_inflow)
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
    """Return the level's deviation from the set point beyond a dead-band [m], (days, n); 0 if unknown."""
    off = record.output - aim.at(day_flow(record))[:, None]
    return np.where(np.isfinite(off), np.copysign(np.maximum(np.abs(off) - band, 0.0), off), 0.0)


def _least_squares(
    command: Floats, inflows: Floats, levels: Floats, trims: Floats, tried: list[Aim], noise: NoiseModel,
    weights: Floats,
) -> tuple[int, int, Floats]:  # fmt: skip
    """Return lag, aim and coefficients (3,) of the smallest whitened squares over all lags and aims."""
    white = noise.whiten(np.concatenate([command[None], inflows, levels, trims]), like=command)
    white = (white * np.sqrt(weights)[:, None]).reshape(len(white), -1)
    G = white @ white.T
    n, m = len(inflows), len(levels)
    lag, aim = (a.ravel() for a in np.indices((n, m)))
    at = np.stack([1 + lag, 1 + n + aim, 1 + n + m + aim], axis=1)
    S, b = G[at[:, :, None], at[:, None]], G[at, 0]  # (lags times aims, 3, 3) and (..., 3)
    scale = np.sqrt(np.maximum(np.diagonal(S, axis1=1, axis2=2), 1e-300))
    inverse = np.linalg.pinv(S / (scale[:, :, None] * scale[:, None]), rcond=1e-10, hermitian=True)
    found = (inverse @ (b / scale)[:, :, None])[:, :, 0] / scale
    left = G[0, 0] - (found * b).sum(axis=1)
    left += SURE**2 * np.array([one.slope != 0.0 for one, _ in tried])[aim]
    best = int(np.argmin(left))
    return int(lag[best]), int(aim[best]), found[best]


def _noise(residual: Floats, quantum: float, start: NoiseModel | None) -> NoiseModel:
    """Fit white noise, walk and slow drift with moves as time; an area of 1 makes the drift a rate."""
    try:
        return fit_noise(
            residual, 1.0, 1.0, gauge_floor=quantum / np.sqrt(12.0), starts=() if start is None else (start,),
            alone=True,
        )  # fmt: skip
    except RividError:  # the law is exact
        floor = max(quantum, 1e-6)
        return NoiseModel(floor, floor, 0.0, 100.0, 0.0, 100.0, 1.0, 1.0) if start is None else start
