"""How the output answers the flows: lags and gains of each day, by least squares over all pairs of lags.

Pool: over an hour, ``h(t + H) - h(t) = c_i V_i(t - l_i) + c_o V_o(t - l_o)``, V the volume of an hour. Where
nothing is wrong c_i and -c_o are 1 / area, l_i is the delay, l_o next to nothing: the gauge is at the gate.
River: ``Q_L(t + H) - Q_L(t) = c_i (Q_i(t + H - l_i) - Q_i(t - l_i))``. All less their means over the day.
"""

import datetime as dt
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rivid.check.record import Record
from rivid.core.hydraulics import propose_delays
from rivid.errors import ConfigError
from rivid.types import HOUR, ONE_DAY, Floats

AROUND = 1.75 * HOUR
"""How far beyond what is expected a lag is looked for [s]: an hour off must lie well inside."""
LONGEST = 24 * HOUR
LEAST = 24
"""Samples of a day below which nothing is fitted."""
SINGULAR = 1e-6
LEAP = 10.0


class Fit(NamedTuple):
    """The best pair of lags.

    Attributes
    ----------
    explained : float
        Share of the output's moves that it explains.
    lag_in, lag_out : float
        From the move of the flow to that of the output [s].
    gain_in, gain_out : float
        [1/m2]; of a river [1], and 0.
    """

    explained: float
    lag_in: float
    lag_out: float
    gain_in: float
    gain_out: float


NOTHING = Fit(0.0, np.nan, np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class Sums:
    """Sums of products over the samples of a day, or of several, for every lag and pair of lags."""

    output: float
    with_in: Floats
    with_out: Floats
    of_in: Floats
    of_out: Floats
    between: Floats

    def __add__(self, other: "Sums") -> "Sums":
        return Sums(*(getattr(self, name) + getattr(other, name) for name in self.__dataclass_fields__))


class Lags:
    """Which lags are tried, for the reach of a record.

    Parameters
    ----------
    record : Record

    Attributes
    ----------
    longest : float
        The longest delay that the hydraulics of [reach] give [s].
    """

    def __init__(self, record: Record) -> None:
        reach, step = record.reach, record.step
        try:
            proposed = propose_delays(
                reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth,
                sample_time=step, kind=reach.kind,
            )  # fmt: skip
            self.longest = min((proposed.d_max + 1) * step, LONGEST)
        except ConfigError:
            self.longest = HOUR
        self.record, self.step = record, step
        around = round(AROUND / step)
        self.horizon = max(round(HOUR / step), 2)
        # of a river both ends may be taken for each other
        least = around if reach.kind == "pool" else max(around, round(self.longest / step))
        self.inflow = np.arange(-least, round(max(self.longest, HOUR) / step) + around + 1)
        self.outflow = np.arange(-around, around + 1) if record.balanced else np.zeros(1, int)

    def sums(self, date: dt.date, days_in: int = 0, days_out: int = 0) -> Sums | None:
        """The sums of a day, its flows taken from so many days later; None where it is short or still."""
        record, h = self.record, self.horizon
        level = record.days[date][record.output]
        n = len(level) - h
        if n < LEAST:
            return None
        inflow = self._moves(date + days_in * ONE_DAY, "u_Qi", n)
        outflow = self._moves(date + days_out * ONE_DAY, "u_Qo", n) if record.balanced else None
        if inflow is None or (record.balanced and outflow is None):
            return None
        x1, first, last = inflow
        x2 = np.zeros((1, n))
        if outflow is not None:
            x2, first, last = outflow[0], max(first, outflow[1]), min(last, outflow[2])
        if last - first < max(n // 3, LEAST):
            return None
        y = _cut((level[h:] - level[:-h])[first:last])
        y = y - y.mean()
        x1, x2 = (x[:, first:last] - x[:, first:last].mean(axis=1, keepdims=True) for x in (x1, x2))
        return Sums(float(y @ y), x1 @ y, x2 @ y, (x1**2).sum(1), (x2**2).sum(1), x1 @ x2.T)

    def _moves(self, date: dt.date, name: str, n: int) -> tuple[Floats, int, int] | None:
        """What a flow did over H at every lag, (lags, n), and from and to which sample that is known."""
        days, h = self.record.days, self.horizon
        if date not in days or len(days[date]) != n + h:
            return None
        lags = self.inflow if name == "u_Qi" else self.outflow
        before, after = max(int(lags[-1]), 0), max(-int(lags[0]), 0)
        parts, left, right = [days[date][name]], 0, 0
        if date - ONE_DAY in days:
            parts.insert(0, days[date - ONE_DAY][name][-before:] if before else parts[0][:0])
            left = len(parts[0])
        if date + ONE_DAY in days:
            parts.append(days[date + ONE_DAY][name][:after])
            right = len(parts[-1])
        flow = np.concatenate([np.zeros(before - left), *parts, np.zeros(after - right)])
        if self.record.reach.kind == "pool":
            volume = np.concatenate([[0.0], np.cumsum(flow) * self.step])
            moves = volume[h:] - volume[:-h]
            moves = moves[: before + n + after]
        else:
            moves = (flow[h:] - flow[:-h])[: before + n + after]
        windows: NDArray[np.float64] = sliding_window_view(moves, n)
        first = max(int(lags[-1]) - left, 0)
        last = min(n, n + right + int(lags[0]))
        return windows[before - lags], first, last

    def best(
        self, sums: Sums, sign: int = 1, near: tuple[float, float] | None = None, within: float = 0.0
    ) -> Fit:
        """The pair of lags that explains most, with c_i > 0 > c_o (or, for `sign` -1, the reverse).

        Parameters
        ----------
        sums : Sums
        sign : {1, -1}
        near : (float, float), optional
            Lags [s] around which it must lie, `within` that many seconds.
        """
        if sums.output <= 0:
            return NOTHING
        det = sums.of_in[:, None] * sums.of_out - sums.between**2
        if self.record.balanced:
            sound = det > SINGULAR * sums.of_in[:, None] * sums.of_out
            safe = np.where(sound, det, np.inf)
            c_in = (sums.with_in[:, None] * sums.of_out - sums.with_out * sums.between) / safe
            c_out = (sums.with_out * sums.of_in[:, None] - sums.with_in[:, None] * sums.between) / safe
            sound &= (sign * c_in > 0) & (sign * c_out < 0)
        else:
            sound = sums.of_in[:, None] > 0
            c_in = sums.with_in[:, None] / np.where(sound, sums.of_in[:, None], np.inf)
            c_out = np.zeros_like(c_in)
            sound &= sign * c_in > 0
        explained = (c_in * sums.with_in[:, None] + c_out * sums.with_out) / sums.output
        if near is not None:
            off = np.abs(self.inflow * self.step - near[0])[:, None] <= within
            sound &= off & (np.abs(self.outflow * self.step - near[1]) <= within)
        if not sound.any():
            return NOTHING
        explained = np.where(sound, explained, -1.0)
        i, o = np.unravel_index(int(explained.argmax()), explained.shape)
        return Fit(
            float(explained[i, o]),
            float(self.inflow[i] * self.step),
            float(self.outflow[o] * self.step),
            float(c_in[i, o]),
            float(c_out[i, o]),
        )


def _cut(moves: Floats) -> Floats:
    """Moves without the leaps that a gauge makes: cut at so many times what is usual."""
    middle = np.median(moves)
    usual = float(np.median(np.abs(moves - middle)))
    return np.clip(moves, middle - LEAP * usual, middle + LEAP * usual) if usual > 0 else moves
