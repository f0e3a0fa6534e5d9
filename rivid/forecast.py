"""The level or discharge of the next hours, from a calibrated reach and the logs until now.

The reach is simulated through the logs and on, with the flows to come as the logs announce them, else held.
The residual until now gives, by the Kalman filter of the diagnosis, what is unlogged and on its way. How
wrong such a forecast is, and what operators and programme will do, is learnt from the same at earlier times
of the record: for each horizon h

    y(t + h) - y(t) = a f + b g + c (m - y(t)) + d (y(t + h - 24 h) - y(t)) + e r(t) + k + error,

f the simulated change, g the same with the inflow of the day before where none is announced, m the mean
output and r the residual at t; the bands are quantiles of the errors of times that were left out of the fit.
Source: model output statistics, Glahn and Lowry (1972, Journal of Applied Meteorology 11, 1203-1211).
"""

import datetime as dt
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import ndtri

from rivid.config import Config
from rivid.diagnosis.calibrated import SETTLED, ReachModel, reached
from rivid.diagnosis.data import PAST, Record, moves_of, with_activity
from rivid.diagnosis.response.hydraulic import as_far_as_it_goes
from rivid.errors import ConfigError, NoDataError
from rivid.logs.days import find_days, held_means, read_series
from rivid.logs.spec import MICRO, spec_of
from rivid.types import DAY, HOUR, Bools, Floats, Ints

HISTORY = 40
"""Days before the forecast from which its errors are learnt: the weather and programme of a season."""
HINDCASTS = 240
"""Times in them, evenly spread: a 5 % quantile of errors then lies on its twelfth."""
FEWEST = 72
"""Fewest of these from which errors are learnt: twelve for each of six coefficients."""
SETTLE = 6 * HOUR
"""Time before each origin from which the filter learns the weather, beside the travel time [s]."""
ARRIVED = 0.9
"""Share of a river's step response after which water of before the row matters no more."""
LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Quantiles of a forecast."""
FOLDS = 5
"""Parts of the time that are left out in turn."""
RIDGE = 1e-3
"""Share of its own square that is added to each regressor: none is singular."""


@dataclass(frozen=True, eq=False)
class Series:
    """Logs on a grid of n samples, from some days ago until the last horizon; arrays have the shape (n,)."""

    time: Floats  # since the local midnight of `first` [s]
    first: dt.date
    inflow: Floats  # [m3/s], NaN where it is not known
    outflow: Floats  # the same; of a river zero
    output: Floats  # [m or m3/s], NaN where it is missing
    now: int  # index of the origin of the forecast
    begin: dt.datetime  # time of the first sample, in the zone of the log

    def moment(self, index: int) -> dt.datetime:
        """Local time of a sample."""
        later = dt.timedelta(seconds=float(self.time[index] - self.time[0]))
        return (self.begin.astimezone(dt.UTC) + later).astimezone(self.begin.tzinfo)


@dataclass(frozen=True, eq=False)
class Forecast:
    """A forecast of the output at the H samples after the origin."""

    series: Series  #: after the origin with the flows that are announced, then held at their last value
    quantiles: Floats  #: of the output, (5, H), at :data:`LEVELS` [m or m3/s]
    announced: int  #: samples after the origin with logged flows
    learnt: int  #: earlier forecasts from which the bands are learnt; 0: they are those of the noise model
    delay_s: float  #: time in which half of a small wave arrives at the usual flow [s]
    notes: tuple[str, ...] = ()
    #: Inflow of the day before where none is announced, from which the quantiles are learnt beside the held
    #: one, (H,) [m3/s]; None where all flows are announced, or nothing is learnt.
    repeated: Floats | None = None


def read_logs(
    root: Path, config: Config, model: ReachModel, *, hours: float, at: dt.datetime | None = None
) -> tuple[Series, tuple[str, ...]]:
    """The logs that a forecast needs, and the days that were left out, with the reason.

    `root` is DATA_DIR, or one file; `hours` is the longest horizon [h]; `at` is the origin, by default the
    last measured output. Later outputs are not used, later flows are announced. NoDataError where no output
    is logged in the :data:`HISTORY` days before the origin; ConfigError where the configuration is of another
    kind of reach than the model, lacks a pool's outflow, or the model's sample time is no multiple of its.
    """
    reach = config.reach
    many = model.sample_time / reach.sample_time  # a diagnosis joins short samples
    if reach.kind != model.kind or many < 1.0 or abs(many - round(many)) > 1e-9:
        raise ConfigError(
            f"the model is of a {model.kind} at {model.sample_time:g} s, the configuration of a {reach.kind} "
            f"at {reach.sample_time:g} s: expected the configuration of the diagnosis"
        )
    if reach.kind == "pool" and not config.input.u_Qo:
        raise ConfigError('[input] u_Qo = "" marks the outflow as not logged: a forecast of a pool needs it')
    spec, sources = spec_of(config), find_days(root, config).days
    if at is not None:
        sources = [s for s in sources if s.date <= (at + dt.timedelta(hours=hours)).date()]
    for last in reversed(sources):  # the last day with an output; later ones may announce flows
        series, zone, _ = read_series(root, [last], config)
        times = series[spec.output][0]
        if at is not None:
            times = times[times <= at.timestamp() * MICRO]
        if len(times):
            break
    else:
        raise NoDataError(f"{root}: no {spec.output} is logged {f'until {at}' if at else 'at all'}")
    oldest = last.date - dt.timedelta(days=HISTORY)
    series, _, refused = read_series(root, [s for s in sources if s.date >= oldest], config)
    origin = int(times[-1]) if at is None else round(at.timestamp() * MICRO)
    step = round(model.sample_time * MICRO)
    start = min(int(column[0][0]) for column in series.values() if len(column[0]))
    back = min(max(origin - start, 0) // step, round(HISTORY * DAY / model.sample_time))
    ahead = max(round(hours * HOUR / model.sample_time), 1)
    grid = origin + step * np.arange(-back, ahead + 1)
    found = {}
    for signal in spec.signals:
        gap = np.where(grid > origin, 0, spec.max_gap) + signal.spacing  # what is announced has no gaps
        place = _held if signal.held else _between
        column = series[signal.name]
        none = np.full(len(grid), np.nan)
        found[signal.name] = place(column, grid, spec.tolerance, gap) if len(column[0]) else none
    begin = dt.datetime.fromtimestamp(grid[0] / MICRO, zone)
    midnight = dt.datetime(begin.year, begin.month, begin.day, tzinfo=zone)
    output = found[spec.output]
    output[back + 1 :] = np.nan
    made = Series(
        (grid - grid[0]) / MICRO + (begin - midnight).total_seconds(), begin.date(), found["u_Qi"],
        found.get("u_Qo", np.zeros(len(grid))), output, back, begin,
    )  # fmt: skip
    return made, tuple(refused)


def _held(column: tuple[Ints, Floats], grid: Ints, late: int, gap: Ints) -> Floats:
    """A command at each time, its mean where it is logged more often: for no longer than a gap (n,)."""
    times, values = column
    before = times.searchsorted(grid + late, side="right") - 1
    known = (before >= 0) & (grid - times[before] < gap)
    step = int(grid[1] - grid[0])
    if len(times) > 1 and np.median(np.diff(times)) + late < step:
        return np.where(known, held_means(times, values, np.append(grid, grid[-1] + step)), np.nan)
    return np.where(known, values[before], np.nan)


def _between(column: tuple[Ints, Floats], grid: Ints, late: int, gap: Ints) -> Floats:
    """A measured quantity at each time, between neighbours that are no further apart than a gap."""
    times, values = column
    after = np.minimum(times.searchsorted(grid - late), len(times) - 1)
    before = np.maximum(times.searchsorted(grid + late, side="right") - 1, 0)
    known = (times[before] <= grid + late) & (times[after] >= grid - late)
    known &= times[after] - times[before] <= gap
    return np.where(known, np.interp(grid, times, values), np.nan)


def forecast(model: ReachModel, series: Series, *, notes: Sequence[str] = ()) -> Forecast:
    """Forecast the output after the origin of a series of :func:`read_logs`; `notes` go into the result.

    NoDataError where the flows or the output before the origin are not known.
    """
    now, ahead = series.now, len(series.time) - 1 - series.now
    known = np.isfinite(series.inflow) & np.isfinite(series.outflow)
    announced = int(np.argmin(np.append(known[now + 1 :], False)))
    lead = lead_of(model)
    usable = _usable(series, known, lead, ahead)
    if not known[max(now - lead, 0) : now + 1].all() or not np.isfinite(series.output[: now + 1]).any():
        raise NoDataError(
            f"the flows of the {lead * model.sample_time / HOUR:.0f} h before {series.moment(now)} are not "
            "all logged: expected them for the water under way; see `rivid check`"
        )
    past = usable[np.linspace(0, len(usable) - 1, min(HINDCASTS, len(usable))).astype(int)]
    origins = np.append(past, now)
    simulated, X, sd, flows = simulations(model, series, origins, lead, ahead, announced)
    steps = np.arange(1, ahead + 1)
    y0 = _hold(series.output)[origins]
    learns = len(past) >= FEWEST
    if learns:
        target = series.output[past[:, None] + steps] - y0[:-1, None]
        quantiles = learnt_quantiles(X[:-1], target, sd[:-1], X[-1:], sd[-1:])[:, 0]
    else:
        quantiles = simulated[-1] + ndtri(np.array(LEVELS))[:, None] * sd[-1]
        more = f"{len(past)} earlier forecasts: expected {FEWEST} or more to learn from; the bands are"
        notes = (*notes, f"{more} the noise model's, which holds flows to be known")
    later = slice(now + 1, None)
    inflow, outflow = series.inflow.copy(), series.outflow.copy()
    inflow[later], outflow[later] = flows[0][-1], flows[1][-1]
    return Forecast(
        replace(series, inflow=inflow, outflow=outflow), y0[-1] + quantiles, announced,
        len(past) if learns else 0, model.half_time, tuple(notes),
        flows[2][-1] if announced < ahead and learns else None,
    )  # fmt: skip


def lead_of(model: ReachModel) -> int:
    """Samples before an origin that its forecast needs: the water under way, and :data:`SETTLE`."""
    settle = round(SETTLE / model.sample_time)
    if model.kind == "pool":
        return settle + math.ceil(2.0 * model.half_time / model.sample_time)
    up = model.kernels(max(round(SETTLED / model.sample_time), 2))["up"]
    return settle + math.ceil(reached(up, ARRIVED))


def _usable(series: Series, known: Bools, lead: int, ahead: int) -> Ints:
    """Earlier origins with flows before and after them, an output at them, and targets before now."""
    gaps = np.concatenate([[0], np.cumsum(~known)])
    at = np.arange(lead, series.now - ahead + 1)
    at = at[(gaps[at + ahead + 1] == gaps[at - lead]) & np.isfinite(series.output[at])]
    targets = np.lib.stride_tricks.sliding_window_view(np.isfinite(series.output), ahead)[at + 1]
    return np.asarray(at[targets.mean(axis=1) > 0.9])


def run(
    model: ReachModel, series: Series, origins: Ints, lead: int, ahead: int, announced: int, repeat: bool
) -> tuple[Floats, Floats, Floats, tuple[Floats, Floats]]:
    """Simulated change of the output after each origin (m,), by the logs until there and the announced flows.

    The simulation begins `lead` samples before each origin and ends `ahead` samples after it, the flows of
    the first `announced` of which are known. The inflow that is not announced is that of the day before with
    `repeat`, else it is held. Returns, of shape (m, ahead), the expected output less the last measured one
    and its standard deviation by the noise [m or m3/s]; the expected residual after the origin, (m,); and the
    inflow and outflow that were assumed, (m, ahead) [m3/s].
    """
    steps = np.arange(-lead, ahead + 1)
    at = np.maximum(origins[:, None] + steps, 0)
    T, until = model.sample_time, lead + announced
    inflow, outflow, output = (values[at] for values in (series.inflow, series.outflow, series.output))
    output[:, lead + 1 :] = np.nan
    outflow[:, until + 1 :] = outflow[:, until : until + 1]
    if repeat:
        day = round(DAY / T)
        back = day * -(np.minimum(announced - steps, 0) // day)  # whole days, to what is known
        inflow = series.inflow[np.maximum(origins[:, None] + steps - back, 0)]
        inflow = np.where(np.isfinite(inflow), inflow, inflow[:, until : until + 1])
    else:
        inflow[:, until + 1 :] = inflow[:, until : until + 1]
    before = _hold(series.outflow)[np.maximum(at[:, :1] + np.arange(-round(PAST * DAY / T), 0), 0)]
    before = np.where(np.isfinite(before), before, outflow[:, :1])
    time = series.time[0] + (origins[:, None] + steps) * T
    days = (time[:, lead] // DAY).astype(int).tolist()
    record = Record(
        dates=tuple(series.first + dt.timedelta(days=day) for day in days),
        time=time, inflow=inflow, outflow=outflow, output=output, used=np.isfinite(output), lead=lead,
        sample_time=T, kind=model.kind, earlier=moves_of(before),
    )  # fmt: skip
    kernels = model.kernels(time.shape[1])
    record = with_activity(record, kernels["up"], kernels["down"])
    baseline = as_far_as_it_goes(model.model.reach.baseline, record, model.model.changes(record))
    mean, sd = model.noise.ahead(record.output - baseline, record.activity)
    total = _hold(baseline + mean)
    now = _hold(output[:, : lead + 1])[:, -1:]
    later = slice(lead + 1, None)
    return total[:, later] - now, sd[:, later], mean[:, lead + 1], (inflow[:, later], outflow[:, later])


def _hold(rows: Floats) -> Floats:
    """Rows with the last finite value where nothing finite follows."""
    last = np.maximum.accumulate(np.where(np.isfinite(rows), np.arange(rows.shape[-1]), 0), axis=-1)
    return np.take_along_axis(rows, last, axis=-1)


def simulations(
    model: ReachModel, series: Series, origins: Ints, lead: int, ahead: int, announced: int
) -> tuple[Floats, Floats, Floats, tuple[Floats, Floats, Floats]]:
    """Simulated changes (m, ahead), all regressors (m, ahead, 6), standard deviations (m, ahead), and flows.

    Arguments and flows as of :func:`run`, then the inflow of the day before. The regressors are the simulated
    change, that with the inflow of the day before, the distance to the mean, the change of the day before,
    the residual, and 1.
    """
    simulated, sd, left, flows = run(model, series, origins, lead, ahead, announced, repeat=False)
    repeated, before = np.zeros_like(simulated), flows[0]
    if announced < ahead:
        repeated, _, _, (before, _) = run(model, series, origins, lead, ahead, announced, repeat=True)
    day, steps = round(DAY / model.sample_time), np.arange(1, ahead + 1)
    held = _hold(series.output)
    y0 = held[origins]
    mean = float(np.nanmean(series.output[: series.now + 1]))
    ago = origins[:, None] + steps - day * -(-steps // day)  # whole days before, to what is measured
    ended = np.take(held, np.maximum(ago, 0))
    change = np.where((ago >= 0) & np.isfinite(ended), ended - y0[:, None], 0.0)
    away = np.broadcast_to((mean - y0)[:, None], change.shape)
    rest = np.broadcast_to(left[:, None], change.shape)
    X = np.stack([simulated, repeated, away, change, rest, np.ones_like(change)], axis=-1)
    return simulated, X, sd, (*flows, before)


def learnt_quantiles(X: Floats, target: Floats, sd: Floats, at: Floats, sd_at: Floats) -> Floats:
    """Quantiles of the change, shape (5, k, H), by least squares for each horizon from earlier forecasts.

    `X` are their regressors (m, H, 6); `target`, (m, H), is what came, less the output at the origin, NaN
    where it was not measured; `sd`, (m, H), is by the noise: errors are counted in these. Errors are those of
    a fit to the other parts of the time: neighbours in time err alike. `at`, (k, H, 6), and `sd_at`, (k, H),
    are regressors and deviations of the forecasts that are wanted.
    """
    weight = np.where(np.isfinite(target), 1.0 / sd, 0.0)
    A, b = X * weight[..., None], np.where(np.isfinite(target), target, 0.0) * weight
    errors = np.full(target.shape, np.nan)
    for part in np.array_split(np.arange(len(A)), FOLDS):
        rest = np.setdiff1d(np.arange(len(A)), part)
        left = b[part] - np.einsum("mhi,hi->mh", A[part], _solved(A[rest], b[rest]))
        errors[part] = np.where(weight[part] > 0.0, left, np.nan)
    middle = np.einsum("mhi,hi->mh", at, _solved(A, b))
    return np.asarray(middle + np.nanquantile(errors, LEVELS, axis=0)[:, None] * sd_at)


def _solved(A: Floats, b: Floats) -> Floats:
    """Coefficients of least squares with a small ridge for each horizon, (h, k); A is (m, h, k), b (m, h)."""
    gram = np.einsum("mhi,mhj->hij", A, A, optimize=True)
    eye = np.eye(gram.shape[-1])
    gram += (RIDGE * np.einsum("hii->hi", gram)[:, :, None] + 1e-12) * eye
    return np.asarray(np.linalg.solve(gram, np.einsum("mhi,mh->hi", A, b, optimize=True)[..., None])[..., 0])
