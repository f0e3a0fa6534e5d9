"""Write docs/accuracy_posterior.md from the scores."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from benchmarks.measure import machine, table
from benchmarks.posterior.accuracy import Bin, Found, reliability
from benchmarks.posterior.oracle import Limit
from benchmarks.posterior.score import Scores, together, wilson
from benchmarks.posterior.worlds import KINDS

EDGES = np.array([0.0, 0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.98, 1.0 + 1e-9])

GATES = (0.0, 0.15, 0.3, 0.5, 2.0)
"""Bounds of the gate time [samples] by which the random reaches are grouped."""

TARGETS: tuple[tuple[str, str, Callable[[Scores], bool]], ...] = (
    ("answered", ">= 90 %", lambda s: bool(s.answered.mean() >= 0.9)),
    ("exact, of the answered", ">= 95 %", lambda s: bool(s.exact[s.answered].mean() >= 0.95)),
    ("within one sample, of the answered", ">= 99 %", lambda s: bool(s.within[s.answered].mean() >= 0.99)),
    ("coverage of the 90 % set", "88-95 %", lambda s: bool(0.88 <= s.covered[s.known].mean() <= 0.95)),
    ("wrong with p above 0.9, of all", "< 1 %", lambda s: bool(s.surely_wrong.mean() < 0.01)),
)


ByFactor = dict[tuple[str, str], Scores]
"""Scores by factor and its value."""


def share(k: int, n: int, digits: int = 1) -> str:
    """Format a share in per cent with its interval."""
    low, high = wilson(k, n)
    return f"{100 * k / max(n, 1):.{digits}f} ({100 * low:.{digits}f}-{100 * high:.{digits}f})"


def mean(values: np.ndarray) -> str:
    """Format the mean of randomised shares and twice its standard error, in per cent."""
    return f"{100 * values.mean():.1f} ± {200 * values.std() / np.sqrt(len(values)):.1f}"


def numbers(s: Scores) -> list[str]:
    """Return the number of days and the shares of `TARGETS` as text."""
    a, n = int(s.answered.sum()), len(s.answered)
    return [
        str(n), share(a, n), share(int(s.exact.sum()), a), share(int(s.within.sum()), a),
        mean(s.covered[s.known]), share(int(s.surely_wrong.sum()), n),
    ]  # fmt: skip


def groups(found: list[Found]) -> dict[str, Scores]:
    """Return the scores of linear and hydraulic truths, for each kind of worlds."""
    return {
        f"{kind}, {name}": together([f.matched for f in found if f.kind == kind and f.is_linear == linear])
        for kind in ("development", "proof")
        for name, linear in (("linear truth", True), ("hydraulic truth", False))
    }


def bins_of(found: list[Found]) -> dict[str, list[Bin]]:
    """Return the reliability of the probability of every candidate, by truth, on the proof worlds."""
    lines = {}
    for name, linear in (("linear truth", True), ("hydraulic truth", False)):
        s = together([f.matched for f in found if f.kind == "proof" and f.is_linear == linear])
        lines[name] = reliability(s.probability[s.known].ravel(), s.is_true[s.known].ravel(), EDGES)
    return lines


def placed(s: Scores) -> list[str]:
    """Return how often the band contains the travel time, and the width of the band."""
    known = int(s.known.sum())
    return [share(int(s.in_band[s.known].sum()), known), f"{np.nanmedian(s.band):.2f}"]


def page(
    found: list[Found],
    drawn: list[Found],
    known: list[Limit],
    exam: tuple[ByFactor, ByFactor],
    head: str,
    tail: str,
) -> str:
    """Return the whole page."""
    by_truth = groups(found)
    head_row = ["", "days", *(f"{what} [%], {aim}" for what, aim, _ in TARGETS)]
    text = head + "\n## Results and targets\n\n"
    text += table(head_row, [[name, *numbers(s)] for name, s in by_truth.items()])
    text += "\n" + verdict(by_truth)
    text += "\n## World by world\n\n"
    short = ["world", "T_s [s]", "days", "answered", "exact", "within one", "coverage", "wrong with p > 0.9",
             "travel time in its 90 % band", "width of the band [samples]"]  # fmt: skip
    for kind, what in (("development", "Worlds used for development, with other seeds"),
                       ("proof", "Worlds not used for development")):  # fmt: skip
        rows = [
            [f.name, f"{f.sample_time:g}", *numbers(f.matched), *placed(f.matched)]
            for f in found
            if f.kind == kind
        ]
        text += f"{what} [%]:\n\n" + table(short, rows) + "\n"
    text += drawn_section(drawn, short[2:]) + random_section(*exam)
    text += reliability_section(found) + null_section(found)
    return text + limit_section(known) + speed_section(found) + tail


def drawn_section(drawn: list[Found], head: list[str]) -> str:
    """Return the table of random reaches by their gate time."""
    gates = [KINDS[f.kind][f.name].changes["channel"]["gate_time"] / f.sample_time for f in drawn]
    rows = []
    for low, high in pairwise(GATES):
        parts = [f.matched for f, gate in zip(drawn, gates, strict=True) if low <= gate < high]
        if parts:
            s = together(parts)
            rows.append([f"{low:g} to {high:g}", str(len(parts)), *numbers(s), *placed(s)])
    return (
        f"{len(drawn)} random reaches, none of them used for development, by the gate time [%]:\n\n"
        + table(["gate [samples]", "reaches", *head], rows)
        + "\n"
    )


def random_section(exam: ByFactor, rough: ByFactor) -> str:
    """Return the scores of the exam's random worlds by factor."""
    head = ["factor", "", "days", "answered", "exact", "within one", "coverage", "wrong with p > 0.9",
            "travel time in its 90 % band", "width of the band [samples]", "error of the half-response [samples]",
            "of the travel time alone"]  # fmt: skip

    def line(s: Scores) -> list[str]:
        errors = (s.half_error, s.front_error)
        return [*numbers(s), *placed(s), *(f"{np.nanmedian(e[s.answered]):.2f}" for e in errors)]

    rows = [[factor, name, *line(s)] for (factor, name), s in exam.items()]
    worst = [["gauge of 10 mm, steps of 20 mm", "", *line(s)] for (f, _), s in rough.items() if f == "all"]
    return (
        "## Random worlds, by factor\n\nPools of the exam without hidden effects ([exam.md](exam.md)): box scheme, Saint-Venant or "
        "linear store; manual control, automatic control\nor a schedule; a stilling well in half of them. Each has eight days, the delays that "
        "`rivid bounds` proposes from a geometry with errors of some percent,\nand a seed not used to choose the constants. The true travel time of the box scheme is that "
        "of the sections of the boxes [%]. The half-response is the travel time plus\nthe half time of the stilling well; its error is a median:\n\n"
        + table(head, rows + worst)
        + "\n"
    )


def verdict(by_truth: dict[str, Scores]) -> str:
    """Return which targets are reached and which are not."""
    lines = []
    for name, s in by_truth.items():
        missed = [what for what, _, reached in TARGETS if not reached(s)]
        lines.append(f"- {name}: " + (f"not reached: {'; '.join(missed)}." if missed else "all reached."))
    return "\n".join(lines) + "\n"


def reliability_section(found: list[Found]) -> str:
    """Return the tables of the reliability diagram and of the probability of being right."""
    text = (
        "## Reliability, on worlds not used for development\n\n"
        "![probability of a delay and frequency with which it is the true one](pictures/posterior_reliability.png)\n\n"
    )
    for name, bins in bins_of(found).items():
        rows = [[f"{b.stated:.3f}", share(b.true, b.n), str(b.n)] for b in bins]
        text += f"{name[0].upper() + name[1:]}, every candidate of every day:\n\n"
        text += table(["stated", "was true [%]", "n"], rows) + "\n"
    s = together([f.matched for f in found if f.kind == "proof"])
    bins = reliability(
        s.top[s.known], s.top_right[s.known], np.array([0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.01])
    )
    rows = [[f"{b.stated:.3f}", share(b.true, b.n), str(b.n)] for b in bins]
    text += "Probability that the best delay is right (`right`), both truths:\n\n"
    return text + table(["stated", "was right [%]", "n"], rows) + "\n"


def null_section(found: list[Found]) -> str:
    """Return the table of shuffled days."""
    rows = []
    for kind in ("development", "proof"):
        s = together([f.shuffled for f in found if f.kind == kind])
        n = len(s.answered)
        sure = int((s.answered & (s.top > 0.9)).sum())
        rows.append([kind, str(n), share(int(s.answered.sum()), n, 2), share(sure, n, 2)])
    return (
        "## False answers on shuffled days\n\nThe inflow of one day with the level and the outflow of another.\n\n"
        + table(["worlds", "days", "answered [%]", "answered with p above 0.9 [%]"], rows)
        + "\n"
    )


def limit_section(known: list[Limit]) -> str:
    """Return the table of the estimator and the oracle."""
    rows = [
        [f"{k.name} ({k.kind})", str(k.days), f"{100 * k.oracle:.1f}", f"{100 * k.estimator:.1f}"]
        for k in known
    ]
    return (
        "## Limit of the information in a day\n\nShare of exact answers among the surest 90 % of days, linear truth. The oracle is the likelihood of the "
        "world's own equation with the true variances\nand memories of gauge and weather; gains, a steady leak and "
        "the delay are free. These shares have an error of two to three\npercentage points. Where the two columns agree, the missed days do not "
        "contain the information.\n\n"
        + table(["world", "days", "oracle [%]", "`posterior` [%]"], rows)
        + "\n"
    )


def speed_section(found: list[Found]) -> str:
    """Return the table of milliseconds per day by the length of the day."""
    by_time: dict[float, list[float]] = {}
    for f in found:
        by_time.setdefault(f.sample_time, []).append(f.matched.ms)
    rows = [[f"{T:g}", str(round(86400 / T)), f"{np.median(ms):.2f}"] for T, ms in sorted(by_time.items())]
    return (
        f"## Time\n\nOne process, one core, d 1-15, the response and its spread included ({machine()}, with other "
        "load):\n\n" + table(["T_s [s]", "samples a day", "ms a day"], rows) + "\n"
    )
