"""Jinja templates of pages in `skinwave/templates`, which escape all text except `Markup`."""

import re
from functools import cache
from typing import Any

from markupsafe import Markup, escape

_OPTION = r"((?<![\w-])--[a-z][a-z-]*(?:[ =]-?\d+(?:[.:]\d+)*)?)"
_UNIT = "dB|%|°C|GiB|MiB|[cknµm]?m|[nµm]?s|[kMG]?Hz|[kMG]?Pa|N|rad|kg|times|degrees|inch"
# Symbols in escaped text, and their markup; lines do not break at the spaces U+00A0 and U+202F.
_SYMBOLS = {
    r"\b(\d+(?:\.\d+)?)e-0*(\d+)\b": "\\1\u00a0\u00d7\u00a010<sup>\u2212\\2</sup>",
    r"\b(\d+(?:\.\d+)?)e\+0*(\d+)\b": "\\1\u00a0\u00d7\u00a010<sup>\\2</sup>",
    r"(?<![\w.)/:=-])-(?=\.?\d|[xyz]\b)": "\u2212",
    r"(?<=\d) x (?=\d)": " \u00d7 ",
    r"(\([^ ()]+,) (?=[^ ()]+\))": "\\1\u00a0",
    r"\^2\b": "²",
    r"\^3\b": "³",
    r"\bum\b": "µm",
    r"\bnu\b": "\u03bd",
    rf"(?<=[\d>)]) (?=(?:{_UNIT})(?!\w))": "\u00a0",
    r"\bPa s\b": "Pa\u00a0s",
    r"(?<=f_d|_AM|AM2|f_e)-(?=\d* ?f_)": "\u202f\u2212\u202f",
    r"(?<=f_d|_AM|AM2|f_e)\+(?=\d* ?f_)": "\u202f+\u202f",
    r"\b(\d+|n) ?(?=f_(?:AM2?|[de])\b)": "\\1\u202f",
    r"\b([fc])_(AM2?|[deRps])\b": r"\1<sub>\2</sub>",
}


def render(template: str, **values: object) -> str:
    """Render a template; text is escaped."""
    shown: str = _templates().get_template(template).render(**values)
    return shown


def part(name: str, *values: object) -> Markup:
    """Apply a macro of `parts.html`; text is escaped."""
    made: Markup = getattr(_templates().get_template("parts.html").module, name)(*values)
    return made


def typeset(text: str) -> Markup:
    """Escape text, typeset its numbers and symbols, and mark options of commands as code.

    `Markup` stays the same.
    """
    if isinstance(text, Markup):
        return text
    # Every second piece is an option.
    pieces = re.split(_OPTION, str(escape(text)))
    for k, piece in enumerate(pieces):
        if k % 2:
            pieces[k] = f"<code>{piece}</code>"
            continue
        for symbol, written in _SYMBOLS.items():
            piece = re.sub(symbol, written, piece)
        pieces[k] = piece
    return Markup("".join(pieces))


@cache
def _templates() -> Any:
    import jinja2

    found = jinja2.Environment(
        loader=jinja2.PackageLoader("skinwave"), autoescape=True, trim_blocks=True,
        lstrip_blocks=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    found.filters["typeset"] = typeset
    return found
