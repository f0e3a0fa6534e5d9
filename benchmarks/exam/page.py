"""Write judged answers as a page: docs/exam.md."""

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.exam.judging import Judged, judge
from benchmarks.exam.rows import CLOSED, COVERED, RELIABLE, ROWS
from benchmarks.exam.running import ROOT
from benchmarks.exam.shares import wilson, written
from benchmarks.exam.worlds import FIRST_PROOF
from benchmarks.measure import table

HEAD = ROOT / "benchmarks" / "exam_head.md"
PAGE = ROOT / "docs" / "exam.md"
Result = dict[str, Any]
Marked = tuple[Result, Judged]


def marked(results: Sequence[Result]) -> list[Marked]:
    """Return the results with their evaluations."""
    return [(r, judge(r["answer"], r["truth"], r["floor"])) for r in results]


def page(results: Sequence[Result]) -> str:
    """Return the whole page.

    Parameters
    ----------
    results : sequence of dict
        From :func:`benchmarks.exam.running.results_of`.
    """
    marks = marked(results)
    judged = [j for _, j in marks]
    return "\n".join([
        HEAD.read_text(encoding="utf-8").replace("FIRST_PROOF", str(FIRST_PROOF)), about(marks), "\n## Targets\n", targets(judged),
        "\n## Probabilities of names\n", reliability(judged), "\n## Intervals\n", coverage(judged),
        "\n## By factor\n", by_factor(marks), "\n## By effect\n", by_effect(marks),
        "\n## Mistakes\n", mistakes(marks),
    ])  # fmt: skip


def about(marks: Sequence[Marked]) -> str:
    """Describe the number of seasons, the duration of a diagnosis, and the revisions."""
    if not marks:
        return "No season has been answered yet."
    seconds = np.array([r["answer"].get("seconds", 0.0) for r, _ in marks])
    days = np.array([r["truth"]["days"] for r, _ in marks])
    revisions = Counter(r["revision"] for r, _ in marks)
    seeds = sorted(r["seed"] for r, _ in marks)
    return (
        f"{len(marks)} seasons, seeds {seeds[0]} to {seeds[-1]}, {days.min()} to {days.max()} days. A "
        f"diagnosis took {np.median(seconds):.1f} s (median), {np.quantile(seconds, 0.9):.1f} s (nine of ten "
        f"at most), {seconds.max():.0f} s (largest). Revisions: "
        + ", ".join(f"{name or 'unknown'} ({n})" for name, n in revisions.most_common())
        + "."
    )


COLUMNS = ["hidden", "share", "target", "n", "hits", "share (Wilson 95 %)", "verdict"]


def targets(judged: Sequence[Judged]) -> str:
    """Return the table of targets."""
    lines, last = [], ""
    for asked in ROWS:
        hits, n = asked.counted(judged)
        goal = asked.target
        lines.append([
            asked.group if asked.group != last else "", asked.words, "-" if goal is None else goal.words,
            str(n), str(hits), written(hits, n), "-" if goal is None else goal.verdict(hits, n),
        ])  # fmt: skip
        last = asked.group
    shares = [j.gap_closed for j in judged if j.gap_closed is not None]
    for words, value, goal_value in zip(
        ("median", "tenth percentile"), _quantiles(shares), CLOSED, strict=True
    ):
        reached = (
            "too few to decide"
            if value is None
            else "reached"
            if value >= goal_value
            else (f"short by {goal_value - value:.2f}")
        )
        lines.append([
            "", f"gap closed of what the truth would close: {words}", f">= {goal_value:.2f}",
            str(len(shares)), "-", "-" if value is None else f"{value:.2f}", reached,
        ])  # fmt: skip
    inside = [hit for j in judged for _, hit in j.covered]
    lines.append([
        "", "intervals cover", COVERED.words, str(len(inside)), str(sum(inside)),
        written(sum(inside), len(inside)), COVERED.verdict(sum(inside), len(inside)),
    ])  # fmt: skip
    return table(COLUMNS, lines)


def _quantiles(shares: Sequence[float]) -> tuple[float | None, float | None]:
    return (float(np.median(shares)), float(np.quantile(shares, 0.1))) if shares else (None, None)


def reliability(judged: Sequence[Judged]) -> str:
    """Return a table of the probabilities of names in tenths and their share of right names, with bars."""
    chances = [one for j in judged for one in j.chances]
    if not chances:
        return "No probabilities yet.\n"
    p, hit = np.array([c for c, _ in chances]), np.array([h for _, h in chances])
    tenth = np.minimum((p * 10).astype(int), 9)
    lines = []
    for k in range(10):
        here = tenth == k
        n, hits = int(here.sum()), int(hit[here].sum())
        if n == 0:
            lines.append([f"{k / 10:.1f} to {(k + 1) / 10:.1f}", "0", "-", "-", "", "-"])
            continue
        mean, low_high = float(p[here].mean()), wilson(hits, n)
        near = low_high[0] - RELIABLE <= mean <= low_high[1] + RELIABLE
        lines.append([
            f"{k / 10:.1f} to {(k + 1) / 10:.1f}", str(n), f"{mean:.2f}", written(hits, n),
            "#" * round(20 * hits / n), "yes" if near else "no",
        ])  # fmt: skip
    wider = f"interval, {RELIABLE:g} wider, holds the mean"
    heads = ["probability", "names", "mean", "right (Wilson 95 %)", "share", wider]
    return table(heads, lines)


def coverage(judged: Sequence[Judged]) -> str:
    """Return a table of how often the 95 % intervals contain the planted value, by parameter."""
    by_name: dict[str, list[bool]] = defaultdict(list)
    for j in judged:
        for name, inside in j.covered:
            by_name[name].append(inside)
    if not by_name:
        return "No interval yet.\n"
    return table(
        ["parameter", "target", "n", "share (Wilson 95 %)", "verdict"],
        [[name, COVERED.words, str(len(hits)), written(sum(hits), len(hits)),
          COVERED.verdict(sum(hits), len(hits))] for name, hits in sorted(by_name.items())],
    )  # fmt: skip


def _binned(key: str, edges: Sequence[float], unit: str, digits: str = "g") -> Callable[[Result], str]:
    def label(r: Result) -> str:
        world = r["truth"]["world"]
        if world["water"] == "river" and unit == "m":  # its gauge reads discharge, and it is longer
            return "river"
        value = float(world[key])
        k = int(np.searchsorted(edges, value, side="right"))
        if k == 0:
            return f"below {edges[0]:{digits}} {unit}"
        return (
            f"{edges[k - 1]:{digits}} {unit} and more"
            if k == len(edges)
            else (f"{edges[k - 1]:{digits}} to {edges[k]:{digits}} {unit}")
        )

    return label


def _size(r: Result) -> str:
    times = min(r["truth"]["times"], default=None)
    if times is None:
        return "-"
    low = next((low for low in (8.0, 4.0, 2.0) if times >= low), 1.0)
    return f"{low:g}x to {2.0 * low:g}x"


def _evidence(r: Result) -> str:
    known = [nats for nats in r["truth"].get("nats", ()) if nats is not None]
    if not known:
        return "-"
    edge = next((edge for edge in (1000, 300, 100, 30) if min(known) >= edge), 0)
    if not edge:
        return "below 30 nats"
    upper = {30: 100, 100: 300, 300: 1000}.get(edge)
    return f"{edge} to {upper} nats" if upper else "1000 nats and more"


FACTORS: dict[str, Callable[[Result], str]] = {
    "water": lambda r: str(r["truth"]["world"]["water"]),
    "operators": lambda r: str(r["truth"]["world"]["operators"]),
    "programme": lambda r: str(r["truth"]["world"]["programme"]),
    "sample time": _binned("sample_time_s", (133.0, 300.0), "s"),
    "gauge step": _binned("gauge_step_m", (0.0015, 0.004, 0.008), "m"),
    "stilling well": lambda r: (
        _binned("well_s", (60.0,), "s")(r) if r["truth"]["world"]["well_s"] else "none"
    ),
    "length": _binned("length_m", (4000.0, 9000.0), "m"),
    "days": _binned("days", (50.0, 80.0), "days"),
    "weather": _binned("weather_share", (0.006, 0.012), "of the flow"),
    "size": _size,
    "evidence": _evidence,
}
"""Factors by which the results are split."""
HEADS = ["factor", "", "seasons", "false (nothing, outsider)", "first (one, >= 2x)", "wrong (any)",
         "worse by > 1 %",
         "seconds, median"]  # fmt: skip


def _place(name: str) -> tuple[bool, float, str]:
    """Return a sort key of the groups of a factor: classes by their numbers, others by name."""
    number = re.search(r"[\d.]+", name)
    return not name.startswith("below"), float(number[0]) if number else 0.0, name


def by_factor(marks: Sequence[Marked]) -> str:
    """Return a table of the main shares by each factor of the world."""
    false = (ROWS[0], next(a for a in ROWS if a.words == "named all the same"))
    first = next(a for a in ROWS if a.words == ">= 2x, separable: first")
    worse = next(a for a in ROWS if "worse" in a.words)
    lines = []
    for factor, label in FACTORS.items():
        groups: dict[str, list[Marked]] = defaultdict(list)
        for one in marks:
            groups[label(one[0])].append(one)
        for k, (name, some) in enumerate(sorted(groups.items(), key=lambda one: _place(one[0]))):
            judged = [j for _, j in some]
            counts = np.sum([a.counted(judged) for a in false], axis=0)
            lines.append([
                factor if k == 0 else "", name, str(len(some)), written(int(counts[0]), int(counts[1])),
                written(*first.counted(judged)), written(sum(j.wrong for j in judged if j.times), sum(
                    j.times is not None for j in judged)),
                written(*worse.counted(judged)),
                f"{np.median([r['answer'].get('seconds', 0.0) for r, _ in some]):.1f}",
            ])  # fmt: skip
    return table(HEADS, lines)


def by_effect(marks: Sequence[Marked]) -> str:
    """Return a table of single effects: found by size, alone, wrong, and the closed gap."""
    cells: dict[str, list[Marked]] = defaultdict(list)
    for r, j in marks:
        if r["truth"]["kind"] == "one":
            cells[r["truth"]["effects"][0]["name"]].append((r, j))
    lines = []
    for name, some in sorted(cells.items()):
        shares = [j.gap_closed for _, j in some if j.gap_closed is not None]
        found = []
        for low, high in ((1.0, 2.0), (2.0, 4.0), (4.0, 17.0)):
            here = [j for _, j in some if low <= (j.times or 0.0) < high]
            found.append(f"{sum(j.found for j in here)}/{len(here)}" if here else "-")
        judged = [j for _, j in some]
        lines.append([
            name, *found, f"{sum(j.alone for j in judged)}/{len(judged)}",
            f"{sum(j.wrong for j in judged)}/{len(judged)}",
            f"{sum(j.kind != 'separable' for j in judged)}/{len(judged)}",
            f"{np.median(shares):.2f}" if shares else "-",
        ])  # fmt: skip
    return table(
        [
            "effect",
            "found, 1x to 2x",
            "2x to 4x",
            "4x and more",
            "alone",
            "wrong",
            "with a rival",
            "gap closed",
        ],
        lines,
    )


def mistakes(marks: Sequence[Marked]) -> str:
    """Return a table of all wrong names."""
    lines = []
    for r, j in marks:
        if j.wrong or j.extra or (j.names and j.kind in ("nothing", "operators", "outside", "removed")):
            hidden = ", ".join(
                f"{e['name']} ({t:.1f}x)"
                for e, t in zip(r["truth"]["effects"], r["truth"]["times"], strict=True)
            )
            result = r["answer"].get("error") or ", ".join(j.names)
            lines.append(
                [str(r["seed"]), j.kind, r["truth"]["world"]["water"], hidden or "-", j.verdict, str(result)]
            )
    heads = ["seed", "hidden", "water", "effects", "verdict", "named"]
    return table(heads, lines) if lines else "None.\n"
