"""Small, fast daily logs for tests: steps of inflow, a delayed integrator with feedback, gauge noise."""

import datetime as dt
from pathlib import Path

import numpy as np

HEAD = "time,u_Qi,u_Qo,h_L"
FIRST = dt.date(2008, 3, 10)
ZONE = dt.timezone(dt.timedelta(hours=1))


def a_day(date, seed=0, delay=6, n=650):
    """Return the columns of one day: times (ISO text), inflow, outflow, level."""
    rng = np.random.default_rng([seed, date.toordinal()])
    moves = (rng.random(n) < 0.12) * rng.normal(size=n) * 12
    inflow = np.clip(300 + np.cumsum(moves), 120, 700).round()
    late = np.r_[np.full(delay + 1, inflow[0]), inflow[: n - delay - 1]]
    level, outflow, trim = np.empty(n), np.empty(n), 0.0
    h = 0.0
    for k in range(n):
        level[k] = h
        trim += 0.05 * h
        outflow[k] = round(max(inflow[k] + 400 * h + trim, 0.0))
        h += 133 / 6.7e5 * (late[k] - outflow[k]) + rng.normal() * 3e-4
    level = (118.0 + level + rng.normal(size=n) * 0.003).round(3)
    midnight = dt.datetime.combine(date, dt.time(), ZONE)
    times = [(midnight + dt.timedelta(seconds=133 * k)).isoformat() for k in range(n)]
    return times, inflow, outflow, level


def text_of(date, seed=0, delay=6, n=650):
    """Return the day as canonical CSV."""
    rows = zip(*a_day(date, seed, delay, n), strict=True)
    return "\n".join([HEAD, *(f"{t},{q:g},{o:g},{h:.3f}" for t, q, o, h in rows)]) + "\n"


def write_days(folder: Path, n_days: int, seed: int = 0, first: dt.date = FIRST) -> list[dt.date]:
    """Write `n_days` CSV files, and return their dates."""
    folder.mkdir(parents=True, exist_ok=True)
    dates = [first + dt.timedelta(days=k) for k in range(n_days)]
    for date in dates:
        (folder / f"{date}.csv").write_text(text_of(date, seed), encoding="utf-8")
    return dates
