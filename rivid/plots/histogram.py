"""The histogram of the delays (Fig. 18), with what the prior alone would say."""

from pathlib import Path

import numpy as np
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator

from rivid.estimators import ESTIMATORS
from rivid.plots import style
from rivid.plots.style import FigureFile
from rivid.results.read import EstimatorResults, Results
from rivid.results.selection import candidates, found, rayleigh
from rivid.text import (
    count,
    no_jump,
    number,
    statuses,
    time_unit,
    trust,
)
from rivid.types import Floats


def draw(results: Results, estimator: EstimatorResults, folder: Path) -> FigureFile:
    """Draw the share of days per delay for an estimator that has candidates.

    Parameters
    ----------
    results : Results
        All of the run, for what its estimators share.
    estimator : EstimatorResults
        With at least one candidate.
    folder : Path
        Where ``histogram_<estimator>.png`` goes.

    Returns
    -------
    FigureFile
    """
    e = estimator
    with_delay = found(e)
    n = int(with_delay.sum())
    without = statuses(e.status)
    page = style.sheet(
        f"How often each delay: {e.estimator}",
        f"{results.reach} · {ESTIMATORS[e.estimator].words} · n = {count(n, 'day')}"
        + (f" ({without} left out)" if without else ""),
        height=4.1,
        right=0.25,
        bottom=0.92,
    )
    axes = page.axes
    places = candidates(e)
    d_min, d_max = (float(places[0]), float(places[-1])) if places.size else (np.nan, np.nan)
    handles: list[object] = []
    if n:
        handles += _bars(page, e, places)
        at_bound = int((e.at_bound & with_delay).sum())
        if at_bound:
            handles.append(
                Patch(
                    facecolor=style.FAINT, edgecolor=style.ACCENT, hatch="////", linewidth=0,
                    label=f"at a bound ({at_bound:,})",
                )
            )  # fmt: skip
    else:
        style.say(axes, f"None of the {count(len(e.dates), 'day')} has a delay.")
        axes.set_ylim(0, 100)
    if ESTIMATORS[e.estimator].rayleigh and places.size:
        line = axes.plot(
            places, 100 * rayleigh(places, results.delay_scale), color=style.WATER, lw=1.2,
            marker="o", ms=2.5, label=f"Rayleigh prior alone (sigma_d = {number(results.delay_scale)})",
        )  # fmt: skip
        handles += line
    if e.probability is not None:
        told = np.isfinite(e.probability)
        handles += axes.plot(
            places, 100 * e.criterion[told].mean(axis=0), color=style.WATER, lw=1.2, marker="o", ms=2.5,
            label=f"mean probability ({count(int(told.sum()), 'day')})",
        )  # fmt: skip
    axes.set_ylabel("share of days [%]")
    axes.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
    axes.yaxis.grid(True)
    axes.spines["right"].set_visible(False)
    if places.size:
        _delay_axes(page, d_min, d_max, results.sample_time)
    else:
        style.no_ticks(axes)
    style.key(page, handles)
    path = folder / f"histogram_{e.estimator}.png"
    style.save(page.figure, path)
    return style.figure_file(
        page,
        "histogram",
        e.estimator,
        path,
        "How often each delay",
        _caption(e.estimator, results.output_unit),
    )


def shares(e: EstimatorResults, places: Floats) -> dict[str, Floats]:
    """Share of days [%] at each candidate by how far to trust them; arrays of shape (K,), 100 in all."""
    with_delay = found(e)
    degenerate = np.array([s == "degenerate" for s in e.status], bool)
    classes = {
        "data decide": ~e.prior_only & ~degenerate,
        "data do not decide": e.prior_only & ~degenerate,
        "degenerate": degenerate,
    }
    whole = max(int(with_delay.sum()), 1)
    return {
        name: np.array([100 * np.count_nonzero(e.delay[days & with_delay] == at) / whole for at in places])
        for name, days in classes.items()
    }


def _bars(page: style.Sheet, e: EstimatorResults, places: Floats) -> list[object]:
    """Stacked bars, hatched where they lie at a bound; their legend entries."""
    colours = {"data decide": style.INK, "data do not decide": style.LIGHT, "degenerate": style.GREY}
    n = int(found(e).sum())
    below = np.zeros(len(places))
    handles: list[object] = []
    for name, share in shares(e, places).items():
        if not share.any():
            continue
        drawn = page.axes.bar(places, share, bottom=below, width=0.78, color=colours[name], linewidth=0)
        for patch in (drawn.patches[0], drawn.patches[-1]):
            patch.set(hatch="////", edgecolor=style.ACCENT)
        handles.append(
            Patch(color=colours[name], label=f"{trust(name, e.estimator)} ({round(share.sum() * n / 100):,})")
        )
        below = below + share
    at_bounds = max(float(below[0]), float(below[-1]))
    page.axes.set_ylim(0, max(1.06 * float(below.max()), 1.22 * at_bounds))  # the bounds' names stay readable
    return handles


def _delay_axes(page: style.Sheet, d_min: float, d_max: float, sample_time: float) -> None:
    """Delays in samples under the panel, minutes under them, the bounds as dashed lines."""
    axes = page.axes
    margin = max(0.7, 0.02 * (d_max - d_min))
    axes.set_xlim(d_min - margin, d_max + margin)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=20, integer=True, steps=[1, 2, 5, 10]))
    unit, seconds = time_unit(d_max * sample_time)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda d, _: f"{d:.0f}\n{d * sample_time / seconds:.1f}"))
    axes.tick_params(axis="x", length=3)
    axes.set_xlabel(f"delay d: above in samples, below in {unit} (d T_s)", labelpad=4)
    for bound, side, name in ((d_min, -0.5, "d_min"), (d_max, 0.5, "d_max")):
        axes.axvline(bound + side, color=style.ACCENT, lw=0.8, ls=(0, (4, 3)))
        axes.annotate(
            name, (bound + side, 1), xycoords=("data", "axes fraction"), xytext=(-4 * np.sign(side), -3),
            textcoords="offset points", ha="right" if side > 0 else "left", va="top",
            fontsize=8, color=style.ACCENT, rotation=90,
        )  # fmt: skip


def _caption(name: str, unit: str) -> str:
    text = "Share of days at each delay d. "
    if ESTIMATORS[name].has_probability:
        text += (
            "The line is the mean probability of each delay, over the days with a delay and those where none "
            "is probable enough. "
        )
    elif not ESTIMATORS[name].unjudged:
        text += (
            "Dark: the data alone say the same delay, to within a sample. Light: "
            "they favour another, or none, so the prior, or chance, decides. "
        )
    text += "Hatched bars lie at d_min or d_max"
    text += "." if ESTIMATORS[name].has_probability else ": the delay may be outside."
    if ESTIMATORS[name].rayleigh:
        text += " The line is the Rayleigh prior itself, before any data."
    return text if unit == "m" else f"{text} {no_jump(name)}"
