"""How often the logs have rows, against `[reach] sample_time`; the hours at which clocks change."""

import datetime as dt
from pathlib import Path

import numpy as np

from rivid.check.findings import Finding, dates_in_words
from rivid.config import Config
from rivid.errors import RividError
from rivid.logs.catalog import DaySource, is_day_file
from rivid.logs.files import DAY, MANY
from rivid.logs.log import load
from rivid.logs.spec import MICRO, spec_of
from rivid.logs.times import local

OFF = 0.02
"""A spacing that differs by more from T_s is told of [relative]."""
HOUR = 3600 * MICRO
CHANGES = (3, 4, 9, 10, 11)
"""Months in which clocks change somewhere."""


class Spacing:
    """How often each column comes, day by day.

    Parameters
    ----------
    root : Path
    config : Config
    """

    def __init__(self, root: Path, config: Config) -> None:
        self.folder = root if root.is_dir() else root.parent
        self.config, self.spec = config, spec_of(config)
        self.usual: dict[str, dict[dt.date, float]] = {}
        self.skipped: list[dt.date] = []
        self.twice: list[dt.date] = []

    def add(self, source: DaySource, reason: str) -> None:
        """Look at a day's rows as they are logged, whatever became of the day."""
        part = source.parts[0]
        try:
            log = load(self.folder / part.path, part.name, self.spec, DAY if is_day_file(part.path) else MANY)
        except (RividError, OSError, ValueError, MemoryError):
            return
        series = log.of_day(source.date)
        for name, (times, _) in series.items():
            if len(times) > 2:
                self.usual.setdefault(name, {})[source.date] = float(np.median(np.diff(times))) / MICRO
        if source.date.weekday() == 6 and source.date.month in CHANGES:
            if "is logged twice with different" in reason:
                self.twice.append(source.date)
            elif _an_hour_missing(series["u_Qi"][0], log.zone):
                self.skipped.append(source.date)

    def findings(self) -> list[Finding]:
        """What is wrong with how often rows come, and with the hours of the clocks."""
        return [*self._intervals(), *self._summer_time()]

    def _intervals(self) -> list[Finding]:
        period = self.config.reach.sample_time
        odd: dict[float, dict[str, list[dt.date]]] = {}
        for signal in self.spec.signals:
            expected = signal.spacing / MICRO
            for date, usual in self.usual.get(signal.name, {}).items():
                if abs(usual / expected - 1) > OFF:
                    odd.setdefault(float(f"{usual:.3g}"), {}).setdefault(signal.name, []).append(date)
        found = []
        for usual, columns in odd.items():
            dates = sorted({date for days in columns.values() for date in days})
            total = len({date for days in self.usual.values() for date in days})
            if len(dates) < max(2, 0.05 * total) and total > 1:
                continue  # a day with holes
            names = ", ".join(columns)
            declared = {signal.spacing for signal in self.spec.signals if signal.name in columns} != {
                round(period * MICRO)
            }
            says = f"{names} come{'s' if len(columns) == 1 else ''} every {usual:g} s"
            against = (
                "[input.interval] says otherwise" if declared else f"[reach] sample_time is {period:g} s"
            )
            finer = usual < period and not declared
            all_columns = len(columns) == len(self.spec.signals)
            if finer:
                advice = "what lies between samples is not used"
            elif all_columns and not declared:
                advice = f"set sample_time = {usual:g}"
            else:
                advice = f"set [input.interval] {next(iter(columns))} = {usual:g}"
            days = {} if len(dates) == total else dict.fromkeys(dates, f"{names} every {usual:g} s")
            found.append(Finding("interval", f"{says}; {against}: {advice}", days, wrong=not finer))
        return found

    def _summer_time(self) -> list[Finding]:
        if not self.skipped and not self.twice:
            return []
        words = []
        if self.skipped:
            words.append(f"an hour of the night is missing on {dates_in_words(self.skipped)}")
        if self.twice:
            words.append(f"one comes twice on {dates_in_words(self.twice)}")
        zone = self.config.input.time_zone
        said = f"it is read as {zone}" if zone else "it is read by the offset that it writes"
        text = (
            f"{' and '.join(words)}, Sundays on which clocks change: the logger keeps summer time, "
            f"and {said}; "
            'set [input] time_zone to its zone, such as "Europe/Paris"'
        )
        days = dict.fromkeys(self.skipped, "an hour of the night is missing")
        days |= dict.fromkeys(self.twice, "an hour of the night comes twice")
        return [Finding("summer time", text, days)]


def _an_hour_missing(times: np.ndarray, zone: dt.tzinfo) -> bool:
    """Whether the only gap is one of an hour between midnight and 4 h."""
    if len(times) < 4:
        return False
    steps = np.diff(times)
    at = int(steps.argmax())
    if abs(int(steps[at]) - int(np.median(steps)) - HOUR) > HOUR // 10:
        return False
    return local(int(times[at]), zone).hour < 4
