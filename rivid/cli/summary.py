"""Results of `rivid run` on stdout: a few lines of at most 80 columns, or JSON."""

import json
import re
from itertools import groupby
from typing import Any

import click
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from rivid.cli.console import abbreviate, wrap
from rivid.config import Config
from rivid.estimators import ESTIMATORS
from rivid.results.tables import finite
from rivid.run.plan import Options
from rivid.run.run import Summary
from rivid.text import count, duration, number, probability, samples_first, share
from rivid.types import Floats

NAME_WIDTH = 14
"""Most columns of an estimator's name; a longer name indents its own line only."""


def print_summary(summary: Summary, config: Config, options: Options, quiet: bool) -> None:
    """Print the counts and main numbers of each estimator, and the days that failed in this run.

    With `quiet`, only the failed days are printed. Of a shard, the number of days estimated.
    """
    if options.shard:
        if not quiet:
            click.echo(
                f"shard {options.shard}: {len(summary.asked_keys):,} of {summary.windows:,} data sets, "
                f"{summary.computed:,} estimated now"
            )
            click.echo("when all shards are done, the same command without --shard merges them")
        return
    if not quiet:
        text = (
            f"{count(summary.windows, 'data set')}, {summary.computed:,} estimated now, "
            f"{summary.reused:,} done before ({summary.seconds:.1f} s)"
        )
        click.echo(click.style(wrap(f"{abbreviate(config.reach.name)}: {text}"), bold=True))
        names = summary.rows["estimator"].to_numpy(zero_copy_only=False)
        width = min(max((len(name) for name in summary.counts), default=0), NAME_WIDTH)
        for name, counts in summary.counts.items():
            numbers = _numbers(name, summary.rows.filter(names == name), config)
            first, *rest = [", ".join(f"{n:,} {status}" for status, n in counts.items()), *numbers]
            click.echo(wrap(f"{name:<{width}}  {first}", 2, width + 4))
            for line in rest:
                click.echo(wrap(line, width + 4))
    _print_failures(summary)
    if not quiet:
        if not summary.reused:
            click.echo("new here? `rivid check` says whether units, clocks and gauge look right")
        shown = "report.html" if options.figures else "delays.csv"
        click.echo(f"{shown.split('.')[0]}: {summary.out / shown}")


def _print_failures(summary: Summary) -> None:
    """The days that failed in this run, on stderr; consecutive days of like messages in one line."""
    failed: dict[str, tuple[Any, str]] = {}  # once a day, whatever the number of its estimators
    for row in summary.rows.select(["date", "key", "status", "message"]).to_pylist():
        if row["status"] == "failed" and row["key"] in summary.computed_keys:
            failed.setdefault(row["key"], (row["date"], row["message"]))
    for _, alike in groupby(failed.values(), lambda day: re.sub(r"[\d.,:-]+", "", day[1])):
        days = list(alike)
        first, message = days[0]
        more = f" to {days[-1][0]} ({len(days)} days)" if len(days) > 1 else ""
        line = wrap(f"{first}{more} failed: {message}{', for one' if more else ''}", 2)
        click.echo(click.style(line, fg="red"), err=True)


def _numbers(name: str, rows: pa.Table, config: Config) -> list[str]:
    """The delay, its doubt, and a river's t50, in words."""
    T_s, lines, edge = config.reach.sample_time, [], 0
    t50, d = (_finite(rows[column]) for column in ("t50_samples", "delay_samples"))
    if len(t50):
        low, mid, high = np.quantile(t50, [0.1, 0.5, 0.9])
        lines.append(
            f"t50 {number(mid)} samples ({duration([mid * T_s])}), four days in five "
            f"{duration([low * T_s, high * T_s])}"
        )
    if len(d):
        values, n = np.unique(d, return_counts=True)
        most = np.sort(values[np.argsort(-n, kind="stable")][:2])
        often = int(np.isin(d, most).sum())
        lines.append(f"delay {samples_first([float(v) for v in most], T_s)} on {often} of {len(d)} days")
        prior = sum(bool(p) for p in rows["prior_only"].to_pylist())
        if prior:
            whose = "the prior's answer" if ESTIMATORS[name].rayleigh else "perhaps chance"
            lines.append(f"{whose}, not the data's, on {share(prior, len(d))}")
        sure = _finite(rows.filter(rows["delay_samples"].is_valid())["probability"])
        if len(sure):
            median, least = (probability(float(p)) for p in (np.median(sure), sure.min()))
            lines.append(f"probability {median} on the median day, {least} on the least sure")
        edges = zip(rows["at_bound"].to_pylist(), rows["delay_samples"].to_pylist(), strict=True)
        edge = sum(bool(b) and delay is not None for b, delay in edges)
        if edge:
            lines.append(f"the shortest or longest delay tried on {share(edge, len(d))}")
    if beyond := sum(bool(b) for b in rows["at_bound"].to_pylist()) - edge:
        lines.append(f"outside the delays tried on {count(beyond, 'day')}")
    return lines


def _finite(column: pa.ChunkedArray) -> Floats:
    values = column.to_numpy(zero_copy_only=False).astype(float)
    return np.asarray(values[np.isfinite(values)], float)


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
