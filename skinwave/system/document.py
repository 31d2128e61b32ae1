"""Parts of a page: one HTML file with its pictures inside.

Templates are those of Jinja in `templates/`, which escape text wherever it enters a page; only
`Markup` is taken as it is. It is made of templates and literals alone: see its `format` and `join`.
"""

import hashlib
import re
from base64 import b64encode
from collections.abc import Iterable
from functools import cache
from html import unescape
from typing import Any

from markupsafe import Markup

from simple_model import Effort

# What a page may load: pictures inside it and its own styles. No network, form or script but those
# of a page within it, by their digests: it inherits this policy.
POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)
_INNER = re.compile(r'<iframe [^>"]*"allow-scripts"[^>]* srcdoc="([^"]*)"')
_SCRIPT = re.compile(r"<script\b[^>]*>(.*?)</script\s*>", re.DOTALL | re.IGNORECASE)
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def page(title: str, *parts: str) -> str:
    """A complete page with its policy; parts that are text are escaped."""
    body = Markup("\n").join(parts)
    return render("page.html", title=title, body=body, policy=_policy(body))


def render(template: str, **values: object) -> str:
    """Render a template of `templates/`; values that are text are escaped."""
    shown: str = _templates().get_template(template).render(**values)
    return shown


def section(heading: str, *parts: str) -> Markup:
    """A headed part of the page."""
    return _part("section", heading, parts)


def paragraph(text: str) -> Markup:
    """A paragraph."""
    return Markup("<p>{}</p>").format(text)


def live_link(file: str) -> Markup:
    """A paragraph that leads to a live page beside this one."""
    return Markup(
        '<p><a href="{}">Change the Tacton and see the waves move</a>: a page that computes in the '
        "browser.</p>"
    ).format(file)


def preformatted(text: str) -> Markup:
    """Text with its own lines and spaces."""
    return Markup("<pre>{}</pre>").format(text)


def warnings_banner(efforts: Iterable[tuple[str, Effort]]) -> Markup:
    """All warnings of some responses by name, for the top of a page; nothing if there are none."""
    return _part("warnings", worst_warnings(efforts))


def picture(drawn: bytes, caption: str, name: str = "", kind: str = "png") -> Markup:
    """A picture inside the page: PNG, or another kind that browsers know."""
    return _part("picture", b64encode(drawn).decode(), caption, name, kind)


def inner_page(page: str, caption: str) -> Markup:
    """A page within the page, on screens only; its scripts reach nothing outside of it."""
    return _part("inner_page", str(page), caption)


def table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> Markup:
    """A table; cells that read as numbers are set to the right."""
    return _part("table", header, rows)


def worst_warnings(efforts: Iterable[tuple[str, Effort]]) -> list[str]:
    """Warnings of some responses with their names; of those that differ by numbers only, the one
    with the largest, and how many more there are.
    """
    alike: dict[str, list[tuple[str, str]]] = {}
    for name, effort in efforts:
        for sentence in effort.warnings:
            alike.setdefault(_NUMBER.sub("#", sentence), []).append((name, sentence))
    found = []
    for group in alike.values():
        name, sentence = max(group, key=lambda one: [float(x) for x in _NUMBER.findall(one[1])])
        of = f"{name}, and {len(group) - 1} more" if len(group) > 1 else name
        found.append(f"{sentence} ({of})" if name else sentence)
    return found


@cache
def _templates() -> Any:
    import jinja2

    found = jinja2.Environment(
        loader=jinja2.PackageLoader("skinwave"), autoescape=True, trim_blocks=True,
        lstrip_blocks=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    found.tests["a_number"] = _is_number
    return found


def _part(name: str, *values: object) -> Markup:
    """A macro of the template of parts, applied to values."""
    made: Markup = getattr(_templates().get_template("parts.html").module, name)(*values)
    return made


def _is_number(cell: str) -> bool:
    return re.sub("[,+.e-]", "", cell).isdigit()


def _policy(body: Markup) -> str:
    """The policy of a page; escaped text has no quotes, so that what is found is an inner page."""
    inner = (unescape(found) for found in _INNER.findall(body))
    scripts = [script for page in inner for script in _SCRIPT.findall(page)]
    if not scripts:
        return POLICY
    digests = (b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
    return f"{POLICY}; script-src " + " ".join(f"'sha256-{digest}'" for digest in digests)
