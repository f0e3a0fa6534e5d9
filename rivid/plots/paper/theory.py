"""Fig. 10, the theoretical impulse response, and the priors in use: what is believed before any data."""

from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator, NullLocator

from rivid.plots import style
from rivid.plots.paper.estimates import Estimates
from rivid.plots.paper.sheets import (
    PaperFigure,
    delay_ticks,
    minutes_above,
    name_panel,
    power_of_ten,
    save,
    sheet,
)
from rivid.reach.integrator import theoretical_fir
from rivid.results.selection import rayleigh
from rivid.text import number, response_unit, time_unit
from rivid.types import Floats

DELAY, ALPHA_I, ALPHA_O, K_Q, K_H = 7, 1e-4, 1.2e-4, 1.0, -1000.0
"""Of the paper's example: d [samples], K_i T_s / A and K_o T_s / A [m per m3/s], K_Q [-], K_h [m2/s]."""

SHOWN = 50
"""Lags of Fig. 10."""


def response(sample_time: float, folder: Path) -> PaperFigure:
    """Fig. 10: the response (10) with the paper's numbers."""
    h = 1e4 * theoretical_fir(SHOWN, DELAY, ALPHA_I, ALPHA_O, K_Q, K_H)
    k = np.arange(SHOWN)
    title = "A theoretical impulse response"
    page = sheet(
        "10", title,
        "d = 7, K_i T_s / A = 1e-4 s/m², K_o T_s / A = 1.2e-4 s/m², K_Q = 1, K_h = −1000 m²/s",
        height=2.9, top=0.85,
    )  # fmt: skip
    axes = page.panels[0]
    axes.axhline(0, color=style.LIGHT, lw=0.7)
    axes.plot(k, h, color=style.INK, lw=1.2, marker="o", ms=3.5)
    for n, (at, words) in enumerate(((0, "people act at once"), (DELAY, "the inflow arrives"))):
        axes.plot([at, at + 1], h[at : at + 2], color=style.ACCENT, lw=2.2, marker="o", ms=4.5)
        axes.annotate(
            words, (at + 1, h[at + 1]), xytext=(9, 5 if n else -1), textcoords="offset points",
            color=style.ACCENT, va="center",
        )  # fmt: skip
    axes.set_xlim(-0.8, SHOWN - 0.2)
    axes.set_xlabel("lag k [T_s]")
    axes.set_ylabel("h[k] [10⁻⁴ m per m³/s]")
    axes.grid(True, axis="y")
    axes.spines["right"].set_visible(False)
    minutes_above(axes, sample_time)
    caption = (
        "Two jumps: people answer at lag 1, the inflow itself arrives at lag d + 1; between them all is slow."
    )
    return save(page, folder, "fig10", "10", title, caption)


def priors(estimates: Estimates, day: int, folder: Path) -> PaperFigure:
    """The Rayleigh prior on d (26) and the inverse-gamma prior on sigma_hD2 (32), as in use.

    The second needs a day: its beta_h comes from that day's ML response.
    """
    s, results = estimates.settings, estimates.results
    title = "The priors in use"
    ml, jmap = estimates.of("ml"), estimates.of("jmap")
    M, h = s.order, ml.fir[day]
    nu = float(np.sum(np.convolve(h, (1.0, -2.0, 1.0))[:M] ** 2))  # ||D h_ML||^2
    alpha_h, beta_h = M / 2, nu / 2
    page = sheet(
        "11", title,
        f"{results.reach} · sigma_d = {number(s.delay_scale)} T_s · alpha_h = M/2 = {number(alpha_h)}, "
        f"beta_h = ‖D h_ML‖²/2 = {beta_h:.1e} on {jmap.dates[day]}",
        height=2.7, columns=2, gap=(0.75, 0.0), right=0.3, bottom=0.85, top=0.9,
    )  # fmt: skip
    left, right = page.panels
    d = np.arange(s.d_min, s.d_max + 1.0)
    handles = list(
        left.plot(d, rayleigh(d, s.delay_scale), color=style.WATER, marker="o", ms=3.5, lw=1.2, label="prior")
    )
    uniform = np.full(len(d), 1 / len(d))
    handles += left.plot(d, uniform, color=style.GREY, lw=1.1, ls=(0, (4, 2)), label="uniform prior")
    left.set_ylim(0, None)
    left.set_ylabel("probability")
    delay_ticks(left, s.d_min, s.d_max, results.sample_time)
    unit, _ = time_unit(s.d_max * results.sample_time)
    left.set_xlabel(f"delay d: above in T_s, below in {unit}")
    name_panel(left, "a", "Rayleigh prior on the delay (26)")

    ten = ""
    if np.isfinite(nu) and nu > 0:
        sd = np.linspace(0.01, 2.0, 400) * np.sqrt(beta_h / (alpha_h + 1))
        factor, ten = power_of_ten(sd)
        right.plot(factor * sd, _density(sd, alpha_h, beta_h), color=style.WATER, lw=1.4)
        at = factor * float(jmap.roughness_sd[day])
        handles.append(right.axvline(at, color=style.ACCENT, lw=1.6, label="estimated by Table VI"))
        right.set_xlim(0, factor * sd[-1])
    right.set_ylim(0, None)
    right.yaxis.set_major_locator(NullLocator())
    right.xaxis.set_major_locator(MaxNLocator(nbins=6))
    right.set_ylabel("density")
    right.set_xlabel(f"sigma_hD, roughness of the response [{ten}{response_unit(results.output_unit)}]")
    name_panel(right, "b", "inverse-gamma prior on sigma_hD² (32)")
    for axes in page.panels:
        axes.spines["right"].set_visible(False)
        axes.grid(True, axis="y")
    width, height = (float(v) for v in page.figure.get_size_inches())
    page.figure.legend(
        handles=handles, loc="upper right", bbox_to_anchor=(1 - 0.3 / width, 1 - 0.14 / height),
        ncols=len(handles),
    )  # fmt: skip
    caption = (
        "What is believed before any data: a delay near sigma_d, and a response about as rough as the ML's."
    )
    return save(page, folder, "fig11_priors", "11", title, caption)


def _density(sd: Floats, alpha_h: float, beta_h: float) -> Floats:
    """Inverse gamma of sigma_hD2, as a density over sigma_hD, its highest point 1."""
    variance = sd**2
    logs = -(alpha_h + 1) * np.log(variance) - beta_h / variance + np.log(2 * sd)
    return np.asarray(np.exp(logs - logs.max()))
