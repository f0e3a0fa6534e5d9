"""Fig. 19: how far the delay varies in each reach of a cascade, estimated and by experience."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.patches import Patch

from rivid.config import Config
from rivid.core.hydraulics import propose_delays, travel_bounds
from rivid.core.jmap import jmap
from rivid.core.settings import JmapSettings
from rivid.plots import style
from rivid.plots.paper.sheets import PaperFigure, legend, save, sheet
from rivid.plots.paper.year import Year
from rivid.text import listed
from rivid.types import Floats

EMPIRICAL = 3
"""The operators' uncertainty: three sampling periods either side of their nominal value (section VI)."""

HELD = 0.9
"""Share of the days that a fluctuation interval holds."""


@dataclass(frozen=True, eq=False)
class CascadeReach:
    """One reach of Fig. 19.

    Attributes
    ----------
    name : str
    length : float
        [m].
    sample_time : float
        T_s [s].
    delay : ndarray, shape (days,)
        Estimates with the uniform prior [samples].
    nominal : int
        The operators' value [samples]; nobody can be asked in a simulation, so it is the gravity wave's
        travel time in the middle of the usual discharges.
    truth : ndarray, shape (days,) or (0,)
        True delays [samples], where they are known.
    """

    name: str
    length: float
    sample_time: float
    delay: Floats
    nominal: int
    truth: Floats

    @property
    def empirical(self) -> tuple[int, int]:
        """The operators' interval [samples]."""
        return max(self.nominal - EMPIRICAL, 1), self.nominal + EMPIRICAL

    @property
    def estimated(self) -> tuple[int, int]:
        """The fluctuation interval of the estimates [samples]."""
        return shortest(self.delay)


def shortest(delay: Floats, held: float = HELD) -> tuple[int, int]:
    """The shortest interval of whole delays that holds a share of the days; the lowest of equals.

    Examples
    --------
    >>> shortest(np.array([1.0, 6, 6, 6, 7, 7, 7, 7, 7, 15]), 0.8)
    (6, 7)
    """
    d = np.sort(delay[np.isfinite(delay)]).astype(int)
    if not len(d):
        return 0, 0
    n = max(int(np.ceil(held * len(d) - 1e-9)), 1)
    widths = d[n - 1 :] - d[: len(d) - n + 1]
    i = int(np.argmin(widths))
    return int(d[i]), int(d[i + n - 1])


def of_year(year: Year, truth: Floats | None = None, settings: JmapSettings | None = None) -> CascadeReach:
    """A reach of the cascade from its logs: the JMAP with uniform prior and fixed alpha.

    Parameters
    ----------
    year : Year
    truth : ndarray, shape (days,), optional
        True delays [samples].
    settings : JmapSettings, optional
        The configuration's by default, with the uniform prior.
    """
    settings = settings or year.config.jmap_settings("uniform", fixed_alpha=True)
    delay = np.full(len(year.dates), np.nan)
    for days, inflow, _, level in year.groups(settings.order):
        delay[days] = jmap(inflow - inflow[:, :1], level - level[:, :1], settings).delay
    reach = year.config.reach
    bounds = travel_bounds(reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth)
    nominal = round(float(bounds.gravity.mean()) / reach.sample_time)
    known = np.empty(0) if truth is None else truth
    return CascadeReach(reach.name, reach.length, reach.sample_time, delay, nominal, known)


def own_bounds(config: Config) -> Config:
    """The same configuration, with order, d_max and sigma_d from the reach's hydraulics."""
    reach = config.reach
    proposal = propose_delays(
        reach.discharge_range, length=reach.length, width=reach.width, depth=reach.depth,
        sample_time=reach.sample_time, kind=reach.kind,
    )  # fmt: skip
    changes = {"order": proposal.order, "d_max": proposal.d_max, "sigma_d": proposal.delay_scale}
    return config.model_copy(update={"jmap": config.jmap.model_copy(update=changes)})


def draw(reaches: Sequence[CascadeReach], folder: Path) -> PaperFigure:
    """Draw Fig. 19.

    Parameters
    ----------
    reaches : sequence of CascadeReach
        All of one sampling period.
    folder : Path
        Where ``fig19.svg`` and ``fig19.png`` go.

    Returns
    -------
    PaperFigure
    """
    title = "Delays of the reaches of a cascade"
    halved = [r.name for r in reaches if _width(r.estimated) <= _width(r.empirical) / 2]
    told = f"interval halved on {listed(halved)}" if halved else "no interval is halved"
    page = sheet("19", title, f"JMAP with uniform prior · {told}")
    axes = page.panels[0]
    top = 1.0
    span = max(r.length for r in reaches) / 1000
    shift = 0.016 * span
    for r in reaches:
        x, top = r.length / 1000, max(top, r.empirical[1], float(np.nanmax(r.delay, initial=1)))
        axes.plot(
            [x - 1.3 * shift] * 2, r.empirical, color=style.LIGHT, lw=9, solid_capstyle="butt", zorder=2
        )
        axes.plot([x + shift] * 2, r.estimated, color=style.INK, lw=2.2, zorder=3)
        for edge in r.estimated:
            axes.plot([x + 0.6 * shift, x + 1.4 * shift], [edge] * 2, color=style.INK, lw=2.2, zorder=3)
        at, days = np.unique(r.delay[np.isfinite(r.delay)], return_counts=True)
        if len(days):
            axes.scatter(
                np.full(len(at), x + 2.2 * shift),
                at,
                s=90 * days / days.sum(),
                color=style.ACCENT,
                lw=0,
                zorder=3,
            )
        if len(r.truth):
            low, high = float(r.truth.min()), float(r.truth.max())
            axes.fill_betweenx([low - 0.3, high + 0.3], x - 0.35 * shift, x + 0.35 * shift, color=style.WATER)
        axes.annotate(
            r.name, (x, 0), xycoords=("data", "axes fraction"), xytext=(0, 4), textcoords="offset points",
            ha="center", fontsize=8, color=style.GREY,
        )  # fmt: skip
    axes.set_xlim(0, span * 1.12)
    style.lag_ticks(axes, -1.2, top + 1.0)
    axes.set_ylim(-1.2, top + 1.0)
    axes.set_xlabel("reach length [km]")
    axes.set_ylabel("delay [T_s]")
    axes.grid(True, axis="y")
    style.second_axis(axes, reaches[0].sample_time, "[minutes]")
    handles: list[object] = [
        Patch(color=style.LIGHT, label="operators' interval (nominal ± 3 T_s)"),
        style.dot(
            "estimated: nine days of ten", marker="|", color=style.INK, markersize=9, markeredgewidth=2
        ),
        style.dot("share of days", marker="o", color=style.ACCENT, markersize=6, markeredgewidth=0),
    ]
    if any(len(r.truth) for r in reaches):
        handles.append(Patch(color=style.WATER, label="true"))
    legend(page, handles)
    caption = (
        "Grey: what operators go by, three sampling periods either side. Dark: nine of ten estimates; "
        "the dots say how often each delay."
    )
    return save(page, folder, "fig19", "19", title, caption)


def _width(interval: tuple[int, int]) -> int:
    return interval[1] - interval[0]
