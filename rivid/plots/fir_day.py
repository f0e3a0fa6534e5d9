"""All impulse responses of one day (Fig. 12): what each estimator makes of the same data."""

import datetime as dt
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from rivid.errors import ConfigError
from rivid.estimators import ESTIMATORS
from rivid.plots import style
from rivid.plots.style import FigureFile
from rivid.plots.tdr import grey_limits
from rivid.results.read import EstimatorResults, Results
from rivid.text import delays, probability, response_unit, samples_first


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


def draw(results: Results, folder: Path, *, day: dt.date | None = None) -> FigureFile | None:
    """Draw the impulse responses of one day, a panel per estimator, each over its grey bar.

    Parameters
    ----------
    results : Results
        All of the run.
    folder : Path
        Where ``fir_day.png`` goes.
    day : datetime.date, optional
        A typical day by default.

    Returns
    -------
    FigureFile or None
        None where no day has an answer.

    Raises
    ------
    ConfigError
        Where no estimator has an answer for `day`.

    Notes
    -----
    Source: Fig. 12.
    """
    chosen = typical_day(results) if day is None else day
    shown = []
    for e in results.estimators:
        if chosen in e.dates and e.answered[(i := e.dates.index(chosen))] and np.isfinite(e.fir[i]).any():
            shown.append((e, i))
    if not shown or chosen is None:
        if day is None:
            return None
        raise ConfigError(f"no impulse response on {day}: choose a day with status ok in delays.csv")
    columns = 1 if len(shown) == 1 else 2
    rows = -(-len(shown) // columns)
    page = style.sheet(
        f"Impulse responses of {chosen}",
        f"{results.reach} · h[k] in {response_unit(results.output_unit)} against the lag k in samples",
        height=0.85 + 2.15 * rows,
    )
    page.axes.remove()
    width, height = style.WIDTH, float(page.figure.get_size_inches()[1])
    gap = 0.65
    each = ((style.WIDTH - 0.68 - 0.25) - gap * (columns - 1)) / columns
    for number, (e, i) in enumerate(shown):
        row, column = divmod(number, columns)
        x = (0.68 + column * (each + gap)) / width
        y = (height - 0.72 - 2.15 * row - 1.45 - 0.12) / height
        axes = page.figure.add_axes((x, y, each / width, 1.25 / height))
        bar = page.figure.add_axes((x, y - 0.17 / height, each / width, 0.11 / height))
        _panel(axes, bar, e, i, results.sample_time, _limits(shown))
    path = folder / "fir_day.png"
    style.save(page.figure, path)
    return style.figure_file(
        page, "fir_day", "", path, f"Impulse responses of {chosen}", _caption(results, shown)
    )


def _limits(shown: list[tuple[EstimatorResults, int]]) -> tuple[float, float]:
    """One y axis for all panels; not from the last lag, where the truncated rest gathers."""
    values = np.concatenate([e.fir[i][:-1] for e, i in shown])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.12 * (high - low) or 1.0
    return low - margin, high + margin


def _panel(
    axes: Axes, bar: Axes, e: EstimatorResults, i: int, sample_time: float, limits: tuple[float, float]
) -> None:
    h = e.fir[i]
    k = np.arange(len(h))
    d = e.delay[i]
    axes.axhline(0, color=style.LIGHT, lw=0.7)
    if e.fir_sd is not None:
        sd = e.fir_sd[i]
        axes.fill_between(k, h - 2 * sd, h + 2 * sd, color=style.LIGHT, alpha=0.5, linewidth=0)
    axes.plot(k, h, color=style.INK, lw=1.0, marker="o", ms=2.4)
    axes.set_ylim(limits)
    axes.set_xlim(-0.5, len(h) - 0.5)
    axes.spines["right"].set_visible(False)
    axes.spines["bottom"].set_visible(False)
    style.no_ticks(axes)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 5, 10]))
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
    axes.yaxis.get_offset_text().set_fontsize(7.5)
    axes.yaxis.get_offset_text().set_color(style.GREY)
    notes = []
    if np.isfinite(d):
        axes.axvspan(d, d + 1, color=style.ACCENT, alpha=0.18, linewidth=0)
        axes.plot([d, d + 1], h[int(d) : int(d) + 2], color=style.ACCENT, lw=1.8, marker="o", ms=3.2)
        notes.append(f"d = {samples_first([float(d)], sample_time)}")
        if e.probability is not None:
            notes.append(f"probability {probability(float(e.probability[i]))}")
    if np.isfinite(e.t50[i]):
        axes.axvline(e.t50[i], color=style.WATER, lw=1.0, ls=(0, (4, 2)))
        notes.append(f"t50 = {delays([round(float(e.t50[i]), 1)], sample_time)}")
    note = " · ".join(notes) or "no delay of its own"
    looks: list[tuple[str, int, dict[str, Any]]] = [
        (e.estimator, 16, {"fontsize": 8.5, "fontweight": "bold"}),
        (note, 4, {"fontsize": 8, "color": style.GREY}),
    ]
    for words, up, look in looks:
        axes.annotate(
            words, (1, 1), xycoords="axes fraction", xytext=(0, up), textcoords="offset points", ha="right",
            **look,
        )  # fmt: skip
    low, high = grey_limits(h)
    bar.imshow(
        h[None, :], cmap="Greys", aspect="auto", extent=(-0.5, len(h) - 0.5, 0, 1), vmin=low, vmax=high
    )
    bar.yaxis.set_ticks([])
    bar.xaxis.set_major_locator(MaxNLocator(nbins=8, integer=True, steps=[1, 2, 5, 10]))
    for spine in bar.spines.values():
        spine.set_visible(True)
        spine.set_linewidth(0.5)


def _caption(results: Results, shown: list[tuple[EstimatorResults, int]]) -> str:
    text = _CAPTION
    if any(ESTIMATORS[e.estimator].has_probability for e, _ in shown):
        text += (
            " The posterior's response is the mean of its likeliest equations; where the outflow is logged, "
            "it is what the level does while the outflow is held, without the people's answer."
        )
    if any(ESTIMATORS[e.estimator].method == "CUSUM" for e, _ in shown):
        text += " CUSUM does not shape the response: there, the step is where its mean is found to change."
    if any(e.fir_sd is not None for e, _ in shown):
        text += " The grey band is two standard deviations to either side."
    if results.output_unit == "m":
        return text
    return f"{text} The dashed blue line is t50: half of a step has arrived."


_CAPTION = (
    "The same day's data through each estimator. The coloured step from d to d + 1 is where the estimator "
    "lets the response jump. Under each panel, the response as a grey bar of the time-day representation."
)
