"""Short logs of several kinds, and one-line reading."""

import datetime as dt

from rivid.config import Config, parse
from rivid.logs.days import find_days, read_window
from tests.daily import a_day

DAY = dt.date(2008, 3, 10)
HEAD = "time,u_Qi,u_Qo,h_L"


def config(reach=None, window_days=1, **given):
    """Return a configuration with these `[input]` keys."""
    return parse({"reach": reach or {}, "input": given, "run": {"window_days": window_days}}, Config)


def rows(date=DAY, n=650, step=133, zone="+01:00", start=0):
    """Return rows of a canonical log as lists of text; inflow, outflow and level are those of `a_day`."""
    _, inflow, outflow, level = a_day(date, n=650)
    midnight = dt.datetime.combine(date, dt.time())
    out = []
    for k in range(n):
        time = (midnight + dt.timedelta(seconds=start + step * k)).isoformat() + zone
        out.append([time, f"{inflow[k % 650]:g}", f"{outflow[k % 650]:g}", f"{level[k % 650]:.3f}"])
    return out


def text(lines, head=HEAD, separator=","):
    """Return lines of cells as CSV."""
    return "\n".join([head, *(separator.join(line) for line in lines)]) + "\n"


def put(folder, lines, name=None, **options):
    """Write a log, and return its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / (name or f"{DAY}.csv")).write_text(text(lines, **options), encoding="utf-8")
    return folder


def read(folder, *, reach=None, day=None, today=None, **given):
    """Read the data set of one day (the only one, or `day`)."""
    settings = config(reach, **given)
    catalog = find_days(folder, settings)
    (source,) = [d for d in catalog.days if day is None or d.date == day]
    return read_window(folder, [source], settings, today=today)
