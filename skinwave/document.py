"""Parts of a page: one HTML file with its pictures inside.

Text is escaped wherever it enters a page; only `Html`, which is made here, is taken as it is.
"""

import hashlib
import re
from base64 import b64encode
from collections.abc import Iterable
from html import escape, unescape
from string import Template

from simple_model import Effort

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="$policy"><title>$title</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<style>
body { font: 16px/1.5 system-ui, sans-serif; max-width: 1120px; margin: 2em auto; padding: 0 1em;
       color: #222; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2em; }
img { max-width: 100%; height: auto; } figure { margin: 1em 0 2em; }
figcaption { color: #555; font-size: 0.9em; }
table { border-collapse: collapse; font-size: 0.88em; } .wide { overflow-x: auto; }
td, th { border-bottom: 1px solid #ddd; padding: 0.3em 0.6em; text-align: left;
         vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.yes { color: #00684c; font-weight: 600; } .no { color: #a33c00; font-weight: 600; }
.warning { border-left: 4px solid #a33c00; background: #fdf2ea; padding: 0.1em 1em; }
small { color: #555; } code { background: #f3f3f3; padding: 0 0.25em; }
iframe { border: 1px solid #ddd; width: 100%; height: 30em; } pre { white-space: pre-wrap; }
@page { size: A4; margin: 14mm; }
@media print { body { margin: 0; padding: 0; max-width: none; font-size: 11px; }
  figure, tr, pre, .warning { break-inside: avoid; } h2, h3 { break-after: avoid; }
  .screen { display: none; }
  details::details-content { content-visibility: visible; }
  .wide { overflow: visible; } table { font-size: 9px; width: 100%; } }
</style></head><body>
<h1>$title</h1>
$body
</body></html>
""")


# What a page may load: pictures inside it and its own styles. No network, form or script but those
# of a page within it, by their digests: it inherits this policy.
POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)
_INNER = re.compile(r'<iframe [^>"]*"allow-scripts"[^>]* srcdoc="([^"]*)"')
_SCRIPT = re.compile(r"<script\b[^>]*>(.*?)</script\s*>", re.DOTALL | re.IGNORECASE)


class Html(str):
    """HTML, as against text. What operations of `str` make of it is text again, so that a part
    that was put together without `markup` or `joined` is shown with its tags, and never obeyed.
    """

    __slots__ = ()


def markup(template: str, *values: str) -> Html:
    """The template with values in the place of its {}; those that are text are escaped."""
    return Html(template.format(*map(escaped, values)))


def joined(parts: Iterable[str], between: str = "\n") -> Html:
    """Parts one after another; those that are text are escaped."""
    return Html(between.join(map(escaped, parts)))


def escaped(part: str) -> Html:
    """HTML as it is, text escaped."""
    return part if isinstance(part, Html) else Html(escape(part))


def page(title: str, *parts: str) -> str:
    """A complete page with its policy; parts that are text are escaped."""
    body = joined(parts)
    return _PAGE.substitute(policy=_policy(body), title=escape(title), body=body)


def _policy(body: Html) -> str:
    """The policy of a page; escaped text has no quotes, so that what is found is an inner page."""
    inner = (unescape(found) for found in _INNER.findall(body))
    scripts = [script for page in inner for script in _SCRIPT.findall(page)]
    if not scripts:
        return POLICY
    digests = (b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
    return f"{POLICY}; script-src " + " ".join(f"'sha256-{digest}'" for digest in digests)


def section(heading: str, *parts: str) -> Html:
    """A headed part of the page."""
    return joined([markup("<h2>{}</h2>", heading), *parts])


def paragraph(text: str) -> Html:
    """A paragraph."""
    return markup("<p>{}</p>", text)


def warnings_banner(efforts: Iterable[tuple[str, Effort]]) -> Html:
    """All warnings of some responses by name, for the top of a page; nothing if there are none."""
    shown = joined((paragraph(f"Take care: {text}.") for text in worst_warnings(efforts)), "")
    return markup('<div class="warning" role="note">{}</div>', shown) if shown else Html()


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


_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def picture(drawn: bytes, caption: str, name: str = "", kind: str = "png") -> Html:
    """A picture inside the page: PNG, or another kind that browsers know."""
    return markup(
        '<figure id="{}"><img alt="{}" src="data:image/{};base64,{}">'
        "<figcaption>{}</figcaption></figure>",
        name, caption, kind, b64encode(drawn).decode(), caption,
    )  # fmt: skip


def inner_page(page: str, caption: str) -> Html:
    """A page within the page, on screens only; its scripts reach nothing outside of it."""
    return markup(
        '<figure class="screen"><iframe sandbox="allow-scripts" title="{}" srcdoc="{}"></iframe>'
        "<figcaption>{}</figcaption></figure>",
        caption, str(page), caption,
    )  # fmt: skip


def table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> Html:
    """A table; cells that read as numbers are set to the right."""
    head = joined((markup("<th>{}</th>", cell) for cell in header), "")
    body = joined((markup("<tr>{}</tr>", joined(map(_cell, row), "")) for row in rows), "")
    return markup('<div class="wide"><table><tr>{}</tr>{}</table></div>', head, body)


def _cell(cell: str) -> Html:
    number = cell.replace(",", "").replace("+", "").replace("-", "").replace(".", "")
    is_number = number.replace("e", "").isdigit()
    return markup('<td class="number">{}</td>' if is_number else "<td>{}</td>", cell)
