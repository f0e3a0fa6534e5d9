"""Synthetic results of a year: the response (10) with noise, and failed days."""

import dataclasses
import datetime as dt
from functools import cache

import numpy as np

from rivid.core.fir import half_time
from rivid.core.hydraulics import travel_bounds
from rivid.plots.draw import draw, jobs
from rivid.results.read import EstimatorResults, Results

T_S = 133.0
ORDER = 30
CANDIDATES = np.arange(1.0, 16.0)
MEASURED = (
    "delay", "t50", "alpha", "noise_sd", "roughness_sd", "condition", "mean_inflow", "bound_gravity_s",
    "bound_kinematic_s",
)  # fmt: skip
"""Columns with one number per day."""


def response(delay, noise, rng, order=ORDER):
    """Return the theoretical response (10), Fig. 10, plus white noise of a size relative to its step."""
    k = np.arange(1, order)
    h = np.zeros(order)
    h[1:] = -1.2e-4 * 0.88 ** (k - 1)
    h[delay + 1 :] += 1e-4 * 0.88 ** (np.arange(delay + 1, order) - delay - 1)
    return h + noise * 1e-4 * rng.standard_normal(order)


def dates_of(n, start=dt.date(2008, 1, 1), missing=0, seed=0):
    """Return consecutive days, less some missing ones (never the first or the last)."""
    days = [start + dt.timedelta(days=i) for i in range(n + missing)]
    gone = np.random.default_rng(seed).choice(np.arange(1, n + missing - 1), missing, replace=False)
    return [day for i, day in enumerate(days) if i not in set(gone.tolist())]


def estimator(name, dates, *, seed=1, unanswered=0.02, noise=0.1):
    """Return the results of an estimator: delays of 6 and 7, some elsewhere, at a bound or from the prior."""
    rng = np.random.default_rng(seed)
    n = len(dates)
    season = np.array([day.timetuple().tm_yday for day in dates])
    inflow = 350 + 200 * np.sin(2 * np.pi * season / 365) + 30 * rng.standard_normal(n)
    bounds = travel_bounds(inflow, length=8200, width=81.6, depth=4.9 + 0.05 * rng.standard_normal(n))
    true = np.where(inflow > 330, 6, 7)
    odd = rng.random(n)
    delay = np.where(odd < 0.03, 15, np.where(odd < 0.08, rng.integers(2, 14, n), true)).astype(float)
    fir = np.array([response(d, noise, rng) for d in true])
    kind = rng.random(n)
    status = np.where(kind < unanswered, "failed", np.where(kind < 2 * unanswered, "unidentifiable", "ok"))
    messages = {"failed": "u_Qi has a gap of 3 h: longer than max_gap", "unidentifiable": "u does not move"}
    if name == "jmap-degenerate":
        status = np.where(status == "ok", "degenerate", status)
    if n > 3:
        status[-1] = "pending"
    gone = ~np.isin(status, ["ok", "degenerate"])
    with_delay = name not in ("ml", "map")
    nan = np.full(n, np.nan)

    def answered(values):
        return np.where(gone, np.nan, values)

    delay = answered(delay) if with_delay else nan
    fir[gone] = np.nan
    return EstimatorResults(
        estimator=name,
        dates=list(dates),
        status=[str(s) for s in status],
        messages=[messages.get(str(s), "") for s in status],
        delay=delay,
        at_bound=(delay == 1) | (delay == 15),
        prior_only=(rng.random(n) < 0.1) & np.isfinite(delay) & (name != "jmap-degenerate"),
        t50=nan,
        fir=fir,
        candidates=CANDIDATES if with_delay else np.empty(0),
        criterion=np.zeros((n, 15 if with_delay else 0)),
        alpha=answered(1e4 * np.ones(n)) if with_delay else nan,
        noise_sd=answered(0.004 * np.ones(n)),
        roughness_sd=answered(4e-5 * np.ones(n)) if with_delay else nan,
        condition=answered(10 ** rng.uniform(4.2, 5.0, n)),
        mean_inflow=np.where(status == "failed", np.nan, inflow),
        bound_gravity_s=np.where(status == "failed", np.nan, bounds.gravity),
        bound_kinematic_s=np.where(status == "failed", np.nan, bounds.kinematic),
    )


def results(names=("ml", "jmap"), dates=None, **kwargs):
    """Return a run of several estimators; 332 days of 2008 by default."""
    dates = dates_of(332, missing=34) if dates is None else dates
    noise = {"ml": 0.4}
    made = [estimator(name, dates, noise=noise.get(name, 0.05), **kwargs) for name in names]
    return Results("basse_isere", T_S, "m", 6.5, made)


REASON = "the likeliest delay is right with a probability below 0.7"


def probable(n=30, unsure=(3, 4, 20), unseen=(9,)):
    """Return days of delays 6 and 7 with p(d | y) on three candidates; some uncertain or without a front."""
    rng = np.random.default_rng(8)
    e = estimator("posterior", dates_of(n), unanswered=0)
    delay = rng.integers(6, 8, n).astype(float)
    p = np.zeros((n, len(CANDIDATES)))
    for i, d in enumerate(delay.astype(int)):
        share = 0.55 if i in unsure else rng.uniform(0.75, 0.999)
        p[i, [d - 1, d, d - 2]] = share, 0.8 * (1 - share), 0.2 * (1 - share)
    right = p.max(axis=1)
    low, high = delay - (right < 0.8), delay + (right < 0.9)
    status, messages = ["ok"] * n, [""] * n
    for days, reason in ((unsure, REASON), (unseen, "no front is seen")):
        for i in days:
            status[i], messages[i] = "unidentifiable", reason
    p[list(unseen)] = right[list(unseen)] = np.nan
    gone = np.array([s != "ok" for s in status])
    fir, delay = e.fir.copy(), np.where(gone, np.nan, delay)
    fir[gone] = np.nan
    nothing = np.full(n, np.nan)
    e = dataclasses.replace(
        e, status=status, messages=messages, delay=delay, fir=fir, probability=right, delay_low=low,
        fir_sd=np.where(gone[:, None], np.nan, 1e-5) * np.ones_like(fir), delay_high=high, criterion=p,
        at_bound=np.zeros(n, bool), prior_only=np.zeros(n, bool), alpha=nothing, noise_sd=nothing,
        roughness_sd=nothing, condition=nothing, bound_gravity_s=np.full(n, 1000.0),
    )  # fmt: skip
    return dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[e])


def searched(n=120, at_edges=0.6, name="direct"):
    """Return a year of a search: no impulse response, and most days at the bounds."""
    e = estimator(name, dates_of(n), unanswered=0)
    rng = np.random.default_rng(3)
    delay = np.where(rng.random(n) < at_edges, rng.choice([1.0, 15.0], n), rng.integers(2, 15, n))
    nothing = np.full(n, np.nan)
    e = dataclasses.replace(
        e, status=["ok"] * n, messages=[""] * n, delay=delay, at_bound=(delay == 1) | (delay == 15),
        prior_only=np.zeros(n, bool), fir=np.empty((n, 0)), alpha=nothing, roughness_sd=nothing,
        condition=nothing,
    )  # fmt: skip
    return dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[e])


def without_answers(run):
    """Return the same days, all failed, as in the tables of a run: no response and no candidate."""
    made = []
    for e in run.estimators:
        n = len(e.dates)
        missing = dict.fromkeys(MEASURED, np.full(n, np.nan))
        none = {"at_bound": np.zeros(n, bool), "prior_only": np.zeros(n, bool), "candidates": np.empty(0)}
        tables = {"fir": np.empty((n, 0)), "criterion": np.empty((n, 0))}
        status = {"status": ["failed"] * n, "messages": ["no sample"] * n}
        made.append(dataclasses.replace(e, **status, **missing, **none, **tables))
    return dataclasses.replace(run, estimators=made)


def river(n=40, names=("map", "jmap")):
    """Return a river reach sampled every 15 min with a smooth response about lag 26, earlier at high flow.

    The jump delay of the JMAP is anywhere on the rise, among 60 candidates.
    """
    made = []
    for name in names:
        base = estimator(name, dates_of(n), seed=2)
        rng = np.random.default_rng(5)
        centre = 26 * (base.mean_inflow / 350) ** -0.35
        k = np.arange(120)
        fir = np.exp(-0.5 * ((k - centre[:, None]) / 5) ** 2) / (5 * np.sqrt(2 * np.pi))
        fir += 0.0005 * rng.standard_normal(fir.shape)
        fir[~base.answered] = np.nan
        jump = np.clip(np.round(centre - 2 + 4 * rng.standard_normal(n)), 1, 60)
        delay = np.where(np.isfinite(base.delay), jump, np.nan)
        with_delay = base.candidates.size > 0
        made.append(dataclasses.replace(
            base, delay=delay, t50=half_time(fir), fir=fir, at_bound=delay == 60,
            prior_only=base.answered & (rng.random(n) < 0.5) & with_delay,
            candidates=np.arange(1.0, 61.0) if with_delay else np.empty(0),
            criterion=np.zeros((n, 60 if with_delay else 0)),
            bound_gravity_s=np.where(np.isnan(base.mean_inflow), np.nan, 7000.0),
            bound_kinematic_s=26_000 * (base.mean_inflow / 300) ** -0.4,
        ))  # fmt: skip
    return Results("lees_ferry", 900.0, "m3/s", 24.5, made)


def probable_river(n=40):
    """Return a river with the delays of the JMAP and of posterior, of which d is t50 rounded."""
    run = river(n, ("jmap",))
    e = run.estimators[0]
    delay, sure = np.floor(e.t50 + 0.5), np.where(np.isfinite(e.t50), 0.6, np.nan)
    e = dataclasses.replace(
        e, estimator="posterior", delay=delay, probability=sure, delay_low=delay - 1, delay_high=delay + 1,
        travel_s=900.0 * e.t50, half_s=900.0 * e.t50, at_bound=np.zeros(n, bool),
        prior_only=np.zeros(n, bool),
    )  # fmt: skip
    return dataclasses.replace(run, estimators=[*run.estimators, e])


@cache
def cases():
    """Return records of every length, and records without results."""
    week = results(("jmap",), dates_of(7))
    return {
        "one day": results(("ml", "jmap"), dates_of(1), unanswered=0),
        "a week": week,
        "twelve days over new year": results(("jmap-uniform",), dates_of(12, dt.date(2023, 12, 26))),
        "a year": results(("ml", "map", "jmap", "jmap-degenerate")),
        "five years": results(("jmap",), dates_of(1700, dt.date(2016, 5, 20), missing=126)),
        "all days failed": without_answers(week),
        "a river": river(),
        "a river, one day": river(1),
        "a river, a year": river(332, ("jmap", "ml")),
        "a river, all days failed": without_answers(river(7)),
        "probabilities": probable(400, unsure=(0, 399), unseen=()),
        "long names": dataclasses.replace(
            results(("jmap-uniform-estimated",), dates_of(60)), reach="a_reach_with_$a_long$_name_" * 3
        ),
    }


def draw_all(run, out):
    """Draw all figures of a run in OUT/figures."""
    drawn = [draw(run, job, out / "figures") for job in jobs(run)]
    return [file for file in drawn if file is not None]
