"""Thumbnails of the gallery: one part of a figure, without legend, with letters of 8 points.

The first picture of a script is its thumbnail, the second the figure itself.
"""

import pickle
from typing import Any

SIZE = (220, 154)  # CSS pixels of a thumbnail on a page, 96 to an inch
SHARPNESS = 2  # pixels of the picture to a CSS pixel
LETTERS = 8  # points


def scraper(block: Any, values: dict[str, Any], settings: dict[str, Any]) -> str:
    """Write the thumbnail of the figures of a block, then the figures."""
    import matplotlib.pyplot as plt
    from PIL import Image, ImageOps
    from pyvista.plotting.plotter import _ALL_PLOTTERS
    from pyvista.plotting.utilities.sphinx_gallery import Scraper
    from sphinx_gallery.scrapers import matplotlib_scraper

    names = values["image_path_iterator"]
    for figure in map(plt.figure, plt.get_fignums()):
        small = reduced(pickle.loads(pickle.dumps(figure)))
        small.savefig(next(names), dpi=96 * SHARPNESS)
        plt.close(small)
    for plotter in _ALL_PLOTTERS.values():
        image = Image.fromarray(plotter.last_image)
        image = image.crop((0, 0, 6 * image.width // 7, image.height))  # without the colour bar
        size = tuple(SHARPNESS * each for each in SIZE)
        ImageOps.pad(image, size, color="white").save(next(names))
    return matplotlib_scraper(block, values, settings) + Scraper()(block, values, settings)


def reduced(figure: Any) -> Any:
    """Return a figure with its last axes alone, without legend, annotations and colour bar."""
    from matplotlib.legend import Legend
    from matplotlib.text import Annotation, Text

    ax = [each for each in figure.axes if each.get_label() != "<colorbar>"][-1]
    for each in figure.axes:
        if each is not ax:
            each.remove()
    for each in ax.findobj(lambda artist: isinstance(artist, Legend | Annotation)):
        each.set_visible(False)
        each.set_in_layout(False)
    ax.set_subplotspec(figure.add_gridspec(1, 1)[0, 0])
    ax.set_anchor("C")
    ax.set_title(ax.get_ylabel(), loc="left")  # a long name does not fit beside the axes
    ax.set_ylabel("")
    for each in ax.findobj(Text):
        each.set_fontsize(LETTERS)
    figure.set_size_inches(*(each / 96 for each in SIZE))
    return figure
