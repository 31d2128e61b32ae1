"""Links from pages of docs/ to what lies beside docs/, which a site has other places for."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
PAGES = {  # of the repository -> of the site
    "bench": "reference/benchmarks",
    "bench/README.md": "reference/benchmarks",
    "examples": "reference/scenes-shipped",
    "CONTRIBUTING.md": "contributing",
    "CHANGELOG.md": "changelog",
    "README.md": "index",
    "examples/gallery": "gallery/index",
}
GALLERY = Path("examples/gallery")  # whose scripts are pages
LINK = re.compile(r"\[([^\]\[]*)\]\(([^)#\s]+)((?:#[^)]*)?)\)")


def _mended(folder: Path, match: re.Match[str]) -> str:
    """A Markdown link as it stands, to a page of the site, or without a link to a folder."""
    text, target, anchor = match.groups()
    if "://" in target:
        return match.group()
    place = (folder / target).resolve()
    try:
        own = place.relative_to(ROOT)
    except ValueError:  # beyond the repository
        return match.group()
    page = PAGES.get(str(own), f"gallery/{own.stem}" if own.parent == GALLERY else "")
    if page:
        return f"[{text}]({os.path.relpath(ROOT / 'docs' / page, folder)}{anchor})"
    return text if place.is_dir() else match.group()


def mended(text: str, folder: Path) -> str:
    """The text of a page in a folder, with links that the site has."""
    return LINK.sub(lambda match: _mended(folder, match), text)


def read(app: "Sphinx", page: str, source: list[str]) -> None:
    """Mend the source of a page when Sphinx has read it."""
    if app.env.doc2path(page).suffix == ".md":
        source[0] = mended(source[0], (ROOT / "docs" / page).parent)


def setup(app: "Sphinx") -> dict[str, bool]:
    """Register the reader."""
    app.connect("source-read", read, priority=600)  # after pages from the code
    return {"parallel_read_safe": True}
