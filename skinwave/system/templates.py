"""Jinja templates of pages in `skinwave/templates`, which escape all text except `Markup`."""

import re
from functools import cache
from typing import Any

from markupsafe import Markup, escape

# Symbols in text, and their markup.
_SYMBOLS = (
    (r"\b(\d*[fc])_(AM2?|[deRps])\b", r"\1<sub>\2</sub>"),
    (r"(?<=\d) x (?=\d)", " \u00d7 "),
    (r"\^2\b", "²"),
)


def render(template: str, **values: object) -> str:
    """Render a template; text is escaped."""
    shown: str = _templates().get_template(template).render(**values)
    return shown


def part(name: str, *values: object) -> Markup:
    """Apply a macro of `parts.html`; text is escaped."""
    made: Markup = getattr(_templates().get_template("parts.html").module, name)(*values)
    return made


def typeset(text: str) -> Markup:
    """Escape text and typeset its symbols; `Markup` stays the same."""
    if isinstance(text, Markup):
        return text
    made = str(escape(text))
    for symbol, written in _SYMBOLS:
        made = re.sub(symbol, written, made)
    return Markup(made)


@cache
def _templates() -> Any:
    import jinja2

    found = jinja2.Environment(
        loader=jinja2.PackageLoader("skinwave"), autoescape=True, trim_blocks=True,
        lstrip_blocks=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    found.tests["a_number"] = lambda cell: re.sub("[,+.e-]", "", cell).isdigit()
    found.filters["typeset"] = typeset
    return found
