"""Jinja templates of pages in `skinwave/templates`, which escape all text except `Markup`."""

import re
from functools import cache
from typing import Any

from markupsafe import Markup, escape

NARROW, FIXED, MINUS = "\u202f", "\u00a0", "\u2212"  # spaces without a line break; minus sign
TIMES = f"{FIXED}\u00d7{FIXED}"
_UNITS = "dB|%|°C|GiB|MiB|[cknµm]?m|[nµm]?s|[kMG]?Hz|[kMG]?Pa|N|rad|kg|times|degrees|inch"
_OPTION = re.compile(r"((?<![\w-])--[a-z][a-z-]*(?:[ =]-?\d+(?:[.:]\d+)*)?)")
# Symbols in escaped text, and their markup.
_SYMBOLS = [
    (re.compile(symbol), written)
    for symbol, written in (
        (r"\b(\d+(?:\.\d+)?)e-0*(\d+)\b", rf"\1{TIMES}10<sup>{MINUS}\2</sup>"),
        (r"\b(\d+(?:\.\d+)?)e\+0*(\d+)\b", rf"\1{TIMES}10<sup>\2</sup>"),
        (r"(?<![\w.)/:=-])-(?=\.?\d|[xyz]\b)", MINUS),
        (r"(?<=\d) x (?=\d)", " \u00d7 "),
        (r"(\([^ ()]+,) (?=[^ ()]+\))", rf"\1{FIXED}"),
        (r"\^2\b", "²"),
        (r"\^3\b", "³"),
        (r"\bum\b", "µm"),
        (r"\bnu\b", "\u03bd"),
        (rf"(?<=[\d>)]) (?=(?:{_UNITS})(?!\w))", FIXED),
        (r"\bPa s\b", f"Pa{FIXED}s"),
        (r"(?<=f_d|_AM|AM2|f_e)-(?=\d* ?f_)", f"{NARROW}{MINUS}{NARROW}"),
        (r"(?<=f_d|_AM|AM2|f_e)\+(?=\d* ?f_)", f"{NARROW}+{NARROW}"),
        (r"\b(\d+|n) ?(?=f_(?:AM2?|[de])\b)", rf"\1{NARROW}"),
        (r"\b([fc])_(AM2?|[deRps])\b", r"\1<sub>\2</sub>"),
    )
]


def render(template: str, **values: object) -> str:
    """Render a template; text is escaped."""
    shown: str = _templates().get_template(template).render(**values)
    return shown


def part(name: str, *values: object) -> Markup:
    """Apply a macro of `parts.html`; text is escaped."""
    made: Markup = getattr(_templates().get_template("parts.html").module, name)(*values)
    return made


def typeset(text: str) -> Markup:
    """Escape text and typeset its numbers and symbols, and options of commands as code; `Markup`
    stays the same.
    """
    if isinstance(text, Markup):
        return text
    # Every second piece is an option.
    pieces = _OPTION.split(str(escape(text)))
    pieces[1::2] = [f"<code>{option}</code>" for option in pieces[1::2]]
    pieces[::2] = map(_with_symbols, pieces[::2])
    return Markup("".join(pieces))


def _with_symbols(text: str) -> str:
    for symbol, written in _SYMBOLS:
        text = symbol.sub(written, text)
    return text


@cache
def _templates() -> Any:
    import jinja2

    found = jinja2.Environment(
        loader=jinja2.PackageLoader("skinwave"), autoescape=True, trim_blocks=True,
        lstrip_blocks=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    found.filters["typeset"] = typeset
    return found
