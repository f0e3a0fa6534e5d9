"""Results of `rivid run` on stdout: a few lines of at most 80 columns, or JSON."""

import json
import math
import re
from itertools import groupby
from typing import Any

import click
import numpy as np
import pyarrow.parquet as pq

from rivid.cli.console import abbreviate, wrap
from rivid.config import Config
from rivid.core.hydraulics import SLOW
from rivid.estimators import ESTIMATORS
from rivid.report.summary import (
    SPREAD_OUT,
    LastWeek,
    facts,
    last_week,
    leading,
    reasons,
    stepped,
    torrents,
)
from rivid.results.read import FEW, EstimatorResults, Results, has_t50, leading_response, passage, rounded
from rivid.results.store import brief_results, finite
from rivid.run.run import Options, Summary
from rivid.text import count, delays, duration, probability, samples_first, share, travel_within


def print_summary(summary: Summary, config: Config, options: Options, quiet: bool, is_new: bool) -> None:
    """Print the counts and main numbers of each estimator, and the failed days; with `quiet` only these.

    `is_new` is whether OUT had no results before.
    """
    if options.shard:
        if not quiet:
            click.echo(
                f"shard {options.shard}: {len(summary.asked_keys):,} of {summary.windows:,} data sets, "
                f"{summary.computed:,} estimated now"
            )
            click.echo("when all shards are done, the same command without --shard merges them")
        return
    noun = "data set" if config.run.window else "day"
    if quiet:
        _print_failures(summary, noun)
        return
    text = (
        f"{count(summary.windows, 'data set')}, {summary.computed:,} estimated now, "
        f"{summary.reused:,} done before ({summary.seconds:.1f} s)"
    )
    click.echo(click.style(wrap(f"{abbreviate(config.reach.name)}: {text}"), bold=True))
    results = brief_results(summary.rows, config)
    # a name of more than 14 letters indents its own line only
    width = min(max((len(name) for name in summary.counts), default=0), 14)
    recent = None if config.run.window else last_week(results)  # weeks are of whole days
    for e in results.estimators:
        counts = ", ".join(f"{n:,} {status}" for status, n in summary.counts.get(e.estimator, {}).items())
        click.echo(wrap(f"{e.estimator:<{width}}  {counts}", 2, width + 4))
        moved = _moved(recent, results.sample_time) if recent and e is recent.estimator else []
        for line in [*_numbers(results, e, noun), *moved]:
            click.echo(wrap(line, width + 4))
    if (waves := config.reach.waves) and (doubt := _doubt(results, waves)):
        click.echo(wrap(doubt, 2))
    _print_failures(summary, noun)
    if is_new and not config.run.window:
        click.echo("hint: `rivid check` tests units, clocks and gauge")
    shown = "report.html" if options.figures else "delays.csv"
    click.echo(f"{shown.split('.')[0]}: {summary.out / shown}")
    if config.run.window:
        click.echo("no report and no figures: data sets of [run] window are no days")


def _print_failures(summary: Summary, noun: str) -> None:
    """The data sets that failed in this run, on stderr; consecutive ones of like messages in one line."""
    failed: dict[str, tuple[Any, str]] = {}  # once a day, whatever the number of its estimators
    for row in summary.rows.select(["date", "key", "status", "message"]).to_pylist():
        if row["status"] == "failed" and row["key"] in summary.computed_keys:
            failed.setdefault(row["key"], (row["date"], row["message"]))
    for _, alike in groupby(failed.values(), lambda day: re.sub(r"[\d.,:-]+", "", day[1])):
        days = list(alike)
        first, message = days[0]
        more = f" to {days[-1][0]} ({count(len(days), noun)}), the first" if len(days) > 1 else ""
        line = wrap(f"{first}{more} failed: {message}", 2)
        click.echo(click.style(line, fg="red"), err=True)


def _doubt(results: Results, waves: tuple[float, float]) -> str:
    """The conflict of the flows, or the median delay or t50, with the `waves` of [reach] [s]; "" for none."""
    e, T_s = leading_response(results) or leading(results), results.sample_time
    if e is None:
        return ""
    earliest = passage(results, e).median if has_t50(e).any() else facts(results, e)["median"]
    latest = earliest if has_t50(e).any() else earliest + 1.0
    if (odd := torrents(e)).any():
        days, flow = f"{odd.sum():,} of {count(len(odd), 'day')}", float(np.median(e.mean_inflow[odd]))
        return (
            f"on {days} the mean inflow, {flow:,.0f} m3/s, is too fast for the width and depth in [reach]: "
            "check [input.units] and these"
        )
    takes = f"by [reach] a wave takes {duration(waves)}"
    if (latest + 1.0) * T_s < waves[0] or (earliest - 1.0) * T_s > SLOW * waves[1]:
        return f"{takes}: check length, width, depth, the clocks and [input.stamp]"
    if waves[1] < T_s:
        return f"{takes}, less than a sample: log every {duration([waves[1] / 2.0])} or more often"
    return ""


def _numbers(results: Results, e: EstimatorResults, noun: str) -> list[str]:
    """The delay, its doubts, and a river's t50, of data sets called `noun`."""
    f, T_s, lines = facts(results, e), results.sample_time, []
    if has_t50(e).any():
        p = passage(results, e)
        of = f"80 % of the {noun}s" if p.with_t50 > FEW else f"all {noun}s"
        lines.append(f"t50 {delays([p.median], T_s)}, {of} {duration([p.low * T_s, p.high * T_s])}")
    n, edge, whole = f["with_delay"], f["at_bound"], rounded(results, e)
    if n:
        if f["common_days"] < SPREAD_OUT * n:
            span = travel_within(f["low"], f["high"], T_s, whole)
            lines.append(f"delay {samples_first([f['median']], T_s, whole)}, 80 % of the {noun}s {span}")
        else:
            of = f"{f['common_days']:,} of {count(n, noun)}"
            lines.append(f"delay {samples_first(f['common'], T_s, whole)} on {of}")
        if f["prior_only"]:
            what = "decided by the prior" if ESTIMATORS[e.estimator].rayleigh else "not decided by the data"
            lines.append(f"{what} on {share(f['prior_only'], n)} of the {noun}s")
        if math.isfinite(f["least"]):
            low, median = probability(f["least"]), probability(f["probability"])
            days = f"on the median {noun}, {low} on the least certain"
            lines.append(f"probability {median} (to within 0.1 sample) {days}")
        if edge:
            lines.append(f"at an end of the searched delays on {share(edge, n)} of the {noun}s")
    for reason, times in reasons(e, e.at_bound & np.isnan(e.delay)):
        lines.append(f"outside the searched delays on {count(times, noun)}: {reason}")
    return lines


def _moved(recent: LastWeek, T_s: float) -> list[str]:
    """Return a line with the delay, or t50, now and before, if the report of the run has it moved."""

    def shown(median: float) -> str:
        return samples_first([median], T_s) if recent.quantity == "delay" else duration([median * T_s])

    name = {"t50": "t50", "travel": "travel time"}.get(recent.quantity, "delay")
    if (t := recent.trend) and t["moved"]:
        return [f"{name} moved: {shown(t['now'])} in the last week, {shown(t['before'])} before"]
    if found := stepped(recent):
        return [f"{name} moved: {shown(found[2])} since {found[0]}, {shown(found[1])} before"]
    return []


def print_json(summary: Summary, with_days: bool) -> None:
    """Print a JSON object per row of the days of this run, if `with_days`, and one of the whole run."""
    at = 0  # rows of the table are those of the summary, in the same order
    for batch in pq.ParquetFile(summary.out / "delays.parquet").iter_batches() if with_days else ():
        keys = summary.rows["key"].slice(at, len(batch)).to_pylist()
        at += len(batch)
        for key, row in zip(keys, batch.to_pylist(), strict=True):
            if key in summary.asked_keys:
                row["computed"] = key in summary.computed_keys
                click.echo(json.dumps(finite(row), default=str))
    whole = {
        "out": str(summary.out),
        "data_sets": summary.windows,
        "computed": summary.computed,
        "reused": summary.reused,
        "failed": summary.failures,
        "newly_failed": summary.new_failures,
        "counts": summary.counts,
        "bad_files": summary.bad_files,
        "seconds": round(summary.seconds, 3),
    }
    click.echo(json.dumps({"summary": whole}))
