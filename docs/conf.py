"""Settings of the documentation site for Sphinx. `.ci/docs` builds it."""

import os
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "extension")]
os.environ.setdefault("MPLBACKEND", "Agg")

import pyvista  # noqa: E402
from pygments.lexers.special import TextLexer  # noqa: E402
from sphinx.highlighting import lexers  # noqa: E402

lexers["csv"] = TextLexer()

pyvista.OFF_SCREEN = True
pyvista.BUILDING_GALLERY = True

project = "skinwave"
author = "the authors of skinwave"
copyright = author  # noqa: A001
release = version = tomllib.loads((HERE.parent / "pyproject.toml").read_text())["project"][
    "version"
]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "mathml",  # formulas without a script
    "generated",  # pages from the code, and links to files outside docs/
    "docstrings",  # numpydoc style
    "outputs",  # what blocks of code print and draw
    "live_page",  # the page that computes
]
exclude_patterns = ["_build", "extension", "gallery/*.py", "sg_execution_times.rst",
                    "gallery/sg_execution_times.rst"]  # fmt: skip
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
suppress_warnings = ["config.cache"]  # functions in the settings of the gallery

nitpicky = True  # checks pages and labels; types of annotations are left out below
nitpick_ignore_regex = [(r"py:.*", r".*")]
default_role = "code"
highlight_language = "none"  # for formulas in docstrings; code blocks name their language

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # docstrings have shapes and units
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_preprocess_types = False
napoleon_attr_annotations = False
python_use_unqualified_type_names = True

sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "filename_pattern": r".*\.py$",
    "image_scrapers": ("thumbnails.scraper",),
    "thumbnail_size": (440, 308),
    "abort_on_example_error": True,
    "download_all_examples": False,
    "within_subsection_order": "FileNameSortKey",
    "show_signature": False,
    "show_memory": False,
    "capture_repr": (),
    "min_reported_time": 10_000,
    "remove_config_comments": True,
    "notebook_extensions": set(),
    "copyfile_regex": r".*\.csv$",
    "default_thumb_file": str(HERE / "overview.png"),
}

html_theme = "furo"
html_title = f"skinwave {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_show_sphinx = False
html_copy_source = False
pygments_style = "a11y-high-contrast-light"
pygments_dark_style = "a11y-high-contrast-dark"
html_theme_options = {"navigation_with_keys": True}
