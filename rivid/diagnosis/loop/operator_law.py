"""How the operators command the outflow, identified from the logs.

They act in steps. After a move k of theirs the command is, in the integrated form of (9),

    u_Qo(k) = c + K_Q u_Qi(k - l) + G e(k) + (G / T_trim) integral of e dt + n(k),

with e the level's deviation from the set point beyond the dead-band, G = -K_h, and n what they do besides:
rounding is white, a person with gains of his own makes a slow walk. They see the level that their moves
before have made, so ordinary least squares would blame the level for n. Whitened by the model of n, what is
left at a move is not known before it, and the level at that move is: least squares are then consistent.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rivid.diagnosis.data import Record
from rivid.diagnosis.loop.operator_moves import last_move, late, looks, lowest_of, moves, step_of
from rivid.diagnosis.loop.result import Operators
from rivid.diagnosis.loop.set_point import SURE, SetPoint, day_flow, set_points
from rivid.diagnosis.noise import NoiseModel, day_weights, fit_noise
from rivid.errors import RividError
from rivid.types import HOUR, Bools, Floats

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
