"""From sources to canonical columns: sums, units, stamps, and values that are reported when they change."""

from dataclasses import dataclass, replace

import numpy as np

from rivid.logs.columns import Micros
from rivid.logs.grid import Grid
from rivid.logs.ingest.ledger import Fate
from rivid.logs.ingest.series import Series
from rivid.logs.spec import MICRO, Signal, Spec
from rivid.types import Floats, Ints


@dataclass(frozen=True, eq=False)
class Canonical:
    """A canonical column, reported regularly.

    Attributes
    ----------
    signal : Signal
    times : ndarray, (n,)
        From which the values count [us UTC]: the stamp's shift is taken off.
    values : ndarray, (n,)
        [m3/s] or [m].
    origins : list of (Series, ndarray)
        Per source: where in it each value comes from.
    """

    signal: Signal
    times: Micros
    values: Floats
    origins: list[tuple[Series, Ints]]

    @property
    def judged(self) -> Signal:
        """The signal as the grid is to judge it."""
        return self.signal

    @property
    def stamps(self) -> Micros:
        """Times as they stand in the export, ascending [us UTC]."""
        return self.times + self.signal.shift

    def of_day(self, grid: Grid, early: int) -> tuple[Micros, Floats, list[tuple[Series, Ints]]]:
        """What belongs to a local day: times, values, and where these come from."""
        low, high = self.times.searchsorted((grid.start - early, grid.end - early)).tolist()
        return (
            self.times[low:high],
            self.values[low:high],
            [(series, rows[low:high]) for series, rows in self.origins],
        )


@dataclass(frozen=True, eq=False)
class Held:
    """A canonical column whose sources are reported when they change: sampled on the grid, held till then.

    Attributes
    ----------
    signal : Signal
    sources : list of Series
    period : int
        T_s [us].
    """

    signal: Signal
    sources: list[Series]
    period: int

    def reports_within(self, grid: Grid) -> list[tuple[Series, Ints]]:
        """The reports of a local day, sampled or not."""
        found: list[tuple[Series, Ints]] = []
        for series in self.sources:
            low, high = series.times.searchsorted((grid.start, grid.end)).tolist()
            found.append((series, low + np.flatnonzero(np.isfinite(series.values[low:high]))))
        return found

    @property
    def judged(self) -> Signal:
        """On the grid it comes every T_s."""
        return replace(self.signal, spacing=self.period, shift=0)

    @property
    def stamps(self) -> Micros:
        """Times of the reports, ascending [us UTC]."""
        return np.unique(np.concatenate([_reports(series)[0] for series in self.sources]))

    def of_day(self, grid: Grid, early: int) -> tuple[Micros, Floats, list[tuple[Series, Ints]]]:
        """The samples of a local day, and the reports that they come from."""
        total = np.zeros(len(grid.times))
        origins: list[tuple[Series, Ints]] = []
        for series in self.sources:
            times, rows = _reports(series)
            if not len(rows):
                total[:] = np.nan
                continue
            at = times.searchsorted(grid.times + early, side="right") - 1
            last = rows[np.maximum(at, 0)]
            age = grid.times - series.times[last]
            held = (at >= 0) & (age <= self.signal.hold)
            total += np.where(held, series.values[last], np.nan)
            picked = np.unique(last[held])
            origins.append((series, picked[np.isfinite(series.values[picked])]))
        there = np.isfinite(total)
        return grid.times[there], total[there] * self.signal.factor, origins


def _reports(series: Series) -> tuple[Micros, Ints]:
    """Reports in order of time: a flag, sentinel or status ends what was held before."""
    rows = np.flatnonzero((series.fates != Fate.DUPLICATE) & (series.fates != Fate.TIME))
    return series.times[rows], rows


def canonical(series: dict[str, Series], spec: Spec) -> list[Canonical | Held]:
    """The canonical columns.

    Parameters
    ----------
    series : dict of Series
        Fates of values that lack a partner in every sum are set.
    spec : Spec
    """
    matched = {name: np.zeros(len(s.times), bool) for name, s in series.items()}
    columns: list[Canonical | Held] = []
    for signal in spec.signals:
        parts = [series[name] for name in signal.sources]
        if signal.hold:
            columns.append(Held(signal, parts, round(spec.period * MICRO)))
            for part in parts:
                matched[part.name][:] = True
            continue
        rows = [np.flatnonzero(part.fates == Fate.USED) for part in parts]
        common = parts[0].times[rows[0]]
        for part, there in zip(parts[1:], rows[1:], strict=True):
            common = np.intersect1d(common, part.times[there], assume_unique=True)
        kept = [there[np.isin(part.times[there], common)] for part, there in zip(parts, rows, strict=True)]
        total = parts[0].values[kept[0]]
        for part, there in zip(parts[1:], kept[1:], strict=True):
            total = total + part.values[there]
        for part, there in zip(parts, kept, strict=True):
            matched[part.name][there] = True
        columns.append(
            Canonical(
                signal,
                common - signal.shift,
                total * signal.factor if signal.factor != 1.0 else total,
                list(zip(parts, kept, strict=True)),
            )
        )
    for name, found in matched.items():
        alone = ~found & (series[name].fates == Fate.USED)
        series[name].fates[alone] = Fate.UNMATCHED
    return columns
