"""Drawing of records, by functions of `skinwave.report` that are imported when first called.

Records are below the room of drawing and import none of it.
"""

from importlib import import_module
from typing import Any


def drawn(module: str, function: str, *values: Any) -> Any:
    """Call a function of a module of `skinwave.report`."""
    return getattr(import_module(f"skinwave.report.{module}"), function)(*values)
