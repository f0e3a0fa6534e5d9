"""What is kept of the good days, for a look at the whole: their samples, at no more than one a minute."""

import datetime as dt
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rivid.config import ReachConfig
from rivid.core.hydraulics import propose_delays
from rivid.errors import ConfigError
from rivid.logs.read import DataSet
from rivid.types import HOUR, ONE_DAY, Floats

Kept = NDArray[np.float32]
FINEST = 60.0
"""[s]; finer samples are averaged: what is looked for lasts longer, and decades must fit into memory."""


@dataclass(frozen=True, eq=False)
class Day:
    """The samples of a day.

    Attributes
    ----------
    date : date
    columns : dict of ndarray, (n,)
        u_Qi, u_Qo [m3/s] where it is logged, and the output: h_L [m] or Q_L [m3/s].
    content : str
        Digest of the samples as they were read.
    """

    date: dt.date
    columns: dict[str, Kept]
    content: str

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name].astype(float)

    def __len__(self) -> int:
        return len(self.columns["u_Qi"])


class Record:
    """The good days of a reach.

    Parameters
    ----------
    reach : ReachConfig

    Attributes
    ----------
    step : float
        Between two samples that are kept [s].
    days : dict of date to Day
        In date order.
    """

    def __init__(self, reach: ReachConfig) -> None:
        self.reach = reach
        self.output = reach.output
        self.merged = max(1, int(np.ceil(FINEST / reach.sample_time)))
        self.step = reach.sample_time * self.merged
        self.days: dict[dt.date, Day] = {}

    def add(self, data: DataSet) -> None:
        """Keep a day."""
        columns = {"u_Qi": data.inflow, self.output: data.output}
        if data.outflow is not None:
            columns["u_Qo"] = data.outflow
        digest = sha256()
        for name in sorted(columns):
            digest.update(np.ascontiguousarray(columns[name]).tobytes())
        kept = {name: self._coarser(values) for name, values in columns.items()}
        if len(kept["u_Qi"]):
            self.days[data.date] = Day(data.date, kept, digest.hexdigest())

    def _coarser(self, values: Floats) -> Kept:
        m = self.merged
        if m > 1:
            whole = len(values) // m * m
            values = values[:whole].reshape(-1, m).mean(axis=1)
        return values.astype(np.float32)

    @property
    def flows(self) -> list[str]:
        """Columns that are discharges."""
        names = list(next(iter(self.days.values())).columns) if self.days else []
        return [name for name in ("u_Qi", "u_Qo", "Q_L") if name in names]

    @property
    def balanced(self) -> bool:
        """Whether the level can be compared with inflow less outflow."""
        return self.reach.kind == "pool" and "u_Qo" in self.flows

    def declared(self, key: str) -> bool:
        """Whether a key of [reach] was given, not taken from Table I."""
        return key in self.reach.model_fields_set

    @cached_property
    def resolution(self) -> float:
        """The smallest step in which the output is logged on most days; 0 where it never moves."""
        smallest = []
        for day in self.days.values():
            values = day[self.output]
            steps = np.abs(np.diff(values))
            # single precision cannot tell steps below this from none
            steps = steps[steps > 4e-7 * max(float(np.abs(values).max()), 1.0)]
            if len(steps):
                smallest.append(float(steps.min()))
        return float(np.median(smallest)) if smallest else 0.0

    def clock(self, k: int) -> str:
        """The time of day of a sample, in words."""
        minutes = round(k * self.step / 60)
        return f"{minutes // 60:02d}:{minutes % 60:02d}"


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


TOLD = 0.35
"""Share of the output's moves from which on a day's fit is believed."""


class Fits:
    """Fits of the days of a record.

    Parameters
    ----------
    record : Record

    Attributes
    ----------
    right : dict of date to Fit
        The best with the inflow raising and the outflow lowering the output.
    reverse : dict of date to Fit
        The best the other way round.
    """

    def __init__(self, record: Record) -> None:
        self.record, self.lags = record, Lags(record)
        self.right: dict[dt.date, Fit] = {}
        self.reverse: dict[dt.date, Fit] = {}
        # without its outflow a pool's level says little of its inflow: people hold it
        fitted = record.balanced or record.reach.kind == "river"
        for date in record.days if fitted else ():
            sums = self.lags.sums(date)
            if sums is not None:
                self.right[date] = self.lags.best(sums)
                self.reverse[date] = self.lags.best(sums, -1)

    @cached_property
    def together(self) -> tuple[Fit, Fit]:
        """The fits to all days at once, the right way round and the other."""
        return self.of(self.right)

    def of(self, dates: Iterable[dt.date], shift: tuple[int, int] = (0, 0)) -> tuple[Fit, Fit]:
        """The fits to some days at once, the right way round and the other; `shift` as of `Lags.sums`."""
        total: Sums | None = None
        for date in dates:
            sums = self.lags.sums(date, *shift)
            if sums is not None:
                total = sums if total is None else total + sums
        if total is None:
            return NOTHING, NOTHING
        return self.lags.best(total), self.lags.best(total, -1)

    def without(self, dates: Collection[dt.date]) -> Fit:
        """The fit to all other days."""
        return self.of(date for date in self.right if date not in dates)[0] if dates else self.together[0]

    @property
    def told(self) -> dict[dt.date, Fit]:
        """Days whose fit is believed."""
        return {date: fit for date, fit in self.right.items() if fit.explained >= TOLD}
