"""Figs 13-16: the impulse responses of the year side by side, the time-day representation (TDR)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rivid.plots import style
from rivid.plots.dates import date_axis
from rivid.plots.paper.estimates import Estimates
from rivid.plots.paper.sheets import PaperFigure, legend, save, sheet
from rivid.plots.tdr import bars, grey_limits
from rivid.results.selection import day_numbers, found
from rivid.text import count, response_unit


@dataclass(frozen=True)
class _Representation:
    number: str
    estimator: str
    title: str
    caption: str


REPRESENTATIONS = (
    _Representation(
        "13", "ml", "Responses of the ML estimator",
        "Rough, but two jumps in grey can be seen: people act at lag 1, the inflow arrives at d + 1.",
    ),
    _Representation(
        "14", "map", "Responses of the MAP estimator",
        "Smoother along the lags, and the jumps are blurred.",
    ),
    _Representation(
        "15", "jmap-uniform", "Responses of the JMAP, uniform prior, alpha fixed",
        "Smooth, with a sharp jump where the estimator puts it (coloured), from each day's data alone.",
    ),
    _Representation(
        "16", "jmap", "Responses of the JMAP, Rayleigh prior",
        "The same with the Rayleigh prior on the delay (Table VI).",
    ),
)  # fmt: skip


def draw(estimates: Estimates, folder: Path) -> list[PaperFigure]:
    """Draw Figs 13-16.

    Parameters
    ----------
    estimates : Estimates
    folder : Path
        Where ``fig13.svg`` and so on go, each with its PNG.

    Returns
    -------
    list of PaperFigure

    Notes
    -----
    Source: section VI; white for the lowest value, black for the highest, with sign.
    """
    return [_draw(estimates, said, folder) for said in REPRESENTATIONS]


def _draw(estimates: Estimates, said: _Representation, folder: Path) -> PaperFigure:
    e, results = estimates.of(said.estimator), estimates.results
    answered = int(e.answered.sum())
    low, high = grey_limits(e.fir)
    note = f"{results.reach} · {count(answered, 'day')}"
    if said.estimator in ("map", "jmap-uniform"):
        note += f" · alpha = {estimates.alpha:g} (m³/s)²"
    if said.estimator == "jmap":
        note += f" · sigma_d = {estimates.settings.delay_scale:g} T_s"
    unit = response_unit(results.output_unit)
    note += f" · white {low:.1e}, black {high:.1e} {unit}".replace("-", "−").replace("e−0", "e−")
    with_delay = found(e)
    page = sheet(said.number, said.title, note, height=3.0)
    axes = page.panels[0]
    first, last = e.dates[0], e.dates[-1]
    date_axis(axes, first, last)
    M = e.fir.shape[1]
    axes.set_facecolor(style.NO_DATA)
    image = bars(e)
    if answered:
        axes.imshow(
            np.repeat(image, -(-400 // M), axis=0),  # lags must not flow into each other as narrow days may
            cmap="Greys", vmin=low, vmax=high, origin="lower", aspect="auto",
            extent=(first.toordinal() - 0.5, last.toordinal() + 0.5, -0.5, M - 0.5),
        )  # fmt: skip
        axes.set_autoscale_on(False)
    else:
        style.say(axes, "No day has an impulse response.")
    look = {"marker": "s", "color": style.NO_DATA, "markersize": 6, "markeredgecolor": style.LIGHT}
    entries: list[object] = []
    if with_delay.any():
        x = day_numbers(e.dates)[with_delay]
        half = max(0.5, 0.6 * image.shape[1] / (72 * page.width))  # day; never thinner than can be seen
        axes.hlines(e.delay[with_delay] + 0.5, x - half, x + half, colors=style.ACCENT, linewidths=1.3)
        entries.append(style.dot("jump between d and d + 1", marker="s", color=style.ACCENT, markersize=4))
    if image.shape[1] > answered:
        entries.append(style.dot("no data", **look))
    style.lag_ticks(axes, -0.5, M - 0.5)
    axes.set_ylabel("lag k [T_s]")
    style.second_axis(axes, results.sample_time, "[minutes]")
    legend(page, entries)
    return save(page, folder, f"fig{said.number}", said.number, said.title, said.caption)
