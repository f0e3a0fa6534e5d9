"""What `rivid run` says to a person at its end: a few lines of at most 80 columns."""

import re
from itertools import groupby
from typing import Any

import click
import numpy as np

from rivid.cli.console import abbreviate, wrap
from rivid.config import Config
from rivid.estimators import ESTIMATORS
from rivid.run.run import Summary
from rivid.text import count, duration, number, probability, samples_first, share

NAME_WIDTH = 14
"""The column of names is no wider; a longer one moves its own line only."""


def print_summary(summary: Summary, config: Config, shown: str) -> None:
    """Counts and the main numbers of each estimator, the days that failed now, and where to look.

    Parameters
    ----------
    summary : Summary
    config : Config
    shown : str
        Name of the file in OUT to point to.
    """
    said = (
        f"{count(summary.windows, 'data set')}, {summary.computed:,} estimated now, "
        f"{summary.reused:,} done before ({summary.seconds:.1f} s)"
    )
    click.echo(click.style(wrap(f"{abbreviate(config.reach.name)}: {said}"), bold=True))
    names = summary.rows["estimator"].to_numpy(zero_copy_only=False)
    width = min(max((len(name) for name in summary.counts), default=0), NAME_WIDTH)
    for name, counts in summary.counts.items():
        rows = summary.rows.filter(names == name)
        numbers = _numbers(name, rows, config)
        first, *rest = [", ".join(f"{n:,} {status}" for status, n in counts.items()), *numbers]
        click.echo(wrap(f"{name:<{width}}  {first}", 2, width + 4))
        for text in rest:
            click.echo(wrap(text, width + 4))
    print_failures(summary)
    if not summary.reused:
        click.echo("new here? `rivid check` says whether units, clocks and gauge look right")
    click.echo(f"{shown.split('.')[0]}: {summary.out / shown}")


def print_failures(summary: Summary) -> None:
    """The days that failed in this run, on stderr; days in a row that say the same but for numbers, once."""
    failed: dict[str, tuple[Any, str]] = {}  # once a day, whatever the number of its estimators
    for row in summary.rows.select(["date", "key", "status", "message"]).to_pylist():
        if row["status"] == "failed" and row["key"] in summary.computed_keys:
            failed.setdefault(row["key"], (row["date"], row["message"]))
    for _, alike in groupby(failed.values(), lambda day: re.sub(r"[\d.,:-]+", "", day[1])):
        days = list(alike)
        first, said = days[0]
        more = f" to {days[-1][0]} ({len(days)} days)" if len(days) > 1 else ""
        line = wrap(f"{first}{more} failed: {said}{', for one' if more else ''}", 2)
        click.echo(click.style(line, fg="red"), err=True)


def _numbers(name: str, rows: Any, config: Config) -> list[str]:
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


def _finite(column: Any) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    values = column.to_numpy(zero_copy_only=False).astype(float)
    return np.asarray(values[np.isfinite(values)])
