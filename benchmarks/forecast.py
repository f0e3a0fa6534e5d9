"""Compare forecasts with their peers, hour by hour on days not used for fitting; write docs/forecast.md.

Usage: python -m benchmarks.forecast [--quick]
"""

import argparse
import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor

import rivid
from benchmarks.measure import table
from rivid import forecast as core
from rivid.config import load_config
from rivid.diagnosis.calibrated import ReachModel
from rivid.forecast import HINDCASTS, HISTORY, LEVELS, Series, learnt_quantiles
from rivid.simulation.scenario import load_scenario
from rivid.types import DAY, HOUR, Floats, Ints

ROOT = Path(__file__).parent.parent
PAGE, HEAD = ROOT / "docs" / "forecast.md", Path(__file__).with_name("forecast_head.md")
HOURS = (0.5, 1.0, 2.0, 4.0, 8.0, 12.0, 24.0)
TRAIN, TEST = 60, 30
"""Days for calibration and learning, and the following days that are scored."""
LAGS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 18.0, 24.0)
"""Lags of the regressions [h]."""


@dataclass(frozen=True, eq=False)
class Case:
    """A reach: a model of its first days, and the series of all days."""

    name: str
    model: ReachModel
    series: Series
    train: Ints
    test: Ints


def case(name: str, arrays: tuple[Floats, Floats, Floats], model: ReachModel, first: dt.date) -> Case:
    """Build a case with origins at every hour."""
    inflow, outflow, output = (a.ravel() for a in arrays)
    T, n = model.sample_time, len(inflow)
    begin = dt.datetime.combine(first, dt.time(), dt.UTC)
    series = Series(T * np.arange(float(n)), first, inflow, outflow, output, n - 1, begin)
    ahead, lead = round(DAY / T), core.lead_of(model)
    hourly = np.arange(max(lead, ahead), n - ahead, max(round(HOUR / T), 1))
    hourly = hourly[np.isfinite(output[hourly])]
    split = TRAIN * ahead
    return Case(name, model, series, hourly[hourly < split - ahead], hourly[hourly >= split])


def calibrated(logs: object, config: object, **more: object) -> ReachModel:
    """Return the model that `rivid diagnose` writes."""
    found = rivid.diagnose(logs, config, **more)  # type: ignore[arg-type]
    assert found.evidence is not None and found.evidence.model is not None
    return ReachModel(found.config.reach.name, found.evidence.model, found.config.reach.sample_time, {})


def pool(place: str, seed: int) -> Case:
    """Return a simulated pool with another seed."""
    scenario = load_scenario(ROOT / "configs" / "scenarios" / f"{place}.toml")
    changed = scenario.model_copy(update={"days": TRAIN + TEST, "missing_days": 0, "seed": seed})
    season = rivid.simulate(changed)
    last = season.dates[TRAIN - 1]
    model = calibrated(season, None, last=last)
    return case(place, (season.inflow, season.outflow, season.level), model, season.dates[0])


def river() -> Case:
    """Return Glen Canyon Dam to Lees Ferry, with the total release."""
    config = load_config(ROOT / "configs" / "glen_canyon_bypass.toml")
    data, first = ROOT / "sample_data" / "glen_canyon", dt.date(2025, 1, 1)
    last = first + dt.timedelta(days=TRAIN - 1)
    model = calibrated(data, config, first=first, last=last)
    from rivid.diagnosis.data import read_record

    end = first + dt.timedelta(days=TRAIN + TEST - 1)
    record, _ = read_record(data, config, first=first, last=end)
    days = tuple(a[:, record.lead :] for a in (record.inflow, record.outflow, record.output))
    assert record.days == TRAIN + TEST
    return case("glen canyon", (days[0], days[1], days[2]), model, first)


def came(c: Case, origins: Ints, steps: Ints) -> Floats:
    """Return the measured output less the output at the origin."""
    return c.series.output[origins[:, None] + steps] - c.series.output[origins, None]


def ours(c: Case, steps: Ints, announced: bool) -> Floats:
    """Return quantiles (5, m, h) of `rivid forecast`, learnt for each day from the days before it."""
    T, ahead = c.model.sample_time, int(steps[-1])
    every = np.concatenate([c.train, c.test])
    lead = core.lead_of(c.model)
    _, X, sd, _ = core.simulations(c.model, c.series, every, lead, ahead, ahead if announced else 0)
    X, sd, target = X[:, steps - 1], sd[:, steps - 1], came(c, every, steps)
    found = np.empty((len(LEVELS), len(c.test), len(steps)))
    day = c.test // round(DAY / T)
    for one in np.unique(day):
        rows = np.flatnonzero(day == one)
        now = int(c.test[rows[0]])
        known = np.flatnonzero((every + ahead < now) & (every > now - HISTORY * DAY / T))
        known = known[np.linspace(0, len(known) - 1, min(HINDCASTS, len(known))).astype(int)]
        at = rows + len(c.train)
        found[:, rows] = learnt_quantiles(X[known], target[known], sd[known], X[at], sd[at])
    return found


def flows(c: Case, origins: Ints, ahead: int, announced: bool, back: int) -> tuple[Floats, Floats]:
    """Return the flows from `back` samples before each origin to `ahead` after it, held unless announced."""
    at = np.maximum(origins[:, None] + np.arange(-back, ahead + 1), 0)
    u, o = c.series.inflow[at], c.series.outflow[at]
    if not announced:
        u[:, back + 1 :], o[:, back + 1 :] = u[:, back : back + 1], o[:, back : back + 1]
    return u, o


def persistence(c: Case, origins: Ints, steps: Ints, announced: bool) -> Floats:
    """Forecast the present output."""
    return np.zeros((len(origins), len(steps)))


def fixed_lag(c: Case, origins: Ints, steps: Ints, announced: bool) -> Floats:
    """Forecast by a fixed lag, the model's: shift a river's inflow; divide a pool's volume by its area."""
    T = c.model.sample_time
    up = c.model.kernels(round(2 * DAY / T))["up"]
    lag = core._half(c.model, up)
    u, o = flows(c, origins, int(steps[-1]), announced, lag + 1)
    if c.model.kind == "river":
        return u[:, steps + 1] - u[:, 1:2]
    area = c.model.model.reach.surface_area or 1.0
    stored = np.cumsum(u[:, 1 : int(steps[-1]) + 1] - o[:, lag + 1 : -1], axis=1) * T / area
    return stored[:, steps - 1]


def paper_fir(c: Case, origins: Ints, steps: Ints, announced: bool) -> Floats:
    """Forecast by the median response of `jmap` on windows of three training days, from the inflow alone."""
    T, three = c.model.sample_time, 3 * round(DAY / c.model.sample_time)
    up = c.model.kernels(round(2 * DAY / T))["up"]
    longest = min(3 * core._half(c.model, up) + 6, 120)
    u = c.series.inflow[: TRAIN // 3 * three].reshape(-1, three)
    y = c.series.output[: TRAIN // 3 * three].reshape(-1, three)
    whole = np.isfinite(y).all(axis=1)
    fitted = rivid.jmap(u[whole], y[whole], order=longest + 3, d_max=longest)
    h = np.nanmedian(fitted.fir, axis=0)
    late, _ = flows(c, origins, int(steps[-1]), announced, len(h))
    answer = np.lib.stride_tricks.sliding_window_view(late - late[:, :1], len(h), axis=1) @ h[::-1]
    return answer[:, steps + 1] - answer[:, 1:2]


def features(c: Case, origins: Ints, step: int, announced: bool, hour: bool) -> Floats:
    """Return past outputs and flows at some lags, means of announced flows until the target, and the hour."""
    T, s = c.model.sample_time, c.series
    lags = np.round(np.array(LAGS) * HOUR / T).astype(int)
    back = np.maximum(origins[:, None] - lags, 0)
    y = s.output[core._latest(s.output, back.ravel())].reshape(back.shape)
    columns = [y - y[:, :1], y[:, :1], s.inflow[back]]
    if c.model.kind == "pool":
        columns.append(s.outflow[back])
    if announced:
        u, o = flows(c, origins, step, True, 0)
        for values in (u, o) if c.model.kind == "pool" else (u,):
            parts = np.array_split(values[:, 1:], min(6, step), axis=1)
            columns.append(np.stack([part.mean(axis=1) for part in parts], axis=1))
    if hour:
        columns.append(np.mod(s.time[origins] / HOUR, 24.0)[:, None])
    return np.concatenate(columns, axis=1)


def arx(c: Case, origins: Ints, steps: Ints, announced: bool) -> Floats:
    """Forecast by a ridge regression for each horizon, fitted to the training origins."""
    found = np.empty((len(origins), len(steps)))
    for j, step in enumerate(steps.tolist()):
        X, y = features(c, c.train, step, announced, False), came(c, c.train, steps[j : j + 1])[:, 0]
        X, y = X[np.isfinite(y)], y[np.isfinite(y)]
        middle, size = X.mean(axis=0), X.std(axis=0) + 1e-9
        A = np.column_stack([(X - middle) / size, np.ones(len(X))])
        beta = np.linalg.solve(A.T @ A + 1e-3 * len(A) * np.eye(A.shape[1]), A.T @ y)
        B = (features(c, origins, step, announced, False) - middle) / size
        found[:, j] = np.column_stack([B, np.ones(len(B))]) @ beta
    return found


def boosting(c: Case, origins: Ints, steps: Ints, announced: bool) -> Floats:
    """Forecast by scikit-learn's gradient boosting for each horizon, on the same features and the hour."""
    found = np.empty((len(origins), len(steps)))
    for j, step in enumerate(steps.tolist()):
        X, y = features(c, c.train, step, announced, True), came(c, c.train, steps[j : j + 1])[:, 0]
        there = np.isfinite(y)
        tree = HistGradientBoostingRegressor(max_iter=200, learning_rate=0.05, random_state=0)
        found[:, j] = tree.fit(X[there], y[there]).predict(features(c, origins, step, announced, True))
    return found


PEERS: dict[str, Callable[[Case, Ints, Ints, bool], Floats]] = {
    "persistence": persistence,
    "fixed lag": fixed_lag,
    "the paper's FIR": paper_fir,
    "ARX": arx,
    "gradient boosting": boosting,
}


def with_bands(
    c: Case, peer: Callable[[Case, Ints, Ints, bool], Floats], steps: Ints, announced: bool
) -> Floats:
    """Return quantiles of a peer: its forecast plus the quantiles of its errors.

    The errors are those on the last third of the training days, after a fit to the first two thirds. For the
    test, a regression is fitted to all training days.
    """
    third = len(c.train) // 3
    early = Case(c.name, c.model, c.series, c.train[: -third - 24], c.train[-third:])
    errors = came(c, early.test, steps) - peer(early, early.test, steps, announced)
    middle = peer(c, c.test, steps, announced)
    return np.asarray(middle + np.nanquantile(errors, LEVELS, axis=0)[:, None])


def scores(c: Case, quantiles: Floats, steps: Ints) -> dict[str, Floats]:
    """Return RMSE of the median, CRPS by the five quantiles, and share within the 90 % band, by horizon."""
    truth = came(c, c.test, steps)
    off = truth - quantiles
    level = np.array(LEVELS)[:, None, None]
    pinball = 2.0 * np.where(off > 0.0, level * off, (level - 1.0) * off).mean(axis=0)
    return {
        "RMSE": np.sqrt(np.nanmean(off[2] ** 2, axis=0)),
        "CRPS": np.nanmean(pinball, axis=0),
        "within the 90 % band": np.nanmean(
            np.where(np.isfinite(truth), (off[0] >= 0.0) & (off[4] <= 0.0), np.nan), axis=0
        ),
    }


TIED = 1.02
"""Ratio of RMSE up to which two methods are tied. It is applied to the CRPS too."""


def section(c: Case) -> str:
    """Return the tables of a reach."""
    steps = np.unique(np.maximum(np.round(np.array(HOURS) * HOUR / c.model.sample_time).astype(int), 1))
    hours = [f"{s * c.model.sample_time / HOUR:.3g} h" for s in steps]
    scale, unit = (1e3, "mm") if c.model.kind == "pool" else (1.0, "m3/s")
    text = (
        f"\n## {c.name}\n\n{len(c.test)} origins, response {c.model.model.reach.name}, effects: "
        f"{', '.join(e.name for e in c.model.model.effects) or 'none'}.\n"
    )
    for announced in (False, True):
        found = {"rivid": scores(c, ours(c, steps, announced), steps)}
        for name, peer in PEERS.items():
            found[name] = scores(c, with_bands(c, peer, steps, announced), steps)
        for what, factor in (("RMSE", scale), ("CRPS", scale)):
            best = np.min([one[what] for one in found.values()], axis=0)
            rows = [
                [
                    name,
                    *(
                        f"**{v * factor:.3g}**" if v <= TIED * b else f"{v * factor:.3g}"
                        for v, b in zip(one[what], best, strict=True)
                    ),
                ]
                for name, one in found.items()
            ]
            given = "flows announced" if announced else "flows not announced"
            text += f"\n{what} [{unit}], {given}:\n\n" + table(["", *hours], rows)
        rows = [[name, *(f"{v:.2f}" for v in one["within the 90 % band"])] for name, one in found.items()]
        text += f"\nWithin the 90 % band, {given}:\n\n" + table(["", *hours], rows)
    return text


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="print the river only")
    quick = parser.parse_args().quick
    made = [river] if quick else [lambda: pool("hydraulic", 11), lambda: pool("uneven", 12), river]
    text = "".join(section(one()) for one in made)
    if quick:
        print(text)
    else:
        PAGE.write_text(HEAD.read_text(encoding="utf-8") + text, encoding="utf-8")


if __name__ == "__main__":
    main()
