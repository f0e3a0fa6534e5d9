"""Draw the pictures of the guide by rivid's own functions and simulator: docs/pictures/guide_*.png.

Usage: python -m benchmarks.guide_pictures [name ...]
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import rivid
from rivid.core.fir import half_time
from rivid.plots import style
from rivid.reach.integrator import theoretical_fir

Floats = NDArray[np.float64]
ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs" / "pictures"
DAYS = 60


def panels(
    title: str, note: str, shares: list[float], height: float = 3.5, gap: float = 0.75
) -> tuple[Figure, list[Axes]]:
    """Return a figure of `height` inches with panels side by side, with `shares` of the width."""
    margins = {"left": 0.72, "right": 0.2, "top": 0.85, "bottom": 0.62}
    return style.sheet(title, note, [height - 0.85 - 0.62], shares, gap=(gap, 0.0), **margins)


def season(name: str, **changes: Any) -> rivid.SimulatedSeason:
    """Simulate a season of a scenario."""
    settings = {"days": DAYS, "missing_days": 0, "seed": 3} | changes
    return rivid.simulate(ROOT / f"configs/scenarios/{name}.toml", **settings)


def arrays(found: rivid.SimulatedSeason) -> tuple[Floats, Floats, Floats]:
    """Return u, y and o of all days, shape (days, N)."""
    days = [found.day(i) for i in range(len(found.dates))]
    return tuple(np.stack([getattr(day, name) for day in days]) for name in ("u", "y", "o"))


def correlation(a: Floats, b: Floats, lags: int) -> Floats:
    """Return the correlation of a with b for delays of b from 0 to `lags` - 1 samples."""
    n = a.shape[1]
    return np.array([np.corrcoef(a[:, : n - k].ravel(), b[:, k:].ravel())[0, 1] for k in range(lags)])


def feedback() -> Figure:
    """Draw a step of the inflow with and without operators, and the correlations of moves."""
    d, lags = 7, 20
    alone = theoretical_fir(lags, d, 2e-4, 2e-4, 0.0, 0.0)
    operated = theoretical_fir(lags, d, 2e-4, 2e-4, 1.0, -300.0)
    figure, (step, seen) = panels(
        "Feedback hides the delay",
        "Left: equations (8) to (10), d = 7. Right: 60 simulated days with operators",
        [1, 1.15],
    )
    k = np.arange(lags)
    for h, colour, words, at in (
        (alone, style.WATER, "outflow held:\nthe water alone", (7.4, 9.5)),
        (operated, style.INK, "operators act at once", (8.6, -14)),
    ):
        step.plot(k, 1e4 * np.cumsum(h), color=colour, lw=1.4, marker="o", ms=3)
        step.annotate(words, at, color=colour, ha="right" if colour == style.WATER else "left")
    step.axvline(d + 1, color=style.ACCENT, lw=0.9, ls=(0, (4, 3)))
    step.annotate("the wave arrives", (d + 0.7, 24.5), color=style.ACCENT, ha="right")
    step.set_xlabel("samples after the inflow rose by 1 m³/s")
    step.set_ylabel("level [10⁻⁴ m]")
    step.set_ylim(-16, 27)
    found = season("basse_isere")
    moves = np.diff(found.inflow, axis=1)
    outflow = correlation(moves, np.diff(found.outflow, axis=1), lags)
    level = correlation(moves, np.diff(found.level, axis=1), lags)
    seen.axhline(0, color=style.LIGHT, lw=0.7)
    seen.bar(k - 0.2, outflow, 0.4, color=style.INK, label="outflow: the operators")
    seen.bar(k + 0.2, level, 0.4, color=style.WATER, label="level at the gauge")
    arrival = int(np.median(found.delay)) + 1
    seen.axvline(arrival, color=style.ACCENT, lw=0.9, ls=(0, (4, 3)))
    seen.annotate("the wave arrives", (arrival + 0.4, 0.86), color=style.ACCENT)
    seen.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=2)
    seen.set_xlabel("samples after a move of the inflow")
    seen.set_ylabel("correlation of moves")
    seen.set_ylim(-0.3, 1)
    for axes in (step, seen):
        axes.spines["right"].set_visible(False)
        axes.xaxis.set_major_locator(style.MaxNLocator(nbins=6, integer=True))
    return figure


def response() -> Figure:
    """Draw one day's response by maximum likelihood, smooth, and smooth with free jumps."""
    day = rivid.read_day(
        ROOT / "sample_data/basse_isere_csv/2008-03-11.csv", config=ROOT / "configs/basse_isere.toml"
    )
    record = json.loads((ROOT / "sample_data/basse_isere_truth.json").read_text(encoding="utf-8"))
    truth = next(one["delay_samples"] for one in record["days"] if one["date"] == str(day.date))
    raw, smooth, joint = rivid.ml(day.u, day.y), rivid.map_fir(day.u, day.y), rivid.jmap(day)
    figure, axes = panels(
        "What the response shows",
        f"{day.date}, simulated sample data: one day, three estimators; true delay {truth}",
        [1, 1, 1], gap=0.25,
    )  # fmt: skip
    names = ("maximum likelihood (17)", "smooth (22)", "smooth but for two jumps (Table VI)")
    k = np.arange(len(raw.fir))
    for panel, fit, name in zip(axes, (raw, smooth, joint), names, strict=True):
        panel.axhline(0, color=style.LIGHT, lw=0.7)
        panel.plot(k, 1e4 * fit.fir, color=style.INK, lw=1.2, marker="o", ms=2.8)
        panel.annotate(name, (0.0, 1.03), xycoords="axes fraction")
        panel.set_xlabel("lag [samples]")
        panel.set_xlim(-0.7, 24.5)
        panel.set_ylim(-4.6, 3)
        panel.spines["right"].set_visible(False)
        if panel is not axes[0]:
            panel.tick_params(labelleft=False)
    d = int(joint.delay)
    axes[2].plot(k[d : d + 2], 1e4 * joint.fir[d : d + 2], color=style.ACCENT, lw=2.4, marker="o", ms=4)
    axes[2].annotate(f"the jump: d = {d}", (d + 1.6, 1e4 * joint.fir[d + 1] + 1.1), color=style.ACCENT)
    axes[0].set_ylabel("h [10⁻⁴ m per m³/s]")
    return figure


def prior() -> Figure:
    """Draw the estimates on three reaches, and those on shuffled days, which contain no delay."""
    reaches = {"short": "short reach", "basse_isere": "reach of Table I", "long": "long reach"}
    figure, axes = panels(
        "What the prior does",
        f"Delays by jmap as published (sigma_d = 6.5) on {DAYS} simulated days of each reach, and on shuffled days",
        [1, 1, 1], gap=0.25,
    )  # fmt: skip
    edges = np.arange(1, 16)
    for panel, (name, words) in zip(axes, reaches.items(), strict=True):
        found = season(name)
        u, y, _ = arrays(found)
        real, chance = (rivid.jmap(v, y).delay for v in (u, np.roll(u, 7, axis=0)))
        panel.axvspan(found.delay.min() - 0.5, found.delay.max() + 0.5, color=style.ACCENT, alpha=0.16, lw=0)
        panel.annotate(
            "true", (found.delay.mean(), 101), ha="center", va="top", color=style.ACCENT, fontsize=8.5
        )
        for values, colour, label, shift in (
            (real, style.INK, "its days", -0.2),
            (chance, style.LIGHT, "shuffled days", 0.2),
        ):
            share = [100 * np.mean(values == d) for d in edges]
            panel.bar(edges + shift, share, 0.4, color=colour, label=label)
        panel.annotate(words, (0.0, 1.03), xycoords="axes fraction")
        panel.set_xlabel("delay d [samples]")
        panel.set_xlim(0.4, 15.6)
        panel.set_ylim(0, 103)
        panel.spines["right"].set_visible(False)
        panel.xaxis.set_major_locator(style.MaxNLocator(nbins=8, integer=True))
        if panel is not axes[0]:
            panel.tick_params(labelleft=False)
    axes[0].set_ylabel("share of days [%]")
    axes[2].legend(loc="upper left", bbox_to_anchor=(0.03, 0.98))
    return figure


def probability() -> Figure:
    """Draw p(d) of a certain and an uncertain day, and of a season with its true delays."""
    found = season("basse_isere", days=45)
    u, y, o = arrays(found)
    answer = rivid.posterior(u, y, o)
    order = np.argsort(np.where(np.isfinite(answer.probability), answer.probability, 2.0))
    unsure, sure = order[0], order[np.isfinite(answer.probability).sum() - 1]
    figure, (one, other, many) = panels(
        "What p(d) means",
        "Two days of the reach of Table I, and 45 days of it in a row; simulated, so the truth is known",
        [0.7, 0.7, 2], gap=0.5,
    )  # fmt: skip
    for axes, at, words in ((one, sure, "a sure day"), (other, unsure, "an unsure one")):
        axes.bar(answer.candidates, answer.probabilities[at], 0.75, color=style.INK)
        axes.plot([found.delay[at]], [1.04], marker="v", color=style.ACCENT, ms=6, clip_on=False)
        axes.annotate(words, (0.0, 1.09), xycoords="axes fraction")
        axes.set_xlim(3.4, 10.6)
        axes.set_ylim(0, 1)
        axes.set_xlabel("delay d [samples]")
        axes.spines["right"].set_visible(False)
        axes.xaxis.set_major_locator(style.MaxNLocator(nbins=8, integer=True))
    one.set_ylabel("probability")
    other.tick_params(labelleft=False)
    n = len(found.dates)
    shade = np.nan_to_num(answer.probabilities.T)
    many.imshow(
        shade, cmap="Greys", vmin=0, vmax=1, aspect="auto", origin="lower", interpolation="nearest",
        extent=(0.5, n + 0.5, answer.candidates[0] - 0.5, answer.candidates[-1] + 0.5),
    )  # fmt: skip
    many.plot(
        np.arange(1, n + 1), found.delay, ls="none", marker="o", ms=4.2, mfc="none", mec=style.ACCENT, mew=1.1
    )
    none = ~np.isfinite(answer.delay)
    many.plot(
        np.flatnonzero(none) + 1, np.full(none.sum(), 3.75), ls="none", marker="x", ms=4.5, color=style.GREY
    )
    many.set_ylim(3.4, 10.6)
    many.set_xlabel("day")
    many.set_ylabel("delay d [samples]")
    many.annotate("black: p near 1     ", (0.0, 1.03), xycoords="axes fraction")
    many.annotate("circle: the truth", (0.34, 1.03), xycoords="axes fraction", color=style.ACCENT)
    many.annotate("×: no answer", (0.66, 1.03), xycoords="axes fraction", color=style.GREY)
    many.spines["right"].set_visible(False)
    return figure


def river() -> Figure:
    """Draw the arrived share of a step by lag, at low and at high flow, from measured days."""
    figure, (flow, step) = panels(
        "A river has no single delay",
        "Measured: the Colorado from Lees Ferry to mile 30, windows of three days",
        [1.15, 1],
    )  # fmt: skip
    days = (("2025-01-15", style.INK), ("2024-11-20", style.WATER))
    for date, colour in days:
        day = rivid.read_day(
            ROOT / "sample_data/glen_canyon", date=date, config=ROOT / "configs/glen_canyon_rm30.toml"
        )
        settings = day.config.jmap_settings()
        fit = rivid.map_fir(
            day.u, day.y, settings.order, day.config.jmap.alpha, free_start=settings.free_start
        )
        hours = (np.arange(settings.order) + 0.5) * day.sample_time / 3600  # centre of the response's bin
        arrived = np.cumsum(fit.fir) / fit.fir.sum()
        t50 = float(half_time(fit.fir[None])[0]) * day.sample_time / 3600
        mean = day.inflow.mean()
        step.plot(hours, 100 * arrived, color=colour, lw=1.5, label=f"{mean:.0f} m³/s: t50 {t50:.1f} h")
        step.plot([t50, t50], [-5, 50], color=colour, lw=0.9, ls=(0, (4, 3)))
        flow.plot(day.hours, day.inflow, color=colour, lw=1.2)
        flow.plot(day.hours, day.output, color=colour, lw=1.2, ls=(0, (3, 2)))
    step.axhline(50, color=style.LIGHT, lw=0.8)
    step.set_xlabel("hours after a step of the inflow")
    step.set_ylabel("arrived [%]")
    step.set_ylim(-5, 112)
    step.set_xlim(0, 14)
    step.legend(loc="upper left", bbox_to_anchor=(0.02, 0.98))
    flow.set_xlabel("hours")
    flow.set_ylabel("discharge [m³/s]")
    flow.set_xlim(0, 72)
    flow.annotate("full line: Lees Ferry     dashed: mile 30", (0.0, 1.03), xycoords="axes fraction")
    for axes in (flow, step):
        axes.spines["right"].set_visible(False)
    return figure


def diagnosis() -> Figure:
    """Draw the unexplained inflow of a season by hour, before and after, and the reduced error."""
    found = season("intermittent", days=30, effects=[{"name": "diurnal_inflow", "amplitude": 6.0}])
    answer = rivid.diagnose(found)
    seen = answer.evidence
    assert seen is not None and answer.gap is not None
    figure, (hours, errors) = panels(
        "What a diagnosis shows",
        "30 simulated days; water that comes and goes with the hour, 6 m³/s to either side, is in no log",
        [1.3, 1],
    )  # fmt: skip
    record = seen.record
    hour = np.mod(record.time, 86400.0) / 3600.0
    bins = np.arange(25)
    for inflow, colour, words in (
        (seen.inflow_before, style.ACCENT, "unexplained, before"),
        (seen.inflow_after, style.WATER, "after the effect is added"),
    ):
        kept = record.used
        at = np.digitize(hour[kept], bins) - 1
        values = inflow[kept]
        mean = [values[at == b].mean() for b in bins[:-1]]
        hours.plot(bins[:-1] + 0.5, mean, color=colour, lw=1.5, marker="o", ms=3, label=words)
    planted = found.effects[0]
    truth = planted.amplitude * np.cos(2 * np.pi * (bins + 0.0 - planted.hour) / 24)
    hours.plot(bins, truth, color=style.GREY, lw=1.0, ls=(0, (4, 3)), label="what was hidden")
    hours.axhline(0, color=style.LIGHT, lw=0.7)
    hours.set_xlim(0, 24)
    hours.set_xticks(range(0, 25, 4))
    hours.set_xlabel("hour of the day")
    hours.set_ylabel("unexplained inflow [m³/s]")
    hours.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=3)
    at = np.arange(len(answer.gap.horizon_h))
    mm = 1000.0
    errors.bar(at - 0.2, mm * np.array(answer.gap.rmse_baseline), 0.38, color=style.ACCENT)
    errors.bar(at + 0.2, mm * np.array(answer.gap.rmse_augmented), 0.38, color=style.WATER)
    errors.set_xticks(at, [f"{h:g} h ahead" for h in answer.gap.horizon_h])
    errors.set_ylabel("error on sealed days [mm]")
    for axes in (hours, errors):
        axes.spines["right"].set_visible(False)
    return figure


ALL = {one.__name__: one for one in (feedback, response, prior, probability, river, diagnosis)}


def main(names: list[str]) -> None:
    """Draw the named pictures, or all."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in names or ALL:
        with style.styled():
            style.save(ALL[name](), PICTURES / f"guide_{name}.png")
        print(f"docs/pictures/guide_{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
