"""One style for all figures: colours, sheets with fixed margins, axes of lags and of dates, files.

Margins are set in inches: layout engines draw every figure twice. Each colour has one meaning: ink for
estimates, vermilion for what needs attention, blue for hydraulics and the prior, beige for no data. They
remain distinct for colour-blind readers.
"""

import datetime as dt
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.container import Container
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from PIL import Image

from rivid.atomic import replacing
from rivid.plots.files import FigureFile
from rivid.results.read import day_numbers
from rivid.text import NO_ANSWER, shorten, ten_to, time_unit
from rivid.types import Floats

INK = "#262B31"
GREY = "#68707A"
LIGHT = "#B4BBC3"
FAINT = "#E4E7EA"
ACCENT = "#D55E00"
WATER = "#0072B2"
NO_DATA = "#F4E8D4"
STATUS_COLOURS = {"failed": ACCENT, "unidentifiable": INK, "pending": LIGHT}

DPI = 150
WIDTH = 9.2  # width of every figure [inch]
VECTOR_DPI = 300  # resolution of images inside a vector file, such as the time-day representation
NOTE = 130  # characters of the line of facts that fit in the width of a figure

STYLE = {
    **dict.fromkeys(("font.size", "axes.labelsize", "xtick.labelsize", "ytick.labelsize"), 8.5),
    **dict.fromkeys(("text.color", "axes.labelcolor", "xtick.labelcolor", "ytick.labelcolor"), INK),
    **dict.fromkeys(("axes.edgecolor", "xtick.color", "ytick.color"), GREY),
    **dict.fromkeys(("axes.facecolor", "figure.facecolor"), "white"),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right", "legend.frameon"), False),
    **dict.fromkeys(("legend.borderpad", "legend.borderaxespad"), 0.0),
    "font.family": "DejaVu Sans",
    "text.parse_math": False,  # the names of reaches are no formulas; see Picture
    "mathtext.default": "regular",
    "axes.linewidth": 0.7,
    "axes.axisbelow": True,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "legend.fontsize": 8,
    "legend.handletextpad": 0.5,
    "legend.columnspacing": 1.4,
    "hatch.linewidth": 0.8,
}


@contextmanager
def styled() -> Iterator[None]:
    """Matplotlib with this style alone: a user's matplotlibrc changes neither look nor bytes."""
    ours: dict[Any, Any] = {k: v for k, v in matplotlib.rcParamsDefault.items() if k != "backend"}
    with matplotlib.rc_context(ours | STYLE):
        yield


SYMBOLS = {  # symbols of the paper as texts have them, and as they are set
    "T_s": "T_s", "u_Qi": "u_{Qi}", "u_Qo": "u_{Qo}", "h_L": "h_L", "h_ML": "h_{ML}", "alpha_h": r"\alpha_h",
    "beta_h": r"\beta_h", "alpha_i": r"\alpha_i", "alpha_o": r"\alpha_o",
    "sigma_hD": r"\sigma_{hD}", "sigma_d": r"\sigma_d", "K_i": "K_i", "K_o": "K_o",
    "K_Q": "K_Q", "K_h": "K_h", "U'U": "U^T U",
}  # fmt: skip
SYMBOL = re.compile(
    r"(?<![\w$])(" + "|".join(map(re.escape, sorted(SYMBOLS, key=len)[::-1])) + r")(²?)(?!\w)"
)


def set_symbols(text: str) -> str:
    """A text with the paper's symbols as mathematics."""
    return SYMBOL.sub(lambda m: f"${SYMBOLS[m[1]]}{'^2' if m[2] else ''}$", text)


def _texts(artist: Artist) -> Iterator[Text]:
    """Texts in an artist, except those of ticks: drawing sets these, and to look for them makes ticks of
    hidden axes too."""
    if isinstance(artist, Text):
        yield artist
    for child in [artist.label] if isinstance(artist, Axis) else artist.get_children():
        yield from _texts(child)


class Picture(Figure):
    """A figure without pyplot's global state; a notebook displays it as the last value of a cell."""

    def draw(self, renderer: Any) -> None:
        """Draw with the paper's symbols as mathematics."""
        for one in _texts(self):
            if SYMBOL.search(words := one.get_text()) and "$" not in words:
                one.set_parse_math(True)
                one.set_text(set_symbols(words))
        super().draw(renderer)

    def _repr_png_(self) -> bytes:
        held = BytesIO()
        self.savefig(held, format="png")
        return held.getvalue()


def sheet(
    title: str,
    note: str,
    heights: Sequence[float] = (2.4,),
    widths: Sequence[float] = (1.0,),
    *,
    gap: tuple[float, float] = (0.65, 0.3),
    left: float = 0.68,
    right: float = 0.72,
    top: float = 0.82,
    bottom: float = 0.66,
    heading: float | None = None,
) -> tuple[Picture, list[Axes]]:
    """A figure with a title, a line of facts under it, and a grid of panels, which are returned row by row.

    `heights` of the rows, from the top, `gap` between columns and between rows, the margins, and `heading`,
    the left end of title and note (`left` by default), are in inches; `widths` are shares of what is left.
    """
    height = top + sum(heights) + gap[1] * (len(heights) - 1) + bottom
    figure = Picture(figsize=(WIDTH, height), dpi=DPI)
    FigureCanvasAgg(figure)
    x = (left if heading is None else heading) / WIDTH
    figure.text(x, 1 - 0.13 / height, title, va="top", fontsize=11, fontweight="bold")
    figure.text(x, 1 - 0.36 / height, shorten(note, NOTE), va="top", fontsize=8.5, color=GREY)
    unit = (WIDTH - left - right - gap[0] * (len(widths) - 1)) / sum(widths)
    panels, y = [], height - top
    for tall in heights:
        y -= tall
        x = left
        for wide in widths:
            panels.append(panel(figure, x, y, wide * unit, tall))
            x += wide * unit + gap[0]
        y -= gap[1]
    return figure, panels


def panel(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """A panel at a place of the figure given in inches."""
    w, h = (float(v) for v in figure.get_size_inches())
    return figure.add_axes((left / w, bottom / h, width / w, height / h))


def inches(ax: Axes) -> tuple[float, float]:
    """Width and height of a panel [inch]."""
    figure: Any = ax.get_figure(root=True)
    (w, h), box = figure.get_size_inches(), ax.get_position()
    return box.width * w, box.height * h


def heading(
    ax: Axes, text: str, *, at: float = 0.0, up: float = 4.0, right: float = 0.0, **look: Any
) -> None:
    """A line of text `up` points above a panel: from its left end (`at` = 0), or up to its right end (1)."""
    given: dict[str, Any] = {"fontsize": 8.5, "color": INK} | look
    ax.annotate(
        text, (at, 1), xycoords="axes fraction", xytext=(right, up), textcoords="offset points",
        ha="right" if at else "left", va="bottom", **given,
    )  # fmt: skip


def name_panel(ax: Axes, letter: str, words: str) -> None:
    """A letter and a few words above the left edge of a panel."""
    heading(ax, letter, up=5, fontweight="bold")
    heading(ax, words, up=5, right=13)


def message(ax: Axes, text: str) -> None:
    """Write in the middle of an empty panel why it is empty."""
    ax.text(
        0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=GREY, fontsize=11, wrap=True
    )


def marks(ax: Axes, x: Floats, y: Floats, label: str, size: float, **look: Any) -> None:
    """Plot marks of `size` points; in the legend they have the legend's own size."""
    given: dict[str, Any] = {"ls": "none", "markersize": size} | look
    ax.plot(x, y, **given)
    entry(ax, label, **{k: v for k, v in look.items() if k not in ("alpha", "zorder")})


def entry(ax: Axes, label: str, **look: Any) -> None:
    """Add an entry to the legend and nothing to the panel."""
    given: dict[str, Any] = {"ls": "none", "markersize": 4.5} | look
    ax.plot([], [], label=label, **given)


def entries(*panels: Axes) -> dict[str, Any]:
    """Legend entries of panels, one for each label; bars come first."""
    found: dict[str, Any] = {}
    for ax in panels:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    return dict(sorted(found.items(), key=lambda item: not isinstance(item[1], Container)))


def key(ax: Axes) -> None:
    """The legend of a panel in one line above it, outside the data."""
    if found := entries(ax):
        ax.legend(
            found.values(), found, loc="lower left", bbox_to_anchor=(0.0, 1.0 + 0.07 / inches(ax)[1]),
            ncols=len(found),
        )  # fmt: skip


def figure_key(panels: Sequence[Axes], *, down: float = 0.37, left: float | None = None) -> None:
    """One legend for several panels, `down` inches below the top: at their right end, or from `left` on."""
    figure: Any = panels[0].get_figure(root=True)
    found, (width, height) = entries(*panels), figure.get_size_inches()
    x = max(ax.get_position().x1 for ax in panels) if left is None else left / width
    figure.legend(
        found.values(), found, loc="upper right" if left is None else "upper left",
        bbox_to_anchor=(x, 1 - down / height), ncols=max(len(found), 1),
    )  # fmt: skip


def few_ticks(ax: Axes, which: str = "y", bins: int = 5) -> None:
    """Up to `bins` intervals of 1, 2 or 5 between the ticks of an axis, without an offset."""
    getattr(ax, f"{which}axis").set_major_locator(MaxNLocator(nbins=bins, steps=[1, 2, 5, 10]))
    ax.ticklabel_format(axis=which, useOffset=False)  # type: ignore[arg-type]


def lag_ticks(ax: Axes, low: float, high: float, bins: int = 8) -> None:
    """Whole samples on the y axis, from `low` to `high`."""
    ax.set_ylim(low, high)
    ax.yaxis.set_major_locator(MaxNLocator(nbins=bins, integer=True, steps=[1, 2, 5, 10]))


def second_axis(ax: Axes, sample_time: float, label: str) -> Axes:
    """A right-hand axis of times for one in samples; from two hours on, `label` has hours for "minutes"."""
    low, high = ax.get_ylim()
    unit, seconds = time_unit(high * sample_time)
    scale = sample_time / seconds
    other = ax.twinx()
    other.set_ylim(low * scale, high * scale)
    other.yaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 3, 5, 10]))
    other.set_ylabel(label.replace("minutes", unit), color=GREY)
    other.tick_params(axis="y", labelcolor=GREY)
    other.spines["right"].set_visible(True)
    for side in ("left", "bottom"):
        other.spines[side].set_visible(False)
    return other


def minutes_above(ax: Axes, sample_time: float) -> None:
    """Minutes along the top of a panel with samples on its x axis."""
    unit, seconds = time_unit(ax.get_xlim()[1] * sample_time)
    scale = sample_time / seconds
    there_and_back: Any = (lambda lag: lag * scale, lambda time: time / scale)
    other = ax.secondary_xaxis("top", functions=there_and_back)
    other.tick_params(labelcolor=GREY, color=GREY, length=3, pad=1)
    other.spines["top"].set_visible(False)
    ax.annotate(unit, (1, 1), xycoords="axes fraction", xytext=(5, 3), textcoords="offset points", color=GREY)


def power_of_ten(values: Floats) -> tuple[float, str]:
    """The factor for small values and the unit's factor for the label, so that no axis needs "1e-4"."""
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    if not 0 < largest < 0.1:
        return 1.0, ""
    power = int(np.floor(np.log10(largest)))
    return 10.0**-power, f"{ten_to(power)} "


# not strftime: the locale must not change the figures
MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
LETTER = 0.087  # width that a letter of a date label needs, with its share of the gap to the next [inch]
STRIP, STRIP_GAP = 0.11, 0.05  # height of the strip of days without an answer, and its gap [inch]


def date_ticks(
    first: dt.date, last: dt.date, width: float = 100.0
) -> tuple[list[float], list[float], list[str]]:
    """Places of lines, and places and texts of the labels that fit in `width` [inch], for `first` to `last`.

    A day is the unit interval around its ordinal number, so a missing day keeps its width. Up to 80 days the
    labels are under their days; beyond, months or years lie between lines. The year is under the first of its
    labels.
    """
    span = (last - first).days + 1
    step = 1 if span <= 900 else 12
    if span <= 80:
        every = next(s for s in (1, 2, 7, 14) if span <= 14 * s)
        days = [first + dt.timedelta(days=k) for k in range(0, span, every)]
        lines = places = [float(day.toordinal()) for day in days]
        names = [f"{day.day} {MONTHS[day.month - 1]}" for day in days]
    else:
        begin = first.year * 12 + (first.month - 1 if step == 1 else 0)
        months = range(begin, (last.year + 1) * 12 + 13, step)
        starts = [dt.date(m // 12, m % 12 + 1, 1) for m in months if m // 12 <= dt.MAXYEAR]
        starts = starts[: next(i for i, day in enumerate(starts) if day > last) + 1]
        if span > 5500:
            every = -(-span // 5500)
            days = [day for day in starts if day.year % every == 0 and first <= day <= last]
            lines = places = [day.toordinal() - 0.5 for day in days]
        else:
            low, high = first.toordinal() - 0.5, last.toordinal() + 0.5
            lines = [x for day in starts if low <= (x := day.toordinal() - 0.5) <= high]
            days, places = [], []
            for day, after in pairwise(starts):
                a, b = max(day.toordinal() - 0.5, low), min(after.toordinal() - 0.5, high)
                if b - a >= 0.028 * (high - low):  # a few days of a month are too narrow for its name
                    days.append(day)
                    places.append((a + b) / 2)
        names = [MONTHS[day.month - 1] if step == 1 else str(day.year) for day in days]
    longest = max([4, *map(len, names)])  # letters; a year has four
    every = -(-len(names) // max(int(width / (LETTER * longest)), 1))
    if len(lines) == len(places):
        lines = lines[::every]
    labels, year = [], 0
    for day, name in list(zip(days, names, strict=True))[::every]:
        labels.append(name if step == 12 or day.year == year else f"{name}\n{day.year}")
        year = day.year
    return lines, places[::every], labels


def date_axis(ax: Axes, first: dt.date, last: dt.date, *, labels: bool = True) -> None:
    """Days from `first` to `last` as the x axis, with as many labels as the panel's width allows."""
    lines, places, names = date_ticks(first, last, inches(ax)[0])
    ax.set_xlim(first.toordinal() - 0.5, last.toordinal() + 0.5)
    ax.xaxis.remove_overlapping_locs = False  # up to 80 days a label is at its line
    ax.set_xticks(lines, [""] * len(lines))
    ax.set_xticks(places, names, minor=True)
    ax.tick_params(axis="x", which="major", length=4, width=0.7)
    ax.tick_params(axis="x", which="minor", length=0, pad=6, labelbottom=labels)


def calendar(ax: Axes, dates: Sequence[dt.date], status: Sequence[str]) -> None:
    """Date axis of a panel and, where days have no answer, a strip and a legend under it that mark them."""
    first, last = dates[0], dates[-1]
    found = [name for name in NO_ANSWER if name in status]
    if not found:
        date_axis(ax, first, last)
        return
    figure: Any = ax.get_figure(root=True)
    box, inch = ax.get_position(), 1 / float(figure.get_size_inches()[1])
    lift = (STRIP + STRIP_GAP) * inch
    ax.set_position((box.x0, box.y0 + lift, box.width, box.height - lift))
    ax.set_xlim(first.toordinal() - 0.5, last.toordinal() + 0.5)
    ax.set_xticks([])
    strip = figure.add_axes((box.x0, box.y0, box.width, STRIP * inch))
    strip.set(ylim=(0, 1), yticks=[])
    strip.spines["left"].set_visible(False)
    date_axis(strip, first, last)
    days = (last - first).days + 1
    thick = min(max(72 * inches(ax)[0] / days, 1.4), 40.0)  # points; the thinnest line that remains visible
    x = day_numbers(dates)
    entry(strip, "days without an answer:", marker="")
    for name in found:
        at = x[[s == name for s in status]]
        # the gravest status is drawn last, over the others
        strip.vlines(
            at, 0, 1, colors=STATUS_COLOURS[name], linewidths=thick, zorder=2.9 - 0.1 * found.index(name)
        )
        entry(strip, f"{name} ({len(at):,})", marker="s", color=STATUS_COLOURS[name], markersize=5)
    shown = entries(strip)
    figure.legend(
        shown.values(), shown, loc="lower right", bbox_to_anchor=(box.x1, 0.09 * inch), ncols=len(shown)
    )


def save(figure: Figure, path: Path) -> None:
    """Write a PNG of at most 256 colours atomically, without dates or software names in it.

    The palette halves the size of the file. The method of maximum coverage changes no colour of these
    figures by more than 8 of 255; a median cut changes rare ones by up to 60. It is sought among the distinct
    colours of stretches of equal pixels: in a quarter of the time that all pixels take.
    """
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    with replacing(path) as scratch:
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(canvas.buffer_rgba()).view(np.uint32)[..., 0]  # type: ignore[no-untyped-call]
        flat = pixels.ravel()
        starts = np.flatnonzero(np.diff(flat, prepend=~flat[:1]))
        colours, of_stretch = np.unique(flat[starts], return_inverse=True)
        row = Image.frombytes("RGBA", (len(colours), 1), colours.tobytes()).convert("RGB")
        row = row.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
        index = np.repeat(np.asarray(row)[0][of_stretch], np.diff(starts, append=len(flat)))
        image = Image.fromarray(index.reshape(pixels.shape), "P")
        image.putpalette(row.getpalette() or ())
        image.save(scratch, "PNG")


def save_vector(figure: Figure, path: Path) -> None:
    """Write an SVG atomically; the same figure gives the same bytes."""
    # the ids inside an SVG are hashes with a salt, which is random by default
    salt: dict[Any, Any] = {"svg.hashsalt": path.stem, "svg.fonttype": "path"}
    with matplotlib.rc_context(salt), replacing(path) as scratch:
        figure.savefig(scratch, format="svg", dpi=VECTOR_DPI, metadata={"Date": None, "Creator": None})


def drop_old(folder: Path, kept: Sequence[FigureFile], kinds: Sequence[str]) -> None:
    """Remove figures of an earlier run: those with names that begin as `kinds` and are not `kept`."""
    names = {file.path.name for file in kept}
    for kind in kinds:
        for path in folder.glob(f"{kind}*.png"):
            if path.name not in names:
                path.unlink(missing_ok=True)


def written(
    figure: Figure, path: Path, title: str, *, kind: str | None = None, estimator: str = "", **facts: Any
) -> FigureFile:
    """Write a PNG; its kind is the name of the file by default, `facts` are those of its caption."""
    save(figure, path)
    width, height = figure.canvas.get_width_height()
    return FigureFile(kind or path.stem, estimator, path, title, facts, width, height)
