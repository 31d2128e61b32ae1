"""Docstrings in numpydoc style: `points : (n, 2) float, metre` gives a meaning, not a type.

Indented formulas and code become literal blocks. Characters that reStructuredText would take for
markup are escaped.
"""

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ENTRY = re.compile(r"^(\*{0,2}\w+(?:, \w+)*) : (.*)$")
MARKUP = re.compile(r"(`[^`]*`)|(\|)|(?<=\w)(_)(?=\W|$)|(\*)")
RULE = re.compile(r"^-{3,}$")


def _plain(line: str) -> str:
    """Return a line in which only backticks are markup."""
    return MARKUP.sub(lambda m: m.group(1) or "\\" + m.group(0), line)


def rewrite(lines: list[str]) -> list[str]:
    """Return the lines of a docstring for napoleon."""
    out: list[str] = []
    in_sections = literal = False
    for line in lines:
        in_sections = in_sections or bool(RULE.match(line))
        indented = line.startswith("    ") and not in_sections
        if indented and not literal and (not out or not out[-1].strip()):
            out += ["::", ""]
            literal = True
        literal = literal and (indented or not line.strip())
        if literal or RULE.match(line):
            out.append(line)
        elif in_sections and (entry := ENTRY.match(line)):
            out += [entry.group(1), f"    {_plain(entry.group(2))}"]
        else:
            out.append(_plain(line))
    return out


def process(app: "Sphinx", what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Rewrite a docstring in place."""
    lines[:] = rewrite(lines)
    if what == "property":  # napoleon reads its first line as "type: meaning"
        lines.insert(0, "")


def setup(app: "Sphinx") -> dict[str, bool]:
    """Register the rewriting, which runs before napoleon."""
    app.connect("autodoc-process-docstring", process, priority=400)
    return {"parallel_read_safe": True}
