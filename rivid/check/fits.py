"""The fit of every day, and of many together."""

import datetime as dt
from collections.abc import Collection, Iterable
from functools import cached_property

from rivid.check.fit import NOTHING, Fit, Lags, Sums
from rivid.check.record import Record

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
