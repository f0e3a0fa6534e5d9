"""Results for the tests of the report, without findings except for those that a test sets."""

import dataclasses
import datetime as dt

import numpy as np

from rivid.report.attention import attention, counted
from rivid.report.build import write_report
from rivid.report.summary import last_week, summarise
from tests.pages import Page
from tests.plots.synthetic import dates_of, estimator, results, river

SUMMARY = {
    "config": {"reach": {"length": 8200.0, "bed_level": None}, "run": {"estimators": ["jmap"]}},
    "versions": {"rivid": "0.1.0", "numpy": "2.3.4"},
    "d_min": 1,
    "d_max": 15,
    "delay_scale": 6.5,
}
STEADY = [7, 7, 6, 7, 7, 6, 7] * 9
"""Delays of nine equal weeks."""


def write(run, out, figures=(), summary=SUMMARY):
    """Write the page of a run, and return its parsed content."""
    html = write_report(run, figures, out, summary=summary).read_text(encoding="utf-8")
    return html, Page(html)


def simple(delays, status=None, messages=None, name="jmap", start=dt.date(2008, 1, 1), dates=None, **changes):
    """Return results of one estimator with the given delays."""
    n = len(delays)
    e = estimator(name, dates or dates_of(n, start), unanswered=0)
    delays = np.array(delays, float)
    e = dataclasses.replace(
        e,
        delay=delays,
        status=status or ["ok"] * n,
        messages=messages or [""] * n,
        at_bound=(delays == 1) | (delays == 15),
        prior_only=np.zeros(n, bool),
        bound_gravity_s=np.full(n, 1000.0),
    )
    e = dataclasses.replace(e, **changes)
    return dataclasses.replace(results(("jmap",), dates_of(1)), estimators=[e])


def passing(t50, inflow, **changes):
    """Return results of a river with the given t50."""
    n = len(t50)
    run = river(n)
    e = dataclasses.replace(
        run.estimators[0],
        status=["ok"] * n,
        messages=[""] * n,
        t50=np.array(t50, float),
        mean_inflow=np.array(inflow, float),
        bound_gravity_s=np.full(n, 7200.0),
        bound_kinematic_s=np.full(n, 25_200.0),
    )
    return dataclasses.replace(run, estimators=[dataclasses.replace(e, **changes)])


def with_travel(run, fraction):
    """Return the same delays with travel times at this fraction of their samples."""
    e = run.estimators[0]
    e = dataclasses.replace(e, travel_s=(e.delay + fraction) * run.sample_time)
    return dataclasses.replace(run, estimators=[e])


def combined(run, other):
    """Return the estimators of both runs."""
    return dataclasses.replace(run, estimators=run.estimators + other.estimators)


def among(n, part):
    """Return the mask of the last `part` of n days."""
    return np.arange(n) >= n - part


def summary_of(run):
    """Return the summary of a run; `look` counts its days to inspect, `rows` are their rows."""
    recent = last_week(run)
    rows = attention(run, recent)
    look = counted(run, recent, rows) if recent else None
    return summarise(run, recent) | {"look": look, "rows": rows}
