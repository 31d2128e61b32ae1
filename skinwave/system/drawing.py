"""Drawing of records by functions of `skinwave.report`, which are imported when first called."""

from importlib import import_module
from typing import Any


def call_report(module: str, function: str, *values: Any) -> Any:
    """Call a function of a module of `skinwave.report`."""
    return getattr(import_module(f"skinwave.report.{module}"), function)(*values)
