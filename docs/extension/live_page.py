"""The live page on the home page of the site, with the skin slab and the paper sheet."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

PAGE = "waves.html"
BODIES = ("skin-slab", "paper-sheet")


def write(app: "Sphinx", exception: Exception | None) -> None:
    """Write the page."""
    if exception is None and app.builder.format == "html":
        from skinwave.live.html_file import data_of, page

        (Path(app.outdir) / PAGE).write_text(page(data_of(bodies=BODIES)), "utf-8")


def setup(app: "Sphinx") -> dict[str, bool]:
    """Register the writer."""
    app.connect("build-finished", write)
    return {"parallel_read_safe": True}
