"""Judged answers as a page: docs/exam.md."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.exam.cases import ROOT, Case
from benchmarks.exam.judging import Judged, judge
from benchmarks.exam.rows import (
    COVERED,
    EVERY_NAMED,
    EVERY_NOTHING,
    NOTHING_ROWS,
    ROWS,
    Asked,
    counted,
)
from benchmarks.exam.shares import written
from benchmarks.measure import table

HEAD = ROOT / "benchmarks" / "exam_head.md"
PAGE = ROOT / "docs" / "exam.md"
Result = tuple[Case, dict[str, Any]]
Marked = tuple[Case, dict[str, Any], Judged]


def marked(results: Sequence[Result]) -> list[Marked]:
    """Results with their marks."""
    return [
        (case, r, judge(r["answer"], r["truth"], case.expected, case.allowed, r["floor"]))
        for case, r in results
    ]


def page(results: Sequence[Result]) -> str:
    """All of it.

    Parameters
    ----------
    results : sequence of (Case, dict)
        From :func:`benchmarks.exam.running.results_of`.
    """
    marks = marked(results)
    parts = [HEAD.read_text(encoding="utf-8"), f"\n{_about(marks)}\n"]
    parts += ["\n## Targets\n\n", targets(marks)]
    parts += ["\n## Every named case\n\n", *_every(marks)]
    parts += ["\n## One effect, by size\n\n", by_effect(marks)]
    parts += ["\n## Wrong and false names\n\n", mistakes(marks)]
    parts += ["\n## All cases\n\n", by_case(marks)]
    return "".join(parts)


def _about(marks: Sequence[Marked]) -> str:
    seconds = [r["answer"].get("seconds", 0.0) for _, r, _ in marks]
    revisions = Counter(r["revision"] for _, r, _ in marks)
    failed = sum("error" in r["answer"] for _, r, _ in marks)
    if not marks:
        return "No season was asked yet."
    asked = ", ".join(f"{name or 'unknown'} ({n})" for name, n in revisions.most_common())
    return (
        f"{len(marks)} seasons; a diagnosis took {np.median(seconds):.0f} s (median), {max(seconds):.0f} s at "
        f"most; {failed} failed. Revisions that answered: {asked}."
    )


def _line(title: str, asked: Asked, judged: Sequence[Judged]) -> list[str]:
    hits, n = counted(asked, judged)
    target = asked.target
    return [
        title, asked.words, "-" if target is None else target.words, str(n), str(hits), written(hits, n),
        "-" if target is None else target.verdict(hits, n),
    ]  # fmt: skip


COLUMNS = ["scenario", "share", "target", "n", "hits", "share (Wilson 95 %)", "verdict"]


def targets(marks: Sequence[Marked]) -> str:
    """The table of the design, a line for each share that it asks."""
    lines = []
    for row in ROWS:
        judged = [j for case, _, j in marks if case.row == row.key]
        lines += [_line(row.title if k == 0 else "", asked, judged) for k, asked in enumerate(row.asked)]
    return table(COLUMNS, lines)


def _every(marks: Sequence[Marked]) -> list[str]:
    """What is asked of all cases whose effect was named, and of those with nothing missing."""
    named = [j for case, _, j in marks if case.expected and j.first]
    nothing = [j for case, _, j in marks if case.row in NOTHING_ROWS]
    lines = [_line("named" if k == 0 else "", asked, named) for k, asked in enumerate(EVERY_NAMED)]
    lines += [_line("nothing missing", asked, nothing) for asked in EVERY_NOTHING]
    shares = [j.gap_closed for j in named if j.gap_closed is not None]
    by_name: dict[str, list[bool]] = defaultdict(list)
    for j in named:
        for name, inside in j.covered:
            by_name[name].append(inside)
    everything = [inside for found in by_name.values() for inside in found]
    text = table(COLUMNS, lines)
    if shares:
        text += (
            f"\nGap closed against the model that knows: median {np.median(shares):.2f} (target 0.90), 10th "
            f"percentile {np.quantile(shares, 0.1):.2f} (target 0.75), of {len(shares)} cases with a gap to "
            f"close; {len(named) - len(shares)} more had none, as the plain response takes the effect upon "
            "itself.\n"
        )
    covered = [
        [name, COVERED.words, str(len(found)), str(sum(found)), written(sum(found), len(found)),
         COVERED.verdict(sum(found), len(found))]
        for name, found in [("**all**", everything), *sorted(by_name.items())]
    ]  # fmt: skip
    text += "\n95 % intervals that hold the planted value:\n\n"
    return [text, table(["parameter", *COLUMNS[2:]], covered)]


def by_effect(marks: Sequence[Marked]) -> str:
    """First or tied with it, by effect and size; and the gap closed as planted."""
    sizes = ("x1", "x2", "x4", "planted")
    cells: dict[str, dict[str, list[Judged]]] = defaultdict(lambda: defaultdict(list))
    for case, _, j in marks:
        if case.name.startswith("one/"):
            _, name, size = case.name.split("/")
            cells[name][size].append(j)
    lines = []
    for name, found in sorted(cells.items()):
        every = [j for js in found.values() for j in js]
        shares = [j.gap_closed for j in every if j.first and j.gap_closed is not None]
        lines.append([
            name,
            *(f"{sum(not j.wrong and bool(j.names) for j in found[s])}/{len(found[s])}" if found[s] else "-"
              for s in sizes),
            f"{sum(j.alone for j in every)}/{len(every)}", f"{sum(j.wrong for j in every)}/{len(every)}",
            f"{np.median(shares):.2f}" if shares else "-",
        ])  # fmt: skip
    heads = ["effect", *(f"found, {s}" for s in sizes), "alone, all", "wrong, all", "gap closed, median"]
    return table(heads, lines)


def mistakes(marks: Sequence[Marked]) -> str:
    """Every name that should not have been given."""
    lines = []
    for case, r, j in marks:
        if j.wrong or (j.false and not case.expected):
            said = r["answer"].get("error") or ", ".join(j.names)
            lines.append([case.name, str(r["seed"]), j.verdict, str(said)])
    return table(["case", "seed", "verdict", "named"], lines) if lines else "None.\n"


def by_case(marks: Sequence[Marked]) -> str:
    """What was answered to each case, and how often."""
    answers: dict[str, Counter[str]] = defaultdict(Counter)
    for case, _, j in marks:
        answers[case.name][f"{j.verdict} [{', '.join(j.names)}]"] += 1
    return table(
        ["case", "seasons", "answers"],
        [[name, str(found.total()), "; ".join(f"{n}x {said}" for said, n in found.most_common())]
         for name, found in answers.items()],
    )  # fmt: skip
