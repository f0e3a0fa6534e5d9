"""Draw the reliability diagram: frequency of true delays against their probability."""

from pathlib import Path

from benchmarks.posterior.accuracy import Bin
from benchmarks.posterior.score import wilson
from rivid.plots.style import ACCENT, GREY, INK, WATER, entry, key, save, sheet, styled


def draw(lines: dict[str, list[Bin]], path: Path, title: str, note: str) -> None:
    """Draw a series of points with 95 % intervals for each group of worlds."""
    colours = [WATER, ACCENT, INK]
    with styled():
        figure, (ax,) = sheet(title, note, [3.12])
        ax.plot([0, 1], [0, 1], color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
        for k, (name, bins) in enumerate(lines.items()):
            colour, aside = colours[k], 0.006 * (k - 0.5)
            for b in bins:
                low, high = wilson(b.true, b.n)
                ax.plot([b.stated + aside] * 2, [low, high], color=colour, linewidth=1.0, alpha=0.6)
                ax.plot(b.stated + aside, b.true / b.n, "o", color=colour, markersize=4.5)
            entry(ax, name, marker="o", color=colour)
        ax.set_xlim(-0.02, 1.02)
        ax.set_ylim(-0.02, 1.02)
        ax.grid(True)
        ax.set_xlabel("probability given to a delay")
        ax.set_ylabel("share of days on which it was the true one")
        key(ax)
        save(figure, path)
