"""Spacing of the logged rows against `[reach] sample_time`, and nights on which clocks change."""

import datetime as dt
from collections import defaultdict
from pathlib import Path

import numpy as np

from rivid.check.findings import Finding, list_dates
from rivid.config import Config
from rivid.errors import RividError
from rivid.logs.days import MISSED, DaySource
from rivid.logs.log import load
from rivid.logs.spec import MICRO, clocks_change, day_bounds, local, spec_of
from rivid.types import Ints

OFF = 0.02  # smallest reported difference between the spacing and T_s [relative]
FEW = 0.05  # smallest share of days with another spacing: fewer are days with gaps
# distance of a step from a multiple of the median one, relative to it, that is odd; share of odd steps beyond
# which rows are irregular. Multiples are missing rows
UNEVEN, ODD = 0.1, 0.3
HOUR = 3600 * MICRO


class Spacing:
    """Spacing of each column's rows, day by day; `root` is DATA_DIR, or one file."""

    def __init__(self, root: Path, config: Config) -> None:
        self.folder = root if root.is_dir() else root.parent
        self.config, self.spec = config, spec_of(config)
        # the median twice [s] or, where rows are irregular, the 5th and the 95th percentile
        self.steps: dict[str, dict[dt.date, tuple[float, float]]] = defaultdict(dict)
        self.nights: dict[str, list[dt.date]] = {"is missing": [], "comes twice": []}

    def add(self, source: DaySource) -> None:
        """Add a day as it is logged (its file is still in memory)."""
        path, *_ = source.parts[0]
        try:
            log = load(self.folder / path, self.spec)
        except (RividError, OSError, ValueError, MemoryError):
            return
        series = log.of_day(source.date)
        for name, (times, _) in series.items():
            if len(times) > 2:
                steps = np.diff(times) / MICRO
                low = high = float(np.median(steps))
                if np.mean(np.abs(steps / low - np.maximum(np.round(steps / low), 1)) > UNEVEN) > ODD:
                    low, high = np.percentile(steps, (5, 95)).tolist()
                self.steps[name][source.date] = low, high
        start, end = day_bounds(source.date, log.zone)
        if clocks_change(source.date) and end - start == 24 * HOUR:  # else the zone changes its clock, too
            if any(fault.twice for fault in log.faults_of(source.date)):
                self.nights["comes twice"].append(source.date)
            elif _misses_an_hour(series["u_Qi"][0], log.zone):
                self.nights["is missing"].append(source.date)

    def findings(self) -> list[Finding]:
        """Return the findings on spacing and summer time."""
        found = self._intervals()
        if days := {date: {"what": what} for what, dates in self.nights.items() for date in dates}:
            listed = [f"{what} on {list_dates(dates)}" for what, dates in self.nights.items() if dates]
            read_as = self.config.input.time_zone or "their written offset"
            found.append(Finding("summer time", {"what": " and ".join(listed), "read_as": read_as}, days))
        return found

    def _intervals(self) -> list[Finding]:
        period = self.config.reach.sample_time
        expected = {signal.name: signal.spacing / MICRO for signal in self.spec.signals}
        uneven = {
            name: np.median(ends, axis=0).tolist()
            for name, days in self.steps.items()
            if (ends := [step for step in days.values() if step[0] < step[1]])
        }
        # in which nearly each sample has a row; one for columns that are alike
        minutes: dict[str, float] = {}
        for name, (_, high) in sorted(uneven.items(), key=lambda item: -item[1][1]):
            alike = (each for each in minutes.values() if each < MISSED * high)
            minutes[name] = next(alike, 60.0 * max(round(high / 60), 1))
        odd: dict[tuple[float, bool], dict[str, list[dt.date]]] = defaultdict(lambda: defaultdict(list))
        for name, spacing in expected.items():
            for date, (low, high) in self.steps[name].items():
                usual = minutes[name] if low < high else high
                if abs(usual / spacing - 1) > OFF:
                    odd[float(f"{usual:.3g}"), low < high][name].append(date)
        total = len(set().union(*self.steps.values()))
        found = []
        for (usual, irregular), columns in odd.items():
            dates = sorted(set().union(*columns.values()))
            if len(dates) < max(2, FEW * total) and total > 1:
                continue
            first = next(iter(columns))
            declared = any(round(expected[name] * MICRO) != round(period * MICRO) for name in columns)
            whole = "sample_time" if len(columns) == len(expected) else "column"
            code = "declared" if declared else "finer" if usual < period else whole
            every = f"{usual:g} s"
            if irregular:
                lows, highs = zip(*(uneven[name] for name in columns), strict=True)
                every = f"{min(lows):.0f} to {max(highs):.0f} s, at irregular times"
            values = {
                "columns": ", ".join(columns), "every": every, "column": first, "spacing_s": usual,
                "expected_s": expected[first] if declared else period, "output": self.spec.output,
            }  # fmt: skip
            days = dates if len(dates) < total else []
            found.append(Finding(f"interval.{code}", values, {date: {} for date in days}))
        return found


def _misses_an_hour(times: Ints, zone: dt.tzinfo) -> bool:
    """Return whether the largest gap is one of an hour between midnight and 4 h."""
    if len(times) < 4:
        return False
    steps = np.diff(times)
    at = int(steps.argmax())
    an_hour = abs(int(steps[at]) - int(np.median(steps)) - HOUR) <= HOUR // 10
    return an_hour and local(int(times[at]), zone).hour < 4
