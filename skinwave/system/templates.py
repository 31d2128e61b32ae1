"""Templates of pages: those of Jinja in `skinwave/templates`, which escape all but `Markup`."""

import re
from functools import cache
from typing import Any

from markupsafe import Markup


def render(template: str, **values: object) -> str:
    """Render a template; values that are text are escaped."""
    shown: str = _templates().get_template(template).render(**values)
    return shown


def part(name: str, *values: object) -> Markup:
    """Apply a macro of `parts.html` to values; those that are text are escaped."""
    made: Markup = getattr(_templates().get_template("parts.html").module, name)(*values)
    return made


@cache
def _templates() -> Any:
    import jinja2

    found = jinja2.Environment(
        loader=jinja2.PackageLoader("skinwave"), autoescape=True, trim_blocks=True,
        lstrip_blocks=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    found.tests["a_number"] = lambda cell: re.sub("[,+.e-]", "", cell).isdigit()
    return found
