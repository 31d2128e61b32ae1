"""Parts of a page: one HTML file with its pictures inside."""

import re
from base64 import b64encode
from collections.abc import Iterable
from html import escape
from string import Template

from simple_model import Effort

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>$title</title>
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


def page(title: str, *parts: str) -> str:
    """A complete page of parts that are HTML already."""
    return _PAGE.substitute(title=escape(title), body="\n".join(parts))


def section(heading: str, *parts: str) -> str:
    """A headed part of the page."""
    return f"<h2>{escape(heading)}</h2>\n" + "\n".join(parts)


def paragraph(text: str) -> str:
    """Plain text as a paragraph."""
    return f"<p>{escape(text)}</p>"


def warnings_banner(efforts: Iterable[tuple[str, Effort]]) -> str:
    """All warnings of some answers by name, for the top of a page; nothing if there are none."""
    shown = "".join(paragraph(f"Take care: {text}.") for text in worst_warnings(efforts))
    return f'<div class="warning" role="note">{shown}</div>' if shown else ""


def worst_warnings(efforts: Iterable[tuple[str, Effort]]) -> list[str]:
    """The warnings of some answers with their names; of those that differ by numbers only, the one
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


def picture(drawn: bytes, caption: str, name: str = "", kind: str = "png") -> str:
    """A picture inside the page: PNG, or another kind that browsers know."""
    return (
        f'<figure id="{escape(name)}"><img alt="{escape(caption)}" '
        f'src="data:image/{kind};base64,{b64encode(drawn).decode()}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def inner_page(page: str, caption: str) -> str:
    """A page within the page, on screens only."""
    frame = f'<iframe title="{escape(caption)}" srcdoc="{escape(page)}"></iframe>'
    return f'<figure class="screen">{frame}<figcaption>{escape(caption)}</figcaption></figure>'


def table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table; cells that read as numbers are set to the right."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def _cell(cell: str) -> str:
    if cell.startswith("<"):
        return f"<td>{cell}</td>"
    number = cell.replace(",", "").replace("+", "").replace("-", "").replace(".", "")
    kind = ' class="number"' if number.replace("e", "").isdigit() else ""
    return f"<td{kind}>{escape(cell)}</td>"
