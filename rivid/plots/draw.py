"""Figures of a run: results in, PNG files out."""

import datetime as dt
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from rivid.errors import ConfigError
from rivid.estimators import ESTIMATORS
from rivid.plots import estimates, style
from rivid.plots.files import FigureFile
from rivid.results import read
from rivid.results.read import EstimatorResults, Results
from rivid.text import count, day_range, delays, probability, response_unit, samples_first, statuses

KINDS = ("t50_", "tdr_", "histogram_", "delay_map_", "delay_discharge_", "fir_day")
"""Beginnings of the names of these figures in OUT/figures."""

Job = tuple[str, str]  # a figure to draw: its kind, and the estimator it shows; empty for all of them


def jobs(results: Results) -> list[Job]:
    """The figures of a run (Figs 12-18), in the order of the report."""
    leading = read.leading_response(results)
    listed: list[Job] = []
    for e in results.estimators:
        if not e.dates:
            continue
        kinds = ["t50", "t50_discharge"] if e is leading else []
        kinds += ["tdr"] if ESTIMATORS[e.estimator].has_fir else []
        kinds += ["histogram", "delay_map", "delay_discharge"] if read.estimates_delay(e) else []
        listed += [(kind, e.estimator) for kind in kinds]
    return [*listed, ("fir_day", "")]


def draw(results: Results, job: Job, folder: Path, *, day: dt.date | None = None) -> FigureFile | None:
    """Draw a figure of :func:`jobs` as <kind>_<estimator>.png in `folder`; None if no day has it.

    Responses are those of `day`, a typical one by default; ConfigError where it has none.
    """
    kind, name = job
    with style.styled():
        if name:
            return _of_estimator(results, results.of(name), kind, folder)
        return _fir_day(results, day, folder)


def _of_estimator(results: Results, e: EstimatorResults, kind: str, folder: Path) -> FigureFile:
    """A figure of one estimator: of all its days, or of those with a mean inflow against it."""
    title, height, plot = FIGURES[kind]
    days = read.has_t50(e) if kind.startswith("t50") else e.answered if kind == "tdr" else read.found(e)
    if kind.endswith("discharge"):
        days = days & np.isfinite(e.mean_inflow)
    shown, margins = count(int(days.sum()), "day"), dict[str, Any]()
    if kind == "histogram":
        without, margins = statuses(e.status), {"right": 0.25, "bottom": 0.92}
        shown = f"n = {shown}" + (f" ({without} left out)" if without else "")
    elif kind in DATED:
        shown += f" of {len(e.dates):,}, {day_range(e.dates[0], e.dates[-1])}"
    what = ["half of a step has arrived"] if kind.startswith("t50") else []
    note = " · ".join([results.reach, *what, ESTIMATORS[e.estimator].words, shown])
    figure, (ax,) = style.sheet(f"{title}: {e.estimator}", note, [height], **margins)
    if kind in DATED:
        style.calendar(ax, e.dates, e.status)
    plot(ax, results, e)
    style.key(ax)
    facts: dict[str, Any] = {
        "unit": results.output_unit,
        "bounds": bool(np.isfinite(e.bound_gravity_s).any()),
        "delay": bool(read.found(e).any()),
        "t50": bool(read.has_t50(e).any()),
        "interval": e.probability is not None,
        "travel": e.travel_s is not None,
        "rounded": read.rounded(results, e),
    }
    if t := read.thirds(e):
        facts |= {"medians": [m * results.sample_time for m in t.medians], "falls": t.longer >= read.CLEAR}
    path = folder / f"{kind}_{e.estimator}.png"
    return style.written(figure, path, title, kind=kind, estimator=e.estimator, **facts)


def _tdr(ax: Axes, results: Results, e: EstimatorResults) -> None:
    fir = np.where(e.answered[:, None], e.fir, np.nan)
    lag, name = (e.delay, "delay d") if read.found(e).any() else (e.t50, "t50")
    estimates.tdr(
        ax, read.day_numbers(e.dates), fir, lag=lag, label=name, low=e.delay_low, high=e.delay_high,
        sample_time=results.sample_time, unit=response_unit(results.output_unit),
    )  # fmt: skip


FIGURES: dict[str, tuple[str, float, Callable[[Axes, Results, EstimatorResults], Any]]] = {
    "t50": ("t50 of each day", 2.42, estimates.t50),
    "t50_discharge": ("t50 and discharge", 2.62, estimates.t50_discharge),
    "tdr": ("Impulse response of each day", 2.82, _tdr),
    "histogram": ("How often each delay", 2.36, estimates.histogram),
    "delay_map": ("Delay of each day", 2.42, estimates.delay_map),
    "delay_discharge": ("Delay and discharge", 2.62, estimates.delay_discharge),
}
"""Figures of one estimator by kind: title, height of the panel [inch] and what draws it."""
DATED = ("t50", "tdr", "delay_map")  # figures over the days of the record


def typical_day(results: Results) -> dt.date | None:
    """Return a day that most estimators answer, or None.

    Of these days, those on which ``jmap`` finds its median delay (where it is among the estimators), and of
    those the one of median condition number.
    """
    answered = [
        (e.dates[i], float(e.condition[i]))
        for e in results.estimators
        for i in np.flatnonzero(e.answered & np.isfinite(e.fir).any(axis=1))
    ]
    if not answered:
        return None
    answers = Counter(day for day, _ in answered)
    kept = {day for day, n in answers.items() if n == max(answers.values())}
    conditions = {day: c for day, c in reversed(answered) if np.isfinite(c)}  # of the first that has one
    for e in results.estimators:
        if e.estimator == "jmap" and np.isfinite(e.delay).any():
            median = np.nanpercentile(e.delay, 50, method="lower")
            kept = kept & {day for day, d in zip(e.dates, e.delay, strict=True) if d == median} or kept
    days = sorted((conditions.get(day, 1.0), day) for day in kept)
    return days[(len(days) - 1) // 2][1]  # of two in the middle the lower one, of equals the earlier


def _fir_day(results: Results, day: dt.date | None, folder: Path) -> FigureFile | None:
    """A panel for each estimator; None where no day has an answer and no day is given."""
    chosen = typical_day(results) if day is None else day
    shown = []
    for e in results.estimators:
        if chosen in e.dates and e.answered[(i := e.dates.index(chosen))] and np.isfinite(e.fir[i]).any():
            shown.append((e, i))
    if not shown or chosen is None:
        if day is None:
            return None
        raise ConfigError(f"no impulse response on {day}: choose a day with status ok in delays.csv")
    title, unit = f"Impulse responses of {chosen}", results.output_unit
    columns = 1 if len(shown) == 1 else 2
    figure, panels = style.sheet(
        title,
        f"{results.reach} · h[k] in {response_unit(unit)} against the lag k in samples",
        [1.25] * -(-len(shown) // columns), [1.0] * columns, gap=(0.65, 0.9), right=0.25, top=1.07,
        bottom=0.68,
    )  # fmt: skip
    # the last lag holds the rest of the truncated response and does not set the scale
    values = np.concatenate([e.fir[i][:-1] for e, i in shown])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.12 * (high - low) or 1.0
    for ax, (e, i) in zip(panels, shown, strict=False):
        _response(ax, results, e, i)
        ax.set_ylim(low - margin, high + margin)
    for ax in panels[len(shown) :]:
        ax.remove()
    used = [ESTIMATORS[e.estimator] for e, _ in shown]
    return style.written(
        figure, folder / "fir_day.png", title, unit=unit, band=any(e.fir_sd is not None for e, _ in shown),
        probable=any(one.has_probability for one in used), cusum=any(one.method == "CUSUM" for one in used),
        rounded=any(read.rounded(results, e) for e, _ in shown),
    )  # fmt: skip


def _response(ax: Axes, results: Results, e: EstimatorResults, i: int) -> None:
    d, t50, T_s, rounded = float(e.delay[i]), float(e.t50[i]), results.sample_time, read.rounded(results, e)
    sd = None if e.fir_sd is None else e.fir_sd[i]
    estimates.response(ax, e.fir[i], delay=d, sd=sd, t50=t50, rounded=rounded)
    ax.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    ax.yaxis.get_offset_text().set(fontsize=7.5, color=style.GREY)
    facts = []
    if np.isfinite(d):
        facts.append(f"d = {samples_first([d], T_s, rounded)}")
        if e.probability is not None:
            facts.append(f"probability {probability(float(e.probability[i]))}")
    if np.isfinite(t50):
        facts.append(f"t50 = {delays([round(t50, 1)], T_s)}")
    style.heading(ax, e.estimator, at=1, up=16, fontweight="bold")
    style.heading(ax, " · ".join(facts) or "no delay of its own", at=1, fontsize=8, color=style.GREY)
    estimates.grey_bar(ax, e.fir[i])
