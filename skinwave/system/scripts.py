"""Scripts of pages: ES modules joined into one, and data that a script element holds.

The modules of a folder become one module script: each is a function that returns what it exports,
in the order in which they need each other.
"""

import json
import re
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from importlib.resources.abc import Traversable
from typing import Any

_IMPORT = re.compile(r'^import\s*\{([^}]*)\}\s*from\s*"\./([\w-]+\.js)";[ \t]*$', re.MULTILINE)
_EXPORT = re.compile(
    r"^export\s+((?:async\s+)?function\s*\*?\s*|class\s+|const\s+)([\w$]+)", re.MULTILINE
)
_REFUSED = re.compile(
    r'^(?:import\s*(?:[{*"\']|[\w$]+\s*(?:,|from\b))|export\b).*|\bimport\s*\(\s*["\'`].*'
    r"|\bimport\.meta\b.*",
    re.MULTILINE,
)
_PAIR = re.compile(r"([\w$]+)(?:\s+as\s+([\w$]+))?")
_CLOSING = re.compile(r"</script|<!--", re.IGNORECASE)


def encoded(data: Mapping[str, Any]) -> str:
    """Return data as JSON that cannot end the script element around it.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    text = json.dumps(data, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def bundle(folder: Traversable, entry: str) -> str:
    """Join a module and all that it imports into the text of one module script.

    Parameters
    ----------
    folder : with the modules
    entry : name of the module that begins the page

    Returns
    -------
    str

    Raises
    ------
    ValueError
        If a module is missing, imports what another does not export, takes part in a circle, or
        has an import or export of a form that is not known here.
    """
    parts: dict[str, _Module] = {}
    waiting = [entry]
    while waiting:
        name = waiting.pop()
        if name in parts:
            continue
        file = folder / name
        if not file.is_file():
            raise ValueError(f"there is no module {name}; correct the import")
        parts[name] = _Module(name, file.read_text(encoding="utf-8"))
        waiting += parts[name].imports
    for part in parts.values():
        for source, names in part.imports.items():
            if missing := names - parts[source].exports:
                raise ValueError(f"{source} does not export {', '.join(sorted(missing))}, which "
                                 f"{part.name} imports")  # fmt: skip
    order = TopologicalSorter({name: part.imports.keys() for name, part in parts.items()})
    try:
        return "\n".join(parts[name].text for name in order.static_order())
    except CycleError as error:
        raise ValueError(f"modules import each other: {' -> '.join(error.args[1])}") from None


class _Module:
    """A module as a function: `imports` (names by module), `exports` (names) and its `text`."""

    def __init__(self, name: str, source: str) -> None:
        self.name = name
        self.imports: dict[str, set[str]] = {}
        self.exports: set[str] = set()
        body = _EXPORT.sub(self._exported, _IMPORT.sub(self._imported, source))
        if found := _REFUSED.search(body):
            raise ValueError(f"{name}: '{found[0].strip()}' is not understood; write import "
                             '{ a } from "./b.js"; or export function, class or const')  # fmt: skip
        if found := _CLOSING.search(body):
            raise ValueError(f"{name}: '{found[0]}' would end the script of the page; split it")
        shown = ", ".join(sorted(self.exports))
        self.text = f"const {_variable(name)} = (() => {{\n{body}\nreturn {{ {shown} }};\n}})();"

    def _imported(self, found: re.Match[str]) -> str:
        pairs = []
        for part in filter(None, (part.strip() for part in found[1].split(","))):
            pair = _PAIR.fullmatch(part)
            if pair is None:
                raise ValueError(f"{self.name}: import of '{part}' is not understood")
            self.imports.setdefault(found[2], set()).add(pair[1])
            pairs.append(f"{pair[1]}: {pair[2]}" if pair[2] else pair[1])
        return f"const {{ {', '.join(pairs)} }} = {_variable(found[2])};"

    def _exported(self, found: re.Match[str]) -> str:
        if found[2] in self.exports:
            raise ValueError(f"{self.name} exports {found[2]} twice")
        self.exports.add(found[2])
        return f"{found[1]}{found[2]}"


def _variable(name: str) -> str:
    """Name of the constant that holds a module's exports."""
    return "$" + re.sub(r"\W", "_", name.removesuffix(".js"))
