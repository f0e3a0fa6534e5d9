"""The summary of a run as numbers, dates and codes: pages and the terminal word it.

One week is one observation: its days share weather, flow and programme, so that a test that counts days
finds moves in records without any (:func:`trend`).
"""

import datetime as dt
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from rivid.core.hydraulics import SLOW
from rivid.estimators import ESTIMATORS
from rivid.results import read
from rivid.results.read import EstimatorResults, Results
from rivid.text import NO_ANSWER, spans
from rivid.types import Bools, Floats, Ints

WEEK = 7  # days of a week; the last week ends with the record
WEEKS = 8  # weeks before the last one to compare it with: about a season of flow and programme
FEWEST_DAYS = 3  # a week with fewer decided days is left out: a trimmed mean of two is no mean
FEWEST_WEEKS = 4  # weeks before the last one for a test: with three, Student's t would need a factor of 9.9
LEVEL = 0.01  # two-sided level of the test for a move: one false alarm in two years of weeks
LIMITS = {4: 5.841, 5: 4.604, 6: 4.032, 7: 3.707, 8: 3.499}
"""Two-sided limits of Student's t at :data:`LEVEL`, with one degree of freedom less than the number of weeks
before. A table, since scipy.stats takes longer to load than a page to write."""
STEP_DAYS, STEP_LIMIT = 5, 20.0
"""Fewest days on each side of a step, and limit of its statistic: of simulated records with outliers on 5 %
of the days and a correlation from day to day of 0 to 0.5 (0.8), 0 to 1.5 % (2 to 4 %) exceed it."""
LONG = 1.5
"""Ratio of travel time and gravity wave in a pool from which the geometry or a clock is in doubt: the wave
takes as long in less than half of the depth."""
SPREAD_OUT = 0.5  # with a smaller share of days at the two commonest delays, a range describes them better
MOST_REASONS = 3  # reasons of unidentifiable days that are listed; the table of days has all
LITTLE = 0.25  # a river's jump delay is called of little use where the prior decides a larger share of days
OFTEN = 1 / 3  # the headline mentions the prior where it decides this share of the days or more


@dataclass(frozen=True)
class LastWeek:
    """The last week of the estimator that represents the reach, and n days of its record."""

    estimator: EstimatorResults
    quantity: str  # t50, travel (travel times with their fraction) or delay (d)
    values: Floats  # of every day [samples], (n,); NaN where there is none
    decided: Bools  # days with a value that the data decide (not prior_only, not degenerate), (n,)
    week: Bools  # days of the last week, (n,)
    first: dt.date  # its ends; the record may have begun later
    last: dt.date
    median: float  # of the week [samples], NaN without a value
    trend: dict[str, Any] | None  # of :func:`trend`

    @property
    def whole(self) -> bool:
        """Whether the record is no longer than a week."""
        return self.estimator.dates[0] >= self.first

    @property
    def given(self) -> Bools:
        """Days of the last week with a value, shape (n,)."""
        return np.asarray(self.week & np.isfinite(self.values))

    @property
    def by_prior(self) -> int:
        """Days of the last week with a value that the data do not decide."""
        return int((self.given & ~self.decided).sum())


def facts(results: Results, estimator: EstimatorResults) -> dict[str, Any]:
    """Count and condense the rows of one estimator over the record; NaN where there is no number.

    Delays are in samples: the one or two most frequent in order (`common`), and 80 % of the days from `low`
    to `high`. `condition`, `noise_sd` [output unit] and `alpha` [(m3/s)^2] are medians of the answered days,
    `probability` and `least` the median and the lowest of the delays.
    """
    e, days = estimator, read.found(estimator)
    values, times = np.unique(e.delay[days], return_counts=True)
    top = np.argsort(-times, kind="stable")[:2]
    sure = np.empty(0) if e.probability is None else e.probability[days]
    tails = np.quantile(e.delay[days], (0.1, 0.9), method="inverted_cdf") if days.any() else (np.nan, np.nan)
    return {
        "days": len(e.dates),
        "answered": int(e.answered.sum()),
        "with_delay": int(days.sum()),
        "common": tuple(sorted(float(v) for v in values[top])),
        "common_days": int(times[top].sum()),
        "median": _median(e.delay[days]),
        "low": float(tails[0]),
        "high": float(tails[1]),
        "at_bound": int((e.at_bound & days).sum()),
        "prior_only": int((e.prior_only & days).sum()),
        "degenerate": e.status.count("degenerate"),
        "too_fast": int(impossible(results, e)[0].sum()),
        "condition": _median(e.condition[e.answered]),
        "noise_sd": _median(e.noise_sd[e.answered]),
        "alpha": _median(e.alpha[e.answered]),
        "probability": _median(sure),
        "least": float(sure.min()) if sure.size else float("nan"),
    }


def _median(values: Floats) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")


def leading(results: Results) -> EstimatorResults | None:
    """Return the first estimator of the highest rank among those with a delay, or else the first at all."""
    having = [e for e in results.estimators if e.dates]
    with_delay = [e for e in having if read.estimates_delay(e)]
    return max(with_delay or having[:1], key=lambda e: ESTIMATORS[e.estimator].represents, default=None)


def last_week(results: Results) -> LastWeek | None:
    """Return the last week of a river's t50, or of a pool's delay; None where no estimator gives any."""
    river = read.leading_response(results)
    e = river or leading(results)
    if e is None or (river is None and not read.estimates_delay(e)):
        return None
    quantity, values = _lags(results, e, "t50" if river else "delay")
    sound = np.isfinite(values) & (read.has_t50(e) if river else read.decided(e))
    ago = weeks_ago(e.dates)
    last = e.dates[-1]
    return LastWeek(
        estimator=e, quantity=quantity, values=values, decided=sound, week=ago == 0,
        first=last - dt.timedelta(days=WEEK - 1), last=last, median=_median(values[ago == 0]),
        trend=trend(values[sound], ago[sound]),
    )  # fmt: skip


def _lags(results: Results, e: EstimatorResults, quantity: str) -> tuple[str, Floats]:
    """The t50, or what is known best of the delay: its name, and the lags [samples], (n,); NaN for none."""
    if quantity == "t50":
        values, days = e.t50, read.has_t50(e)
    elif e.travel_s is not None:
        quantity, values, days = "travel", e.travel_s / results.sample_time, read.found(e)
    else:
        quantity, values, days = "delay", e.delay, read.found(e)
    return quantity, np.where(days, values, np.nan)


def weeks_ago(dates: Sequence[dt.date]) -> Ints:
    """Return how many weeks before the last one each day lies, shape (n,); 0 in the last week."""
    days = read.day_numbers(dates).astype(np.int64)
    return np.asarray((days[-1] - days) // WEEK)


def trend(values: Floats, ago: Ints) -> dict[str, Any] | None:
    """Test whether the delay has moved: the last week against up to eight weeks before it.

    A week is the mean of its days without the lowest and the highest, so that one day at a bound moves no
    week. The delay has moved where the median of the last week lies outside those of all weeks before, and
    Student's t of a new observation is beyond its two-sided 1 % limit. The variance of weeks is not taken
    below the one that their days would give if they were independent.

    `values`, shape (n,), are those of the decided days [samples], `ago` their weeks before the last one. None
    with fewer than three days in the last week, or fewer than four weeks before that have three; otherwise
    medians [samples] of the last week (`now`), of all days `before`, and the lowest and highest of the weeks
    before (`low`, `high`).

    Simulated with delays that are correlated from day to day by 0 to 0.8, its size is 0.2 to 1.6 %, and a
    move of one sample (two) is found in 45 to 14 % (98 to 63 %) of the records. Counting the days outside the
    band of the year before, as if they were independent, exceeds its level twelvefold.
    """
    count = np.bincount(ago, minlength=WEEKS + 1)[: WEEKS + 1]
    weeks = np.flatnonzero(count >= FEWEST_DAYS)
    if not len(weeks) or weeks[0] != 0 or len(weeks) <= FEWEST_WEEKS:
        return None
    whole = [values[ago == w] for w in weeks]
    # without the lowest and the highest, where that leaves three
    middles = [np.sort(days)[1:-1] if days.size >= FEWEST_DAYS + 2 else days for days in whole]
    means = np.array([days.mean() for days in middles])
    medians = np.array([np.median(days) for days in whole])
    K = len(weeks) - 1
    among = float(means[1:].var(ddof=1))
    spread = sum(float(days.size * days.var()) for days in middles) / sum(days.size - 1 for days in middles)
    alone = spread / count[weeks]  # the variance of a week's mean, were its days independent
    error = float(np.sqrt(max(among, alone[1:].mean()) / K + max(among, alone[0])))
    change = float(means[0] - means[1:].mean())
    low, high = float(medians[1:].min()), float(medians[1:].max())
    return {
        "now": float(medians[0]),
        "before": float(np.median(np.concatenate(whole[1:]))),
        "low": low,
        "high": high,
        "days": int(count[0]),
        "weeks": K,
        "t": change / error if error > 0 else float(np.copysign(np.inf, change)) if change else 0.0,
        "moved": not low <= medians[0] <= high and abs(change) > LIMITS[K] * error,
    }


def step(values: Floats, flow: Floats, day: Floats) -> int | None:
    """Return the place of a step in a series of delays, or None without one.

    The statistic is the largest reduction of the squared error by a step, beside a constant and the logarithm
    of the flow, over the variance of what remains, inflated by its correlation from day to day. Four fifths
    of the days on one side must lie beyond four fifths of the other side: outliers make no step.
    `values` [samples], `flow` [m3/s] and `day` [days] have shape (n,).
    """
    n = len(values)
    if n < 2 * STEP_DAYS:
        return None
    known = np.column_stack([np.ones(n), np.log(np.maximum(flow, 1e-9))])
    both = np.column_stack([np.tril(np.ones((n, n)))[:, STEP_DAYS : n - STEP_DAYS + 1], values])
    both -= known @ np.linalg.lstsq(known, both, rcond=None)[0]  # a flow that rests is no second column
    steps, left = both[:, :-1], both[:, -1]
    size = np.maximum((steps * steps).sum(axis=0), 1e-9)
    best = int(np.argmax((steps.T @ left) ** 2 / size))
    along = float(steps[:, best] @ left)
    left = left - steps[:, best] * along / size[best]
    square = max(float(left @ left), 1e-3 * n)  # travel times have tenths of a sample
    memory = max(float((left[1:] * left[:-1])[np.diff(day) == 1].sum()) / square, 0.0)
    memory = min(memory + 2.0 * (1.0 + 3.0 * memory) / n, 0.95)  # its estimate is low by so much
    statistic = along**2 / size[best] * (n - 3) / square * (1.0 - memory) / (1.0 + memory)
    before, after = values[: best + STEP_DAYS], values[best + STEP_DAYS :]
    (low, high), (lower, upper) = np.quantile(before, (0.2, 0.8)), np.quantile(after, (0.2, 0.8))
    return best + STEP_DAYS if statistic > STEP_LIMIT and (lower > high or upper < low) else None


def stepped(recent: LastWeek) -> tuple[dt.date, float, float] | None:
    """Return the date of a :func:`step` in the last nine weeks and the medians on both sides [samples]."""
    e = recent.estimator
    used = np.flatnonzero(recent.decided & (weeks_ago(e.dates) <= WEEKS) & np.isfinite(e.mean_inflow))
    values = recent.values[used]
    place = step(values, e.mean_inflow[used], read.day_numbers(e.dates)[used])
    if place is None:
        return None
    return e.dates[used[place]], _median(values[:place]), _median(values[place:])


def impossible(results: Results, estimator: EstimatorResults, quantity: str = "delay") -> tuple[Bools, Bools]:
    """Return the days with an arrival that the geometry excludes: too fast and too slow, each of shape (n,).

    Too fast is more than a sample before the gravity wave, too slow more than a sample after
    :data:`rivid.core.hydraulics.SLOW` travel times of the wave that carries the signal. The arrival is t50
    where that is the `quantity`, else the travel time, or all that d allows.
    """
    T_s, (known, lag) = results.sample_time, _lags(results, estimator, quantity)
    latest = lag + 1 if known == "delay" else lag
    fast = (latest + 1) * T_s < estimator.bound_gravity_s
    return fast, (lag - 1) * T_s > SLOW * _wave(results, estimator)


def _wave(results: Results, e: EstimatorResults) -> Floats:
    """Travel time [s] of the wave that carries the signal, gravity in a pool, kinematic in a river; (n,)."""
    return e.bound_gravity_s if results.output_unit == "m" else e.bound_kinematic_s


def torrents(e: EstimatorResults) -> Bools:
    """Return the days with a flow that has no travel time (5), of shape (n,): its Froude number is 2 or more.

    Where no geometry is configured all days are such.
    """
    return np.isfinite(e.mean_inflow) & ~np.isfinite(e.bound_gravity_s)


def _ends(values: Floats) -> tuple[float, float] | None:
    """Lowest and highest finite value."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else None


def missing(dates: Sequence[dt.date]) -> list[dt.date]:
    """Return the days between the first and the last that have no row: no log of them exists."""
    return [a + dt.timedelta(days=k) for a, b in pairwise(dates) for k in range(1, (b - a).days)]


def summarise(results: Results, recent: LastWeek | None) -> dict[str, Any]:
    """Condense a run and its last week into one record of numbers, dates and codes.

    Its parts are None where there is nothing to report. Lags are in samples, bounds in seconds.
    """
    lead, river = leading(results), read.leading_response(results)
    dates = sorted({date for e in results.estimators for date in e.dates})
    gone = missing(dates)
    return {
        "assumed": results.assumed,
        "first": dates[0] if dates else None,
        "last": dates[-1] if dates else None,
        "days": len(dates),
        "missing": len(gone),
        "no_log": spans(gone),
        "now": _now(results, recent) if recent else None,
        "moved": _moved(recent) if recent and np.isfinite(recent.values).any() else None,
        "prior": _prior(results, recent, lead) if recent and lead else None,
        "waves": _waves(results, recent) if recent else None,
        "record": _record(results, lead) if lead else None,
        "passage": _passage(results, river, lead) if river and lead else None,
    }


def reasons(e: EstimatorResults, days: Bools, most: int | None = None) -> list[tuple[str, int]]:
    """Return the first remark on each of these days, (n,), and how often it stands, the commonest first."""
    first = (text.split("; ")[0] for text, day in zip(e.messages, days, strict=True) if day)
    return Counter(first).most_common(most)


def _statuses(status: Sequence[str]) -> dict[str, int]:
    """Days without an answer by status, the gravest first."""
    return {name: n for name in NO_ANSWER if (n := list(status).count(name))}


def _now(results: Results, recent: LastWeek) -> dict[str, Any]:
    e, given = recent.estimator, recent.given
    finite = np.flatnonzero(np.isfinite(recent.values))
    tried = read.candidates(e)
    d = _median(e.delay[given])
    code, asked = "given", np.zeros(len(e.dates), bool)
    if set(e.status) == {"pending"}:
        code = "pending"
    elif not finite.size:
        code, asked = "none", ~asked
    elif not given.any():
        code, asked = "none_in_week", recent.week
    interval = None
    if given.any() and e.delay_low is not None and e.delay_high is not None:
        below, above = (0.5, 0.5) if recent.quantity == "t50" else (0.0, 1.0)  # a t50 is rounded, a d cut off
        interval = _median(e.delay_low[given]) - below, _median(e.delay_high[given]) + above
    why = [(text, n) for text, n in reasons(e, asked) if text and 2 * n > asked.sum()]
    fast, slow = (2 * int((days & given).sum()) for days in impossible(results, e, recent.quantity))
    return {
        "code": code,
        "quantity": recent.quantity,
        "first": max(recent.first, e.dates[0]),
        "rows": len(e.dates),
        "days": int(recent.week.sum()),
        "given": int(given.sum()),
        "by_prior": recent.by_prior,
        "judged": recent.quantity != "t50" and not ESTIMATORS[e.estimator].unchecked,
        "delay": d,
        "range": _ends(recent.values[given]),
        "interval": interval if interval and np.isfinite(interval).all() else None,
        "statuses": _statuses([s for s, day in zip(e.status, asked, strict=True) if day]),
        "reason": why[0] if why else None,
        "latest": (e.dates[finite[-1]], float(recent.values[finite[-1]])) if finite.size else None,
        "at_end": recent.quantity != "t50" and tried.size > 2 and d in (tried[0], tried[-1]),
        "fast": bool(given.any() and fast >= given.sum()),
        "slow": _ends(_wave(results, e)[given]) if given.any() and slow >= given.sum() else None,
    }


def _moved(recent: LastWeek) -> dict[str, Any]:
    """The test, or why there is none.

    Without a move, the last week is the `same` as the weeks before, lies within their `scatter`, or lies
    `outside` their medians, though not by enough for the test.
    """
    t, e = recent.trend, recent.estimator
    ago = weeks_ago(e.dates)
    days = np.bincount(ago[recent.decided], minlength=WEEKS + 1)[: WEEKS + 1]
    undecided = (ago <= WEEKS) & np.isfinite(recent.values) & ~recent.decided
    since = None if t is not None and t["moved"] else stepped(recent)
    flow = np.isfinite(e.mean_inflow)
    inflow = [e.mean_inflow[flow & span] for span in (ago == 0, (ago > 0) & (ago <= WEEKS))]
    if t is not None:
        inside = t["low"] <= t["now"] <= t["high"]
        code = "same" if t["now"] == t["before"] else "scatter" if inside else "outside"
        code = "moved" if t["moved"] else code
    elif recent.whole:
        code = "one_week"
    else:
        code = "few_days" if days[0] < FEWEST_DAYS else "few_weeks"
    return {
        "code": code,
        "trend": t,
        "since": since[0] if since else None,
        "sides": since[1:] if since else None,
        "days": int(days[0]),
        "weeks": min(int(ago.max()), WEEKS),
        "weeks_used": int((days[1:] >= FEWEST_DAYS).sum()),
        "fewest_days": FEWEST_DAYS,
        "fewest_weeks": FEWEST_WEEKS,
        "decided_only": bool(undecided.any()),
        "not_judged": recent.quantity != "t50" and ESTIMATORS[e.estimator].unjudged,
        "inflow": [float(part.mean()) for part in inflow] if all(part.size for part in inflow) else None,
    }


def _prior(results: Results, recent: LastWeek, lead: EstimatorResults) -> dict[str, Any] | None:
    """The number of days that the prior, or chance, decides; or the probabilities of the delays."""
    e, given = recent.estimator, recent.given
    n = int(given.sum())
    if recent.quantity == "t50" and not ESTIMATORS[e.estimator].has_probability:
        part: dict[str, Any] = {"code": "response", "jump": read.estimates_delay(e), "lead": None}
        if read.estimates_delay(lead) and not ESTIMATORS[lead.estimator].unchecked:
            f = facts(results, lead)
            if f["with_delay"]:
                part |= {"lead": lead.estimator, "record": (f["prior_only"], f["with_delay"])}
        return part | {"rayleigh": ESTIMATORS[lead.estimator].rayleigh, "decides": None}
    f = facts(results, e)
    if not f["with_delay"]:
        return None
    decides = None
    if recent.by_prior and recent.by_prior >= OFTEN * n:
        decides = ("week", recent.by_prior, n)
    elif f["prior_only"] and f["prior_only"] >= OFTEN * f["with_delay"]:
        decides = ("record", f["prior_only"], f["with_delay"])
    part = {
        "code": "prior",
        "rayleigh": ESTIMATORS[e.estimator].rayleigh,
        "week": None if recent.whole or not n else (recent.by_prior, n),
        "record": (f["prior_only"], f["with_delay"]),
        "decides": decides,
    }
    if ESTIMATORS[e.estimator].unjudged:
        part["code"] = "not_judged"
    elif e.probability is not None:
        sure = e.probability[given if n else np.isfinite(recent.values)]
        part |= {"code": "probability", "of": "week" if part["week"] else "record"}
        part |= {"median": float(np.median(sure)), "least": float(sure.min())}
    return part


def _waves(results: Results, recent: LastWeek) -> dict[str, Any] | None:
    """The gravity wave on the days of the last value, the days that are faster, and the answer over it."""
    if results.assumed:
        return {"code": "assumed"}
    given = recent.given if recent.given.any() else np.isfinite(recent.values)
    gravity = _ends(recent.estimator.bound_gravity_s[given])
    fast = int((impossible(results, recent.estimator, recent.quantity)[0] & given).sum())
    odd = torrents(recent.estimator) & given
    if not odd.any() and (gravity is None or (recent.quantity == "t50" and not fast)):
        return None
    middle = recent.values + (0.5 if recent.quantity == "delay" else 0.0)
    ratio = _median((middle * results.sample_time / recent.estimator.bound_gravity_s)[given])
    slow = recent.quantity != "t50" and ratio > LONG
    days = int(given.sum())
    flow = _median(recent.estimator.mean_inflow[odd])
    return {
        "code": "given", "gravity": gravity, "fast": fast, "days": days, "ratio": ratio, "slow": slow,
        "torrents": int(odd.sum()), "flow": flow,
    }  # fmt: skip


def doubted(results: Results, recent: LastWeek) -> str:
    """Return whether the report puts the last answers in doubt as too "fast" or too "slow"; else ""."""
    now, waves = _now(results, recent), _waves(results, recent) or {}
    return "fast" if now["fast"] else "slow" if now["slow"] or waves.get("slow") else ""


def _record(results: Results, e: EstimatorResults) -> dict[str, Any]:
    f, tried = facts(results, e), read.candidates(e)
    ends = (float(tried[0]), float(tried[-1])) if tried.size else None
    unknown = np.array([status == "unidentifiable" for status in e.status])
    days = read.found(e)
    record: dict[str, Any] = {
        "estimator": e.estimator,
        "facts": f,
        "first": e.dates[0],
        "fir_only": not read.estimates_delay(e),
        "ends": ends,
        "piled": f["common"] == ends and tried.size > 2 and f["common_days"] >= SPREAD_OUT * f["with_delay"],
        "spread": f["common_days"] < SPREAD_OUT * f["with_delay"],
        "travel_s": _median(e.travel_s[days]) if e.travel_s is not None else None,
        "half_s": _median(e.half_s[days]) if e.half_s is not None else None,
        "statuses": _statuses(e.status),
        "reasons": reasons(e, unknown, MOST_REASONS) if ESTIMATORS[e.estimator].has_probability else [],
        "gravity": _ends(e.bound_gravity_s[days]),
        "kinematic": _ends(e.bound_kinematic_s[days]) if results.output_unit != "m" else None,
    }
    if ESTIMATORS[e.estimator].rayleigh and f["with_delay"]:
        p = read.rayleigh(tried, results.delay_scale)
        modes = tried[p > 0.99 * p.max()]  # for 6.5 samples, 6 and 7 differ by less than the paper's digits
        record["modes"] = [float(d) for d in modes]
        record["near_prior"] = min(float(np.abs(modes - d).min()) for d in f["common"]) <= 1
        others = [other for other in results.estimators if ESTIMATORS[other.estimator].uniform]
        uniform = ((other.estimator, facts(results, other)) for other in others)
        record["uniform"] = next((one for one in uniform if one[1]["with_delay"]), None)
    return record


def _passage(results: Results, e: EstimatorResults, lead: EstimatorResults) -> dict[str, Any]:
    p, f = read.passage(results, e), facts(results, lead)
    return {
        "estimator": e.estimator,
        "numbers": p,
        "first": e.dates[0],
        "statuses": _statuses(e.status),
        "no_sum": int((e.answered & ~np.isfinite(e.t50)).sum()),
        "gravity": _ends(e.bound_gravity_s[read.has_t50(e)]),
        "kinematic": _ends(e.bound_kinematic_s[read.has_t50(e)]),
        "jump_of_little_use": f["prior_only"] >= LITTLE * f["with_delay"]
        or f["high"] - f["low"] > 2 * (p.high - p.low),
    }
