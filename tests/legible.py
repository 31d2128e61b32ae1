"""Text of a figure: what is cut or drawn over other text, and the sizes of its letters."""

from itertools import combinations

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

TOUCHING = 0.5  # pixels


def texts(figure):
    """Texts that are drawn, and the box of each in pixels."""
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    hidden = set()
    for ax in figure.findobj(Axes):
        for axis in (ax.xaxis, ax.yaxis):
            drawn = axis._update_ticks()  # labels beyond the limits of an axis are not
            every = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            hidden |= {x for t in every if t not in drawn for x in (t.label1, t.label2)}
    return [
        (text, text.get_window_extent(canvas.get_renderer()))
        for text in figure.findobj(Text)
        if text.get_text().strip() and text.get_visible() and text not in hidden
    ]


def illegible(figure):
    """Texts that leave the canvas, and pairs of texts that overlap."""
    found, canvas = texts(figure), figure.bbox
    cut = [
        text.get_text()
        for text, box in found
        if min(box.x0 - canvas.x0, box.y0 - canvas.y0) < -TOUCHING
        or max(box.x1 - canvas.x1, box.y1 - canvas.y1) > TOUCHING
    ]
    return cut + [
        (one.get_text(), other.get_text())
        for (one, a), (other, b) in combinations(found, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > TOUCHING
        and min(a.y1, b.y1) - max(a.y0, b.y0) > TOUCHING
    ]


def sizes(figure):
    return {text.get_fontsize() for text, _ in texts(figure)}
