"""Figures of a run: results in, PNG files out."""

import datetime as dt
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from rivid.errors import ConfigError
from rivid.estimators import ESTIMATORS
from rivid.plots import captions, estimates, style
from rivid.plots.style import FigureFile
from rivid.results.days import day_numbers, estimates_delay, found, has_t50, leading_response, thirds
from rivid.results.read import EstimatorResults, Results
from rivid.text import (
    count,
    day_range,
    delays,
    probability,
    response_unit,
    samples_first,
    statuses,
)

KINDS = ("t50_", "tdr_", "histogram_", "delay_map_", "delay_discharge_", "fir_day")
"""How the names of these figures begin in OUT/figures."""

Job = tuple[str, str]
"""A figure to draw: its kind, and the estimator it shows; empty for all of them."""

Drawn = tuple[Figure, str, str]
"""A figure, its title on a page and its caption."""


def draw_all(results: Results, out: Path, *, day: dt.date | None = None) -> list[FigureFile]:
    """Draw every figure of a run into OUT/figures, over those that are there.

    Parameters
    ----------
    results : Results
        All of OUT.
    out : Path
        OUT; files are written to its folder ``figures``.
    day : datetime.date, optional
        The day of the impulse responses; a typical one by default.

    Returns
    -------
    list of FigureFile
        Per estimator: tdr, where it has impulse responses, and histogram, delay_map and delay_discharge,
        where it estimates delays; then the responses of one day. Nothing for an estimator without a single
        row. For a river, t50 and t50_discharge of the leading estimator.

    Raises
    ------
    ConfigError
        Where `day` is not among the results.
    RividError
        Where a file cannot be written.

    Notes
    -----
    Source: Figs 12-18. The same results give the same bytes.
    """
    folder = out / "figures"
    drawn = [draw(results, job, folder, day=day) for job in jobs(results)]
    files = [file for file in drawn if file is not None]
    drop_old(folder, files)
    return files


def jobs(results: Results) -> list[Job]:
    """The figures of a run, in the order of the report."""
    leading = leading_response(results)
    listed: list[Job] = []
    for e in results.estimators:
        if not e.dates:
            continue
        kinds = ["t50", "t50_discharge"] if e is leading else []
        kinds += ["tdr"] if ESTIMATORS[e.estimator].has_fir else []
        kinds += ["histogram", "delay_map", "delay_discharge"] if estimates_delay(e) else []
        listed += [(kind, e.estimator) for kind in kinds]
    return [*listed, ("fir_day", "")]


def draw(results: Results, job: Job, folder: Path, *, day: dt.date | None = None) -> FigureFile | None:
    """Draw a figure of :func:`jobs` as <kind>_<estimator>.png in `folder`; None if no day has what it shows.

    Raises
    ------
    ConfigError, RividError
        As :func:`draw_all`.
    """
    kind, name = job
    with style.styled():
        if kind == "fir_day":
            drawn = _fir_day(results, day)
        else:
            drawn = FIGURES[kind](results, next(e for e in results.estimators if e.estimator == name))
        if drawn is None:
            return None
        path = folder / (f"{kind}_{name}.png" if name else f"{kind}.png")
        return style.written(drawn[0], path, *drawn[1:], kind=kind, estimator=name)


def drop_old(folder: Path, files: list[FigureFile]) -> None:
    """Remove figures of estimators that are no longer part of the run."""
    kept = {file.path.name for file in files}
    for kind in KINDS:
        for path in folder.glob(f"{kind}*.png"):
            if path.name not in kept:
                path.unlink(missing_ok=True)


def _note(results: Results, e: EstimatorResults, facts: str) -> str:
    return f"{results.reach} · {ESTIMATORS[e.estimator].words} · {facts}"


def _days(e: EstimatorResults, n: int) -> str:
    return f"{count(n, 'day')} of {len(e.dates):,}, {day_range(e.dates[0], e.dates[-1])}"


def _tdr(results: Results, e: EstimatorResults) -> Drawn:
    title, unit = "Impulse response of each day", results.output_unit
    note = _note(results, e, _days(e, int(e.answered.sum())))
    figure, (ax,) = style.sheet(f"{title}: {e.estimator}", note, [2.82])
    style.calendar(ax, e.dates, e.status)
    delay, t50 = found(e), has_t50(e)
    fir = np.where(e.answered[:, None], e.fir, np.nan)
    lag, name = (e.delay, "delay d") if delay.any() else (e.t50, "t50")
    estimates.tdr(
        ax, day_numbers(e.dates), fir, lag=lag, label=name, low=e.delay_low, high=e.delay_high,
        sample_time=results.sample_time,
    )  # fmt: skip
    if e.answered.any():
        estimates.grey_scale(ax, fir, response_unit(unit))
    style.key(ax)
    interval = e.probability is not None
    return figure, title, captions.tdr(unit, delay=bool(delay.any()), t50=bool(t50.any()), interval=interval)


def _histogram(results: Results, e: EstimatorResults) -> Drawn:
    title, without = "How often each delay", statuses(e.status)
    facts = f"n = {count(int(found(e).sum()), 'day')}" + (f" ({without} left out)" if without else "")
    figure, (ax,) = style.sheet(
        f"{title}: {e.estimator}", _note(results, e, facts), [2.36], right=0.25, bottom=0.92
    )
    style.key(estimates.histogram(ax, results, e))
    return figure, title, captions.histogram(e.estimator, results.output_unit)


def _delay_map(results: Results, e: EstimatorResults) -> Drawn:
    title = "Delay of each day"
    note = _note(results, e, _days(e, int(found(e).sum())))
    figure, (ax,) = style.sheet(f"{title}: {e.estimator}", note, [2.42])
    style.calendar(ax, e.dates, e.status)
    style.key(estimates.delay_map(ax, results, e))
    return figure, title, captions.delay_map(e.estimator, results.output_unit, bounds=_bounded(e))


def _delay_discharge(results: Results, e: EstimatorResults) -> Drawn:
    title, n = "Delay and discharge", int((found(e) & np.isfinite(e.mean_inflow)).sum())
    figure, (ax,) = style.sheet(f"{title}: {e.estimator}", _note(results, e, count(n, "day")), [2.62])
    style.key(estimates.delay_discharge(ax, results, e))
    return figure, title, captions.delay_discharge(e.estimator, results.output_unit, bounds=_bounded(e))


def _t50(results: Results, e: EstimatorResults) -> Drawn:
    title = "t50 of each day"
    note = f"{results.reach} · half of a step has arrived · {ESTIMATORS[e.estimator].words}"
    note += f" · {_days(e, int(has_t50(e).sum()))}"
    figure, (ax,) = style.sheet(f"{title}: {e.estimator}", note, [2.42])
    style.calendar(ax, e.dates, e.status)
    style.key(estimates.t50(ax, results, e))
    return figure, title, captions.T50


def _t50_discharge(results: Results, e: EstimatorResults) -> Drawn:
    title, n = "t50 and discharge", int((has_t50(e) & np.isfinite(e.mean_inflow)).sum())
    note = f"{results.reach} · half of a step has arrived · {ESTIMATORS[e.estimator].words}"
    figure, (ax,) = style.sheet(f"{title}: {e.estimator}", f"{note} · {count(n, 'day')}", [2.62])
    style.key(estimates.t50_discharge(ax, results, e))
    return figure, title, captions.t50_discharge(thirds(e), results.sample_time, bounds=_bounded(e))


def _bounded(e: EstimatorResults) -> bool:
    return bool(np.isfinite(e.bound_gravity_s).any())


FIGURES: dict[str, Callable[[Results, EstimatorResults], Drawn]] = {
    "t50": _t50,
    "t50_discharge": _t50_discharge,
    "tdr": _tdr,
    "histogram": _histogram,
    "delay_map": _delay_map,
    "delay_discharge": _delay_discharge,
}
"""Figures of one estimator by kind."""


# All impulse responses of one day (Fig. 12)


def typical_day(results: Results) -> dt.date | None:
    """The day most estimators answer, and of those the one of median condition number; None without one."""
    answers: dict[dt.date, int] = {}
    conditions: dict[dt.date, float] = {}
    for e in results.estimators:
        for i in np.flatnonzero(e.answered & np.isfinite(e.fir).any(axis=1)):
            answers[e.dates[i]] = answers.get(e.dates[i], 0) + 1
            if np.isfinite(e.condition[i]):
                conditions.setdefault(e.dates[i], float(e.condition[i]))
    if not answers:
        return None
    most = max(answers.values())
    days = sorted(day for day, n in answers.items() if n == most)
    logs = np.log10([max(conditions.get(day, 1.0), 1.0) for day in days])
    return days[int(np.argmin(np.abs(logs - np.median(logs))))]


def _fir_day(results: Results, day: dt.date | None) -> Drawn | None:
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
    unit, columns = results.output_unit, 1 if len(shown) == 1 else 2
    figure, panels = style.sheet(
        f"Impulse responses of {chosen}",
        f"{results.reach} · h[k] in {response_unit(unit)} against the lag k in samples",
        [1.25] * -(-len(shown) // columns), [1.0] * columns, gap=(0.65, 0.9), right=0.25, top=1.07,
        bottom=0.68,
    )  # fmt: skip
    # the last lag holds the rest of the truncated response and does not set the scale
    values = np.concatenate([e.fir[i][:-1] for e, i in shown])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.12 * (high - low) or 1.0
    for ax, (e, i) in zip(panels, shown, strict=False):
        _response(ax, e, i, results.sample_time)
        ax.set_ylim(low - margin, high + margin)
    for ax in panels[len(shown) :]:
        ax.remove()
    band = any(e.fir_sd is not None for e, _ in shown)
    caption = captions.fir_day([e.estimator for e, _ in shown], unit, band=band)
    return figure, f"Impulse responses of {chosen}", caption


def _response(ax: Axes, e: EstimatorResults, i: int, sample_time: float) -> None:
    d, t50 = float(e.delay[i]), float(e.t50[i])
    estimates.response(ax, e.fir[i], delay=d, sd=None if e.fir_sd is None else e.fir_sd[i], t50=t50)
    ax.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    ax.yaxis.get_offset_text().set(fontsize=7.5, color=style.GREY)
    facts = []
    if np.isfinite(d):
        facts.append(f"d = {samples_first([d], sample_time)}")
        if e.probability is not None:
            facts.append(f"probability {probability(float(e.probability[i]))}")
    if np.isfinite(t50):
        facts.append(f"t50 = {delays([round(t50, 1)], sample_time)}")
    style.heading(ax, e.estimator, at=1, up=16, fontweight="bold")
    style.heading(ax, " · ".join(facts) or "no delay of its own", at=1, fontsize=8, color=style.GREY)
    estimates.grey_bar(ax, e.fir[i])
