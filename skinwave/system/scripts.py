"""Scripts of pages: ES modules joined into one script, and data in a script element.

Each module becomes a function that returns its exports, in the order of their dependencies.
"""

import hashlib
import json
import re
from base64 import b64encode
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from importlib.resources.abc import Traversable
from typing import Any

_IMPORT = re.compile(r'^import\s*\{([^}]*)\}\s*from\s*"\./([\w-]+\.js)";[ \t]*$', re.MULTILINE)
_EXPORT = re.compile(
    r"^export\s+((?:async\s+)?function\s*\*?\s*|class\s+|const\s+)([\w$]+)", re.MULTILINE
)
_NAME = re.compile(r"([\w$]+)(?:\s+as\s+([\w$]+))?")


def digest(script: str) -> str:
    """Return the digest of a script as it is written in a content security policy."""
    return f"'sha256-{b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def json_for_script(data: Mapping[str, Any]) -> str:
    """Return data as JSON for a script element; raise a ValueError if a number is not finite."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def bundle(folder: Traversable, entry: str) -> str:
    """Join the entry module and all modules of its folder that it imports into one script.

    Raises a ValueError for a missing module or name, a cycle, or an unsupported form of import.
    """
    texts: dict[str, str] = {}
    needed: dict[str, dict[str, set[str]]] = {entry: {}}  # names by module that each imports
    exported: dict[str, set[str]] = {}
    while missing := needed.keys() - texts.keys():
        name = min(missing)
        if not (folder / name).is_file():
            raise ValueError(f"module {name} does not exist; correct the import")
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
    """Return a module as a constant: the result of a function that returns its exports."""

    def unpacked(found: re.Match[str]) -> str:
        pairs = (f"{own}: {other}" if other else own for own, other in _NAME.findall(found[1]))
        return f"const {{ {', '.join(pairs)} }} = {_variable(found[2])};"

    body = _EXPORT.sub(r"\1\2", _IMPORT.sub(unpacked, source))
    # Imports and exports of other forms, and text that ends the script of the page.
    refused = (
        r'^(?:import\s*(?:[{*"\']|[\w$]+\s*(?:,|from\b))|export\b).*|\bimport\s*\(\s*["\'`].*'
        r"|\bimport\.meta\b.*|(?i:</script)|<!--"
    )
    if found := re.search(refused, body, re.MULTILINE):
        raise ValueError(
            f"{name}: '{found[0].strip()}' is not supported; import and export by name "
            "at the start of a line, and split text that ends a script"
        )
    shown = ", ".join(sorted(exports))
    return f"const {_variable(name)} = (() => {{\n{body}\nreturn {{ {shown} }};\n}})();"


def _variable(name: str) -> str:
    """Return the name of the constant with a module's exports."""
    return "$" + re.sub(r"\W", "_", name.removesuffix(".js"))
