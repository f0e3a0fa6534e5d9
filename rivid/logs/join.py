"""Several logs of a day, or days of a window, as one: they must mean the same days and agree."""

import datetime as dt
from collections import Counter
from collections.abc import Sequence

import numpy as np

from rivid.errors import DataError
from rivid.logs.catalog import DaySource
from rivid.logs.columns import Micros
from rivid.logs.times import clock, day_bounds
from rivid.types import Floats


def refuse_zones(zones: Sequence[dt.tzinfo], date: dt.date) -> None:
    """Refuse a day whose logs mean different days."""
    if len({day_bounds(date, zone) for zone in zones}) > 1:
        raise DataError(
            f"the logs of {date} have different UTC offsets: "
            "set [input] time_zone to the zone whose days are meant"
        )


def refuse_shifted(sources: Sequence[DaySource], zones: Sequence[dt.tzinfo]) -> None:
    """Each day must end where the next begins, or the grid is not regular."""
    for (a, zone_a), (b, zone_b) in zip(
        zip(sources, zones, strict=True), list(zip(sources, zones, strict=True))[1:], strict=False
    ):
        if day_bounds(a.date, zone_a)[1] != day_bounds(b.date, zone_b)[0]:
            if b.date - a.date == dt.timedelta(days=1):
                raise DataError(
                    f"{a.date} and {b.date} have different UTC offsets: "
                    "set [input] time_zone to the zone whose days are meant"
                )
            raise DataError(f"{a.date} and {b.date} are not consecutive days")


def join(parts: list[tuple[Micros, Floats]]) -> tuple[Micros, Floats]:
    """One column of what follows each other."""
    return np.concatenate([t for t, _ in parts]), np.concatenate([v for _, v in parts])


def merge(
    parts: list[tuple[Micros, Floats]], name: str, paths: str, zone: dt.tzinfo, notes: Counter[str]
) -> tuple[Micros, Floats]:
    """One column of a day from several files; where they overlap they must agree."""
    times, values = join(parts)
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    repeated = np.r_[False, np.diff(times) == 0][: len(times)]
    conflict = np.flatnonzero(repeated & (values != np.roll(values, 1)))
    if len(conflict):
        i = int(conflict[0])
        moment = clock(int(times[i]), zone, with_date=True)
        raise DataError(f"{paths} disagree about {name} at {moment}: {values[i - 1]:.6g} and {values[i]:.6g}")
    if repeated.any():
        notes[f"values of {name} in two files"] += int(repeated.sum())
    return times[~repeated], values[~repeated]
