"""Reliability diagram: what was said beside how often it was true."""

from pathlib import Path

from benchmarks.posterior.accuracy import Bin
from benchmarks.posterior.score import wilson
from rivid.plots.style import ACCENT, GREY, INK, WATER, dot, key, save, sheet, styled


def draw(lines: dict[str, list[Bin]], path: Path, title: str, note: str) -> None:
    """One line of dots with 95 % intervals for each group of worlds."""
    colours = [WATER, ACCENT, INK]
    with styled():
        page = sheet(title, note, height=4.6)
        page.axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
        handles = []
        for k, (name, bins) in enumerate(lines.items()):
            colour, aside = colours[k], 0.006 * (k - 0.5)
            for b in bins:
                low, high = wilson(b.true, b.n)
                page.axes.plot([b.said + aside] * 2, [low, high], color=colour, linewidth=1.0, alpha=0.6)
                page.axes.plot(b.said + aside, b.true / b.n, "o", color=colour, markersize=4.5)
            handles.append(dot(name, marker="o", color=colour, markersize=4.5))
        page.axes.set_xlim(-0.02, 1.02)
        page.axes.set_ylim(-0.02, 1.02)
        page.axes.grid(True)
        page.axes.set_xlabel("probability given to a delay")
        page.axes.set_ylabel("share of days on which it was the true one")
        key(page, handles)
        save(page.figure, path)
