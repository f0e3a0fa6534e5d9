"""Figures for tests: the saved ones, and whether their texts are readable."""

from contextlib import contextmanager
from unittest.mock import patch

from matplotlib.legend import Legend
from matplotlib.text import Text

from rivid.plots import style
from rivid.plots.files import FigureFile


@contextmanager
def saved(*, write=False):
    """Collect the figures that are saved inside, by the stem of the file; drawn only, or also written."""
    figures, save = {}, style.save

    def keep(figure, path):
        figures[path.stem] = figure
        if write:
            save(figure, path)
        else:
            figure.draw_without_rendering()  # the checks need the positions of texts, not the pixels

    with patch.object(style, "save", keep):
        yield figures


def as_file(path):
    """Return the record of a figure from `path`."""
    return FigureFile(path.stem, "", path, "", {}, 1, 1)


def labels(figure):
    """Return the labels of all legends of a figure, in order."""
    return [text.get_text() for one in figure.findobj(Legend) for text in one.get_texts()]


def check(figure, name):
    """Check that no text or legend is cut off, and that no tick labels of an axis overlap."""
    renderer, edge = figure.canvas.get_renderer(), figure.bbox
    texts = [t for t in figure.findobj(Text) if t.get_text().strip() and t.get_visible()]
    for ax in [*figure.axes, *(child for one in figure.axes for child in one.child_axes)]:
        for axis in (ax.xaxis, ax.yaxis):
            drawn = [label for label in axis.get_ticklabels(which="both") if label.get_text().strip()]
            ticks = [w for tick in axis._update_ticks() for w in (tick.label1, tick.label2)]
            shown = [w for w in ticks if w.get_visible() and w.get_text()]
            texts = [t for t in texts if t not in drawn or t in shown]
            boxes = [w.get_window_extent(renderer) for w in shown]
            for i, box in enumerate(boxes):
                assert not any(box.overlaps(other) for other in boxes[:i]), f"{name}: {shown[i]}"
    assert texts, name
    for one in [*texts, *figure.findobj(Legend)]:
        box = one.get_window_extent(renderer)
        where = f"{name}: {one} at {box.extents} in {edge.extents}"
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= edge.x1 and box.y1 <= edge.y1, where
    return [(t.get_window_extent(renderer), t.get_text()) for t in texts]
