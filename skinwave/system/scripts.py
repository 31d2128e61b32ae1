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
_NAME = re.compile(r"([\w$]+)(?:\s+as\s+([\w$]+))?")
# Imports and exports of other forms, and what would end the script of the page.
_REFUSED = re.compile(
    r'^(?:import\s*(?:[{*"\']|[\w$]+\s*(?:,|from\b))|export\b).*|\bimport\s*\(\s*["\'`].*'
    r"|\bimport\.meta\b.*|(?i:</script)|<!--",
    re.MULTILINE,
)


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
    """Join the module that begins a page, and all in its folder that it imports, into one script.

    Raises
    ------
    ValueError
        If a module is missing, imports what another does not export, takes part in a circle, or
        has an import or export of a form that is not known here.
    """
    texts: dict[str, str] = {}
    needed: dict[str, dict[str, set[str]]] = {entry: {}}  # names by module that each imports
    exported: dict[str, set[str]] = {}
    while missing := needed.keys() - texts.keys():
        name = min(missing)
        if not (folder / name).is_file():
            raise ValueError(f"there is no module {name}; correct the import")
        source = (folder / name).read_text(encoding="utf-8")
        for names, module in _IMPORT.findall(source):
            found = {part[0] for part in _NAME.findall(names)}
            needed[name][module] = needed[name].get(module, set()) | found
            needed.setdefault(module, {})
        exported[name] = {part[1] for part in _EXPORT.findall(source)}
        texts[name] = _as_function(name, source, exported[name])
    for name, imports in needed.items():
        for module, names in imports.items():
            if unknown := names - exported[module]:
                raise ValueError(f"{name} imports {min(unknown)}, which {module} does not export")
    try:
        return "\n".join(texts[name] for name in TopologicalSorter(needed).static_order())
    except CycleError as error:
        raise ValueError(f"modules import each other: {' -> '.join(error.args[1])}") from None


def _as_function(name: str, source: str, exports: set[str]) -> str:
    """A module as a constant: the result of a function that returns its exports."""

    def unpacked(found: re.Match[str]) -> str:
        pairs = (f"{own}: {other}" if other else own for own, other in _NAME.findall(found[1]))
        return f"const {{ {', '.join(pairs)} }} = {_variable(found[2])};"

    body = _EXPORT.sub(r"\1\2", _IMPORT.sub(unpacked, source))
    if found := _REFUSED.search(body):
        raise ValueError(
            f"{name}: '{found[0].strip()}' is refused; import and export by name at the beginning "
            "of a line, and split texts that end a script"
        )
    shown = ", ".join(sorted(exports))
    return f"const {_variable(name)} = (() => {{\n{body}\nreturn {{ {shown} }};\n}})();"


def _variable(name: str) -> str:
    """Name of the constant that holds a module's exports."""
    return "$" + re.sub(r"\W", "_", name.removesuffix(".js"))
