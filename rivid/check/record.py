"""The good days of a reach, and how its output answers the flows on them.

Lags and gains of a day are fitted by least squares, over all pairs of lags. Pool: over an hour H,
``h(t + H) - h(t) = c_i V_i(t - l_i) + c_o V_o(t - l_o)``, where V is the volume of an hour. Without faults
c_i and -c_o are 1 / area, l_i is the delay, and l_o is nearly zero, since the gauge is at the gate. River:
``Q_L(t + H) - Q_L(t) = c_i (Q_i(t + H - l_i) - Q_i(t - l_i))``. All terms less their means over the day.
"""

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
from rivid.errors import ConfigError
from rivid.input_config import FLOWS
from rivid.logs.days import DataSet
from rivid.types import HOUR, ONE_DAY, Floats

Kept = NDArray[np.float32]
Sums = tuple[Floats, ...]
"""Sums over the samples of a day, for every lag: yy, x_i y, x_o y, x_i x_i, x_o x_o, x_i x_o."""

FINEST = 60.0  # shortest sample time kept [s]; finer samples are averaged, so that decades fit into memory
# lags searched beyond the expected ones [s]: a clock that is an hour off must lie well inside
AROUND = 1.75 * HOUR
LONGEST = 24 * HOUR  # longest lag searched [s]
LEAST = 24  # fewest samples of a day that are fitted
# a flow that moves by less than this part of its size does not move: rounding alone gives about 1e-13
STILL = 1e-10
SINGULAR = 1e-6  # smallest determinant of the normal equations, relative to the product of their diagonal
# moves of the output are clipped at so many times the median move: leaps of the gauge are not fitted
LEAP = 10.0
BELIEVED = 0.35  # smallest share of the variance of the output's moves that a believed fit explains
NEAR = 20 * 60.0  # lags within this distance of the usual ones count as usual [s]


@dataclass(frozen=True, eq=False)
class Day:
    """Samples of a day."""

    columns: dict[str, Kept]  # (n,) each: u_Qi, u_Qo where it is logged, Q_L [m3/s], h_L [m]
    content: str  # digest of the samples as they were read

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name].astype(float)

    def __len__(self) -> int:
        return len(self.columns["u_Qi"])


class Record:
    """The good days of a reach, in order of dates, at a sample time of `step` [s]."""

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
        digest = sha256(b"".join(columns[name].tobytes() for name in sorted(columns)))
        whole = len(data.inflow) // self.merged * self.merged
        if whole:
            kept = {
                name: values[:whole].reshape(-1, self.merged).mean(axis=1).astype(np.float32)
                for name, values in columns.items()
            }
            self.days[data.date] = Day(kept, digest.hexdigest())

    @property
    def flows(self) -> list[str]:
        """Columns that are discharges."""
        columns = next(iter(self.days.values())).columns if self.days else {}
        return [name for name in FLOWS if name in columns]

    @property
    def balanced(self) -> bool:
        """Whether the level can be compared with inflow less outflow."""
        return self.reach.kind == "pool" and "u_Qo" in self.flows

    def declared(self, key: str) -> bool:
        """Return whether a key of [reach] is configured rather than taken from Table I."""
        return key in self.reach.model_fields_set

    @property
    def area(self) -> tuple[float, str]:
        """Surface of the water [m2] and the keys of [reach] it is from; "" where none is configured."""
        if not self.declared("surface_area") and self.declared("length") and self.declared("width"):
            return self.reach.length * self.reach.width, "length x width"
        return self.reach.surface_area, "surface_area" if self.declared("surface_area") else ""

    @cached_property
    def resolution(self) -> float:
        """Smallest step of the output on the median day; 0 if it never moves."""
        smallest = []
        for day in self.days.values():
            values = day[self.output]
            steps = np.abs(np.diff(values))
            # smaller steps are below the resolution of single precision
            steps = steps[steps > 4e-7 * max(float(np.abs(values).max()), 1.0)]
            if len(steps):
                smallest.append(float(steps.min()))
        return float(np.median(smallest)) if smallest else 0.0

    def clock(self, k: int) -> str:
        """Return the time of day of a sample, as HH:MM."""
        minutes = round(k * self.step / 60)
        return f"{minutes // 60:02d}:{minutes % 60:02d}"


def consecutive(dates: Iterable[dt.date], among: Iterable[dt.date], gap: int = 1) -> list[list[dt.date]]:
    """Split dates into rows in which each is at most `gap` places after the one before, among others."""
    order = {date: k for k, date in enumerate(among)}
    rows: list[list[dt.date]] = []
    for date in dates:
        if rows and order[date] - order[rows[-1][-1]] <= gap:
            rows[-1].append(date)
        else:
            rows.append([date])
    return rows


class Fit(NamedTuple):
    """The best pair of lags."""

    explained: float  # explained share of the variance of the output's moves [-]
    lag_in: float  # from the move of the inflow to that of the output [s]
    lag_out: float  # from the move of the outflow to that of the output [s]
    gain_in: float  # [1/m2]; of a river [-]
    gain_out: float  # [1/m2]; of a river 0


NO_FIT = Fit(0.0, np.nan, np.nan, np.nan, np.nan)


class Fits:
    """Fits of the days of a record."""

    def __init__(self, record: Record) -> None:
        self.record = record
        reach, step = record.reach, record.step
        try:  # the longest delay of [reach] by its hydraulics [s]
            self.longest = min((reach.proposal(step).d_max + 1) * step, LONGEST)
        except ConfigError:
            self.longest = HOUR
        around = round(AROUND / step)
        self.horizon = max(round(HOUR / step), 2)
        # the ends of a river may be exchanged
        least = around if reach.kind == "pool" else max(around, round(self.longest / step))
        self.inflow = np.arange(-least, round(max(self.longest, HOUR) / step) + around + 1)
        self.outflow = np.arange(-around, around + 1) if record.balanced else np.zeros(1, int)
        # the best fit if the inflow raises and the outflow lowers the output; if it is the other way round
        self.right: dict[dt.date, Fit] = {}
        self.reverse: dict[dt.date, Fit] = {}
        # the level of a pool without its outflow depends little on the inflow: operators hold it
        for date in record.days if record.balanced or reach.kind == "river" else ():
            if (sums := self.sums(date)) is not None:
                self.right[date], self.reverse[date] = self.best(sums), self.best(sums, -1)

    @cached_property
    def together(self) -> tuple[Fit, Fit]:
        """The fits to all days at once, the right way round and reversed."""
        return self.of(self.right)

    def of(self, dates: Iterable[dt.date], shift: tuple[int, int] = (0, 0)) -> tuple[Fit, Fit]:
        """Return the fits to some days at once, the right way round and reversed; `shift` as in `sums`."""
        total = self._total(dates, shift)
        return (NO_FIT, NO_FIT) if total is None else (self.best(total), self.best(total, -1))

    def _total(self, dates: Iterable[dt.date], shift: tuple[int, int] = (0, 0)) -> Sums | None:
        """Return the sums over some days; None without any."""
        every = [sums for date in dates if (sums := self.sums(date, *shift)) is not None]
        return tuple(sum(terms[1:], terms[0]) for terms in zip(*every, strict=True)) if every else None

    def volume(self) -> float:
        """Return the least RMS of the net volume at any lags, over that of the level's moves [m2].

        0 if one of the flows does not move.
        """
        total = self._total(self.right)
        if total is None or total[0] <= 0:
            return 0.0
        yy, _, _, of_in, of_out, between = total
        if min(of_in.max(), of_out.max()) <= SINGULAR * max(of_in.max(), of_out.max()):
            return 0.0
        return float(np.sqrt((of_in[:, None] + of_out - 2.0 * between).min() / yy))

    def without(self, dates: Collection[dt.date]) -> Fit:
        """Return the fit to all other days."""
        return self.of(date for date in self.right if date not in dates)[0] if dates else self.together[0]

    def sums(self, date: dt.date, days_in: int = 0, days_out: int = 0) -> Sums | None:
        """Return the sums of a day with its flows from so many days later; None if too short or still."""
        record, h = self.record, self.horizon
        level = record.days[date][record.output]
        n = len(level) - h
        if n < LEAST:
            return None
        inflow = self._moves(date + days_in * ONE_DAY, "u_Qi", n)
        none = np.zeros((1, n)), 0, n
        outflow = self._moves(date + days_out * ONE_DAY, "u_Qo", n) if record.balanced else none
        if inflow is None or outflow is None:
            return None
        first, last = max(inflow[1], outflow[1]), min(inflow[2], outflow[2])
        if last - first < max(n // 3, LEAST):
            return None
        y = (level[h:] - level[:-h])[first:last]
        middle = np.median(y)
        limit = LEAP * float(np.median(np.abs(y - middle)))
        if limit > 0:
            y = np.clip(y, middle - limit, middle + limit)
        y = y - y.mean()
        moves = [x[:, first:last] for x, *_ in (inflow, outflow)]
        x_i, x_o = (x - x.mean(axis=1, keepdims=True) for x in moves)
        return y @ y, x_i @ y, x_o @ y, (x_i**2).sum(1), (x_o**2).sum(1), x_i @ x_o.T

    def _moves(self, date: dt.date, name: str, n: int) -> tuple[Floats, int, int] | None:
        """Return a flow's moves over the horizon at every lag, (lags, n), and the span of known samples."""
        days, h = self.record.days, self.horizon
        if date not in days or len(days[date]) != n + h:
            return None
        lags = self.inflow if name == "u_Qi" else self.outflow
        before, after = max(int(lags[-1]), 0), max(-int(lags[0]), 0)
        own = days[date][name]
        if name == "u_Qi" and np.ptp(own) <= STILL * np.abs(own).max():
            return None
        previous, following = (
            days[day][name] if day in days else own[:0] for day in (date - ONE_DAY, date + ONE_DAY)
        )
        left, right = min(before, len(previous)), min(after, len(following))
        known = (previous[len(previous) - left :], own, following[:right])
        flow = np.concatenate([np.zeros(before - left), *known, np.zeros(after - right)])
        if self.record.reach.kind == "pool":
            flow = np.concatenate([[0.0], np.cumsum(flow) * self.record.step])
        moves = (flow[h:] - flow[:-h])[: before + n + after]
        windows: NDArray[np.float64] = sliding_window_view(moves, n)
        return windows[before - lags], max(int(lags[-1]) - left, 0), min(n, n + right + int(lags[0]))

    def near(self, date: dt.date, lags: tuple[float, float]) -> float:
        """Return the explained share of a day by lags near these [s]; 0 where it has no sums."""
        sums = self.sums(date)
        return 0.0 if sums is None else self.best(sums, near=lags).explained

    def best(self, sums: Sums, sign: int = 1, near: tuple[float, float] | None = None) -> Fit:
        """Return the pair of lags, near these [s], that explains most, with c_i > 0 > c_o if `sign` is 1."""
        yy, with_in, with_out, of_in, of_out, between = sums
        if yy <= 0:
            return NO_FIT
        if self.record.balanced:
            det = of_in[:, None] * of_out - between**2
            sound = det > SINGULAR * of_in[:, None] * of_out
            safe = np.where(sound, det, np.inf)
            c_in = (with_in[:, None] * of_out - with_out * between) / safe
            c_out = (with_out * of_in[:, None] - with_in[:, None] * between) / safe
            sound &= (sign * c_in > 0) & (sign * c_out < 0)
        else:
            sound = of_in[:, None] > 0
            c_in = with_in[:, None] / np.where(sound, of_in[:, None], np.inf)
            c_out = np.zeros_like(c_in)
            sound &= sign * c_in > 0
        explained = (c_in * with_in[:, None] + c_out * with_out) / yy
        step = self.record.step
        if near is not None:
            sound &= np.abs(self.inflow * step - near[0])[:, None] <= NEAR
            sound &= np.abs(self.outflow * step - near[1]) <= NEAR
        if not sound.any():
            return NO_FIT
        explained = np.where(sound, explained, -1.0)
        i, o = np.unravel_index(int(explained.argmax()), explained.shape)
        lags = float(self.inflow[i] * step), float(self.outflow[o] * step)
        return Fit(float(explained[i, o]), *lags, float(c_in[i, o]), float(c_out[i, o]))
